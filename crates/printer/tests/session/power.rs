//! The power goes in the middle of a print, and comes back: the board knows nothing, the motors stand elsewhere.

use printer::{
    error::ErrorCode,
    interruption::{Interruption, Survey},
    journal::Journal,
    session::{Event, JobOptions, JobStatus, PhaseName, Request, ScheduledMove},
};
use units::{Celsius, Mm};

use crate::{
    bench::{Bench, Setup},
    machine,
    print::squares,
};

/// The power is gone for so long, in s: everything is cold then.
const GONE_S: f64 = 200.0;
const EXTRUDER: usize = 3;

/// A machine whose power goes when a print is so old, in s since power-up, and has come back.
fn interrupted(file: &str, at: f64) -> Bench {
    let setup = Setup::faults(&format!("power-loss={GONE_S}@{at}"));
    let mut bench = setup.ready();
    bench.start_with(file, JobOptions { journal: Some(9), ..JobOptions::default() }).unwrap();
    bench.until("the loss", 600.0, |bench| bench.session.phase() == PhaseName::Failed);
    let error = bench.error();
    assert_eq!(error.code, ErrorCode::LinkLost);
    bench.run(GONE_S);
    let state = bench.state();
    assert!(state.motors.iter().all(|motor| !motor.energised), "{state:?}");
    bench.replace_session(&setup.config);
    bench.connect();
    bench
}

/// What journal and file say, and what was really so.
fn survey(bench: &Bench, file: &str) -> Interruption {
    let config = machine::config(&Setup::default().config, bench.printer.profile());
    let mut survey = Survey::new(&config, Journal::read(bench.journal.as_bytes()).unwrap()).unwrap();
    for piece in file.as_bytes().chunks(100) {
        if survey.wants() > 0 {
            survey.feed(piece);
        }
        while survey.advance().unwrap() {}
    }
    survey.end();
    while survey.advance().unwrap() {}
    survey.report().unwrap()
}

/// When the print is at each line, in s since power-up.
fn ages(file: &str) -> Vec<(u32, f64)> {
    let mut bench = Setup::default().ready();
    bench.start(file);
    let mut ages: Vec<(u32, f64)> = Vec::new();
    bench.until("the end", 600.0, |bench| {
        let told = bench.events.iter().rev().find_map(|event| match event {
            Event::Progress { line, .. } => Some(*line),
            _ => None,
        });
        if let Some(line) = told.filter(|&line| ages.last().is_none_or(|last| last.0 < line)) {
            ages.push((line, bench.age()));
        }
        bench.session.job_status() == JobStatus::None
    });
    ages
}

fn start(bench: &mut Bench, file: &str, line: u32) {
    bench.journal.clear();
    bench
        .start_with(file, JobOptions { start_line: Some(line), journal: Some(10), ..JobOptions::default() })
        .unwrap();
    bench.until("the line", 20.0, |bench| bench.session.job_status() == JobStatus::Paused);
}

/// How far the load of Z is from where the session has it.
fn z_off(bench: &mut Bench) -> f64 {
    let (position, _) = bench.session.position().unwrap();
    bench.state().motors[2].position.0 - position[2]
}

fn moves(events: &[Event]) -> Vec<ScheduledMove> {
    let made = |event: &Event| match event {
        Event::Move(made) => Some(*made),
        _ => None,
    };
    events.iter().filter_map(made).collect()
}

#[test]
fn a_print_goes_on_above_what_it_had_made() {
    let file = squares(4);
    let ages = ages(&file);
    let (first, last) = (ages[3].1, ages[ages.len() - 4].1);
    for part in 0..6 {
        let at = first + (last - first) * (f64::from(part) + 0.37) / 6.0;
        let mut bench = interrupted(&file, at);
        let found = survey(&bench, &file);
        // Progress is told from time to time: it was somewhere between two lines.
        let before = ages.iter().rfind(|(_, age)| *age <= at).unwrap().0;
        let behind = ages.iter().find(|(_, age)| *age > at).unwrap().0;
        assert!(found.line < behind && found.reach_line >= before, "{found:?}, at {before} to {behind}");
        // The last progress is little more than a second old: two lines of three quarters each.
        assert!(found.line + 6 >= before, "{found:?}, at {before}");
        let truth = bench.state().motors[2].position.0;
        let range = found.z_range.unwrap();
        assert!(truth > range[0].0 - 0.1 && truth < range[1].0 + 0.1, "{truth} {found:?}");

        start(&mut bench, &file, found.start_line);
        assert_eq!(bench.session.pending_start().unwrap().line, found.start_line);
        assert_eq!(bench.request(Request::Resume).unwrap_err().code, ErrorCode::NotHomed);
        // The motor gets current with the first step; then it is where one of the places has it.
        let places = &found.standings.places;
        bench.ask(Request::SetPosition { axis: 2, position: places[0] });
        bench.gcode("G91\nG1 Z1 F600\nG90");
        let off = z_off(&mut bench);
        let place = places.iter().find(|place| (place.0 - places[0].0 - off).abs() < 0.02);
        let place = place.unwrap_or_else(|| panic!("{off} from the first of {places:?}"));
        bench.ask(Request::SetPosition { axis: 2, position: Mm(place.0 + 1.0) });
        let from = bench.events.len();
        bench.ask(Request::Resume);
        bench.job_done();
        bench.assert_all_off();
        assert!(z_off(&mut bench).abs() < 0.02);

        // Up, home, beside the part, prime, across, down.
        let ways = moves(&bench.events[from..]);
        let ways: Vec<&ScheduledMove> = ways.iter().take_while(|mv| mv.line == 0).collect();
        // Nothing need have been extruded yet at that height.
        let clear = found.position[2].0 - 0.2 + 1.9;
        for way in ways.iter().filter(|way| way.from[..2] != way.to[..2]) {
            assert!(way.from[2].min(way.to[2]) >= clear, "{way:?} below {clear}");
        }
        let primes = ways.iter().position(|way| way.to[EXTRUDER] > way.from[EXTRUDER] + 5.0).unwrap();
        let [x, y, ..] = ways[primes].to;
        assert!(!(50.0..100.0).contains(&x) || !(50.0..100.0).contains(&y), "primes at {x} {y}");
        assert!(ways[..primes].iter().any(|way| way.homing));
        // The filament is left as the lines before have left it.
        let pushed: f64 =
            ways.iter().filter(|way| !way.homing).map(|way| way.to[EXTRUDER] - way.from[EXTRUDER]).sum();
        let pushed_back = [8.0, 7.0];
        assert!(pushed_back.iter().any(|wanted| (pushed - wanted).abs() < 1e-6), "{pushed}");
        let homed: Vec<usize> = bench.events[from..]
            .iter()
            .filter_map(|event| match event {
                Event::Homed { axis, .. } => Some(*axis),
                _ => None,
            })
            .collect();
        assert_eq!(homed, [0, 1]);
    }
}

/// By its own clock the host has made the rest of the queue long before it misses the board.
#[test]
fn a_print_is_over_only_when_the_board_has_lived_to_make_it() {
    let file = squares(2);
    let last = ages(&file).last().unwrap().1;
    let bench = interrupted(&file, last - 0.5);
    assert!(!Journal::read(bench.journal.as_bytes()).unwrap().has_ended);
}

#[test]
fn what_is_switched_off_on_the_way_is_asked_about() {
    let file = squares(2);
    let mut bench = Setup::default().ready();
    start(&mut bench, &file, 20);
    // What it is going to be heated to is told before anything is heated.
    let targets = |bench: &Bench| bench.session.pending_start().unwrap().targets;
    assert_eq!(targets(&bench), [Celsius(70.0), Celsius(35.0)]);
    bench.ask(Request::SetTemperature(gcode::Heater::Bed, Celsius(40.0)));
    assert_eq!(targets(&bench), [Celsius(70.0), Celsius(40.0)]);
    bench.ask(Request::SetPosition { axis: 2, position: Mm(40.0) });
    bench.ask(Request::Resume);
    bench.until("homing", 60.0, |bench| bench.celsius(0) > 62.0);
    // The user changes their mind: nothing is primed cold, and everything is off.
    bench.ask(Request::Cancel);
    bench.job_over();
    assert!(bench.events.contains(&Event::JobCancelled));
    bench.assert_all_off();
}
