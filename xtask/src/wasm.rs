//! `cargo xtask wasm`: the planner as WebAssembly, with bindings for Node (`node/`) and the web (`web/`) in
//! `target/wasm-bindings/`.
//!
//! The bindings are made by wasm-bindgen as a library of the very version that the crates use. It is a program of its
//! own (`xtask-wasm-bindgen`), because it takes a minute to build once and the other chores should not wait for it.

use anyhow::Result;

use crate::workspace;

/// Where the bindings go, below cargo's target folder.
const BINDINGS_FOLDER: &str = "wasm-bindings";

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
            .args([&module, &output]),
    )?;
    println!("{}", output.display());
    Ok(())
}
