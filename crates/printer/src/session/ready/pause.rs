//! A job that is put aside in the middle of a run of motion, on boards that can hold it: motion comes to rest on its path,
//! the board drops what it has, and the head is parked. On the way back the head goes to where every motor stood, motion is
//! held again, and the very same steps are given from the next one on. To the job's plan nothing has happened.

use units::{Mm, MmPerS, Seconds};

use super::{Failure, Ready, hold::Purpose};
use crate::{
    error::{ErrorCode, PrinterError},
    journal::MotorQueue,
    machine::{EXTRUDER, MOTORS, Motors},
    planner::{ExtrusionPermit, Planner},
    reach::Reach,
    session::{
        event::Event,
        job::{JobState, Paused, RETURN_FEED, Retracted},
        stream::Cut,
    },
};

/// The filament is pulled back by this much where the machine file has no `[firmware_retraction]` …
const RETRACT: Mm = Mm(1.0);
/// … and so fast.
const RETRACT_SPEED: MmPerS = MmPerS(20.0);

/// Counts that no machine can have.
fn impossible() -> Failure {
    let detail = "the motors' counts belong to no place of the head";
    Failure::Stop(PrinterError::new(ErrorCode::Internal, detail))
}

/// Where the head is parked. An axis that is not homed stays where it is, as does one that has no place to go to.
fn park_place(at: [f64; 2], homed: [bool; 3], places: [Option<Mm>; 2], reach: &Reach) -> [f64; 2] {
    let places: [Option<f64>; 2] =
        core::array::from_fn(|axis| places[axis].filter(|_| homed[axis]).map(|place| place.0));
    let within = reach.clamped(core::array::from_fn(|axis| places[axis].unwrap_or(at[axis])));
    core::array::from_fn(|axis| places[axis].map_or(at[axis], |_| within[axis]))
}

impl Ready {
    /// The board has dropped the run that was being made, and its motors stand where they say: the job is put aside, and
    /// another planner moves the machine until it goes on.
    pub(super) fn put_aside(
        &mut self,
        queues: &[MotorQueue; MOTORS],
        targets: Vec<(gcode::Heater, units::Celsius)>,
        could_extrude: bool,
        now: Seconds,
    ) -> Result<(), Failure> {
        let at = self.board.motion_at(now);
        let cut = self.stream.cut(queues, at, &mut self.board).map_err(Failure::Stop)?;
        self.lease.forget();
        self.events.push(Event::RunBroken { at });
        let counts = queues.map(|queue| queue.position);
        let position = match &cut {
            Some(cut) => {
                self.thermal.forget_fan_orders();
                self.set_fan_now(cut.left.fan, now);
                self.stream
                    .position_of(counts, &Motors::new(&self.config), &self.board)
                    .ok_or_else(impossible)?
            }
            None => self.planner.position(),
        };
        let retracted = self.retraction(position[EXTRUDER]);
        let retract = retracted.map_or(0.0, |of| of.from - of.to);
        self.diary.park(queues, cut.is_some(), at, retract, &mut self.board);
        let homed = self.planner.guard.homed();
        let mut aside = Planner::new(&self.config, self.board.clock).map_err(Failure::Stop)?;
        aside.set_same_transform(&self.planner);
        aside.stand_at(position);
        (0..3).for_each(|axis| aside.guard.set_homed(axis, homed[axis]));
        if cut.is_none() {
            // The run was over before motion rested: what comes next waits.
            self.hold_wait(now);
        }
        let planner = Box::new(core::mem::replace(&mut self.planner, aside));
        if let Some(job) = &mut self.job {
            job.paused = Some(Paused {
                planner,
                position,
                homed,
                could_extrude,
                targets,
                start: None,
                rest: Some(at),
                cut: cut.map(Box::new),
                retracted,
            });
        }
        Ok(())
    }

    /// Motion is set going again, with nothing in the board's queue: the head leaves the part.
    pub(super) fn park(&mut self, now: Seconds) {
        let Some(job) = self.job.as_mut().filter(|job| job.state == JobState::Halting) else { return };
        job.state = JobState::Parking;
        if let Err(error) = self.plan_park() {
            self.source_failed(error, now);
        }
    }

    /// How far the filament is pulled back, if that is possible.
    fn retraction(&self, from: f64) -> Option<Retracted> {
        let length = self.config.firmware_retraction.as_ref().map_or(RETRACT, |it| it.retract_length);
        let may_retract = length > Mm(0.0)
            && self.config.extruder.is_some()
            && self.extrusion_permit() == ExtrusionPermit::Allowed;
        may_retract.then_some(Retracted { from, to: from - length.0 })
    }

    /// Pulls the filament back, lifts, and goes to the place that the machine file names, as far as that is safe.
    fn plan_park(&mut self) -> Result<(), PrinterError> {
        let mut to = self.planner.position();
        let homed = self.planner.guard.homed();
        let Some(paused) = self.job.as_ref().and_then(|job| job.paused.as_ref()) else { return Ok(()) };
        if paused.could_extrude && self.extrusion_permit() != ExtrusionPermit::Allowed {
            // It sticks to the part.
            return Ok(());
        }
        let retracted = paused.retracted;
        if let Some(retracted) = retracted {
            to[EXTRUDER] = retracted.to;
            let speed = self.config.firmware_retraction.as_ref().map(|it| it.retract_speed);
            self.planner.push_raw_move(to, speed.unwrap_or(RETRACT_SPEED), gcode::LineNumber(0))?;
        }
        if homed[2] {
            let [x, y, z, _] = to;
            let reach = Reach::new(&self.config);
            to[2] = reach.lifted([x, y, z], self.config.printer.pause_lift.0);
            self.planner.push_raw_move(to, RETURN_FEED, gcode::LineNumber(0))?;
            let [park_x, park_y] = park_place([x, y], homed, self.config.printer.pause_position, &reach);
            let up = to[2];
            // So high up it may be too far away.
            let parks = reach.judge_way([x, y, up], [park_x, park_y, up]).is_ok();
            [to[0], to[1]] = if parks { [park_x, park_y] } else { [x, y] };
            self.planner.push_raw_move(to, RETURN_FEED, gcode::LineNumber(0))?;
        }
        Ok(())
    }

    /// What the nozzle's filament is to be at once the head is back, in mm, and how fast it gets there.
    pub(super) fn primed(&self, retracted: Retracted) -> (f64, MmPerS) {
        let speed = self.config.firmware_retraction.as_ref().map(|retraction| retraction.unretract_speed);
        let here = self.planner.position()[EXTRUDER];
        let Retracted { from, to } = retracted;
        // To the very step, unless somebody has moved the filament meanwhile.
        let e = if here.to_bits() == to.to_bits() { from } else { here + (from - to) };
        (e, speed.unwrap_or(RETRACT_SPEED))
    }

    /// The head is parked, or stands where its way back was broken off.
    pub(super) fn is_parked(&mut self, now: Seconds) {
        let here = self.planner.position()[EXTRUDER];
        if let Some(job) = &mut self.job {
            job.state = JobState::Paused;
            if let Some(retracted) = job.paused.as_mut().and_then(|paused| paused.retracted.as_mut()) {
                retracted.to = here;
            }
        }
        self.tell_paused(now);
    }

    /// The head is back: motion is held once more, so that it goes on as softly as it came to rest.
    pub(super) fn go_on_from_rest(&mut self, now: Seconds) {
        self.hold_motion(Purpose::GoOn, now);
    }

    /// Motion is held where it was cut: the job's own planner goes on, with the next step.
    pub(super) fn rejoin_cut(&mut self, now: Seconds) {
        let Some(mut paused) = self.job.as_mut().and_then(|job| job.paused.take()) else { return };
        let Some(cut) = paused.cut.take() else { return };
        let Cut { at: broken, .. } = *cut;
        let at = self.board.motion_at(now);
        let from = cut.left.from;
        self.planner = *paused.planner;
        let (run, moves) = self.stream.rejoin(*cut, at, &self.board);
        if let Some(job) = &mut self.job {
            job.state = JobState::Printing;
        }
        self.diary.count(run.start, from, &mut self.board);
        self.lease.forget();
        self.stream.send_again(&mut self.board, now);
        let fan = self.thermal.fan_speed();
        self.stream.kept.set_fan(fan);
        self.events.push(Event::RunResumed { broken, at });
        for mv in moves {
            self.events.push(Event::Move(mv));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parking_moves_no_axis_that_is_not_homed_or_has_no_place() {
        let config =
            crate::config::parse(include_str!("../../../../../samples/printer.cfg")).0.expect("a machine");
        let reach = Reach::new(&config);
        // Where an axis that is not homed is taken to be may well be out of its reach.
        let at = [-7.0, 1e4];
        let places = [Some(Mm(3.0)), Some(Mm(-1e4))];
        let [_, lowest] = reach.clamped([0.0, -1e4]);
        for (homed, places, expected) in [
            ([false, false, true], places, at),
            ([true, false, true], places, [3.0, at[1]]),
            ([false, true, true], places, [at[0], lowest]),
            ([true; 3], [None; 2], at),
            ([true; 3], [None, places[1]], [at[0], lowest]),
        ] {
            assert_eq!(park_place(at, homed, places, &reach), expected, "{homed:?}");
        }
    }
}
