//! The command as users and scripts see it: exit statuses, JSON, texts.

use std::{
    fs,
    path::PathBuf,
    process::{Command, Output},
};

use serde_json::Value;

const MACHINE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../samples/printer.cfg");

/// A small print: homing, heat, a square, a retraction, an arc.
const PRINT: &str = "M104 S200\nG28\nM109 S200\nG90\nM82\nG92 E0\nG1 Z0.3 F600\nG1 X50 Y50 F9000\n\
    G1 X60 Y50 E0.5 F1800\nG1 X60 Y60 E1.0\nG1 X50 Y60 E1.5\nG1 X50 Y50 E2.0\nG3 X60 Y60 I10 J0 E2.6\n\
    G1 E1.6 F2400\nG1 X10 Y10 F12000\nM104 S0\nM84\n";

struct File(PathBuf);

impl File {
    fn new(name: &str, content: impl AsRef<[u8]>) -> Self {
        let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
        fs::write(&path, content).expect("a scratch file");
        Self(path)
    }
}

fn stepcast(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_stepcast")).args(arguments).output().expect("the command runs")
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(&output.stderr)))
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn simulate(file: &File, more: &[&str]) -> (Output, Value) {
    let path = file.0.to_str().expect("a path in UTF-8");
    let output = stepcast(&[&["simulate", path, "--config", MACHINE, "--json"], more].concat());
    let report = json(&output);
    (output, report)
}

#[test]
fn wrong_usage_is_status_2_with_help() {
    for arguments in
        [&[][..], &["fly"], &["plan", "a.gcode"], &["simulate", "a", "--config", "b", "--fault", "x"]]
    {
        let output = stepcast(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(
            stderr(&output).contains("--help") || stderr(&output).contains("Usage"),
            "{}",
            stderr(&output)
        );
    }
    assert_eq!(stepcast(&["--help"]).status.code(), Some(0));
}

#[test]
fn completions_are_written_for_every_shell() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let output = stepcast(&["completions", shell]);
        assert_eq!(output.status.code(), Some(0));
        assert!(String::from_utf8_lossy(&output.stdout).contains("virtual-printer"), "{shell}");
    }
}

#[test]
fn check_tells_good_files_from_bad_ones() {
    let good = File::new("check-good.gcode", PRINT);
    let path = good.0.to_str().unwrap();
    let output = stepcast(&["check", path, "--config", MACHINE, "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(json(&output)["printable"], true);
    let bad = File::new("check-bad.gcode", "G28\nSTART_PRINT\nG1 X9999\n");
    let output = stepcast(&["check", bad.0.to_str().unwrap(), "--config", MACHINE]);
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("check-bad.gcode:2:") && text.contains("check-bad.gcode:3:"), "{text}");
    assert!(stderr(&output).contains("cannot be printed"), "{}", stderr(&output));
}

#[test]
fn files_that_are_no_gcode_are_named() {
    for (name, content, code) in [
        ("empty.gcode", &b""[..], "file-empty"),
        ("model.stl", b"solid cube\n facet normal 0 0 1\n", "file-binary"),
        ("part.bgcode", b"GCDE\x01\0\0\0\x01\0\0\0", "file-binary"),
        ("cut.gcode.gz", b"\x1f\x8b\x08\0\0\0\0\0\0\x03\x4b", "file-cut-off"),
    ] {
        let file = File::new(name, content);
        let path = file.0.to_str().unwrap();
        for command in ["plan", "simulate"] {
            let output = stepcast(&[command, path, "--config", MACHINE, "--json"]);
            assert_eq!(output.status.code(), Some(1), "{command} {name}");
            assert_eq!(json(&output)["error"]["code"], code, "{command} {name}");
            assert!(stderr(&output).contains("to do:"), "{}", stderr(&output));
        }
    }
}

#[test]
fn plan_counts_steps_and_bytes_and_writes_the_stream() {
    let file = File::new("plan.gcode", PRINT);
    let dump = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("plan.stream");
    let arguments = [
        "plan",
        file.0.to_str().unwrap(),
        "--config",
        MACHINE,
        "--json",
        "--dump-stream",
        dump.to_str().unwrap(),
    ];
    let output = stepcast(&arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let report = json(&output);
    // To X50, around the square, three quarters of a circle of 10 mm radius, to X10; 80 steps a mm.
    assert_eq!(report["motors"]["stepper_x"]["steps"], 80 * (50 + (10 + 10) + (20 + 10) + 50));
    assert_eq!(report["motors"]["stepper_z"]["steps"], 120);
    assert!(report["max_step_error_us"].as_f64().unwrap() <= 25.0);
    assert!((report["filament_mm"].as_f64().unwrap() - 1.6).abs() < 1e-9);
    let stream = fs::read(&dump).unwrap();
    assert_eq!(report["bytes"].as_u64().unwrap(), stream.len() as u64);
    assert_eq!(stream.last(), Some(&0x7e));
    stepcast(&arguments);
    assert_eq!(fs::read(&dump).unwrap(), stream, "the same plan twice");
    let ahead = json(&stepcast(&[&arguments[..5], &["--step-search", "ahead"]].concat()));
    assert_eq!(ahead["motors"]["stepper_x"]["steps"], report["motors"]["stepper_x"]["steps"]);
    assert!(ahead["bytes"].as_u64() < report["bytes"].as_u64(), "a look ahead saves bytes");
}

#[test]
fn a_print_is_simulated_to_its_end_whatever_the_link_does() {
    let file = File::new("print.gcode", PRINT);
    let (output, clean) = simulate(&file, &[]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(clean["result"], "done");
    assert_eq!(clean["reason"], Value::Null);
    for motor in ["stepper_x", "stepper_y", "stepper_z", "extruder"] {
        let motor = &clean["motors"][motor];
        assert_eq!(motor["planned_steps"], motor["counted_steps"]);
        assert_eq!(motor["lost_steps"], 0);
    }
    assert!(clean["path_error_max_mm"].as_f64().unwrap() <= 0.02);
    assert!(clean["temperature_error_max_c"].as_f64().unwrap() <= 3.0);
    assert!((clean["motors"]["stepper_x"]["end_position_mm"].as_f64().unwrap() - 10.0).abs() < 1e-6);
    assert_eq!(clean["after"]["heaters_off"], true);
    let (output, damaged) = simulate(&file, &["--fault", "corrupt=0.01", "--seed", "9"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(damaged["retransmitted_bytes"].as_u64().unwrap() > 0);
    assert_eq!(damaged["step_digest"], clean["step_digest"]);
    assert_eq!(damaged["pulse_digest"], clean["pulse_digest"]);
    let (_, again) = simulate(&file, &["--fault", "corrupt=0.01", "--seed", "9"]);
    assert_eq!(again["sent_bytes"], damaged["sent_bytes"], "the same seed gives the same run");
    let (output, small) = simulate(&file, &["--board", "stm32f103"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(small["board"], "stm32f103");
}

#[test]
fn what_must_not_be_printed_is_refused_by_line() {
    for (name, gcode, code, line) in [
        ("cold.gcode", "G28\nG1 X10 E1 F600\n", "cold-extrusion", 2),
        ("unhomed.gcode", "G1 X10 F600\n", "not-homed", 1),
        ("range.gcode", "G28\nG1 X10 F600\nG1 X4000\n", "move-out-of-range", 3),
        ("macro.gcode", "G28\nPRINT_START\nG1 X10 F600\n", "unknown-command", 2),
        ("cut.gcode", "M104 S200\nG28\nG1 X10 F600\n", "file-cut-off", 3),
    ] {
        let file = File::new(name, gcode);
        let (output, report) = simulate(&file, &[]);
        assert_eq!(output.status.code(), Some(1), "{name}");
        assert_eq!(report["result"], "refused", "{name}");
        assert_eq!(report["error"]["code"], code, "{name}");
        assert_eq!(report["error"]["line"], line, "{name}");
        assert_eq!(report["motors"]["stepper_x"]["counted_steps"], 0, "{name}");
        assert!(stderr(&output).contains(&format!("ine {line}")), "{}", stderr(&output));
    }
    let macro_file = File::new("macro-confirmed.gcode", "G28\nPRINT_START\nG1 X10 F600\n");
    for confirm in [&["--confirm-line", "2"][..], &["--confirm-all"]] {
        let (output, report) = simulate(&macro_file, confirm);
        assert_eq!((output.status.code(), &report["result"]), (Some(0), &Value::from("done")));
    }
}

#[test]
fn every_fault_ends_with_its_own_error_and_a_safe_machine() {
    let file = File::new("faults.gcode", PRINT);
    for (fault, code) in [
        ("sensor-open=extruder@20", "sensor-below-min"),
        ("sensor-short=extruder@20", "sensor-above-max"),
        ("heater-dead=extruder", "heater-not-heating"),
        ("endstop-stuck-on=x", "endstop-still-triggered"),
        ("endstop-stuck-off=y", "endstop-not-reached"),
        ("unplug@20", "link-lost"),
        ("drop=1", "board-silent"),
    ] {
        let (output, report) = simulate(&file, &["--fault", fault]);
        assert_eq!(output.status.code(), Some(1), "{fault}");
        assert_eq!(report["result"], "failed", "{fault}");
        assert_eq!(report["error"]["code"], code, "{fault}");
        // A board whose host is gone keeps its heaters at stand-by.
        assert_eq!(report["after"]["heaters_off"], !fault.starts_with("unplug"), "{fault}");
        assert_eq!(report["after"]["motors_still"], true, "{fault}");
        assert!(stderr(&output).contains("safety:"), "{}", stderr(&output));
    }
}

#[test]
fn a_wrong_machine_file_is_said_by_line() {
    let config = File::new("wrong.cfg", "[printer]\nkinematics: cartesian\nmax_velocity: fast\n");
    let file = File::new("any.gcode", PRINT);
    let output = stepcast(&["plan", file.0.to_str().unwrap(), "--config", config.0.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("wrong.cfg: line 3"), "{}", stderr(&output));
    let output = stepcast(&["plan", file.0.to_str().unwrap(), "--config", "/nowhere.cfg"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("/nowhere.cfg"), "{}", stderr(&output));
}

#[test]
fn a_print_begins_with_a_line_or_a_layer() {
    let second =
        PRINT.replace("G1 E1.6 F2400\n", "G1 Z0.5 F600\nG1 X50 Y50 E3.4 F1800\nG1 X60 E3.9\nG1 E1.6 F2400\n");
    let file = File::new("start.gcode", &second);
    let (output, whole) = simulate(&file, &[]);
    assert_eq!(output.status.code(), Some(0), "{whole:#}");
    let moves = |report: &Value| report["moves"].as_u64().expect("a number");
    for (arguments, least) in [(["--start-line", "11"], 7), (["--start-layer", "2"], 5)] {
        let (output, report) = simulate(&file, &arguments);
        assert_eq!((output.status.code(), &report["result"]), (Some(0), &"done".into()), "{report:#}");
        // The way there is up, to the side, filament out and back, across, down.
        assert!(moves(&report) >= least && report["pauses"] == 1, "{report:#}");
        let error = report["path_error_max_mm"].as_f64();
        assert!(error.is_some_and(|error| error < 0.02), "{report:#}");
        let homed: Vec<&Value> =
            report["homing"].as_array().expect("a list").iter().map(|homed| &homed["motor"]).collect();
        assert_eq!(homed, ["stepper_z", "stepper_x", "stepper_y"]);
    }
    let (_, first) = simulate(&file, &["--start-layer", "1"]);
    assert_eq!(first["pulse_digest"], whole["pulse_digest"]);
    let (output, error) = simulate(&file, &["--start-layer", "9"]);
    assert_eq!(output.status.code(), Some(1), "{error:#}");
    assert!(error["reason"].as_str().is_some_and(|reason| reason.contains("2 layers")), "{error:#}");
    let both = ["simulate", "a", "--config", "b", "--start-line", "3", "--start-layer", "2"];
    assert_eq!(stepcast(&both).status.code(), Some(2));
}

/// What `SAVE_CONFIG` leaves behind a machine file: a bed that is not flat, axes that are not square.
const LEVEL: &str = "\n[skew_correction]\n[bed_mesh]\nfade_start: 0.5\nfade_end: 10\n\
    #*# <---------------------- SAVE_CONFIG ---------------------->\n\
    #*# DO NOT EDIT THIS BLOCK OR BELOW. The contents are auto-generated.\n#*#\n\
    #*# [bed_mesh default]\n#*# version = 1\n#*# points =\n\
    #*# \t  0.110000, 0.042500, 0.012500, 0.120000\n#*# \t  0.052500, -0.035000, -0.067500, 0.060000\n\
    #*# \t  0.030000, -0.062500, -0.102500, 0.030000\n#*# \t  0.150000, 0.065000, 0.020000, 0.160000\n\
    #*# x_count = 4\n#*# y_count = 4\n#*# mesh_x_pps = 2\n#*# mesh_y_pps = 2\n#*# algo = bicubic\n\
    #*# tension = 0.2\n#*# min_x = 20.0\n#*# max_x = 80.0\n#*# min_y = 20.0\n#*# max_y = 80.0\n#*#\n\
    #*# [skew_correction calm]\n#*# xy_skew = 0.004\n#*# xz_skew = -0.002\n#*# yz_skew = 0.001\n";

#[test]
fn pulses_follow_a_bed_that_is_not_flat() {
    let machine = fs::read_to_string(MACHINE).unwrap() + LEVEL;
    let machine = File::new("level.cfg", machine);
    let gcode = PRINT
        .replacen("F9000\n", "F9000\nBED_MESH_PROFILE LOAD=default\nSKEW_PROFILE LOAD=calm\n", 1)
        .replacen("G1 E1.6", "G1 Z3\nG1 X15 Y85 Z0.4 E3.6 F3000\nBED_MESH_CLEAR\nG1 E2.6", 1);
    let file = File::new("level.gcode", &gcode);
    let [path, machine] = [&file, &machine].map(|it| it.0.to_str().unwrap());
    let output = stepcast(&["simulate", path, "--config", machine, "--json"]);
    let report = json(&output);
    assert_eq!(report["result"], "done", "{}", report["reason"]);
    for motor in ["stepper_x", "stepper_y", "stepper_z", "extruder"] {
        let motor = &report["motors"][motor];
        assert_eq!(motor["planned_steps"], motor["counted_steps"]);
        assert_eq!(motor["lost_steps"], 0);
    }
    // A microstep across and up, and what a piece may be off.
    assert!(report["path_error_max_mm"].as_f64().unwrap() <= 0.02, "{}", report["path_error_max_mm"]);
    let (_, flat) = simulate(
        &File::new(
            "flat.gcode",
            gcode.replace("BED_MESH_PROFILE LOAD=default\n", "").replace("SKEW_PROFILE LOAD=calm\n", ""),
        ),
        &[],
    );
    let steps = |report: &Value| report["motors"]["stepper_z"]["counted_steps"].as_u64().unwrap();
    assert!(steps(&report) > steps(&flat) + 20, "Z follows the bed: {} {}", steps(&report), steps(&flat));
    assert!(report["moves"].as_u64() > flat["moves"].as_u64());
    // What is not there is said before anything moves.
    let wrong = File::new("no-mesh.gcode", gcode.replace("LOAD=default", "LOAD=warm"));
    let output = stepcast(&["simulate", wrong.0.to_str().unwrap(), "--config", machine, "--json"]);
    let report = json(&output);
    assert_eq!((&report["result"], &report["error"]["code"]), (&"refused".into(), &"no-such-profile".into()));
}

#[test]
fn a_plan_tells_features_layers_and_the_axes_over_time() {
    let file = File::new("trace.gcode", format!(";TYPE:External perimeter\n{PRINT}"));
    let table = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("trace.csv");
    let [path, csv] = [&file.0, &table].map(|path| path.to_str().expect("a path in UTF-8"));
    let plan = ["plan", path, "--config", MACHINE, "--json", "--layers", "--trace", csv];
    let report = json(&stepcast(&[&plan[..], &["--trace-step-ms", "2"]].concat()));
    let sum = |list: &str| -> f64 {
        let list = report[list].as_array().expect("a list");
        list.iter().map(|one| one["time_s"].as_f64().expect("a time")).sum()
    };
    let time = report["print_time_s"].as_f64().expect("a time");
    assert!((sum("features") - time).abs() < 1e-6 && (sum("layers") - time).abs() < 1e-6, "{report:#}");
    let names: Vec<_> = report["features"].as_array().unwrap().iter().map(|one| &one["name"]).collect();
    assert_eq!(names, ["outer_wall", "travel", "retraction"]);
    let text = fs::read_to_string(&table).expect("the table");
    let rows: Vec<Vec<f64>> =
        text.lines().skip(1).map(|row| row.split(',').map(|cell| cell.parse().unwrap()).collect()).collect();
    assert!(text.starts_with("time_s,x_mm,y_mm,z_mm,e_mm,x_mm_s,"));
    assert!((rows.len() as f64 - time / 0.002).abs() <= 1.0 && rows.iter().all(|row| row.len() == 13));
    // From place to place at the speeds between, but for what accelerations do in 2 ms.
    for pair in rows.windows(2) {
        for axis in 1..5 {
            let (way, mean) = (pair[1][axis] - pair[0][axis], 0.5 * (pair[0][axis + 4] + pair[1][axis + 4]));
            assert!((way - 0.002 * mean).abs() < 0.02, "{pair:?}");
        }
    }
    let unwritable = stepcast(&["plan", path, "--config", MACHINE, "--trace", "/nowhere/trace.csv"]);
    assert_eq!(unwritable.status.code(), Some(1));
    assert!(stderr(&unwritable).contains("/nowhere/trace.csv"));
}

#[test]
fn arcs_are_drawn_as_arcs() {
    let arcs = "M83\nG3 X50 Y50 I10 J0 E2 F9000\nG2 X70 Y50 R10 E1\nG1 X75 E0.1\nG3 X80 Y55 I0 J5 E0.3\nG1 Y70\nG18\n\
        G3 X90 Z0.3 I5 K0 F600\nG17\nG3 X90 Y70 Z5 I-4 J0 P4 E0.5 F3000\nG2 X90.3 Y70 I0.15 J0 E0.05\nG91\nG2 X1 Y1 I1\n\
        G90\nM82\nG92 E2\n";
    let print = PRINT.replacen("G3 X60 Y60 I10 J0 E2.6\n", arcs, 1);
    let (output, report) = simulate(&File::new("arcs.gcode", print), &[]);
    assert!(output.status.success(), "{report:#}");
    // Half a step of two axes, and what a step's time may be off.
    assert!(report["path_error_max_mm"].as_f64().is_some_and(|error| error < 0.013), "{report:#}");
    for motor in ["stepper_x", "stepper_y", "stepper_z", "extruder"] {
        let steps = &report["motors"][motor];
        assert_eq!(steps["planned_steps"], steps["counted_steps"], "{motor}");
    }
}
