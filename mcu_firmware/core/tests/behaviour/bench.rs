//! A board made of memory, and a host that knows the protocol and nothing else. Time is the test's.

use firmware_core::{AnalogSample, Board, Firmware, Pin, PinError, Pull};
use units::{Clock32, Hertz, Ticks};
use wire::{
    Command, Response, ShutdownReason,
    block::{Block, Deframer, Frame, PAYLOAD_BYTES_MAX},
};

pub(crate) const CLOCK: Hertz = Hertz(12_000_000);
pub(crate) const MILLISECOND: u64 = 12_000;
pub(crate) const SECOND: u64 = 12_000_000;
pub(crate) const OBJECTS: usize = 24;
pub(crate) const MOVES: usize = 256;

const PINS: Pin = 30;
const ANALOG_PINS: std::ops::RangeInclusive<Pin> = 26..=29;

/// A change of an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Edge {
    pub(crate) at: u64,
    pub(crate) pin: Pin,
    pub(crate) level: bool,
}

#[derive(Default)]
pub(crate) struct FakeBoard {
    pub(crate) now: u64,
    /// Added to the clock each time that it is read, as time passes on a chip.
    pub(crate) ticks_per_read: u64,
    pub(crate) levels: [bool; PINS as usize],
    pub(crate) edges: Vec<Edge>,
    /// Changes of inputs that are to come.
    pub(crate) inputs: Vec<Edge>,
    pub(crate) analog: [u16; PINS as usize],
    /// How long a reading takes; 0 is none at all.
    pub(crate) conversion_ticks: u32,
    converting: [bool; PINS as usize],
    pub(crate) has_room: bool,
    pub(crate) sent: Vec<u8>,
    pub(crate) dictionary: Vec<u8>,
    pub(crate) resets: u32,
    /// The resistors of the inputs, in the order in which they were configured.
    pub(crate) pulls: Vec<(Pin, Pull)>,
}

impl Board for FakeBoard {
    fn now(&mut self) -> Clock32 {
        self.now += self.ticks_per_read;
        Ticks(self.now).low()
    }

    fn configure_output(&mut self, pin: Pin, level: bool) -> Result<(), PinError> {
        *self.levels.get_mut(usize::from(pin)).ok_or(PinError)? = level;
        Ok(())
    }

    fn configure_input(&mut self, pin: Pin, pull: Pull) -> Result<(), PinError> {
        self.pulls.push((pin, pull));
        if pin < PINS { Ok(()) } else { Err(PinError) }
    }

    fn configure_analog(&mut self, pin: Pin) -> Result<(), PinError> {
        if ANALOG_PINS.contains(&pin) { Ok(()) } else { Err(PinError) }
    }

    fn set_pin(&mut self, pin: Pin, level: bool) {
        let known = &mut self.levels[usize::from(pin)];
        if *known != level {
            *known = level;
            self.edges.push(Edge { at: self.now, pin, level });
        }
    }

    fn read_pin(&mut self, pin: Pin) -> bool {
        let past = self.inputs.iter().filter(|edge| edge.pin == pin && edge.at <= self.now);
        past.max_by_key(|edge| edge.at).is_some_and(|edge| edge.level)
    }

    fn sample_analog(&mut self, pin: Pin) -> AnalogSample {
        let converting = &mut self.converting[usize::from(pin)];
        *converting = self.conversion_ticks != 0 && !*converting;
        if *converting {
            AnalogSample::Pending(self.conversion_ticks)
        } else {
            AnalogSample::Ready(self.analog[usize::from(pin)])
        }
    }

    fn transmit(&mut self, block: &[u8]) -> bool {
        if self.has_room {
            self.sent.extend_from_slice(block);
        }
        self.has_room
    }

    fn dictionary(&self) -> &[u8] {
        &self.dictionary
    }

    fn reset(&mut self) {
        self.resets += 1;
    }
}

/// A board and its host.
pub(crate) struct Bench {
    pub(crate) firmware: Box<Firmware<OBJECTS, MOVES>>,
    pub(crate) board: FakeBoard,
    sequence: u8,
}

impl Bench {
    /// A board that has just started, at a clock of `now`.
    pub(crate) fn at(now: u64) -> Self {
        let board = FakeBoard { now, has_room: true, analog: [2000; 30], ..FakeBoard::default() };
        Self { firmware: Box::new(Firmware::new(CLOCK)), board, sequence: 0 }
    }

    /// The same with plain Klipper firmware.
    pub(crate) fn plain(now: u64) -> Self {
        let mut bench = Self::at(now);
        *bench.firmware = Firmware::new(CLOCK).plain();
        bench
    }

    /// A board whose host has configured `commands`.
    pub(crate) fn configured(now: u64, commands: &[Command<'_>]) -> Self {
        let mut bench = Self::at(now);
        bench.send(&Command::AllocateOids { count: OBJECTS as u8 });
        bench.send_all(commands);
        bench.send(&Command::FinalizeConfig { crc: 7 });
        assert_eq!(bench.firmware.shutdown_reason(), None);
        bench
    }

    /// Hands the board bytes as they are.
    pub(crate) fn receive(&mut self, bytes: &[u8]) {
        self.firmware.receive(&mut self.board, bytes);
        self.firmware.run_timers(&mut self.board);
    }

    /// Sends a block with the next number.
    pub(crate) fn send_payload(&mut self, payload: &[u8]) {
        self.receive(Block::new(self.sequence, payload).as_bytes());
        self.sequence = self.sequence.wrapping_add(1);
    }

    /// Sends commands, a block each, from this number on.
    pub(crate) fn send_from(&mut self, sequence: u8, commands: &[Command<'_>]) {
        self.sequence = sequence;
        self.send_all(commands);
    }

    pub(crate) fn send(&mut self, command: &Command<'_>) {
        let mut payload = Vec::new();
        assert!(command.encode(&mut payload));
        self.send_payload(&payload);
    }

    pub(crate) fn send_all(&mut self, commands: &[Command<'_>]) {
        for command in commands {
            self.send(command);
        }
    }

    /// Several commands in as few blocks as they fit.
    pub(crate) fn send_together(&mut self, commands: &[Command<'_>]) {
        let mut payload = Vec::new();
        for command in commands {
            let mut bytes = Vec::new();
            assert!(command.encode(&mut bytes));
            if payload.len() + bytes.len() > PAYLOAD_BYTES_MAX {
                self.send_payload(&payload);
                payload.clear();
            }
            payload.extend(bytes);
        }
        self.send_payload(&payload);
    }

    /// Lets time pass, as a timer interrupt would see it.
    pub(crate) fn run_until(&mut self, until: u64) {
        loop {
            let mut next = self.firmware.run_timers(&mut self.board);
            if self.firmware.has_tasks() {
                self.firmware.run_tasks(&mut self.board);
                next = self.firmware.run_timers(&mut self.board);
            }
            let next = Ticks(self.board.now).nearest(next).0;
            assert!(next > self.board.now, "a timer that was due did not run");
            if next > until {
                self.board.now = self.board.now.max(until);
                return;
            }
            self.board.now = next;
        }
    }

    pub(crate) fn run_for(&mut self, ticks: u64) {
        self.run_until(self.board.now + ticks);
    }

    /// What the board has said since the last time, acknowledgements left out.
    pub(crate) fn said(&mut self) -> Vec<String> {
        self.pick(|response| Some(format!("{response:?}")))
    }

    pub(crate) fn pick<T>(&mut self, mut wanted: impl FnMut(&Response<'_>) -> Option<T>) -> Vec<T> {
        let mut picked = Vec::new();
        for (_, mut payload) in self.blocks().iter().map(|(sequence, bytes)| (sequence, &bytes[..])) {
            while !payload.is_empty() {
                let response = Response::decode(&mut payload).expect("the board speaks its own language");
                picked.extend(wanted(&response));
            }
        }
        picked
    }

    /// The blocks that the board has sent since the last time.
    pub(crate) fn blocks(&mut self) -> Vec<(u8, Vec<u8>)> {
        let mut blocks = Vec::new();
        Deframer::new().push(&std::mem::take(&mut self.board.sent), |frame| match frame {
            Frame::Block { sequence, payload } => blocks.push((sequence, payload.to_vec())),
            Frame::Garbage => panic!("the board sends no garbage"),
        });
        blocks
    }

    pub(crate) fn position(&mut self, oid: u8) -> i32 {
        self.board.sent.clear();
        self.send(&Command::StepperGetPosition { oid });
        let positions = self.pick(|response| match *response {
            Response::StepperPosition { pos, .. } => Some(pos),
            _ => None,
        });
        assert_eq!(positions.len(), 1, "{:?}", self.firmware.shutdown_reason());
        positions[0]
    }

    pub(crate) fn shutdown(&self) -> Option<ShutdownReason> {
        self.firmware.shutdown_reason()
    }

    /// When a pin rose, or fell.
    pub(crate) fn edges_of(&self, pin: Pin, level: bool) -> Vec<u64> {
        let edges = self.board.edges.iter();
        edges.filter(|edge| edge.pin == pin && edge.level == level).map(|edge| edge.at).collect()
    }
}

pub(crate) const STEP_PIN: Pin = 2;
pub(crate) const DIR_PIN: Pin = 3;
pub(crate) const PULSE: u32 = 24;

pub(crate) const fn stepper(oid: u8) -> Command<'static> {
    Command::ConfigStepper {
        oid,
        step_pin: STEP_PIN,
        dir_pin: DIR_PIN,
        invert_step: 0,
        step_pulse_ticks: PULSE,
    }
}

pub(crate) const fn steps(oid: u8, interval: u32, count: u16, add: i16) -> Command<'static> {
    Command::QueueStep { oid, interval, count, add }
}

pub(crate) const fn output(oid: u8, max_duration: u32) -> Command<'static> {
    Command::ConfigDigitalOut { oid, pin: 17, value: 0, default_value: 0, max_duration }
}
