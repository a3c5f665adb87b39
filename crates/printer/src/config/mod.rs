//! A machine as its `printer.cfg` describes it: text in, checked values and diagnostics out.
//!
//! Knows the format and the meaning of the options that are supported; knows nothing of files, boards or sessions.
//! Lengths in millimetres, times in seconds, temperatures in °C, as in the file. Defaults are those of Klipper's
//! public documentation (docs/Config_Reference.md).
//!
//! Nothing is ignored in silence: what is not understood is a diagnostic. Where leaving something out would make the
//! machine move or heat otherwise than its owner expects, that is an error and there is no [`PrinterConfig`].

mod bed;
mod diagnostics;
mod document;
mod dynamics;
mod hints;
mod kinematics;
mod machine;
mod pin;
mod reader;
mod rest;
mod stepper;
mod thermal;
mod torque;

pub use diagnostics::{CONFIG_DIAGNOSTICS_MAX, ConfigDiagnostic, Severity};
pub use document::CONFIG_BYTES_MAX;
pub use dynamics::AxisShaperConfig;
pub use kinematics::{DeltaConfig, Kinematics, TowerConfig};
pub use machine::{FirmwareRetraction, IdleTimeoutConfig, MachineConfig, McuConfig, UnreachableSpeed};
pub use pin::{PinSpec, Pull};
pub use stepper::{MotorConfig, StepperConfig};
pub use thermal::{ControlConfig, ExtruderConfig, FanConfig, HeaterConfig};

use std::sync::Arc;

use motion::MotorAbility;

use crate::transform::Profiles;
use diagnostics::Log;
use reader::{Checked, PinRegistry, Reader, Reported};

/// A whole machine, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct PrinterConfig {
    /// `[mcu]`.
    pub mcu: McuConfig,
    /// `[printer]`.
    pub printer: MachineConfig,
    /// `[stepper_x]`, `[stepper_y]`, `[stepper_z]`, in this order: each says what there is to say of its axis, and of a
    /// motor. Those of a delta are its towers' motors; where the head may be is said of the axes all the same.
    pub steppers: [StepperConfig; 3],
    /// `[extruder]`, if the machine has one.
    pub extruder: Option<ExtruderConfig>,
    /// `[heater_bed]`, if the machine has one.
    pub heater_bed: Option<HeaterConfig>,
    /// `[fan]`: the part fan, if the machine has one.
    pub fan: Option<FanConfig>,
    /// `[idle_timeout]`.
    pub idle_timeout: IdleTimeoutConfig,
    /// `[input_shaper]` for X and Y.
    pub input_shaper: [AxisShaperConfig; 2],
    /// `[firmware_retraction]`: what G10 and G11 do; none where the section is missing.
    pub firmware_retraction: Option<FirmwareRetraction>,
    /// `[motor_torque …]` of X, Y, Z and the extruder: what a motor can do at each speed, where that is known.
    pub abilities: [Option<MotorAbility>; 4],
    /// `[skew_correction …]` and `[bed_mesh …]`: what G-code can load.
    pub profiles: Arc<Profiles>,
    /// `[force_move] enable_force_move`: positions may be set by hand.
    pub force_move: bool,
}

impl PrinterConfig {
    /// How far an input shaper may move an axis from when its move does.
    pub fn shaper_reach(&self) -> units::Seconds {
        let reaches = self.input_shaper.iter().filter_map(AxisShaperConfig::shaper);
        units::Seconds(reaches.map(|shaper| shaper.duration().0).fold(0.0, f64::max))
    }

    /// Every heater of the machine.
    pub fn heaters(&self) -> impl Iterator<Item = &HeaterConfig> {
        self.extruder.iter().map(|extruder| &extruder.heater).chain(&self.heater_bed)
    }
}

/// Reads a printer.cfg. The configuration is there exactly when no diagnostic is an error; diagnostics are in the
/// order of the lines and at most [`CONFIG_DIAGNOSTICS_MAX`] and one.
pub fn parse(text: &str) -> (Option<PrinterConfig>, Vec<ConfigDiagnostic>) {
    let mut log = Log::default();
    let config = build(text, &mut log);
    let config = config.ok().filter(|_| !log.has_errors());
    (config, log.into_diagnostics())
}

/// Everything that the builders of sections share.
struct Builder<'a> {
    document: document::Document,
    pins: PinRegistry,
    log: &'a mut Log,
}

impl Builder<'_> {
    /// A section that may be missing.
    fn section(&mut self, name: &str) -> Option<Reader<'_>> {
        let section = self.document.take(name)?;
        Some(self.reader(section))
    }

    /// A section that must be there.
    fn required_section(&mut self, name: &str) -> Checked<Reader<'_>> {
        let Some(section) = self.document.take(name) else {
            self.log.error(0, format!("[{name}] is missing: every printer.cfg needs that section"));
            return Err(Reported);
        };
        Ok(self.reader(section))
    }

    fn reader(&mut self, section: document::Section) -> Reader<'_> {
        Reader::new(section, &mut self.pins, self.log)
    }
}

fn build(text: &str, log: &mut Log) -> Checked<PrinterConfig> {
    let document = document::read(text, log);
    let mut builder = Builder { document, pins: PinRegistry::default(), log };
    let kind = kinematics::kind(&mut builder)?;
    // All sections are read before the first missing one ends this, so that one reading shows every mistake.
    let mcu = machine::mcu(&mut builder);
    let mut printer = machine::printer(&mut builder, kind);
    let steppers = kinematics::steppers(&mut builder, kind, &mut printer);
    let printer = printer.map(|(printer, _)| printer);
    let custom = thermal::custom_sensors(&mut builder);
    let limits = printer.map(|printer| (printer.max_velocity, printer.max_accel));
    let extruder = thermal::extruder(&mut builder, &custom, limits);
    let heater_bed = thermal::heater_bed(&mut builder, &custom);
    let fan = thermal::fan(&mut builder);
    let idle_timeout = machine::idle_timeout(&mut builder);
    let input_shaper = dynamics::input_shaper(&mut builder);
    let firmware_retraction = machine::firmware_retraction(&mut builder);
    let force_move = machine::force_move(&mut builder);
    let profiles = bed::profiles(&mut builder);
    let feeder = extruder.as_ref().ok().and_then(Option::as_ref).map(|extruder| extruder.motor.clone());
    let motors = kinematics::motor_names(kind).into_iter().zip(
        steppers
            .each_ref()
            .map(|stepper| stepper.as_ref().ok().map(|stepper| stepper.motor.clone()))
            .into_iter()
            .chain([feeder]),
    );
    let mut abilities = Vec::new();
    for (motor, (name, config)) in motors.enumerate() {
        let is_alone = kind.is_none_or(|kind| kind.is_alone(motor));
        abilities.push(torque::motor_torque(&mut builder, name, config.as_ref(), is_alone));
    }
    if printer.as_ref().is_ok_and(|it| it.max_jerk.is_some())
        && abilities.iter().any(|it| it.as_ref().is_ok_and(Option::is_some))
    {
        let problem =
            "[printer] max_jerk cannot be used together with [motor_torque …]: leave out one of them";
        builder.log.error(0, problem);
    }
    rest::report(builder.document.into_rest(), builder.log);
    Ok(PrinterConfig {
        mcu: mcu?,
        printer: printer?,
        steppers: {
            let [x, y, z] = steppers;
            [x?, y?, z?]
        },
        extruder: extruder?,
        heater_bed: heater_bed?,
        fan: fan?,
        idle_timeout: idle_timeout?,
        input_shaper: input_shaper?,
        firmware_retraction: firmware_retraction?,
        abilities: abilities.into_iter().collect::<Checked<Vec<_>>>()?.try_into().map_err(|_| Reported)?,
        profiles: profiles?,
        force_move: force_move?,
    })
}

/// A machine for tests.
#[cfg(test)]
pub(crate) const SMALL_MACHINE: &str = include_str!("small_machine.cfg");
/// A delta for tests.
#[cfg(test)]
pub(crate) const SMALL_DELTA: &str = include_str!("small_delta.cfg");

#[cfg(test)]
mod kinematics_tests;
#[cfg(test)]
mod tests;
