//! What an owner may ask of a session, and when it is refused.

use units::Seconds;
use wire::Command;

use super::{
    CONSOLE_BYTES_MAX, Session, Stage,
    event::{Event, Request},
    job::{Job, JobOptions, JobState, JobStatus, RETURN_FEED},
    ready::{Failure, Ready},
};
use crate::{
    error::{ErrorCode, PrinterError},
    machine,
    planner::Position,
};

impl Session {
    /// Asks for something. What it leads to comes as events; an error means that nothing was done.
    pub fn request(&mut self, request: Request, now: Seconds) -> Result<(), PrinterError> {
        match request {
            Request::EmergencyStop => {
                self.emergency_stop();
                return Ok(());
            }
            Request::FirmwareRestart => {
                self.restart(now);
                return Ok(());
            }
            _ => {}
        }
        let Stage::Ready(ready) = &mut self.stage else { return Err(ErrorCode::NotConnected.into()) };
        match request {
            Request::Gcode(text) if is_emergency(&text) => self.emergency_stop(),
            Request::Gcode(text) => ready.type_gcode(&text)?,
            Request::SetTemperature(heater, target) => {
                ready.thermal.set_target(heater, target, &mut ready.board, now)?;
            }
            Request::SetFan(speed) => ready.thermal.set_fan(speed, None, &mut ready.board, now),
            Request::SetSpeedFactor(factor) => {
                ready.sources().for_each(|source| source.interpreter.set_speed_factor(factor));
            }
            Request::SetFlowFactor(factor) => {
                ready.sources().for_each(|source| source.interpreter.set_flow_factor(factor));
            }
            Request::Pause => ready.pause(),
            Request::Resume => ready.resume()?,
            Request::Cancel => ready.cancel(now),
            Request::EmergencyStop | Request::FirmwareRestart => {}
        }
        Ok(())
    }

    /// Everything stops, whatever the session is doing.
    fn emergency_stop(&mut self) {
        let error = PrinterError::from(ErrorCode::EmergencyStop);
        match &self.stage {
            Stage::Ready(_) => self.on_failure(Failure::Stop(error)),
            Stage::Connecting(_) => {
                let Stage::Connecting(connecting) = self.take_stage() else { return };
                let mut board = connecting.board;
                board.immediate(&Command::EmergencyStop {});
                self.stopped(board, error);
            }
            Stage::Shutdown(_) | Stage::Identifying(_) | Stage::Failed => {}
        }
    }

    /// Starts a job; its file is then fed in pieces. The file should have been checked before
    /// ([`crate::check`]): what blocks it only shows here when the print gets to it.
    pub fn start_job(&mut self, options: JobOptions, now: Seconds) -> Result<(), PrinterError> {
        let Stage::Ready(ready) = &mut self.stage else { return Err(ErrorCode::NotConnected.into()) };
        if ready.job.is_some() || !ready.is_at_rest() {
            return Err(ErrorCode::BusyPrinting.into());
        }
        let mut job = Job::new(options, machine::gcode_settings(&ready.config));
        ready.planner.adopt(&mut job.source);
        ready.stream.reset_elapsed();
        job.told = now;
        ready.job = Some(job);
        Ok(())
    }

    /// How many bytes of the job's file may be fed now.
    pub fn job_wants(&self) -> usize {
        match &self.stage {
            Stage::Ready(ready) => ready.job.as_ref().map_or(0, |job| job.source.wants()),
            _ => 0,
        }
    }

    /// The next bytes of the job's file.
    pub fn job_feed(&mut self, bytes: &[u8]) {
        if let Stage::Ready(ready) = &mut self.stage
            && let Some(job) = &mut ready.job
        {
            job.source.feed(bytes);
        }
    }

    /// The job's file has ended.
    pub fn job_end(&mut self) {
        if let Stage::Ready(ready) = &mut self.stage
            && let Some(job) = &mut ready.job
        {
            job.source.end();
        }
    }

    /// What the job is doing.
    pub fn job_status(&self) -> JobStatus {
        match &self.stage {
            Stage::Ready(ready) => ready.job_status(),
            _ => JobStatus::None,
        }
    }

    /// How much motion the board has received and not yet made, in seconds. `None` where no run of motion is being
    /// made, or nothing more of it is to come.
    pub fn motion_queued(&self, now: Seconds) -> Option<Seconds> {
        match &self.stage {
            Stage::Ready(ready) => ready.motion_queued(now),
            _ => None,
        }
    }

    /// Where the last planned move ends: X, Y, Z, E in mm, and which axes are homed.
    pub fn position(&self) -> Option<(Position, [bool; 3])> {
        match &self.stage {
            Stage::Ready(ready) => Some((ready.planner.position(), ready.planner.guard.homed())),
            _ => None,
        }
    }

    /// The part fan's speed, 0 ..= 1.
    pub fn fan_speed(&self) -> f64 {
        match &self.stage {
            Stage::Ready(ready) => ready.thermal.fan_speed(),
            _ => 0.0,
        }
    }
}

/// Whether a typed line asks for an emergency stop, which waits for nothing.
fn is_emergency(text: &str) -> bool {
    text.lines().any(|line| line.trim().eq_ignore_ascii_case("M112"))
}

impl Ready {
    fn type_gcode(&mut self, text: &str) -> Result<(), PrinterError> {
        if !matches!(self.job_status(), JobStatus::None | JobStatus::Paused) {
            return Err(ErrorCode::BusyPrinting.into());
        }
        if text.len() > CONSOLE_BYTES_MAX || text.len() >= self.console.wants() {
            let detail = format!("more than {CONSOLE_BYTES_MAX} bytes at once");
            return Err(PrinterError::new(ErrorCode::InvalidGcode, detail));
        }
        self.console.feed(text.as_bytes());
        self.console.feed(b"\n");
        Ok(())
    }

    fn sources(&mut self) -> impl Iterator<Item = &mut crate::planner::Source> {
        core::iter::once(&mut self.console).chain(self.job.as_mut().map(|job| &mut job.source))
    }

    /// Goes back to where the job was paused, and on.
    fn resume(&mut self) -> Result<(), PrinterError> {
        let at_rest = self.is_at_rest();
        let Some(job) = self.job.as_mut().filter(|job| job.state == JobState::Paused) else {
            return Err(PrinterError::new(ErrorCode::NotConnected, "there is no paused job"));
        };
        if !at_rest {
            return Err(ErrorCode::BusyPrinting.into());
        }
        let Some(target) = job.paused_at else { return Err(ErrorCode::Internal.into()) };
        if self.planner.guard.homed() != [true; 3] {
            return Err(PrinterError::new(
                ErrorCode::NotHomed,
                "the position was lost while the job was paused",
            ));
        }
        // Across first, at the greater height, then down: nothing is hit on the way. The filament stays as it is.
        let [_, _, z, e] = self.planner.position();
        let up = z.max(target[2]);
        let here = self.planner.position();
        for to in
            [[here[0], here[1], up, e], [target[0], target[1], up, e], [target[0], target[1], target[2], e]]
        {
            self.planner.push_raw_move(to, RETURN_FEED, gcode::LineNumber(0))?;
        }
        self.planner.rejoin(&job.source);
        job.state = JobState::Printing;
        job.paused_at = None;
        self.events.push_back(Event::Resumed);
        Ok(())
    }
}
