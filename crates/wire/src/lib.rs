//! Klipper's wire protocol: the one place in this project that knows bytes.
//!
//! * [`vlq`]: the variable-length integers that everything is made of.
//! * [`block`]: framing, CRC and resynchronisation.
//! * [`check`]: the stronger check that blocks may carry.
//! * [`messages`]: every command and response, declared once; host and board both work from that declaration.
//! * [`rows`]: the check over the rows of steps that a stepper has taken.
//! * `dictionary` (feature `dictionary`, needs an allocator): the self-description that a board hands to its host.
//!
//! Knows nothing of retransmission (that is the host's link and the board's receiver), of time or of what a message
//! means. The core is `no_std` and allocates nothing.
//!
//! Source: the protocol description in Klipper's public documentation (docs/Protocol.md), and measurements.
#![no_std]

#[cfg(any(feature = "dictionary", test))]
extern crate alloc;

pub mod block;
pub mod check;
#[cfg(feature = "dictionary")]
pub mod dictionary;
pub mod messages;
pub mod rows;
pub mod shutdown;
pub mod vlq;

pub use messages::{Command, DecodeError, Response};
pub use rows::RowCheck;
pub use shutdown::ShutdownReason;
