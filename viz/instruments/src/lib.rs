//! The page's instruments: the temperatures of the last minutes and the planned speed around now, drawn with egui.
//!
//! [`view::View`] holds what is shown and draws it with egui alone, wherever that runs; [`web`] puts it on a WebGL
//! context for JavaScript. Knows nothing of printers, pages or clocks: readings, planned speeds and the time are
//! given. Times are in s, temperatures in °C, speeds in mm/s; positions in points, which are CSS pixels.
//!
//! Everything drawn is in the page's text, too: a canvas says nothing to a screen reader.

pub mod axis;
pub mod history;
pub mod speed;
pub mod theme;
pub mod thin;
pub mod view;
#[cfg(target_arch = "wasm32")]
pub mod web;
pub mod window;
