//! How a machine file is laid out on a board: which oid is what, and the commands that say so.
//!
//! Knows names of pins and the board's dictionary, no time and no state.

use units::{Oid, Seconds};
use wire::{
    Command,
    dictionary::{BOARD_HEATERS, Dictionary, DictionaryError, MOTION_CLOCK},
    messages::CommandKind,
};

use crate::{
    config::{HeaterConfig, PinSpec, PrinterConfig, Pull},
    error::{ErrorCode, PrinterError},
    heater::{self, board::Objects},
    machine::MOTORS,
};

/// Every command without which a machine cannot be run.
const NEEDED: &[CommandKind] = &[
    CommandKind::AllocateOids,
    CommandKind::GetConfig,
    CommandKind::FinalizeConfig,
    CommandKind::GetClock,
    CommandKind::GetUptime,
    CommandKind::EmergencyStop,
    CommandKind::ConfigStepper,
    CommandKind::QueueStep,
    CommandKind::SetNextStepDir,
    CommandKind::ResetStepClock,
    CommandKind::StepperGetPosition,
    CommandKind::StepperStopOnTrigger,
    CommandKind::ConfigTrsync,
    CommandKind::TrsyncStart,
    CommandKind::TrsyncSetTimeout,
    CommandKind::TrsyncTrigger,
    CommandKind::ConfigEndstop,
    CommandKind::EndstopQueryState,
    CommandKind::EndstopHome,
    CommandKind::ConfigAnalogIn,
    CommandKind::QueryAnalogIn,
    CommandKind::ConfigDigitalOut,
    CommandKind::SetDigitalOutPwmCycle,
    CommandKind::QueueDigitalOut,
    CommandKind::UpdateDigitalOut,
];

/// What a board needs besides so that its motion can be held: the host's lease on motion, and what ends a hold.
const MOTION_NEEDED: &[CommandKind] = &[
    CommandKind::MotionLease,
    CommandKind::MotionEnd,
    CommandKind::MotionHold,
    CommandKind::MotionResume,
    CommandKind::MotionGetState,
    CommandKind::MotionDrop,
    CommandKind::MotionJob,
    CommandKind::MotionTie,
    CommandKind::StepperGetQueue,
];
/// The version of the motion clock that is spoken here.
const MOTION_VERSION: f64 = 1.0;

/// What a board needs besides so that it regulates heaters by itself.
const HEATERS_NEEDED: &[CommandKind] = &[
    CommandKind::ConfigHeater,
    CommandKind::HeaterPoint,
    CommandKind::HeaterPid,
    CommandKind::HeaterWatermark,
    CommandKind::HeaterCheck,
    CommandKind::HeaterSet,
    CommandKind::HeaterLease,
    CommandKind::HeaterGetState,
];
/// The version of the board's heaters that is spoken here.
const HEATERS_VERSION: f64 = 1.0;

/// How many readings of a sensor are added up.
pub(super) const SAMPLE_COUNT: u8 = 8;

/// How long a heater stays on without being refreshed by its loop, wherever that runs.
const HEATER_MAX_DURATION: Seconds = Seconds(3.0);

/// A converter's full scale where the board does not say.
const ADC_MAX_DEFAULT: f64 = 4095.0;

/// A motor's objects.
#[derive(Clone, Copy, Debug)]
pub(super) struct StepperOids {
    pub(super) stepper: Oid,
    pub(super) invert_dir: bool,
    pub(super) enable: Option<Output>,
}

/// A switched or pulsed output.
#[derive(Clone, Copy, Debug)]
pub(super) struct Output {
    pub(super) oid: Oid,
    pub(super) inverted: bool,
    /// The period of its pulses in ticks; 0 for one that is only on or off.
    pub(super) cycle_ticks: u32,
}

impl Output {
    /// What `queue_digital_out` has to say for a share of time between 0 and 1.
    pub(super) fn on_ticks(self, duty: f64) -> u32 {
        let duty = if duty.is_finite() { duty.clamp(0.0, 1.0) } else { 0.0 };
        let duty = if self.inverted { 1.0 - duty } else { duty };
        let full = f64::from(self.cycle_ticks.max(1));
        libm::round(duty * full) as u32
    }
}

/// An axis' switch and the trigger that it fires.
#[derive(Clone, Copy, Debug)]
pub(super) struct EndstopOids {
    pub(super) endstop: Oid,
    pub(super) trsync: Oid,
    pub(super) inverted: bool,
}

/// A heater's sensor and its power.
#[derive(Clone, Copy, Debug)]
pub(super) struct HeaterOids {
    pub(super) sensor: Oid,
    pub(super) power: Output,
    /// Where the board itself regulates it.
    pub(super) board: Option<Oid>,
}

/// Which object is what.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    pub(super) steppers: [Option<StepperOids>; MOTORS],
    pub(super) endstops: [EndstopOids; 3],
    pub(super) extruder: Option<HeaterOids>,
    pub(super) bed: Option<HeaterOids>,
    pub(super) fan: Option<Output>,
    /// Whether the board can hold its motion (docs/motion-clock.md). The part fan then follows the motion clock.
    pub(super) has_motion_clock: bool,
    /// The commands that set all this up, without `finalize_config`.
    pub(super) commands: Vec<Command<'static>>,
    /// The CRC-32 of those commands: a board that was set up by the same says so.
    pub(super) crc: u32,
}

struct Builder<'a> {
    dictionary: &'a Dictionary,
    clock_freq: f64,
    commands: Vec<Command<'static>>,
    oids: u8,
    /// Full scale of the converter, where the board regulates its heaters.
    heaters_adc_max: Option<f64>,
}

impl Builder<'_> {
    fn oid(&mut self) -> Oid {
        let oid = Oid(self.oids);
        self.oids += 1;
        oid
    }

    fn ticks(&self, duration: Seconds) -> u32 {
        libm::round(duration.0 * self.clock_freq) as u32
    }

    fn pin(&self, pin: &PinSpec) -> Result<u8, PrinterError> {
        self.dictionary.pin(&pin.name).ok_or_else(|| {
            let mcu = self.dictionary.text("MCU").unwrap_or_else(|| "the board".into());
            PrinterError::new(ErrorCode::PinUnknown, format!("{mcu} has no pin \"{}\"", pin.name))
        })
    }

    fn output(
        &mut self,
        pin: &PinSpec,
        cycle: Option<Seconds>,
        max_duration: Seconds,
    ) -> Result<Output, PrinterError> {
        let number = u32::from(self.pin(pin)?);
        let Oid(oid) = self.oid();
        let off = u8::from(pin.inverted);
        let max_duration = self.ticks(max_duration);
        self.commands.push(Command::ConfigDigitalOut {
            oid,
            pin: number,
            value: off,
            default_value: off,
            max_duration,
        });
        let cycle_ticks = cycle.map_or(0, |cycle| self.ticks(cycle));
        if cycle_ticks > 0 {
            self.commands.push(Command::SetDigitalOutPwmCycle { oid, cycle_ticks });
        }
        Ok(Output { oid: Oid(oid), inverted: pin.inverted, cycle_ticks })
    }

    fn heater(&mut self, config: &HeaterConfig) -> Result<HeaterOids, PrinterError> {
        let pin = u32::from(self.pin(&config.sensor_pin)?);
        let sensor = self.oid();
        self.commands.push(Command::ConfigAnalogIn { oid: sensor.0, pin });
        let power = self.output(&config.heater_pin, Some(config.pwm_cycle_time), HEATER_MAX_DURATION)?;
        let board = self.heaters_adc_max.and_then(|adc_max| {
            let objects = Objects { heater: self.oids, sensor: sensor.0, output: power.oid.0 };
            let commands = heater::board::commands(config, objects, adc_max, SAMPLE_COUNT)?;
            self.commands.extend(commands);
            Some(self.oid())
        });
        Ok(HeaterOids { sensor, power, board })
    }

    fn endstop(&mut self, pin: &PinSpec) -> Result<EndstopOids, PrinterError> {
        let number = self.pin(pin)?;
        let (endstop, trsync) = (self.oid(), self.oid());
        let pull_up = match pin.pull {
            Pull::Up => 1,
            Pull::None => 0,
            Pull::Down => -1,
        };
        self.commands.push(Command::ConfigEndstop { oid: endstop.0, pin: number, pull_up });
        self.commands.push(Command::ConfigTrsync { oid: trsync.0 });
        Ok(EndstopOids { endstop, trsync, inverted: pin.inverted })
    }

    fn stepper(&mut self, motor: &crate::config::MotorConfig) -> Result<StepperOids, PrinterError> {
        let step_pin = self.pin(&motor.step_pin)?;
        let dir_pin = self.pin(&motor.dir_pin)?;
        let stepper = self.oid();
        self.commands.push(Command::ConfigStepper {
            oid: stepper.0,
            step_pin,
            dir_pin,
            invert_step: u8::from(motor.step_pin.inverted),
            step_pulse_ticks: self.ticks(motor.step_pulse_duration),
        });
        let enable = match &motor.enable_pin {
            Some(pin) => Some(self.output(pin, None, Seconds::ZERO)?),
            None => None,
        };
        Ok(StepperOids { stepper, invert_dir: motor.dir_pin.inverted, enable })
    }
}

/// Full scale of the board's converter.
pub(super) fn adc_max(dictionary: &Dictionary) -> f64 {
    dictionary.number("ADC_MAX").unwrap_or(ADC_MAX_DEFAULT)
}

impl Layout {
    /// Lays a machine out on a board.
    pub(super) fn new(
        config: &PrinterConfig,
        dictionary: &Dictionary,
        clock_freq: f64,
    ) -> Result<Self, PrinterError> {
        let wrong =
            |error: DictionaryError| PrinterError::new(ErrorCode::DictionaryIncomplete, error.to_string());
        dictionary.require(NEEDED).map_err(wrong)?;
        let has_motion_clock = dictionary.number(MOTION_CLOCK) == Some(MOTION_VERSION)
            && dictionary.require(MOTION_NEEDED).is_ok();
        let has_heaters = dictionary.number(BOARD_HEATERS) == Some(HEATERS_VERSION)
            && dictionary.require(HEATERS_NEEDED).is_ok();
        let heaters_adc_max = has_heaters.then(|| adc_max(dictionary));
        let mut builder = Builder { dictionary, clock_freq, commands: Vec::new(), oids: 0, heaters_adc_max };
        let mut steppers = [None; MOTORS];
        let [x, y, z] = &config.steppers;
        let endstops = [
            builder.endstop(&x.endstop_pin)?,
            builder.endstop(&y.endstop_pin)?,
            builder.endstop(&z.endstop_pin)?,
        ];
        for (slot, axis) in steppers.iter_mut().zip(&config.steppers) {
            *slot = Some(builder.stepper(&axis.motor)?);
        }
        let mut extruder = None;
        if let Some(config) = &config.extruder {
            steppers[3] = Some(builder.stepper(&config.motor)?);
            extruder = Some(builder.heater(&config.heater)?);
        }
        let bed = config.heater_bed.as_ref().map(|bed| builder.heater(bed)).transpose()?;
        let fan = match &config.fan {
            Some(fan) => Some(builder.output(&fan.pin, Some(fan.cycle_time), Seconds::ZERO)?),
            None => None,
        };
        if let Some(fan) = fan.filter(|_| has_motion_clock) {
            builder.commands.push(Command::MotionTie { oid: fan.oid.0 });
        }
        let mut commands = vec![Command::AllocateOids { count: builder.oids }];
        commands.append(&mut builder.commands);
        let mut bytes = Vec::new();
        for command in &commands {
            dictionary.encode(command, &mut bytes).map_err(wrong)?;
        }
        let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&bytes);
        Ok(Self { steppers, endstops, extruder, bed, fan, has_motion_clock, commands, crc })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use virtual_printer::BoardProfile;

    fn lay_out(text: &str) -> Result<Layout, PrinterError> {
        let config = crate::config::parse(text).0.expect("a machine");
        let board = BoardProfile::rp2040();
        let dictionary = Dictionary::parse(&board.description().compressed()).expect("a dictionary");
        Layout::new(&config, &dictionary, f64::from(board.clock.0))
    }

    const SAMPLE: &str = include_str!("../../../../samples/printer.cfg");

    #[test]
    fn the_sample_machine_is_laid_out_as_its_file_says() {
        let layout = lay_out(SAMPLE).unwrap();
        // The points of the sensors' curves are many.
        let is_point = |command: &&Command<'_>| matches!(command, Command::HeaterPoint { .. });
        assert!((4..=64).contains(&layout.commands.iter().filter(is_point).count()));
        let others = layout.commands.iter().filter(|command| !is_point(command));
        let text: Vec<String> = others.map(|command| format!("{command:?}")).collect();
        let expected = [
            "AllocateOids { count: 21 }",
            "ConfigEndstop { oid: 0, pin: 20, pull_up: 1 }",
            "ConfigTrsync { oid: 1 }",
            "ConfigEndstop { oid: 2, pin: 21, pull_up: 1 }",
            "ConfigTrsync { oid: 3 }",
            "ConfigEndstop { oid: 4, pin: 22, pull_up: 1 }",
            "ConfigTrsync { oid: 5 }",
            "ConfigStepper { oid: 6, step_pin: 0, dir_pin: 1, invert_step: 0, step_pulse_ticks: 24 }",
            "ConfigDigitalOut { oid: 7, pin: 2, value: 1, default_value: 1, max_duration: 0 }",
            "ConfigStepper { oid: 8, step_pin: 3, dir_pin: 4, invert_step: 0, step_pulse_ticks: 24 }",
            "ConfigDigitalOut { oid: 9, pin: 5, value: 1, default_value: 1, max_duration: 0 }",
            "ConfigStepper { oid: 10, step_pin: 6, dir_pin: 7, invert_step: 0, step_pulse_ticks: 24 }",
            "ConfigDigitalOut { oid: 11, pin: 8, value: 1, default_value: 1, max_duration: 0 }",
            "ConfigStepper { oid: 12, step_pin: 9, dir_pin: 10, invert_step: 0, step_pulse_ticks: 24 }",
            "ConfigDigitalOut { oid: 13, pin: 11, value: 1, default_value: 1, max_duration: 0 }",
            "ConfigAnalogIn { oid: 14, pin: 26 }",
            "ConfigDigitalOut { oid: 15, pin: 16, value: 0, default_value: 0, max_duration: 36000000 }",
            "SetDigitalOutPwmCycle { oid: 15, cycle_ticks: 1200000 }",
            "ConfigHeater { oid: 16, adc_oid: 14, out_oid: 15, sample_count: 8, max_power: 4096, smooth: 1000 }",
            "HeaterPid { oid: 16, kp: 1460605, ki: 71056, kd: 7500402 }",
            "HeaterCheck { oid: 16, max_error: 120000, gain_time: 20000, hysteresis: 5000, gain: 2000 }",
            "ConfigAnalogIn { oid: 17, pin: 27 }",
            "ConfigDigitalOut { oid: 18, pin: 17, value: 0, default_value: 0, max_duration: 36000000 }",
            "SetDigitalOutPwmCycle { oid: 18, cycle_ticks: 1200000 }",
            "ConfigHeater { oid: 19, adc_oid: 17, out_oid: 18, sample_count: 8, max_power: 4096, smooth: 1000 }",
            "HeaterWatermark { oid: 19, delta: 2000 }",
            "HeaterCheck { oid: 19, max_error: 120000, gain_time: 60000, hysteresis: 5000, gain: 2000 }",
            "ConfigDigitalOut { oid: 20, pin: 18, value: 0, default_value: 0, max_duration: 0 }",
            "SetDigitalOutPwmCycle { oid: 20, cycle_ticks: 120000 }",
            "MotionTie { oid: 20 }",
        ];
        assert_eq!(text, expected, "{text:#?}");
        assert!(layout.steppers[1].is_some_and(|oids| oids.invert_dir));
    }

    #[test]
    fn plain_boards_are_told_nothing_of_a_motion_clock_nor_of_heaters() {
        let config = crate::config::parse(SAMPLE).0.expect("a machine");
        let board = BoardProfile::rp2040().plain();
        let dictionary = Dictionary::parse(&board.description().compressed()).expect("a dictionary");
        let layout = Layout::new(&config, &dictionary, f64::from(board.clock.0)).unwrap();
        assert!(!layout.has_motion_clock);
        assert!(layout.commands.iter().all(|command| !command.kind().is_extension()));
        assert!(layout.extruder.is_some_and(|oids| oids.board.is_none()));
    }

    #[test]
    fn every_heater_is_watched_by_the_board_and_off_by_default() {
        let layout = lay_out(&SAMPLE.replace("heater_pin: gpio16", "heater_pin: !gpio16")).unwrap();
        for heater in [layout.extruder.unwrap(), layout.bed.unwrap()] {
            let found = layout.commands.iter().find_map(|command| match *command {
                Command::ConfigDigitalOut { oid, value, default_value, max_duration, .. }
                    if oid == heater.power.oid.0 =>
                {
                    Some((value, default_value, max_duration))
                }
                _ => None,
            });
            let off = u8::from(heater.power.inverted);
            assert_eq!(found, Some((off, off, 36_000_000)));
            assert_eq!(heater.power.on_ticks(0.0), u32::from(off) * heater.power.cycle_ticks);
            assert_eq!(heater.power.on_ticks(f64::NAN), heater.power.on_ticks(0.0));
        }
    }

    #[test]
    fn another_machine_file_has_another_number() {
        let crc = lay_out(SAMPLE).unwrap().crc;
        assert_ne!(crc, lay_out(&SAMPLE.replace("gpio18", "gpio19")).unwrap().crc);
        assert_eq!(crc, lay_out(&SAMPLE.replace("max_accel: 3000", "max_accel: 2000")).unwrap().crc);
    }

    #[test]
    fn a_pin_that_the_board_lacks_is_named() {
        let error = lay_out(&SAMPLE.replace("gpio18", "PA8")).unwrap_err();
        assert_eq!(error.code, ErrorCode::PinUnknown);
        assert!(error.detail.contains("PA8") && error.detail.contains("rp2040"));
    }
}
