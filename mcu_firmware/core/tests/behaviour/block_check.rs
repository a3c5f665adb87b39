//! The check over whole blocks: how it comes on, what it refuses, how a host that does not know it finds in.

use proptest::prelude::*;
use wire::{
    Command, ShutdownReason,
    block::{Block, PAYLOAD_BYTES_MAX},
    check::BlockCheck,
    messages::{CommandKind, ResponseKind},
};

use crate::bench::{Bench, SECOND, output};

fn to_board() -> BlockCheck {
    BlockCheck::new(CommandKind::BlockCheck.spec().id)
}

fn encoded(commands: &[Command<'_>]) -> Vec<u8> {
    let mut payload = Vec::new();
    assert!(commands.iter().all(|command| command.encode(&mut payload)));
    payload
}

/// What the board answered since the last time: the number that it expects, whether its blocks were checked, messages.
fn answers(bench: &mut Bench) -> Vec<(u8, bool, Vec<u8>)> {
    let check = BlockCheck::new(ResponseKind::BlockChecked.spec().id);
    let blocks = bench.blocks();
    let opened = blocks.into_iter().map(|(sequence, payload)| match check.open(sequence, &payload) {
        Some(messages) => (sequence, true, messages.to_vec()),
        None => (sequence, false, payload),
    });
    opened.collect()
}

/// A board that checks, and the number that it expects.
fn checking() -> (Bench, u8) {
    let mut bench = Bench::configured(0, &[output(0, 0)]);
    bench.board.sent.clear();
    // Rooms, an output, the end of the configuration.
    let expected = 3;
    bench.receive(to_board().seal(expected, &encoded(&[Command::GetClock {}])).as_bytes());
    let answers = answers(&mut bench);
    let (number, checked, messages) = answers.last().expect("an answer");
    assert_eq!((*number, *checked, messages.len()), (4, true, 0), "{answers:?}");
    assert_eq!(answers.len(), 2);
    (bench, *number)
}

const SWITCH: Command<'static> = Command::UpdateDigitalOut { oid: 0, value: 1 };

#[test]
fn once_a_check_was_right_blocks_without_one_are_refused_whole() {
    let (mut bench, expected) = checking();
    let payload = encoded(&[SWITCH, Command::GetClock {}]);
    bench.receive(Block::new(expected, &payload).as_bytes());
    assert_eq!(answers(&mut bench), [(expected, false, vec![])], "whoever sent it may not know of checks");
    assert!(!bench.board.levels[17]);
    bench.receive(to_board().seal(expected, &payload).as_bytes());
    assert!(bench.board.levels[17]);
    let answers = answers(&mut bench);
    assert!(answers.iter().all(|&(number, checked, _)| (number, checked) == (expected + 1, true)));
    assert_eq!(answers.len(), 2, "{answers:?}");
}

#[test]
fn a_wrong_check_is_refused_before_anything_is_done() {
    let (mut bench, expected) = checking();
    let sealed = to_board().seal(expected, &encoded(&[SWITCH]));
    let payload = &sealed.as_bytes()[2..sealed.as_bytes().len() - 3];
    for bit in 0..8 * payload.len() {
        let mut damaged = payload.to_vec();
        damaged[bit / 8] ^= 1 << (bit % 8);
        bench.receive(Block::new(expected, &damaged).as_bytes());
        assert_eq!(answers(&mut bench), [(expected, false, vec![])], "bit {bit}");
    }
    assert!(!bench.board.levels[17]);
    assert_eq!(bench.shutdown(), None);
}

#[test]
fn refusals_of_noise_and_of_repeated_blocks_are_checked() {
    let (mut bench, expected) = checking();
    bench.receive(&[9, 9, 9, wire::block::SYNC]);
    bench.receive(to_board().seal(expected - 1, &encoded(&[Command::EmergencyStop {}])).as_bytes());
    assert_eq!(answers(&mut bench), [(expected, true, vec![]), (expected, true, vec![])]);
    assert_eq!(bench.shutdown(), None);
}

#[test]
fn a_new_host_finds_in_by_asking_who_it_speaks_to_and_by_nothing_else() {
    let identify = |offset| Command::Identify { offset, count: 40 };
    for stranger in [
        &[][..],
        &[identify(40)],
        &[identify(0), Command::GetClock {}],
        &[Command::GetClock {}, identify(0)],
        &[Command::GetConfig {}],
        &[Command::EmergencyStop {}],
        &[Command::Reset {}],
        &[Command::ConfigReset {}],
        &[Command::BlockCheck { crc: 7 }],
    ] {
        let (mut bench, expected) = checking();
        bench.receive(Block::new(expected, &encoded(stranger)).as_bytes());
        assert_eq!(answers(&mut bench), [(expected, false, vec![])], "{stranger:?}");
        assert_eq!((bench.shutdown(), bench.board.resets), (None, 0));
        // The number alone lets nobody in.
        bench.receive(Block::new(expected + 1, &encoded(&[identify(0)])).as_bytes());
        assert_eq!(answers(&mut bench), [(expected, false, vec![])]);
        bench.receive(Block::new(expected, &encoded(&[identify(0)])).as_bytes());
        assert_eq!(answers(&mut bench).last(), Some(&(expected + 1, false, vec![])));
        bench.send_from(expected + 1, &[SWITCH]);
        assert!(bench.board.levels[17], "it is a plain board again");
        assert!(answers(&mut bench).iter().all(|&(_, checked, _)| !checked));
    }
}

#[test]
fn nothing_but_a_right_check_at_the_blocks_end_turns_it_on() {
    let mut bench = Bench::configured(0, &[output(0, 0)]);
    let right = to_board().seal(4, &encoded(&[SWITCH]));
    let right = &right.as_bytes()[2..right.as_bytes().len() - 3];
    let mut more = right.to_vec();
    more.extend(encoded(&[Command::GetClock {}]));
    for payload in [
        encoded(&[Command::BlockCheck { crc: 0 }]),
        encoded(&[SWITCH, Command::BlockCheck { crc: 0xffff_ffff }]),
        // Right in a block of another length.
        more,
        // Right in a block with another number.
        right.to_vec(),
    ] {
        bench.send_payload(&payload);
        bench.board.sent.clear();
        bench.send(&Command::GetClock {});
        assert!(answers(&mut bench).iter().all(|&(_, checked, _)| !checked), "{payload:?}");
    }
    assert_eq!(bench.shutdown(), None);
}

#[test]
fn what_resets_the_configuration_leaves_the_check_alone() {
    let (mut bench, mut expected) = checking();
    for command in [Command::EmergencyStop {}, Command::ClearShutdown {}, Command::ConfigReset {}] {
        bench.receive(to_board().seal(expected, &encoded(&[command])).as_bytes());
        expected += 1;
        let answers = answers(&mut bench);
        assert_eq!(answers.last(), Some(&(expected, true, vec![])), "{command:?}");
        assert!(answers.iter().all(|&(_, checked, _)| checked));
    }
    bench.run_for(6 * SECOND);
    let answers = answers(&mut bench);
    assert!(
        !answers.is_empty() && answers.iter().all(|&(_, checked, _)| checked),
        "statistics are checked too"
    );
}

#[test]
fn a_plain_board_does_not_know_it() {
    let mut bench = Bench::plain(0);
    bench.receive(to_board().seal(0, &[]).as_bytes());
    assert_eq!(bench.shutdown(), Some(ShutdownReason::CommandParser));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn whatever_the_framing_lets_through_changes_nothing_without_a_check(
        blocks in prop::collection::vec(
            (0_u8..16, prop::collection::vec(any::<u8>(), 0..=PAYLOAD_BYTES_MAX)), 1..20,
        ),
    ) {
        let (mut bench, expected) = checking();
        for (sequence, payload) in &blocks {
            bench.receive(Block::new(*sequence, payload).as_bytes());
        }
        for (number, checked, messages) in answers(&mut bench) {
            prop_assert_eq!((number, checked, messages), (expected, false, vec![]));
        }
        prop_assert_eq!(bench.shutdown(), None);
    }
}
