//! `cargo xtask bindings`: the TypeScript types of the messages between the page and its WebAssembly, written from the
//! Rust types into committed files. With `--check` nothing is written; a difference is an error.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail};

use crate::workspace;

/// Where the types go. What else ends in `.ts` there is from an earlier time.
const FOLDER: &str = "web/src/bindings";
/// Before each file's text, in what the generator writes.
const MARK: &str = "=== ";

/// `cargo xtask bindings [--check]`.
pub(crate) fn run(check: bool) -> Result<()> {
    let generate = ["run", "--quiet", "--package=planner-wasm", "--features=bindings", "--example=bindings"];
    let output = workspace::cargo()
        .args(generate)
        .stderr(std::process::Stdio::inherit())
        .output()
        .context("cannot start cargo")?;
    if !output.status.success() {
        bail!("the types could not be generated ({})", output.status);
    }
    let text = String::from_utf8(output.stdout).context("the generated types are no text")?;
    let wanted = files_in(&text)?;
    let folder = workspace::root().join(FOLDER);
    let present = files_at(&folder)?;
    if present == wanted {
        println!("{FOLDER}: {} types are up to date", wanted.len());
        return Ok(());
    }
    if check {
        let differing = differences(&present, &wanted).join(", ");
        bail!(
            "{FOLDER} does not fit planner-wasm/src/messages ({differing}): run `cargo xtask bindings` and commit it"
        );
    }
    fs::create_dir_all(&folder).with_context(|| format!("cannot create {}", folder.display()))?;
    for name in differences(&present, &wanted) {
        let path = folder.join(name);
        match wanted.get(name) {
            Some(text) => fs::write(&path, text),
            None => fs::remove_file(&path),
        }
        .with_context(|| format!("cannot write {}", path.display()))?;
    }
    println!("wrote {FOLDER}");
    Ok(())
}

/// Names and texts of the files that the generator wrote one behind the other.
fn files_in(text: &str) -> Result<BTreeMap<String, String>> {
    let mut files: BTreeMap<String, String> = BTreeMap::new();
    let mut current: Option<String> = None;
    for line in text.lines() {
        if let Some(name) = line.strip_prefix(MARK) {
            if name.contains(['/', '\\']) || files.insert(name.to_owned(), String::new()).is_some() {
                bail!("the generator wrote a file with an unusable name: {name}");
            }
            current = Some(name.to_owned());
        } else {
            let file = current.as_ref().and_then(|name| files.get_mut(name));
            let file = file.context("the generator wrote something before the first file")?;
            file.push_str(line);
            file.push('\n');
        }
    }
    Ok(files)
}

/// The TypeScript files of a folder, which need not be there.
fn files_at(folder: &Path) -> Result<BTreeMap<String, String>> {
    let mut files = BTreeMap::new();
    if !folder.exists() {
        return Ok(files);
    }
    for entry in fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))? {
        let path = entry.with_context(|| format!("cannot read {}", folder.display()))?.path();
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        if path.extension().is_some_and(|extension| extension == "ts") {
            let text =
                fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
            // Git may check text out with `\r\n`.
            files.insert(name, text.replace("\r\n", "\n"));
        }
    }
    Ok(files)
}

/// The names of what differs, is missing or is too much.
fn differences<'a>(
    present: &'a BTreeMap<String, String>,
    wanted: &'a BTreeMap<String, String>,
) -> Vec<&'a str> {
    let mut names: Vec<&str> = present
        .keys()
        .chain(wanted.keys())
        .filter(|name| present.get(*name) != wanted.get(*name))
        .map(String::as_str)
        .collect();
    names.sort_unstable();
    names.dedup();
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_cut_apart_and_compared() {
        let wanted = files_in("=== A.ts\na1\na2\n=== B.ts\nb\n").unwrap();
        assert_eq!(wanted["A.ts"], "a1\na2\n");
        let present = files_in("=== A.ts\na1\na2\n=== C.ts\nc\n").unwrap();
        assert_eq!(differences(&present, &wanted), ["B.ts", "C.ts"]);
        assert!(files_in("text\n").is_err());
        assert!(files_in("=== ../A.ts\n").is_err());
        assert!(files_in("=== A.ts\n=== A.ts\n").is_err());
    }
}
