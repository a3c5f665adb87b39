//! What the commands of the board's heaters do. A board without them does not know them.

use units::Clock32;
use wire::{Command, ShutdownReason};

use crate::{
    board::Board,
    firmware::Core,
    heater::{Drive, Heater, Target, Wiring},
    objects::Object,
};

impl<const OBJECTS: usize, const MOVES: usize> Core<OBJECTS, MOVES> {
    pub(crate) fn dispatch_heater(
        &mut self,
        board: &mut impl Board,
        command: &Command<'_>,
    ) -> Result<(), ShutdownReason> {
        if !self.has_heaters {
            return Err(ShutdownReason::CommandParser);
        }
        match *command {
            Command::HeaterGetState { oid } => {
                let state = self.heaters.get(oid)?.report(board.now());
                self.reply(board, &state);
                return Ok(());
            }
            Command::HeaterSet { .. } | Command::HeaterLease { .. } if self.config_crc.is_none() => {
                return Err(ShutdownReason::NotConfigured);
            }
            Command::HeaterSet { oid, target, standby, standby_s } => {
                let now = board.now();
                self.look(now);
                self.heaters.set(oid, Target { milli: target, standby, standby_s })?;
                self.look(now);
            }
            Command::HeaterLease { alive } => {
                let now = board.now();
                self.heaters.lease(now, Clock32(alive))?;
                self.look(now);
            }
            _ if self.config_crc.is_some() => return Err(ShutdownReason::AlreadyConfigured),
            _ => return self.configure_heater(command),
        }
        Ok(())
    }

    fn configure_heater(&mut self, command: &Command<'_>) -> Result<(), ShutdownReason> {
        match *command {
            Command::ConfigHeater { oid, adc_oid, out_oid, sample_count, max_power, smooth } => {
                self.objects.check_free(oid)?;
                let wiring = Wiring { oid, adc: adc_oid, out: out_oid, sample_count, max_power, smooth };
                let heater = Heater::new(wiring)?;
                if self.objects.analog_in(adc_oid)?.feeds_heater {
                    return Err(ShutdownReason::InvalidHeater);
                }
                self.objects.digital_out(out_oid)?.own()?;
                self.heaters.add(heater)?;
                self.objects.analog_in(adc_oid)?.feeds_heater = true;
                self.objects.put(oid, Object::Heater);
                Ok(())
            }
            Command::HeaterPoint { oid, sum, temperature } => {
                self.heaters.get(oid)?.add_point(sum, temperature)
            }
            Command::HeaterPid { oid, kp, ki, kd } => {
                self.heaters.get(oid)?.set_pid(kp, ki, kd);
                Ok(())
            }
            Command::HeaterWatermark { oid, delta } => self.heaters.get(oid)?.set_watermark(delta),
            Command::HeaterCheck { oid, max_error, gain_time, hysteresis, gain } => {
                self.heaters.get(oid)?.set_check(max_error, gain_time, hysteresis, gain)
            }
            _ => Ok(()),
        }
    }

    /// Takes in what the sensors say, and tells the host. In the main loop: a division takes long on a small chip.
    pub(crate) fn run_heaters(&mut self, board: &mut impl Board) {
        self.heaters.is_due = false;
        while let Some(step) = self.heaters.step() {
            if let Err(reason) = step.and_then(|drive| self.drive(board, &drive)) {
                self.shut_down(board, reason);
                return;
            }
        }
        let now = board.now();
        for heater in self.heaters.all().filter(|heater| heater.report_pending) {
            heater.report_pending = false;
            let _ = self.receiver.send(board, &heater.report(now));
        }
    }

    fn drive(&mut self, board: &mut impl Board, drive: &Drive) -> Result<(), ShutdownReason> {
        let output = self.objects.digital_out(drive.out)?;
        output.drive(board, drive.share);
        match output.wake(&self.hold.clock) {
            Some(wake) => self.timers.schedule(drive.out, wake),
            None => self.timers.cancel(drive.out),
        }
        Ok(())
    }
}
