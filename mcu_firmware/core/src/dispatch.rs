//! What each command does. Bad values and bad timing are returned as the reason to shut down.

use units::Clock32;
use wire::{Command, Response, ShutdownReason, messages::Extension};

use crate::{
    analog_in::{AnalogIn, Sampling},
    board::{Board, Pin, Pull},
    digital_out::DigitalOut,
    endstop::{Endstop, Watch},
    firmware::Core,
    moves::OutputMove,
    objects::Object,
    stepper::Stepper,
    trsync::Trsync,
};

/// The most dictionary bytes in one `identify_response`, so that it fits a block whatever its offset, check and all.
const IDENTIFY_BYTES_MAX: u8 = 46;

impl<const OBJECTS: usize, const MOVES: usize> Core<OBJECTS, MOVES> {
    pub(crate) fn dispatch(
        &mut self,
        board: &mut impl Board,
        command: Command<'_>,
    ) -> Result<(), ShutdownReason> {
        match command.kind().extension() {
            None => {}
            Some(Extension::Heaters) => return self.dispatch_heater(board, &command),
            Some(Extension::MotionClock) => return self.dispatch_motion(board, &command),
            // What a block may end in is nothing to be done, and unknown to a board without the block check.
            Some(Extension::BlockCheck) => return Err(ShutdownReason::CommandParser),
        }
        match command {
            Command::Identify { .. }
            | Command::GetConfig {}
            | Command::GetClock {}
            | Command::GetUptime {}
            | Command::StepperGetPosition { .. }
            | Command::EndstopQueryState { .. } => self.query(board, command),
            Command::EmergencyStop {} => Err(ShutdownReason::EmergencyStop),
            Command::ClearShutdown {} => {
                if self.halt.reason().is_some() {
                    self.forget(board);
                }
                Ok(())
            }
            Command::ConfigReset {} => {
                self.forget(board);
                Ok(())
            }
            Command::Reset {} => {
                self.forget(board);
                board.reset();
                Ok(())
            }
            Command::AllocateOids { .. }
            | Command::FinalizeConfig { .. }
            | Command::ConfigStepper { .. }
            | Command::ConfigTrsync { .. }
            | Command::ConfigEndstop { .. }
            | Command::ConfigAnalogIn { .. }
            | Command::ConfigDigitalOut { .. } => {
                if self.config_crc.is_some() {
                    return Err(ShutdownReason::AlreadyConfigured);
                }
                self.configure(board, command)
            }
            Command::SetDigitalOutPwmCycle { oid, cycle_ticks } => {
                self.objects.digital_out(oid)?.set_cycle(cycle_ticks)
            }
            _ if self.config_crc.is_none() => Err(ShutdownReason::NotConfigured),
            Command::QueueStep { .. }
            | Command::SetNextStepDir { .. }
            | Command::ResetStepClock { .. }
            | Command::StepperStopOnTrigger { .. } => self.step(board, command),
            _ => self.act(board, command),
        }
    }

    fn query(&mut self, board: &mut impl Board, command: Command<'_>) -> Result<(), ShutdownReason> {
        match command {
            Command::Identify { offset, count } => {
                self.identify(board, offset, count);
                return Ok(());
            }
            Command::GetConfig {} => {
                let response = Response::Config {
                    is_config: self.config_crc.is_some().into(),
                    crc: self.config_crc.unwrap_or(0),
                    is_shutdown: self.halt.reason().is_some().into(),
                    move_count: self.moves.limit(),
                };
                self.reply(board, &response);
            }
            Command::GetClock {} => {
                let clock = board.now().0;
                self.reply(board, &Response::Clock { clock });
            }
            Command::GetUptime {} => {
                self.uptime.look(board.now());
                let response = self.uptime.response();
                self.reply(board, &response);
            }
            Command::StepperGetPosition { oid } => {
                let pos = self.objects.stepper(oid)?.position();
                self.reply(board, &Response::StepperPosition { oid, pos });
            }
            Command::EndstopQueryState { oid } => {
                let state = self.objects.endstop(oid)?.state(board, oid);
                self.reply(board, &state);
            }
            _ => {}
        }
        Ok(())
    }

    fn identify(&self, board: &mut impl Board, offset: u32, count: u8) {
        let mut data = [0; IDENTIFY_BYTES_MAX as usize];
        let mut len = 0;
        let dictionary = board.dictionary();
        if let Some(rest) = usize::try_from(offset).ok().and_then(|offset| dictionary.get(offset..)) {
            len = rest.len().min(usize::from(count.min(IDENTIFY_BYTES_MAX)));
            data[..len].copy_from_slice(&rest[..len]);
        }
        // An empty piece tells the host that this was all.
        self.reply(board, &Response::IdentifyResponse { offset, data: &data[..len] });
    }

    fn configure(&mut self, board: &mut impl Board, command: Command<'_>) -> Result<(), ShutdownReason> {
        let (oid, object) = match command {
            Command::AllocateOids { count } => return self.objects.allocate(count),
            Command::FinalizeConfig { crc } => {
                self.config_crc = Some(crc);
                return Ok(());
            }
            Command::ConfigStepper { oid, step_pin, dir_pin, invert_step, step_pulse_ticks } => {
                self.objects.check_free(oid)?;
                let stepper = Stepper::new(board, (step_pin, dir_pin), invert_step != 0, step_pulse_ticks)?;
                (oid, Object::Stepper(stepper))
            }
            Command::ConfigTrsync { oid } => (oid, Object::Trsync(Trsync::new())),
            Command::ConfigEndstop { oid, pin, pull_up } => {
                self.objects.check_free(oid)?;
                let pull = match pull_up {
                    0 => Pull::Floating,
                    1.. => Pull::Up,
                    _ => Pull::Down,
                };
                (oid, Object::Endstop(Endstop::new(board, pin, pull)?))
            }
            Command::ConfigAnalogIn { oid, pin } => {
                self.objects.check_free(oid)?;
                let pin = Pin::try_from(pin).map_err(|_| ShutdownReason::InvalidAdcPin)?;
                (oid, Object::AnalogIn(AnalogIn::new(board, pin)?))
            }
            Command::ConfigDigitalOut { oid, pin, value, default_value, max_duration } => {
                self.objects.check_free(oid)?;
                let pin = Pin::try_from(pin).map_err(|_| ShutdownReason::InvalidPin)?;
                let output = DigitalOut::new(board, pin, value != 0, default_value != 0, max_duration)?;
                (oid, Object::DigitalOut(output))
            }
            _ => return Ok(()),
        };
        self.objects.check_free(oid)?;
        self.objects.put(oid, object);
        Ok(())
    }

    fn step(&mut self, board: &mut impl Board, command: Command<'_>) -> Result<(), ShutdownReason> {
        match command {
            Command::QueueStep { oid, interval, count, add } => {
                let stepper = self.objects.stepper(oid)?;
                let row = (interval, count, add);
                if let Some(wake) = stepper.queue_step(board, &mut self.moves, &self.hold.clock, row)? {
                    self.timers.schedule(oid, wake);
                }
            }
            Command::SetNextStepDir { oid, dir } => self.objects.stepper(oid)?.set_next_dir(dir != 0),
            Command::ResetStepClock { oid, clock } => {
                self.objects.stepper(oid)?.reset_clock(Clock32(clock))?;
            }
            Command::StepperStopOnTrigger { oid, trsync_oid } => {
                let is_armed = self.objects.trsync(trsync_oid)?.is_armed();
                let stepper = self.objects.stepper(oid)?;
                if stepper.stop_on.is_some() {
                    return Err(ShutdownReason::StepperAlreadyTriggered);
                }
                stepper.stop_on = Some(trsync_oid);
                // A trigger that fired a moment ago, or was never armed, would never stop it any more.
                if !is_armed && stepper.stop(&mut self.moves) {
                    self.timers.cancel(oid);
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn act(&mut self, board: &mut impl Board, command: Command<'_>) -> Result<(), ShutdownReason> {
        match command {
            Command::TrsyncStart { oid, report_clock, report_ticks, expire_reason } => {
                let trsync = self.objects.trsync(oid)?;
                trsync.start(Clock32(report_clock), report_ticks, expire_reason);
                let wake = trsync.wake();
                self.release_steppers(oid);
                self.set_timer(board, oid, wake)
            }
            Command::TrsyncSetTimeout { oid, clock } => {
                let trsync = self.objects.trsync(oid)?;
                if !trsync.is_armed() {
                    return Ok(());
                }
                if Clock32(clock).is_before(board.now()) {
                    return Err(ShutdownReason::TimerTooClose);
                }
                trsync.set_timeout(Clock32(clock));
                self.update_trsync_timer(oid);
                Ok(())
            }
            Command::TrsyncTrigger { oid, reason } => {
                self.objects.trsync(oid)?;
                self.fire(board, oid, reason);
                let trsync = self.objects.trsync(oid)?;
                trsync.end_reports();
                let state = trsync.state(oid);
                self.timers.cancel(oid);
                self.reply(board, &state);
                Ok(())
            }
            Command::EndstopHome { .. } => self.home(board, command),
            Command::QueryAnalogIn { .. } => self.sample(board, command),
            Command::QueueDigitalOut { oid, clock, on_ticks } => {
                let output = self.objects.digital_out(oid)?;
                output.check_free()?;
                let change = OutputMove { clock, on_ticks };
                output.queue(board.now(), &mut self.moves, &self.hold.clock, change)?;
                let wake = output.wake(&self.hold.clock);
                self.reset_output_timer(oid, wake);
                Ok(())
            }
            Command::UpdateDigitalOut { oid, value } => {
                let output = self.objects.digital_out(oid)?;
                output.check_free()?;
                output.update(board, &mut self.moves, value != 0);
                let wake = output.wake(&self.hold.clock);
                self.reset_output_timer(oid, wake);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Steppers no longer obey a trigger that is armed anew.
    fn release_steppers(&mut self, trsync_oid: u8) {
        for (_, object) in self.objects.iter_mut() {
            if let Object::Stepper(stepper) = object
                && stepper.stop_on == Some(trsync_oid)
            {
                stepper.stop_on = None;
            }
        }
    }

    fn update_trsync_timer(&mut self, oid: u8) {
        match self.objects.trsync(oid).ok().and_then(|trsync| trsync.wake()) {
            Some(wake) => self.timers.schedule(oid, wake),
            None => self.timers.cancel(oid),
        }
    }

    /// An output's pending edge may be due at this moment, so that its timer may be late by a little.
    fn reset_output_timer(&mut self, oid: u8, wake: Option<Clock32>) {
        match wake {
            Some(wake) => self.timers.schedule(oid, wake),
            None => self.timers.cancel(oid),
        }
    }

    fn home(&mut self, board: &mut impl Board, command: Command<'_>) -> Result<(), ShutdownReason> {
        let Command::EndstopHome {
            oid,
            clock,
            sample_ticks,
            sample_count,
            rest_ticks,
            pin_value,
            trsync_oid,
            trigger_reason,
        } = command
        else {
            return Ok(());
        };
        if sample_count == 0 {
            self.timers.cancel(oid);
            if let Some(trsync_oid) = self.objects.endstop(oid)?.stop() {
                self.objects.trsync(trsync_oid)?.cancel_timeout();
                self.update_trsync_timer(trsync_oid);
            }
            return Ok(());
        }
        self.objects.trsync(trsync_oid)?;
        let watch = Watch {
            sample_ticks,
            sample_count,
            rest_ticks,
            level: pin_value != 0,
            trsync: trsync_oid,
            reason: trigger_reason,
        };
        self.objects.endstop(oid)?.home(Clock32(clock), watch)?;
        self.set_timer(board, oid, Some(Clock32(clock)))
    }

    fn sample(&mut self, board: &mut impl Board, command: Command<'_>) -> Result<(), ShutdownReason> {
        let Command::QueryAnalogIn {
            oid,
            clock,
            sample_ticks,
            sample_count,
            rest_ticks,
            bytes_per_report,
            min_value,
            max_value,
            range_check_count,
        } = command
        else {
            return Ok(());
        };
        // Another number of readings would give the heater another temperature.
        let is_other = |count| sample_count != 0 && sample_count != count;
        if self.heaters.fed_by(oid).is_some_and(|heater| is_other(heater.wiring.sample_count)) {
            return Err(ShutdownReason::InvalidHeater);
        }
        let clock = Clock32(clock);
        let sampling = Sampling {
            sample_ticks,
            sample_count,
            rest_ticks,
            bytes_per_report,
            min_value,
            max_value,
            range_check_count,
        };
        let runs = self.objects.analog_in(oid)?.query(board, clock, sampling)?;
        self.set_timer(board, oid, runs.then_some(clock))
    }
}
