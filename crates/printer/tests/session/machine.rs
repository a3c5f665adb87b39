//! The machine that is printed on: small, quick to home and quick to heat.

use printer::{
    config::{self, HeaterConfig, Kinematics, MotorConfig, PinSpec, PrinterConfig, StepperConfig},
    machine::{EXTRUDER, MOTOR_NAMES},
};
use units::{Celsius, Mm, Ohms};
use virtual_printer::{
    BoardProfile, Endstop, Fan, Filament, Gantry, Heater, Machine, Mechanics, Motor, Plant, Sensor, Side,
    Thermistor, Wire,
};

pub(crate) const CONFIG: &str = "
[mcu]
serial: none
[printer]
kinematics: cartesian
max_velocity: 200
max_accel: 2000
max_z_velocity: 15
max_z_accel: 200
[stepper_x]
step_pin: gpio0
dir_pin: gpio1
enable_pin: !gpio2
rotation_distance: 40
microsteps: 16
endstop_pin: ^gpio20
position_endstop: 0
position_max: 150
homing_speed: 40
second_homing_speed: 10
[stepper_y]
step_pin: gpio3
dir_pin: !gpio4
enable_pin: !gpio5
rotation_distance: 40
microsteps: 16
endstop_pin: ^gpio21
position_endstop: 150
position_max: 150
homing_speed: 40
second_homing_speed: 10
homing_positive_dir: true
[stepper_z]
step_pin: gpio6
dir_pin: gpio7
enable_pin: !gpio8
rotation_distance: 8
microsteps: 16
endstop_pin: ^gpio22
position_endstop: 0.5
position_max: 100
homing_speed: 8
second_homing_speed: 2
homing_retract_dist: 2
[extruder]
step_pin: gpio9
dir_pin: gpio10
enable_pin: !gpio11
rotation_distance: 22.67
microsteps: 16
nozzle_diameter: 0.4
filament_diameter: 1.75
heater_pin: gpio16
sensor_type: EPCOS 100K B57560G104F
sensor_pin: gpio26
control: pid
pid_kp: 22.2
pid_ki: 1.08
pid_kd: 114
min_temp: 0
max_temp: 260
min_extrude_temp: 60
max_extrude_cross_section: 10
[heater_bed]
heater_pin: gpio17
sensor_type: EPCOS 100K B57560G104F
sensor_pin: gpio27
control: watermark
min_temp: 0
max_temp: 120
[fan]
pin: gpio18
[idle_timeout]
timeout: 30
";

/// Reads a machine file for a board: pins are named as on the RP2040 and put on others in the same order.
pub(crate) fn config(text: &str, board: &BoardProfile) -> PrinterConfig {
    let mut text = text.to_owned();
    if board.name != "rp2040" {
        for pin in (0..30).rev() {
            let name = match pin {
                0..16 => format!("PB{pin}"),
                16..26 => format!("PD{}", pin - 16),
                _ => format!("PA{}", pin - 26),
            };
            text = text.replace(&format!("gpio{pin}"), &name);
        }
    }
    let (config, remarks) = config::parse(&text);
    config.unwrap_or_else(|| panic!("{remarks:#?}"))
}

/// What is wired to the board's pins.
pub(crate) fn parts(config: &PrinterConfig) -> Machine {
    let mut machine = Machine { gantry: gantry(config), ..Machine::default() };
    let starts: [f64; 3] = core::array::from_fn(|axis| start(axis, &config.steppers[axis]));
    let belts = machine.gantry.motors(starts);
    for (axis, stepper) in config.steppers.iter().enumerate() {
        let mut own = axis_motor(axis, stepper);
        if machine.gantry.is_coupled() {
            (own.start, own.frame) = (Mm(belts[axis]), None);
        }
        machine.motors.push(own);
        machine.endstops.push(Endstop {
            name: MOTOR_NAMES[axis].to_owned(),
            wire: wire(&stepper.endstop_pin),
            motor: axis,
            side: if stepper.homing_positive_dir { Side::Max } else { Side::Min },
            position: stepper.position_endstop,
        });
    }
    machine.fans.extend(config.fan.iter().map(|fan| Fan { name: "fan".into(), wire: wire(&fan.pin) }));
    if let Some(extruder) = &config.extruder {
        machine.motors.push(motor(EXTRUDER, &extruder.motor, Mechanics::extruder(16), 0.0, None));
        machine.heaters.push(Heater {
            fan: config.fan.as_ref().map(|_| 0),
            filament: Some(Filament { motor: EXTRUDER, diameter: extruder.filament_diameter }),
            ..heater(&extruder.heater, Plant::hot_end())
        });
    }
    machine.heaters.extend(config.heater_bed.iter().map(|bed| heater(bed, Plant::bed())));
    machine
}

/// How the machine is built: by belts, or with a motor for each axis.
pub(crate) fn gantry(config: &PrinterConfig) -> Gantry {
    match config.printer.kinematics {
        Kinematics::Cartesian => Gantry::Cartesian,
        Kinematics::CoreXy => Gantry::CoreXy,
        Kinematics::CoreXz => Gantry::CoreXz,
        Kinematics::HybridCoreXy => Gantry::HybridCoreXy,
        Kinematics::HybridCoreXz => Gantry::HybridCoreXz,
        Kinematics::Delta(_) => panic!("these benches have no towers"),
    }
}

/// Where an axis stands at power-up: not far from its endstop, so that homing is quick.
fn start(axis: usize, stepper: &StepperConfig) -> f64 {
    let endstop = stepper.position_endstop.0;
    let away = if axis == 2 { 6.0 } else { 15.0 };
    if stepper.homing_positive_dir { endstop - away } else { endstop + away }
}

fn axis_motor(axis: usize, stepper: &StepperConfig) -> Motor {
    let mm_per_rotation = stepper.motor.rotation_distance.0;
    let mechanics = Mechanics::nema17(stepper.motor.microsteps, mm_per_rotation, 0.4);
    let endstop = stepper.position_endstop.0;
    let start = start(axis, stepper);
    let frame = (stepper.position_min.0.min(endstop) - 3.0, stepper.position_max.0.max(endstop) + 3.0);
    motor(axis, &stepper.motor, mechanics, start, Some(frame))
}

fn motor(
    index: usize,
    config: &MotorConfig,
    mechanics: Mechanics,
    start: f64,
    frame: Option<(f64, f64)>,
) -> Motor {
    Motor {
        name: MOTOR_NAMES[index].to_owned(),
        step: wire(&config.step_pin),
        dir: wire(&config.dir_pin),
        enable: config.enable_pin.as_ref().map(wire),
        mechanics,
        step_distance: config.step_distance(),
        start: Mm(start),
        frame: frame.map(|(low, high)| (Mm(low), Mm(high))),
        sag: Mm(0.0),
    }
}

fn heater(config: &HeaterConfig, plant: Plant) -> Heater {
    let divider = &config.thermistor;
    let points = [25.0, 150.0, 250.0].map(|celsius| {
        (Celsius(celsius), Ohms(divider.curve.resistance(Celsius(celsius)).0 + divider.inline.0))
    });
    let thermistor = Thermistor::steinhart_hart(points).unwrap();
    Heater {
        name: config.name.clone(),
        wire: wire(&config.heater_pin),
        sensor_pin: config.sensor_pin.name.clone(),
        sensor: Sensor { thermistor, pull_up: divider.pullup, ..Sensor::default() },
        plant,
        fan: None,
        filament: None,
    }
}

fn wire(pin: &PinSpec) -> Wire {
    Wire::new(pin.name.clone(), pin.inverted)
}
