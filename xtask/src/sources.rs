//! Reads the pure crates' sources for what they must not reach for.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

/// What a pure crate does not contain: I/O, clocks, threads, the environment, the terminal.
const FORBIDDEN: [&str; 12] = [
    "std::fs",
    "std::io",
    "std::net",
    "std::env",
    "std::process",
    "std::thread",
    "std::time::Instant",
    "std::time::SystemTime",
    "Instant::now",
    "println!",
    "eprintln!",
    "dbg!",
];

/// One line for each place in `folder`'s Rust files, tests left out, that reaches outside.
pub(crate) fn impurities(folder: &Path) -> Result<Vec<String>> {
    let mut findings = Vec::new();
    for file in rust_files(folder)? {
        let text = fs::read_to_string(&file).with_context(|| format!("cannot read {}", file.display()))?;
        for (line, word) in forbidden_words(&text) {
            findings.push(format!("{}:{line}: {word} in a crate that does no I/O", file.display()));
        }
    }
    Ok(findings)
}

fn rust_files(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    let mut open = vec![folder.to_path_buf()];
    while let Some(folder) = open.pop() {
        let entries = fs::read_dir(&folder).with_context(|| format!("cannot read {}", folder.display()))?;
        for entry in entries {
            let path = entry?.path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") && !is_test(&path) {
                files.push(path);
            }
        }
    }
    files.sort();
    Ok(files)
}

/// A file of tests only, by its name.
fn is_test(path: &Path) -> bool {
    path.file_stem()
        .and_then(|stem| stem.to_str())
        .is_some_and(|stem| stem == "tests" || stem.ends_with("_tests"))
}

/// Line number and word of each hit, up to the tests at the file's end; comments do not count.
fn forbidden_words(text: &str) -> Vec<(usize, &'static str)> {
    let mut found = Vec::new();
    for (index, line) in text.lines().enumerate() {
        if line.trim_start().starts_with("#[cfg(test)]") {
            break;
        }
        let code = line.split("//").next().unwrap_or(line);
        found.extend(FORBIDDEN.iter().filter(|word| code.contains(**word)).map(|word| (index + 1, *word)));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_clocks_and_files_but_not_in_comments_or_tests() {
        let text =
            "use std::fs;\n// std::net\nlet t = Instant::now();\n#[cfg(test)]\nmod tests { use std::io; }";
        assert_eq!(forbidden_words(text), [(1, "std::fs"), (3, "Instant::now")]);
    }
}
