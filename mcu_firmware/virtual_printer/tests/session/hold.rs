//! The motion clock with real motors on it: nothing is lost when it slows down, stops and goes on, or the host is gone.

use units::{StepCount, Ticks};
use virtual_printer::{BoardProfile, EdgeLog, State};
use wire::{Command, Response, dictionary::Dictionary, messages::CommandKind};

use crate::host::{Host, machine};
use crate::motion::{configure, home, queue_ramp, queue_start};

/// 300 mm/s.
const SPEED: f64 = 24_000.0;
const CRUISE: u16 = 9000;
/// With both ramps of the plan.
const STEPS: i64 = 9000 + 2 * 1800;
const RAMP_S: f64 = 0.3;

fn ramp_ticks(host: &Host<impl virtual_printer::Recorder>, seconds: f64) -> u32 {
    (f64::from(host.printer.profile().clock.0) * seconds) as u32
}

/// Holds the run `after` seconds from its start, with a ramp, and goes on: what came of it.
fn hold_and_go_on(after: f64, ramp_s: f64) -> State {
    let mut host = Host::usual("", ());
    configure(&mut host);
    let start = host.after(0.2);
    queue_ramp(&mut host, start, true, SPEED, CRUISE);
    host.run(0.2 + after);
    let ramp = ramp_ticks(&host, ramp_s);
    host.send(&[Command::MotionHold { ramp }]);
    host.run(ramp_s + 0.1);
    let held = host.state();
    host.run(0.5);
    let later = host.state();
    assert_eq!(held.motors[0].count, later.motors[0].count, "held");
    host.send(&[Command::MotionResume { ramp }]);
    host.run(1.5);
    host.state()
}

#[test]
fn a_hold_at_full_speed_loses_no_step() {
    for after in [0.01, 0.05, 0.1, 0.14, 0.15, 0.2, 0.3, 0.4, 0.5, 0.55] {
        let state = hold_and_go_on(after, RAMP_S);
        let x = &state.motors[0];
        assert_eq!((x.count, x.lost, state.shutdown), (StepCount(STEPS), StepCount(0), None), "{after} s");
    }
}

/// The queue ends at full speed because the host is late.
fn starve(covers: bool) -> (State, Ticks) {
    let mut host = Host::usual("", ());
    configure(&mut host);
    let start = host.after(0.2);
    let end = queue_start(&mut host, start, true, SPEED, CRUISE);
    if covers {
        let (covered, alive) = (end.low().0, host.after(5.0).low().0);
        let ramp = ramp_ticks(&host, RAMP_S);
        host.send(&[Command::MotionLease { covered, alive, ramp }]);
    }
    host.run(2.0);
    let state = host.state();
    host.send(&[Command::MotionGetState {}]);
    host.run(0.1);
    let motion = host.all(|response| match response {
        Response::MotionState { motion, .. } => Some(motion),
        _ => None,
    });
    let now = motion.last().expect("a state");
    (state, Ticks(end.low().0.wrapping_sub(*now).into()))
}

#[test]
fn a_starved_queue_costs_steps_unless_it_is_leased() {
    let (state, _) = starve(false);
    assert_ne!(state.motors[0].lost, StepCount(0), "motors stopped dead at 300 mm/s");
    let (state, left) = starve(true);
    let x = &state.motors[0];
    assert_eq!(x.lost, StepCount(0));
    assert!(left < Ticks(600), "{left:?} of the queue's time left");
    assert!((STEPS - 1802..=STEPS - 1800).contains(&x.count.0), "{:?}", x.count);
}

#[test]
fn when_the_host_is_gone_the_head_rests_on_its_path() {
    for alive_s in [0.25, 0.31, 0.4, 0.6] {
        let mut host = Host::usual("", EdgeLog::new(100_000));
        configure(&mut host);
        let start = host.after(0.2);
        queue_ramp(&mut host, start, true, SPEED, CRUISE);
        let (alive, covered) = (host.after(alive_s), host.after(10.0));
        let ramp = ramp_ticks(&host, RAMP_S);
        host.send(&[Command::MotionLease { covered: covered.low().0, alive: alive.low().0, ramp }]);
        host.run(3.0);
        let states = host.all(|response| match response {
            Response::MotionState { state, reason, .. } => Some((state, reason)),
            _ => None,
        });
        assert_eq!(states.last(), Some(&(2, 2)));
        let rest = Ticks(alive.0 + u64::from(ramp) + 600_000);
        let x = host.state().motors.remove(0);
        assert_eq!(x.lost, StepCount(0));
        assert!(x.count.0 < STEPS, "{:?}", x.count);
        assert!(host.printer.recorder().steps(0).all(|step| step.0 <= rest));
        // A host again: it vouches for what is queued, and the run ends where it was to.
        let alive = host.after(10.0).low().0;
        host.send(&[
            Command::MotionLease { covered: covered.low().0, alive, ramp },
            Command::MotionEnd { clock: covered.low().0 },
            Command::MotionResume { ramp },
        ]);
        host.run(2.0);
        let x = host.state().motors.remove(0);
        assert_eq!((x.count, x.lost), (StepCount(STEPS), StepCount(0)));
    }
}

#[test]
fn with_plain_firmware_the_pulses_are_the_same() {
    let run = |profile: BoardProfile| {
        let mut host = Host::new(profile, &machine(), "", EdgeLog::new(100_000));
        configure(&mut host);
        let homed = home(&mut host);
        (homed, host.printer.into_recorder().edges().to_vec())
    };
    let plain = run(BoardProfile::rp2040().plain());
    assert!(plain.1.len() > 3000);
    assert!(plain == run(BoardProfile::rp2040()));
}

#[test]
fn a_plain_board_says_so_and_stops_at_what_it_does_not_know() {
    let dictionary =
        |profile: BoardProfile| Dictionary::parse(&profile.description().compressed()).expect("a dictionary");
    let plain = BoardProfile::rp2040().plain();
    assert!(dictionary(BoardProfile::rp2040()).supports(CommandKind::MotionHold));
    assert!(!dictionary(plain.clone()).supports(CommandKind::MotionHold));
    let mut host = Host::new(plain, &machine(), "", ());
    configure(&mut host);
    host.send(&[Command::MotionHold { ramp: 1000 }]);
    host.run(0.1);
    assert!(host.state().shutdown.is_some());
}
