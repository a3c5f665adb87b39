//! The session as the page sees it, against the virtual printer.

use super::*;
use crate::{Simulation, messages::PhaseLabel};
use printer::{config::parse, session::SpeedProfile};

fn machine() -> PrinterConfig {
    parse(demo_machine::USUAL_MACHINE).0.unwrap()
}

/// Lets a host and a printer run until a time, or until an event is seen.
fn run(host: &mut Host, printer: &mut Simulation, until: f64, seen: impl Fn(&UiEvent) -> bool) -> bool {
    let (mut to_board, mut to_host) = (Vec::new(), Vec::new());
    while printer.now().0 < until {
        let now = printer.now();
        let wake = host.poll(now, &mut to_board);
        printer.write(&to_board);
        to_board.clear();
        if host.take_events().iter().any(&seen) {
            return true;
        }
        printer.run_until(wake.max(now + Seconds(50e-6)).min(Seconds(until)), &mut to_host);
        host.receive(&to_host, printer.now());
        to_host.clear();
    }
    false
}

#[test]
fn a_snapshot_follows_the_machine() {
    let mut printer = Simulation::new(machine(), None, 1, "").unwrap();
    let mut host = Host::new(machine(), printer.now());
    let before = host.snapshot(printer.now());
    assert_eq!((before.phase, before.board, before.live_mm), (PhaseLabel::Identifying, None, None));
    let ready = |event: &UiEvent| *event == UiEvent::Phase { phase: PhaseLabel::Ready };
    assert!(run(&mut host, &mut printer, 20.0, ready));
    host.request(UiRequest::Home { axes: Vec::new() }, printer.now()).unwrap();
    assert!(run(&mut host, &mut printer, 120.0, |event| matches!(event, UiEvent::Homed { axis: 2, .. })));
    let settled = printer.now().0 + 3.0;
    run(&mut host, &mut printer, settled, |_| false);
    host.take_moves(printer.now());

    let text = "G90\nG1 X100 Y50 F600".to_owned();
    host.request(UiRequest::Gcode { text }, printer.now()).unwrap();
    host.request(UiRequest::SetFan { speed: 0.5 }, printer.now()).unwrap();
    host.request(UiRequest::SetSpeedFactor { factor: 0.8 }, printer.now()).unwrap();
    let halfway = printer.now().0 + 5.0;
    run(&mut host, &mut printer, halfway, |_| false);
    let now = printer.now();
    let snapshot = host.snapshot(now);
    let (live, end) = (snapshot.live_mm.unwrap(), snapshot.position_mm.unwrap());
    assert!((end[0] - 100.0).abs() < 1e-9 && (end[1] - 50.0).abs() < 1e-9);
    assert!(live[0] > 10.0 && live[0] < 90.0, "{live:?}");
    assert!((live[0] - 2.0 * live[1]).abs() < 1e-6, "{live:?}");
    let truly = printer.state();
    assert!((truly.motors[0].position_mm - live[0]).abs() < 1.0, "{live:?} {truly:?}");
    assert_eq!((snapshot.homed, snapshot.speed_factor), ([true; 3], 0.8));
    assert!((snapshot.fan - 0.5).abs() < 0.01);
    assert!(snapshot.link.unwrap().received_bytes > 1000);
    assert_eq!(snapshot.temperatures.len(), 2);

    let moves = host.take_moves(now);
    let speeds = host.planned_speed(now, Seconds(6.0), Seconds(20.0));
    let pairs: Vec<[f64; 2]> = speeds.chunks(2).map(|pair| [pair[0], pair[1]]).collect();
    let at = |time: f64| pairs.iter().position(|pair| pair[0] > time).map(|next| pairs[next - 1][1]);
    assert!((at(0.0).unwrap() - 8.0).abs() < 0.01, "{pairs:?}");
    assert_eq!((pairs[0], pairs[pairs.len() - 1]), ([-6.0, 0.0], [20.0, 0.0]));
    let driven: f64 = pairs.windows(2).map(|w| (w[1][0] - w[0][0]) * 0.5 * (w[0][1] + w[1][1])).sum();
    assert!((driven - (100.0_f64 * 100.0 + 50.0 * 50.0).sqrt()).abs() < 1e-3, "{driven}");

    assert_eq!(moves.len(), MOVE_NUMBERS);
    let (start, stop) = (moves[1], moves[2]);
    assert!(start < now.0 && now.0 < stop && stop - start > 11.0, "{moves:?}");
    assert_eq!(moves[7..9], [100.0, 50.0]);
    assert_eq!(host.take_moves(now), Vec::<f64>::new());

    host.request(UiRequest::EmergencyStop, now).unwrap();
    let stopped = host.snapshot(now);
    assert_eq!((stopped.phase, stopped.live_mm), (PhaseLabel::Shutdown, None));
    assert!(stopped.error.is_some());
    assert!(host.planned_speed(now, Seconds(6.0), Seconds(20.0)).is_empty());
}

/// The head is told of in the G-code's coordinates on its way over a bed that is not flat, as it is where it rests.
#[test]
fn where_the_head_is_has_one_meaning() {
    const BED: &str = "\n[bed_mesh]\n[bed_mesh hill]\npoints:\n  0.1, 0.2, 0.3\n  0.2, 0.5, 0.4\n  0.3, 0.4, 0.5\n\
        x_count: 3\ny_count: 3\nmin_x: 0\nmax_x: 300\nmin_y: 0\nmax_y: 300\n";
    let machine = || parse(&format!("{}{BED}", demo_machine::USUAL_MACHINE)).0.unwrap();
    let mut printer = Simulation::new(machine(), None, 1, "").unwrap();
    let mut host = Host::new(machine(), printer.now());
    let ready = |event: &UiEvent| *event == UiEvent::Phase { phase: PhaseLabel::Ready };
    assert!(run(&mut host, &mut printer, 20.0, ready));
    let text = "G28\nBED_MESH_PROFILE LOAD=hill\nG90\nG1 X20 Y20 Z2 F6000".to_owned();
    host.request(UiRequest::Gcode { text }, printer.now()).unwrap();
    assert!(run(&mut host, &mut printer, 120.0, |event| matches!(event, UiEvent::Homed { axis: 2, .. })));
    let settled = printer.now().0 + 5.0;
    run(&mut host, &mut printer, settled, |_| false);
    host.request(UiRequest::Gcode { text: "G1 X220 Y180 F1200".to_owned() }, printer.now()).unwrap();
    let (mut is_on_the_way, mut highest) = (0, 0.0_f64);
    for _ in 0..16 {
        let later = printer.now().0 + 1.0;
        run(&mut host, &mut printer, later, |_| false);
        let snapshot = host.snapshot(printer.now());
        let [x, _, z, _] = snapshot.live_mm.unwrap();
        assert!((z - 2.0).abs() < 0.005, "Z {z} at X {x}");
        is_on_the_way += u32::from(x > 25.0 && x < 215.0);
        // The motor stands elsewhere.
        highest = highest.max(printer.state().motors[2].position_mm);
    }
    assert!(is_on_the_way > 5 && highest > 2.3, "{is_on_the_way} {highest}");
}

#[test]
fn what_nobody_takes_is_bounded_and_counted() {
    let mut host = Host::new(machine(), Seconds(0.0));
    assert_eq!(host.events.len(), 0);
    host.events.extend((0..EVENTS_MAX + 9).map(|_| UiEvent::Paused));
    host.sort_events();
    let events = host.take_events();
    assert_eq!(events.len(), EVENTS_MAX + 1);
    // The session's own first event is among those that stay.
    assert_eq!(events.last(), Some(&UiEvent::Dropped { count: 10 }));
    assert_eq!(host.take_events(), []);
    for _ in 0..MOVES_MAX + 9 {
        let (still, speed) = ([0.0; 4], SpeedProfile::default());
        let (start, end) = (Ticks(0), Ticks(1));
        let mv = ScheduledMove { line: 1, start, end, from: still, to: still, speed, homing: false };
        host.remember(&Event::Move(mv));
    }
    assert_eq!((host.moves.len(), host.ahead.len()), (MOVES_MAX, MOVES_MAX));
}

#[test]
fn the_least_motion_queued_tells_of_a_host_that_was_held_up() {
    let file = "G90\nM83\nG28\n".to_owned() + &"G1 X20 Y20 F3000\nG1 X80 Y20\n".repeat(30);
    for held_up_s in [0.0, 1.5] {
        let mut printer = Simulation::new(machine(), None, 1, "").unwrap();
        let mut host = Host::new(machine(), printer.now());
        let ready = |event: &UiEvent| *event == UiEvent::Phase { phase: PhaseLabel::Ready };
        assert!(run(&mut host, &mut printer, 20.0, ready));
        host.start_job(JobOptions::default(), printer.now()).unwrap();
        host.job_feed(file.as_bytes());
        host.job_end();
        assert_eq!(host.snapshot(printer.now()).job.queued_least_s, None);
        assert!(run(&mut host, &mut printer, 300.0, |event| {
            matches!(event, UiEvent::Progress { line, .. } if *line > 20)
        }));
        let (until, mut to_host) = (printer.now() + Seconds(held_up_s), Vec::new());
        while printer.now() < until {
            printer.run_until(until, &mut to_host);
        }
        host.receive(&to_host, printer.now());
        assert!(run(&mut host, &mut printer, 300.0, |event| *event == UiEvent::JobDone));
        let least = host.snapshot(printer.now()).job.queued_least_s.unwrap();
        // Held up for longer, it would find its motion held. Ten seconds are kept, and looked after twenty times a second.
        let expected = 9.9 - held_up_s;
        assert!((least - expected).abs() < 0.5, "held up for {held_up_s} s: {least} s were left");
    }
}
