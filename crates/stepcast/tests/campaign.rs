//! A short campaign: every scenario keeps its promise, and the same seed gives the same campaign.

use std::process::Command;

use serde_json::Value;

const SCENARIOS: [&str; 15] = [
    "corrupt",
    "flip",
    "drop",
    "duplicate",
    "delay",
    "stall",
    "host_death",
    "take_up",
    "torn_journal",
    "board_reset",
    "sensor_fault",
    "plain_host_death",
    "plain_stall",
    "pause",
    "power_loss",
];

fn campaign(arguments: &[&str]) -> (Option<i32>, Value) {
    let output = Command::new(env!("CARGO_BIN_EXE_stepcast"))
        .args(["campaign", "--json"])
        .args(arguments)
        .output()
        .expect("the command runs");
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    let value = serde_json::from_slice(&output.stdout).unwrap_or_else(|problem| panic!("{problem}: {error}"));
    (output.status.code(), value)
}

#[test]
fn every_promise_is_kept_whatever_happens() {
    let (status, classes) = campaign(&["--runs", "2", "--seed", "7", "--jobs", "2"]);
    let classes = classes.as_array().expect("a list");
    assert_eq!(status, Some(0), "{classes:#?}");
    assert_eq!(classes.iter().map(|class| &class["scenario"]).collect::<Vec<_>>(), SCENARIOS);
    for class in classes {
        assert_eq!((&class["runs"], &class["broken"]), (&2.into(), &0.into()), "{class:#}");
        assert_eq!((&class["wrong_resumes"], &class["restarts_without_consent"]), (&0.into(), &0.into()));
        let stops_hard = ["board_reset", "sensor_fault", "plain_host_death", "plain_stall"];
        if !stops_hard.iter().any(|name| class["scenario"] == *name) {
            assert_eq!(class["lost_steps"], 0);
            let error_max = if class["scenario"] == "power_loss" { 0.05 } else { 0.02 };
            let error = class["path_error_max_mm"].as_f64();
            assert!(error.is_some_and(|error| error > 0.0 && error <= error_max), "{class:#}");
        }
    }
    let power = &classes[14];
    assert!(power["z_error_max_mm"].as_f64().is_some_and(|error| error <= 0.05), "{power:#}");
    let death = &classes[6];
    assert!(death["time_to_rest_max_s"].as_f64().is_some_and(|rest| rest <= 0.36), "{death:#}");
    assert_eq!(classes[7]["holds"], 2, "each is taken up");
    assert!(death["time_to_safe_heaters_max_s"].as_f64().is_some_and(|safe| safe <= 7.0), "{death:#}");
}

#[test]
fn a_seed_is_a_campaign() {
    let arguments = ["--runs", "2", "--seed", "20", "--scenario", "stall,corrupt"];
    let first = campaign(&arguments);
    assert_eq!(first, campaign(&[&arguments[..], &["--jobs", "3"]].concat()));
    let names: Vec<&Value> =
        first.1.as_array().expect("a list").iter().map(|class| &class["scenario"]).collect();
    assert_eq!(names, ["corrupt", "stall"]);
}

#[test]
fn what_cannot_be_run_is_said() {
    let scratch = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("campaign-empty.gcode");
    std::fs::write(&scratch, "G28\nM84\n").expect("a scratch file");
    let (status, error) = campaign(&["--runs", "1", "--file", scratch.to_str().expect("a path in UTF-8")]);
    assert_eq!(status, Some(1));
    assert!(error["reason"].as_str().is_some_and(|reason| reason.contains("nothing is printed")), "{error}");
    for arguments in [["--runs", "0"], ["--scenario", "meteor"], ["--jobs", "0"]] {
        let output = Command::new(env!("CARGO_BIN_EXE_stepcast")).arg("campaign").args(arguments).output();
        assert_eq!(output.expect("the command runs").status.code(), Some(2), "{arguments:?}");
    }
}
