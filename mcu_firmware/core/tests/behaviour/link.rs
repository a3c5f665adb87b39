//! Blocks, sequence numbers, identification and the states of the configuration.

use wire::{
    Command, Response, ShutdownReason,
    block::{BLOCK_BYTES_MIN, Block, SYNC},
};

use crate::bench::{Bench, CLOCK, OBJECTS, SECOND, output, stepper, steps};

/// The numbers of the acknowledgements sent since the last time.
fn acks(bench: &mut Bench) -> Vec<u8> {
    bench.blocks().iter().filter(|(_, payload)| payload.is_empty()).map(|&(sequence, _)| sequence).collect()
}

#[test]
fn blocks_are_acknowledged_and_strangers_refused() {
    let mut bench = Bench::at(0);
    bench.send(&Command::GetClock {});
    assert_eq!(acks(&mut bench), [1]);
    for (sequence, why) in [(0, "a repeated block"), (2, "a block after a lost one")] {
        let mut payload = Vec::new();
        Command::EmergencyStop {}.encode(&mut payload);
        bench.firmware.receive(&mut bench.board, Block::new(sequence, &payload).as_bytes());
        assert_eq!(acks(&mut bench), [1], "{why}");
        assert_eq!(bench.shutdown(), None, "{why}");
    }
    bench.firmware.receive(&mut bench.board, &[9, 9, 9, SYNC, SYNC]);
    assert_eq!(acks(&mut bench), [1], "garbage is answered once, sync bytes are not");
}

#[test]
fn replies_carry_the_number_that_acknowledges_their_command() {
    let mut bench = Bench::at(0);
    bench.send(&Command::GetClock {});
    let sequences: Vec<u8> = bench.blocks().iter().map(|&(sequence, _)| sequence).collect();
    assert_eq!(sequences, [1, 1]);
}

#[test]
fn an_acknowledgement_without_room_is_sent_later() {
    let mut bench = Bench::at(0);
    bench.run_for(1);
    bench.board.has_room = false;
    bench.send(&Command::GetClock {});
    bench.send(&Command::GetClock {});
    assert!(bench.firmware.has_tasks());
    bench.board.has_room = true;
    bench.board.sent.clear();
    bench.firmware.run_tasks(&mut bench.board);
    let blocks = bench.blocks();
    assert_eq!(blocks, [(2, vec![])], "one acknowledgement for both; the replies are lost");
    assert!(!bench.firmware.has_tasks());
}

#[test]
fn starting_is_said_once_and_waits_for_room() {
    let mut bench = Bench::at(5);
    bench.board.has_room = false;
    bench.run_for(10);
    assert!(bench.firmware.has_tasks());
    bench.board.has_room = true;
    bench.run_for(10);
    bench.run_for(10);
    assert_eq!(bench.said(), ["Starting"]);
}

#[test]
fn the_dictionary_arrives_in_pieces() {
    let mut bench = Bench::at(0);
    let dictionary: Vec<u8> = (0..=255).cycle().take(1000).collect();
    bench.board.dictionary.clone_from(&dictionary);
    let mut got: Vec<u8> = Vec::new();
    loop {
        let offset = got.len() as u32;
        bench.send(&Command::Identify { offset, count: 40 });
        let pieces = bench.pick(|response| match *response {
            Response::IdentifyResponse { offset: at, data } => {
                assert_eq!(at, offset);
                Some(data.to_vec())
            }
            _ => None,
        });
        assert_eq!(pieces.len(), 1);
        if pieces[0].is_empty() {
            break;
        }
        got.extend(&pieces[0]);
    }
    assert_eq!(got, dictionary);
    bench.send_all(&[
        Command::Identify { offset: u32::MAX, count: 255 },
        Command::Identify { offset: 990, count: 255 },
        Command::Identify { offset: 0, count: 255 },
    ]);
    let lengths = bench.pick(|response| match *response {
        Response::IdentifyResponse { data, .. } => Some(data.len()),
        _ => None,
    });
    assert_eq!(lengths, [0, 10, 46]);
}

fn config(bench: &mut Bench) -> (u8, u32, u8, u16) {
    bench.board.sent.clear();
    bench.send(&Command::GetConfig {});
    let configs = bench.pick(|response| match *response {
        Response::Config { is_config, crc, is_shutdown, move_count } => {
            Some((is_config, crc, is_shutdown, move_count))
        }
        _ => None,
    });
    configs[0]
}

#[test]
fn the_configuration_is_kept_until_it_is_reset() {
    let mut bench = Bench::at(0);
    assert_eq!(config(&mut bench), (0, 0, 0, 256));
    bench.send_all(&[Command::AllocateOids { count: 2 }, stepper(0), Command::FinalizeConfig { crc: 99 }]);
    assert_eq!(config(&mut bench), (1, 99, 0, 256));
    bench.send(&Command::EmergencyStop {});
    assert_eq!(config(&mut bench), (1, 99, 1, 256));
    bench.send(&Command::ClearShutdown {});
    assert_eq!(config(&mut bench), (0, 0, 0, 256));
    bench.send_all(&[Command::AllocateOids { count: 2 }, stepper(0), Command::FinalizeConfig { crc: 5 }]);
    bench.send(&Command::ClearShutdown {});
    assert_eq!(config(&mut bench), (1, 5, 0, 256), "nothing to clear, nothing forgotten");
    bench.send(&Command::ConfigReset {});
    assert_eq!(config(&mut bench), (0, 0, 0, 256));
}

#[test]
fn a_board_with_less_memory_says_so() {
    let mut bench = Bench::at(0);
    *bench.firmware = firmware_core::Firmware::new(CLOCK).with_move_count(3);
    bench.send_all(&[Command::AllocateOids { count: 1 }, stepper(0), Command::FinalizeConfig { crc: 1 }]);
    assert_eq!(config(&mut bench).3, 3);
    for _ in 0..4 {
        bench.send(&steps(0, 1_000_000, 1, 0));
        assert_eq!(bench.shutdown(), None, "one row is being executed, three wait");
    }
    bench.send(&steps(0, 1_000_000, 1, 0));
    assert_eq!(bench.shutdown(), Some(ShutdownReason::MoveQueueOverflow));
}

#[test]
fn a_restart_puts_outputs_to_their_defaults_first() {
    let mut bench = Bench::configured(0, &[output(0, 0)]);
    bench.send(&Command::UpdateDigitalOut { oid: 0, value: 1 });
    bench.send(&Command::Reset {});
    assert_eq!(bench.board.resets, 1);
    assert!(!bench.board.levels[17]);
    assert_eq!(config(&mut bench).0, 0);
}

#[test]
fn resetting_the_configuration_stops_what_runs() {
    let mut bench = Bench::configured(0, &[stepper(0), output(1, 0)]);
    bench.send_all(&[
        Command::UpdateDigitalOut { oid: 1, value: 1 },
        steps(0, 1000, 1000, 0),
        Command::ConfigReset {},
    ]);
    bench.run_for(SECOND);
    assert!(!bench.board.levels[17]);
    assert_eq!(bench.edges_of(2, true), [0_u64; 0]);
    assert_eq!(bench.shutdown(), None);
    bench.send(&Command::AllocateOids { count: OBJECTS as u8 });
    assert_eq!(bench.shutdown(), None, "a new configuration can be made");
}

#[test]
fn the_clock_is_told_in_both_widths_and_across_wraps() {
    let mut bench = Bench::at(u64::from(u32::MAX) - 10);
    bench.run_for(1);
    // The firmware counts its own wraps: it cannot know of those before it started.
    for wraps in [1_u64, 2, 3] {
        bench.run_until((wraps << 32) + 5);
        bench.board.sent.clear();
        bench.send_all(&[Command::GetUptime {}, Command::GetClock {}]);
        let expected = [format!("Uptime {{ high: {wraps}, clock: 5 }}"), "Clock { clock: 5 }".to_owned()];
        assert_eq!(bench.said(), expected);
    }
}

#[test]
fn statistics_come_every_five_seconds() {
    let mut bench = Bench::at(0);
    bench.board.ticks_per_read = 1;
    bench.run_for(21 * SECOND);
    let counts = bench.pick(|response| match *response {
        Response::Stats { count, sum, .. } => Some((count, sum)),
        _ => None,
    });
    assert_eq!(counts.len(), 4);
    assert!(counts.iter().all(|&(count, sum)| count >= 1 && sum >= count), "{counts:?}");
}

#[test]
fn a_shutdown_answers_every_block_once_and_some_commands_still() {
    let mut bench = Bench::configured(0, &[stepper(0)]);
    bench.send_together(&[Command::EmergencyStop {}, steps(0, 1, 1, 0)]);
    let reason = ShutdownReason::EmergencyStop as u16;
    assert_eq!(
        bench.said().last().cloned(),
        Some(format!("Shutdown {{ clock: 0, static_string_id: {reason} }}"))
    );
    bench.send_together(&[steps(0, 1, 1, 0), Command::StepperGetPosition { oid: 0 }, Command::GetClock {}]);
    assert_eq!(
        bench.said(),
        [format!("IsShutdown {{ static_string_id: {reason} }}"), "Clock { clock: 0 }".to_owned()]
    );
    bench.send(&Command::EmergencyStop {});
    assert_eq!(bench.said(), [format!("IsShutdown {{ static_string_id: {reason} }}")]);
}

#[test]
fn a_shutdown_without_room_is_announced_later() {
    let mut bench = Bench::at(0);
    bench.run_for(1);
    bench.board.has_room = false;
    bench.send(&Command::EmergencyStop {});
    bench.run_for(1000);
    assert!(bench.firmware.has_tasks());
    bench.board.has_room = true;
    bench.board.sent.clear();
    bench.run_for(1000);
    assert_eq!(bench.said(), ["Shutdown { clock: 1, static_string_id: 2 }"]);
}

#[test]
fn the_number_of_the_next_block_outlives_a_shutdown() {
    let mut bench = Bench::at(0);
    bench.send_all(&[Command::EmergencyStop {}, Command::ClearShutdown {}, Command::ConfigReset {}]);
    bench.board.sent.clear();
    bench.firmware.receive(&mut bench.board, Block::new(1, &[]).as_bytes());
    assert_eq!(acks(&mut bench), [3]);
    assert_eq!(Block::new(1, &[]).as_bytes().len(), BLOCK_BYTES_MIN);
}
