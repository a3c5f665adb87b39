//! A sliced file's print time against the least time of the same moves, which shares no code with the look-ahead.

use super::*;
use crate::config;

const TEST_PART: &str = include_str!("../../../../samples/test-part.gcode");
const MACHINE: &str = include_str!("../../../../samples/printer.cfg");
/// A small motor for one axis.
const TORQUE: &str = "pull_out_torque: 0: 0.4, 400: 0.38, 1000: 0.25, 2000: 0.12, 4000: 0.03\n\
    inertia: 250\nload_torque: 0.01\n";

/// Time of the plan over the least time.
fn ratio(machine: &str, feed_scale: f64) -> f64 {
    let (config, report) = config::parse(machine);
    let config = config.unwrap_or_else(|| panic!("{report:?}"));
    let options =
        PlanOptions { feed_scale, bound: true, minimum_cruise_ratio: Some(0.0), ..PlanOptions::default() };
    let mut stream = PlanStream::with_options(&config, options).unwrap();
    let mut blocks = Vec::new();
    for piece in TEST_PART.as_bytes().chunks(5000) {
        stream.feed(piece, &mut blocks, |_| {}).unwrap();
        blocks.clear();
    }
    let report = stream.finish(&mut blocks, |_| {}).unwrap();
    report.print_time.0 / report.bound.unwrap().0
}

#[test]
fn a_print_takes_no_longer_than_its_limits_ask() {
    let axes = "[printer]\nmax_x_accel: 2000\nmax_y_accel: 1500\nmax_x_velocity: 250\nmax_y_velocity: 120";
    for machine in [MACHINE.to_owned(), MACHINE.replacen("[printer]", axes, 1)] {
        for feed_scale in [1.0, 4.0] {
            let ratio = ratio(&machine, feed_scale);
            // The step generator's filters end a moment after the last move.
            assert!((1.0 - 1e-9..1.0005).contains(&ratio), "{ratio} at {feed_scale}");
        }
    }
}

#[test]
fn with_torque_a_print_takes_hardly_longer() {
    let machine =
        MACHINE.replacen("max_velocity: 300\nmax_accel: 3000", "max_velocity: 1000\nmax_accel: 50000", 1)
            + &format!("\n[motor_torque stepper_x]\n{TORQUE}\n[motor_torque stepper_y]\n{TORQUE}");
    for feed_scale in [1.0, 4.0] {
        let ratio = ratio(&machine, feed_scale);
        assert!((1.0 - 1e-3..1.005).contains(&ratio), "{ratio} at {feed_scale}");
    }
}
