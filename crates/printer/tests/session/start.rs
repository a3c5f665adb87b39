//! Jobs that begin in the middle of their file, after the power was gone or because the user wants it.

use gcode::Heater;
use printer::{
    error::ErrorCode,
    journal::Journal,
    session::{Event, JobOptions, JobStatus, PhaseName, Request, ScheduledMove},
};
use units::{Celsius, Mm};

use crate::{
    bench::{Bench, Setup},
    print::squares,
};

fn at_line(line: u32) -> JobOptions {
    JobOptions { start_line: Some(line), journal: Some(77), ..JobOptions::default() }
}

/// The file's own moves.
fn moves(bench: &Bench) -> Vec<ScheduledMove> {
    let made = |event: &Event| match event {
        Event::Move(made) if !made.homing => Some(*made),
        _ => None,
    };
    bench.events.iter().filter_map(made).collect()
}

#[track_caller]
pub(crate) fn paused(bench: &mut Bench, file: &str, line: u32) {
    paused_with(bench, file, at_line(line));
}

#[track_caller]
pub(crate) fn paused_with(bench: &mut Bench, file: &str, options: JobOptions) {
    bench.start_with(file, options).unwrap();
    bench.until("the line", 20.0, |bench| bench.session.job_status() == JobStatus::Paused);
}

/// Lines that extrude, and all that set something before them.
#[test]
fn it_goes_on_as_if_the_lines_before_had_been_made() {
    let file = squares(3);
    let file =
        file.replace("G1 Z1.2 F600\n", "G1 Z1.2 F600\nM106 S128\nM204 S700\nM221 S90\nG92 X61 E5\nG1 X61\n");
    let whole = {
        let mut bench = Setup::default().ready();
        bench.print(&file);
        moves(&bench)
    };
    let lines: Vec<u32> = whole.iter().map(|mv| mv.line).filter(|&line| line > 0).collect();
    for &line in lines.iter().step_by(3).skip(1) {
        let mut bench = Setup::default().ready();
        paused(&mut bench, &file, line);
        assert_eq!(bench.pulses().len(), 0);
        bench.home();
        bench.ask(Request::Resume);
        bench.job_over();
        bench.job_done();
        let made = moves(&bench);
        let tail = |moves: &[ScheduledMove]| -> Vec<(u32, [f64; 3], [f64; 3], f64)> {
            let of = |mv: &ScheduledMove| {
                let at = |p: [f64; 4]| [p[0], p[1], p[2]];
                (mv.line, at(mv.from), at(mv.to), mv.to[3] - mv.from[3])
            };
            moves.iter().filter(|mv| mv.line >= line).map(of).collect()
        };
        let (expected, made_tail) = (tail(&whole), tail(&made));
        assert_eq!(made_tail.len(), expected.len(), "{line}");
        for (made, expected) in made_tail.iter().zip(&expected) {
            let near = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
            assert!(
                made.0 == expected.0
                    && near(made.1, expected.1)
                    && near(made.2, expected.2)
                    && (made.3 - expected.3).abs() < 1e-9,
                "{line}: {made:?} instead of {expected:?}"
            );
        }
        // Nothing moves across below what has been printed by then, but for the last way down.
        let top = whole
            .iter()
            .filter(|mv| mv.line > 0 && mv.line < line && mv.to[3] > mv.from[3])
            .fold(0.0, |top: f64, mv| top.max(mv.to[2]));
        let ways = made.iter().filter(|mv| mv.line == 0);
        for way in ways.filter(|way| way.from[0] != way.to[0] || way.from[1] != way.to[1]) {
            assert!(way.from[2].min(way.to[2]) >= top + 1.9, "{line}: {way:?}");
        }
        assert!(bench.state().motors.iter().all(|motor| motor.lost.0 == 0));
    }
}

#[test]
fn after_a_loss_of_power_the_user_says_where_z_is() {
    let file = squares(3);
    let mut bench = Setup::default().ready();
    bench.start(&file);
    bench.line(24);
    bench.ask(Request::EmergencyStop);
    bench.ask(Request::FirmwareRestart);
    bench.connect();
    bench.events.clear();
    assert_eq!(bench.session.position().unwrap().1, [false; 3]);
    paused(&mut bench, &file, 24);
    // Nothing is homed: no way leads there.
    let error = bench.request(Request::Resume).unwrap_err();
    assert_eq!(error.code, ErrorCode::NotHomed);
    let set = |axis, mm| Request::SetPosition { axis, position: Mm(mm) };
    for (axis, mm) in [(2, 101.0), (2, -0.1), (2, f64::NAN), (3, 0.0), (9, 0.0)] {
        assert_eq!(bench.request(set(axis, mm)).unwrap_err().code, ErrorCode::MoveOutOfRange);
    }
    bench.ask(set(2, 1.4));
    bench.gcode("G91\nG1 Z5 F600\nG90\nG28 X Y");
    assert_eq!(bench.session.position().unwrap().1, [true; 3]);
    bench.ask(Request::Resume);
    bench.until("heat", 60.0, |bench| bench.celsius(0) > 65.0);
    bench.job_over();
    bench.job_done();
    bench.assert_all_off();
    // Only at rest is there anything to be said.
    bench.home();
    bench.ask(Request::Gcode("G1 X100 F600".into()));
    bench.run(2.0);
    assert_eq!(bench.request(set(2, 1.0)).unwrap_err().code, ErrorCode::BusyPrinting);
}

#[test]
fn its_host_may_die_too() {
    let file = squares(3);
    let play = |dies: bool| {
        let setup = Setup::default();
        let mut bench = setup.ready();
        paused(&mut bench, &file, 17);
        bench.home();
        let from = bench.pulses().len();
        bench.ask(Request::Resume);
        bench.line(18);
        assert!(bench.pulses().len() > from);
        if dies {
            bench.stalled = true;
            bench.run(20.0);
            bench.stalled = false;
            bench.replace_session(&setup.config);
            bench.until("the held print", 20.0, |bench| bench.session.phase() == PhaseName::Holding);
            let journal = Journal::read(bench.journal.as_bytes()).unwrap();
            bench.load(&file);
            bench.session.take_up(&journal).unwrap();
            bench.until("the plan", 20.0, |bench| bench.session.job_status() == JobStatus::Held);
            bench.ask(Request::Resume);
        }
        bench.job_over();
        bench.job_done();
        bench.counts()
    };
    assert_eq!(play(true), play(false));
}

#[test]
fn a_line_that_there_is_not_is_said() {
    let mut bench = Setup::default().ready();
    bench.start_with(&squares(1), at_line(9999)).unwrap();
    bench.job_over();
    bench.failed(ErrorCode::InvalidGcode, None);
    bench.assert_all_off();
    // One that can be cancelled while it is read, and while it waits.
    paused(&mut bench, &squares(1), 12);
    bench.ask(Request::SetTemperature(Heater::Tool(0), Celsius(50.0)));
    bench.ask(Request::Cancel);
    bench.job_over();
    bench.assert_all_off();
    // The first line is where every job begins.
    bench.events.clear();
    bench.start_with(&squares(1), at_line(1)).unwrap();
    bench.job_over();
    bench.job_done();
}
