//! Taking up a print that another host had put aside: the head is parked, or on its way. What that host was about to do with
//! it is dropped at rest; then the print is paused, as it was.

use std::collections::VecDeque;

use units::{Clock32, Seconds, Ticks};

use super::{Ready, hold::Purpose, rate::Rate, take_up::Rest};
use crate::{
    config::PrinterConfig,
    error::{ErrorCode, PrinterError},
    journal::{BoardQueue, Continuation, Parked, TimedDue},
    machine::{self, EXTRUDER, Motors},
    planner::{Planner, TimedAction},
    session::{
        board::Board,
        diary::Diary,
        job::{Job, JobOptions, JobState, Paused, Retracted},
        kept::Left,
        stream::{Cut, Due, Run, leaves_hot},
    },
};

impl Ready {
    /// A machine whose board counts for a print that another host has put aside. It stays paused.
    pub(super) fn take_up_parked(
        config: PrinterConfig,
        board: Board,
        mut taken: Continuation,
        parked: &Parked,
        queue: &BoardQueue,
        options: JobOptions,
        now: Seconds,
    ) -> Result<Self, (Box<Board>, PrinterError)> {
        let motors = Motors::new(&config);
        let inverted = board.layout.steppers.map(|oids| oids.is_some_and(|oids| oids.invert_dir));
        let signed = |motor: usize, steps: i32| if inverted[motor] { steps.wrapping_neg() } else { steps };
        let counts = queue.motors.map(|motor| motor.position);
        let since = core::array::from_fn(|motor| {
            signed(motor, counts[motor].wrapping_sub(parked.motors[motor].position))
        });
        let places = motors
            .moved(&taken.position_at_start, taken.made)
            .and_then(|position| Some((position, motors.moved(&position, since)?)));
        let Some((position, here)) = places else {
            let detail = "the motors' counts belong to no place of the head";
            return Err((Box::new(board), PrinterError::new(ErrorCode::ContinuationRefused, detail)));
        };
        let planner = match Planner::new(&config, board.clock) {
            Ok(planner) => planner,
            Err(error) => return Err((Box::new(board), error)),
        };
        let extruder_step_mm = machine::step_distances(&config)[EXTRUDER].0;
        let mut rest = Rest::of(&mut taken);
        let mut diary = Diary::default();
        diary.take_up(&taken, now);
        let mut ready = Self::with_planner(config, board, planner, now);
        (ready.diary, ready.rate, ready.off_mm) = (diary, Rate::unknown(), taken.off_mm);
        ready.planner.set_same_transform(&taken.planner);
        ready.planner.stand_at(here);
        let homed = taken.planner.guard.homed();
        (0..3).for_each(|axis| ready.planner.guard.set_homed(axis, homed[axis]));
        ready.stream.stand_at(counts, here);
        let run = Run { start: Ticks(0), end: taken.end, homing: false };
        let mut cut = Cut {
            run,
            // Of the clocks 32 bits are known, and the rest came soon after what had been made.
            at: taken.made_until.nearest(Clock32(parked.rest.wrapping_sub(taken.start.0))),
            left: Left { rows: taken.backlog, from: taken.from, fan: 0.0, fans: VecDeque::new() },
            forward: taken.forward,
            made: core::array::from_fn(|motor| signed(motor, taken.made[motor])),
            position_at_start: taken.position_at_start,
            elapsed: taken.elapsed,
            timeline: VecDeque::new(),
        };
        for (at, due) in taken.timeline {
            match due {
                TimedDue::Move(planned, pace) if at > cut.at => {
                    cut.timeline.push_back((at, Due::MoveEnd(ready.scheduled(&planned, run), pace)));
                }
                TimedDue::Action(_, TimedAction::Fan { speed, .. }) if at > cut.at => {
                    cut.left.fans.push_back((at, speed));
                }
                TimedDue::Action(line, action) if at > cut.at => {
                    cut.timeline.push_back((at, Due::Action(line, action)));
                }
                TimedDue::Action(_, action) => rest.pass(&action),
                TimedDue::Move(..) => {}
            }
        }
        taken.adopted.iter().for_each(|&input| rest.adopt(input));
        cut.left.fan = rest.fan();
        let leaves_hot = leaves_hot(&cut.timeline, rest.is_nozzle_on());
        let could_extrude = rest.is_nozzle_on() || parked.retract > 0.0;
        let mut job = Job::new(options, machine::gcode_settings(&ready.config));
        job.source = taken.source;
        job.has_moved = true;
        job.leaves_hot = leaves_hot;
        job.told = now;
        job.state = JobState::Halting;
        job.paused = Some(Paused {
            planner: Box::new(taken.planner),
            position,
            homed,
            could_extrude,
            targets: rest.targets,
            start: None,
            rest: None,
            cut: Some(Box::new(cut)),
            retracted: retracted(parked, position[EXTRUDER], here[EXTRUDER], extruder_step_mm),
        });
        ready.job = Some(job);
        ready.hold_motion(Purpose::Parked, now);
        Ok(ready)
    }
}

/// What was pulled back of the filament, as far as the other host came: to the very step, unless somebody moved it.
fn retracted(parked: &Parked, cut: f64, here: f64, step_mm: f64) -> Option<Retracted> {
    if parked.retract <= 0.0 {
        return None;
    }
    let is_on_the_way = (cut - parked.retract - step_mm..=cut + step_mm / 2.0).contains(&here);
    Some(Retracted { from: if is_on_the_way { cut } else { here + parked.retract }, to: here })
}
