//! Prints whose host is held up.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use serde_json::Value;

const MACHINE: &str = include_str!("../../../samples/printer.cfg");

/// Heat, a long way, and the fan on and off.
const PRINT: &str = "M104 S200\nG28\nM109 S200\nG90\nM82\nG92 E0\nG1 Z0.3 F600\nG1 X20 Y20 F9000\n\
    G1 X150 E5 F1800\nM106 S200\nG1 Y150 E10\nG1 X20 E15\nM107\nG1 X150 Y20 E22\nG1 E21 F2400\n\
    G1 X10 Y10 F12000\nM104 S0\nM84\n";

fn scratch(name: &str, content: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::write(&path, content).expect("a scratch file");
    path
}

fn simulate(name: &str, more: &[&str]) -> Value {
    simulate_file(name, PRINT, more)
}

fn simulate_file(name: &str, print: &str, more: &[&str]) -> Value {
    let file = scratch(&format!("{name}.gcode"), print);
    let machine = scratch(&format!("{name}.cfg"), MACHINE);
    let output = Command::new(env!("CARGO_BIN_EXE_stepcast"))
        .arg("simulate")
        .args([&file, Path::new("--config"), &machine, Path::new("--json")])
        .args(more)
        .output()
        .expect("the command runs");
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    serde_json::from_slice(&output.stdout).unwrap_or_else(|problem| panic!("{problem}: {error}"))
}

/// When the board has been at its long way for a while: heating takes nearly all of the time before.
fn on_the_way(clean: &Value) -> f64 {
    let seconds = |key: &str| clean[key].as_f64().expect("a number");
    // The machine is watched for six seconds after the end.
    seconds("virtual_time_s") - 6.0 - seconds("print_time_s") + 2.0
}

#[test]
fn a_print_whose_host_is_held_up_is_the_same_print() {
    let clean = simulate("holds-clean", &[]);
    assert_eq!((&clean["result"], &clean["holds"]), (&Value::from("done"), &Value::from(0)), "{clean:#}");
    let at = on_the_way(&clean);
    let short = [0.5, 1.2, 1.7].map(|lasts| format!("--fault=host-stall={lasts}@{}", at + 3.0 * lasts));
    let short = simulate("holds-short", &short.each_ref().map(String::as_str));
    assert_eq!((&short["holds"], &short["pulse_digest"]), (&Value::from(0), &clean["pulse_digest"]));
    for lasts in [2.5, 4.0] {
        let faults = [at, at + 10.0].map(|at| format!("--fault=host-stall={lasts}@{at}"));
        let held = simulate(&format!("holds-{lasts}"), &[&faults[0], &faults[1], "--confirm-holds"]);
        assert_eq!(held["result"], "done", "{held:#}");
        assert_eq!((&held["holds"], &held["step_digest"]), (&Value::from(2), &clean["step_digest"]));
        assert!(held["path_error_max_mm"].as_f64().expect("a distance") <= 0.02);
        let lost = held["motors"].as_object().expect("motors").values().map(|motor| &motor["lost_steps"]);
        assert!(lost.into_iter().all(|lost| lost == 0));
    }
}

#[test]
fn a_host_that_is_away_for_long_resumes_hot() {
    let clean = simulate("holds-clean-long", &[]);
    let at = on_the_way(&clean);
    for lasts in [30.0, 2400.0] {
        let fault = format!("--fault=host-stall={lasts}@{at}");
        let held = simulate(&format!("holds-long-{lasts}"), &[&fault, "--confirm-holds"]);
        assert_eq!(held["result"], "done", "{held:#}");
        assert_eq!((&held["holds"], &held["step_digest"]), (&Value::from(1), &clean["step_digest"]));
        assert!(held["motors"].as_object().expect("motors").values().all(|motor| motor["lost_steps"] == 0));
        // Whatever was extruded was extruded as hot as it has to be.
        assert!(held["temperature_error_max_c"].as_f64().is_none_or(|error| error <= 3.0), "{held:#}");
    }
}

#[test]
fn nothing_goes_on_without_a_word() {
    let clean = simulate("holds-clean-too", &[]);
    let fault = format!("--fault=host-stall=3@{}", on_the_way(&clean));
    let held = simulate("holds-unconfirmed", &[&fault]);
    assert_eq!((&held["error"]["code"], &held["holds"]), (&Value::from("held-host-away"), &Value::from(1)));
}

#[test]
fn a_paused_print_is_the_same_print() {
    // Homing at its end is not taken for a move that was told before the pause.
    let print = PRINT.replace("M104 S0\n", "G28 X\nM104 S0\n");
    let clean = simulate_file("pauses-clean", &print, &[]);
    assert_eq!((&clean["result"], &clean["pauses"]), (&Value::from("done"), &Value::from(0)), "{clean:#}");
    let at = on_the_way(&clean) - 8.0;
    let faults = [at, at + 15.0].map(|at| format!("--fault=pause=2@{at}"));
    let paused = simulate_file("pauses", &print, &faults.each_ref().map(String::as_str));
    assert_eq!((&paused["result"], &paused["pauses"]), (&Value::from("done"), &Value::from(2)), "{paused:#}");
    assert_eq!((&paused["holds"], &paused["step_digest"]), (&Value::from(0), &clean["step_digest"]));
    assert_eq!(paused["motors"]["stepper_z"]["counted_steps"], clean["motors"]["stepper_z"]["counted_steps"]);
}
