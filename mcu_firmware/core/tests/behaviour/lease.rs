//! Who slows motion down and who starts it again: the host, and its lease when it runs out.

use wire::{Command, Response, ShutdownReason};

use crate::{
    bench::{Bench, MILLISECOND, SECOND, steps},
    hold::{
        HELD, MotionState, RUNNING, SLOWING, SPEEDING, Seen, motion_bench, motion_state, motion_states,
        watch_until,
    },
};

const RAMP: u32 = 3_600_000;
/// Of the ramp's 256 slices, one: what a ramp may begin late by.
const SLICE: u64 = RAMP as u64 / 256;
const INTERVAL: u32 = 500;
const HOST: u8 = 1;
const ALIVE: u8 = 2;
const COVERED: u8 = 3;

/// Stepper 0 makes `count` steps of [`INTERVAL`], from the start on.
fn moving(start: u64, count: u32) -> Bench {
    let mut bench = motion_bench(start, &[]);
    let mut left = count;
    while left > 0 {
        let now = left.min(1000) as u16;
        bench.send(&steps(0, INTERVAL, now, 0));
        left -= u32::from(now);
    }
    bench
}

fn lease(bench: &mut Bench, covered: u64, alive: u64) {
    bench.send(&Command::MotionLease { covered: covered as u32, alive: alive as u32, ramp: RAMP });
}

fn rises(seen: &[Seen]) -> Vec<u64> {
    seen.iter().filter(|edge| edge.pin == 0 && edge.level).map(|edge| edge.at).collect()
}

fn states(bench: &mut Bench) -> Vec<(u8, u8)> {
    let mut states: Vec<_> = motion_states(bench).iter().map(|state| (state.state, state.reason)).collect();
    states.dedup();
    states
}

#[test]
fn a_hold_slows_evenly_and_rests_after_half_the_ramp() {
    for start in [0, (1 << 32) - 2 * SECOND] {
        let mut bench = moving(start, 60_000);
        let mut seen = Vec::new();
        let held_at = start + SECOND;
        watch_until(&mut bench, held_at, &mut seen);
        let before = seen.len();
        bench.send(&Command::MotionHold { ramp: RAMP });
        watch_until(&mut bench, held_at + 2 * SECOND, &mut seen);
        let state = motion_state(&mut bench);
        assert_eq!((state.state, state.reason, state.rate), (HELD, HOST, 0));
        let slices = u64::from(RAMP.div_ceil(256)) * 256;
        assert_eq!(state.motion, (held_at + slices / 2) as u32);
        // Where an even deceleration would be at each step: never further from it than its slices are long.
        let (mut last, mut farthest) = (held_at, 0.0_f64);
        for edge in &seen[before..] {
            assert!(edge.at - held_at <= slices, "moves after the ramp");
            let (t, ramp) = ((edge.at - held_at) as f64, slices as f64);
            let motion = f64::from(edge.motion.wrapping_sub(held_at as u32));
            farthest = farthest.max((motion - (t - t * t / (2.0 * ramp))).abs());
            last = edge.at;
        }
        // A slice's rate is the mean of the ramp's: at most an eighth of a slice's change apart, and a tick.
        assert!(farthest <= SLICE as f64 / 256.0 / 8.0 + 2.0, "{farthest} ticks");
        assert!(last > held_at + slices / 2);
    }
}

#[test]
fn all_changes_are_told_and_a_held_clock_four_times_a_second() {
    let mut bench = moving(0, 60_000);
    bench.run_until(SECOND);
    assert_eq!(motion_states(&mut bench), [], "a plain host hears nothing of it");
    bench.send(&Command::MotionHold { ramp: RAMP });
    bench.run_for(RAMP.into());
    bench.run_for(SLICE);
    assert_eq!(states(&mut bench), [(SLOWING, HOST), (HELD, HOST)]);
    bench.run_for(10 * SECOND);
    assert!((39..=41).contains(&motion_states(&mut bench).len()));
    bench.send(&Command::MotionResume { ramp: RAMP });
    bench.run_for(SECOND);
    assert_eq!(states(&mut bench), [(SPEEDING, 0), (RUNNING, 0)]);
    bench.run_for(10 * SECOND);
    assert_eq!(motion_states(&mut bench), [], "and then no more");
    bench.send(&Command::MotionRate { rate: 2048, ramp: RAMP });
    bench.run_for(SECOND);
    let state = motion_state(&mut bench);
    assert_eq!((state.state, state.rate), (RUNNING, 2048));
}

#[test]
fn holds_and_resumes_turn_ramps_round() {
    let mut bench = moving(0, 60_000);
    bench.run_until(SECOND);
    bench.send(&Command::MotionHold { ramp: RAMP });
    bench.run_for(u64::from(RAMP) / 4);
    let slowest = motion_state(&mut bench);
    assert!((3000..3200).contains(&slowest.rate), "{slowest:?}");
    bench.send(&Command::MotionResume { ramp: RAMP });
    bench.run_for(u64::from(RAMP) / 8);
    assert_eq!(motion_state(&mut bench).state, SPEEDING);
    bench.send_all(&[Command::MotionHold { ramp: RAMP }, Command::MotionHold { ramp: RAMP }]);
    bench.run_for(SLICE + 1);
    let turned = motion_state(&mut bench);
    assert!(turned.state == SLOWING && turned.rate > slowest.rate && turned.rate < 4096, "{turned:?}");
    bench.run_for(u64::from(RAMP));
    assert_eq!(motion_state(&mut bench).state, HELD);
    bench.send_all(&[Command::MotionResume { ramp: RAMP }, Command::MotionResume { ramp: RAMP }]);
    bench.run_for(20 * SECOND);
    assert_eq!(bench.position(0), -60_000);
    assert_eq!(bench.shutdown(), None);
}

#[test]
fn without_its_host_motion_rests_within_the_ramp_and_stays() {
    let mut bench = moving(0, 120_000);
    lease(&mut bench, 120_000 * 500, 2 * SECOND);
    let mut seen = Vec::new();
    watch_until(&mut bench, 2 * SECOND - 1, &mut seen);
    assert_eq!(motion_state(&mut bench).state, RUNNING);
    watch_until(&mut bench, 20 * SECOND, &mut seen);
    let state = motion_state(&mut bench);
    assert_eq!((state.state, state.reason), (HELD, ALIVE));
    assert!(rises(&seen).last().expect("steps") <= &(2 * SECOND + u64::from(RAMP) + SLICE));
    // The host that comes back has to renew first: what it does not vouch for does not move.
    bench.send(&Command::MotionResume { ramp: RAMP });
    bench.run_for(SECOND);
    assert_eq!(motion_state(&mut bench).state, HELD);
    let alive = bench.board.now + 10 * SECOND;
    lease(&mut bench, 120_000 * 500, alive);
    bench.run_for(SECOND);
    assert_eq!(motion_state(&mut bench).state, HELD, "a renewal starts nothing");
    bench.send_all(&[Command::MotionResume { ramp: RAMP }, Command::MotionEnd { clock: 120_000 * 500 }]);
    bench.run_for(10 * SECOND);
    assert_eq!(bench.position(0), -120_000);
    assert_eq!(bench.shutdown(), None);
}

#[test]
fn a_renewal_while_slowing_does_not_stop_the_hold_but_allows_to_resume() {
    let mut bench = moving(0, 120_000);
    lease(&mut bench, 120_000 * 500, SECOND);
    bench.run_until(SECOND + u64::from(RAMP) / 2);
    lease(&mut bench, 120_000 * 500, 40 * SECOND);
    let state = motion_state(&mut bench);
    assert_eq!((state.state, state.reason), (SLOWING, ALIVE));
    bench.send(&Command::MotionResume { ramp: RAMP });
    bench.run_for(2 * SLICE);
    assert_eq!(motion_state(&mut bench).state, SPEEDING);
}

#[test]
fn renewals_change_no_pulse() {
    let run = |renewals: bool| {
        let mut bench = moving((1 << 32) - SECOND, 120_000);
        bench.send(&steps(1, 30_000, 300, -7));
        for _ in 0..70 {
            if renewals {
                let now = bench.board.now;
                lease(&mut bench, now + SECOND, now + SECOND / 2);
            }
            bench.run_for(SECOND / 7 + 13);
        }
        (bench.board.edges.clone(), motion_state(&mut bench).state)
    };
    let with = run(true);
    assert_eq!(with.1, RUNNING);
    assert!(with.0.len() > 230_000);
    assert!(with == run(false));
}

#[test]
fn an_almost_empty_queue_rests_before_its_end() {
    let mut bench = moving(0, 24_000);
    let covered = 24_000 * 500_u64;
    // Renewed to the end of the queue, which the host is late to fill.
    lease(&mut bench, covered, 100 * SECOND);
    let mut seen = Vec::new();
    watch_until(&mut bench, 5 * SECOND, &mut seen);
    let state = motion_state(&mut bench);
    assert_eq!((state.state, state.reason), (HELD, COVERED));
    let short = covered - u64::from(state.motion);
    assert!(short < 600, "rests {short} ticks before");
    let made = rises(&seen).len();
    assert!((23_998..=24_000).contains(&made), "{made}");
    // More comes: it goes on where it was.
    bench.send_all(&[steps(0, INTERVAL, 24_000, 0)]);
    bench.send(&Command::MotionResume { ramp: RAMP });
    watch_until(&mut bench, 5 * SECOND + MILLISECOND, &mut seen);
    assert_eq!(motion_state(&mut bench).state, HELD, "not covered yet");
    lease(&mut bench, 2 * covered, 100 * SECOND);
    bench.send_all(&[Command::MotionEnd { clock: 2 * covered as u32 }, Command::MotionResume { ramp: RAMP }]);
    watch_until(&mut bench, 20 * SECOND, &mut seen);
    let planned: Vec<u32> = (1..=48_000).map(|step| step * INTERVAL).collect();
    let made: Vec<u32> =
        seen.iter().filter(|edge| edge.pin == 0 && edge.level).map(|edge| edge.motion).collect();
    assert!(made == planned);
}

#[test]
fn where_the_queue_ends_at_rest_the_lease_ends() {
    let mut bench = moving(0, 24_000);
    lease(&mut bench, SECOND, 2 * SECOND);
    bench.send(&Command::MotionEnd { clock: SECOND as u32 });
    bench.run_for(10 * SECOND);
    let state = motion_state(&mut bench);
    assert_eq!((state.state, state.reason, state.clock), (RUNNING, 0, state.motion));
    assert_eq!(bench.position(0), -24_000);
}

#[test]
fn a_stop_is_a_stop_and_a_reset_makes_the_clocks_one() {
    let mut bench = moving(0, 60_000);
    bench.run_until(SECOND);
    bench.send(&Command::MotionHold { ramp: RAMP });
    bench.run_for(u64::from(RAMP) / 2);
    bench.send(&Command::EmergencyStop {});
    assert_eq!(bench.shutdown(), Some(ShutdownReason::EmergencyStop));
    let edges = bench.board.edges.len();
    bench.run_for(5 * SECOND);
    assert_eq!(bench.board.edges.len(), edges);
    bench.send(&Command::ClearShutdown {});
    let state = motion_state(&mut bench);
    let plain =
        MotionState { clock: state.clock, motion: state.clock, rate: 4096, state: RUNNING, reason: 0 };
    assert_eq!(state, plain);
}

#[test]
fn a_trigger_wins_over_a_hold() {
    let config = [Command::ConfigTrsync { oid: 10 }, Command::ConfigEndstop { oid: 11, pin: 20, pull_up: 1 }];
    let mut bench = motion_bench(0, &config);
    let clock = SECOND as u32;
    bench.send_all(&[
        Command::TrsyncStart { oid: 10, report_clock: clock, report_ticks: 0, expire_reason: 4 },
        Command::StepperStopOnTrigger { oid: 0, trsync_oid: 10 },
        Command::TrsyncSetTimeout { oid: 10, clock: 20 * clock },
        Command::EndstopHome {
            oid: 11,
            clock,
            sample_ticks: 180,
            sample_count: 4,
            rest_ticks: 3000,
            pin_value: 1,
            trsync_oid: 10,
            trigger_reason: 1,
        },
        steps(0, clock, 1, 0),
        steps(0, INTERVAL, 20_000, 0),
    ]);
    bench.run_until(SECOND + 100 * MILLISECOND);
    bench.send(&Command::MotionHold { ramp: RAMP });
    let hit = bench.board.now + u64::from(RAMP) / 3;
    bench.board.inputs.push(crate::bench::Edge { at: hit, pin: 20, level: true });
    bench.board.edges.clear();
    bench.run_for(5 * SECOND);
    let last = *bench.edges_of(0, true).last().expect("steps");
    assert!(last > hit - 2 * u64::from(INTERVAL) && last <= hit + 3000 + 3 * 180, "{last} {hit}");
    let position = bench.position(0);
    // At rest it may move again, in motion time.
    bench.send(&Command::MotionResume { ramp: RAMP });
    bench.run_for(SECOND);
    let motion = motion_state(&mut bench).motion;
    bench.send_all(&[Command::ResetStepClock { oid: 0, clock: motion + 60_000 }, steps(0, INTERVAL, 10, 0)]);
    bench.run_for(SECOND);
    assert_eq!(bench.position(0), position - 10);
    assert_eq!(bench.shutdown(), None);
}

#[test]
fn a_plain_board_knows_none_of_it() {
    for command in
        [Command::MotionGetState {}, Command::MotionHold { ramp: RAMP }, Command::MotionTie { oid: 0 }]
    {
        let mut bench = Bench::plain(0);
        bench.send(&command);
        assert_eq!(bench.shutdown(), Some(ShutdownReason::CommandParser), "{command:?}");
        assert!(
            bench.pick(|response| matches!(response, Response::MotionState { .. }).then_some(())).is_empty()
        );
    }
}
