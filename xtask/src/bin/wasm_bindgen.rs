//! Makes JavaScript bindings for a WebAssembly module: `xtask-wasm-bindgen MODULE.wasm OUTPUT_FOLDER` writes
//! `OUTPUT_FOLDER/node` and `OUTPUT_FOLDER/web`. Started by `cargo xtask wasm`.

use std::{fs, path::PathBuf};

use anyhow::{Context, Result};
use wasm_bindgen_cli_support::Bindgen;

fn main() -> Result<()> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let module = arguments.next().context("usage: xtask-wasm-bindgen MODULE.wasm OUTPUT_FOLDER")?;
    let output = arguments.next().context("usage: xtask-wasm-bindgen MODULE.wasm OUTPUT_FOLDER")?;
    let mut node = Bindgen::new();
    node.nodejs(true)?;
    let mut web = Bindgen::new();
    // Functions' names are a tenth of what travels to the browser; those for Node keep them for traces.
    web.web(true)?.remove_name_section(true).remove_producers_section(true);
    for (mut bindgen, name) in [(node, "node"), (web, "web")] {
        bindgen
            .input_path(&module)
            .typescript(true)
            // The web bindings look for the module beside themselves (`import.meta.url`), which bundlers understand.
            .omit_default_module_path(false)
            .generate(output.join(name))
            .with_context(|| format!("cannot make the bindings for {name}"))?;
    }
    // The bindings for Node are CommonJS, whatever the package around them says.
    fs::write(output.join("node").join("package.json"), "{ \"type\": \"commonjs\" }\n")?;
    Ok(())
}
