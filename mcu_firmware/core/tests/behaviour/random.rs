//! Whatever arrives, the firmware neither panics nor hangs nor leaves the pins that it was given.

use firmware_core::Firmware;
use proptest::{collection::vec, prelude::*};
use wire::{
    block::Block,
    messages::{Command, CommandKind},
    vlq,
};

use crate::bench::{Bench, CLOCK, SECOND, output, stepper};

/// Objects of every kind, so that random oids hit some.
const CONFIG: [Command<'static>; 12] = [
    stepper(0),
    output(1, 36_000_000),
    Command::ConfigTrsync { oid: 2 },
    Command::ConfigEndstop { oid: 3, pin: 5, pull_up: 0 },
    Command::ConfigAnalogIn { oid: 4, pin: 26 },
    output(5, 0),
    Command::SetDigitalOutPwmCycle { oid: 1, cycle_ticks: 1000 },
    Command::ConfigHeater { oid: 6, adc_oid: 4, out_oid: 1, sample_count: 2, max_power: 4096, smooth: 1000 },
    Command::HeaterPoint { oid: 6, sum: 100, temperature: 300 },
    Command::HeaterPoint { oid: 6, sum: 60_000, temperature: 0 },
    Command::HeaterPid { oid: 6, kp: 1 << 24, ki: 1 << 20, kd: 0 },
    Command::HeaterCheck { oid: 6, max_error: 1, gain_time: 1000, hysteresis: 1, gain: 1 },
];

/// A number near the limits of what the protocol can say, small, or near the present clock.
fn number() -> impl Strategy<Value = i64> {
    prop_oneof![0..6_i64, 0..300_i64, 0..70_000_i64, -40_000..40_000_i64, any::<i32>().prop_map(i64::from)]
}

/// A command with the right number of fields and random values: most decode.
fn command() -> impl Strategy<Value = Vec<u8>> {
    (0..CommandKind::ALL.len(), vec(number(), 9)).prop_map(|(which, values)| {
        let spec = CommandKind::ALL[which].spec();
        let mut bytes = Vec::new();
        vlq::encode(i32::from(spec.id), &mut bytes);
        for (field, value) in spec.fields.iter().zip(values) {
            let value = match field.format {
                "%c" => value.rem_euclid(256),
                "%hu" => value.rem_euclid(1 << 16),
                "%hi" => value.rem_euclid(1 << 16) - (1 << 15),
                _ => value,
            };
            // Oids of objects that exist are what leads furthest.
            let value = if field.name.ends_with("oid") { value % 7 } else { value };
            vlq::encode(value as i32, &mut bytes);
        }
        bytes
    })
}

/// As [`Bench::run_until`], for a firmware whose random timers may come at any rate.
fn run_for(bench: &mut Bench, ticks: u64) {
    const ROUNDS_MAX: u32 = 200;
    let until = bench.board.now + ticks;
    for _ in 0..ROUNDS_MAX {
        bench.firmware.run_timers(&mut bench.board);
        bench.firmware.run_tasks(&mut bench.board);
        let next = bench.firmware.run_timers(&mut bench.board);
        let next = units::Ticks(bench.board.now).nearest(next).0;
        assert!(next > bench.board.now, "a timer that was due did not run");
        bench.board.now = next.min(until);
    }
}

proptest! {
    #[test]
    fn random_bytes_are_survived(bytes: Vec<u8>, piece in 1_usize..70) {
        let mut bench = Bench::at(0);
        for chunk in bytes.chunks(piece) {
            bench.firmware.receive(&mut bench.board, chunk);
        }
        run_for(&mut bench, SECOND);
    }

    #[test]
    fn random_payloads_are_survived(payloads in vec(vec(any::<u8>(), 0..59), 0..20)) {
        let mut bench = Bench::configured(0, &CONFIG);
        for payload in payloads {
            bench.send_payload(&payload);
            bench.send(&Command::ClearShutdown {});
        }
        run_for(&mut bench, SECOND);
    }

    #[test]
    fn random_commands_are_survived(now: u32, clear: bool, commands in vec((command(), 0..100_000_u64), 0..60)) {
        let mut bench = Bench::configured(u64::from(now), &CONFIG);
        for (payload, pause) in commands {
            bench.send_payload(&payload);
            if clear && bench.shutdown().is_some() {
                bench.send(&Command::ClearShutdown {});
                bench.send(&Command::AllocateOids { count: 7 });
                bench.send_all(&CONFIG);
                bench.send(&Command::FinalizeConfig { crc: 0 });
            }
            run_for(&mut bench, pause);
            if bench.shutdown().is_some() {
                prop_assert!(!bench.board.levels[17], "an output that is not at its default");
            }
        }
    }

    #[test]
    fn a_tiny_board_survives_too(commands in vec(command(), 0..40)) {
        let mut bench = Bench::at(0);
        let mut firmware = Box::new(Firmware::<1, 1>::new(CLOCK));
        for (sequence, payload) in commands.iter().enumerate() {
            firmware.receive(&mut bench.board, Block::new(sequence as u8, payload).as_bytes());
            firmware.run_timers(&mut bench.board);
            firmware.run_tasks(&mut bench.board);
            bench.board.now += 10;
        }
    }
}
