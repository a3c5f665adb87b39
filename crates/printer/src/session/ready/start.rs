//! A job that begins in the middle of its file: the lines before are read and not made. Then it is paused, as if they had
//! been, and goes on from there once the machine is homed and the user says so.

use units::{Celsius, Seconds};

use super::Ready;
use crate::{
    error::{Ended, ErrorCode, PrinterError},
    planner::{Planner, Skip, Skipped},
    session::{
        event::Event,
        job::{Job, JobState, Paused, Start},
    },
};

/// Ways lead this much above what has been printed, in mm.
const CLEARANCE_MM: f64 = 2.0;

impl Ready {
    /// Has a job begin with a line. The planner that is at hand goes on moving the machine until then.
    pub(in crate::session) fn begin_at(&mut self, job: &mut Job, line: u32) -> Result<(), PrinterError> {
        let mut planner = Box::new(Planner::new(&self.config, self.board.clock)?);
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
            start: Some(Start { line, clear_z: 0.0, fan: 0.0 }),
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
                paused.start = Some(Start { line: line.0, clear_z, fan: skip.fan });
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
                let text = format!("line {} is the next; home the machine, then resume", line.0);
                self.events.push(Event::Message(text));
                self.events.push(Event::Paused);
            }
            Err(error) => self.source_failed(error, now),
        }
    }
}
