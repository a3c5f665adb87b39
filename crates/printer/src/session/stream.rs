//! The stream of motion: step commands from the planner onto the board's motion clock, just far enough ahead.
//!
//! A run of motion gets a start clock when its first move is planned; from then on every step is that clock plus the
//! plan's own ticks, so that the same run gives the same intervals whenever it starts. All clocks here are the board's
//! motion clock, unless they say otherwise: a hold delays everything alike. Knows nothing of G-code.

use std::collections::VecDeque;

use steps::{StepCommand, StepCommandKind};
use units::{Seconds, Ticks};
use wire::Command;

pub(super) use super::run::{Cut, Due, Run, TakenUp, leaves_hot};
use super::{
    board::{Board, FAN_LANE},
    event::ScheduledMove,
    kept::{KEPT_AFTER, Kept},
};
use crate::{
    error::PrinterError,
    journal::{MotorQueue, Row, RowPlace},
    link::Lane,
    machine::{MOTORS, Motors},
    pace::Pace,
    planner::Position,
};

/// With less than this ahead and no more G-code at hand, the machine is brought to rest on what there is.
pub(super) const STARVED: Seconds = Seconds(1.0);
/// A motor's lane that has less room than this takes no more: one command of the planner's is at most three messages.
const LANE_ROOM_MIN: usize = 3;
/// The most things that wait for their clock.
const TIMELINE_MAX: usize = 16_384;
/// Motors are switched on this long before their first step.
const ENABLE_LEAD: Seconds = Seconds(0.02);
/// After its last step a run counts as ended only this much later: the board's clock is an estimate.
const SETTLE: Seconds = Seconds(0.02);

/// What has to be said to a motor before its next steps.
#[derive(Clone, Copy, Debug, Default)]
struct Pending {
    reset: bool,
    forward: Option<bool>,
}

/// The stream of motion.
#[derive(Debug, Default)]
pub(super) struct MotionStream {
    run: Option<Run>,
    pending: [Pending; MOTORS],
    timeline: VecDeque<(Ticks, Due)>,
    enabled: [bool; MOTORS],
    /// The hardware clock at which each motor's driver was last switched: the next switch must come later.
    switched: [Ticks; MOTORS],
    /// The direction of each motor's next steps, as planned …
    planned_forward: [bool; MOTORS],
    /// … and the level of its direction pin for them: high counts up.
    forward: [bool; MOTORS],
    /// Where the board counts each motor to be once all of its steps have been made.
    counts: [i32; MOTORS],
    /// The same at the start of the run, and the machine's position there.
    counts_at_start: [i32; MOTORS],
    position_at_start: Position,
    /// Print time of the runs that have ended.
    elapsed: Seconds,
    /// What the board may not have made yet.
    pub(super) kept: Kept,
    /// Rows that the board has dropped, before those that are pushed next, and each motor's direction after them.
    again: [VecDeque<Row>; MOTORS],
    again_forward: [bool; MOTORS],
}

impl MotionStream {
    /// The run that is being made, if there is one.
    pub(super) const fn run(&self) -> Option<Run> {
        self.run
    }

    /// Print time of all runs so far, without those that home.
    pub(super) fn elapsed(&self, clock_now: Ticks, board: &Board) -> Seconds {
        let running = self.run.filter(|run| !run.homing).map_or(Seconds::ZERO, |run| {
            let until = run.end.map_or(clock_now, |end| end.min(clock_now));
            board.clock.duration_of(until.saturating_sub(run.start))
        });
        self.elapsed + running
    }

    /// Forgets the print time of what was before.
    pub(super) fn reset_elapsed(&mut self) {
        self.elapsed = Seconds::ZERO;
    }

    /// Whether the planner should be asked for more. A run of which everything has been generated has yet to be ended.
    pub(super) fn wants_more(&self, generated_until: Option<Ticks>, clock_now: Ticks, board: &Board) -> bool {
        let has_room = |motor| board.link.room(Lane::Motion(motor as u8)) >= LANE_ROOM_MIN;
        self.timeline.len() < TIMELINE_MAX
            && !self.kept.is_full()
            && self.again.iter().all(VecDeque::is_empty)
            && (0..MOTORS).all(has_room)
            && self
                .run
                .zip(generated_until)
                .is_none_or(|(run, until)| run.start + until < clock_now + board.horizon())
    }

    /// Whether the motion planned so far ends soon.
    pub(super) fn is_starving(&self, planned_until: Seconds, clock_now: Ticks, board: &Board) -> bool {
        self.run.is_some_and(|run| run.start + board.ticks(planned_until) < clock_now + board.ticks(STARVED))
    }

    /// A run starts as soon as the link allows.
    pub(super) fn start_run(&mut self, position: Position, board: &Board, now: Seconds, homing: bool) -> Run {
        // A driver that has just been switched off is first on again.
        let ready = self.switched().saturating_sub(board.clock_at(now)) + board.ticks(ENABLE_LEAD * 2.0);
        let start = board.run_clock(now).max(board.motion_at(now) + ready);
        let run = Run { start, end: None, homing };
        self.run = Some(run);
        self.counts_at_start = self.counts;
        self.position_at_start = position;
        self.pending = [Pending { reset: true, forward: None }; MOTORS];
        self.kept.begin(Default::default());
        run
    }

    /// The hardware clock at which the last driver was switched, or will be.
    pub(super) fn switched(&self) -> Ticks {
        self.switched.iter().fold(Ticks(0), |last, &clock| last.max(clock))
    }

    /// Switches a motor's driver on before its first step at `at`.
    fn enable(&mut self, motor: usize, at: Ticks, board: &mut Board, now: Seconds) {
        if self.enabled[motor] {
            return;
        }
        self.enabled[motor] = true;
        let mut clock = board.hardware_of(at, now).saturating_sub(board.ticks(ENABLE_LEAD));
        if board.motion.may_rest() {
            // Held where the motor is about to make its first step, which then waits too.
            clock = clock.max(board.output_clock(now));
        }
        self.switched[motor] = clock;
        Self::switch_driver(motor, true, clock, board);
    }

    /// Whether any driver is on.
    pub(super) fn any_enabled(&self) -> bool {
        self.enabled.contains(&true)
    }

    /// Switches drivers off, at rest.
    pub(super) fn disable(&mut self, motors: [bool; MOTORS], board: &mut Board, now: Seconds) {
        let clock = board.output_clock(now);
        for motor in (0..MOTORS).filter(|&motor| motors[motor]) {
            if core::mem::take(&mut self.enabled[motor]) {
                let clock = clock.max(self.switched[motor] + Ticks(1));
                self.switched[motor] = clock;
                Self::switch_driver(motor, false, clock, board);
            }
        }
    }

    fn switch_driver(motor: usize, on: bool, clock: Ticks, board: &mut Board) {
        let Some(enable) = board.layout.steppers[motor].and_then(|oids| oids.enable) else { return };
        let on_ticks = enable.on_ticks(f64::from(u8::from(on)));
        board.control_at(
            &Command::QueueDigitalOut { oid: enable.oid.0, clock: clock.low().0, on_ticks },
            clock,
        );
    }

    /// A motor's next step command, of the run that is being made.
    pub(super) fn push(&mut self, command: &StepCommand, board: &mut Board, now: Seconds) {
        let motor = command.motor;
        match command.kind {
            StepCommandKind::SetDir { forward } => self.turn(motor, forward, board),
            StepCommandKind::QueueStep { interval, count, add } => {
                let forward = self.planned_forward[motor];
                let row = Row { interval, count, add, forward, start: command.start, end: command.end };
                self.send(motor, &row, board, now);
            }
        }
    }

    /// The direction of a motor's steps from here on. The order travels with the steps that it is for.
    fn turn(&mut self, motor: usize, forward: bool, board: &Board) {
        let Some(oids) = board.layout.steppers[motor] else { return };
        self.planned_forward[motor] = forward;
        self.forward[motor] = forward != oids.invert_dir;
        self.pending[motor].forward = Some(forward);
    }

    fn send(&mut self, motor: usize, row: &Row, board: &mut Board, now: Seconds) {
        let (Some(run), Some(oids)) = (self.run, board.layout.steppers[motor]) else { return };
        let oid = oids.stepper.0;
        let due = run.start + row.first();
        self.enable(motor, due, board, now);
        let Pending { reset, forward } = core::mem::take(&mut self.pending[motor]);
        if reset {
            let clock = run.start + row.start;
            board.motion(motor, &Command::ResetStepClock { oid, clock: clock.low().0 }, due, None);
        }
        if let Some(forward) = forward {
            let dir = u8::from(forward != oids.invert_dir);
            board.motion(motor, &Command::SetNextStepDir { oid, dir }, due, None);
        }
        let Row { interval, count, add, .. } = *row;
        let made = i32::from(count);
        self.counts[motor] = self.counts[motor].wrapping_add(if self.forward[motor] { made } else { -made });
        let end = run.start + row.end;
        board.motion(motor, &Command::QueueStep { oid, interval, count, add }, due, Some(end));
        if board.layout.has_motion_clock && !run.homing {
            self.kept.push(motor, *row);
        }
    }

    /// Forgets what has been made for certain.
    pub(super) fn forget_made(&mut self, motion_now: Ticks, board: &Board) {
        if let Some(run) = self.run {
            let made_until = motion_now.saturating_sub(run.start).saturating_sub(board.ticks(KEPT_AFTER));
            self.kept.forget(made_until, motion_now);
        }
    }

    /// Takes up a run that the board holds.
    pub(super) fn take_up(&mut self, taken: &TakenUp) -> Run {
        let run = Run { start: taken.start, end: taken.end, homing: false };
        self.run = Some(run);
        self.counts = taken.counts;
        self.counts_at_start = taken.counts_at_start;
        self.position_at_start = taken.position_at_start;
        self.elapsed = taken.elapsed;
        self.enabled = [true; MOTORS];
        run
    }

    /// The board's motors stand, at rest, where they do at this position; their drivers are on.
    pub(super) const fn stand_at(&mut self, counts: [i32; MOTORS], position: Position) {
        self.counts = counts;
        self.counts_at_start = counts;
        self.position_at_start = position;
        self.enabled = [true; MOTORS];
    }

    /// Gives a board that has dropped its queue the steps again that it had not made, before those that are pushed next:
    /// those of a host before, whose drivers are on as far as anybody knows. `forward` is the direction that holds after
    /// them, `from` where the board counts from.
    pub(super) fn give_again(
        &mut self,
        backlog: &[VecDeque<Row>; MOTORS],
        forward: [bool; MOTORS],
        from: [RowPlace; MOTORS],
        board: &mut Board,
        now: Seconds,
    ) {
        let clock = board.output_clock(now);
        for motor in 0..MOTORS {
            self.switched[motor] = clock;
            Self::switch_driver(motor, true, clock, board);
        }
        self.begin_again(backlog.clone(), forward, from, board);
        self.send_again(board, now);
    }

    fn begin_again(
        &mut self,
        rows: [VecDeque<Row>; MOTORS],
        forward: [bool; MOTORS],
        from: [RowPlace; MOTORS],
        board: &Board,
    ) {
        self.kept.begin(from);
        for motor in 0..MOTORS {
            self.pending[motor].reset = true;
            self.turn(motor, rows[motor].front().map_or(forward[motor], |row| row.forward), board);
        }
        self.again = rows;
        self.again_forward = forward;
    }

    /// Sends rows again, as far as there is room.
    pub(super) fn send_again(&mut self, board: &mut Board, now: Seconds) {
        for motor in 0..MOTORS {
            while board.link.room(Lane::Motion(motor as u8)) >= LANE_ROOM_MIN
                && let Some(row) = self.again[motor].pop_front()
            {
                if row.forward != self.planned_forward[motor] {
                    self.turn(motor, row.forward, board);
                }
                self.send(motor, &row, board, now);
                let after = self.again_forward[motor];
                if self.again[motor].is_empty() && after != row.forward {
                    self.turn(motor, after, board);
                }
            }
        }
    }

    /// The board has dropped its queue at rest on the path, at the motion clock `at`, and says where its motors stand: what
    /// is left of the run is put aside. Nothing where no run was being made.
    pub(super) fn cut(
        &mut self,
        queues: &[MotorQueue; MOTORS],
        at: Ticks,
        board: &mut Board,
    ) -> Result<Option<Cut>, PrinterError> {
        for (motor, queue) in queues.iter().enumerate() {
            self.counts[motor] = queue.position;
        }
        let Some(run) = self.run else { return Ok(None) };
        let again = core::mem::take(&mut self.again);
        let mut forward = self.planned_forward;
        let mut left = self.kept.cut(queues)?;
        for (motor, rows) in again.into_iter().enumerate() {
            if !rows.is_empty() {
                forward[motor] = self.again_forward[motor];
                left.rows[motor].extend(rows);
            }
        }
        let timeline = core::mem::take(&mut self.timeline);
        let cut = Cut {
            run,
            at,
            left,
            forward,
            made: core::array::from_fn(|motor| self.counts[motor].wrapping_sub(self.counts_at_start[motor])),
            position_at_start: self.position_at_start,
            elapsed: self.elapsed,
            timeline,
        };
        self.abandon(board);
        Ok(Some(cut))
    }

    /// Goes on with a run that was put aside, at the motion clock `at` of another rest: gives the moves that are to be made
    /// of it. What else was to happen happens so much later as well.
    pub(super) fn rejoin(&mut self, cut: Cut, at: Ticks, board: &Board) -> (Run, Vec<ScheduledMove>) {
        let Cut { run, at: was, left, forward, made, position_at_start, elapsed, timeline } = cut;
        let later = |clock: Ticks| Ticks((clock.0 + at.0).saturating_sub(was.0));
        let run = Run { start: later(run.start), end: run.end.map(later), ..run };
        self.run = Some(run);
        self.counts_at_start = core::array::from_fn(|motor| self.counts[motor].wrapping_sub(made[motor]));
        self.position_at_start = position_at_start;
        self.elapsed = elapsed;
        self.begin_again(left.rows, forward, left.from, board);
        for (clock, speed) in left.fans {
            self.kept.push_fan(later(clock), speed);
        }
        let mut moves = Vec::new();
        for (clock, due) in timeline {
            let due = match due {
                Due::MoveEnd(mv, pace) => {
                    let mv = mv.at(later);
                    moves.push(mv);
                    Due::MoveEnd(mv, pace)
                }
                due @ Due::Action(..) => due,
            };
            self.timeline.push_back((later(clock), due));
        }
        (run, moves)
    }

    /// Something happens when the board's clock gets to `at`. In the order of the clocks.
    pub(super) fn schedule(&mut self, at: Ticks, due: Due) {
        self.timeline.push_back((at, due));
    }

    /// The next thing whose clock has come.
    pub(super) fn pop_due(&mut self, clock_now: Ticks) -> Option<Due> {
        self.timeline.pop_front_if(|(at, _)| *at <= clock_now).map(|(_, due)| due)
    }

    /// The pace of the move that is being made, or comes next; nothing behind the last that is planned.
    pub(super) fn pace(&self) -> Option<Pace> {
        self.timeline.iter().find_map(|(_, due)| match due {
            Due::MoveEnd(_, pace) => Some(*pace),
            Due::Action(..) => None,
        })
    }

    /// Whether the nozzle is on once all that has been planned has been made.
    pub(super) fn leaves_hot(&self, is_hot: bool) -> bool {
        leaves_hot(&self.timeline, is_hot)
    }

    /// The run's last move has been planned; it ends at this clock.
    pub(super) fn end_run(&mut self, at: Ticks) {
        if let Some(run) = &mut self.run {
            run.end = Some(at);
        }
    }

    /// A run that has been made to its end; it is then forgotten.
    pub(super) fn take_finished(&mut self, clock_now: Ticks, board: &Board) -> Option<Run> {
        let run = self.run?;
        let end = run.end?;
        if clock_now <= end + board.ticks(SETTLE) || !self.timeline.is_empty() {
            return None;
        }
        if !run.homing {
            self.elapsed += board.clock.duration_of(end - run.start);
        }
        self.run = None;
        Some(run)
    }

    /// What has not been sent would reach a board that has dropped what was before it.
    pub(super) fn forget_unsent(board: &mut Board) {
        (0..=FAN_LANE).for_each(|lane| board.link.forget_motion(lane as u8));
    }

    /// Drops what has not been sent: the motors were stopped by something else. Whether there was a run.
    pub(super) fn abandon(&mut self, board: &mut Board) -> bool {
        for motor in 0..MOTORS {
            board.link.forget_motion(motor as u8);
        }
        self.timeline.clear();
        self.again = Default::default();
        self.run.take().is_some()
    }

    /// The board says where it counts a motor to be, at rest.
    pub(super) const fn set_count(&mut self, motor: usize, count: i32) {
        self.counts[motor] = count;
    }

    /// Where the board counts a motor to be once all of its steps have been made.
    pub(super) const fn count(&self, motor: usize) -> i32 {
        self.counts[motor]
    }

    /// Where the machine stands, in mm, from where the board counts its motors to be: the present run was broken off. None
    /// where no head could be.
    pub(super) fn position_of(
        &self,
        counts: [i32; MOTORS],
        motors: &Motors,
        board: &Board,
    ) -> Option<Position> {
        let made = core::array::from_fn(|motor: usize| {
            let made = counts[motor].wrapping_sub(self.counts_at_start[motor]);
            let is_inverted = board.layout.steppers[motor].is_some_and(|oids| oids.invert_dir);
            if is_inverted { made.wrapping_neg() } else { made }
        });
        motors.moved(&self.position_at_start, made)
    }

    /// The clock up to which the board has all steps of the run: that of the first which it has not acknowledged, or
    /// the end of what has been generated. `None` where no run is being made.
    pub(super) fn covered(&self, generated_until: Option<Ticks>, board: &Board) -> Option<Ticks> {
        let run = self.run?;
        let generated = run.end.or(generated_until.map(|until| run.start + until))?;
        let again =
            self.again.iter().filter_map(|rows| rows.front()).map(|row| run.start + row.first()).min();
        let waiting = board.link.motion_covered().into_iter().chain(again).min();
        Some(waiting.map_or(generated, |waiting| waiting.min(generated)))
    }
}
