//! Jobs that end as they should, and what happens on the way.

use std::fmt::Write;

use gcode::Heater;
use printer::session::{Event, JobOptions, JobStatus, Request, ScheduledMove};
use units::Celsius;

use crate::bench::{Bench, Pulse, Setup};

/// A job with everything that jobs begin with; the nozzle gets warm, not hot.
pub(crate) const START: &str = "M140 S35\nM104 S70\nG28\nM190 S35\nM109 S70\nM83\nG92 E0\n";
/// What jobs end with.
pub(crate) const END: &str = "M104 S0\nM140 S0\nM107\nM84\n";

/// Squares, one upon the other: 8 lines each.
pub(crate) fn squares(count: usize) -> String {
    let mut file = String::from(START);
    for layer in 0..count {
        let z = 1.0 + 0.2 * layer as f64;
        let square =
            "G1 X60 Y60 F9000\nG1 X90 E1 F2400\nG1 Y90 E1\nG1 X60 E1\nG1 Y60 E1\nG1 E-1 F1800\nG1 E1\n";
        write!(file, "G1 Z{z:.1} F600\n{square}").unwrap();
    }
    file + END
}

/// Many lines.
fn lines(count: u32, line: impl Fn(u32) -> String) -> String {
    (0..count).map(line).collect()
}

/// The moves as they were told, less those that home.
fn moves(bench: &Bench) -> Vec<ScheduledMove> {
    let made = |event: &Event| match event {
        Event::Move(made) if !made.homing => Some(*made),
        _ => None,
    };
    bench.events.iter().filter_map(made).collect()
}

/// Prints on a machine of its own and gives what was counted.
pub(crate) fn print_alone(file: &str) -> (Vec<i64>, Vec<Pulse>) {
    let mut bench = Setup::default().ready();
    bench.print(file);
    bench.job_done();
    (bench.counts(), bench.relative_pulses(0))
}

#[test]
fn a_job_is_printed_and_leaves_the_machine_as_the_file_says() {
    let mut bench = Setup::default().ready();
    bench.print(&squares(3));
    bench.job_done();
    bench.run(0.5);
    let state = bench.state();
    assert!(state.motors.iter().all(|motor| motor.lost.0 == 0));
    assert!(state.motors[..3].iter().all(|motor| !motor.energised));
    assert_eq!(bench.session.position().unwrap().1, [false; 3]);
    bench.assert_all_off();
    let lines: Vec<u32> = moves(&bench).iter().map(|made| made.line).collect();
    // Where a square ends the next one begins: two lines go nowhere.
    assert!(lines.is_sorted() && lines.len() == 3 * 8 - 2, "{lines:?}");
}

#[test]
fn a_hot_end_that_stays_hot_by_intent_is_confirmed() {
    let mut bench = Setup::default().ready();
    let options = JobOptions { confirmed_lines: [9].into(), ..JobOptions::default() };
    bench.start_with(&format!("{START}G1 X20 F6000\nG1 X30 E1\n"), options).unwrap();
    bench.job_over();
    bench.job_done();
    bench.run(20.0);
    assert!(bench.celsius(0) > 60.0, "{}", bench.celsius(0));
}

#[test]
fn two_jobs_one_after_the_other_make_the_same_pulses() {
    let mut bench = Setup::default().ready();
    let file = squares(1).replace("M84\n", "G1 X0 Y150 Z0.5 F6000\n");
    bench.print(&file);
    bench.job_done();
    let first = bench.pulses().len();
    bench.print(&format!("SET_VELOCITY_LIMIT ACCEL=300\n{file}"));
    let second = bench.pulses().len();
    // The limits of the job before are gone.
    bench.print(&file);
    bench.job_done();
    let printed = |pulses: &[Pulse]| -> Vec<Pulse> {
        let start = pulses.iter().position(|pulse| pulse.1 == 3).unwrap();
        let from = pulses[start].0;
        pulses[start..].iter().map(|&(at, motor, way)| (at - from, motor, way)).collect()
    };
    let pulses = bench.pulses();
    assert!(printed(&pulses[..first]) == printed(&pulses[second..]));
    assert!(printed(&pulses[..first]) != printed(&pulses[first..second]));
}

#[test]
fn dwells_waits_and_outputs_come_at_their_print_time() {
    let mut bench = Setup::default().ready();
    bench.home();
    let file = "G1 X100 F1200\nM106 S255\nG1 X60\nG4 P1500\nM107\nG1 X50\nM400\nM117 here\nG1 X0\nM104 S0\n";
    bench.start(file);
    // The clocks of the fan's edges, as the machine sees them.
    let mut edges = Vec::new();
    while bench.session.job_status() != JobStatus::None {
        bench.run(0.01);
        let is_on = bench.state().fans[0].duty > 0.5;
        if is_on != (edges.len() % 2 == 1) {
            edges.push(bench.printer.now().0);
        }
    }
    bench.job_done();
    let made = moves(&bench);
    let [to_100, to_60, to_50, to_0] = made[..] else { panic!("{made:?}") };
    let tick = bench.printer.profile().clock.0 as f64;
    let apart = |a: u64, b: u64| (a as f64 - b as f64) / tick;
    assert_eq!(edges.len(), 2);
    assert!(apart(edges[0], to_100.end.0).abs() < 0.03, "{}", apart(edges[0], to_100.end.0));
    let dwell = apart(to_50.start.0, to_60.end.0);
    assert!((dwell - 1.5).abs() < 1e-3, "{dwell}");
    assert!(apart(edges[1], to_50.start.0).abs() < 0.03, "{}", apart(edges[1], to_50.start.0));
    // Between M400 and what follows the machine is at rest, and the message comes then.
    let ends: Vec<u64> = bench.events.iter().filter_map(run_end).collect();
    assert!(ends.contains(&to_50.end.0) && to_0.start > to_50.end);
}

#[test]
fn the_speed_of_each_move_adds_up_to_its_length_and_goes_on_in_the_next() {
    let mut bench = Setup::default().ready();
    let travel = lines(40, |n| format!("G1 X{} Y{} E0.3 F{}\n", 60 + n % 7, 60 + n % 5, 1200 + 60 * n));
    bench.print(
        &(squares(2).replace(END, "") + &travel + "G4 P500\nG1 X60 Y60\nG2 X60 Y60 I10 J0 E2\n" + END),
    );
    bench.job_done();
    let freq = f64::from(bench.printer.profile().clock.0);
    let mut before: Option<ScheduledMove> = None;
    let mut turned = 0;
    for made in moves(&bench) {
        let speed = made.speed;
        let corners = [
            (made.start.0, speed.start.0),
            (speed.cruise_from.0, speed.cruise.0),
            (speed.cruise_until.0, speed.cruise.0),
            (made.end.0, speed.end.0),
        ];
        let driven: f64 =
            corners.windows(2).map(|w| (w[1].0 - w[0].0) as f64 / freq * 0.5 * (w[0].1 + w[1].1)).sum();
        let way: [f64; 3] = core::array::from_fn(|axis| made.to[axis] - made.from[axis]);
        let straight = way.iter().map(|d| d * d).sum::<f64>().sqrt();
        // The pieces of the circle around X70 Y60 are as long as the circle is.
        let is_round = |at: [f64; 4]| (libm::hypot(at[0] - 70.0, at[1] - 60.0) - 10.0).abs() < 1e-6;
        let bends = is_round(made.from) && is_round(made.to) && made.from[2] == made.to[2] && straight < 2.0;
        let length = if bends { 20.0 * libm::asin(straight / 20.0) } else { straight };
        // Each corner's clock is rounded to a tick.
        let rounding = 4.0 * speed.cruise.0 / freq;
        assert!((driven - length).abs() <= rounding, "{made:?}: {driven} mm of {length} mm");
        let entry = before.filter(|last| last.end == made.start).map_or(0.0, |last| last.speed.end.0);
        assert!((speed.start.0 - entry).abs() < 1e-9, "{made:?} after {entry} mm/s");
        turned += u32::from(entry > 0.0);
        before = Some(made);
    }
    assert_eq!(before.unwrap().speed.end.0, 0.0);
    assert!(turned > 40, "{turned} corners were passed at speed");
}

fn run_end(event: &Event) -> Option<u64> {
    if let Event::RunEnded { at } = event { Some(at.0) } else { None }
}

#[test]
fn a_long_dwell_does_not_keep_a_job_from_being_cancelled() {
    let mut bench = Setup::default().ready();
    bench.home();
    bench.start("G1 X10 F3000\nG4 S600\nG1 X20\n");
    bench.run(10.0);
    bench.ask(Request::Cancel);
    bench.run(1.0);
    assert_eq!(bench.session.job_status(), JobStatus::None);
    bench.assert_position(10.0, 150.0, 0.5);
}

#[test]
fn a_target_that_changes_on_the_way_takes_effect_on_the_way() {
    let mut bench = Setup::default().ready();
    let mut file = format!("{START}G1 X10 F6000\nM104 S90\n");
    for _ in 0..20 {
        file += "G1 X100 E1 F1200\nG1 X10 E1\n";
    }
    bench.start(&(file + END));
    bench.line(20);
    let targets: Vec<f64> = bench
        .events
        .iter()
        .filter_map(|event| match event {
            Event::Temperature { heater: Heater::Tool(0), target, .. } => Some(target.0),
            _ => None,
        })
        .collect();
    assert!(targets.contains(&70.0) && targets.last() == Some(&90.0));
    bench.job_over();
    bench.job_done();
    bench.assert_all_off();
}

#[test]
fn inches_offsets_and_relative_moves_end_where_they_should() {
    let mut bench = Setup::default().ready();
    bench
        .print("G28\nG1 X10 Y100 F6000\nG92 X0 Y0\nG1 X5 Y5\nG91\nG1 X5 Y5\nG90\nG20\nG1 X1\nG21\nG1 Y-20\n");
    bench.job_done();
    bench.assert_position(10.0 + 25.4, 80.0, 0.5);
}

#[test]
fn faster_and_thicker_takes_effect_in_the_middle() {
    let file = {
        let body: String = (0..12).map(|_| "G1 X100 E2 F1200\nG1 X10 E2\n").collect();
        format!("{START}G1 X10 F6000\n{body}{END}")
    };
    let plain = {
        let mut bench = Setup::default().ready();
        bench.print(&file);
        bench.job_done();
        (moves(&bench), bench.counts())
    };
    let mut bench = Setup::default().ready();
    bench.start(&file);
    bench.line(12);
    bench.ask(Request::SetSpeedFactor(2.0));
    bench.ask(Request::SetFlowFactor(1.5));
    bench.job_over();
    bench.job_done();
    let changed = moves(&bench);
    let length = |moves: &[ScheduledMove]| moves.last().unwrap().end.0 - moves[0].start.0;
    assert!(length(&changed) < length(&plain.0) * 9 / 10);
    let counts = bench.counts();
    assert_eq!(counts[..3], plain.1[..3]);
    assert!(counts[3] > plain.1[3] * 11 / 10 && counts[3] < plain.1[3] * 3 / 2);
    // Nonsense changes nothing.
    bench.ask(Request::SetSpeedFactor(f64::NAN));
    assert_eq!(bench.session.factors(), [2.0, 1.5]);
}

#[test]
fn factors_are_those_of_the_lines_that_were_read() {
    let mut bench = Setup::default().ready();
    bench.gcode("M220 S50");
    assert_eq!(bench.session.factors(), [0.5, 1.0]);
    // A job begins with its own.
    bench.start(&format!("{START}M220 S80\nM221 S95\nG1 X10 F6000\nG1 X100 E1 F600\n{END}"));
    assert_eq!(bench.session.factors(), [1.0, 1.0]);
    bench.line(10);
    assert_eq!(bench.session.factors(), [0.8, 0.95]);
    bench.job_over();
    bench.job_done();
    assert_eq!(bench.session.factors(), [0.5, 1.0]);
}

#[test]
fn a_job_that_is_fed_late_comes_to_rest_on_its_path_and_goes_on() {
    let (expected, _) = print_alone(&squares(3));
    let mut bench = Setup::default().ready();
    // In the middle of a line of the second square.
    bench.feed_max = squares(3).match_indices("G1 Y90").nth(1).unwrap().0 + 4;
    bench.start(&squares(3));
    bench.line(14);
    bench.run(10.0);
    let (resting, state) = (bench.pulses().len(), bench.state());
    bench.run(2.0);
    assert_eq!(bench.pulses().len(), resting);
    assert!(state.motors.iter().all(|motor| motor.lost.0 == 0));
    assert_eq!(bench.session.job_status(), JobStatus::Printing);
    bench.feed_max = usize::MAX;
    bench.job_over();
    bench.job_done();
    assert_eq!(bench.counts(), expected);
    assert!(bench.state().motors.iter().all(|motor| motor.lost.0 == 0));
}

#[test]
fn while_a_job_runs_other_orders_are_refused_and_heaters_can_be_set() {
    let mut bench = Setup::default().ready();
    bench.start(&squares(2));
    bench.line(10);
    let busy = printer::error::ErrorCode::BusyPrinting;
    assert_eq!(bench.request(Request::Gcode("G1 X0".into())).unwrap_err().code, busy);
    assert_eq!(bench.start_with("G28\n", JobOptions::default()).unwrap_err().code, busy);
    assert_eq!(bench.request(Request::Resume).unwrap_err().code, printer::error::ErrorCode::NoJob);
    bench.ask(Request::SetTemperature(Heater::Tool(0), Celsius(80.0)));
    bench.ask(Request::SetFan(1.0));
    bench.run(6.0);
    assert!(bench.state().fans[0].speed > 0.5);
}

#[test]
fn nobody_who_takes_events_is_no_harm() {
    let mut bench = Setup::default().ready();
    bench.home();
    let comments = lines(40_000, |n| format!(";TYPE:Perimeter\n;Z:{n}\n"));
    bench.print(&format!("G1 X10 F6000\n{comments}G1 X20\n"));
    bench.job_done();
}

#[test]
fn a_file_full_of_fan_orders_neither_floods_the_board_nor_hangs() {
    let mut bench = Setup::default().ready();
    bench.home();
    let orders = lines(5000, |n| format!("M106 S{}\n", n % 256));
    bench.print(&format!("M104 S50\n{orders}G1 X10 F6000\n{orders}M106 S255\nG1 X20\nM104 S0\n"));
    bench.job_done();
    bench.run(1.0);
    assert!(bench.state().fans[0].duty > 0.95);
    assert_eq!(bench.state().shutdown, None);
}
