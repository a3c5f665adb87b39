//! What a printer.cfg means, and what every mistake in one is told.

use proptest::prelude::*;
use units::{Celsius, Mm, MmPerS, Seconds};

use super::*;

fn machine() -> PrinterConfig {
    let (config, diagnostics) = parse(SMALL_MACHINE);
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

/// The machine with the first `old` replaced, or, where `old` is empty, with text put after it.
pub(super) fn with(old: &str, new: &str) -> String {
    assert!(SMALL_MACHINE.contains(old), "`{old}` is not there");
    if old.is_empty() {
        return format!("{SMALL_MACHINE}{new}");
    }
    SMALL_MACHINE.replacen(old, new, 1)
}

fn line_of(text: &str, what: &str) -> u32 {
    1 + text.lines().position(|line| line.contains(what)).unwrap_or_else(|| panic!("`{what}`")) as u32
}

/// Asserts that a change gives one diagnostic, on the line that holds `at` (none: the whole file), saying `words`.
pub(super) fn assert_diagnosed(text: &str, severity: Severity, at: &str, words: &str) {
    let (config, diagnostics) = parse(text);
    let line = if at.is_empty() { 0 } else { line_of(text, at) };
    assert_eq!(config.is_some(), severity != Severity::Error, "{diagnostics:#?}");
    let [diagnostic] = diagnostics.as_slice() else { panic!("not one for `{words}`: {diagnostics:#?}") };
    assert_eq!((diagnostic.severity, diagnostic.line), (severity, line), "{diagnostic}");
    assert!(diagnostic.message.contains(words), "{diagnostic} lacks `{words}`");
}

#[test]
fn every_wrong_value_is_an_error_on_its_line() {
    use Severity::Error;
    for (old, new, at, words) in [
        ("max_velocity: 300", "max_velocity: fast", "fast", "is not a number; write the machine's top speed"),
        ("max_velocity: 300", "max_velocity: 0", "max_velocity: 0", "must be above 0"),
        ("max_velocity: 300", "max_velocity: nan", "max_velocity: nan", "must be above 0"),
        ("max_velocity: 300", "max_velocity: 1e300", "1e300", "must be above 0 and at most 10000"),
        ("max_velocity: 300", "max_velocity:", "max_velocity:", "it has no value"),
        ("kinematics: cartesian", "kinematics: polar", "polar", "there are cartesian, corexy,"),
        ("step_pin: gpio2", "step_pin: ^gpio2", "^gpio2", "an output has no pull-up"),
        ("step_pin: gpio2", "step_pin: probe:x", "probe:x", "only pins of the main board"),
        ("rotation_distance: 40", "rotation_distance: 0", "rotation_distance: 0", "must be above 0"),
        (
            "rotation_distance: 40",
            "rotation_distance: 1e-9",
            "rotation_distance: 1e-9",
            "one microstep comes out as",
        ),
        ("microsteps: 16", "microsteps: 16.5", "16.5", "whole number from 1 to 256"),
        ("microsteps: 16", "full_steps_per_rotation: 201\nmicrosteps: 16", "201", "multiple of 4"),
        ("gear_ratio: 50:17, 2:1", "gear_ratio: 50/17", "50/17", "not a pair of teeth"),
        ("gear_ratio: 50:17, 2:1", "gear_ratio: 0:1", "gear_ratio", "not a pair of teeth"),
        ("gear_ratio: 50:17, 2:1", "gear_ratio: 2:1,", "gear_ratio", "not a pair of teeth"),
        ("position_max: 300", "position_max: 0", "position_max: 0", "must be above position_min"),
        ("position_endstop: 0\n", "position_endstop: -5\n", "position_endstop: -5", "must lie within"),
        ("position_endstop: 0\n", "position_endstop: 150\n", "[stepper_x]", "direction of homing is unclear"),
        (
            "position_endstop: 0\n",
            "position_endstop: 0\nhoming_positive_dir: yes\n",
            "dir: yes",
            "away from the endstop",
        ),
        (
            "position_endstop: 0\n",
            "position_endstop: 0\nhoming_positive_dir: maybe\n",
            "maybe",
            "must be true or false",
        ),
        ("homing_speed: 50", "homing_speed: -1", "homing_speed: -1", "must be above 0"),
        ("sensor_type: Generic 3950", "sensor_type: MAX6675", "MAX6675", "write one of: EPCOS"),
        ("sensor_pin: gpio26", "sensor_pin: ^gpio26", "^gpio26", "a sensor's pin takes no"),
        ("control: pid", "control: magic", "magic", "write `pid` or `watermark`"),
        ("max_temp: 260", "max_temp: -5", "max_temp: -5", "must be above 0"),
        ("max_temp: 260", "max_temp: 160", "[extruder]", "min_extrude_temp: 170 must lie within"),
        ("min_temp: 0\nmax_temp: 130", "min_temp: 140\nmax_temp: 130", "max_temp: 130", "above min_temp"),
        (
            "nozzle_diameter: 0.4",
            "nozzle_diameter: 4",
            "filament_diameter",
            "must not be below nozzle_diameter",
        ),
        ("", "max_power: 2\n", "max_power: 2", "above 0 and at most 1"),
        ("", "hardware_pwm: perhaps\n", "perhaps", "must be true or false"),
        ("", "[verify_heater extruder]\ncheck_gain_time: 0\n", "check_gain_time", "from 1 to 600"),
        ("", "[verify_heater heater_bed]\nmax_error: x\n", "max_error", "is not a number"),
        ("", "[idle_timeout]\ntimeout: 0\n", "timeout: 0", "must be above 0"),
        ("", "[force_move]\nenable_force_move: 2\n", "enable_force_move", "must be true or false"),
        ("", "[firmware_retraction]\nretract_speed: 0\n", "retract_speed", "from 1 to"),
        ("", "[tmc2209 stepper_x]\n", "[tmc2209", "microsteps and current"),
        ("", "[stepper_z1]\n", "[stepper_z1]", "further motors"),
        ("", "[dual_carriage]\n", "[dual_carriage]", "second carriage"),
        (
            "",
            "[thermistor a b]\ntemperature1: 25\nresistance1: 1000\nbeta: 0\n",
            "beta: 0",
            "must be above 0",
        ),
    ] {
        assert_diagnosed(&with(old, new), Error, at, words);
    }
}

#[test]
fn every_missing_option_is_an_error_on_its_sections_line() {
    for (line, section) in [
        ("kinematics: cartesian\n", "[printer]"),
        ("max_velocity: 300\n", "[printer]"),
        ("max_accel: 3000\n", "[printer]"),
        ("step_pin: gpio2\n", "[stepper_x]"),
        ("dir_pin: gpio3\n", "[stepper_x]"),
        ("rotation_distance: 40\n", "[stepper_x]"),
        ("microsteps: 16\n", "[stepper_x]"),
        ("endstop_pin: ^gpio5\n", "[stepper_x]"),
        ("position_endstop: 0\n", "[stepper_x]"),
        ("position_max: 300\n", "[stepper_x]"),
        ("nozzle_diameter: 0.4\n", "[extruder]"),
        ("filament_diameter: 1.75\n", "[extruder]"),
        ("heater_pin: gpio17\n", "[extruder]"),
        ("sensor_type: EPCOS 100K B57560G104F\n", "[extruder]"),
        ("sensor_pin: gpio26\n", "[extruder]"),
        ("control: pid\n", "[extruder]"),
        ("pid_Kp: 22.2\n", "[extruder]"),
        ("pid_Ki: 1.08\n", "[extruder]"),
        ("pid_Kd: 114\n", "[extruder]"),
        ("min_temp: 0\n", "[extruder]"),
        ("max_temp: 260\n", "[extruder]"),
        ("control: watermark\n", "[heater_bed]"),
        ("pin: gpio19\n", "[fan]"),
    ] {
        let text = if section == "[fan]" { with("[fan]\npin: gpio19\n", "[fan]\n") } else { with(line, "") };
        assert_diagnosed(&text, Severity::Error, section, "it is missing; write ");
    }
}

#[test]
fn every_missing_section_that_is_needed_is_an_error() {
    for section in ["mcu", "printer", "stepper_x", "stepper_y", "stepper_z"] {
        let header = format!("[{section}]");
        let start = SMALL_MACHINE.find(&header).unwrap();
        let end = start + SMALL_MACHINE[start..].find("\n\n").unwrap();
        let text = format!("{}{}", &SMALL_MACHINE[..start], &SMALL_MACHINE[end..]);
        let words = format!("{header} is missing");
        assert_diagnosed(&text, Severity::Error, "", &words);
    }
    // A machine without heaters, fan and extruder is a machine.
    let start = SMALL_MACHINE.find("[extruder]").unwrap();
    let (config, diagnostics) = parse(&SMALL_MACHINE[..start]);
    assert!(diagnostics.is_empty(), "{diagnostics:#?}");
    let config = config.unwrap();
    assert!(config.extruder.is_none() && config.heater_bed.is_none() && config.fan.is_none());
    assert_eq!(config.heaters().count(), 0);
}

#[test]
fn what_is_missed_is_a_warning_on_its_line() {
    for (old, new, at, words) in [
        (
            "microsteps: 16",
            "microstepping: 8\nmicrosteps: 16",
            "microstepping",
            "has no option `microstepping`",
        ),
        ("homing_speed: 50", "homing_sped: 50", "homing_sped", "did you mean `homing_speed`?"),
        ("homing_speed: 50", "homing_speed:", "homing_speed:", "the default counts"),
        (
            "max_accel: 3000",
            "max_accel: 3000\nmax_accel_to_decel: 750",
            "to_decel",
            "minimum_cruise_ratio: 0.750",
        ),
        ("", "[include mainsail.cfg]\n", "[include", "copy that file's text in here"),
        ("", "[gcode_macro START_PRINT]\ngcode:\n  G28\n", "[gcode_macro", "macros are not run"),
        ("", "[heater_fan hotend]\npin: gpio20\n", "[heater_fan", "own fan will not run"),
        ("", "[bltouch]\n", "[bltouch]", "not probed"),
        ("", "[extruder1]\n", "[extruder1]", "only one extruder"),
        ("", "[mcu second]\n", "[mcu second]", "second board"),
        ("", "[verify_heater chamber]\n", "[verify_heater", "there is no heater [chamber]"),
        ("", "[fann]\n", "[fann]", "is not known"),
        ("", "[idle_timeout]\ngcode:\n  M84\n", "gcode:", "not supported yet"),
        ("", "enable_pin: gpio20\n", "enable_pin: gpio20", "driven by its `pin` alone"),
        (
            "",
            "[thermistor t]\ntemperature1: 25\nresistance1: 100000\nbeta: 3950\nresistance2: 5\n",
            "resistance2",
            "no effect beside beta",
        ),
    ] {
        assert_diagnosed(&with(old, new), Severity::Warning, at, words);
    }
}

#[test]
fn what_is_not_needed_is_a_note_on_its_line() {
    for (old, new, at, words) in [
        ("", "[virtual_sdcard]\npath: ~/gcodes\n", "[virtual_sdcard]", "not needed here"),
        ("", "tachometer_pin: gpio21\n", "tachometer_pin", "not measured yet"),
        ("control: watermark", "control: watermark\npid_Kp: 5", "pid_Kp: 5", "controlled by watermark"),
        ("[printer]", "restart_method: command\n[printer]", "restart_method", "whoever opens the port"),
    ] {
        assert_diagnosed(&with(old, new), Severity::Info, at, words);
    }
}

#[test]
fn options_reach_the_machine() {
    let text = with(
        "",
        "max_power: 0.5\noff_below: 0.1\n[verify_heater extruder]\nmax_error: 60\n[idle_timeout]\ntimeout: 60\n\
         [force_move]\nenable_force_move: true\n[firmware_retraction]\nretract_length: 0.8\n",
    );
    let config = parse(&text).0.unwrap();
    let fan = config.fan.as_ref().unwrap();
    assert_eq!([0.05, 0.5, 7.0, f64::NAN, -1.0].map(|speed| fan.duty(speed)), [0.0, 0.25, 0.5, 0.0, 0.0]);
    assert_eq!(config.extruder.unwrap().heater.verify.max_error_c_s, 60.0);
    assert_eq!(config.idle_timeout.timeout, Seconds(60.0));
    assert!(config.force_move);
    assert_eq!(config.firmware_retraction.unwrap().retract_length, Mm(0.8));
}

#[test]
fn a_sensor_of_ones_own_is_used_by_its_name() {
    let sensor = "[thermistor my bed]\ntemperature1: 25\nresistance1: 100000\nbeta: 3950\n";
    let text = format!("{}{sensor}", with("sensor_type: Generic 3950", "sensor_type: my bed"));
    let (config, diagnostics) = parse(&text);
    assert!(diagnostics.is_empty(), "{diagnostics:#?}");
    let bed = config.unwrap().heater_bed.unwrap();
    assert!((bed.thermistor.curve.resistance(Celsius(25.0)).0 - 100_000.0).abs() < 1e-6);
}

#[test]
fn drivers_may_share_an_enable_pin_but_nothing_else() {
    let (config, diagnostics) = parse(&with("enable_pin: !gpio8", "enable_pin: !gpio4"));
    assert!(config.is_some(), "{diagnostics:#?}");
    let text = with("enable_pin: !gpio8", "enable_pin: !gpio2");
    assert_diagnosed(&text, Severity::Error, "enable_pin: !gpio2", "already used by [stepper_x] step_pin");
}

#[test]
fn one_reading_shows_every_mistake() {
    let text = with("max_velocity: 300", "max_velocity: x")
        .replace("nozzle_diameter: 0.4", "")
        .replace("gpio19", "?");
    let (config, diagnostics) = parse(&text);
    assert!(config.is_none());
    let messages: Vec<String> = diagnostics.iter().map(ToString::to_string).collect();
    assert_eq!(messages.len(), 3, "{messages:#?}");
    assert!(diagnostics.windows(2).all(|pair| pair[0].line <= pair[1].line), "in the order of the file");
}

fn assert_sane(config: &PrinterConfig) {
    let motors =
        config.steppers.iter().map(|axis| &axis.motor).chain(config.extruder.iter().map(|e| &e.motor));
    for motor in motors {
        assert!(motor.step_distance().0.is_finite() && motor.step_distance() > Mm::ZERO);
    }
    for axis in &config.steppers {
        assert!(axis.position_min < axis.position_max);
        assert!(axis.position_endstop >= axis.position_min && axis.position_endstop <= axis.position_max);
    }
    for heater in config.heaters() {
        assert!(heater.min_temp < heater.max_temp);
        assert!(heater.max_power > 0.0 && heater.max_power <= 1.0);
    }
}

proptest! {
    #[test]
    fn no_text_panics_and_errors_decide(text in "\\PC*") {
        let (config, diagnostics) = parse(&text);
        let has_errors = diagnostics.iter().any(|diagnostic| diagnostic.severity == Severity::Error);
        prop_assert_eq!(config.is_none(), has_errors);
        prop_assert!(diagnostics.len() <= CONFIG_DIAGNOSTICS_MAX + 1);
    }

    #[test]
    fn no_shuffle_of_real_pieces_panics(
        pieces in prop::collection::vec(
            prop::sample::select(SMALL_MACHINE.split_inclusive(['\n', ' ', ':']).collect::<Vec<_>>()),
            0..200,
        ),
        noise in prop::collection::vec("[\\[\\]:=#;!^~ \n\t0-9.eE+*-]{0,6}", 0..20),
    ) {
        let mut text = String::new();
        for (index, piece) in pieces.iter().enumerate() {
            text.push_str(piece);
            if let Some(noise) = noise.get(index / 7) {
                text.push_str(noise);
            }
        }
        let lines = text.lines().count() as u32;
        let (_, diagnostics) = parse(&text);
        prop_assert!(diagnostics.iter().all(|diagnostic| diagnostic.line <= lines));
    }

    #[test]
    fn a_damaged_machine_is_sane_or_refused(at in 0..SMALL_MACHINE.len(), with in "\\PC{0,5}", cut in 0_usize..5) {
        let end = (at + cut).min(SMALL_MACHINE.len());
        let text = format!("{}{with}{}", &SMALL_MACHINE[..at], &SMALL_MACHINE[end..]);
        let (config, diagnostics) = parse(&text);
        let has_errors = diagnostics.iter().any(|diagnostic| diagnostic.severity == Severity::Error);
        prop_assert_eq!(config.is_none(), has_errors);
        if let Some(config) = config {
            assert_sane(&config);
        }
    }
}

const TORQUE: &str =
    "\n[motor_torque stepper_x]\npull_out_torque: 0: 2.2, 400: 2.1,\n  2000: 0.6\ninertia: 480\n";

#[test]
fn a_motor_s_torque_is_read_into_what_its_axis_can_do() {
    let (config, diagnostics) = parse(&with("", &format!("{TORQUE}load_torque: 0.1\nresonances: 20-40\n")));
    assert!(diagnostics.is_empty(), "{diagnostics:#?}");
    let abilities = config.unwrap().abilities;
    assert!(abilities[1..].iter().all(Option::is_none));
    let x = abilities[0].as_ref().unwrap();
    // 0.3·0.6 N·m are left at 2000 steps/s, which are 400 mm/s; nothing beyond is known.
    assert_eq!(x.top(), MmPerS(400.0));
    let accel = x.accel_at(MmPerS(0.0), motion::Demand::Speed).0;
    let exact = (0.3 * 2.2 - 0.1) / 480e-7 * 40.0 / core::f64::consts::TAU;
    assert!((0.97..=1.0).contains(&(accel / exact)), "{accel} {exact}");
}

#[test]
fn a_resolution_that_the_load_makes_unreal_is_told() {
    let (config, diagnostics) = parse(&with("", &format!("{TORQUE}load_torque: 0.3\n")));
    assert!(config.is_some());
    // A sixteenth has 9.80 % of 2.2 N·m; an eighth has 19.51 %.
    let text = &diagnostics[0].message;
    assert!(text.contains("9.80 %") && text.contains("1/8"), "{text}");
}

#[test]
fn a_torque_that_no_motor_has_is_told_with_its_line() {
    for (wrong, said) in [
        ("pull_out_torque: 0: 2.2, x", "not a pair"),
        ("pull_out_torque: 10: 2.2, 20: 1", "must start at 0"),
        ("pull_out_torque: 0: 2.2, 400: 2.1\nload_torque: 1", "leaves nothing"),
        ("pull_out_torque: 0: 2.2, 400: 2.1\nresonances: 40-20", "not a band"),
        ("pull_out_torque: 0: 2.2, 400: 2.1\ntorque_margin: 1.2", "at most 1"),
    ] {
        let text = with("", &format!("\n[motor_torque stepper_x]\n{wrong}\ninertia: 480\n"));
        let (config, diagnostics) = parse(&text);
        assert!(config.is_none(), "{wrong}");
        assert!(
            diagnostics.iter().any(|it| it.message.contains(said) && it.line > 0),
            "{wrong}: {diagnostics:#?}"
        );
    }
}

/// A mesh as `SAVE_CONFIG` leaves it behind the machine file.
const SAVED_MESH: &str = "
#*# <---------------------- SAVE_CONFIG ---------------------->
#*# DO NOT EDIT THIS BLOCK OR BELOW. The contents are auto-generated.
#*#
#*# [bed_mesh default]
#*# version = 1
#*# points =
#*# \t  0.110000, 0.042500, 0.012500, 0.120000
#*# \t  -0.035000, -0.035000, -0.067500, 0.060000
#*# \t  0.150000, 0.065000, 0.020000, 0.160000
#*# tension = 0.2
#*# min_x = 20.0
#*# algo = lagrange
#*# y_count = 3
#*# mesh_y_pps = 2
#*# min_y = 10.0
#*# x_count = 4
#*# max_y = 110.0
#*# mesh_x_pps = 2
#*# max_x = 200.0
#*#
#*# [skew_correction calm]
#*# xy_skew = 0.004
";

#[test]
fn meshes_and_skews_are_read_as_they_were_saved() {
    let options = "\n[skew_correction]\n[bed_mesh]\nspeed: 120\nmesh_min: 35, 6\nmesh_max: 240, 198\n\
        probe_count: 5, 3\nalgorithm: Bicubic\nsplit_delta_z: 2.0\nfaulty_region_1_min: 1, 2\nfade_end: 10\nfade_target: 0\n\
        zero_reference_position: 20, 10\n";
    let (config, diagnostics) = parse(&format!("{SMALL_MACHINE}{options}{SAVED_MESH}"));
    assert!(diagnostics.iter().all(|it| it.severity == Severity::Info), "{diagnostics:#?}");
    let profiles = config.unwrap().profiles;
    assert_eq!(profiles.skews["calm"], crate::transform::Skew { xy: 0.004, xz: 0.0, yz: 0.0 });
    let mesh = profiles.meshes["default"].mesh().unwrap();
    assert_eq!(mesh.z_error, crate::transform::Z_ERROR_MAX_MM);
    let at = |x, y| mesh.machine_from_gcode([x, y, 0.0])[2];
    // Less what it is where Z is to be 0.
    for (place, height) in
        [([20.0, 10.0], 0.11), ([200.0, 10.0], 0.12), ([20.0, 60.0], -0.035), ([200.0, 110.0], 0.16)]
    {
        assert!((at(place[0], place[1]) - (height - 0.11)).abs() < 1e-12, "{place:?}");
    }
    assert_eq!(mesh.machine_from_gcode([50.0, 50.0, 30.0]), [50.0, 50.0, 30.0]);
    assert!(machine().profiles.meshes.is_empty());
}

#[test]
fn a_mesh_that_is_wrong_is_told_what() {
    for (old, new, told) in [
        ("algo = lagrange", "algo = spline", "`spline` is not `lagrange` or `bicubic`"),
        ("x_count = 4", "x_count = 5", "a row has 4 points, x_count is 5"),
        ("y_count = 3", "y_count = 4", "3 rows, y_count is 4"),
        ("y_count = 3", "y_count = 2", "whole number from 3 to 100"),
        ("0.060000", "nan", "`nan` is no height"),
        ("0.060000", "1e300", "`1e300` is no height"),
        ("0.060000", "x", "`x` is no height"),
        ("max_x = 200.0", "max_x = 20.0", "1 mm apart"),
        ("max_x = 200.0", "max_x = -20.0", "1 mm apart"),
        ("min_y = 10.0", "", "[bed_mesh default] min_y: it is missing"),
        ("version = 1", "version = 2", "whole number from 1 to 1"),
        ("xy_skew = 0.004", "xy_skew = 0.4", "must be from -0.25 to 0.25"),
    ] {
        assert!(SAVED_MESH.contains(old), "{old}");
        let (config, diagnostics) = parse(&format!("{SMALL_MACHINE}{}", SAVED_MESH.replacen(old, new, 1)));
        assert_eq!(config, None, "{new}");
        assert!(diagnostics.iter().any(|it| it.message.contains(told)), "{told}: {diagnostics:#?}");
    }
    for option in
        ["mesh_min: 5", "probe_count: 2", "mesh_pps: 1,2,3", "algorithm: x", "zero_reference_position: a, b"]
    {
        let (config, _) = parse(&format!("{SMALL_MACHINE}\n[bed_mesh]\n{option}\n"));
        assert_eq!(config, None, "{option}");
    }
}

#[test]
fn a_mesh_that_cannot_be_used_is_left_out_and_told() {
    for (options, told) in [
        ("fade_end: 1.1", "fade_end less fade_start is 0.100 mm"),
        ("fade_end: 10\nfade_target: 5", "fade_target 5.000 mm is not between"),
    ] {
        let (config, diagnostics) = parse(&format!("{SMALL_MACHINE}\n[bed_mesh]\n{options}\n{SAVED_MESH}"));
        let profiles = config.unwrap_or_else(|| panic!("{diagnostics:#?}")).profiles;
        assert!(profiles.meshes.is_empty() && profiles.skews.contains_key("calm"), "{profiles:?}");
        let warned = |it: &ConfigDiagnostic| it.severity == Severity::Warning && it.message.contains(told);
        assert!(diagnostics.iter().any(warned), "{told}: {diagnostics:#?}");
    }
}
