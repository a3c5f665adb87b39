//! Prints on a bed that is not flat, by axes that are not square: hosts that die, pauses, and prints that begin with a line.

use printer::{
    error::ErrorCode,
    interruption::Survey,
    journal::Journal,
    session::{Event, JobOptions, JobStatus, PhaseName, Request, ScheduledMove},
    transform::TransformRecord,
};
use units::Mm;
use virtual_printer::BoardProfile;

use crate::{
    attach::{die, file, setup, steps, take_up},
    bench::{Bench, Setup},
    machine,
    print::squares,
    start::{paused, paused_with},
};

/// A bed that is deepest in its middle, and a machine that leans.
const LEVEL: &str = "
[skew_correction lean]
xy_skew: 0.01
xz_skew: -0.02
yz_skew: 0.005
[bed_mesh]
fade_start: 1.1
fade_end: 6
[bed_mesh cold]
points:
  0.20, 0.10, 0.05, 0.12
  0.10, -0.08, -0.10, 0.02
  0.06, -0.12, -0.06, 0.08
  0.15, 0.05, 0.11, 0.25
x_count: 4
y_count: 4
min_x: 5
max_x: 145
min_y: 5
max_y: 145
algo: bicubic
tension: 0.4
";

fn levelled(board: BoardProfile) -> Setup {
    let mut setup = setup(board);
    setup.config.push_str(LEVEL);
    setup
}

/// The skew is the file's own affair; it changes on the way.
fn leaning(file: &str) -> String {
    let file = file.replacen("G28\n", "G28\nSKEW_PROFILE LOAD=lean\n", 1);
    file.replacen("G1 Z1.4", "SET_SKEW XY=140.4,142.8,99.8\nG1 Z1.4", 1)
}

/// Starts a print with a mesh that was loaded by hand.
fn started(setup: &Setup, file: &str) -> (Bench, usize) {
    let mut bench = setup.ready();
    bench.gcode("BED_MESH_PROFILE LOAD=cold");
    let options = JobOptions { journal: Some(0x00ab_0000), ..JobOptions::default() };
    bench.start_with(file, options).unwrap();
    let homed = |event: &Event| matches!(event, Event::Homed { axis: 2, .. });
    bench.until("homed", 100.0, |bench| bench.events.iter().any(homed));
    let from = bench.pulses().len();
    (bench, from)
}

/// The file's own moves.
fn moves(bench: &Bench) -> Vec<ScheduledMove> {
    let made = |event: &Event| match event {
        Event::Move(made) if !made.homing => Some(*made),
        _ => None,
    };
    bench.events.iter().filter_map(made).collect()
}

#[test]
fn the_next_step_follows_on_a_bed_that_is_not_flat() {
    let setup = levelled(BoardProfile::rp2040());
    let file = leaning(&file());
    let (mut whole, from) = started(&setup, &file);
    whole.job_over();
    whole.job_done();
    let expected = steps(&mut whole, from);
    // Z follows the bed, within layers too.
    let made = moves(&whole);
    assert!(made.iter().filter(|mv| mv.line > 0 && mv.from[2] != mv.to[2]).count() > 50);
    for tenth in 0..12 {
        let (mut bench, from) = started(&setup, &file);
        bench.run(0.1 + 0.9 * f64::from(tenth));
        if bench.session.job_status() == JobStatus::None {
            assert!(tenth > 8, "the print is too short");
            break;
        }
        die(&mut bench, &setup, 0.1 * f64::from(tenth % 7));
        take_up(&mut bench, &file);
        bench.ask(Request::Resume);
        bench.job_over();
        bench.job_done();
        assert!(steps(&mut bench, from) == expected, "{tenth}");
    }
}

#[test]
fn a_journal_knows_what_was_in_force_when_the_print_began() {
    let setup = levelled(BoardProfile::rp2040());
    let file = leaning(&file());
    let (mut bench, _) = started(&setup, &file);
    bench.run(2.0);
    // Without the mesh the plan is another one, which is found out by its rows.
    let line = bench.journal.lines().next().unwrap();
    assert!(line.contains("\"mesh\":\"cold\""), "{line}");
    let json = line.split_once(' ').unwrap().1.replace("\"mesh\":\"cold\"", "\"mesh\":null");
    let check = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(json.as_bytes());
    let other = bench.journal.replacen(line, &format!("{check:08x} {json}"), 1);
    die(&mut bench, &setup, 0.5);
    bench.until("the held print", 20.0, |bench| bench.session.phase() == PhaseName::Holding);
    bench.load(&file);
    let journal = Journal::read(other.as_bytes()).unwrap();
    bench.session.take_up(&journal).unwrap();
    bench.until("the refusal", 20.0, |bench| !bench.errors().is_empty());
    assert_eq!(bench.session.phase(), PhaseName::Holding);
}

#[test]
fn a_pause_leads_back_to_the_same_place_over_the_bed() {
    let setup = levelled(BoardProfile::rp2040());
    let file = leaning(&file());
    let (mut whole, _) = started(&setup, &file);
    whole.job_over();
    let expected = whole.session.position().unwrap().0;
    for late in [1.0, 2.5, 4.0] {
        let (mut bench, _) = started(&setup, &file);
        bench.run(late);
        bench.ask(Request::Pause);
        bench.until("the pause", 20.0, |bench| bench.session.job_status() == JobStatus::Paused);
        let before = bench.session.position().unwrap().0;
        // By hand, the same coordinates hold.
        bench.gcode("G91\nG1 X5 Y5 Z5 F600\nG90");
        let after = bench.session.position().unwrap().0;
        for axis in 0..3 {
            assert!((after[axis] - before[axis] - 5.0).abs() < 1e-9, "{before:?} {after:?}");
        }
        // What is loaded in a pause is not the print's.
        bench.gcode("BED_MESH_CLEAR\nSET_SKEW CLEAR=1\nG1 Z30 F600");
        bench.ask(Request::Resume);
        bench.job_over();
        bench.job_done();
        let end = bench.session.position().unwrap().0;
        for axis in 0..3 {
            assert!((end[axis] - expected[axis]).abs() < 1e-9, "{end:?} {expected:?}");
        }
        assert_eq!(bench.counts()[..3], whole.counts()[..3]);
        assert!(bench.state().motors.iter().all(|motor| motor.lost.0 == 0));
    }
}

#[test]
fn a_print_that_begins_with_a_line_goes_above_the_bed_that_it_has() {
    let setup = levelled(BoardProfile::rp2040());
    let first = "G1 X60 Y60 F9000\n";
    let load = format!("{first}BED_MESH_PROFILE LOAD=cold\nSKEW_PROFILE LOAD=lean\n");
    let file = squares(3).replacen(first, &load, 1);
    let whole = {
        let mut bench = setup.ready();
        bench.print(&file);
        moves(&bench)
    };
    // The move after what was loaded leads there from where the head stood; what follows begins where a line has it.
    let loaded = 1 + file.lines().position(|line| line.starts_with("SKEW_PROFILE")).unwrap() as u32;
    let mut lines: Vec<u32> = whole.iter().map(|mv| mv.line).filter(|&line| line > loaded + 1).collect();
    lines.dedup();
    assert!(lines.len() > 15);
    for &line in lines.iter().step_by(4) {
        let mut bench = setup.ready();
        paused(&mut bench, &file, line);
        goes_on_as(&whole, &mut bench, line);
    }
}

/// A bench that waits to begin with a line makes what a whole print makes from there on.
fn goes_on_as(whole: &[ScheduledMove], bench: &mut Bench, line: u32) {
    bench.home();
    bench.ask(Request::Resume);
    bench.job_over();
    bench.job_done();
    let made = moves(bench);
    let tail = |moves: &[ScheduledMove]| -> Vec<ScheduledMove> {
        moves.iter().filter(|mv| mv.line >= line).copied().collect()
    };
    let (expected, tail) = (tail(whole), tail(&made));
    assert_eq!(tail.len(), expected.len(), "{line}");
    for (made, expected) in tail.iter().zip(&expected) {
        let near = |a: [f64; 4], b: [f64; 4]| (0..3).all(|axis| (a[axis] - b[axis]).abs() < 1e-6);
        assert!(
            near(made.from, expected.from) && near(made.to, expected.to),
            "{line}: {made:?} {expected:?}"
        );
    }
    // The way there leads above what has been printed by then, by the motors' own heights.
    let printed = whole.iter().filter(|mv| mv.line > 0 && mv.line < line && mv.to[3] > mv.from[3]);
    let top = printed.fold(0.0, |top: f64, mv| top.max(mv.to[2]).max(mv.from[2]));
    let ways = made.iter().filter(|mv| mv.line == 0);
    for way in ways.filter(|way| way.from[0] != way.to[0] || way.from[1] != way.to[1]) {
        assert!(way.from[2].min(way.to[2]) >= top + 1.9, "{line}: {way:?} {top}");
    }
}

/// After a loss of power nobody need remember what had been loaded by hand: the journal does.
#[test]
fn what_was_loaded_by_hand_is_in_force_again_where_an_interrupted_print_begins() {
    let setup = levelled(BoardProfile::rp2040());
    let file = squares(3);
    let load = "BED_MESH_PROFILE LOAD=cold\nSKEW_PROFILE LOAD=lean";
    let journaled = || JobOptions { journal: Some(9), ..JobOptions::default() };
    let mut bench = setup.ready();
    bench.gcode(load);
    bench.start_with(&file, journaled()).unwrap();
    bench.job_done();
    let (whole, mut journal) = (moves(&bench), bench.journal.clone());
    let lines: Vec<u32> = whole.iter().map(|mv| mv.line).filter(|&line| line > 8).collect();
    for line in [lines[0], lines[lines.len() / 2]] {
        // Where it was does not matter here, nor that it has come to its end.
        let began = journal.lines().next().unwrap().to_owned() + "\n";
        let config = machine::config(&setup.config, &setup.board);
        let mut survey = Survey::new(&config, Journal::read(began.as_bytes()).unwrap()).unwrap();
        for piece in file.as_bytes().chunks(100) {
            survey.feed(&piece[..piece.len().min(survey.wants())]);
            while survey.advance().unwrap() {}
        }
        survey.end();
        while survey.advance().unwrap() {}
        let found = survey.report().unwrap();
        let mut bench = setup.ready();
        let options = JobOptions { start_line: Some(line), transform: Some(found.transform), ..journaled() };
        paused_with(&mut bench, &file, options);
        goes_on_as(&whole, &mut bench, line);
        // The next interruption knows it, too.
        journal.clone_from(&bench.journal);
    }
    // Begun as it is, it has what is in force, which is nothing.
    let mut bench = setup.ready();
    paused(&mut bench, &file, lines[0]);
    bench.home();
    bench.ask(Request::Resume);
    bench.job_done();
    assert!(
        moves(&bench)
            .iter()
            .filter(|mv| mv.line > 0)
            .all(|mv| mv.to[2] == mv.from[2] || mv.to[0] == mv.from[0])
    );
    // From its beginning it gets the same, and a mesh that is gone is told.
    let with = |mesh: &str| {
        let transform = TransformRecord { mesh: Some(mesh.into()), ..TransformRecord::default() };
        JobOptions { transform: Some(transform), ..journaled() }
    };
    let mut bench = setup.ready();
    let error = bench.start_with(&file, with("warm")).unwrap_err();
    assert_eq!(error.code, ErrorCode::NoSuchProfile);
    bench.start_with(&file, with("cold")).unwrap();
    bench.job_done();
    assert!(moves(&bench).iter().any(|mv| mv.line > 8 && mv.to[2] != mv.from[2] && mv.to[0] != mv.from[0]));
}

#[test]
fn what_is_said_of_an_axis_is_what_is_told_of_it() {
    let mut bench = levelled(BoardProfile::rp2040()).ready();
    bench.gcode("BED_MESH_PROFILE LOAD=cold\nG28\nG1 X70 Y80 Z10 F6000");
    let set = |axis, mm| Request::SetPosition { axis, position: Mm(mm) };
    let told = |bench: &Bench, axis: usize| bench.session.position().unwrap().0[axis];
    // Above, in and below the fade; saying it again changes nothing.
    for z in [10.0, 3.0, 0.3] {
        for _ in 0..3 {
            bench.ask(set(2, z));
            assert!((told(&bench, 2) - z).abs() < 1e-9, "{z} {}", told(&bench, 2));
        }
    }
    // At the bed's middle, which is deep, the motor stands lower than the head over the bed.
    assert!((-0.2..-0.05).contains(&bench.session.z_lift()), "{}", bench.session.z_lift());
    // Where the motor would be below its end.
    assert_eq!(bench.request(set(2, 0.0)).unwrap_err().code, ErrorCode::MoveOutOfRange);
    bench.gcode("SKEW_PROFILE LOAD=lean");
    for (axis, mm) in [(1, 60.0), (0, 40.0), (2, 5.0)] {
        bench.ask(set(axis, mm));
        assert!((told(&bench, axis) - mm).abs() < 1e-9, "{axis} {mm} {}", told(&bench, axis));
    }
    // Of axes that lean none is known without the others.
    bench.gcode("M84");
    assert_eq!(bench.request(set(0, 40.0)).unwrap_err().code, ErrorCode::NotHomed);
}

#[test]
fn an_axis_that_is_homed_in_a_print_leaves_the_others_where_the_skew_has_them() {
    let setup = levelled(BoardProfile::rp2040());
    let file = leaning(&file()).replacen("M400\n", "G28 Y\nG1 Z2 F600\nM400\n", 1);
    let homing = 1 + file.lines().position(|line| line == "G28 Y").unwrap() as u32;
    let begun = || {
        let (mut bench, _) = started(&setup, &file);
        let homed = |event: &&Event| matches!(event, Event::Homed { axis: 1, .. });
        bench.until("homed again", 100.0, |bench| bench.events.iter().filter(homed).count() > 1);
        let from = bench.pulses().len();
        (bench, from)
    };
    let (mut whole, from) = begun();
    whole.job_over();
    whole.job_done();
    let expected = steps(&mut whole, from);
    // What goes up takes X and Y along by what it leans, and by no more.
    let made = moves(&whole);
    let up: Vec<_> = made.iter().filter(|mv| mv.line == homing + 1).collect();
    assert!(!up.is_empty());
    let by = |mv: &ScheduledMove, axis: usize| (mv.to[axis] - mv.from[axis]).abs();
    assert!(up.iter().all(|mv| by(mv, 0) < 0.02 && by(mv, 1) < 0.005), "{up:?}");
    for late in [0.3, 1.5] {
        let (mut bench, from) = begun();
        bench.run(late);
        die(&mut bench, &setup, 0.2);
        take_up(&mut bench, &file);
        bench.ask(Request::Resume);
        bench.job_over();
        bench.job_done();
        assert!(steps(&mut bench, from) == expected, "{late}");
    }
}
