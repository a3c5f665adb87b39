//! What a block costs the core itself: full blocks of commands that do next to nothing, with the block check or without.
//!
//! `valgrind --tool=callgrind --toggle-collect='receive::run*' target/release/examples/receive BLOCKS [checked]`: the
//! instructions over the bytes that it prints.

use firmware_core::{AnalogSample, Board, Firmware, Pin, PinError, Pull};
use units::{Clock32, Hertz};
use wire::{
    Command,
    block::{Block, PAYLOAD_BYTES_MAX},
    check::BlockCheck,
    messages::CommandKind,
};

/// A board that does nothing.
struct Still;

impl Board for Still {
    fn now(&mut self) -> Clock32 {
        Clock32(0)
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
    fn set_pin(&mut self, _: Pin, _: bool) {}
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

/// Alone what the board does, for `--toggle-collect`.
#[inline(never)]
fn run(firmware: &mut Firmware<4, 16>, stream: &[u8]) {
    firmware.receive(&mut Still, stream);
}

fn encoded(commands: &[Command<'_>]) -> Vec<u8> {
    let mut payload = Vec::new();
    assert!(commands.iter().all(|command| command.encode(&mut payload)), "a vector has room");
    payload
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let blocks: usize =
        arguments.first().and_then(|text| text.parse().ok()).expect("usage: receive BLOCKS [checked]");
    let check = BlockCheck::new(CommandKind::BlockCheck.spec().id);
    let checked = arguments.get(1).is_some_and(|word| word == "checked");
    let mut firmware = Box::new(Firmware::<4, 16>::new(Hertz(12_000_000)));
    let config =
        Command::ConfigStepper { oid: 0, step_pin: 0, dir_pin: 1, invert_step: 0, step_pulse_ticks: 24 };
    let setup = encoded(&[Command::AllocateOids { count: 1 }, config, Command::FinalizeConfig { crc: 1 }]);
    firmware.receive(&mut Still, Block::new(0, &setup).as_bytes());
    let one = encoded(&[Command::SetNextStepDir { oid: 0, dir: 1 }]);
    let room = PAYLOAD_BYTES_MAX - if checked { check.len() } else { 0 };
    let payload = one.repeat(room / one.len());
    let mut stream = Vec::new();
    for number in 1..=blocks {
        let block =
            if checked { check.seal(number as u8, &payload) } else { Block::new(number as u8, &payload) };
        stream.extend(block.as_bytes());
    }
    run(&mut firmware, &stream);
    println!(
        "{} bytes, {} of them messages, {:?}",
        stream.len(),
        blocks * payload.len(),
        firmware.shutdown_reason()
    );
}
