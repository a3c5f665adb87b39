//! The firmware as a whole: bytes in, timers, reports out.

use units::{Clock32, Hertz};
use wire::{
    Command, Response, ShutdownReason,
    block::{Deframer, Frame},
};

use crate::{
    board::Board,
    heater::Heaters,
    hold::Hold,
    moves::MovePool,
    objects::{After, Object, Objects},
    receiver::Receiver,
    scheduler::Timers,
    shutdown::{Halt, is_allowed},
    trsync::Due,
    uptime::{Stats, Uptime},
};

/// A timer that falls this far behind shuts the board down: the step rate or the load is beyond the chip.
const LATE_SECONDS_INVERSE: u32 = 1000;
/// Timers that are due one after the other keep the main loop waiting for this part of that time at most …
const BUSY_PART: u32 = 10;
/// … and then let it run for this part, even if they fall behind.
const REST_PART: u32 = 50;

/// One board's firmware: `OBJECTS` is how many oids it has (at most 255), `MOVES` how many entries its move pool has
/// (at most 65534).
///
/// Calls must not overlap: a chip that calls [`Self::run_timers`] from an interrupt guards it with a critical section.
/// Clocks may lie up to 2³¹ ticks ahead of [`Board::now`]; those further away count as past.
pub struct Firmware<const OBJECTS: usize, const MOVES: usize> {
    deframer: Deframer,
    core: Core<OBJECTS, MOVES>,
}

impl<const OBJECTS: usize, const MOVES: usize> Firmware<OBJECTS, MOVES> {
    /// A firmware that has just started, on a board whose clock runs at `clock`.
    pub const fn new(clock: Hertz) -> Self {
        Self { deframer: Deframer::new(), core: Core::new(clock) }
    }

    /// Uses fewer entries of the move pool than there are, as a board with less memory would.
    #[must_use]
    pub const fn with_move_count(mut self, move_count: u16) -> Self {
        self.core.moves.set_limit(move_count);
        self
    }

    /// Without a motion clock: it is the hardware clock, and its commands do not exist.
    #[must_use]
    pub const fn without_motion_clock(mut self) -> Self {
        self.core.has_motion_clock = false;
        self
    }

    /// As a board that leaves temperature loops to its host.
    #[must_use]
    pub const fn without_heaters(mut self) -> Self {
        self.core.has_heaters = false;
        self
    }

    /// As a board that knows no check over blocks but the framing's own.
    #[must_use]
    pub const fn without_block_check(mut self) -> Self {
        self.core.receiver.without_check();
        self
    }

    /// As a board with plain Klipper firmware, which has none of these.
    #[must_use]
    pub const fn plain(self) -> Self {
        self.without_motion_clock().without_heaters().without_block_check()
    }

    /// Takes bytes from the host, in pieces of any size: answers and obeys.
    pub fn receive(&mut self, board: &mut impl Board, bytes: &[u8]) {
        let Self { deframer, core } = self;
        let now = board.now();
        core.timers.look(now);
        core.look(now);
        deframer.push(bytes, |frame| core.frame(board, frame));
    }

    /// Runs every timer that is due (not later than [`Board::now`]) and returns the clock at which to call it again,
    /// which is later than now; there always is one, for the clock has to be looked at every few seconds. Timers that
    /// never let up are left alone for a moment after a tenth of a millisecond, so that the main loop still runs.
    ///
    /// Called from the timer interrupt on a chip, by the event loop in a simulation; and whenever bytes have been
    /// received and tasks have run, since they may have started an earlier timer.
    pub fn run_timers(&mut self, board: &mut impl Board) -> Clock32 {
        self.core.run_timers(board)
    }

    /// Sends what is waiting: reports, and what found no room before. Called from the main loop.
    pub fn run_tasks(&mut self, board: &mut impl Board) {
        self.core.run_tasks(board);
    }

    /// Whether [`Self::run_tasks`] has something to do. It stays so while an acknowledgement, `starting` or `shutdown`
    /// finds no room.
    pub const fn has_tasks(&self) -> bool {
        self.core.has_tasks()
    }

    /// The motion clock at a clock that is not before the last call; docs/motion-clock.md says how it runs.
    pub fn motion_clock(&self, clock: Clock32) -> Clock32 {
        self.core.hold.clock.motion(clock)
    }

    /// Why the board is shut down, if it is.
    pub const fn shutdown_reason(&self) -> Option<ShutdownReason> {
        self.core.halt.reason()
    }
}

/// All but the deframer, whose buffer holds the block that is being obeyed.
pub(crate) struct Core<const OBJECTS: usize, const MOVES: usize> {
    pub(crate) objects: Objects<OBJECTS>,
    /// All timers, on the hardware clock. Those that wait on the motion clock are set to what that means, anew each
    /// time its rate changes; where it is out of reach they do not run.
    pub(crate) timers: Timers<OBJECTS>,
    pub(crate) moves: MovePool<MOVES>,
    pub(crate) receiver: Receiver,
    pub(crate) halt: Halt,
    pub(crate) hold: Hold,
    pub(crate) has_motion_clock: bool,
    pub(crate) heaters: Heaters,
    pub(crate) has_heaters: bool,
    /// The host's mark of the job whose rows are counted.
    pub(crate) job: u32,
    /// The host's mark of the configuration, once that is complete.
    pub(crate) config_crc: Option<u32>,
    pub(crate) uptime: Uptime,
    stats: Stats,
    /// When the clock has to be looked at again.
    look_at: Clock32,
    clock: Hertz,
    late_ticks: u32,
    starting: bool,
    pub(crate) reports_pending: bool,
}

impl<const OBJECTS: usize, const MOVES: usize> Core<OBJECTS, MOVES> {
    const fn new(clock: Hertz) -> Self {
        Self {
            objects: Objects::new(),
            timers: Timers::new(),
            moves: MovePool::new(),
            receiver: Receiver::new(),
            halt: Halt::new(),
            hold: Hold::new(clock),
            has_motion_clock: true,
            heaters: Heaters::new(clock),
            has_heaters: true,
            job: 0,
            config_crc: None,
            uptime: Uptime::new(),
            stats: Stats::new(clock),
            look_at: Clock32(0),
            clock,
            late_ticks: clock.0 / LATE_SECONDS_INVERSE,
            starting: true,
            reports_pending: false,
        }
    }

    fn frame(&mut self, board: &mut impl Board, frame: Frame<'_>) {
        match frame {
            Frame::Block { sequence, payload } => {
                if let Some(messages) = self.receiver.accept(sequence, payload) {
                    self.obey(board, sequence, messages);
                }
            }
            Frame::Garbage => self.receiver.garbage(),
        }
        self.receiver.acknowledge(board);
    }

    /// Obeys the messages of one block, in order.
    fn obey(&mut self, board: &mut impl Board, sequence: u8, messages: &[u8]) {
        let mut refused = false;
        let mut rest = messages;
        while !rest.is_empty() {
            // What follows a message that does not decode cannot be understood either.
            let Ok(command) = Command::decode(&mut rest) else {
                self.shut_down(board, ShutdownReason::CommandParser);
                return;
            };
            if matches!(command, Command::BlockCheck { .. })
                && self.receiver.met_check(sequence, messages, rest)
            {
                continue;
            }
            if self.halt.reason().is_some() && !is_allowed(&command) {
                // Once a block is enough: a block may hold many commands.
                if !refused && let Some(refusal) = self.halt.refusal() {
                    self.reply(board, &refusal);
                }
                refused = true;
            } else if let Err(reason) = self.dispatch(board, command) {
                self.shut_down(board, reason);
                // The announcement has just told the host; that is refusal enough for this block.
                refused = true;
            }
        }
    }

    /// Runs for every edge of every step: what is rare is kept out of line.
    fn run_timers(&mut self, board: &mut impl Board) -> Clock32 {
        let begin = board.now();
        let mut now = begin;
        self.timers.look(now);
        if !now.is_before(self.look_at) || self.stats.is_new() {
            self.look(now);
        }
        while let Some((oid, wake)) = self.timers.first() {
            if now.is_before(wake) {
                now = board.now();
                if now.is_before(wake) {
                    if !now.is_before(self.look_at) {
                        self.look(now);
                        continue;
                    }
                    return if self.look_at.is_before(wake) { self.next_look(now) } else { wake };
                }
                if now.since(begin) as u32 > self.late_ticks / BUSY_PART {
                    return now.wrapping_add(self.late_ticks / REST_PART + 1);
                }
            }
            if now.since(wake) as u32 > self.late_ticks {
                self.shut_down(board, ShutdownReason::TimerInPast);
                break;
            }
            if let Some(Object::Stepper(stepper)) = self.objects.get_mut(oid) {
                match stepper.event(board, &mut self.moves, &self.hold.clock, self.late_ticks) {
                    Ok(Some(next)) => self.timers.reschedule_first(next),
                    Ok(None) => self.timers.cancel(oid),
                    Err(reason) => self.shut_down(board, reason),
                }
            } else {
                self.run_timer(board, oid, wake);
            }
        }
        self.next_look(board.now())
    }

    /// When the clock has to be looked at again: after now, even where that is overdue.
    fn next_look(&self, now: Clock32) -> Clock32 {
        if now.is_before(self.look_at) { self.look_at } else { now.wrapping_add(1) }
    }

    /// Looks at the clock, which is due every few seconds and at every change of the motion clock.
    #[cold]
    #[inline(never)]
    pub(crate) fn look(&mut self, now: Clock32) {
        self.uptime.look(now);
        self.look_at = self.stats.look(now);
        self.hold.advance(now);
        self.reports_pending |= self.hold.report_pending;
        self.heaters.look(now);
        for at in [self.hold.event_at(), self.heaters.event_at()].into_iter().flatten() {
            if at.is_before(self.look_at) {
                self.look_at = at;
            }
        }
        if self.hold.take_retime() {
            self.retime();
        }
    }

    /// Sets the timers that wait on the motion clock, whose rate has changed.
    fn retime(&mut self) {
        let Self { objects, timers, hold, .. } = self;
        for (oid, object) in objects.iter_mut() {
            let wake = match object {
                Object::Stepper(stepper) => match stepper.motion_wake() {
                    Some(wake) => hold.clock.when(wake),
                    None => continue,
                },
                Object::DigitalOut(output) if output.is_tied() => output.wake(&hold.clock),
                _ => continue,
            };
            match wake {
                Some(wake) => timers.schedule(oid, wake),
                None => timers.cancel(oid),
            }
        }
    }

    /// The timers of everything but steppers.
    #[inline(never)]
    fn run_timer(&mut self, board: &mut impl Board, oid: u8, wake: Clock32) {
        let after = match self.objects.get_mut(oid) {
            Some(Object::DigitalOut(output)) => output.event(board, &mut self.moves, &self.hold.clock, wake),
            Some(Object::Endstop(endstop)) => Ok(endstop.event(board, wake)),
            Some(Object::AnalogIn(input)) => {
                let after = input.event(board, wake);
                self.reports_pending |= input.report_pending;
                if let Some(sum) = input.take_sum() {
                    self.heaters.feed(oid, sum);
                }
                after
            }
            Some(Object::Trsync(trsync)) => {
                let due = trsync.event(wake);
                self.reports_pending |= due == Due::Report;
                let next = trsync.wake().map_or(After::Done, After::Again);
                Ok(if let Due::Expired(reason) = due { After::Fire { trsync: oid, reason } } else { next })
            }
            Some(Object::Stepper(_) | Object::Heater | Object::Free) | None => Ok(After::Done),
        };
        match after {
            Ok(After::Again(next)) => self.timers.reschedule_first(next),
            Ok(After::Done) => self.timers.cancel(oid),
            Ok(After::Fire { trsync, reason }) => {
                self.timers.cancel(oid);
                self.fire(board, trsync, reason);
            }
            Err(reason) => self.shut_down(board, reason),
        }
    }

    /// Starts, moves or stops an object's timer. One that would be late from the start means that the host's message
    /// came too late.
    pub(crate) fn set_timer(
        &mut self,
        board: &mut impl Board,
        oid: u8,
        wake: Option<Clock32>,
    ) -> Result<(), ShutdownReason> {
        let Some(wake) = wake else {
            self.timers.cancel(oid);
            return Ok(());
        };
        if wake.is_before(board.now()) {
            return Err(ShutdownReason::TimerTooClose);
        }
        self.timers.schedule(oid, wake);
        Ok(())
    }

    /// Fires a trigger, once: the steppers that obey it stop.
    pub(crate) fn fire(&mut self, board: &mut impl Board, oid: u8, reason: u8) {
        let Ok(trsync) = self.objects.trsync(oid) else { return };
        if trsync.fire(reason, board.now()) {
            self.reports_pending = true;
            for (stepper_oid, object) in self.objects.iter_mut() {
                if let Object::Stepper(stepper) = object
                    && stepper.stop_on == Some(oid)
                    && stepper.stop(&mut self.moves)
                {
                    self.timers.cancel(stepper_oid);
                }
            }
        }
        match self.objects.trsync(oid).ok().and_then(|trsync| trsync.wake()) {
            Some(wake) => self.timers.schedule(oid, wake),
            None => self.timers.cancel(oid),
        }
    }

    /// Stops everything. Nothing leads out of it but the host's `clear_shutdown`, `config_reset` or `reset`.
    #[cold]
    #[inline(never)]
    pub(crate) fn shut_down(&mut self, board: &mut impl Board, reason: ShutdownReason) {
        if self.halt.enter(reason, board.now()) {
            self.stop_everything(board);
            self.announce(board);
        }
    }

    /// Stops everything and forgets the configuration.
    pub(crate) fn forget(&mut self, board: &mut impl Board) {
        self.stop_everything(board);
        self.objects.clear();
        self.heaters = Heaters::new(self.clock);
        self.config_crc = None;
        self.job = 0;
        self.halt.leave();
    }

    fn stop_everything(&mut self, board: &mut impl Board) {
        self.timers.clear();
        self.objects.shut_down(board);
        self.heaters.shut_down();
        self.moves.reset();
        self.hold = Hold::new(self.clock);
        self.reports_pending = false;
    }

    fn announce(&mut self, board: &mut impl Board) {
        if let Some(announcement) = self.halt.announcement() {
            self.halt.announce = !self.receiver.send(board, &announcement);
        }
    }

    /// Answers a command. An answer that finds no room is lost: the host asks again.
    pub(crate) fn reply(&self, board: &mut impl Board, message: &Response<'_>) {
        let _ = self.receiver.send(board, message);
    }

    const fn has_tasks(&self) -> bool {
        self.starting
            || self.halt.announce
            || self.reports_pending
            || self.heaters.is_due
            || self.stats.pending
            || self.receiver.is_ack_pending()
    }

    fn run_tasks(&mut self, board: &mut impl Board) {
        let begin = board.now();
        if self.starting {
            self.starting = !self.receiver.send(board, &Response::Starting {});
        }
        if self.halt.announce {
            self.announce(board);
        }
        if self.receiver.is_ack_pending() {
            self.receiver.acknowledge(board);
        }
        if self.reports_pending {
            self.reports_pending = false;
            self.report(board);
        }
        if self.heaters.is_due {
            self.run_heaters(board);
        }
        if self.hold.report_pending {
            self.hold.report_pending = false;
            self.report_motion(board);
        }
        if self.stats.pending {
            let stats = self.stats.take();
            self.reply(board, &stats);
        }
        self.stats.add(board.now().since(begin).unsigned_abs());
    }

    fn report(&mut self, board: &mut impl Board) {
        for (oid, object) in self.objects.iter_mut() {
            match object {
                Object::AnalogIn(input) if input.report_pending => {
                    let _ = self.receiver.send(board, &input.report(oid));
                    input.report_done();
                }
                Object::Stepper(stepper) if stepper.report_pending => {
                    stepper.report_pending = !self.receiver.send(board, &stepper.progress(oid, self.job));
                    self.reports_pending |= stepper.report_pending;
                }
                Object::Trsync(trsync) if trsync.report_pending => {
                    trsync.report_pending = false;
                    let _ = self.receiver.send(board, &trsync.state(oid));
                }
                _ => {}
            }
        }
    }
}
