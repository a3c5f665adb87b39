//! The planner for JavaScript: a thin shell over `printer`, with no logic of its own.

use wasm_bindgen::prelude::wasm_bindgen;

/// This program's version.
#[wasm_bindgen]
pub fn version() -> String {
    env!("CARGO_PKG_VERSION").to_owned()
}
