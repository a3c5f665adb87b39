//! `cargo xtask wasm`: the planner as WebAssembly, with bindings for Node (`node/`) and the web (`web/`) in
//! `target/wasm-bindings/`, and the latter where the page imports it.
//!
//! The bindings are made by wasm-bindgen as a library of the very version that the crates use. It is a program of its
//! own (`xtask-wasm-bindgen`), because it takes a minute to build once and the other chores should not wait for it.

use std::{fs, path::Path};

use anyhow::{Context, Result};

use crate::workspace;

/// Where the bindings go, below cargo's target folder.
const BINDINGS_FOLDER: &str = "wasm-bindings";

/// Where the page imports them from; not committed.
const PAGE_FOLDER: &str = "web/src/bindings/wasm";

/// `cargo xtask wasm`.
pub(crate) fn run() -> Result<()> {
    let target = workspace::target_directory()?;
    workspace::run(workspace::cargo().args([
        "build",
        "--package=planner-wasm",
        "--target=wasm32-unknown-unknown",
        "--profile=wasm",
    ]))?;
    let module = target.join("wasm32-unknown-unknown").join("wasm").join("planner_wasm.wasm");
    let output = target.join(BINDINGS_FOLDER);
    bind(&module, &output)?;
    let page = workspace::root().join(PAGE_FOLDER);
    copy_changed(&output.join("web"), &page)?;
    println!("{}\n{}", output.display(), page.display());
    Ok(())
}

/// Makes bindings for a module: `node/` and `web/` in the output folder.
pub(crate) fn bind(module: &Path, output: &Path) -> Result<()> {
    workspace::run(
        workspace::cargo()
            .args([
                "run",
                "--package=xtask",
                "--features=wasm",
                "--bin=xtask-wasm-bindgen",
                "--profile=tools",
                "--",
            ])
            .args([module, output]),
    )
}

/// Copies a folder's files. Those that are the same already are left alone, so that nobody who watches them starts over.
fn copy_changed(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir_all(to).with_context(|| format!("cannot create {}", to.display()))?;
    for entry in fs::read_dir(from).with_context(|| format!("cannot read {}", from.display()))? {
        let source = entry.with_context(|| format!("cannot read {}", from.display()))?.path();
        let Some(name) = source.file_name() else { continue };
        let target = to.join(name);
        let bytes = fs::read(&source).with_context(|| format!("cannot read {}", source.display()))?;
        if fs::read(&target).ok().as_ref() != Some(&bytes) {
            fs::write(&target, bytes).with_context(|| format!("cannot write {}", target.display()))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unchanged_files_are_not_written_again() {
        let folder = std::env::temp_dir().join(format!("stepcast-wasm-{}", std::process::id()));
        let (from, to) = (folder.join("from"), folder.join("to"));
        fs::create_dir_all(&from).unwrap();
        fs::write(from.join("a"), "one").unwrap();
        fs::write(from.join("b"), "two").unwrap();
        copy_changed(&from, &to).unwrap();
        let before = fs::metadata(to.join("a")).unwrap().modified().unwrap();
        std::thread::sleep(std::time::Duration::from_millis(20));
        fs::write(from.join("b"), "three").unwrap();
        copy_changed(&from, &to).unwrap();
        assert_eq!(fs::metadata(to.join("a")).unwrap().modified().unwrap(), before);
        assert_eq!(fs::read_to_string(to.join("b")).unwrap(), "three");
        fs::remove_dir_all(&folder).unwrap();
    }
}
