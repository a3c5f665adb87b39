//! `cargo xtask instruments`: the instruments as WebAssembly, in `web/public/instruments`, where the page build takes
//! them from, and beside a page that is built already, so that whoever has it open need not build it again.
//!
//! Apart from `cargo xtask wasm`, because they take minutes to build and the page works without them.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result};

use crate::{wasm, workspace};

/// Where the bindings go, below cargo's target folder.
const BINDINGS_FOLDER: &str = "instruments-bindings";
/// What the page build copies as it is; not committed.
const PUBLIC_FOLDER: &str = "web/public/instruments";
/// The built page.
const PAGE_FOLDER: &str = "web/dist";
/// The module first: whoever finds the script finds its module.
const FILES: [&str; 2] = ["instruments_bg.wasm", "instruments.js"];

/// `cargo xtask instruments`.
pub(crate) fn run() -> Result<()> {
    let target = workspace::target_directory()?;
    workspace::run(workspace::cargo().args([
        "build",
        "--package=instruments",
        "--target=wasm32-unknown-unknown",
        "--profile=instruments",
    ]))?;
    let module = target.join("wasm32-unknown-unknown").join("instruments").join("instruments.wasm");
    let output = target.join(BINDINGS_FOLDER);
    wasm::bind(&module, &output)?;
    let page = workspace::root().join(PAGE_FOLDER);
    let mut places = vec![workspace::root().join(PUBLIC_FOLDER)];
    places.extend(page.join("index.html").is_file().then(|| page.join("instruments")));
    for place in places {
        publish(&output.join("web"), &place)?;
        println!("{}", place.display());
    }
    Ok(())
}

/// Puts the files there, each whole or not at all: a page may be asking for them right now.
fn publish(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir_all(to).with_context(|| format!("cannot create {}", to.display()))?;
    for name in FILES {
        let (source, target) = (from.join(name), to.join(name));
        let bytes = fs::read(&source).with_context(|| format!("cannot read {}", source.display()))?;
        if fs::read(&target).ok().as_ref() == Some(&bytes) {
            continue;
        }
        let whole = to.join(format!("{name}.new"));
        fs::write(&whole, bytes).with_context(|| format!("cannot write {}", whole.display()))?;
        fs::rename(&whole, &target).with_context(|| format!("cannot write {}", target.display()))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn script_and_module_are_published_and_nothing_else() {
        let folder = std::env::temp_dir().join(format!("stepcast-instruments-{}", std::process::id()));
        let (from, to) = (folder.join("from"), folder.join("to"));
        fs::create_dir_all(&from).unwrap();
        for name in FILES.into_iter().chain(["instruments.d.ts"]) {
            fs::write(from.join(name), name).unwrap();
        }
        publish(&from, &to).unwrap();
        fs::write(from.join(FILES[0]), "newer").unwrap();
        publish(&from, &to).unwrap();
        let mut there: Vec<String> = fs::read_dir(&to)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        there.sort();
        assert_eq!(there, ["instruments.js", "instruments_bg.wasm"]);
        assert_eq!(fs::read_to_string(to.join(FILES[0])).unwrap(), "newer");
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn without_the_script_nothing_is_claimed() {
        let folder = std::env::temp_dir().join(format!("stepcast-no-instruments-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        assert!(publish(&folder, &folder.join("to")).is_err());
        fs::remove_dir_all(&folder).unwrap();
    }
}
