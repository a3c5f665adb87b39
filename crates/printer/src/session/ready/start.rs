//! A job that begins in the middle of its file: the lines before are read and not made. Then it is paused, as if they had
//! been, and goes on from there once it is known where Z is and the user says so.
//!
//! The way to the first line must not lead through what has been printed, and the nozzle may stick to that, cold. So it is
//! first warmed until it comes free and lifted above everything; only then are X and Y homed, if they are not. There,
//! everything gets warm, the nozzle is filled beside the part, and goes across and down.

use gcode::LineNumber;
use units::{Celsius, MmPerS, Seconds};

use super::{Ready, Wait};
use crate::{
    error::{Ended, ErrorCode, PrinterError},
    journal::Input,
    machine::EXTRUDER,
    planner::{ExtrusionPermit, Planner, Skip, Skipped},
    reach::Reach,
    session::{
        event::Event,
        job::{Job, JobState, Paused, RETURN_FEED, Start, Way},
    },
};

/// Ways lead this much above what has been printed, in mm.
const CLEARANCE_MM: f64 = 2.0;
/// What is pushed out beside the part: what may have run out of the nozzle, or burnt in it.
const PRIME_MM: f64 = 8.0;
const PRIME_SPEED: MmPerS = MmPerS(3.0);
/// Then it is pulled back by this much where the machine file has no `[firmware_retraction]`, so that it does not drip …
const PULL_MM: f64 = 1.0;
const PULL_SPEED: MmPerS = MmPerS(20.0);
/// … or by as much as the lines before have; more than this is no retraction.
const RETRACTED_MAX_MM: f64 = 20.0;
/// Beside the part is at least so far from it, in mm, and so far from the ends of the axes.
const ASIDE_MM: f64 = 5.0;
const FROM_ENDS_MM: f64 = 1.0;

impl Ready {
    /// Has a job begin with a line. The planner that is at hand goes on moving the machine until then.
    pub(in crate::session) fn begin_at(&mut self, job: &mut Job, line: u32) -> Result<(), PrinterError> {
        let mut planner = Box::new(Planner::new(&self.config, self.board.clock)?);
        match &job.options.transform {
            Some(record) => planner.set_recorded_transform(record)?,
            None => planner.set_same_transform(&self.planner),
        }
        planner.begin_job(&mut job.source);
        let endstops = self.config.steppers.each_ref().map(|stepper| stepper.position_endstop.0);
        job.skip = Some(Skip::new(line, endstops));
        job.state = JobState::Skipping;
        job.paused = Some(Paused {
            position: planner.position(),
            planner,
            homed: [true; 3],
            could_extrude: false,
            targets: Vec::new(),
            start: Some(Start {
                line,
                clear_z: 0.0,
                fan: 0.0,
                printed: None,
                retracted: 0.0,
                pulled: 0.0,
                way: Way::Free,
            }),
            rest: None,
            cut: None,
            retracted: None,
        });
        Ok(())
    }

    pub(super) fn skips(&self) -> bool {
        self.job.as_ref().is_some_and(|job| job.state == JobState::Skipping)
    }

    /// Reads on towards the line with which the job begins.
    pub(super) fn skip(&mut self, now: Seconds) {
        self.last_active = now;
        let Some(Job { skip: Some(skip), paused: Some(paused), source, .. }) = &mut self.job else { return };
        let line = skip.line();
        match skip.advance(&mut paused.planner, source) {
            Ok(Skipped::NeedsInput | Skipped::Working) => {}
            Ok(Skipped::Done) => {
                let z_max = self.config.steppers[2].position_max.0;
                let clear_z = (skip.top + CLEARANCE_MM).min(z_max);
                if clear_z <= skip.top {
                    let detail = "there is no room above what has been printed";
                    let error = PrinterError::new(ErrorCode::MoveOutOfRange, detail).at_line(line.0);
                    return self.source_failed(error.ending(Ended::Job), now);
                }
                paused.position = paused.planner.position();
                paused.targets.clone_from(&skip.targets);
                paused.start = Some(Start {
                    line: line.0,
                    clear_z,
                    fan: skip.fan,
                    printed: skip.printed,
                    retracted: skip.retracted.min(RETRACTED_MAX_MM),
                    pulled: 0.0,
                    way: Way::Free,
                });
                let is_hot = |&(heater, target): &(gcode::Heater, Celsius)| {
                    heater == gcode::Heater::Tool(0) && target > Celsius::ZERO
                };
                paused.could_extrude = skip.targets.iter().any(is_hot);
                if let Some(job) = &mut self.job {
                    job.state = JobState::Paused;
                    job.has_moved = true;
                    job.leaves_hot = job.paused.as_ref().is_some_and(|paused| paused.could_extrude);
                    job.skip = None;
                }
                self.adopt_factors();
                let text = format!("line {} is the next; say where Z stands, then resume", line.0);
                self.events.push(Event::Message(text));
                self.events.push(Event::Paused);
            }
            Err(error) => self.source_failed(error, now),
        }
    }

    /// What the user has set while lines were passed over holds from here on.
    fn adopt_factors(&mut self) {
        let factors = self.job.as_mut().map_or([None; 2], |job| core::mem::take(&mut job.factors));
        for input in [factors[0].map(Input::Speed), factors[1].map(Input::Flow)].into_iter().flatten() {
            self.set_factor(input);
        }
    }

    fn start_mut(&mut self) -> Option<&mut Start> {
        self.job.as_mut()?.paused.as_mut()?.start.as_mut()
    }

    /// The user wants a job to begin: its way begins.
    pub(super) fn set_out(&mut self, heats: bool) {
        if let Some(start) = self.start_mut() {
            (start.way, start.pulled) = (Way::Free, 0.0);
        }
        if heats {
            self.wait = Wait::Free;
        }
    }

    /// A stretch of the way to a job's first line has been made, and the machine is at rest: the next begins. `false` at
    /// its end.
    pub(super) fn next_stretch(&mut self) -> Result<bool, PrinterError> {
        let could_extrude = self.job.as_ref().and_then(|job| job.paused.as_ref()).map(|it| it.could_extrude);
        if self.start_mut().is_some()
            && self.thermal.has_fallen()
            && let Some(job) = &mut self.job
        {
            // The host was held up meanwhile: the user is asked again.
            job.state = JobState::Paused;
            self.events.push(Event::Paused);
            return Ok(true);
        }
        let Some(start) = self.start_mut() else { return Ok(false) };
        start.way = match start.way {
            Way::Free => Way::Up,
            Way::Up => Way::Home,
            Way::Home => Way::Heat,
            Way::Heat => Way::Prime,
            Way::Prime => Way::Down,
            Way::Down => return Ok(false),
        };
        let start = *start;
        match start.way {
            Way::Up => {
                let [x, y, z, e] = self.planner.position();
                self.go([x, y, z.max(start.clear_z), e], RETURN_FEED)?;
            }
            Way::Home => {
                let homed = self.planner.guard.homed();
                self.begin_homing([!homed[0], !homed[1], false], LineNumber(0));
            }
            Way::Heat => self.wait = Wait::Heat,
            Way::Prime if could_extrude == Some(true) => self.prime(&start)?,
            Way::Free | Way::Prime => {}
            Way::Down => self.go_down(&start)?,
        }
        Ok(true)
    }

    fn go(&mut self, to: [f64; 4], feed: MmPerS) -> Result<(), PrinterError> {
        let place = |[x, y, z, _]: [f64; 4]| [x, y, z];
        Reach::new(&self.config)
            .judge_way(place(self.planner.position()), place(to))
            .map_err(|detail| PrinterError::new(ErrorCode::MoveOutOfRange, detail))?;
        self.planner.push_raw_move(to, feed, LineNumber(0))
    }

    /// Fills the nozzle where what comes out does not fall onto the part.
    fn prime(&mut self, start: &Start) -> Result<(), PrinterError> {
        if self.extrusion_permit() != ExtrusionPermit::Allowed {
            return Err(PrinterError::new(ErrorCode::ColdExtrusion, "the nozzle was switched off meanwhile"));
        }
        let Some(extruder) = &self.config.extruder else { return Ok(()) };
        let prime_mm = PRIME_MM.min(extruder.max_extrude_only_distance.0);
        let [x, y, z, e] = self.planner.position();
        let Some([x, y]) = self.aside(start.printed, [x, y]) else {
            let text = "there is no room beside the part: the nozzle is not primed";
            self.events.push(Event::Message(text.into()));
            return Ok(());
        };
        let up = self.across([x, y], z.max(start.clear_z), start.clear_z)?;
        let [here_x, here_y, ..] = self.planner.position();
        let retraction = self.config.firmware_retraction.as_ref();
        let (pull_mm, speed) =
            retraction.map_or((PULL_MM, PULL_SPEED), |it| (it.retract_length.0, it.retract_speed));
        let pulled = pull_mm.max(start.retracted).min(extruder.max_extrude_only_distance.0);
        self.go([here_x, here_y, up, e], RETURN_FEED)?;
        self.go([x, y, up, e], RETURN_FEED)?;
        self.go([x, y, up, e + prime_mm], PRIME_SPEED)?;
        self.go([x, y, up, e + prime_mm - pulled], speed)?;
        if let Some(start) = self.start_mut() {
            start.pulled = pulled;
        }
        Ok(())
    }

    /// The nearest place beside what has been printed, if there is any: here, or near a corner.
    fn aside(&self, printed: Option<[[f64; 2]; 2]>, here: [f64; 2]) -> Option<[f64; 2]> {
        let Some([low, high]) = printed else { return Some(here) };
        let is_beside = |place: &[f64; 2]| {
            (0..2).any(|axis| place[axis] < low[axis] - ASIDE_MM || place[axis] > high[axis] + ASIDE_MM)
        };
        let corners = Reach::new(&self.config).corners(FROM_ENDS_MM);
        let away = |place: &[f64; 2]| libm::hypot(place[0] - here[0], place[1] - here[1]);
        core::iter::once(here)
            .chain(corners)
            .filter(is_beside)
            .min_by(|one, other| away(one).total_cmp(&away(other)))
    }

    /// Across, above everything, then down to where the first line begins; the filament then is as the lines before
    /// have left it.
    fn go_down(&mut self, start: &Start) -> Result<(), PrinterError> {
        let Some(paused) = self.job.as_ref().and_then(|job| job.paused.as_ref()) else { return Ok(()) };
        let [x, y, z, _] = paused.position;
        let [here_x, here_y, here_z, e] = self.planner.position();
        let floor = z.max(start.clear_z);
        let up = self.across([x, y], here_z.max(floor), floor)?;
        for to in [[here_x, here_y, up, e], [x, y, up, e], [x, y, z, e]] {
            self.go(to, RETURN_FEED)?;
        }
        let missing = start.pulled - start.retracted;
        if missing > 0.0 {
            let retraction = self.config.firmware_retraction.as_ref();
            let speed = retraction.map_or(PULL_SPEED, |it| it.unretract_speed);
            let mut to = self.planner.position();
            to[EXTRUDER] += missing;
            self.go(to, speed)?;
        }
        Ok(())
    }
}
