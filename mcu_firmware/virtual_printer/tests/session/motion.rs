//! Steps on the pins, homing, and the machine's answer to them.

use crate::host::{Host, STEP_MM, machine};
use units::{StepCount, Ticks};
use virtual_printer::{BoardProfile, EdgeKind, EdgeLog, Recorder};
use wire::{Command, Response};

const PULSE: u32 = 24;

/// Object 0 is X, 1 its enable pin, 2 its trigger, 3 its endstop; 4 is E, 5 its enable pin.
pub(crate) fn configure<R: Recorder>(host: &mut Host<R>) {
    let stepper = |oid, step_pin, dir_pin| Command::ConfigStepper {
        oid,
        step_pin,
        dir_pin,
        invert_step: 0,
        step_pulse_ticks: PULSE,
    };
    let enable =
        |oid, pin| Command::ConfigDigitalOut { oid, pin, value: 1, default_value: 1, max_duration: 0 };
    host.send(&[
        Command::AllocateOids { count: 6 },
        stepper(0, 2, 3),
        enable(1, 4),
        Command::ConfigTrsync { oid: 2 },
        Command::ConfigEndstop { oid: 3, pin: 5, pull_up: 1 },
        stepper(4, 14, 15),
        enable(5, 16),
        Command::FinalizeConfig { crc: 1 },
        Command::UpdateDigitalOut { oid: 1, value: 0 },
        Command::UpdateDigitalOut { oid: 5, value: 0 },
    ]);
    host.run(0.1);
    assert_eq!(host.state().shutdown, None);
}

/// Intervals and counts from rest up to `speed` steps/s.
fn ramp_rows(clock: f64, speed: f64) -> Vec<(u32, u16)> {
    let accel = 160_000.0;
    let ramp = (speed * speed / (2.0 * accel)) as u16;
    // Rows of ten steps with intervals that follow the square root, the way any planner's do.
    let mut rows = Vec::new();
    let mut done = 0_u16;
    let mut last = 0.0;
    while done < ramp {
        let count = 10.min(ramp - done);
        let until = (2.0 * f64::from(done + count) / accel).sqrt();
        rows.push((((until - last) / f64::from(count) * clock) as u32, count));
        last = until;
        done += count;
    }
    rows
}

/// Queues a run of X from rest: up to `speed` steps/s and down again.
pub(crate) fn queue_ramp<R: Recorder>(
    host: &mut Host<R>,
    start: Ticks,
    forward: bool,
    speed: f64,
    cruise: u16,
) {
    queue_start(host, start, forward, speed, cruise);
    let clock = f64::from(host.printer.profile().clock.0);
    for (interval, count) in ramp_rows(clock, speed).into_iter().rev() {
        host.send(&[Command::QueueStep { oid: 0, interval, count, add: 0 }]);
    }
}

/// The same without the end; gives the clock of its last step.
pub(crate) fn queue_start<R: Recorder>(
    host: &mut Host<R>,
    start: Ticks,
    forward: bool,
    speed: f64,
    cruise: u16,
) -> Ticks {
    let clock = f64::from(host.printer.profile().clock.0);
    host.send(&[
        Command::ResetStepClock { oid: 0, clock: start.low().0 },
        Command::SetNextStepDir { oid: 0, dir: u8::from(forward) },
    ]);
    let mut rows = ramp_rows(clock, speed);
    rows.push(((clock / speed) as u32, cruise));
    let mut end = start;
    for (interval, count) in rows {
        host.send(&[Command::QueueStep { oid: 0, interval, count, add: 0 }]);
        end += Ticks(u64::from(interval) * u64::from(count));
    }
    end
}

#[test]
fn the_recorder_sees_exact_clocks_across_a_wrap() {
    for profile in [BoardProfile::rp2040(), BoardProfile::stm32f103()] {
        let mut machine = machine();
        if profile.name == "stm32f103" {
            // Same numbers, other names.
            machine = renamed(machine);
        }
        let mut host = Host::new(profile, &machine, "", EdgeLog::new(10_000));
        configure(&mut host);
        let wrap = Ticks(1 << 32);
        let start = Ticks(wrap.0 - 100_000);
        host.run_to(Ticks(start.0 - 3_000_000));
        host.send(&[
            Command::ResetStepClock { oid: 0, clock: start.low().0 },
            Command::SetNextStepDir { oid: 0, dir: 1 },
            Command::QueueStep { oid: 0, interval: 5000, count: 30, add: -20 },
            Command::SetNextStepDir { oid: 0, dir: 0 },
            Command::QueueStep { oid: 0, interval: 4000, count: 25, add: 100 },
        ]);
        host.run_to(wrap + Ticks(3_000_000));
        assert_eq!(host.state().shutdown, None);

        let mut expected = Vec::new();
        let mut clock = start.0;
        let mut count = 0;
        for (interval, steps, add, way) in [(5000_i64, 30, -20, 1), (4000, 25, 100, -1)] {
            let mut interval = interval;
            for _ in 0..steps {
                clock = clock.wrapping_add_signed(interval);
                count += way;
                expected.push((Ticks(clock), count));
                interval += add;
            }
        }
        let log = host.printer.recorder();
        assert_eq!(log.steps(0).collect::<Vec<_>>(), expected);
        assert!(expected[0].0 < wrap && expected[54].0 > wrap, "the test crosses the wrap");
        let ends = log.edges().iter().filter(|edge| edge.kind == EdgeKind::StepEnd).map(|edge| edge.at);
        let expected_ends: Vec<_> = expected.iter().map(|step| step.0 + Ticks(PULSE.into())).collect();
        assert_eq!(ends.collect::<Vec<_>>(), expected_ends);
        let turns = log.edges().iter().filter(|edge| matches!(edge.kind, EdgeKind::Direction { .. }));
        let turns: Vec<_> = turns.map(|edge| edge.at).collect();
        assert_eq!(turns.len(), 2);
        assert!(turns[0] < expected[0].0 && turns[1] > expected[29].0 && turns[1] < expected[30].0);
    }
}

fn renamed(mut machine: virtual_printer::Machine) -> virtual_printer::Machine {
    let rename = |pin: &mut String| {
        let number: u8 = pin.trim_start_matches("gpio").parse().expect("a pin");
        *pin = if number < 16 { format!("PA{number}") } else { format!("PB{}", number - 16) };
    };
    for motor in &mut machine.motors {
        rename(&mut motor.step.pin);
        rename(&mut motor.dir.pin);
        rename(&mut motor.enable.as_mut().expect("an enable pin").pin);
    }
    for endstop in &mut machine.endstops {
        rename(&mut endstop.wire.pin);
    }
    // The sensor's pin has no converter here.
    machine.heaters.clear();
    machine.fans.clear();
    machine
}

#[test]
fn a_sane_move_arrives_and_a_mad_one_loses_steps() {
    let mut host = Host::usual("", ());
    configure(&mut host);
    let start = host.after(0.2);
    queue_ramp(&mut host, start, true, 8000.0, 4000);
    host.run(1.5);
    let x = host.state().motors.remove(0);
    assert_eq!((x.count, x.lost), (StepCount(4400), StepCount(0)));
    assert!((x.position.0 - 20.0 - 4400.0 * STEP_MM).abs() < 0.02, "{}", x.position);
    // From rest to 600 mm/s at once.
    let start = host.after(0.2);
    host.send(&[
        Command::ResetStepClock { oid: 0, clock: start.low().0 },
        Command::QueueStep { oid: 0, interval: 250, count: 8000, add: 0 },
    ]);
    host.run(1.5);
    let x = host.state().motors.remove(0);
    assert_eq!(x.count, StepCount(12_400), "every pulse came");
    assert!(x.lost.0 > 1000, "{:?}", x.lost);
    assert!(x.position.0 < 120.0, "{}", x.position);
}

#[test]
fn without_current_the_carriage_stays() {
    let mut host = Host::usual("", ());
    configure(&mut host);
    host.send(&[Command::UpdateDigitalOut { oid: 1, value: 1 }]);
    host.run(0.1);
    let start = host.after(0.2);
    queue_ramp(&mut host, start, true, 4000.0, 1000);
    host.run(1.0);
    let x = host.state().motors.remove(0);
    assert!(!x.energised);
    assert_eq!(x.position.0, 20.0);
}

/// Moves X towards its endstop with the board watching it; gives what the trigger reported: reason and steps.
pub(crate) fn home<R: Recorder>(host: &mut Host<R>) -> (u8, i32) {
    let start = host.after(0.2);
    host.send(&[
        Command::TrsyncStart {
            oid: 2,
            report_clock: start.low().0,
            report_ticks: 1_200_000,
            expire_reason: 4,
        },
        Command::StepperStopOnTrigger { oid: 0, trsync_oid: 2 },
        Command::TrsyncSetTimeout { oid: 2, clock: (start + Ticks(12_000_000)).low().0 },
        Command::EndstopHome {
            oid: 3,
            clock: start.low().0,
            sample_ticks: 180,
            sample_count: 4,
            rest_ticks: 3000,
            pin_value: 1,
            trsync_oid: 2,
            trigger_reason: 1,
        },
    ]);
    queue_ramp(host, start, false, 4000.0, 3000);
    host.run(1.6);
    host.send(&[Command::StepperGetPosition { oid: 0 }]);
    host.run(0.1);
    let reasons = host.all(|response| match response {
        Response::TrsyncState { can_trigger: 0, trigger_reason, .. } => Some(trigger_reason),
        _ => None,
    });
    let positions = host.all(|response| match response {
        Response::StepperPosition { pos, .. } => Some(pos),
        _ => None,
    });
    (*reasons.last().expect("a report"), *positions.last().expect("a position"))
}

#[test]
fn homing_stops_where_the_switch_closes() {
    let mut host = Host::usual("", ());
    configure(&mut host);
    let (reason, position) = home(&mut host);
    assert_eq!(reason, 1);
    // 20 mm at 50 mm/s; the switch is found within the time of its samples, and the rotor lags a little.
    assert!((-1640..=-1598).contains(&position), "{position}");
    let state = host.state();
    assert!(state.endstops[0].triggered);
    assert_eq!(state.motors[0].lost, StepCount(0));
    assert_eq!(state.motors[0].count, StepCount(position.into()));
}

#[test]
fn an_endstop_stuck_on_stops_at_once_and_one_stuck_off_hits_the_frame() {
    let mut host = Host::usual("endstop-stuck-on=x", ());
    configure(&mut host);
    let (reason, position) = home(&mut host);
    assert_eq!(reason, 1);
    assert!(position.abs() < 10, "{position}");

    let mut host = Host::usual("endstop-stuck-off=x", ());
    configure(&mut host);
    let (reason, _) = home(&mut host);
    assert_eq!(reason, 4, "the time ran out");
    let x = host.state().motors.remove(0);
    assert!(x.position.0 >= -3.0 && x.position.0 < 1.0, "{}", x.position);
    assert!(x.lost.0 != 0);
}

#[test]
fn a_run_does_not_depend_on_how_time_is_cut() {
    let run = |piece: f64| {
        let mut host = Host::usual("delay=0.02", EdgeLog::new(20_000));
        configure(&mut host);
        let start = Ticks(host.printer.start().0 + 6_000_000);
        queue_ramp(&mut host, start, false, 4000.0, 2600);
        let end = host.since_start(2.0);
        while host.printer.now() < end {
            let until = host.after(piece).min(end);
            host.run_to(until);
            host.state();
        }
        (host.state(), host.printer.into_recorder().edges().to_vec())
    };
    let whole = run(10.0);
    assert!(whole.1.len() > 5000);
    assert_eq!(whole, run(0.000_317));
}
