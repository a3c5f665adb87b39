//! The motion clock slows down, stops and goes on: whatever happens to it, the same edges come in the same order at the
//! same motion clocks, and pulses keep their width.

use proptest::prelude::*;
use units::Clock32;
use wire::{Command, Response};

use crate::bench::{Bench, PULSE, SECOND, steps};

pub(crate) const PULSE_TICKS: u64 = PULSE as u64;
/// Steppers 0 to 2 on pins 0 to 5.
pub(crate) const STEPPERS: u8 = 3;

pub(crate) const RUNNING: u8 = 0;
pub(crate) const SLOWING: u8 = 1;
pub(crate) const HELD: u8 = 2;
pub(crate) const SPEEDING: u8 = 3;

/// What `motion_state` says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MotionState {
    pub(crate) clock: u32,
    pub(crate) motion: u32,
    pub(crate) rate: u16,
    pub(crate) state: u8,
    pub(crate) reason: u8,
}

pub(crate) fn motion_states(bench: &mut Bench) -> Vec<MotionState> {
    bench.pick(|response| match *response {
        Response::MotionState { clock, motion, rate, state, reason } => {
            Some(MotionState { clock, motion, rate, state, reason })
        }
        _ => None,
    })
}

/// The state now; what was said before is dropped.
pub(crate) fn motion_state(bench: &mut Bench) -> MotionState {
    bench.board.sent.clear();
    bench.send(&Command::MotionGetState {});
    motion_states(bench)[0]
}

pub(crate) fn motion_bench(now: u64, more: &[Command<'_>]) -> Bench {
    let stepper = |oid| Command::ConfigStepper {
        oid,
        step_pin: 2 * oid,
        dir_pin: 2 * oid + 1,
        invert_step: 0,
        step_pulse_ticks: PULSE,
    };
    let mut config: Vec<Command<'_>> = (0..STEPPERS).map(stepper).collect();
    config.extend(more);
    let mut bench = Bench::configured(now, &config);
    for oid in 0..STEPPERS {
        bench.send(&Command::ResetStepClock { oid, clock: now as u32 });
    }
    bench
}

/// An edge with the motion clock at which it came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Seen {
    pub(crate) pin: u8,
    pub(crate) level: bool,
    pub(crate) at: u64,
    pub(crate) motion: u32,
}

/// Runs as [`Bench::run_until`] does and reads the motion clock at every edge.
pub(crate) fn watch_until(bench: &mut Bench, until: u64, seen: &mut Vec<Seen>) {
    bench.board.edges.clear();
    loop {
        let next = bench.firmware.run_timers(&mut bench.board);
        bench.firmware.run_tasks(&mut bench.board);
        if !bench.board.edges.is_empty() {
            let motion = motion_state(bench).motion;
            let edges = std::mem::take(&mut bench.board.edges);
            seen.extend(edges.iter().map(|edge| Seen {
                pin: edge.pin,
                level: edge.level,
                at: edge.at,
                motion,
            }));
        }
        let next = units::Ticks(bench.board.now).nearest(next).0;
        assert!(next > bench.board.now, "a timer that was due did not run");
        if next > until {
            bench.board.now = bench.board.now.max(until);
            return;
        }
        bench.board.now = next;
    }
}

type Row = (u32, u16, i16, bool);

/// Rows whose steps are far enough apart for pulses and turns to keep their motion clocks.
fn rows() -> impl Strategy<Value = Vec<Row>> {
    let row = (80_u32..20_000, 1_u16..30, -300_i16..300, any::<bool>());
    let is_sound = |row: &Row| {
        i64::from(row.0) + i64::from(row.2) * i64::from(row.1 - 1) >= 80
            && row.0 as i64 - i64::from(row.2) > 0
    };
    prop::collection::vec(row.prop_filter("too close", is_sound), 1..12)
}

/// Where each edge of a stepper belongs: pin, level and motion clock.
fn planned(oid: u8, start: u64, rows: &[Row]) -> Vec<(u8, bool, u32)> {
    let (mut edges, mut clock, mut forward) = (vec![], start, false);
    for &(interval, count, add, way) in rows {
        let mut interval = i64::from(interval);
        for _ in 0..count {
            clock += interval as u64;
            interval += i64::from(add);
            if way != forward {
                forward = way;
                edges.push((2 * oid + 1, way, (clock - PULSE_TICKS) as u32));
            }
            edges.push((2 * oid, true, clock as u32));
        }
    }
    edges
}

#[derive(Clone, Copy, Debug)]
enum Act {
    Hold(u32),
    Resume(u32),
    Rate(u16, u32),
    /// Renewals of a lease that never runs out.
    Lease,
}

fn act() -> impl Strategy<Value = Act> {
    let ramp = || prop_oneof![Just(0), 1_u32..200_000, 1_u32..4_000_000];
    prop_oneof![
        ramp().prop_map(Act::Hold),
        ramp().prop_map(Act::Resume),
        (256_u16..=4096, ramp()).prop_map(|(rate, ramp)| Act::Rate(rate, ramp)),
        Just(Act::Lease),
    ]
}

fn do_act(bench: &mut Bench, act: Act) {
    let now = bench.board.now as u32;
    let command = match act {
        Act::Hold(ramp) => Command::MotionHold { ramp },
        Act::Resume(ramp) => Command::MotionResume { ramp },
        Act::Rate(rate, ramp) => Command::MotionRate { rate, ramp },
        Act::Lease => Command::MotionLease {
            covered: motion_state(bench).motion.wrapping_add(1 << 30),
            alive: now.wrapping_add(1 << 30),
            ramp: 3_600_000,
        },
    };
    bench.send(&command);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn holds_neither_lose_nor_move_an_edge(
        before_wrap in 0_u64..3_000_000,
        lead in 60_000_u64..200_000,
        tables in [rows(), rows(), rows()],
        acts in prop::collection::vec((0_u64..1_500_000, act()), 0..12),
    ) {
        let start = (1 << 32) - before_wrap;
        let mut bench = motion_bench(start, &[]);
        for (oid, rows) in (0..).zip(&tables) {
            bench.send(&steps(oid, lead as u32, 1, 0));
            for &(interval, count, add, forward) in rows {
                bench.send_all(&[
                    Command::SetNextStepDir { oid, dir: forward.into() },
                    steps(oid, interval, count, add),
                ]);
            }
        }
        let mut seen = Vec::new();
        for (pause, act) in acts {
            let until = bench.board.now + pause;
            watch_until(&mut bench, until, &mut seen);
            do_act(&mut bench, act);
        }
        bench.send_all(&[
            Command::MotionRate { rate: 4096, ramp: 0 },
            Command::MotionResume { ramp: 100_000 },
        ]);
        let until = bench.board.now + 8 * SECOND;
        watch_until(&mut bench, until, &mut seen);
        prop_assert_eq!(bench.shutdown(), None);
        prop_assert_eq!(motion_state(&mut bench).rate, 4096);
        for (oid, rows) in (0..).zip(&tables) {
            let (step, dir) = (2 * oid, 2 * oid + 1);
            let mut rows = rows.clone();
            rows.insert(0, (lead as u32, 1, 0, false));
            let edges = seen.iter().filter(|edge| edge.pin == dir || (edge.pin == step && edge.level));
            let edges: Vec<_> = edges.map(|edge| (edge.pin, edge.level, edge.motion)).collect();
            prop_assert_eq!(edges, planned(oid, start, &rows));
            let times = |level| seen.iter().filter(move |edge| edge.pin == step && edge.level == level);
            let widths: Vec<_> = times(true).zip(times(false)).map(|(rise, fall)| fall.at - rise.at).collect();
            prop_assert!(widths.iter().all(|&width| width == PULSE_TICKS), "{:?}", widths);
            prop_assert_eq!(times(true).count(), times(false).count());
        }
        // Nothing is nearer in hardware ticks than in motion ticks.
        for pair in seen.windows(2) {
            let apart = Clock32(pair[1].motion).since(Clock32(pair[0].motion));
            prop_assert!(apart >= 0 && pair[1].at - pair[0].at >= apart as u64);
        }
    }

    #[test]
    fn random_leases_rest_within_what_they_cover(
        before_wrap in 0_u64..3_000_000,
        ramps in prop::collection::vec(1_u32..3_000_000, 2),
        rate in 256_u16..=4096,
        covered in 0_u32..6_000_000,
        acts in prop::collection::vec((0_u64..900_000, act()), 0..8),
    ) {
        let start = (1 << 32) - before_wrap;
        let mut bench = motion_bench(start, &[]);
        bench.send(&Command::MotionRate { rate, ramp: ramps[1] });
        bench.run_for(5_000_000);
        let lease = |bench: &mut Bench, covered| {
            let alive = (bench.board.now as u32).wrapping_add(1 << 30);
            bench.send(&Command::MotionLease { covered, alive, ramp: ramps[0] });
        };
        let at = motion_state(&mut bench).motion;
        // Enough to come to rest from where it is, and a little.
        let limit = at.wrapping_add(ramps[0] / 2 + 40_000 + covered);
        lease(&mut bench, limit);
        for (pause, act) in acts {
            bench.run_for(pause);
            if !matches!(act, Act::Lease) {
                do_act(&mut bench, act);
            }
        }
        let mut left = Clock32(limit).since(Clock32(motion_state(&mut bench).motion));
        prop_assert!(left >= 0);
        for _ in 0..3 {
            bench.send(&Command::MotionResume { ramp: ramps[1] });
            bench.run_for(20 * SECOND);
            left = Clock32(limit).since(Clock32(motion_state(&mut bench).motion));
            prop_assert!(left >= 0, "{} ticks beyond", -left);
        }
        let state = motion_state(&mut bench);
        prop_assert_eq!((state.state, state.rate, state.reason), (HELD, 0, 3));
        prop_assert_eq!(bench.shutdown(), None);
    }
}
