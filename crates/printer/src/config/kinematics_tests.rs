//! Machines of every kinematics as their files have them.

use super::tests::{assert_diagnosed, with};
use super::*;

/// The delta with one thing changed.
fn delta_with(old: &str, new: &str) -> String {
    assert!(SMALL_DELTA.contains(old), "{old}");
    SMALL_DELTA.replacen(old, new, 1)
}

#[test]
fn machines_of_belts_move_as_klippers_documentation_says() {
    for (name, kinematics, x, y, z) in [
        ("corexy", Kinematics::CoreXy, [1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 0.0, 1.0]),
        ("corexz", Kinematics::CoreXz, [1.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, -1.0]),
        ("hybrid_corexy", Kinematics::HybridCoreXy, [1.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 1.0]),
        ("hybrid_corexz", Kinematics::HybridCoreXz, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 1.0]),
    ] {
        let text = with("kinematics: cartesian", &format!("kinematics: {name}"));
        let (config, diagnostics) = parse(&text);
        assert!(diagnostics.is_empty(), "{diagnostics:#?}");
        let config = config.unwrap();
        assert_eq!(config.printer.kinematics, kinematics);
        let geometry = config.printer.kinematics.geometry();
        // What all motors do where one axis moves.
        for (axis, motors) in [x, y, z].into_iter().enumerate() {
            let mut at = [0.0; 4];
            at[axis] = 1.0;
            assert_eq!(geometry.motor_positions(&at)[..3], motors, "{name} {axis}");
        }
        assert_eq!(geometry.motor_positions(&[0.0, 0.0, 0.0, 2.0]), [0.0, 0.0, 0.0, 2.0]);
    }
}

#[test]
fn a_delta_is_what_its_towers_make_it() {
    let (config, diagnostics) = parse(SMALL_DELTA);
    assert!(diagnostics.is_empty(), "{diagnostics:#?}");
    let config = config.unwrap();
    let Kinematics::Delta(delta) = config.printer.kinematics else { panic!("{config:?}") };
    assert_eq!(delta.towers.map(|tower| tower.angle), [210.0, 330.0, 90.0]);
    assert_eq!(delta.towers.map(|tower| tower.arm_length.0), [270.0; 3]);
    assert_eq!(delta.print_radius.0, 110.0);
    let home = config.steppers.each_ref().map(|axis| axis.position_endstop.0);
    assert!(home.iter().zip([0.0, 0.0, 300.0]).all(|(at, wanted)| (at - wanted).abs() < 1e-9), "{home:?}");
    assert_eq!(config.steppers[2].name, "stepper_c");
    assert_eq!(config.steppers[1].homing_speed.0, 40.0, "as in [stepper_a]");
    // B and C may say otherwise; the head then hangs beside the middle when it is home.
    let uneven =
        delta_with("endstop_pin: ^gpio9", "endstop_pin: ^gpio9\nposition_endstop: 300.5\narm_length: 270.2");
    let home = parse(&uneven).0.unwrap().steppers.map(|axis| axis.position_endstop.0);
    assert!(home[0].abs() > 0.01 && home[2] > 300.0 && home[2] < 300.5, "{home:?}");
}

#[test]
fn what_makes_no_delta_is_said_on_its_line() {
    use Severity::{Error, Info, Warning};
    for (old, new, severity, at, words) in [
        ("delta_radius: 134\n", "", Error, "[printer]", "delta_radius: it is missing"),
        ("delta_radius: 134", "delta_radius: 400", Error, "radius: 400", "cannot hold a head"),
        ("delta_radius: 134", "delta_radius: 265", Error, "radius: 265", "the arms are too short"),
        (
            "print_radius: 110",
            "print_radius: 130",
            Warning,
            "radius: 130",
            "only 122.1 of 130 mm can be used",
        ),
        ("arm_length: 270\n", "", Error, "[stepper_a]", "arm_length: it is missing"),
        ("position_endstop: 300", "position_endstop: -3", Error, "endstop: -3", "must be above 0"),
        (
            "endstop_pin: ^gpio9",
            "endstop_pin: ^gpio9\nposition_endstop: 250",
            Error,
            "endstop: 300",
            "nozzle would be",
        ),
        (
            "endstop_pin: ^gpio9",
            "endstop_pin: ^gpio9\nangle: 210",
            Error,
            "radius: 134",
            "towers stand apart",
        ),
        (
            "endstop_pin: ^gpio9",
            "endstop_pin: ^gpio9\nhoming_speed: 9",
            Info,
            "speed: 9",
            "all towers home together",
        ),
        (
            "[extruder]",
            "[motor_torque stepper_b]\npull_out_torque: 0: 1, 900: 0.4\ninertia: 50\n[extruder]",
            Error,
            "pull_out",
            "more than one axis",
        ),
        (
            "kinematics: delta",
            "kinematics: rotary_delta",
            Error,
            "rotary_delta",
            "is not supported: there are",
        ),
    ] {
        assert_diagnosed(&delta_with(old, new), severity, at, words);
    }
    let torque = "[motor_torque stepper_x]\npull_out_torque: 0: 1, 900: 0.4\ninertia: 50\n[fan]";
    let text = with("kinematics: cartesian", "kinematics: corexy").replace("[fan]", torque);
    assert_diagnosed(&text, Error, "pull_out", "more than one axis");
    // A motor that moves its own axis alone may have it.
    let text =
        with("kinematics: cartesian", "kinematics: corexy").replace("[fan]", &torque.replace("_x]", "_z]"));
    assert!(parse(&text).0.is_some_and(|config| config.abilities[2].is_some()));
}
