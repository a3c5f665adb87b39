//! A message on its way to the board: its bytes, and when it may and must be sent.

use units::Ticks;
use wire::{
    Command,
    check::MESSAGE_BYTES_MAX,
    dictionary::{Dictionary, DictionaryError},
    vlq::SliceSink,
};

/// The most motion lanes, one a stepper.
pub const MOTION_LANES_MAX: usize = 8;
/// No event may be scheduled further ahead of the board's clock than this: its 32-bit clock compares by differences.
pub const SCHEDULE_AHEAD_TICKS_MAX: Ticks = Ticks(3 << 28);

/// Which queue a message waits in. Order is kept within a lane, not between lanes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lane {
    /// Ahead of everything that has not been sent: the emergency stop.
    Immediate,
    /// Ahead of motion: configuration, heaters, queries.
    Control,
    /// What one stepper does, by its number below [`MOTION_LANES_MAX`], or something else that follows the motion
    /// clock. Lanes are merged by [`Outgoing::due`].
    Motion(u8),
}

/// A message to be sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Outgoing {
    pub(super) bytes: [u8; MESSAGE_BYTES_MAX],
    pub(super) len: u8,
    pub(super) lane: Lane,
    /// The clock by which the board must have it.
    pub(super) req_clock: Ticks,
    /// It must not be sent before this clock.
    pub(super) min_clock: Ticks,
    /// The entry of the move queue that it takes comes free at this clock.
    pub(super) entry_until: Option<Ticks>,
    /// Motion lasts until the board has it; otherwise it only goes along.
    pub(super) covers: bool,
}

impl Outgoing {
    /// A message of these bytes; `None` where they do not fit a block beside its check.
    pub fn from_bytes(lane: Lane, payload: &[u8]) -> Option<Self> {
        let mut bytes = [0; MESSAGE_BYTES_MAX];
        bytes.get_mut(..payload.len())?.copy_from_slice(payload);
        Some(Self::new(lane, bytes, payload.len()))
    }

    /// A command as this board numbers it.
    pub fn command(
        lane: Lane,
        dictionary: &Dictionary,
        command: &Command<'_>,
    ) -> Result<Self, DictionaryError> {
        let mut bytes = [0; MESSAGE_BYTES_MAX];
        let mut sink = SliceSink::new(&mut bytes);
        dictionary.encode(command, &mut sink)?;
        let len = sink.len();
        // The longest command has eight integers; only responses carry strings.
        debug_assert!(len < MESSAGE_BYTES_MAX, "every command fits a block beside its check");
        Ok(Self::new(lane, bytes, len))
    }

    const fn new(lane: Lane, bytes: [u8; MESSAGE_BYTES_MAX], len: usize) -> Self {
        Self {
            bytes,
            len: len as u8,
            lane,
            req_clock: Ticks(0),
            min_clock: Ticks(0),
            entry_until: None,
            covers: true,
        }
    }

    /// It belongs to something that happens at `clock`: the board must have it before, and gets it no earlier than
    /// its clock can tell that `clock` is ahead. For `set_next_step_dir` and `reset_step_clock` this is the clock of
    /// the first step that follows.
    #[must_use]
    pub fn due(mut self, clock: Ticks) -> Self {
        self.req_clock = clock;
        self.min_clock = clock.saturating_sub(SCHEDULE_AHEAD_TICKS_MAX);
        self
    }

    /// It goes along with the motion without being any: how far the board has motion does not depend on it.
    #[must_use]
    pub fn beside(mut self) -> Self {
        self.covers = false;
        self
    }

    /// It must not be sent before `clock`.
    #[must_use]
    pub fn not_before(mut self, clock: Ticks) -> Self {
        self.min_clock = clock;
        self
    }

    /// It takes an entry of the board's move queue, which comes free at `clock`: for a `queue_step`, that of its last
    /// step.
    #[must_use]
    pub fn entry_until(mut self, clock: Ticks) -> Self {
        self.entry_until = Some(clock);
        self
    }

    /// The lane it waits in.
    pub const fn lane(&self) -> Lane {
        self.lane
    }

    /// The message.
    pub fn payload(&self) -> &[u8] {
        &self.bytes[..usize::from(self.len)]
    }
}
