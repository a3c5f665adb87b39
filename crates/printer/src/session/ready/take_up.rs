//! Taking up what another host began: the board holds its motion, and the plan has been made again up to there.
//!
//! The board's queue is of no more use, since nobody knows which changes of outputs are in it: at the user's word it is
//! dropped, and the very same steps are given again, on the same motion clock.

use std::collections::VecDeque;

use units::{Celsius, Seconds, Ticks};

use super::{Ready, rate::Rate};
use crate::{
    config::PrinterConfig,
    error::{ErrorCode, PrinterError},
    journal::{BoardQueue, Continuation, Input, MotorQueue, Row, RowPlace, TimedDue},
    machine::{self, MOTORS},
    planner::TimedAction,
    session::{
        board::Board,
        diary::Diary,
        job::{Job, JobOptions},
        stream::{Due, TakenUp},
    },
};

/// Commands that are not answered are given again after this long.
const ASK_AGAIN: Seconds = Seconds(0.3);

/// What is left of a run that another host began.
#[derive(Clone, Debug)]
pub(super) struct Rest {
    backlog: [VecDeque<Row>; MOTORS],
    /// Each motor's direction after that.
    forward: [bool; MOTORS],
    from: [RowPlace; MOTORS],
    pub(super) targets: Vec<(gcode::Heater, Celsius)>,
    fan: f64,
    /// Changes of the fan's speed that are yet to come, on the motion clock.
    fans: Vec<(Ticks, f64)>,
    asked: Seconds,
}

impl Ready {
    /// A machine whose board holds a print that another host began, and the plan for it. It stays held.
    pub(in crate::session) fn take_up(
        config: PrinterConfig,
        board: Board,
        mut taken: Continuation,
        queue: &BoardQueue,
        options: JobOptions,
        now: Seconds,
    ) -> Result<Self, (Box<Board>, PrinterError)> {
        if let Some(parked) = taken.parked {
            return Self::take_up_parked(config, board, taken, &parked, queue, options, now);
        }
        let motion_now = board.motion_at(now);
        let mut start = motion_now.saturating_sub(taken.made_until).nearest(taken.start);
        // A run that has come to its end is over, however long ago: of its clock only 32 bits are known.
        if let Some(end) = taken.end.filter(|_| !queue.is_held) {
            while start + end > motion_now && start.0 > 1 << 32 {
                start = Ticks(start.0 - (1 << 32));
            }
        }
        let clocks = taken.backlog.iter().zip(&queue.motors).filter(|(_, motor)| motor.left > 0);
        let agrees = |(rows, motor): (&VecDeque<Row>, &MotorQueue)| {
            rows.front().is_some_and(|row| (start + row.first()).low() == motor.next)
        };
        if !clocks.into_iter().all(agrees) {
            let detail = "the board's clock is not where the plan has it";
            return Err((Box::new(board), PrinterError::new(ErrorCode::ContinuationRefused, detail)));
        }
        let inverted = board.layout.steppers.map(|oids| oids.is_some_and(|oids| oids.invert_dir));
        let mut diary = Diary::default();
        diary.take_up(&taken, now);
        let mut rest = Rest::of(&mut taken);
        let mut ready = Self::with_planner(config, board, taken.planner, now);
        let counts = queue.motors.map(|motor| motor.position);
        let made = |motor: usize| if inverted[motor] { -taken.made[motor] } else { taken.made[motor] };
        (ready.diary, ready.rate, ready.off_mm) = (diary, Rate::unknown(), taken.off_mm);
        let run = ready.stream.take_up(&TakenUp {
            start,
            end: taken.end.map(|end| start + end),
            counts,
            counts_at_start: core::array::from_fn(|motor| counts[motor].wrapping_sub(made(motor))),
            position_at_start: taken.position_at_start,
            elapsed: taken.elapsed,
        });
        rest.backlog = taken.backlog;
        for (at, due) in taken.timeline {
            let at = start + at;
            match due {
                TimedDue::Move(planned, pace) if at > motion_now => ready.schedule_move(&planned, pace, run),
                TimedDue::Action(_, TimedAction::Fan { speed, .. }) if at > motion_now => {
                    rest.fans.push((at, speed));
                }
                TimedDue::Action(line, action) if at > motion_now => {
                    ready.stream.schedule(at, Due::Action(line, action));
                }
                TimedDue::Action(_, action) => rest.pass(&action),
                TimedDue::Move(..) => {}
            }
        }
        taken.adopted.iter().for_each(|&input| rest.adopt(input));
        let mut job = Job::new(options, machine::gcode_settings(&ready.config));
        job.source = taken.source;
        job.has_moved = true;
        job.leaves_hot = ready.stream.leaves_hot(rest.is_nozzle_on());
        job.told = now;
        ready.job = Some(job);
        ready.hold_for_host(rest);
        Ok(ready)
    }

    /// The board has dropped what another host gave it: it gets it again, with what the print had set by then.
    pub(super) fn rejoin(&mut self, rest: &Rest, now: Seconds) {
        let Some(run) = self.stream.run() else { return };
        self.diary.count(run.start, rest.from, &mut self.board);
        self.stream.give_again(&rest.backlog, rest.forward, rest.from, &mut self.board, now);
        self.stream.kept.set_fan(rest.fan);
        self.thermal.set_fan(rest.fan, None, &mut self.board, now);
        for &(at, speed) in &rest.fans {
            self.stream.kept.push_fan(at, speed);
        }
    }
}

impl Rest {
    /// What heaters and fan had been told by then, with nothing to be made yet.
    pub(super) fn of(taken: &mut Continuation) -> Self {
        Self {
            backlog: Default::default(),
            forward: taken.forward,
            from: taken.from,
            targets: core::mem::take(&mut taken.targets),
            fan: taken.fan,
            fans: Vec::new(),
            asked: Seconds(f64::NEG_INFINITY),
        }
    }

    /// The part fan's speed.
    pub(super) const fn fan(&self) -> f64 {
        self.fan
    }

    /// What the user had set last.
    pub(super) fn adopt(&mut self, input: Input) {
        match input {
            Input::Target(heater, celsius) => {
                let (heater, target) = (heater.heater(), Celsius(celsius));
                self.pass(&TimedAction::SetTemperature { heater, target });
            }
            Input::Fan(speed) => self.fan = speed,
            Input::FinishRun | Input::Speed(_) | Input::Flow(_) => {}
        }
    }

    /// Whether the print had the nozzle hot.
    pub(super) fn is_nozzle_on(&self) -> bool {
        self.targets
            .iter()
            .any(|&(heater, target)| heater == gcode::Heater::Tool(0) && target > Celsius::ZERO)
    }

    /// An action whose time has passed.
    pub(super) fn pass(&mut self, action: &TimedAction) {
        match *action {
            TimedAction::SetTemperature { heater, target } => {
                self.targets.retain(|(known, _)| *known != heater);
                self.targets.push((heater, target));
            }
            TimedAction::TurnOffHeaters => self.targets.clear(),
            TimedAction::Fan { speed, .. } => self.fan = speed,
            _ => {}
        }
    }

    /// Has a board that does not hold do so: what is to be dropped is dropped at rest.
    pub(super) fn stop(&mut self, ramp: Seconds, board: &mut Board, now: Seconds) {
        if now - self.asked >= ASK_AGAIN && !board.motion.is_held() {
            self.asked = now;
            let ramp = board.ticks(ramp);
            board.hold_motion(ramp, now);
        }
    }
}
