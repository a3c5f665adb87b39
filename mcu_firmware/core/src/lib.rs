//! The firmware without a chip: command dispatch, timers, steppers, endstops and triggers, analog inputs, outputs and
//! shutdown, speaking Klipper's wire protocol.
//!
//! Knows nothing of registers or interrupts: those are behind [`Board`]. All times are ticks of the board's clock, 32
//! bits that wrap. `no_std`, no allocation, every queue bounded; no input can panic it or make it loop.
//!
//! | module | what it is |
//! |---|---|
//! | `board` | what is asked of a chip |
//! | `firmware`, `dispatch` | the whole; what each command does |
//! | `receiver` | sequence numbers, checks and acknowledgements |
//! | `motion_clock`, `hold`, `motion_commands` | the clock that steps are due on; when it slows down and stops |
//! | `heater`, `heater_commands` | temperature loops on the board, and what a silent host means to them |
//! | `scheduler`, `moves` | timers; the pool of queued moves |
//! | `objects` | what was configured, by oid |
//! | `stepper`, `endstop`, `trsync`, `analog_in`, `digital_out` | the kinds of objects |
//! | `shutdown`, `uptime` | the stopped state; clock and statistics |
//!
//! Source: the command descriptions in Klipper's public documentation (docs/MCU_Commands.md, docs/Protocol.md).
#![no_std]

mod analog_in;
mod board;
mod digital_out;
mod dispatch;
mod endstop;
mod firmware;
mod heater;
mod heater_commands;
mod hold;
mod motion_clock;
mod motion_commands;
mod moves;
mod objects;
mod receiver;
mod scheduler;
mod shutdown;
mod stepper;
mod trsync;
mod uptime;

pub use board::{AnalogSample, Board, Pin, PinError, Pull};
pub use firmware::Firmware;
pub use uptime::STATS_SUMSQ_BASE;
