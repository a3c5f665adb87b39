use units::{Celsius, MmPerS2, Seconds};

use super::*;
use crate::Annotation;
use crate::action::{Heater, MeshChange, ObjectAction, ObjectId, PauseReason, SkewChange, VelocityLimit};

fn one(line: &str) -> Action {
    let mut actions = clean(line).actions;
    assert_eq!(actions.len(), 1, "{line}: {actions:?}");
    actions.remove(0)
}

#[test]
fn temperatures_and_what_they_wait_for() {
    let set = |heater, target, wait| Action::SetTemperature { heater, target: Celsius(target), wait };
    for (line, action) in [
        ("M104 S215 ; set temperature", set(Heater::Tool(0), 215.0, Wait::No)),
        ("M104 T1 S0", set(Heater::Tool(1), 0.0, Wait::No)),
        ("M109 S215", set(Heater::Tool(0), 215.0, Wait::UntilHeated)),
        ("M109 R180", set(Heater::Tool(0), 180.0, Wait::UntilReached)),
        ("M140 S60", set(Heater::Bed, 60.0, Wait::No)),
        ("M190 S60", set(Heater::Bed, 60.0, Wait::UntilHeated)),
        ("M190 R40", set(Heater::Bed, 40.0, Wait::UntilReached)),
        ("M141 S50", set(Heater::Chamber, 50.0, Wait::No)),
        ("M191 S50", set(Heater::Chamber, 50.0, Wait::UntilHeated)),
        ("SET_HEATER_TEMPERATURE HEATER=extruder1 TARGET=200", set(Heater::Tool(1), 200.0, Wait::No)),
        ("set_heater_temperature heater=heater_bed", set(Heater::Bed, 0.0, Wait::No)),
    ] {
        assert_eq!(one(line), action, "{line}");
    }
    assert_eq!(clean("T2\nM104 S200").actions[1], set(Heater::Tool(2), 200.0, Wait::No));
    let wait =
        Action::WaitForTemperature { heater: Heater::Bed, minimum: Some(Celsius(50.0)), maximum: None };
    assert_eq!(one("TEMPERATURE_WAIT SENSOR=heater_bed MINIMUM=50"), wait);
    for (line, said) in [
        ("M104", "1:0-4 error missing-value"),
        ("M109 S-10", "1:5-6 error value-out-of-range"),
        ("M140 S99999", "1:5-6 error value-out-of-range"),
        ("M104 T1.5 S200", "1:5-6 error value-out-of-range"),
        ("SET_HEATER_TEMPERATURE HEATER=dryer TARGET=50", "1:23-35 blocking unsupported-command"),
        ("SET_HEATER_TEMPERATURE TARGET=50", "1:0-22 error missing-value"),
    ] {
        let read = read(line);
        assert_eq!((read.said(), read.actions.len()), (vec![said.to_owned()], 0), "{line}");
    }
}

#[test]
fn fans_motors_waits_and_reports() {
    for (line, action) in [
        ("M106 S127.5", Action::Fan { index: 0, speed: 0.5 }),
        ("M106", Action::Fan { index: 0, speed: 1.0 }),
        ("M106 P2 S999", Action::Fan { index: 2, speed: 1.0 }),
        ("M107", Action::Fan { index: 0, speed: 0.0 }),
        ("M107 P1", Action::Fan { index: 1, speed: 0.0 }),
        ("M84", Action::MotorsOff { x: true, y: true, z: true, e: true }),
        ("M18 X E", Action::MotorsOff { x: true, y: false, z: false, e: true }),
        ("G28", Action::Home { x: true, y: true, z: true }),
        ("G28 W ; without mesh", Action::Home { x: true, y: true, z: true }),
        ("G28 X0 Y", Action::Home { x: true, y: true, z: false }),
        ("G4 P500", Action::Dwell(Seconds(0.5))),
        ("G4 S2", Action::Dwell(Seconds(2.0))),
        ("M400", Action::WaitForMoves),
        ("M105", Action::ReportTemperatures),
        ("M114", Action::ReportPosition),
        ("M112", Action::EmergencyStop),
        ("M117 50% done ; really", Action::Message("50% done".into())),
        ("M117", Action::Message(String::new())),
        ("T1", Action::SelectTool(1)),
        ("M0 Press the button", Action::Pause(PauseReason::Requested)),
        ("M600", Action::Pause(PauseReason::FilamentChange)),
        ("PAUSE", Action::Pause(PauseReason::Requested)),
        ("CANCEL_PRINT", Action::Cancel),
        ("TURN_OFF_HEATERS", Action::TurnOffHeaters),
        ("RESPOND TYPE=echo MSG=\"hello there\"", Action::Message("hello there".into())),
    ] {
        assert_eq!(one(line), action, "{line}");
    }
    assert_eq!(clean("G4").actions, []);
    assert_eq!(read("M84 S30").said(), ["1:0-3 info ignored-setting"]);
    assert_eq!(read("M106 P300").said(), ["1:5-6 error value-out-of-range"]);
    assert_eq!(read("G4 S1000000").said(), ["1:0-2 error value-out-of-range"]);
}

#[test]
fn limits_of_the_planner() {
    let accel =
        |a| Action::VelocityLimit(VelocityLimit { accel: Some(MmPerS2(a)), ..VelocityLimit::default() });
    assert_eq!(one("M204 S1500"), accel(1500.0));
    assert_eq!(one("M204 P1500 T1000"), accel(1000.0));
    assert_eq!(one("M204 P800"), accel(800.0));
    assert_eq!(clean("M204 R1000").actions, []);
    let all = VelocityLimit {
        velocity: Some(MmPerS(300.0)),
        accel: Some(MmPerS2(5000.0)),
        square_corner_velocity: Some(MmPerS(8.0)),
        minimum_cruise_ratio: Some(0.5),
    };
    for line in [
        "SET_VELOCITY_LIMIT VELOCITY=300 ACCEL=5000 SQUARE_CORNER_VELOCITY=8 MINIMUM_CRUISE_RATIO=0.5",
        "SET_VELOCITY_LIMIT velocity=300 accel=5000 ACCEL_TO_DECEL=2500 SQUARE_CORNER_VELOCITY=8",
    ] {
        assert_eq!(one(line), Action::VelocityLimit(all), "{line}");
    }
    let advance = |advance, smooth_time: Option<f64>| Action::PressureAdvance {
        advance,
        smooth_time: smooth_time.map(Seconds),
    };
    assert_eq!(one("SET_PRESSURE_ADVANCE ADVANCE=.045 SMOOTH_TIME=0.04"), advance(Some(0.045), Some(0.04)));
    assert_eq!(one("M900 K0.05"), advance(Some(0.05), None));
    assert_eq!(one("M572 S0.03 D0"), advance(Some(0.03), None));
    assert_eq!(read("M900 K30").said(), ["1:0-4 info ignored-setting"]);
    let Action::MachineLimits(limits) = one("M203 X500 Y500 Z12 E120 ; mm/s") else { panic!() };
    assert_eq!(
        (limits.velocity_mm_s.z, limits.velocity_mm_s.e, limits.accel_mm_s2.x),
        (Some(12.0), Some(120.0), None)
    );
    let Action::MachineLimits(limits) = one("M205 X8.00 J0.02") else { panic!() };
    assert_eq!((limits.jerk_mm_s.x, limits.junction_deviation), (Some(8.0), Some(units::Mm(0.02))));
    for line in [
        "SET_VELOCITY_LIMIT ACCEL=-5",
        "SET_VELOCITY_LIMIT MINIMUM_CRUISE_RATIO=1",
        "M204 S0",
        "M220 S0",
        "M221 S5000",
    ] {
        let read = read(line);
        assert!(read.actions.is_empty() && read.said()[0].ends_with("error value-out-of-range"), "{line}");
    }
    assert_eq!(read("SET_VELOCITY_LIMIT ACCEL=fast").said(), ["1:19-29 error malformed-word"]);
    assert_eq!(read("SET_VELOCITY_LIMIT ACCEL 5").said(), ["1:19-24 error malformed-word"]);
}

#[test]
fn objects_of_both_dialects() {
    let objects = |text: &str| -> Vec<ObjectAction> {
        let only = |action| if let Action::Object(object) = action { object } else { panic!("{action:?}") };
        clean(text).actions.into_iter().map(only).collect()
    };
    let name = |name: &str| ObjectId::Name(name.into());
    assert_eq!(
        objects(
            "EXCLUDE_OBJECT_DEFINE NAME='a b_id_0' CENTER=10,20.5 POLYGON=[[0,0],[1,-2.5], [3,4]]\nEXCLUDE_OBJECT_START NAME=a\n\
             EXCLUDE_OBJECT_END NAME=a\nEXCLUDE_OBJECT NAME=a\nEXCLUDE_OBJECT RESET=1"
                .replace("], [", "],[")
                .as_str()
        ),
        [
            ObjectAction::Define {
                id: name("a b_id_0"),
                label: None,
                centre: Some([10.0, 20.5]),
                polygon: vec![[0.0, 0.0], [1.0, -2.5], [3.0, 4.0]]
            },
            ObjectAction::Start(name("a")),
            ObjectAction::End(Some(name("a"))),
            ObjectAction::Cancel(Some(name("a"))),
            ObjectAction::Restore(None),
        ]
    );
    let define = ObjectAction::Define {
        id: ObjectId::Index(0),
        label: Some("cube.stl".into()),
        centre: None,
        polygon: vec![],
    };
    assert_eq!(
        objects("M486 T2\nM486 S0 A\"cube.stl\"\nM486 S-1\nM486 P1\nM486 C"),
        [
            ObjectAction::Count(2),
            define.clone(),
            ObjectAction::Start(ObjectId::Index(0)),
            ObjectAction::End(None),
            ObjectAction::Cancel(Some(ObjectId::Index(1))),
            ObjectAction::Cancel(None),
        ]
    );
    // PrusaSlicer gives the label a line of its own.
    assert_eq!(
        objects("M486 S0\nM486 Acube.stl\nM486 S-1\nM486 Anobody"),
        [ObjectAction::Start(ObjectId::Index(0)), define, ObjectAction::End(None)]
    );
    assert_eq!(read("EXCLUDE_OBJECT_START").said(), ["1:0-20 error missing-value"]);
    assert_eq!(read("M486 S1.5").said(), ["1:5-6 error value-out-of-range"]);
}

#[test]
fn harmless_commands_pass_and_unknown_ones_block() {
    clean(
        "M73 P5 R12\nM115 U3.1.0\nM862.3 P \"MK3S\"\nM17\nM110 N5\nM209 S0\nM200 D0\nTIMELAPSE_TAKE_FRAME\nM118 {x*1}",
    );
    for (line, said) in [
        ("START_PRINT BED=60 EXTRUDER=200", "1:0-11 blocking unknown-macro"),
        ("  print_end", "1:2-11 blocking unknown-macro"),
        ("G29", "1:0-3 blocking unsupported-command"),
        ("M1002 gcode_claim_action : 2", "1:0-5 blocking unknown-command"),
        ("G38.2 Z-5", "1:0-5 blocking unknown-command"),
        ("M104_WAIT", "1:0-9 blocking unknown-macro"),
        ("X10 Y20", "1:0-3 blocking unknown-command"),
        ("Tx", "1:0-2 blocking unknown-macro"),
        ("M200 D1.75", "1:0-4 error unsupported-command"),
        ("M200 S1", "1:0-4 error unsupported-command"),
        ("M302 S0", "1:0-4 info ignored-setting"),
        ("{if x}", "1:0-1 error malformed-word"),
        ("<html>", "1:0-1 error malformed-word"),
    ] {
        let read = read(line);
        assert_eq!((read.said(), read.actions.len()), (vec![said.to_owned()], 0), "{line}");
    }
}

#[test]
fn every_message_says_what_to_do_or_what_is_done() {
    let text = "START_PRINT\nM999\nG1 X1 X2\nM104\nG2 X1\nM200 D2\nG1 Q1\nG1 X1 \u{1}";
    for diagnostic in read(text).diagnostics {
        assert!(diagnostic.message.ends_with(['.', ')']) && diagnostic.message.len() > 20, "{diagnostic}");
    }
}

#[test]
fn comments_and_odd_lines() {
    let read = clean(
        "\u{feff}G1 X1\n%\n(a comment) G1 (here) X2 ; and here\n( only )\n\t\n;LAYER_CHANGE\n;Z:0.2\n  G1 X3  ",
    );
    let x: Vec<f64> = read.moves().iter().map(|to| to[0]).collect();
    assert_eq!(x, [1.0, 2.0, 3.0]);
    assert!(read.actions.contains(&Action::Annotation(Annotation::LayerChange)));
    assert_eq!(self::read("G1 X1 (open").said(), ["1:6-11 info malformed-word"]);
    assert_eq!(self::read("\u{feff}G1 X1 X2").said(), ["1:9-10 error duplicate-word"]);
    // A picture that never ends does not swallow commands.
    let unended = clean("; thumbnail begin 1x1 9\n; aGVsbG8\nG1 X1\n;LAYER_CHANGE");
    assert_eq!(unended.actions.len(), 2);
}

#[test]
fn checksums_and_line_numbers_are_verified() {
    let sum = |line: &str| format!("{line}*{}", line.bytes().fold(0, |sum, b| sum ^ b));
    let good =
        [sum("N0 M110 N0"), sum("N1 G1 X5 "), sum("N2 M117 a*b"), sum("N3 T0"), sum("N4 PAUSE")].join("\n");
    assert_eq!(clean(&good).actions.len(), 4);
    let gap = format!("{}\n{}", sum("N1 G1 X5"), sum("N3 G1 X6"));
    let read_gap = read(&gap);
    assert_eq!(
        (read_gap.said(), read_gap.moves().len()),
        (vec!["2:0-2 blocking line-number-out-of-order".to_owned()], 2)
    );
    for (line, said) in [
        ("N1 G1 X5*1", "1:8-10 error checksum-mismatch"),
        ("G1 X5*1", "1:5-7 error checksum-mismatch"),
        ("N1 G1 X5*", "1:8-9 error malformed-word"),
        ("N1 =", "1:3-4 error malformed-word"),
        ("N1.5 G1 X1", "1:0-4 error value-out-of-range"),
    ] {
        let read = read(line);
        assert_eq!((read.said(), read.actions.len()), (vec![said.to_owned()], 0), "{line}");
    }
    assert_eq!(clean(&sum("G1 X5")).moves().len(), 1);
    // Numbers without checksums are names of lines, as other machines' programs have them.
    assert_eq!(clean("N10 G1 X1\nN20 G1 X2\nN5").moves().len(), 2);
}

#[test]
fn skew_and_bed_mesh() {
    let lengths = |xy, xz, yz| Action::Skew(SkewChange::Measured { xy, xz, yz });
    for (line, action) in [
        ("SET_SKEW XY=140.4,142.8,99.8", lengths(Some([140.4, 142.8, 99.8]), None, None)),
        ("set_skew xz=1,2,3 yz=\"4, 5, 6\"", lengths(None, Some([1.0, 2.0, 3.0]), Some([4.0, 5.0, 6.0]))),
        ("SET_SKEW CLEAR=1", Action::Skew(SkewChange::Clear)),
        ("SKEW_PROFILE LOAD=calm", Action::Skew(SkewChange::Load("calm".into()))),
        ("GET_CURRENT_SKEW", Action::Skew(SkewChange::Report)),
        (
            "CALC_MEASURED_SKEW AC=140.4 BD=142.8 AD=99.8",
            Action::Skew(SkewChange::Calculate([140.4, 142.8, 99.8])),
        ),
        ("BED_MESH_PROFILE LOAD=\"cold bed\"", Action::BedMesh(MeshChange::Load("cold bed".into()))),
        ("BED_MESH_CLEAR", Action::BedMesh(MeshChange::Clear)),
        ("BED_MESH_OUTPUT PGP=1", Action::BedMesh(MeshChange::Report)),
    ] {
        assert_eq!(one(line), action, "{line}");
    }
    for (line, said) in [
        ("SET_SKEW XY=1,2", "1:9-15 error value-out-of-range"),
        ("SET_SKEW XY=1,2,3,4", "1:9-19 error value-out-of-range"),
        ("SET_SKEW XY=1,-2,3", "1:9-18 error value-out-of-range"),
        ("SET_SKEW XY=1,nan,3", "1:9-19 error value-out-of-range"),
        ("CALC_MEASURED_SKEW AC=1 BD=2", "1:0-18 error missing-value"),
        ("SKEW_PROFILE", "1:0-12 error missing-value"),
        ("SKEW_PROFILE SAVE=x", "1:0-12 info ignored-setting"),
        ("BED_MESH_PROFILE REMOVE=x", "1:0-16 info ignored-setting"),
        ("BED_MESH_CALIBRATE", "1:0-18 blocking unsupported-command"),
    ] {
        let read = read(line);
        assert_eq!((read.said(), read.actions.len()), (vec![said.to_owned()], 0), "{line}");
    }
}
