//! From a machine file to what the planner needs: limits, motors, step distances.
//!
//! Knows the order of motors, which is the same everywhere: X, Y, Z, extruder.

use gcode::VelocityLimit;
use motion::{ExtruderLimits, Limits, Profile};
use steps::{Geometry, StepGenerator, StepperSpec};
use units::{Hertz, Mm, MmPerS, MmPerS2, Seconds};

use crate::{
    config::{Kinematics, PrinterConfig},
    error::{ErrorCode, PrinterError},
};

/// How many motors a machine has: three axes and the extruder (which never moves where there is none).
pub const MOTORS: usize = 4;

/// The motors' names, as in the machine file; see [`motor_names`].
pub const MOTOR_NAMES: [&str; MOTORS] = ["stepper_x", "stepper_y", "stepper_z", "extruder"];

/// The motors' names in a machine's file.
pub fn motor_names(config: &PrinterConfig) -> [&'static str; MOTORS] {
    match config.printer.kinematics {
        Kinematics::Delta(_) => ["stepper_a", "stepper_b", "stepper_c", "extruder"],
        _ => MOTOR_NAMES,
    }
}

/// What a machine file calls a heater.
pub fn heater_name(heater: gcode::Heater) -> String {
    match heater {
        gcode::Heater::Tool(0) => "extruder".to_owned(),
        gcode::Heater::Tool(tool) => format!("extruder{tool}"),
        gcode::Heater::Bed => "heater_bed".to_owned(),
        gcode::Heater::Chamber => "the chamber heater".to_owned(),
    }
}

/// The index of the extruder's motor.
pub const EXTRUDER: usize = 3;

/// How far a step may be from its exact time, either way (and never more than half the gap to its neighbours).
pub const STEP_ERROR_MAX: Seconds = Seconds(25e-6);

/// A stand-in where a machine has no extruder: no move reaches it.
const NO_EXTRUDER_STEP_MM: Mm = Mm(1.0);

/// How the motors move the head.
pub fn geometry(config: &PrinterConfig) -> Geometry {
    config.printer.kinematics.geometry()
}

/// Whether Z has a motor of its own, whose place says where Z is.
pub fn has_z_motor(config: &PrinterConfig) -> bool {
    geometry(config).coupled([false, false, true, false]) == [false, false, true, false]
}

/// From the motors' steps to the head.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motors {
    geometry: Geometry,
    steps_mm: [f64; MOTORS],
}

/// A motor that rounding has put on the wrong side of the middle between two steps is moved by this share of half a step.
const NUDGE: f64 = 1e-6;

impl Motors {
    /// Of a machine.
    pub(crate) fn new(config: &PrinterConfig) -> Self {
        Self { geometry: geometry(config), steps_mm: step_distances(config).map(|distance| distance.0) }
    }

    /// How they move the head.
    pub(crate) const fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// The step that each motor is on where the machine stands there.
    pub(crate) fn counts(&self, position: &[f64; MOTORS]) -> [f64; MOTORS] {
        let at = self.geometry.motor_positions(position);
        core::array::from_fn(|motor| libm::floor(at[motor] * (1.0 / self.steps_mm[motor]) + 0.5))
    }

    /// Where the machine stands after its motors have made so many steps from a place, forward less backward: exactly so
    /// many steps from it. None where no head could be.
    pub(crate) fn moved(&self, from: &[f64; MOTORS], made: [i32; MOTORS]) -> Option<[f64; MOTORS]> {
        if made == [0; MOTORS] {
            return Some(*from);
        }
        let start = self.geometry.motor_positions(from);
        let counts = self.counts(from);
        let wanted: [f64; MOTORS] = core::array::from_fn(|motor| counts[motor] + f64::from(made[motor]));
        let mut at: [f64; MOTORS] =
            core::array::from_fn(|motor| start[motor] + f64::from(made[motor]) * self.steps_mm[motor]);
        let position = self.geometry.position(&at)?;
        if self.counts(&position) == wanted {
            return Some(position);
        }
        for motor in 0..MOTORS {
            at[motor] += NUDGE * (wanted[motor] * self.steps_mm[motor] - at[motor]);
        }
        self.geometry.position(&at)
    }
}

/// The axes that are homed where these are to be: a delta's towers home together.
pub fn homed_together(config: &PrinterConfig, axes: [bool; 3]) -> [bool; 3] {
    let is_delta = matches!(config.printer.kinematics, Kinematics::Delta(_));
    if is_delta && axes.contains(&true) { [true; 3] } else { axes }
}

/// The distance that one step moves each motor's axis.
pub fn step_distances(config: &PrinterConfig) -> [Mm; MOTORS] {
    let [x, y, z] = config.steppers.each_ref().map(|axis| axis.motor.step_distance());
    let e = config.extruder.as_ref().map_or(NO_EXTRUDER_STEP_MM, |extruder| extruder.motor.step_distance());
    [x, y, z, e]
}

/// The section of the filament in mm²; 1.75 mm thick where the machine file has no extruder.
pub fn filament_area_mm2(config: &PrinterConfig) -> f64 {
    const USUAL_MM2: f64 = core::f64::consts::PI * 1.75 * 1.75 / 4.0;
    config.extruder.as_ref().map_or(USUAL_MM2, crate::config::ExtruderConfig::filament_area_mm2)
}

/// The speed of each motor's axis at which it makes as many steps as can be told apart: pulses and the gaps between
/// them last for `step_pulse_duration` at least.
pub fn motor_speeds_max(config: &PrinterConfig, clock: Hertz) -> [MmPerS; MOTORS] {
    let [x, y, z] = config.steppers.each_ref().map(|axis| axis.motor.step_pulse_duration);
    let e = config.extruder.as_ref().map_or(Seconds::ZERO, |extruder| extruder.motor.step_pulse_duration);
    let pulses = [x, y, z, e];
    let distances = step_distances(config);
    core::array::from_fn(|motor| {
        let pulse_ticks = clock.ticks_in(pulses[motor]).0.max(1) as f64;
        let rate = steps::step_rate_max(clock).min(f64::from(clock.0) / (2.0 * pulse_ticks));
        MmPerS(distances[motor].0 * rate)
    })
}

/// The planner's limits.
pub fn limits(config: &PrinterConfig) -> Limits {
    let printer = &config.printer;
    let extruder = config.extruder.as_ref().map_or(
        ExtruderLimits {
            max_extrude_only_velocity: MmPerS(f64::from(u16::MAX)),
            max_extrude_only_accel: MmPerS2(f64::from(u16::MAX)),
            instantaneous_corner_velocity: MmPerS(1.0),
        },
        |extruder| ExtruderLimits {
            max_extrude_only_velocity: extruder.max_extrude_only_velocity,
            max_extrude_only_accel: extruder.max_extrude_only_accel,
            instantaneous_corner_velocity: extruder.instantaneous_corner_velocity,
        },
    );
    Limits {
        max_velocity: printer.max_velocity,
        max_accel: printer.max_accel,
        square_corner_velocity: printer.square_corner_velocity,
        minimum_cruise_ratio: printer.minimum_cruise_ratio,
        max_z_velocity: printer.max_z_velocity,
        max_z_accel: printer.max_z_accel,
        max_xy_velocity: printer.max_xy_velocity,
        max_xy_accel: printer.max_xy_accel,
        junction_deviation: printer.junction_deviation,
        extruder,
    }
}

/// What shapes the speed along the path besides the limits.
pub fn profile(config: &PrinterConfig) -> Profile {
    Profile { motors: config.abilities.to_vec(), max_jerk: config.printer.max_jerk }
}

/// The limits after a file's own: it may ask for less than the machine file allows, never for more.
pub fn lowered(machine: &Limits, current: &Limits, limit: &VelocityLimit) -> Limits {
    let mut limits = *current;
    if let Some(velocity) = limit.velocity {
        limits.max_velocity = velocity.min(machine.max_velocity);
    }
    if let Some(accel) = limit.accel {
        limits.max_accel = accel.min(machine.max_accel);
    }
    if let Some(corner) = limit.square_corner_velocity {
        limits.square_corner_velocity = corner.min(machine.square_corner_velocity);
    }
    if let Some(ratio) = limit.minimum_cruise_ratio {
        limits.minimum_cruise_ratio = ratio;
    }
    limits
}

/// A step generator for the machine's motors, whose steps may be off by so much.
pub fn step_generator(
    config: &PrinterConfig,
    clock: Hertz,
    max_error: Seconds,
) -> Result<StepGenerator<Geometry>, PrinterError> {
    let specs = step_distances(config).map(|step_distance| StepperSpec {
        step_distance,
        max_error,
        search: config.printer.step_search,
    });
    StepGenerator::new(clock, &specs, geometry(config))
        .map_err(|error| PrinterError::new(ErrorCode::ConfigInvalid, error.to_string()))
}

/// What the G-code reader has to know of the machine.
pub fn gcode_settings(config: &PrinterConfig) -> gcode::Settings {
    let retraction = config.firmware_retraction.as_ref().map(|retraction| gcode::FirmwareRetraction {
        length: retraction.retract_length.0,
        speed: retraction.retract_speed,
        extra_length: retraction.unretract_extra_length.0,
        unretract_speed: retraction.unretract_speed,
        z_hop: 0.0,
    });
    gcode::Settings { retraction }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn machines() -> [PrinterConfig; 3] {
        let core = crate::config::SMALL_MACHINE.replace("kinematics: cartesian", "kinematics: corexy");
        [crate::config::SMALL_MACHINE, &core, crate::config::SMALL_DELTA]
            .map(|text| crate::config::parse(text).0.expect("a machine"))
    }

    proptest! {
        #[test]
        fn the_head_is_found_exactly_so_many_steps_away(
            // Places half-way between two steps are the hard ones.
            halves in [-4000..4000_i32, -4000..4000_i32, 0..8000_i32],
            made in [-3000..3000_i32, -3000..3000_i32, -3000..3000_i32, -999..999_i32],
        ) {
            for config in machines() {
                let motors = Motors::new(&config);
                let [x, y, z] = halves.map(|half| f64::from(half) * 0.00625);
                let from = [x, y, z, 1.5];
                let there = motors.moved(&from, made).expect("a place");
                let counts = [from, there].map(|at| motors.counts(&at));
                for motor in 0..MOTORS {
                    prop_assert_eq!(counts[1][motor] - counts[0][motor], f64::from(made[motor]));
                }
                let back = motors.moved(&there, made.map(|steps| -steps)).expect("a place");
                for axis in 0..MOTORS {
                    prop_assert!((back[axis] - from[axis]).abs() < 1e-6, "{:?} {:?}", from, back);
                }
                prop_assert_eq!(motors.counts(&back), counts[0]);
            }
        }
    }

    #[test]
    fn towers_home_together() {
        let [cartesian, core, delta] = machines();
        let x = [true, false, false];
        assert_eq!([&cartesian, &core].map(|config| homed_together(config, x)), [x; 2]);
        assert_eq!(homed_together(&delta, x), [true; 3]);
        assert_eq!(homed_together(&delta, [false; 3]), [false; 3]);
        assert_eq!([&cartesian, &core, &delta].map(has_z_motor), [true, true, false]);
        assert_eq!(motor_names(&delta)[2], "stepper_c");
    }
}
