//! How far steppers came in their rows: counts, check, and going on after a drop; outputs that follow motion.

use proptest::prelude::*;
use wire::{Command, Response, RowCheck, ShutdownReason};

use crate::{
    bench::{Bench, SECOND, output, stepper, steps},
    hold::{Seen, motion_bench, motion_state, watch_until},
};

const RAMP: u32 = 600_000;
const OUTPUT: u8 = 20;
const OUTPUT_PIN: u8 = 17;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Progress {
    job: u32,
    received: u32,
    done: u32,
    left: u16,
    next: u32,
    dir: u8,
    pos: i32,
    crc: u32,
}

fn pick(bench: &mut Bench) -> Vec<(u8, Progress)> {
    bench.pick(|response| match *response {
        Response::StepperQueue { oid, job, received, done, left, next, dir, pos, crc } => {
            Some((oid, Progress { job, received, done, left, next, dir, pos, crc }))
        }
        _ => None,
    })
}

fn progress(bench: &mut Bench, oid: u8) -> Progress {
    bench.board.sent.clear();
    bench.send(&Command::StepperGetQueue { oid });
    pick(bench)[0].1
}

type Row = (u32, u16, i16, bool);

fn queue(bench: &mut Bench, oid: u8, rows: &[Row]) {
    for &(interval, count, add, forward) in rows {
        bench.send_all(&[
            Command::SetNextStepDir { oid, dir: forward.into() },
            steps(oid, interval, count, add),
        ]);
    }
}

fn check(rows: &[Row]) -> u32 {
    let mut check = RowCheck::new();
    for &(interval, count, add, forward) in rows {
        check.add(interval, count, add, forward);
    }
    check.value()
}

fn edges(seen: &[Seen]) -> Vec<(u8, bool, u32)> {
    let rises = seen.iter().filter(|edge| edge.pin == 1 || (edge.pin == 0 && edge.level));
    rises.map(|edge| (edge.pin, edge.level, edge.motion)).collect()
}

#[test]
fn rows_and_steps_are_counted_as_they_are_made() {
    let mut bench = motion_bench(0, &[]);
    bench.send(&Command::MotionJob { id: 77 });
    let rows = [(10_000, 3, 0, true), (10_000, 2, 100, false)];
    queue(&mut bench, 0, &rows);
    let at = |bench: &mut Bench, now| {
        bench.run_until(now);
        let Progress { received, done, left, next, dir, pos, .. } = progress(bench, 0);
        (received, done, left, next, dir, pos)
    };
    assert_eq!(at(&mut bench, 0), (2, 0, 3, 10_000, 1, 0));
    assert_eq!(at(&mut bench, 10_010), (2, 0, 2, 20_000, 1, 1), "during the pulse");
    assert_eq!(at(&mut bench, 15_000), (2, 0, 2, 20_000, 1, 1));
    assert_eq!(at(&mut bench, 30_000), (2, 1, 0, 30_000, 1, 3), "the last of a row");
    assert_eq!(at(&mut bench, 30_100), (2, 1, 2, 40_000, 0, 3));
    assert_eq!(at(&mut bench, 40_010), (2, 1, 1, 50_100, 0, 2));
    assert_eq!(at(&mut bench, 90_000), (2, 2, 0, 50_100, 0, 1));
    let last = progress(&mut bench, 0);
    assert_eq!((last.job, last.crc), (77, check(&rows)));
    bench.send(&Command::MotionJob { id: 78 });
    let new = progress(&mut bench, 0);
    assert_eq!(new, Progress { job: 78, received: 0, done: 0, crc: 0, ..last });
    queue(&mut bench, 0, &[(60_000, 1, 0, true)]);
    bench.send(&Command::MotionJob { id: 79 });
    assert_eq!(bench.shutdown(), Some(ShutdownReason::StepperActive));
}

proptest! {
    #[test]
    fn a_drop_tells_exactly_what_is_left_to_send_again(
        start: u32,
        at in 0_u64..600_000,
        rows in prop::collection::vec((200_u32..3000, 1_u16..40, 0_i16..30, any::<bool>()), 1..20),
    ) {
        let start = u64::from(start);
        let rows: Vec<Row> = std::iter::once((100_000, 1, 0, false)).chain(rows).collect();
        let whole = {
            let mut bench = motion_bench(start, &[]);
            queue(&mut bench, 0, &rows);
            let mut seen = Vec::new();
            watch_until(&mut bench, start + SECOND, &mut seen);
            edges(&seen)
        };
        let mut bench = motion_bench(start, &[]);
        bench.send(&Command::MotionJob { id: 5 });
        queue(&mut bench, 0, &rows);
        let mut seen = Vec::new();
        watch_until(&mut bench, start + at, &mut seen);
        bench.send(&Command::MotionHold { ramp: RAMP });
        watch_until(&mut bench, start + at + SECOND, &mut seen);
        bench.board.sent.clear();
        bench.send(&Command::MotionDrop {});
        let reports = pick(&mut bench);
        prop_assert_eq!(reports.iter().map(|report| report.0).collect::<Vec<_>>(), [0, 1, 2]);
        let cut = reports[0].1;
        prop_assert_eq!((cut.job, cut.received, cut.crc), (5, rows.len() as u32, check(&rows)));
        // Rows that were on their way are void, and the answer stays.
        queue(&mut bench, 0, &[(500, 3, 0, true)]);
        prop_assert_eq!(progress(&mut bench, 0), cut);
        bench.send_all(&[Command::MotionResume { ramp: RAMP }]);
        watch_until(&mut bench, start + at + 2 * SECOND, &mut seen);
        prop_assert_eq!(progress(&mut bench, 0), cut);

        // The host goes on: what is left of the row, then the others, all later by the same time.
        let done = cut.done as usize;
        let mut rest = rows.get(done..).unwrap_or_default().to_vec();
        let mut later = 0;
        if let Some(first) = rest.first_mut() {
            let made = first.1 - if cut.left == 0 { first.1 } else { cut.left };
            prop_assert!(cut.left != 0, "a row is either done or has steps left");
            let interval = i64::from(first.0) + i64::from(first.2) * i64::from(made);
            let again = motion_state(&mut bench).motion.wrapping_add(50_000);
            later = again.wrapping_sub(cut.next);
            bench.send(&Command::ResetStepClock { oid: 0, clock: again.wrapping_sub(interval as u32) });
            *first = (interval as u32, cut.left, first.2, first.3);
        }
        let before = seen.len();
        queue(&mut bench, 0, &rest);
        watch_until(&mut bench, start + at + 4 * SECOND, &mut seen);
        for edge in &mut seen[before..] {
            edge.motion = edge.motion.wrapping_sub(later);
        }
        prop_assert_eq!(bench.shutdown(), None);
        let strip = |edges: Vec<(u8, bool, u32)>| -> Vec<_> {
            edges.into_iter().filter(|edge| edge.0 == 0).map(|edge| edge.2).collect()
        };
        prop_assert_eq!(strip(edges(&seen)), strip(whole));
        prop_assert_eq!(bench.position(0), rows.iter().map(|row| i32::from(row.1) * if row.3 { 1 } else { -1 }).sum::<i32>());
    }
}

#[test]
fn tied_outputs_change_in_motion_time_and_keep_their_modulation() {
    let config = [
        output(OUTPUT, 0),
        Command::SetDigitalOutPwmCycle { oid: OUTPUT, cycle_ticks: 12_000 },
        Command::MotionTie { oid: OUTPUT },
    ];
    let mut bench = motion_bench(0, &config);
    let change = |clock, on_ticks| Command::QueueDigitalOut { oid: OUTPUT, clock, on_ticks };
    bench.send_all(&[change(1_000_000, 12_000), change(2_000_000, 3000), change(3_000_000, 0)]);
    let mut seen = Vec::new();
    watch_until(&mut bench, 1_500_000, &mut seen);
    bench.send(&Command::MotionHold { ramp: RAMP });
    watch_until(&mut bench, 5_000_000, &mut seen);
    assert_eq!(seen.len(), 1, "held before the second change");
    bench.send(&Command::MotionResume { ramp: RAMP });
    watch_until(&mut bench, 10_000_000, &mut seen);
    assert_eq!((seen[0].at, seen[0].motion), (1_000_000, 1_000_000));
    let falls: Vec<u64> = seen.iter().filter(|edge| !edge.level).map(|edge| edge.at).collect();
    let second = seen[1].at - 3000;
    assert!(falls.windows(2).take(20).all(|pair| pair[1] - pair[0] == 12_000), "{falls:?}");
    let last = seen.last().expect("edges");
    assert!(!bench.board.levels[usize::from(OUTPUT_PIN)]);
    assert!((last.at - second).abs_diff(1_000_000) <= 12_000, "off after a million ticks of motion");
    // A drop leaves it as it is.
    bench.send(&Command::UpdateDigitalOut { oid: OUTPUT, value: 1 });
    let at = motion_state(&mut bench).motion + 2_000_000;
    bench.send_all(&[change(at, 0), Command::MotionHold { ramp: RAMP }]);
    bench.run_for(SECOND);
    bench.send_all(&[Command::MotionDrop {}, Command::MotionResume { ramp: RAMP }]);
    bench.run_for(SECOND);
    assert!(bench.board.levels[usize::from(OUTPUT_PIN)]);
    assert_eq!(bench.shutdown(), None);
}

#[test]
fn an_output_that_must_be_refreshed_cannot_be_tied() {
    let mut bench = Bench::at(0);
    bench.send_all(&[
        Command::AllocateOids { count: 21 },
        output(OUTPUT, 1000),
        Command::MotionTie { oid: OUTPUT },
    ]);
    assert_eq!(bench.shutdown(), Some(ShutdownReason::InvalidMotion));
}

#[test]
fn what_a_drop_has_to_tell_waits_for_room() {
    let mut bench = Bench::configured(0, &[stepper(0), stepper(1)]);
    bench.send_all(&[Command::MotionJob { id: 5 }, Command::MotionHold { ramp: RAMP }]);
    bench.run_for(2 * SECOND);
    bench.board.sent.clear();
    bench.board.has_room = false;
    bench.send(&Command::MotionDrop {});
    bench.run_for(SECOND);
    assert!(bench.firmware.has_tasks());
    bench.board.has_room = true;
    bench.run_for(SECOND);
    let told = bench.pick(|response| match *response {
        Response::StepperQueue { oid, job, .. } => Some((oid, job)),
        _ => None,
    });
    assert_eq!(told, [(0, 5), (1, 5)]);
    assert!(!bench.firmware.has_tasks());
}
