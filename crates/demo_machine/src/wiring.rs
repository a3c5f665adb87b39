//! From a `printer.cfg` to the simulated machine: what the file calls a pin gets a part of a usual printer wired to it.
//!
//! The file knows pins, directions and distances; masses, torques and heaters it does not know, so those are of a usual
//! desktop printer. Order of motors: X, Y, Z, extruder, as everywhere.

use printer::{
    config::{HeaterConfig, Kinematics, MotorConfig, PinSpec, PrinterConfig, StepperConfig},
    error::{ErrorCode, PrinterError},
    machine::{EXTRUDER, MOTOR_NAMES},
};
use units::{Celsius, Mm, Ohms};
use virtual_printer::{
    Endstop, Fan, Filament, Gantry, Heater, Machine, Mechanics, Motor, Plant, Sensor, Side, Thermistor,
    Towers, Wire,
};

/// What each axis moves, in kg: the carriage, the bed, the gantry.
const MOVED_KG: [f64; 3] = [0.4, 0.8, 0.8];
/// A carriage on a delta's tower with its share of the head, in kg.
const TOWER_KG: f64 = 0.2;
/// What hangs on a motor, as a torque: a gantry's weight is small behind a screw.
const GRAVITY_M_S2: f64 = 9.81;
/// At power-up an axis stands this far from its endstop, or in the middle of a shorter one.
const START_FROM_ENDSTOP_MM: f64 = 40.0;
/// The frame is this far beyond the positions that may be used.
const FRAME_MARGIN_MM: f64 = 3.0;
/// Where a sensor's curve is taken from the machine file.
const CURVE_POINTS_C: [f64; 3] = [25.0, 150.0, 250.0];

/// Builds the machine that a file describes. An error where the file has a part that cannot be simulated.
pub fn machine(config: &PrinterConfig) -> Result<Machine, PrinterError> {
    let mut machine = Machine { gantry: gantry(config), ..Machine::default() };
    let axes = axes(config);
    let starts = machine.gantry.motors(axes.each_ref().map(|axis| axis.start));
    for (index, (stepper, axis)) in config.steppers.iter().zip(&axes).enumerate() {
        let start = if machine.gantry.is_coupled() { starts[index] } else { axis.start };
        machine.motors.push(axis_motor(config, index, stepper, axis, Mm(start)));
        machine.endstops.push(Endstop {
            name: stepper.name.clone(),
            wire: wire(&stepper.endstop_pin),
            motor: index,
            side: if stepper.homing_positive_dir { Side::Max } else { Side::Min },
            position: Mm(axis.endstop),
        });
    }
    if let Some(fan) = &config.fan {
        machine.fans.push(Fan { name: "fan".to_owned(), wire: wire(&fan.pin) });
    }
    if let Some(extruder) = &config.extruder {
        let mechanics = Mechanics {
            full_steps_per_rotation: extruder.motor.full_steps_per_rotation,
            ..Mechanics::extruder(extruder.motor.microsteps)
        };
        machine.motors.push(motor(MOTOR_NAMES[EXTRUDER], &extruder.motor, mechanics, Mm::ZERO, None));
        machine.heaters.push(Heater {
            fan: config.fan.as_ref().map(|_| 0),
            filament: Some(Filament { motor: EXTRUDER, diameter: extruder.filament_diameter }),
            ..heater(&extruder.heater, Plant::hot_end())?
        });
    }
    if let Some(bed) = &config.heater_bed {
        machine.heaters.push(heater(bed, Plant::bed())?);
    }
    Ok(machine)
}

/// How the machine is built.
fn gantry(config: &PrinterConfig) -> Gantry {
    match &config.printer.kinematics {
        Kinematics::Cartesian => Gantry::Cartesian,
        Kinematics::CoreXy => Gantry::CoreXy,
        Kinematics::CoreXz => Gantry::CoreXz,
        Kinematics::HybridCoreXy => Gantry::HybridCoreXy,
        Kinematics::HybridCoreXz => Gantry::HybridCoreXz,
        Kinematics::Delta(delta) => Gantry::Delta(Towers {
            feet: delta.towers.map(|tower| {
                let angle = tower.angle.to_radians();
                [delta.delta_radius.0 * libm::cos(angle), delta.delta_radius.0 * libm::sin(angle)]
            }),
            arms: delta.towers.map(|tower| tower.arm_length.0),
        }),
    }
}

/// What runs between two stops, in mm.
struct Carriage {
    min: f64,
    max: f64,
    endstop: f64,
    start: f64,
}

/// The carriages that press the endstops: of the axes, or on a delta's towers.
fn axes(config: &PrinterConfig) -> [Carriage; 3] {
    core::array::from_fn(|index| {
        let stepper = &config.steppers[index];
        let (min, max) = (stepper.position_min.0, stepper.position_max.0);
        if let Kinematics::Delta(delta) = &config.printer.kinematics {
            let endstop = delta.endstops()[index].0;
            let z = &config.steppers[2];
            let low = endstop - (z.position_max - z.position_min).0 - delta.towers[index].arm_length.0;
            // None of them stands like the others.
            let start = endstop - START_FROM_ENDSTOP_MM - 7.0 * index as f64;
            return Carriage { min: low, max: endstop, endstop, start };
        }
        let away = START_FROM_ENDSTOP_MM.min((max - min) / 2.0);
        let endstop = stepper.position_endstop.0;
        let start = if stepper.homing_positive_dir { endstop - away } else { endstop + away };
        Carriage { min, max, endstop, start }
    })
}

/// What a motor moves, in kg, and what of that hangs on it, down to lower positions of its own.
fn loads(gantry: &Gantry, index: usize) -> (f64, f64) {
    let z = MOVED_KG[2];
    match (gantry, index) {
        // Two motors share what hangs on one belt and the other.
        (Gantry::CoreXy, 0 | 1) => (MOVED_KG[1] / 2.0, 0.0),
        // What hangs on a single belt is light, or it would fall without current.
        (Gantry::HybridCoreXz, 2) => (MOVED_KG[0], MOVED_KG[0]),
        (Gantry::CoreXz, 0) => (z / 2.0, z / 2.0),
        (Gantry::CoreXz, 2) => (z / 2.0, -z / 2.0),
        (Gantry::Delta(_), _) => (TOWER_KG, TOWER_KG),
        (_, 2) => (z, z),
        _ => (MOVED_KG[index], 0.0),
    }
}

fn axis_motor(
    config: &PrinterConfig,
    index: usize,
    stepper: &StepperConfig,
    carriage: &Carriage,
    start: Mm,
) -> Motor {
    let gantry = gantry(config);
    let mm_per_rotation = stepper.motor.rotation_distance.0 / stepper.motor.gear_ratio;
    let (moved_kg, hanging_kg) = loads(&gantry, index);
    let mut mechanics = Mechanics {
        full_steps_per_rotation: stepper.motor.full_steps_per_rotation,
        ..Mechanics::nema17(stepper.motor.microsteps, mm_per_rotation, moved_kg)
    };
    if hanging_kg != 0.0 {
        mechanics.load_nm = hanging_kg * GRAVITY_M_S2 * mm_per_rotation / 1000.0 / std::f64::consts::TAU;
    }
    let &Carriage { min, max, endstop, .. } = carriage;
    let frame = (Mm(min.min(endstop) - FRAME_MARGIN_MM), Mm(max.max(endstop) + FRAME_MARGIN_MM));
    let is_alone = !gantry.is_coupled() || (0..3).all(|axis| axis == index || is_free(&gantry, index, axis));
    motor(&stepper.name, &stepper.motor, mechanics, start, is_alone.then_some(frame))
}

/// Whether a motor stands still where only this axis moves.
fn is_free(gantry: &Gantry, motor: usize, axis: usize) -> bool {
    let way = core::array::from_fn(|it| f64::from(u8::from(it == axis)));
    gantry.motors(way)[motor] == 0.0
}

fn motor(
    name: &str,
    config: &MotorConfig,
    mechanics: Mechanics,
    start: Mm,
    frame: Option<(Mm, Mm)>,
) -> Motor {
    Motor {
        name: name.to_owned(),
        step: wire(&config.step_pin),
        dir: wire(&config.dir_pin),
        enable: config.enable_pin.as_ref().map(wire),
        mechanics,
        step_distance: config.step_distance(),
        start,
        frame,
        sag: Mm::ZERO,
    }
}

fn heater(config: &HeaterConfig, plant: Plant) -> Result<Heater, PrinterError> {
    let divider = &config.thermistor;
    let points = CURVE_POINTS_C.map(|celsius| {
        let ohms = divider.curve.resistance(Celsius(celsius)).0 + divider.inline.0;
        (Celsius(celsius), Ohms(ohms))
    });
    let Some(thermistor) = Thermistor::steinhart_hart(points) else {
        let detail = format!(
            "[{}] sensor_type: {} cannot be simulated: only sensors whose resistance falls with temperature (NTC) can",
            config.name, config.sensor_type
        );
        return Err(PrinterError::new(ErrorCode::ConfigUnsupported, detail));
    };
    Ok(Heater {
        name: config.name.clone(),
        wire: wire(&config.heater_pin),
        sensor_pin: config.sensor_pin.name.clone(),
        sensor: Sensor { thermistor, pull_up: divider.pullup, ..Sensor::default() },
        plant,
        fan: None,
        filament: None,
    })
}

fn wire(pin: &PinSpec) -> Wire {
    Wire::new(pin.name.clone(), pin.inverted)
}

#[cfg(test)]
mod tests {
    use super::*;
    use printer::config;

    #[test]
    fn the_usual_machine_is_wired_part_for_part() {
        let config = config::parse(crate::USUAL_MACHINE).0.unwrap();
        let built = machine(&config).unwrap();
        let names: Vec<_> = built.motors.iter().map(|motor| motor.name.as_str()).collect();
        assert_eq!(names, MOTOR_NAMES);
        assert_eq!(built.endstops.len(), 3);
        assert_eq!(built.heaters.len(), config.heaters().count());
        for (motor, distance) in built.motors.iter().zip(printer::machine::step_distances(&config)) {
            assert_eq!(motor.step_distance, distance);
        }
        for (endstop, stepper) in built.endstops.iter().zip(&config.steppers) {
            let motor = &built.motors[endstop.motor];
            let (low, high) = motor.frame.unwrap();
            assert!(low < endstop.position && endstop.position < high);
            assert_ne!(motor.start, stepper.position_endstop);
        }
    }
}
