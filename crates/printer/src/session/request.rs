//! What an owner may ask of a session, and when it is refused.

use units::{Celsius, Mm, Seconds};
use wire::Command;

use super::{
    Session, Stage,
    console::Console,
    event::Request,
    job::{Job, JobOptions, JobState, JobStatus, PendingStart, Start},
    ready::{Failure, Ready},
};
use crate::{
    error::{Ended, ErrorCode, PrinterError},
    journal::{Input, MovedBy},
    machine,
    planner::Position,
};

impl Session {
    /// Asks for something. What it leads to comes as events; an error means that nothing was done.
    pub fn request(&mut self, request: Request, now: Seconds) -> Result<(), PrinterError> {
        match request {
            Request::EmergencyStop => return self.emergency_stop(now),
            Request::Gcode(text) if is_emergency(&text) => return self.emergency_stop(now),
            Request::FirmwareRestart => {
                self.restart_wanted(now);
                return Ok(());
            }
            _ => {}
        }
        let Stage::Ready(ready) = &mut self.stage else { return Err(ErrorCode::NotConnected.into()) };
        ready.last_active = now;
        let request = match request {
            // Not a line of the console's own: it is for the print.
            Request::Gcode(text) if ready.job.is_some() => {
                factor_typed(&text).unwrap_or(Request::Gcode(text))
            }
            request => request,
        };
        match request {
            Request::Gcode(text) => ready.idle_console()?.type_text(text)?,
            Request::MoveBy { axis, distance, speed } => {
                ready.idle_console()?.move_by(axis, distance, speed)?;
            }
            Request::SetTemperature(heater, target) => {
                ready.thermal.set_target(heater, target, &mut ready.board, now)?;
                ready.diary.target(heater, target.0);
            }
            Request::SetFan(speed) => {
                ready.set_fan_now(speed, now);
                ready.diary.input(Input::Fan(speed));
            }
            Request::SetSpeedFactor(factor) => {
                ready.set_factor(Input::Speed(factor));
            }
            Request::SetFlowFactor(factor) => {
                ready.set_factor(Input::Flow(factor));
            }
            Request::SetPosition { axis, position } => ready.set_position(axis, position)?,
            Request::Pause => ready.pause(now)?,
            Request::Resume => ready.resume(now)?,
            Request::Cancel => ready.cancel(now)?,
            Request::EmergencyStop | Request::FirmwareRestart => {}
        }
        Ok(())
    }

    /// Everything stops, whatever the session is doing. Refused where no board is known that could be told.
    fn emergency_stop(&mut self, now: Seconds) -> Result<(), PrinterError> {
        let error = PrinterError::from(ErrorCode::EmergencyStop);
        match self.take_stage() {
            Stage::Ready(ready) => {
                self.stage = Stage::Ready(ready);
                self.on_failure(Failure::Stop(error), now);
            }
            Stage::Connecting(connecting) => {
                let mut board = connecting.board;
                board.link.forget_all();
                board.immediate(&Command::EmergencyStop {});
                self.stopped(board, error);
            }
            Stage::Holding(holding) => {
                self.stage = Stage::Holding(holding);
                self.on_failure(Failure::Stop(error), now);
            }
            // It has stopped, but who presses that button does not trust it.
            Stage::Shutdown(mut board) => {
                board.immediate(&Command::EmergencyStop {});
                self.stage = Stage::Shutdown(board);
            }
            stage @ (Stage::Identifying(_) | Stage::Failed) => {
                self.stage = stage;
                return Err(ErrorCode::NotConnected.into());
            }
        }
        Ok(())
    }

    /// Starts a job; its file is then fed in pieces. The file should have been checked before
    /// ([`crate::check`]): what blocks it only shows here when the print gets to it.
    pub fn start_job(&mut self, options: JobOptions, now: Seconds) -> Result<(), PrinterError> {
        let Stage::Ready(ready) = &mut self.stage else { return Err(ErrorCode::NotConnected.into()) };
        if ready.job.is_some() {
            return Err(ErrorCode::BusyPrinting.into());
        }
        if ready.is_console_busy() {
            return Err(PrinterError::new(ErrorCode::BusyPrinting, "what was typed is still being done"));
        }
        let mut job = Job::new(options, machine::gcode_settings(&ready.config));
        match job.options.start_line {
            Some(line) if line > 1 => ready.begin_at(&mut job, line)?,
            _ => {
                if let Some(record) = &job.options.transform {
                    ready.planner.set_recorded_transform(record)?;
                }
                ready.planner.begin_job(&mut job.source);
            }
        }
        let since_power_up = ready.board.since_power_up;
        ready.diary.begin(&job.options, &ready.config, &ready.planner, since_power_up, now);
        ready.diary.off(ready.off_mm);
        if job.skip.is_none() {
            ready.note_preheating();
        }
        ready.last_active = now;
        ready.stream.reset_elapsed();
        job.told = now;
        ready.job = Some(job);
        Ok(())
    }

    /// How many bytes of the job's file may be fed now.
    pub fn job_wants(&self) -> usize {
        match &self.stage {
            Stage::Ready(ready) => ready.job.as_ref().map_or(0, |job| job.source.wants()),
            Stage::Holding(holding) => holding.wants(),
            _ => 0,
        }
    }

    /// The next bytes of the job's file, no more than [`Self::job_wants`]: more than that ends the job, since they would
    /// have to be dropped or kept without bound.
    pub fn job_feed(&mut self, bytes: &[u8]) {
        if let Stage::Holding(holding) = &mut self.stage {
            let fits = bytes.len() <= holding.wants();
            if let Some(replay) = holding.replay().filter(|_| fits) {
                replay.feed(bytes);
            }
        }
        if let Stage::Ready(ready) = &mut self.stage
            && let Some(job) = &mut ready.job
        {
            if bytes.len() <= job.source.wants() {
                job.source.feed(bytes);
            } else if !job.is_ending() {
                let detail = "more of the file was handed over than was asked for";
                let error = PrinterError::new(ErrorCode::Internal, detail).ending(Ended::Job);
                job.state = JobState::Failing(error);
            }
        }
    }

    /// The job's file has ended.
    pub fn job_end(&mut self) {
        if let Stage::Holding(holding) = &mut self.stage
            && let Some(replay) = holding.replay()
        {
            replay.end();
        }
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

    /// How the job begins that is paused before its first line, which is not that of its file.
    pub fn pending_start(&self) -> Option<PendingStart> {
        let Stage::Ready(ready) = &self.stage else { return None };
        let job = ready.job.as_ref().filter(|job| job.status() == JobStatus::Paused)?;
        let paused = job.paused.as_ref()?;
        let Start { line, clear_z, .. } = paused.start?;
        let [x, y, z, _] = paused.position;
        let targets = [gcode::Heater::Tool(0), gcode::Heater::Bed]
            .map(|heater| ready.thermal.goal(heater, &paused.targets).max(Celsius::ZERO));
        Some(PendingStart { line, position: [x, y, z], clear_z, targets })
    }

    /// How much motion the board has received and not yet made, in seconds. `None` where no run of motion is being
    /// made, or nothing more of it is to come.
    pub fn motion_queued(&self, now: Seconds) -> Option<Seconds> {
        match &self.stage {
            Stage::Ready(ready) => ready.motion_queued(now),
            _ => None,
        }
    }

    /// Where the last planned move ends, in the G-code's coordinates: X, Y, Z, E in mm, and which axes are homed.
    pub fn position(&self) -> Option<(Position, [bool; 3])> {
        match &self.stage {
            Stage::Ready(ready) => Some((ready.planner.gcode_position(), ready.planner.guard.homed())),
            _ => None,
        }
    }

    /// Where the G-code has a place of the motors, such as those of [`super::ScheduledMove`], by the skew and the bed that
    /// are in force for what is planned now.
    pub fn gcode_from_machine(&self, position: Position) -> Position {
        match &self.stage {
            Stage::Ready(ready) => ready.planner.gcode_from_machine(position),
            _ => position,
        }
    }

    /// How much higher Z's motor stands than the Z of [`Self::position`], in mm: what makes up for the bed there.
    pub fn z_lift(&self) -> f64 {
        match &self.stage {
            Stage::Ready(ready) => ready.planner.position()[2] - ready.planner.gcode_position()[2],
            _ => 0.0,
        }
    }

    /// The speed and flow factors of what is planned from now on, 1 is as written: the job's, or those of what is typed.
    pub fn factors(&self) -> [f64; 2] {
        match &self.stage {
            Stage::Ready(ready) => {
                let source = ready.job.as_ref().map_or(&ready.console.source, |job| &job.source);
                let [speed, flow] = ready.job.as_ref().map_or([None; 2], |job| job.factors);
                [
                    speed.unwrap_or_else(|| source.interpreter.speed_factor()),
                    flow.unwrap_or_else(|| source.interpreter.flow_factor()),
                ]
            }
            _ => [1.0, 1.0],
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
    text.lines().any(|line| {
        let command = line.split(';').next().unwrap_or_default();
        command.trim().eq_ignore_ascii_case("M112")
    })
}

/// What sets a factor where that is all that was typed: `M220 S50`, in percent.
fn factor_typed(text: &str) -> Option<Request> {
    let line = text.split(';').next().unwrap_or_default().trim().to_ascii_uppercase();
    let (request, rest): (fn(f64) -> Request, _) = if let Some(rest) = line.strip_prefix("M220") {
        (Request::SetSpeedFactor, rest)
    } else {
        (Request::SetFlowFactor, line.strip_prefix("M221")?)
    };
    let percent: f64 = rest.trim_start().strip_prefix('S')?.trim_start().parse().ok()?;
    (percent.is_finite() && percent > 0.0).then(|| request(percent / 100.0))
}

impl Ready {
    /// The console, unless a job is what is carried out.
    fn idle_console(&mut self) -> Result<&mut Console, PrinterError> {
        match self.job_status() {
            JobStatus::None | JobStatus::Paused => Ok(&mut self.console),
            _ => Err(ErrorCode::BusyPrinting.into()),
        }
    }

    /// Takes the user's word for where an axis stands, in the G-code's coordinates, as [`Session::position`] tells it.
    fn set_position(&mut self, axis: usize, position: Mm) -> Result<(), PrinterError> {
        self.idle_console()?;
        if self.is_console_busy() {
            return Err(PrinterError::new(ErrorCode::BusyPrinting, "what was typed is still being done"));
        }
        let limits =
            self.config.steppers.get(axis).map(|stepper| (stepper.position_min, stepper.position_max));
        if !limits.is_some_and(|(min, max)| (min..=max).contains(&position)) {
            let detail = format!("an axis cannot stand at {position}");
            return Err(PrinterError::new(ErrorCode::MoveOutOfRange, detail));
        }
        if machine::homed_together(&self.config, [true, false, false]) == [true; 3] {
            let detail = "where a delta's head is cannot be said axis by axis: home it, it goes upwards";
            return Err(PrinterError::new(ErrorCode::NotHomed, detail));
        }
        let place = self.motors_place(axis, position)?;
        self.diary.lose_place(&mut self.board);
        self.planner.set_axis(axis, place, true);
        self.note_height(self.planner.position()[2], MovedBy::Others);
        self.planner.correct(&mut self.console.source);
        Ok(())
    }

    /// Where an axis has its motor where it stands there in the G-code's coordinates; the other motors stay.
    fn motors_place(&self, axis: usize, position: Mm) -> Result<f64, PrinterError> {
        let transform = self.planner.transform();
        if transform.is_identity() {
            return Ok(position.0);
        }
        if axis < 2 && transform.has_skew() && self.planner.guard.homed() != [true; 3] {
            let detail = "while a skew is made up for, X and Y follow from one another and from Z: home them, or \
                take the skew back first (SET_SKEW CLEAR=1)";
            return Err(PrinterError::new(ErrorCode::NotHomed, detail));
        }
        let [x, y, z, _] = self.planner.position();
        let place = transform.motors_place([x, y, z], axis, position.0);
        let stepper = &self.config.steppers[axis];
        if (stepper.position_min.0..=stepper.position_max.0).contains(&place) {
            Ok(place)
        } else {
            let detail = format!("an axis cannot stand at {position} over a bed that is not flat");
            Err(PrinterError::new(ErrorCode::MoveOutOfRange, detail))
        }
    }

    /// A factor of what is planned from now on. What lines set that are passed over does not override it.
    pub(in crate::session) fn set_factor(&mut self, input: Input) {
        if let Some(job) = self.job.as_mut().filter(|job| job.state == JobState::Skipping) {
            match input {
                Input::Speed(factor) => job.factors[0] = Some(factor),
                Input::Flow(factor) => job.factors[1] = Some(factor),
                _ => {}
            }
            return;
        }
        for source in self.sources() {
            match input {
                Input::Speed(factor) => source.set_speed_factor(factor),
                Input::Flow(factor) => source.interpreter.set_flow_factor(factor),
                _ => {}
            }
        }
        self.diary.input(input);
    }

    fn sources(&mut self) -> impl Iterator<Item = &mut crate::planner::Source> {
        core::iter::once(&mut self.console.source).chain(self.job.as_mut().map(|job| &mut job.source))
    }
}
