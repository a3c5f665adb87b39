//! The host without I/O: everything between a G-code file and the bytes on the wire.
//!
//! Bytes and time are arguments: `receive(bytes, now)`, `poll(now)`. Knows nothing of ports, files, threads or clocks,
//! so the same code runs in a browser's worker, in the native command and in tests in virtual time.

mod arcs;
pub mod check;
pub mod clock_sync;
pub mod config;
pub mod error;
pub mod heater;
pub mod identify;
pub mod interruption;
pub mod journal;
pub mod link;
pub mod machine;
pub mod move_queue;
mod pace;
pub mod planner;
pub mod preview;
mod reach;
pub mod session;
pub mod step_rate;
pub mod thermistor;
pub mod transform;
