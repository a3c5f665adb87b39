//! Prints on machines of every kinematics: what their pulses draw, and that a print survives on each of them.

use std::{
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use serde_json::Value;

const CARTESIAN: &str = include_str!("../../../samples/printer.cfg");
const CORE_XY: &str = include_str!("../../../samples/corexy.cfg");
const DELTA: &str = include_str!("../../../samples/delta.cfg");

/// Without heat: straight on, slanted, an arc, and up and down, around the middle of a round bed.
const PRINT: &str = "G28\nG90\nG1 Z5 F6000\nG1 X-40 Y-30 F9000\nG1 X60 Y-30 F12000\nG1 X60 Y55\nG1 X-20 Y-40\n\
    G2 X30 Y10 I25 J25 F6000\nG1 Z15 F3000\nG1 X-70 Y40 Z8 F9000\nG1 X-70.013 Y40.004\nG28 X\nG1 Z20 F3000\n\
    G1 X5 Y5 F9000\nG18\nG3 X15 Z20 I5 K0 F3000\nG17\nG1 X40.5 Y-61.2 Z10\nM84\n";

/// The same on a bed whose corner is at 0.
fn on_a_square_bed() -> String {
    let move_word = |word: &str| match (word.get(..1), word.get(1..).and_then(|at| at.parse::<f64>().ok())) {
        (Some(axis @ ("X" | "Y")), Some(at)) => format!("{axis}{:.3}", at + 150.0),
        _ => word.to_owned(),
    };
    let line = |line: &str| line.split(' ').map(move_word).collect::<Vec<_>>().join(" ");
    PRINT.lines().map(line).collect::<Vec<_>>().join("\n")
}

/// The machine and what it prints.
fn machine(kinematics: &str) -> (String, String) {
    let text = match kinematics {
        "delta" => return (DELTA.to_owned(), PRINT.to_owned()),
        "cartesian" => CARTESIAN.to_owned(),
        other => CORE_XY.replace("kinematics: corexy", &format!("kinematics: {other}")),
    };
    // Belts that move Z too are none of a screw.
    let z = text.find("[stepper_z]").expect("a Z axis");
    let text = if kinematics.ends_with("corexz") {
        let belt = text[z..].replacen("rotation_distance: 8", "rotation_distance: 40", 1);
        format!("{}{belt}", &text[..z]).replace("max_z_velocity: 15", "max_z_velocity: 100")
    } else {
        text
    };
    (text, on_a_square_bed())
}

const ALL: [&str; 6] = ["cartesian", "corexy", "corexz", "hybrid_corexy", "hybrid_corexz", "delta"];

fn scratch(name: &str, content: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::write(&path, content).expect("a scratch file");
    path
}

fn stepcast(arguments: &[&str], paths: &[&Path]) -> Value {
    let output = Command::new(env!("CARGO_BIN_EXE_stepcast"))
        .args(arguments)
        .args(paths)
        .output()
        .expect("the command runs");
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    serde_json::from_slice(&output.stdout).unwrap_or_else(|problem| panic!("{problem}: {error}"))
}

fn simulate(name: &str, kinematics: &str, print: &str, more: &[&str]) -> Value {
    let (machine, _) = machine(kinematics);
    let file = scratch(&format!("kinematics-{name}-{kinematics}.gcode"), print);
    let config = scratch(&format!("kinematics-{name}-{kinematics}.cfg"), &machine);
    let mut arguments = vec!["simulate", "--json"];
    arguments.extend(more);
    stepcast(&arguments, &[&file, Path::new("--config"), &config])
}

fn seconds(report: &Value, key: &str) -> f64 {
    report[key].as_f64().expect("a number")
}

fn all_motors(report: &Value, holds: impl Fn(&Value) -> bool) -> bool {
    report["motors"].as_object().expect("motors").values().all(holds)
}

#[test]
fn every_machine_draws_what_the_file_says() {
    for kinematics in ALL {
        let (_, print) = machine(kinematics);
        let report = simulate("draws", kinematics, &print, &[]);
        assert_eq!(report["result"], "done", "{kinematics}: {report:#}");
        // Half a step of each motor, of the two that stop together at an endstop another half, and 25 µs at 200 mm/s.
        assert!(seconds(&report, "path_error_max_mm") <= 0.025, "{kinematics}: {report:#}");
        assert!(all_motors(&report, |motor| motor["lost_steps"] == 0), "{kinematics}: {report:#}");
        let homed = report["homing"].as_array().expect("a list");
        let again = if kinematics == "delta" { 3 } else { 1 };
        assert_eq!(homed.len(), 3 + again, "{report:#}");
        for axis in homed {
            // The contact bounces and the carriage runs on by a step or two; nothing else may be off.
            assert!(seconds(axis, "error_mm").abs() <= 0.06, "{kinematics}: {axis:#}");
        }
    }
}

/// A shaper makes an axis late, not the head stray: to and fro along one axis, whatever another has, the head stays on its
/// line. Were it on the motors, those that move the head together would come apart while it speeds up.
#[test]
fn filters_are_on_the_axes_not_on_the_motors() {
    // Each axis by itself, with the other's shaper as unlike as can be; rests between moves, for shapers round corners.
    let moves = |x: f64, y: f64, z: f64| {
        let to_and_fro = |axis: &str, middle: f64, far: f64| {
            let end = |by: f64| format!("G1 {axis}{:.3}\nM400\nG4 P200\n", middle + by);
            [far, -far, 0.3 * far, -far, 0.0].map(end).concat()
        };
        let xy = to_and_fro("X", x, 60.0) + &to_and_fro("Y", y, 55.0);
        format!("G28\nG90\nG1 Z{z} F6000\nM400\nG4 P200\nG1 F12000\n{xy}M84\n")
    };
    for (kinematics, print) in [
        ("corexy", moves(150.0, 140.0, 30.0)),
        ("hybrid_corexy", moves(150.0, 140.0, 30.0)),
        ("corexz", moves(150.0, 140.0, 30.0)),
        ("hybrid_corexz", moves(150.0, 140.0, 30.0)),
        ("delta", moves(0.0, 0.0, 30.0)),
    ] {
        for shapers in
            ["shaper_freq_x: 20\n", "shaper_freq_y: 20\n", "shaper_freq_x: 30\nshaper_freq_y: 55\n"]
        {
            let text = format!("{}\n[input_shaper]\n{shapers}", machine(kinematics).0);
            let file = scratch(&format!("kinematics-shaped-{kinematics}.gcode"), &print);
            let config = scratch(&format!("kinematics-shaped-{kinematics}.cfg"), &text);
            let report = stepcast(&["simulate", "--json"], &[&file, Path::new("--config"), &config]);
            assert_eq!(report["result"], "done", "{kinematics}: {report:#}");
            assert!(all_motors(&report, |motor| motor["lost_steps"] == 0), "{kinematics}: {report:#}");
            assert!(seconds(&report, "path_error_max_mm") <= 0.025, "{kinematics}, {shapers}: {report:#}");
        }
    }
}

#[test]
fn a_print_whose_host_is_held_up_is_the_same_print() {
    for kinematics in ["corexy", "hybrid_corexz", "delta"] {
        // Homing in the middle is no motion that can be held: without it.
        let print = machine(kinematics).1.replace("G28 X\n", "");
        let clean = simulate("held-clean", kinematics, &print, &[]);
        assert_eq!(clean["result"], "done", "{clean:#}");
        // The machine is watched for six seconds after the end.
        let at = seconds(&clean, "virtual_time_s") - 6.0 - seconds(&clean, "print_time_s") + 2.0;
        let fault = format!("--fault=host-stall=4@{at}");
        let held = simulate("held", kinematics, &print, &[&fault, "--confirm-holds"]);
        assert_eq!((&held["result"], &held["holds"]), (&"done".into(), &1.into()), "{kinematics}: {held:#}");
        assert_eq!(held["step_digest"], clean["step_digest"], "{kinematics}");
        assert!(seconds(&held, "path_error_max_mm") <= 0.025, "{kinematics}: {held:#}");
    }
}

#[test]
fn prints_are_taken_up_and_paused_to_the_step() {
    for kinematics in ["corexy", "delta"] {
        let (text, print) = machine(kinematics);
        let config = scratch(&format!("kinematics-campaign-{kinematics}.cfg"), &text);
        // Something that pushes filament, of which windows are taken.
        // A move as short as dust takes no filament.
        let is_dust = |line: &str| line.contains(".013 ") || line.contains(".987 ");
        let print = print.replace("G28 X\n", "").replace("G90\n", "G90\nM83\nM104 S200\nM109 S200\n");
        let drawn = |line: &str| match line {
            _ if is_dust(line) => String::new(),
            _ if line.starts_with("G1 X") => format!("{line} E0.4\n"),
            "M84" => "M104 S0\nM84\n".to_owned(),
            _ => format!("{line}\n"),
        };
        let print: Vec<String> = print.lines().map(drawn).collect();
        let file = scratch(&format!("kinematics-campaign-{kinematics}.gcode"), &print.concat());
        let scenarios = ["--scenario", "take_up,pause,torn_journal"];
        let classes = stepcast(
            &[&["campaign", "--json", "--runs", "3", "--seed", "5"][..], &scenarios].concat(),
            &[Path::new("--config"), &config, Path::new("--file"), &file],
        );
        let classes = classes.as_array().expect("a list");
        assert_eq!(classes.len(), 3);
        for class in classes {
            assert_eq!((&class["runs"], &class["broken"]), (&3.into(), &0.into()), "{kinematics}: {class:#}");
            assert_eq!((&class["wrong_resumes"], &class["lost_steps"]), (&0.into(), &0.into()), "{class:#}");
        }
    }
}

#[test]
fn what_cannot_be_reached_is_refused_with_its_line() {
    for (print, line, words) in [
        ("G28\nG90\nG1 Z5 F6000\nG1 X90 Y90\n", 4, "from the middle"),
        ("G28\nG90\nG1 Z299 F6000\nG1 X100 Y0\n", 4, "beyond its endstop"),
        ("G28\nG90\nG1 Z-1 F6000\n", 3, "Z -1.000"),
        // Its ends and where it is farthest along X and Y are within the round bed, its middle is not.
        (
            "G28\nG90\nG1 Z5 F6000\nG1 X89.848 Y53.486\nG3 X53.486 Y89.848 I-39.848 J-3.486\n",
            5,
            "from the middle",
        ),
    ] {
        let report = simulate("refused", "delta", print, &[]);
        assert_eq!(report["result"], "refused", "{report:#}");
        let error = &report["error"];
        assert_eq!(
            (&error["code"], &error["line"]),
            (&"move-out-of-range".into(), &line.into()),
            "{report:#}"
        );
        assert!(error.to_string().contains(words), "{error:#}");
    }
}

/// Arcs and lines that come to the very middle of two positions of a motor, turn there and go back: whether that is a step there and
/// back or none is for the last bits to say.
#[test]
fn ways_that_touch_half_a_step_are_counted_right() {
    let mut print = String::from("G28\nG90\nG1 Z5 F6000\nG1 F9000\n");
    for half in 0..40 {
        // Steps are 0.0125 mm: the middles are 0.00625 mm beside them.
        let top = 160.006_25 + 0.0125 * f64::from(half);
        for (radius, way) in [(5.0, "G3"), (7.0, "G2"), (3.1, "G3")] {
            let (x, y) = (top - radius, 120.0 + radius);
            let (from, to) = if way == "G3" { (120.0 - radius, y) } else { (y, 120.0 - radius) };
            let middle = 120.0 - from;
            let _ = writeln!(print, "G1 X{x:.5} Y{from:.5}\n{way} X{x:.5} Y{to:.5} I0 J{middle:.5}");
        }
        // To the very same places and back.
        let _ = writeln!(print, "G1 X{:.5} Y{:.5}\nG1 X150", top + 3.0, 110.0 - 0.0125 * f64::from(half));
    }
    print += "M84\n";
    let report = simulate("touches", "cartesian", &print, &[]);
    assert_eq!(report["result"], "done", "{report:#}");
}

#[test]
fn a_plan_names_motors_as_the_machine_file_does_and_tells_of_lines_that_it_leaves_out() {
    for (kinematics, names, others) in [
        ("delta", ["stepper_a", "stepper_b", "stepper_c"], ["stepper_x", "stepper_y", "stepper_z"]),
        ("corexy", ["stepper_x", "stepper_y", "stepper_z"], ["stepper_a", "stepper_b", "stepper_c"]),
    ] {
        let (text, _) = machine(kinematics);
        let print = "G28\nG1 X5 Y3 Z2 F3000\nFROBNICATE\nG1 X1e400\nG1 X9\n";
        let file = scratch(&format!("kinematics-named-{kinematics}.gcode"), print);
        let config = scratch(&format!("kinematics-named-{kinematics}.cfg"), &text);
        let plan = stepcast(&["plan", "--json"], &[&file, Path::new("--config"), &config]);
        let steps = |name: &str| plan["motors"][name]["steps"].as_u64();
        assert!(names.iter().all(|name| steps(name).is_some_and(|steps| steps > 0)), "{plan:#}");
        assert!(others.iter().all(|name| steps(name).is_none()), "{plan:#}");
        assert_eq!((&plan["skipped_lines"], &plan["first_skipped_line"]), (&2.into(), &3.into()), "{plan:#}");
    }
}

#[test]
fn a_print_begins_with_any_line() {
    for kinematics in ["corexy", "corexz", "delta"] {
        // On a delta the head comes from its top, from where nothing but the middle can be reached.
        let print = machine(kinematics).1.replace("G28 X\n", "");
        let report = simulate("begins", kinematics, &print, &["--start-line", "6"]);
        assert_eq!(report["result"], "done", "{kinematics}: {report:#}");
        assert!(seconds(&report, "path_error_max_mm") <= 0.025, "{kinematics}: {report:#}");
        assert!(all_motors(&report, |motor| motor["lost_steps"] == 0), "{kinematics}: {report:#}");
    }
}
