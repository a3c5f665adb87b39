//! What a step costs the core itself: steppers at full speed on a board that does nothing.
//!
//! `valgrind --tool=callgrind --toggle-collect='steps::run*' target/release/examples/steps STEPPERS ROWS`: the instructions
//! over the steps. Without the toggle, sending and queueing the rows is in it too.

use firmware_core::{AnalogSample, Board, Firmware, Pin, PinError, Pull};
use units::{Clock32, Hertz};
use wire::{Command, block::Block};

const CLOCK: Hertz = Hertz(12_000_000);
const STEPS_A_ROW: u16 = 20;
const ROWS_MAX: usize = 8000;
const INTERVAL: u32 = 150;

/// A clock, and pins that count how often they rise.
struct Still {
    now: u32,
    pulses: u64,
}

impl Board for Still {
    #[inline]
    fn now(&mut self) -> Clock32 {
        Clock32(self.now)
    }
    fn configure_output(&mut self, _: Pin, _: bool) -> Result<(), PinError> {
        Ok(())
    }
    fn configure_input(&mut self, _: Pin, _: Pull) -> Result<(), PinError> {
        Ok(())
    }
    fn configure_analog(&mut self, _: Pin) -> Result<(), PinError> {
        Ok(())
    }
    #[inline]
    fn set_pin(&mut self, _: Pin, level: bool) {
        self.pulses += u64::from(level);
    }
    fn read_pin(&mut self, _: Pin) -> bool {
        false
    }
    fn sample_analog(&mut self, _: Pin) -> AnalogSample {
        AnalogSample::Ready(0)
    }
    fn transmit(&mut self, _: &[u8]) -> bool {
        true
    }
    fn dictionary(&self) -> &[u8] {
        &[]
    }
    fn reset(&mut self) {}
}

struct Host {
    firmware: Box<Firmware<16, ROWS_MAX>>,
    board: Still,
    sequence: u8,
}

impl Host {
    fn send(&mut self, command: &Command<'_>) {
        let mut payload = Vec::new();
        assert!(command.encode(&mut payload), "a vector has room");
        self.firmware.receive(&mut self.board, Block::new(self.sequence, &payload).as_bytes());
        self.sequence = self.sequence.wrapping_add(1);
    }
}

/// Alone what happens at the timers, for `--toggle-collect`.
#[inline(never)]
fn run(host: &mut Host, pulses: u64) {
    while host.board.pulses < pulses && host.firmware.shutdown_reason().is_none() {
        host.board.now = host.firmware.run_timers(&mut host.board).0;
    }
}

fn main() {
    let numbers: Vec<u32> = std::env::args().skip(1).map(|text| text.parse().expect("a number")).collect();
    let &[steppers, rows] = &numbers[..] else { panic!("usage: steps STEPPERS ROWS") };
    let firmware = Box::new(Firmware::new(CLOCK));
    let mut host = Host { firmware, board: Still { now: 0, pulses: 0 }, sequence: 0 };
    let steppers = steppers as u8;
    host.send(&Command::AllocateOids { count: steppers });
    for oid in 0..steppers {
        let (step_pin, dir_pin) = (2 * oid, 2 * oid + 1);
        host.send(&Command::ConfigStepper { oid, step_pin, dir_pin, invert_step: 0, step_pulse_ticks: 24 });
    }
    host.send(&Command::FinalizeConfig { crc: 1 });
    for oid in 0..steppers {
        host.send(&Command::ResetStepClock { oid, clock: CLOCK.0 + 47 * u32::from(oid) });
        for row in 0..rows {
            let add = if row % 2 == 0 { 1 } else { -1 };
            host.send(&Command::QueueStep { oid, interval: INTERVAL, count: STEPS_A_ROW, add });
        }
    }
    let expected = u64::from(rows) * u64::from(STEPS_A_ROW) * u64::from(steppers);
    run(&mut host, expected);
    println!("{steppers} steppers: {} steps, {:?}", host.board.pulses, host.firmware.shutdown_reason());
}
