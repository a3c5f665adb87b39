//! The link with the block check on, against a board at the end of a bad line.

use proptest::prelude::*;
use wire::block::{BLOCK_BYTES_MIN, Block, PAYLOAD_BYTES_MAX};

use super::{
    lossy_line::{Conditions, Line, checks},
    tests::{MESSAGE_BYTES, connected, flood, message},
    *,
};

/// A line whose ends check, and have done so.
fn checked(seed: u64) -> Line {
    let mut line = connected(seed);
    line.check();
    flood(&mut line, 1);
    assert!(line.link.stats().checked);
    line.board.taken.clear();
    line
}

#[test]
fn the_longest_message_fits_beside_the_check() {
    let mut line = checked(1);
    let longest = Outgoing::from_bytes(Lane::Control, &[7; wire::check::MESSAGE_BYTES_MAX]).unwrap();
    line.link.queue(longest).unwrap();
    assert!(line.run(5.0, |line| line.link.is_idle()));
    assert_eq!(line.board.taken.last().map(|(_, payload)| &payload[..]), Some(longest.payload()));
    assert_eq!(Outgoing::from_bytes(Lane::Control, &[7; wire::check::MESSAGE_BYTES_MAX + 1]), None);
}

#[test]
fn blocks_are_as_full_as_the_check_leaves_room() {
    let mut line = checked(2);
    line.link.set_receive_window(192);
    flood(&mut line, 5000);
    let room = PAYLOAD_BYTES_MAX - checks().to_board.len();
    let blocks = line.board.taken.len();
    let least = 5000 / (room / MESSAGE_BYTES);
    assert!((least..least + 5).contains(&blocks), "{blocks}");
    assert!(line.board.taken.iter().all(|(_, payload)| payload.len() <= room));
}

#[test]
fn what_has_no_check_is_dropped_once_the_board_checks() {
    let mut line = checked(3);
    let expected = line.board.expected;
    let mut heard = 0;
    let now = Seconds(line.now_s);
    for payload in [&b"clock"[..], &[]] {
        line.link.receive(Block::new(expected, payload).as_bytes(), now, |_| heard += 1);
    }
    // A refusal without a check is none either.
    line.link.queue(message(Lane::Control, 1)).unwrap();
    let mut out = Vec::new();
    line.link.poll(now, Ticks(0), &mut out);
    assert_eq!(out.len(), BLOCK_BYTES_MIN + MESSAGE_BYTES + checks().to_board.len());
    line.link.receive(Block::new(expected + 1, &[]).as_bytes(), now, |_| heard += 1);
    assert_eq!((heard, line.link.stats().unchecked, line.link.unacknowledged().0), (0, 3, 1));
    let sealed = checks().from_board.seal(expected + 1, b"clock");
    line.link.receive(sealed.as_bytes(), now, |payload| heard += payload.bytes.len());
    assert_eq!((heard, line.link.unacknowledged().0), (5, 0));
}

#[test]
fn a_board_that_has_started_anew_is_heard() {
    let mut line = checked(4);
    let (now, mut heard) = (Seconds(line.now_s), Vec::<u8>::new());
    let starting = checks().starting;
    line.link.receive(Block::new(9, &starting).as_bytes(), now, |payload| heard.extend(payload.bytes));
    assert_eq!(heard, starting);
    assert_eq!(line.link.stats().unchecked, 0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn everything_arrives_once_and_in_order(
        seed: u64, corrupt in 0.0..0.02, drop in 0.0..0.01, duplicate in 0.0..0.01, stall in 0.0..0.01,
        laconic: bool, uart: bool,
    ) {
        let base = if uart { Conditions::UART } else { Conditions::USB };
        let mut line = Line::new(Conditions { corrupt, drop, duplicate, stall, ..base }, seed);
        line.link.set_receive_window(if uart { 192 } else { usize::MAX });
        line.board.laconic = laconic;
        flood(&mut line, 20);
        line.board.taken.clear();
        line.check();
        flood(&mut line, 300);
        prop_assert!(line.link.stats().checked && line.board.is_checking);
    }
}
