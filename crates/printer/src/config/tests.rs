//! What a printer.cfg means, and what every mistake in one is told.

use proptest::prelude::*;
use units::{Celsius, Mm, MmPerS, MmPerS2, Seconds};

use super::*;

/// A small cartesian machine with everything that is supported.
const MACHINE: &str = "\
[mcu]
serial: /dev/serial/by-id/usb-board

[printer]
kinematics: cartesian
max_velocity: 300
max_accel: 3000
max_z_velocity: 15
max_z_accel: 200

[stepper_x]
step_pin: gpio2
dir_pin: gpio3
enable_pin: !gpio4
rotation_distance: 40
microsteps: 16
endstop_pin: ^gpio5
position_endstop: 0
position_max: 300
homing_speed: 50

[stepper_y]
step_pin: gpio6
dir_pin: !gpio7
enable_pin: !gpio8
rotation_distance: 40
microsteps: 16
endstop_pin: ^!gpio9
position_endstop: 300
position_max: 300

[stepper_z]
step_pin: gpio10
dir_pin: gpio11
enable_pin: !gpio12
rotation_distance: 8
microsteps: 16
endstop_pin: ~gpio13
position_endstop: 0.5
position_min: -2
position_max: 250

[extruder]
step_pin: gpio14
dir_pin: gpio15
enable_pin: !gpio16
rotation_distance: 22.6789511
microsteps: 16
gear_ratio: 50:17, 2:1
nozzle_diameter: 0.4
filament_diameter: 1.75
heater_pin: gpio17
sensor_type: EPCOS 100K B57560G104F
sensor_pin: gpio26
control: pid
pid_Kp: 22.2
pid_Ki: 1.08
pid_Kd: 114
min_temp: 0
max_temp: 260

[heater_bed]
heater_pin: gpio18
sensor_type: Generic 3950
sensor_pin: gpio27
control: watermark
min_temp: 0
max_temp: 130

[fan]
pin: gpio19
";

fn machine() -> PrinterConfig {
    let (config, diagnostics) = parse(MACHINE);
    assert!(diagnostics.is_empty(), "{diagnostics:#?}");
    config.unwrap()
}

#[test]
fn a_whole_machine_is_read_with_klippers_defaults() {
    let config = machine();
    assert_eq!(config.printer.max_velocity, MmPerS(300.0));
    assert_eq!(config.printer.square_corner_velocity, MmPerS(5.0));
    assert_eq!(config.printer.minimum_cruise_ratio, 0.5);
    assert_eq!(config.mcu.baud, 250_000);
    assert_eq!(config.idle_timeout.timeout, Seconds(600.0));
    let [x, y, z] = &config.steppers;
    assert_eq!(x.step_distance(), Mm(0.0125));
    assert_eq!((x.homing_speed, x.second_homing_speed), (MmPerS(50.0), MmPerS(25.0)));
    assert_eq!((y.homing_speed, y.homing_retract_speed), (MmPerS(5.0), MmPerS(5.0)));
    assert_eq!(y.homing_retract_dist, Mm(5.0));
    assert!(!x.homing_positive_dir && y.homing_positive_dir && !z.homing_positive_dir);
    assert!(y.motor.dir_pin.inverted && y.endstop_pin.inverted);
    assert_eq!((y.endstop_pin.pull, z.endstop_pin.pull), (Pull::Up, Pull::Down));
    assert_eq!(z.position_min, Mm(-2.0));
    assert_eq!(x.motor.step_pulse_duration, Seconds(2e-6));
    let bed = config.heater_bed.as_ref().unwrap();
    assert_eq!(bed.control, ControlConfig::Watermark { max_delta: Celsius(2.0) });
    assert_eq!(bed.verify.check_gain_time, Seconds(60.0));
    assert_eq!(config.fan.as_ref().unwrap().cycle_time, Seconds(0.010));
    assert!(!config.force_move);
    assert_eq!(
        config.heaters().map(|heater| heater.name.as_str()).collect::<Vec<_>>(),
        ["extruder", "heater_bed"]
    );
}

#[test]
fn the_extruders_limits_follow_from_nozzle_and_filament() {
    let extruder = machine().extruder.unwrap();
    let ratio = 4.0 * 0.16 / (core::f64::consts::PI * 1.75 * 1.75 / 4.0);
    assert!((extruder.max_extrude_only_velocity.0 - 300.0 * ratio).abs() < 1e-9);
    assert!((extruder.max_extrude_only_accel.0 - 3000.0 * ratio).abs() < 1e-9);
    assert!((extruder.max_extrude_cross_section - 0.64).abs() < 1e-12);
    assert_eq!(extruder.max_extrude_only_distance, Mm(50.0));
    assert_eq!(extruder.heater.min_extrude_temp, Celsius(170.0));
    assert_eq!(extruder.heater.verify.check_gain_time, Seconds(20.0));
    let expected = 22.678_951_1 / (200.0 * 16.0 * (50.0 / 17.0) * 2.0);
    assert!((extruder.motor.step_distance().0 - expected).abs() < 1e-15);
}

/// The machine with one line replaced, or, where `old` is empty, with text put after it.
fn with(old: &str, new: &str) -> String {
    if old.is_empty() {
        return format!("{MACHINE}{new}");
    }
    assert_eq!(MACHINE.matches(old).count(), 1, "`{old}` must name one place");
    MACHINE.replace(old, new)
}

fn line_of(text: &str, what: &str) -> u32 {
    1 + text.lines().position(|line| line.contains(what)).unwrap_or_else(|| panic!("`{what}`")) as u32
}

/// Asserts that a change gives one diagnostic, on the line that holds `at` (none: the whole file), saying `words`.
fn assert_diagnosed(text: &str, severity: Severity, at: &str, words: &str) {
    let (config, diagnostics) = parse(text);
    let line = if at.is_empty() { 0 } else { line_of(text, at) };
    assert_eq!(config.is_some(), severity != Severity::Error, "{diagnostics:#?}");
    let [diagnostic] = diagnostics.as_slice() else { panic!("not one for `{words}`: {diagnostics:#?}") };
    assert_eq!((diagnostic.severity, diagnostic.line), (severity, line), "{diagnostic}");
    assert!(diagnostic.message.contains(words), "{diagnostic} lacks `{words}`");
}
