//! A host that is just enough to drive the virtual printer: it numbers blocks and never repeats one.

use units::{Celsius, Mm, Seconds, Ticks};
use virtual_printer::{
    BoardProfile, Endstop, Fan, Faults, Filament, Heater, Machine, Mechanics, Motor, Plant, Recorder, Sensor,
    Side, State, VirtualPrinter, Wire,
};
use wire::block::{Block, Deframer, Frame};
use wire::{Command, Response};

/// A payload of the board's, and when it came.
pub(crate) struct Answer {
    pub(crate) at: Ticks,
    pub(crate) payload: Vec<u8>,
}

pub(crate) struct Host<R: Recorder> {
    pub(crate) printer: VirtualPrinter<R>,
    pub(crate) answers: Vec<Answer>,
    sequence: u8,
    deframer: Deframer,
}

pub(crate) const STEP_MM: f64 = 0.0125;

/// X with an endstop at 0, E, a hot end, a fan.
pub(crate) fn machine() -> Machine {
    let motor = |name: &str, pins: [&str; 3], mechanics, frame| Motor {
        name: name.into(),
        step: Wire::new(pins[0], false),
        dir: Wire::new(pins[1], false),
        enable: Some(Wire::new(pins[2], true)),
        mechanics,
        step_distance: Mm(STEP_MM),
        start: Mm(20.0),
        sag: Mm(0.0),
        frame,
    };
    let frame = Some((Mm(-3.0), Mm(203.0)));
    Machine {
        motors: vec![
            motor("stepper_x", ["gpio2", "gpio3", "gpio4"], Mechanics::nema17(16, 40.0, 0.5), frame),
            motor("extruder", ["gpio14", "gpio15", "gpio16"], Mechanics::extruder(16), None),
        ],
        endstops: vec![Endstop {
            name: "stepper_x".into(),
            wire: Wire::new("gpio5", false),
            motor: 0,
            side: Side::Min,
            position: Mm(0.0),
        }],
        heaters: vec![Heater {
            name: "extruder".into(),
            wire: Wire::new("gpio17", false),
            sensor_pin: "gpio26".into(),
            sensor: Sensor::default(),
            plant: Plant { ambient: Celsius(22.0), ..Plant::hot_end() },
            fan: Some(0),
            filament: Some(Filament { motor: 1, diameter: Mm(1.75) }),
        }],
        fans: vec![Fan { name: "fan".into(), wire: Wire::new("gpio19", false) }],
        ..Machine::default()
    }
}

impl<R: Recorder> Host<R> {
    pub(crate) fn new(profile: BoardProfile, machine: &Machine, faults: &str, recorder: R) -> Self {
        let mut script = Faults::default();
        if !faults.is_empty() {
            script = faults.parse().expect("faults");
        }
        let printer = VirtualPrinter::new(profile, machine, &script, 42, recorder).expect("a sound machine");
        Self { printer, answers: Vec::new(), sequence: 0, deframer: Deframer::new() }
    }

    /// An rp2040 with the usual machine.
    pub(crate) fn usual(faults: &str, recorder: R) -> Self {
        Self::new(BoardProfile::rp2040(), &machine(), faults, recorder)
    }

    pub(crate) fn send(&mut self, commands: &[Command<'_>]) {
        for command in commands {
            let mut payload = Vec::new();
            assert!(command.encode(&mut payload));
            self.printer.write(Block::new(self.sequence, &payload).as_bytes());
            self.sequence = (self.sequence + 1) & 15;
        }
    }

    pub(crate) fn run(&mut self, duration: f64) {
        let until = self.after(duration);
        self.run_to(until);
    }

    pub(crate) fn run_to(&mut self, until: Ticks) {
        let mut bytes = Vec::new();
        while self.printer.now() < until {
            bytes.clear();
            let at = self.printer.run_until(until, &mut bytes);
            self.deframer.push(&bytes, |frame| {
                if let Frame::Block { payload, .. } = frame {
                    self.answers.push(Answer { at, payload: payload.to_vec() });
                }
            });
        }
    }

    /// The clock so many seconds from now.
    pub(crate) fn after(&self, seconds: f64) -> Ticks {
        self.printer.now() + self.printer.profile().clock.ticks_in(Seconds(seconds))
    }

    /// The clock so many seconds after power-up.
    pub(crate) fn since_start(&self, seconds: f64) -> Ticks {
        self.printer.start() + self.printer.profile().clock.ticks_in(Seconds(seconds))
    }

    /// All messages of one kind, in order: what `pick` makes of them.
    pub(crate) fn all<T>(&self, pick: impl Fn(Response<'_>) -> Option<T>) -> Vec<T> {
        let mut found = Vec::new();
        for answer in &self.answers {
            let mut rest = &answer.payload[..];
            while !rest.is_empty() {
                found.extend(Response::decode(&mut rest).ok().and_then(&pick));
            }
        }
        found
    }

    pub(crate) fn state(&mut self) -> State {
        self.printer.state()
    }
}
