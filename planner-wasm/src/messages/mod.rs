//! What crosses to JavaScript as JSON: plain data with the units in the names, one source for Rust and TypeScript.
//!
//! Knows how things are written, not when: the shells fill these. `cargo xtask bindings` writes the TypeScript types into
//! `web/src/bindings`. What is hot (vertices, moves, bytes) crosses as typed arrays and is not here.
//!
//! Suffixes: `_mm`, `_mm_s`, `_s` (seconds), `_c` (°C), `_hz`, `_bytes`; shares are 0 … 1.

mod config;
mod error;
mod event;
mod journal;
mod preview;
mod request;
mod snapshot;
mod virtual_state;

pub use config::{ConfigFinding, ConfigReport, ConfigSeverity, HeaterSummary, MachineSummary};
pub use error::ErrorMessage;
pub use event::{HeaterName, PhaseLabel, UiEvent};
pub use journal::{InterruptionView, JournalView, TransformView};
pub use preview::{
    Blocking, FeatureSummary, FileKindReport, Finding, FindingSeverity, LayerSummary, PreviewSummary,
};
pub use request::{JobRequest, JogAxis, UiRequest};
pub use snapshot::{BoardView, JobPhase, JobView, LinkView, Snapshot, StartView, TemperatureView};
pub use virtual_state::{EndstopState, FanState, HeaterState, MotorState, VirtualState};

/// A message as JSON. Nothing here can fail to be written: no maps with other keys than text, no foreign types.
pub(crate) fn json(message: &impl serde::Serialize) -> String {
    serde_json::to_string(message).unwrap_or_else(|_| "null".to_owned())
}
