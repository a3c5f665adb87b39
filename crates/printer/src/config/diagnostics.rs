//! What was found while reading a printer.cfg, bounded however wrong the text is.

/// How much a diagnostic matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// Read, without effect here, and nothing is lost by it.
    Info,
    /// The machine works, but not in every way the file asks for.
    Warning,
    /// The machine cannot be run from this file.
    Error,
}

/// One finding in a printer.cfg.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct ConfigDiagnostic {
    /// Line, counted from 1; 0 where something is missing that no line stands for.
    pub line: u32,
    /// How much it matters.
    pub severity: Severity,
    /// What is wrong and what to write instead.
    pub message: String,
}

impl core::fmt::Display for ConfigDiagnostic {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let severity = match self.severity {
            Severity::Info => "note",
            Severity::Warning => "warning",
            Severity::Error => "error",
        };
        if self.line == 0 {
            write!(f, "{severity}: {}", self.message)
        } else {
            write!(f, "line {}: {severity}: {}", self.line, self.message)
        }
    }
}

/// Most diagnostics that are kept; a file that is not a printer.cfg at all could give one a line.
pub const CONFIG_DIAGNOSTICS_MAX: usize = 200;

/// Longest piece of the user's text that a message repeats, in characters.
const EXCERPT_CHARACTERS_MAX: usize = 60;

#[derive(Debug, Default)]
pub(super) struct Log {
    diagnostics: Vec<ConfigDiagnostic>,
    left_out: usize,
    has_errors: bool,
}

impl Log {
    pub(super) fn error(&mut self, line: u32, message: impl Into<String>) {
        self.has_errors = true;
        self.push(line, Severity::Error, message.into());
    }

    pub(super) fn warning(&mut self, line: u32, message: impl Into<String>) {
        self.push(line, Severity::Warning, message.into());
    }

    pub(super) fn info(&mut self, line: u32, message: impl Into<String>) {
        self.push(line, Severity::Info, message.into());
    }

    pub(super) const fn has_errors(&self) -> bool {
        self.has_errors
    }

    fn push(&mut self, line: u32, severity: Severity, message: String) {
        if self.diagnostics.len() < CONFIG_DIAGNOSTICS_MAX {
            self.diagnostics.push(ConfigDiagnostic { line, severity, message });
            return;
        }
        self.left_out += 1;
        // An error must be seen, so it takes the place of the last lesser finding.
        if severity == Severity::Error
            && let Some(lesser) =
                self.diagnostics.iter_mut().rev().find(|kept| kept.severity != Severity::Error)
        {
            *lesser = ConfigDiagnostic { line, severity, message };
        }
    }

    /// In the order of the file; what concerns the whole file comes last.
    pub(super) fn into_diagnostics(mut self) -> Vec<ConfigDiagnostic> {
        self.diagnostics.sort_by_key(|diagnostic| diagnostic.line.wrapping_sub(1));
        if self.left_out > 0 {
            let severity = if self.has_errors { Severity::Error } else { Severity::Warning };
            let message = format!("{} more findings are left out: mend these first", self.left_out);
            self.diagnostics.push(ConfigDiagnostic { line: 0, severity, message });
        }
        self.diagnostics
    }
}

/// The user's text as a message may repeat it: one line, no control characters, not long.
pub(super) fn excerpt(text: &str) -> String {
    let mut characters =
        text.trim().chars().map(|character| if character.is_control() { ' ' } else { character });
    let mut short: String = characters.by_ref().take(EXCERPT_CHARACTERS_MAX).collect();
    if characters.next().is_some() {
        short.push('…');
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_log_is_bounded_and_keeps_errors_before_lesser_findings() {
        let mut log = Log::default();
        for line in 1..=500 {
            log.info(line, "x");
        }
        log.error(501, "bad");
        let diagnostics = log.into_diagnostics();
        assert_eq!(diagnostics.len(), CONFIG_DIAGNOSTICS_MAX + 1);
        assert!(diagnostics.iter().any(|diagnostic| diagnostic.message == "bad"));
        assert!(diagnostics.last().unwrap().message.starts_with("301 more"));
    }

    #[test]
    fn excerpts_are_short_and_printable() {
        assert_eq!(excerpt(" a\nb\u{7}c "), "a b c");
        assert_eq!(excerpt(&"é".repeat(100)).chars().count(), 61);
    }

    #[test]
    fn a_diagnostic_prints_its_line() {
        let diagnostic = ConfigDiagnostic { line: 3, severity: Severity::Error, message: "no".to_owned() };
        assert_eq!(diagnostic.to_string(), "line 3: error: no");
        let diagnostic = ConfigDiagnostic { line: 0, ..diagnostic };
        assert_eq!(diagnostic.to_string(), "error: no");
    }
}
