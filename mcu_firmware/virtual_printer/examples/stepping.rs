//! What a step costs: four motors at high speed, and at a print's usual one.
//!
//! `cargo run --release -p virtual-printer --example stepping`

use std::time::Instant;
use units::{Mm, Seconds, Ticks};
use virtual_printer::{BoardProfile, Faults, Machine, Mechanics, Motor, VirtualPrinter, Wire};
use wire::{Command, block::Block};

const MOTORS: u8 = 4;

fn machine() -> Machine {
    let pin = |number: u8| Wire::new(format!("gpio{number}"), false);
    let motor = |index: u8| Motor {
        name: format!("motor{index}"),
        step: pin(2 * index),
        dir: pin(2 * index + 1),
        enable: None,
        mechanics: Mechanics::nema17(16, 40.0, 0.5),
        step_distance: Mm(0.0125),
        start: Mm(0.0),
        frame: None,
        sag: Mm(0.0),
    };
    Machine { motors: (0..MOTORS).map(motor).collect(), ..Machine::default() }
}

/// Numbers and writes commands, one a block.
struct Host {
    printer: VirtualPrinter<()>,
    sequence: u8,
}

impl Host {
    fn send(&mut self, command: Command<'_>) {
        let mut payload = Vec::new();
        assert!(command.encode(&mut payload));
        self.printer.write(Block::new(self.sequence, &payload).as_bytes());
        self.sequence = (self.sequence + 1) & 15;
    }
}

fn measure(steps_per_s: u32, seconds: u32) {
    let profile = BoardProfile::rp2040();
    let clock = profile.clock;
    let printer =
        VirtualPrinter::new(profile, &machine(), &Faults::default(), 1, ()).expect("a sound machine");
    let mut host = Host { printer, sequence: 0 };
    host.send(Command::AllocateOids { count: MOTORS });
    for oid in 0..MOTORS {
        let (step_pin, dir_pin) = (2 * oid, 2 * oid + 1);
        host.send(Command::ConfigStepper { oid, step_pin, dir_pin, invert_step: 0, step_pulse_ticks: 24 });
    }
    host.send(Command::FinalizeConfig { crc: 1 });
    let start = host.printer.now() + clock.ticks_in(Seconds(0.5));
    let interval = clock.0 / steps_per_s;
    let ramp = |part: u32| interval + part * part * 6;
    for oid in 0..MOTORS {
        // Not all on the same tick.
        let at = Ticks(start.0 + u64::from(oid) * 101);
        host.send(Command::ResetStepClock { oid, clock: at.low().0 });
        // Rotors neither start nor stop at this speed: a ramp on both sides.
        for part in (1..40).rev() {
            host.send(Command::QueueStep { oid, interval: ramp(part), count: 40, add: 0 });
        }
        for _ in 0..seconds {
            host.send(Command::QueueStep { oid, interval, count: steps_per_s as u16, add: 0 });
        }
        for part in 1..40 {
            host.send(Command::QueueStep { oid, interval: ramp(part), count: 40, add: 0 });
        }
    }
    let mut to_host = Vec::new();
    let end = start + clock.ticks_in(Seconds(f64::from(seconds) + 1.0));
    let began = Instant::now();
    while host.printer.run_until(end, &mut to_host) < end {}
    let took_s = began.elapsed().as_secs_f64();
    let state = host.printer.state();
    let pulses: u64 = state.motors.iter().map(|motor| motor.pulses).sum();
    let lost: i64 = state.motors.iter().map(|motor| motor.lost.0.abs()).sum();
    println!(
        "{MOTORS} motors at {steps_per_s} steps/s: {pulses} steps in {took_s:.3} s, {:.0} ns a step, {:.2} ms per \
         second of the board's; {lost} lost; shutdown: {:?}",
        took_s * 1e9 / pulses as f64,
        took_s * 1e3 / f64::from(seconds),
        state.shutdown
    );
}

fn main() {
    measure(20_000, 30);
    // A usual print's mean.
    measure(1500, 600);
}
