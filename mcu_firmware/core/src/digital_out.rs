//! Outputs: heaters, fans, enable pins. Switched at a clock, or pulse-width modulated by timers. What is queued for an
//! output that is tied to motion is due on the motion clock; the modulation itself is always on the hardware clock.
//!
//! An output with a `max_duration` that is not at its default has to be set again within that time, else the board
//! stops: a host that died must not leave a heater on.

use units::Clock32;
use wire::ShutdownReason;

use crate::{
    board::{Board, Pin},
    heater::SHARE_ONE,
    motion_clock::MotionClock,
    moves::{MovePool, OutputMove, Queue},
    objects::After,
};

/// Durations have to be shorter than half the clock's range to be told from the past.
const DURATION_TICKS_MAX: u32 = i32::MAX as u32;

pub(crate) struct DigitalOut {
    pin: Pin,
    level: bool,
    default_level: bool,
    /// 0 is no limit.
    max_duration: u32,
    /// 0 is no modulation.
    cycle_ticks: u32,
    on_ticks: u32,
    off_ticks: u32,
    /// The next edge of the modulation.
    toggle_at: Option<Clock32>,
    /// When the next queued change is due or, with none queued, when `max_duration` ends. On the motion clock for an
    /// output that is tied to it, which has no `max_duration`.
    load_at: Option<Clock32>,
    is_tied: bool,
    /// A heater drives it, nobody else …
    is_owned: bool,
    /// … and wants it to be on for so long from the next cycle on.
    next_on: Option<u32>,
    queue: Queue,
    last_queued: Clock32,
}

impl DigitalOut {
    pub(crate) fn new(
        board: &mut impl Board,
        pin: Pin,
        level: bool,
        default_level: bool,
        max_duration: u32,
    ) -> Result<Self, ShutdownReason> {
        // Nobody would watch an output that starts away from its default before the configuration is complete.
        if max_duration > DURATION_TICKS_MAX || (max_duration != 0 && level != default_level) {
            return Err(ShutdownReason::CommandParser);
        }
        board.configure_output(pin, level).map_err(|_| ShutdownReason::InvalidPin)?;
        Ok(Self {
            pin,
            level,
            default_level,
            max_duration,
            cycle_ticks: 0,
            on_ticks: 0,
            off_ticks: 0,
            toggle_at: None,
            load_at: None,
            is_tied: false,
            is_owned: false,
            next_on: None,
            queue: Queue::new(),
            last_queued: Clock32(0),
        })
    }

    /// Sets the period of the modulation, for the changes that are queued from now on.
    pub(crate) fn set_cycle(&mut self, cycle_ticks: u32) -> Result<(), ShutdownReason> {
        self.check_free()?;
        if cycle_ticks > DURATION_TICKS_MAX || !self.queue.is_empty() {
            return Err(ShutdownReason::InvalidPwm);
        }
        self.cycle_ticks = cycle_ticks;
        Ok(())
    }

    /// Ties the queued changes to the motion clock. An output that has to be refreshed cannot be: a hold would end it.
    pub(crate) const fn tie(&mut self) -> Result<(), ShutdownReason> {
        if self.max_duration != 0 {
            return Err(ShutdownReason::InvalidMotion);
        }
        self.is_tied = true;
        Ok(())
    }

    /// Gives the output to a heater. It has to be modulated, off, and watched: the loop has to refresh it.
    pub(crate) fn own(&mut self) -> Result<(), ShutdownReason> {
        let is_fit = self.max_duration != 0 && self.cycle_ticks > 0 && self.queue.is_empty();
        if !is_fit || self.level != self.default_level || self.is_owned {
            return Err(ShutdownReason::InvalidHeater);
        }
        self.is_owned = true;
        Ok(())
    }

    /// Whether the host may set it.
    pub(crate) const fn check_free(&self) -> Result<(), ShutdownReason> {
        if self.is_owned { Err(ShutdownReason::InvalidHeater) } else { Ok(()) }
    }

    /// On, which is away from the default, for a share of each cycle. Off is at once; another width begins with the next
    /// cycle, so that none is cut short. Has to be called again within `max_duration`.
    pub(crate) fn drive(&mut self, board: &mut impl Board, share: u32) {
        let on = u64::from(self.cycle_ticks) * u64::from(share.min(SHARE_ONE));
        let on = ((on + u64::from(SHARE_ONE / 2)) / u64::from(SHARE_ONE)) as u32;
        let now = board.now();
        if on == 0 {
            self.toggle_at = None;
            self.next_on = None;
            self.set(board, self.default_level);
        } else if self.toggle_at.is_some() {
            self.next_on = Some(on);
        } else {
            self.begin_cycle(board, now, on);
        }
        self.load_at = self.limit_from(now);
    }

    /// On for so long, from this clock on.
    fn begin_cycle(&mut self, board: &mut impl Board, clock: Clock32, on: u32) {
        let off = self.cycle_ticks.saturating_sub(on);
        (self.on_ticks, self.off_ticks) = if self.default_level { (off, on) } else { (on, off) };
        self.set(board, !self.default_level);
        self.toggle_at = (off > 0).then(|| clock.wrapping_add(on));
    }

    pub(crate) const fn is_tied(&self) -> bool {
        self.is_tied
    }

    /// Drops what is queued; the output stays as it is.
    pub(crate) fn drop_queue<const M: usize>(&mut self, moves: &mut MovePool<M>) {
        moves.clear(&mut self.queue);
        self.load_at = None;
    }

    /// When the next change is due on the hardware clock, if that is within reach.
    fn load_due(&self, motion: &MotionClock) -> Option<Clock32> {
        self.load_at.and_then(|at| if self.is_tied { motion.when(at) } else { Some(at) })
    }

    /// When the timer is to wake.
    pub(crate) fn wake(&self, motion: &MotionClock) -> Option<Clock32> {
        match (self.toggle_at, self.load_due(motion)) {
            (Some(toggle), Some(load)) => Some(if toggle.is_before(load) { toggle } else { load }),
            (toggle, load) => toggle.or(load),
        }
    }

    /// Queues a change; they have to come in the order of their clocks.
    pub(crate) fn queue<const M: usize>(
        &mut self,
        now: Clock32,
        moves: &mut MovePool<M>,
        motion: &MotionClock,
        change: OutputMove,
    ) -> Result<(), ShutdownReason> {
        let clock = Clock32(change.clock);
        let now = if self.is_tied { motion.motion(now) } else { now };
        if clock.is_before(now) || (!self.queue.is_empty() && clock.is_before(self.last_queued)) {
            return Err(ShutdownReason::TimerTooClose);
        }
        if self.queue.is_empty() {
            if self.load_at.is_some_and(|end| end.is_before(clock)) {
                return Err(ShutdownReason::OutputTooFarAhead);
            }
            self.load_at = Some(clock);
        }
        self.last_queued = clock;
        moves.push(&mut self.queue, change)
    }

    /// Sets the output now. What was queued is dropped.
    pub(crate) fn update<const M: usize>(
        &mut self,
        board: &mut impl Board,
        moves: &mut MovePool<M>,
        level: bool,
    ) {
        moves.clear(&mut self.queue);
        self.toggle_at = None;
        self.set(board, level);
        self.load_at = self.limit_from(board.now());
    }

    /// The next queued change, the next edge of the modulation, or the end of `max_duration`.
    pub(crate) fn event<const M: usize>(
        &mut self,
        board: &mut impl Board,
        moves: &mut MovePool<M>,
        motion: &MotionClock,
        wake: Clock32,
    ) -> Result<After, ShutdownReason> {
        if self.load_due(motion) == Some(wake) {
            self.load(board, moves, wake)?;
        } else if self.toggle_at == Some(wake) {
            if self.level == self.default_level
                && let Some(on) = self.next_on.take()
            {
                self.begin_cycle(board, wake, on);
                return Ok(self.wake(motion).map_or(After::Done, After::Again));
            }
            self.set(board, !self.level);
            self.toggle_at = Some(wake.wrapping_add(if self.level { self.on_ticks } else { self.off_ticks }));
        }
        Ok(self.wake(motion).map_or(After::Done, After::Again))
    }

    fn load<const M: usize>(
        &mut self,
        board: &mut impl Board,
        moves: &mut MovePool<M>,
        wake: Clock32,
    ) -> Result<(), ShutdownReason> {
        let change: OutputMove = moves.pop(&mut self.queue).ok_or(ShutdownReason::MissedOutput)?;
        self.set(board, change.on_ticks != 0);
        self.toggle_at = None;
        if change.on_ticks != 0 && change.on_ticks < self.cycle_ticks {
            self.on_ticks = change.on_ticks;
            self.off_ticks = self.cycle_ticks - change.on_ticks;
            self.toggle_at = Some(wake.wrapping_add(self.on_ticks));
        }
        let limit = self.limit_from(wake);
        let next = moves.front::<OutputMove>(self.queue).map(|next| Clock32(next.clock));
        if let (Some(limit), Some(next)) = (limit, next)
            && limit.is_before(next)
        {
            return Err(ShutdownReason::OutputTooFarAhead);
        }
        self.load_at = next.or(limit);
        Ok(())
    }

    /// When the state that begins at `clock` has to be refreshed.
    fn limit_from(&self, clock: Clock32) -> Option<Clock32> {
        let is_default = self.level == self.default_level && self.toggle_at.is_none();
        (self.max_duration != 0 && !is_default).then(|| clock.wrapping_add(self.max_duration))
    }

    fn set(&mut self, board: &mut impl Board, level: bool) {
        self.level = level;
        board.set_pin(self.pin, level);
    }

    /// Back to the default. The move pool is reset by the caller.
    pub(crate) fn shut_down(&mut self, board: &mut impl Board) {
        self.queue = Queue::new();
        self.toggle_at = None;
        self.next_on = None;
        self.load_at = None;
        self.set(board, self.default_level);
    }
}
