//! Reads along what the host tells the board, for the moment by which its lease on motion would bring that to rest.
//!
//! Knows the numbers of our own boards' messages, and nothing of what became of them on the way.

use units::{Clock32, Ticks};
use wire::{
    Command,
    block::{Deframer, Frame},
    check::BlockCheck,
    messages::CommandKind,
};

/// A hold may begin a slice of its ramp late: docs/motion-clock.md.
const RAMP_SLICES: u32 = 256;

/// The last lease that was sent.
#[derive(Debug, Default)]
pub(super) struct LeaseTap {
    deframer: Deframer,
    rest: Option<Ticks>,
}

impl LeaseTap {
    /// Bytes go to the board at this clock.
    pub(super) fn watch(&mut self, bytes: &[u8], now: Ticks) {
        let check = BlockCheck::new(CommandKind::BlockCheck.spec().id);
        let latest = &mut self.rest;
        self.deframer.push(bytes, |frame| {
            let Frame::Block { sequence, payload } = frame else { return };
            let mut rest = check.open(sequence, payload).unwrap_or(payload);
            while let Ok(command) = Command::decode(&mut rest) {
                if let Command::MotionLease { alive, ramp, .. } = command {
                    let ramp = Ticks(u64::from(ramp) + u64::from(ramp / RAMP_SLICES));
                    *latest = (*latest).max(Some(now.nearest(Clock32(alive)) + ramp));
                }
                if rest.is_empty() {
                    break;
                }
            }
        });
    }

    /// The clock by which motion rests when the host is heard of no more.
    pub(super) const fn rest(&self) -> Option<Ticks> {
        self.rest
    }
}
