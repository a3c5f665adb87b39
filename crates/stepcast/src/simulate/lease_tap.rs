//! Reads along what the host tells the board, for the moment by which its lease on motion, or its order to hold, would bring
//! that to rest.
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
    hold_ramp: Ticks,
}

impl LeaseTap {
    /// Bytes go to the board at this clock.
    pub(super) fn watch(&mut self, bytes: &[u8], now: Ticks) {
        let check = BlockCheck::new(CommandKind::BlockCheck.spec().id);
        let (latest, hold_ramp) = (&mut self.rest, &mut self.hold_ramp);
        self.deframer.push(bytes, |frame| {
            let Frame::Block { sequence, payload } = frame else { return };
            let mut rest = check.open(sequence, payload).unwrap_or(payload);
            while let Ok(command) = Command::decode(&mut rest) {
                let lasts = |ramp: u32| Ticks(u64::from(ramp) + u64::from(ramp / RAMP_SLICES));
                match command {
                    Command::MotionLease { alive, ramp, .. } => {
                        *latest = (*latest).max(Some(now.nearest(Clock32(alive)) + lasts(ramp)));
                    }
                    Command::MotionHold { ramp } => *hold_ramp = lasts(ramp),
                    _ => {}
                }
                if rest.is_empty() {
                    break;
                }
            }
        });
    }

    /// How long motion takes to rest after the last order to hold.
    pub(super) const fn hold_ramp(&self) -> Ticks {
        self.hold_ramp
    }

    /// The clock by which motion rests when the host is heard of no more.
    pub(super) const fn rest(&self) -> Option<Ticks> {
        self.rest
    }
}
