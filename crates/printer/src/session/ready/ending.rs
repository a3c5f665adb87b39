//! Stopping: a job that is paused, cancelled, at its end or has failed, and a machine that nobody uses.

use units::Seconds;

use super::{Held, Ready, Wait, hold::Purpose};
use crate::{
    error::{Ended, ErrorCode, PrinterError},
    journal::MovedBy,
    planner::{ExtrusionPermit, Planner},
    reach::Reach,
    session::{
        event::Event,
        job::{Job, JobState, JobStatus, Paused, RETURN_FEED, Retracted},
    },
};

impl Ready {
    /// The G-code that is being carried out cannot go on: a job ends with everything off, the console only forgets
    /// what else it was told. What was planned before that place is made first, as warm as it was to be made.
    pub(in crate::session) fn source_failed(&mut self, error: PrinterError, now: Seconds) {
        self.planner.drop_barrier();
        match &mut self.job {
            Some(job) if job.is_active() => {
                if !matches!(job.state, JobState::Failing(_)) {
                    job.state = JobState::Failing(error.ending(Ended::Job));
                    self.stop_waiting();
                    if self.is_at_rest() {
                        self.switch_off(now);
                    }
                }
            }
            _ => {
                self.forget_console();
                self.events.push(Event::Error(error));
            }
        }
    }

    /// What was typed and not yet done is not done, and the console knows where the machine will stand.
    fn forget_console(&mut self) {
        self.console.clear();
        self.planner.correct(&mut self.console.source);
    }

    fn switch_off(&mut self, now: Seconds) {
        self.thermal.all_off(&mut self.board, now);
        self.set_fan_now(0.0, now);
    }

    /// Sets the part fan, with no regard to what moves.
    pub(in crate::session) fn set_fan_now(&mut self, speed: f64, now: Seconds) {
        self.thermal.set_fan(speed, None, &mut self.board, now);
        let speed = self.thermal.fan_speed();
        self.stream.kept.set_fan(speed);
    }

    /// What was typed and not yet done is not done, and waits no longer.
    pub(super) fn stop_typed(&mut self) {
        if self.is_console_busy() {
            self.planner.drop_barrier();
            self.forget_console();
            self.stop_waiting();
        }
    }

    /// Nothing is waited for any more; an axis that is being homed stops.
    fn stop_waiting(&mut self) {
        self.held = Held::default();
        self.break_wait();
    }

    /// As [`Self::stop_waiting`]; what a paused job was waiting for still holds.
    fn break_wait(&mut self) {
        match &mut self.wait {
            Wait::Homing { axis, remaining, .. } => {
                remaining.clear();
                axis.cancel();
            }
            wait => *wait = Wait::Nothing,
        }
    }

    pub(in crate::session) fn pause(&mut self, now: Seconds) -> Result<(), PrinterError> {
        let Some(job) = &self.job else { return Err(ErrorCode::NoJob.into()) };
        match job.state {
            JobState::Printing => {}
            JobState::Returning => {
                self.stop_returning(now);
                return Ok(());
            }
            _ => return Ok(()),
        }
        if self.stop_heating_held() {
            return Ok(());
        }
        let is_held = self.hold_motion(Purpose::Pause, now);
        if !is_held {
            self.hold_wait(now);
        }
        if let Some(job) = &mut self.job {
            job.state = if is_held { JobState::Halting } else { JobState::Pausing };
        }
        Ok(())
    }

    /// The way back of a paused job is broken off: it is paused where the head comes to rest.
    fn stop_returning(&mut self, now: Seconds) {
        self.break_wait();
        let moves = self.stream.run().is_some_and(|run| !run.homing) || self.hold.is_some();
        let is_held = moves && self.hold_motion(Purpose::Back, now);
        if let Some(job) = self.job.as_mut().filter(|job| !job.is_ending()) {
            job.state = if is_held { JobState::Halting } else { JobState::Parking };
        }
    }

    /// What is waited for, or is about to be, waits until the job goes on.
    pub(super) fn hold_wait(&mut self, now: Seconds) {
        self.held = Held { wait: self.wait.hold(now), barrier: self.planner.take_barrier() };
    }

    pub(in crate::session) fn cancel(&mut self, now: Seconds) -> Result<(), PrinterError> {
        if self.cancel_held(now) {
            return Ok(());
        }
        let is_console_busy = self.is_console_busy();
        match &mut self.job {
            // It ends with its error, but at once.
            Some(job) if matches!(job.state, JobState::Failing(_)) => {}
            Some(job) => job.state = JobState::Cancelling,
            None if is_console_busy => self.forget_console(),
            None => return Err(ErrorCode::NoJob.into()),
        }
        self.planner.drop_barrier();
        self.stop_waiting();
        self.switch_off(now);
        self.hold_motion(Purpose::End, now);
        Ok(())
    }

    /// Goes on with what is held; else goes back to where the job was paused, and on.
    pub(in crate::session) fn resume(&mut self, now: Seconds) -> Result<(), PrinterError> {
        if self.resume_held(now)? {
            return Ok(());
        }
        let paused = self.job.as_ref().filter(|job| job.state == JobState::Paused);
        let Some(paused) = paused.and_then(|job| job.paused.as_ref()) else {
            return Err(PrinterError::new(ErrorCode::NoJob, "no job is paused"));
        };
        let Paused { homed: was_homed, could_extrude, start, .. } = *paused;
        if self.is_console_busy() {
            return Err(PrinterError::new(ErrorCode::BusyPrinting, "what was typed is still being done"));
        }
        let homed = self.planner.guard.homed();
        // On the way to a first line X and Y are homed above the part.
        let axes = if start.is_some() { 2..3 } else { 0..3 };
        if axes.into_iter().any(|axis| was_homed[axis] && !homed[axis]) {
            let detail = match start {
                Some(_) => "it must be known where Z stands: the way to the first line leads up first",
                None => "the position was lost while the job was paused",
            };
            return Err(PrinterError::new(ErrorCode::NotHomed, detail));
        }
        let targets = paused.targets.clone();
        let heats = self.heat_again(&targets, could_extrude, false, now)?;
        if start.is_some() {
            self.set_out(heats);
        } else if heats {
            self.wait = Wait::Heat;
        } else {
            self.go_back()?;
        }
        if let Some(job) = &mut self.job {
            job.state = JobState::Returning;
        }
        self.events.push(Event::Resumed);
        Ok(())
    }

    /// Across first, at the greater height, then down: nothing is hit on the way. The filament stays as it is, and so
    /// does an axis whose position was not known then.
    pub(super) fn go_back(&mut self) -> Result<(), PrinterError> {
        let Some(paused) = self.job.as_ref().and_then(|job| job.paused.as_ref()) else { return Ok(()) };
        let Paused { position, homed: was_homed, retracted, .. } = *paused;
        let here = self.planner.position();
        let [x, y, z] =
            core::array::from_fn(|axis| if was_homed[axis] { position[axis] } else { here[axis] });
        let up = self.across([x, y], here[2].max(z), z)?;
        let e = here[3];
        for to in [[here[0], here[1], up, e], [x, y, up, e], [x, y, z, e]] {
            self.planner.push_raw_move(to, RETURN_FEED, gcode::LineNumber(0))?;
        }
        if let Some(retracted) = retracted {
            let (from, speed) = self.primed(retracted);
            self.planner.push_raw_move([x, y, z, from], speed, gcode::LineNumber(0))?;
            if let Some(paused) = self.job.as_mut().and_then(|job| job.paused.as_mut()) {
                paused.retracted = Some(Retracted { from, to: e });
            }
        }
        Ok(())
    }

    /// How high the head can go across to a place: this high, or, on machines that reach less up there, as high as it
    /// goes, above `floor`.
    pub(super) fn across(&self, to: [f64; 2], up: f64, floor: f64) -> Result<f64, PrinterError> {
        let [x, y, ..] = self.planner.position();
        Reach::new(&self.config).across([x, y], to, up, floor).ok_or_else(|| {
            let detail = format!("there is no way to X {:.3} Y {:.3} above Z {floor:.3} mm", to[0], to[1]);
            PrinterError::new(ErrorCode::MoveOutOfRange, detail)
        })
    }

    /// What is done once the machine is at rest: a job that was told to stop has stopped, and a machine that nobody
    /// uses is switched off.
    pub(super) fn rest(&mut self, now: Seconds) {
        if !self.is_at_rest() || !matches!(self.wait, Wait::Nothing) {
            // Motion that is held waits for the user, as a pause does.
            if self.hold_status() != Some(JobStatus::Held) {
                self.last_active = now;
            }
            return;
        }
        if self.diary.is_z_moved_by_others() && self.planner.guard.homed()[2] {
            self.note_height(self.planner.position()[2], MovedBy::Nobody);
        }
        let state = self.job.as_ref().map(|job| job.state.clone());
        match state {
            Some(JobState::Pausing) => self.is_paused(now),
            Some(JobState::Parking) => self.is_parked(now),
            // The board has yet to hold for it to go on, or holds, and the user decides.
            Some(JobState::Returning) if self.hold.is_some() => {}
            Some(JobState::Returning) => self.has_returned(now),
            Some(JobState::Cancelling) => self.end_job(Event::JobCancelled, now),
            Some(JobState::Failing(error)) => self.end_job(Event::Error(error), now),
            Some(JobState::Printing | JobState::Skipping | JobState::Halting) => {}
            Some(JobState::Paused) | None => self.idle(now),
        }
    }

    /// The job's planner is put aside, and another one moves the machine until it is back.
    fn is_paused(&mut self, now: Seconds) {
        let (position, homed) = (self.planner.position(), self.planner.guard.homed());
        let mut aside = match Planner::new(&self.config, self.board.clock) {
            Ok(aside) => aside,
            Err(error) => return self.source_failed(error, now),
        };
        aside.set_same_transform(&self.planner);
        aside.stand_at(position);
        (0..3).for_each(|axis| aside.guard.set_homed(axis, homed[axis]));
        let could_extrude = self.extrusion_permit() == ExtrusionPermit::Allowed;
        let targets = self.thermal.wanted();
        let planner = Box::new(core::mem::replace(&mut self.planner, aside));
        if let Some(job) = &mut self.job {
            job.state = JobState::Paused;
            job.paused = Some(Paused {
                planner,
                position,
                homed,
                could_extrude,
                targets,
                start: None,
                rest: None,
                cut: None,
                retracted: None,
            });
        }
        self.tell_paused(now);
    }

    /// The job waits for the user, who may move the machine meanwhile.
    pub(super) fn tell_paused(&mut self, now: Seconds) {
        self.last_active = now;
        self.console.clear();
        self.planner.adopt(&mut self.console.source);
        self.events.push(Event::Paused);
    }

    /// A nozzle that was hot enough in a print that is to go on is not any more: the user is asked again. Whether that is
    /// so.
    pub(super) fn is_too_cold_to_go_on(&mut self, now: Seconds) -> bool {
        let paused = self.job.as_ref().and_then(|job| job.paused.as_ref());
        let could_extrude = paused.is_some_and(|paused| paused.could_extrude);
        if !could_extrude || self.extrusion_permit() == ExtrusionPermit::Allowed {
            return false;
        }
        let text = "the nozzle was switched off while the print was about to go on: it is paused again";
        self.events.push(Event::Message(text.into()));
        self.is_parked(now);
        true
    }

    /// The machine is where the job was paused: its own planner goes on.
    fn has_returned(&mut self, now: Seconds) {
        match self.next_stretch() {
            Ok(true) => return,
            Ok(false) => {}
            Err(error) => return self.source_failed(error, now),
        }
        if self.is_too_cold_to_go_on(now) {
            return;
        }
        self.note_height(self.planner.position()[2], MovedBy::File);
        let Some(job) = &mut self.job else { return };
        if job.paused.as_ref().is_some_and(|paused| paused.cut.is_some()) {
            return self.go_on_from_rest(now);
        }
        job.state = JobState::Printing;
        if let Some(paused) = job.paused.take() {
            self.planner = *paused.planner;
            if let Some(broken) = paused.rest {
                self.events.push(Event::RunResumed { broken, at: self.board.motion_at(now) });
            }
            if let Some(start) = paused.start {
                self.set_fan_now(start.fan, now);
            }
        }
        let Held { wait, barrier } = core::mem::take(&mut self.held);
        self.wait = wait.go_on(now);
        self.planner.put_barrier(barrier);
    }

    /// A job that ends early leaves everything off.
    fn end_job(&mut self, event: Event, now: Seconds) {
        self.switch_off(now);
        self.forget_job(event);
    }

    fn forget_job(&mut self, event: Event) {
        self.job = None;
        self.diary.end(&mut self.board);
        self.held = Held::default();
        self.planner.drop_barrier();
        self.console.clear();
        self.planner.adopt(&mut self.console.source);
        self.events.push(event);
    }

    /// The job's file has been carried out to its end.
    pub(super) fn finish_job(&mut self, now: Seconds) {
        let error = self.job.as_ref().and_then(wrong_at_end);
        match error {
            Some(error) => self.source_failed(error, now),
            None => self.forget_job(Event::JobDone),
        }
    }

    /// Nobody has used the machine for a while. A paused job keeps its motors on, so that it can be resumed once the
    /// user has heated again.
    fn idle(&mut self, now: Seconds) {
        if now - self.last_active < self.config.idle_timeout.timeout {
            return;
        }
        self.last_active = now;
        let heats = self.thermal.any_target();
        if self.job.is_some() {
            if heats {
                self.thermal.all_off(&mut self.board, now);
                self.events.push(Event::Message("paused for too long: heaters are off".into()));
            }
        } else if heats || self.stream.any_enabled() {
            self.thermal.all_off(&mut self.board, now);
            self.stream.disable([true; 4], &mut self.board, now);
            (0..3).for_each(|axis| self.planner.guard.set_homed(axis, false));
            self.events.push(Event::Message("idle for too long: heaters and motors are off".into()));
        }
    }
}

/// What is wrong with a job whose file ends as it does.
fn wrong_at_end(job: &Job) -> Option<PrinterError> {
    let line = job.source.line().0;
    if !job.has_moved {
        return Some(PrinterError::new(ErrorCode::FileEmpty, "the file made no move"));
    }
    // Whoever wants the nozzle to stay hot confirms the last line, as with everything that looks wrong.
    let is_cut_off = job.leaves_hot && !job.is_confirmed(line);
    let detail = "it ended with the nozzle still hot";
    is_cut_off.then(|| PrinterError::new(ErrorCode::FileCutOff, detail).at_line(line))
}
