//! The link against a board at the end of a line, good or bad, in virtual time.

use proptest::prelude::*;
use wire::block::{BLOCK_BYTES_MIN, Block};

use super::{
    lossy_line::{CLOCK, Conditions, Line},
    *,
};

pub(super) const MESSAGE_BYTES: usize = 7;
/// Messages of that size in a full block.
const MESSAGES_IN_BLOCK: usize = 8;

/// A message that says what it is: its number, its lane.
pub(super) fn message(lane: Lane, number: u32) -> Outgoing {
    let mut bytes = [mark(lane); MESSAGE_BYTES];
    bytes[..4].copy_from_slice(&number.to_le_bytes());
    Outgoing::from_bytes(lane, &bytes).unwrap()
}

const fn mark(lane: Lane) -> u8 {
    match lane {
        Lane::Immediate => 100,
        Lane::Control => 101,
        Lane::Motion(at) => at,
    }
}

fn at(seconds: f64) -> Ticks {
    CLOCK.ticks_in(Seconds(seconds))
}

/// Steps from one second to another.
fn step(lane: u8, number: u32, from_s: f64, to_s: f64) -> Outgoing {
    message(Lane::Motion(lane), number).due(at(from_s)).entry_until(at(to_s))
}

/// What arrived, in order: lane mark and number.
fn arrivals(line: &Line) -> Vec<(u8, u32)> {
    let messages = line.board.taken.iter().flat_map(|(_, payload)| payload.chunks(MESSAGE_BYTES));
    messages.map(|bytes| (bytes[4], u32::from_le_bytes(bytes[..4].try_into().unwrap()))).collect()
}

/// Sends this many messages as fast as they go; gives the payload bytes a second.
pub(super) fn flood(line: &mut Line, messages: u32) -> f64 {
    let (start_s, mut queued) = (line.now_s, 0);
    let done = line.run(start_s + 300.0, |line| {
        while queued < messages && line.link.room(Lane::Control) > 0 {
            line.link.queue(message(Lane::Control, queued)).unwrap();
            queued += 1;
        }
        queued == messages && line.link.is_idle()
    });
    assert!(done, "not everything was sent in time: {:?}", line.link.stats());
    let expected: Vec<_> = (0..messages).map(|number| (mark(Lane::Control), number)).collect();
    assert!(arrivals(line) == expected, "not everything arrived once and in order");
    f64::from(messages) * MESSAGE_BYTES as f64 / (line.now_s - start_s)
}

#[test]
fn whatever_number_the_board_is_at_nothing_is_lost() {
    for seed in 0..16 {
        flood(&mut Line::new(Conditions::USB, seed), 100);
        flood(&mut Line::new(Conditions { corrupt: 0.03, ..Conditions::USB }, seed), 100);
    }
}

#[test]
fn a_clean_line_is_used_well_and_nothing_is_sent_twice() {
    for (conditions, window, least) in
        [(Conditions::USB, None, 150_000.0), (Conditions::UART, Some(192), 22_000.0)]
    {
        let mut line = Line::new(conditions, 1);
        line.link.set_receive_window(window.unwrap_or(usize::MAX));
        let rate = flood(&mut line, 5000);
        let stats = line.link.stats();
        assert!(rate > least, "{rate} bytes a second");
        assert_eq!((stats.bytes_retransmitted, stats.garbage, stats.absurd), (0, 0, 0));
        let blocks = stats.blocks_sent as usize;
        assert!((625..630).contains(&blocks), "blocks are full: {blocks}");
    }
}

#[test]
fn one_percent_of_corrupted_bytes_leaves_four_kilobytes_a_second() {
    for (base, window) in [(Conditions::USB, usize::MAX), (Conditions::UART, 192)] {
        for (laconic, latency_s) in [(false, 0.001), (false, 0.002), (true, 0.001), (true, 0.002)] {
            for seed in 0..3 {
                let mut line = Line::new(Conditions { corrupt: 0.01, latency_s, ..base }, seed);
                line.link.set_receive_window(window);
                line.board.laconic = laconic;
                let rate = flood(&mut line, 2000);
                assert!(rate > 4000.0, "{rate} bytes a second: {base:?} {laconic} {latency_s} {seed}");
            }
        }
    }
}

#[test]
fn losses_are_not_multiplied_by_the_answers_to_them() {
    // Every loss is repaired by about one retransmission, even where a slow line holds several of them.
    let mut line = Line::new(Conditions { corrupt: 0.003, ..Conditions::UART }, 3);
    line.link.set_receive_window(192);
    flood(&mut line, 8000);
    let stats = line.link.stats();
    let expected = 0.003 * 8000.0 * MESSAGE_BYTES as f64 * 64.0 / 56.0;
    assert!((stats.retransmissions as f64) < 1.5 * expected, "{stats:?}, {expected} expected");
}

#[test]
fn the_number_of_calls_is_that_of_the_events() {
    let mut line = Line::new(Conditions { corrupt: 0.01, ..Conditions::USB }, 4);
    flood(&mut line, 2000);
    let stats = line.link.stats();
    assert!(line.wakes < stats.retransmissions + 10, "{} calls", line.wakes);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn everything_arrives_once_and_in_order(
        seed: u64, corrupt in 0.0..0.02, drop in 0.0..0.01, duplicate in 0.0..0.01, stall in 0.0..0.01,
        laconic: bool, uart: bool,
    ) {
        let base = if uart { Conditions::UART } else { Conditions::USB };
        let mut line = Line::new(Conditions { corrupt, drop, duplicate, stall, ..base }, seed);
        // Whatever a host before us left behind.
        line.board_says(b"late");
        line.link.set_receive_window(if uart { 192 } else { usize::MAX });
        line.board.laconic = laconic;
        flood(&mut line, 300);
    }

    #[test]
    fn noise_never_panics_and_queues_stay_bounded(
        noise in prop::collection::vec(prop_oneof![
            prop::collection::vec(any::<u8>(), 0..80),
            (any::<u8>(), prop::collection::vec(any::<u8>(), 0..20))
                .prop_map(|(sequence, payload)| Block::new(sequence, &payload).as_bytes().to_vec()),
        ], 0..100),
        clocks in prop::collection::vec(any::<u64>(), 100),
    ) {
        let mut link = Link::new();
        link.set_board(CLOCK, 10);
        let mut out = Vec::new();
        for (at, (bytes, clock)) in noise.iter().zip(clocks).enumerate() {
            let _ = link.queue(step(0, at as u32, at as f64, at as f64 + 1.0));
            let _ = link.queue(message(Lane::Control, at as u32).entry_until(Ticks(clock)));
            let now = Seconds(at as f64 * 0.01);
            link.receive(bytes, now, |_| {});
            out.clear();
            let wake = link.poll(now, Ticks(clock), &mut out);
            prop_assert!(wake.is_none_or(|wake| wake > now));
            prop_assert!(out.len() <= 2 * WINDOW_BLOCKS_IMMEDIATE_MAX * BLOCK_BYTES_MAX);
            prop_assert!(link.unacknowledged().0 <= WINDOW_BLOCKS_MAX);
        }
    }
}

/// A line whose board has been found.
pub(super) fn connected(seed: u64) -> Line {
    let mut line = Line::new(Conditions::USB, seed);
    line.link.queue(message(Lane::Control, 0)).unwrap();
    assert!(line.run(1.0, |line| line.link.is_idle()));
    line.board.taken.clear();
    line
}

#[test]
fn a_silent_board_gets_no_more_than_the_window_and_is_not_pestered() {
    for (window, blocks) in [(usize::MAX, WINDOW_BLOCKS_MAX), (192, 3), (1, 1)] {
        let mut line = connected(2);
        line.link.set_receive_window(window);
        for number in 0..500 {
            line.link.queue(message(Lane::Control, number)).unwrap();
        }
        let (mut out, mut now_s, mut polls) = (Vec::new(), line.now_s, 0);
        let end_s = now_s + 60.0;
        while now_s < end_s {
            now_s = line.link.poll(Seconds(now_s), Ticks(0), &mut out).unwrap().0;
            assert_eq!(line.link.unacknowledged().0, blocks);
            assert!(line.link.unacknowledged().1 <= window.max(BLOCK_BYTES_MAX));
            polls += 1;
        }
        assert!(polls < 60 * 2 + 10, "{polls}");
    }
}

#[test]
fn the_emergency_stop_overtakes_everything_and_does_not_wait_for_the_window() {
    let mut line = connected(5);
    for number in 0..500 {
        line.link.queue(message(Lane::Control, number)).unwrap();
    }
    let mut out = Vec::new();
    line.link.poll(Seconds(line.now_s), Ticks(0), &mut out);
    assert_eq!(line.link.unacknowledged().0, WINDOW_BLOCKS_MAX);
    line.link.queue(message(Lane::Immediate, 7)).unwrap();
    out.clear();
    line.link.poll(Seconds(line.now_s), Ticks(0), &mut out);
    assert_eq!(out.len(), BLOCK_BYTES_MIN + MESSAGE_BYTES);
    assert_eq!(out[2..][..MESSAGE_BYTES], *message(Lane::Immediate, 7).payload());
}

#[test]
fn a_full_lane_says_so() {
    for (lane, most) in [
        (Lane::Immediate, IMMEDIATE_MESSAGES_MAX),
        (Lane::Control, CONTROL_MESSAGES_MAX),
        (Lane::Motion(7), MOTION_MESSAGES_MAX),
        (Lane::Motion(8), 0),
    ] {
        let mut link = Link::new();
        assert_eq!(link.room(lane), most);
        for number in 0..most {
            link.queue(message(lane, number as u32)).unwrap();
        }
        assert_eq!((link.room(lane), link.waiting(lane)), (0, most));
        assert_eq!(link.queue(message(lane, 0)), Err(LaneFull(lane)));
    }
}

#[test]
fn motion_lanes_are_merged_by_when_they_are_due_and_keep_their_order() {
    let mut line = connected(1);
    for number in 0..40 {
        let from_s = 0.3 + 0.01 * f64::from(number);
        line.link.queue(step(0, number, from_s, from_s)).unwrap();
        if number % 4 == 0 {
            line.link.queue(step(1, number, from_s + 0.001, from_s)).unwrap();
        }
    }
    line.link.queue(message(Lane::Control, 99)).unwrap();
    assert!(line.run(5.0, |line| line.link.is_idle()));
    let arrived = arrivals(&line);
    assert_eq!(arrived[0], (mark(Lane::Control), 99));
    let due = |&(lane, number): &(u8, u32)| 10 * number + u32::from(lane);
    assert!(arrived[1..].is_sorted_by_key(due), "{arrived:?}");
    assert_eq!(arrived.len(), 51);
}

#[test]
fn motion_goes_no_earlier_than_the_horizon_and_in_full_blocks() {
    let mut line = connected(1);
    line.link.set_horizon(Seconds(2.0));
    for number in 0..1000 {
        let from_s = 0.5 + 0.02 * f64::from(number);
        line.link.queue(step(0, number, from_s, from_s + 0.02)).unwrap();
    }
    let mut least_s = f64::INFINITY;
    line.run(18.0, |line| {
        if line.now_s > 1.0 {
            least_s = least_s.min(CLOCK.duration_of(line.link.motion_covered().unwrap()).0 - line.now_s);
        }
        false
    });
    assert!((1.6..2.0).contains(&least_s), "{least_s} s queued on the board");
    for (taken_s, payload) in &line.board.taken {
        let number = u32::from_le_bytes(payload[..4].try_into().unwrap());
        assert!(0.5 + 0.02 * f64::from(number) - taken_s < 2.0);
    }
    let full = line.board.taken.iter().filter(|(_, payload)| payload.len() > 50).count();
    assert!(full + 3 >= line.board.taken.len(), "{full} of {}", line.board.taken.len());
}

#[test]
fn a_step_far_ahead_waits_for_the_clock_to_come_within_reach_without_holding_up_the_rest() {
    // 3 << 28 ticks are 67 s at 12 MHz; the horizon is made longer than that.
    let mut line = connected(1);
    line.link.set_horizon(Seconds(1000.0));
    line.link.queue(step(0, 1, 100.0, 100.0)).unwrap();
    line.link.queue(step(0, 2, 100.1, 100.1)).unwrap();
    line.link.queue(step(1, 1, 50.0, 50.0)).unwrap();
    assert!(line.run(200.0, |line| line.link.is_idle()));
    assert_eq!(arrivals(&line), [(1, 1), (0, 1), (0, 2)]);
    let (first_s, second_s) = (line.board.taken[0].0, line.board.taken[1].0);
    assert!(first_s < 0.5 && (32.89..33.5).contains(&second_s), "{first_s} {second_s}");
}

#[test]
fn the_move_queue_is_never_overfilled_and_blocks_stay_full() {
    const MOVES: u16 = 100;
    let mut line = connected(1);
    line.link.set_board(CLOCK, MOVES);
    let total: u32 = 3000;
    let ends = |number: u32| 0.5 + 0.005 * f64::from(number + 1);
    let mut queued = 0;
    let done = line.run(30.0, |line| {
        while queued < total && line.link.waiting(Lane::Motion(2)) < 1000 {
            line.link.queue(step(2, queued, ends(queued) - 0.005, ends(queued))).unwrap();
            queued += 1;
        }
        let arrived = arrivals_of_last_block(line);
        let running =
            arrived.map_or(0, |last| (0..=last).rev().take_while(|&n| ends(n) > line.now_s).count());
        assert!(running <= usize::from(MOVES), "{running} entries");
        queued == total && line.link.is_idle()
    });
    assert!(done);
    assert_eq!(arrivals(&line).len(), total as usize);
    let late = line.board.taken.iter().filter(|(taken_s, payload)| {
        *taken_s > ends(u32::from_le_bytes(payload[..4].try_into().unwrap())) - 0.2
    });
    assert_eq!(late.count(), 0, "every step came well before it was due");
    let blocks = line.board.taken.len();
    assert!(blocks < total as usize / MESSAGES_IN_BLOCK * 5 / 4, "{blocks} blocks");
    assert!(line.wakes < 4 * blocks as u64, "{} calls", line.wakes);
}

fn arrivals_of_last_block(line: &Line) -> Option<u32> {
    let (_, payload) = line.board.taken.last()?;
    let last = payload.chunks(MESSAGE_BYTES).next_back()?;
    Some(u32::from_le_bytes(last[..4].try_into().unwrap()))
}

#[test]
fn outputs_find_an_entry_even_when_motion_has_taken_all_it_may() {
    let mut line = connected(1);
    line.link.set_board(CLOCK, 64);
    for number in 0..100 {
        line.link.queue(step(0, number, 1.0, 50.0)).unwrap();
    }
    line.run(0.8, |_| false);
    assert_eq!(line.link.moves().free_for_motion(), 0);
    let before = arrivals(&line).len();
    line.link.queue(message(Lane::Control, 1).entry_until(at(0.9))).unwrap();
    line.run(0.9, |_| false);
    assert_eq!(arrivals(&line)[before..], [(mark(Lane::Control), 1)]);
}

#[test]
fn what_the_board_has_acknowledged_is_known() {
    let mut line = connected(1);
    for number in 0..20 {
        let from_s = 0.3 + 0.01 * f64::from(number);
        line.link.queue(step(3, number, from_s, from_s + 0.005)).unwrap();
    }
    assert_eq!(line.link.motion_covered(), Some(at(0.3)));
    assert_eq!(line.link.motion_acknowledged(3), Ticks(0));
    assert!(line.run(5.0, |line| line.link.is_idle()));
    assert_eq!(line.link.motion_covered(), None);
    assert_eq!(line.link.motion_acknowledged(3), at(0.3 + 0.19 + 0.005));
    assert_eq!(line.link.motion_acknowledged(200), Ticks(0));
}

#[test]
fn a_stopped_stepper_frees_its_lane_and_its_entries() {
    let mut line = connected(1);
    for number in 0..20 {
        line.link.queue(step(3, number, 0.3, 10.0)).unwrap();
        line.link.queue(step(4, number, 100.0, 100.0)).unwrap();
    }
    line.run(0.3, |_| false);
    assert_eq!(line.link.moves().taken(), 20);
    line.link.forget_motion(3);
    line.link.forget_motion(4);
    assert_eq!((line.link.moves().taken(), line.link.waiting(Lane::Motion(4))), (0, 0));
    line.link.queue(message(Lane::Control, 1)).unwrap();
    line.link.forget_all();
    assert!(line.link.is_idle());
}

#[test]
fn an_answer_tells_when_its_question_was_sent_unless_that_is_in_doubt() {
    let mut line = connected(9);
    line.board.question = Some(42);
    line.link.queue(message(Lane::Control, 42)).unwrap();
    let asked_s = line.now_s;
    assert!(line.run(5.0, |line| !line.heard.is_empty()));
    assert_eq!(line.heard[0], (Seconds(line.now_s), Some(Seconds(asked_s))));

    let mut line = Line::new(Conditions { corrupt: 0.02, ..Conditions::USB }, 10);
    line.board.question = Some(42);
    for _ in 0..100 {
        line.link.queue(message(Lane::Control, 42)).unwrap();
        assert!(line.run(line.now_s + 5.0, |line| line.link.is_idle()));
    }
    let doubtful = line.heard.iter().filter(|(_, sent)| sent.is_none()).count();
    assert!(doubtful > 0 && doubtful < line.heard.len(), "{doubtful}");
    // A question sent once takes no longer than the line does.
    let longest =
        line.heard.iter().filter_map(|(received, sent)| Some(received.0 - (*sent)?.0)).fold(0.0, f64::max);
    assert!(longest < 0.0035, "{longest}");
}

#[test]
fn the_boards_room_is_never_exceeded_by_a_message_longer_than_shortened_blocks() {
    const ROOM: usize = BLOCK_BYTES_MAX;
    let mut line = connected(1);
    line.link.set_receive_window(ROOM);
    // A bad line has made blocks short.
    (0..200).for_each(|_| line.link.window.loss.lost());
    for number in 0..60 {
        let long = Outgoing::from_bytes(Lane::Control, &[1; 50]).unwrap();
        line.link.queue(if number % 4 == 3 { long } else { message(Lane::Control, number) }).unwrap();
    }
    let done = line.run(10.0, |line| {
        let (_, bytes) = line.link.unacknowledged();
        assert!(bytes <= ROOM, "{bytes} bytes on the way");
        line.link.is_idle()
    });
    assert!(done);
}

#[test]
fn a_message_that_waits_for_its_clock_does_not_wait_for_a_full_move_queue() {
    let mut line = connected(1);
    line.link.set_board(CLOCK, 64);
    for number in 0..100 {
        line.link.queue(step(0, number, 1.0, 50.0)).unwrap();
    }
    line.run(0.7, |_| false);
    assert_eq!(line.link.moves().free_for_motion(), 0);
    let before = arrivals(&line).len();
    line.link.queue(message(Lane::Control, 1).not_before(at(0.8))).unwrap();
    line.run(0.81, |_| false);
    assert_eq!(arrivals(&line)[before..], [(mark(Lane::Control), 1)]);
}
