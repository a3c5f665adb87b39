//! Reads a `printer.cfg` from the disk and says what was found in it.

use std::{fs::File, io::Read, path::Path};

use anyhow::Context;
use printer::{
    config::{self, CONFIG_BYTES_MAX, ConfigDiagnostic, PrinterConfig, Severity},
    error::{ErrorCode, PrinterError},
};

use crate::console;

/// The most errors that are put into one message.
const ERRORS_SHOWN_MAX: usize = 5;

/// The machine that a file describes. Warnings go to stderr; errors end the job.
pub(crate) fn load(path: &Path) -> anyhow::Result<PrinterConfig> {
    let text = read(path)?;
    let (found, diagnostics) = config::parse(&text);
    for diagnostic in diagnostics.iter().filter(|diagnostic| diagnostic.severity == Severity::Warning) {
        console::note(&format!("{}: {diagnostic}", path.display()));
    }
    found.ok_or_else(|| invalid(path, &diagnostics).into())
}

fn read(path: &Path) -> anyhow::Result<String> {
    let file = File::open(path).with_context(|| format!("cannot open {}", path.display()))?;
    // One byte more than allowed tells a file that is too long.
    let limit = CONFIG_BYTES_MAX as u64 + 1;
    let mut bytes = Vec::new();
    file.take(limit).read_to_end(&mut bytes).with_context(|| format!("cannot read {}", path.display()))?;
    if bytes.len() as u64 == limit {
        anyhow::bail!(
            "{} is too long for a printer.cfg (more than {CONFIG_BYTES_MAX} bytes)",
            path.display()
        );
    }
    match String::from_utf8(bytes) {
        Ok(text) => Ok(text),
        // Comments in an old 8-bit character set are no reason to refuse the machine.
        Err(error) if !error.as_bytes().contains(&0) => {
            Ok(String::from_utf8_lossy(error.as_bytes()).into_owned())
        }
        Err(_) => anyhow::bail!("{} is not a text file, so it is no printer.cfg", path.display()),
    }
}

fn invalid(path: &Path, diagnostics: &[ConfigDiagnostic]) -> PrinterError {
    let errors = diagnostics.iter().filter(|diagnostic| diagnostic.severity == Severity::Error);
    let count = errors.clone().count();
    let mut lines: Vec<String> =
        errors.take(ERRORS_SHOWN_MAX).map(|error| format!("\n  {}: {error}", path.display())).collect();
    if count > ERRORS_SHOWN_MAX {
        lines.push(format!("\n  and {} more", count - ERRORS_SHOWN_MAX));
    }
    PrinterError::new(ErrorCode::ConfigInvalid, lines.concat().trim_end_matches('.'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_name_file_and_line() {
        let path = std::env::temp_dir().join(format!("stepcast-config-{}.cfg", std::process::id()));
        std::fs::write(&path, "[printer]\nkinematics: cartesian\nmax_velocity: fast\n").unwrap();
        let error = load(&path).unwrap_err();
        std::fs::remove_file(&path).unwrap();
        let text = error.to_string();
        assert!(text.contains(".cfg: line 3: error:"), "{text}");
        assert_eq!(error.downcast_ref::<PrinterError>().unwrap().code, ErrorCode::ConfigInvalid);
    }

    #[test]
    fn a_file_that_is_not_there_is_named() {
        let error = load(Path::new("/nowhere/printer.cfg")).unwrap_err();
        assert!(format!("{error:#}").contains("/nowhere/printer.cfg"), "{error:#}");
    }
}
