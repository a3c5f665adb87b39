//! Everything that the page runs in its workers, for JavaScript: planner, session, preview, virtual printer.
//!
//! Thin shells over the crates, without logic of their own. Bytes, vertices and moves cross as typed arrays; everything
//! else as JSON in the shapes of [`messages`]. What fails is thrown as an `Error` whose message is a `PrinterError` as
//! JSON. Time is an argument, in seconds; nothing here reads a clock.

// wasm-bindgen hands optional texts over by value.
#![allow(clippy::needless_pass_by_value)]

mod host;
pub mod messages;
mod plan;
mod preview;
mod simulation;
mod speed;
mod survey;
mod virtual_printer;

use printer::{
    config::{ConfigDiagnostic, PrinterConfig, Severity, parse},
    error::{ErrorCode, PrinterError},
    journal::Journal,
};
use wasm_bindgen::prelude::{JsError, wasm_bindgen};

pub use host::{Host, MOVE_NUMBERS};
pub use simulation::Simulation;
pub use speed::SPEED_PAIRS_MAX;
pub use survey::Survey;

use messages::{ConfigReport, ErrorMessage, FileKindReport, JournalView, json};

/// The most findings that are put into one message; [`parse_config`] gives all of them.
const FINDINGS_SHOWN_MAX: usize = 5;

/// What is in a `printer.cfg`: a `ConfigReport` as JSON.
#[wasm_bindgen]
pub fn parse_config(printer_cfg: &str) -> String {
    json(&ConfigReport::of(printer_cfg))
}

/// What a print's journal says: a `JournalView` as JSON, or nothing where it cannot be read. `held` is what
/// `PrinterSession.held_print` gave, if anything did.
#[wasm_bindgen]
pub fn read_journal(journal: &[u8], held: Option<u32>) -> Option<String> {
    Journal::read(journal).ok().map(|journal| json(&JournalView::of(&journal, held)))
}

/// What a file is, from its first bytes (4096 are enough) and its name: a `FileKindReport` as JSON.
#[wasm_bindgen]
pub fn file_kind(head: &[u8], name: Option<String>) -> String {
    json(&FileKindReport::from(gcode::sniff(head, name.as_deref())))
}

/// The text of the machine that is simulated where the user has none.
#[wasm_bindgen]
pub fn usual_printer_cfg() -> String {
    demo_machine::USUAL_MACHINE.to_owned()
}

/// An error as JavaScript is told.
fn thrown(error: &PrinterError) -> JsError {
    JsError::new(&json(&ErrorMessage::from(error)))
}

/// A machine, or what is wrong with its file.
fn read_config(printer_cfg: &str) -> Result<PrinterConfig, PrinterError> {
    let (config, diagnostics) = parse(printer_cfg);
    config.ok_or_else(|| {
        let errors = diagnostics.iter().filter(|diagnostic| diagnostic.severity == Severity::Error);
        let lines: Vec<String> = errors.take(FINDINGS_SHOWN_MAX).map(ConfigDiagnostic::to_string).collect();
        PrinterError::new(ErrorCode::ConfigInvalid, lines.join("; ").trim_end_matches('.'))
    })
}
