//! G-code: bytes → lines → words → modal state → [`Action`]s and [`Diagnostic`]s.
//!
//! Reads what `PrusaSlicer`, Orca, Cura, Slic3r and Simplify3D write for Marlin and Klipper, as a stream: [`Lines`] splits
//! chunks of any size, an [`Interpreter`] carries the modal state from line to line, and neither ever holds more than one
//! line and the chunk it came in. No input can panic, and what is not understood is said, by line and column, never skipped
//! in silence.
//!
//! Knows nothing of machines: not whether an axis is homed, how far it reaches, how fast it may go or whether a
//! nozzle is warm. Positions are those of the machine (mm), with `e` a running total of the filament fed; feeds are mm/s.
//!
//! Sources: the NIST RS274/NGC interpreter manual for words, modes and arcs; Marlin's and Klipper's public command
//! references for the dialects; the slicers' own output. Where Marlin and Klipper differ, Klipper is followed (`G91`
//! makes E relative too, `G90` gives it back to `M82`/`M83`).

mod action;
mod annotation;
mod arc;
mod diagnostic;
mod interpreter;
mod lines;
mod number;
mod sniff;
mod words;

pub use action::{
    Action, AxisShaper, AxisValues, Heater, InputShaper, MachineLimits, MeshChange, Move, ObjectAction,
    ObjectId, PauseReason, Position, ShaperName, SkewChange, VelocityLimit, Wait,
};
pub use annotation::{Annotation, Feature, PictureLine};
pub use arc::{Arc, ArcError, ArcPiece, CHORD_TOLERANCE, CHORD_TOLERANCE_MIN, Chords, Plane};
pub use diagnostic::{Diagnostic, DiagnosticCode, Severity};
pub use interpreter::{FirmwareRetraction, Interpreter, Settings};
pub use lines::{LINE_BYTES_MAX, Line, LineNumber, Lines};
pub use sniff::{FileKind, SNIFF_BYTES, sniff};
