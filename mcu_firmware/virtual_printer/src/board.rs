//! The simulated board: pins, converter and transmitter as the firmware core sees them, and what hangs on them.
//!
//! Keeps the clock, which only the event loop moves. Does not know commands or when what happens next.

use crate::gantry::Gantry;
use crate::heater::{DutyMeter, FanState, HeaterState, Sensor};
use crate::machine::{Filament, MOTORS_MAX};
use crate::motor::MotorState;
use crate::pipe::Pipe;
use crate::profile::BoardProfile;
use crate::random::Random;
use crate::recorder::Recorder;
use crate::switch::Switch;
use crate::thermistor::{ADC_MAX, counts};
use firmware_core::{AnalogSample, Board, Pin, PinError, Pull};
use units::{Celsius, Clock32, Ticks};

/// How long the converter works on a reading.
const CONVERSION_S: f64 = 10e-6;

/// What a pin is wired to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    Nothing,
    Step(u8),
    Dir(u8),
    /// The motors whose drivers hang on this pin, one bit each.
    Enable(u16),
    Heater(u8),
    Fan(u8),
    Endstop(u8),
    Sensor(u8),
}

const _: () = assert!(MOTORS_MAX <= u16::BITS as usize);

/// What the firmware made of a pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    /// As after power-up: nothing is driven.
    Unset,
    Output,
    Input(Pull),
    Analog,
}

/// A motor with its driver.
#[derive(Clone, Debug)]
pub(crate) struct Axis {
    pub(crate) name: String,
    pub(crate) motor: MotorState,
    pub(crate) step_inverted: bool,
    pub(crate) dir_inverted: bool,
    /// `None`: always energised.
    pub(crate) enable_inverted: Option<bool>,
    pub(crate) step_active: bool,
    pub(crate) forward: bool,
    pub(crate) pulses: u64,
    pub(crate) step_mm: f64,
    pub(crate) start_mm: f64,
    /// By how much it sinks without power, in microsteps.
    pub(crate) sag: f64,
}

/// What presses a switch.
#[derive(Clone, Debug)]
pub(crate) enum Sits {
    /// A motor's own load: the motor, and the switch's place among its own.
    Motor(usize, usize),
    /// A carriage that several motors move: the axis, the switch, and where the carriage was in mm at which clock.
    Carriage { axis: usize, switch: Switch, at: f64, clock: u64 },
}

/// A switch, as wired.
#[derive(Clone, Debug)]
pub(crate) struct EndstopWiring {
    pub(crate) name: String,
    pub(crate) sits: Sits,
    pub(crate) inverted: bool,
    /// Set by a fault: what it reads as, whatever the carriage does.
    pub(crate) stuck: Option<bool>,
}

/// A heater, as wired.
#[derive(Clone, Debug)]
pub(crate) struct HeaterWiring {
    pub(crate) name: String,
    pub(crate) inverted: bool,
    pub(crate) meter: DutyMeter,
    pub(crate) state: HeaterState,
    pub(crate) sensor: Sensor,
    pub(crate) fan: Option<usize>,
    pub(crate) filament: Option<Filament>,
    /// Volume of filament per microstep, mm³.
    pub(crate) mm3_per_step: f64,
    /// Where the filament's motor stood at the last step of time.
    pub(crate) rotor: f64,
    /// Set by a fault: the share of its power that it takes, whatever the pin says.
    pub(crate) stuck: Option<f64>,
    /// Set by a fault: what the converter reads.
    pub(crate) reads: Option<u16>,
}

/// A fan, as wired.
#[derive(Clone, Debug)]
pub(crate) struct FanWiring {
    pub(crate) name: String,
    pub(crate) inverted: bool,
    pub(crate) meter: DutyMeter,
    pub(crate) state: FanState,
}

/// The board and the machine.
#[derive(Debug)]
pub(crate) struct SimulatedBoard<R> {
    pub(crate) clock: u64,
    pub(crate) profile: BoardProfile,
    pub(crate) dictionary: Vec<u8>,
    pub(crate) roles: Box<[Role; 256]>,
    modes: Box<[Mode; 256]>,
    levels: Box<[bool; 256]>,
    pub(crate) axes: Vec<Axis>,
    pub(crate) gantry: Gantry,
    pub(crate) endstops: Vec<EndstopWiring>,
    pub(crate) heaters: Vec<HeaterWiring>,
    pub(crate) fans: Vec<FanWiring>,
    /// The reading that the converter works on, and when it is ready.
    conversion: Option<(Pin, u64)>,
    conversion_ticks: u64,
    noise: Random,
    pub(crate) up: Pipe,
    /// The machine has power.
    pub(crate) powered: bool,
    /// The cable is in.
    pub(crate) plugged: bool,
    /// Something was sent since the event loop looked.
    pub(crate) sent: bool,
    /// The firmware asked for a restart.
    pub(crate) restart_wanted: bool,
    pub(crate) recorder: R,
}

impl<R: Recorder> SimulatedBoard<R> {
    /// A board with nothing wired to it.
    pub(crate) fn new(profile: BoardProfile, noise: Random, up: Pipe, recorder: R) -> Self {
        Self {
            clock: profile.clock_at_start.0,
            dictionary: profile.description().compressed(),
            roles: Box::new([Role::Nothing; 256]),
            modes: Box::new([Mode::Unset; 256]),
            levels: Box::new([false; 256]),
            axes: Vec::new(),
            gantry: Gantry::default(),
            endstops: Vec::new(),
            heaters: Vec::new(),
            fans: Vec::new(),
            conversion: None,
            conversion_ticks: (CONVERSION_S * f64::from(profile.clock.0)) as u64,
            noise,
            up,
            powered: true,
            plugged: true,
            sent: false,
            restart_wanted: false,
            recorder,
            profile,
        }
    }

    /// A restart: no pin is driven any more.
    pub(crate) fn release_pins(&mut self) {
        self.modes.fill(Mode::Unset);
        self.levels.fill(false);
        self.conversion = None;
        let now = self.clock;
        for axis in &mut self.axes {
            axis.motor.energise(now, self.powered && axis.enable_inverted.is_none());
            if axis.step_active {
                axis.step_active = false;
            }
        }
        for meter in self.heaters.iter_mut().map(|heater| &mut heater.meter) {
            meter.set(now, false);
        }
        for meter in self.fans.iter_mut().map(|fan| &mut fan.meter) {
            meter.set(now, false);
        }
    }

    /// The machine's power is gone.
    pub(crate) fn lose_power(&mut self) {
        self.powered = false;
        self.restart_wanted = true;
        for axis in &mut self.axes {
            axis.motor.lose_power(self.clock, axis.sag);
        }
    }

    /// The machine's power is back.
    pub(crate) fn regain_power(&mut self, chance: &mut Random) {
        self.powered = true;
        for axis in &mut self.axes {
            axis.motor.regain_power(self.clock, chance.chance(0.5));
            axis.motor.energise(self.clock, axis.enable_inverted.is_none());
        }
    }

    /// One step of time of the thermal model, which ended now and took `ticks`.
    pub(crate) fn thermal_step(&mut self, ticks: u64) {
        let now = self.clock;
        for axis in &mut self.axes {
            axis.motor.advance(now);
        }
        self.move_carriages(now);
        for fan in &mut self.fans {
            let duty = fan.meter.take(now, ticks);
            fan.state.step(duty);
        }
        for heater in &mut self.heaters {
            let duty = heater.meter.take(now, ticks);
            let fan = heater.fan.map_or(0.0, |fan| self.fans[fan].state.speed);
            let mut filament_mm3 = 0.0;
            if let Some(filament) = heater.filament {
                let rotor = self.axes[filament.motor].motor.rotor();
                filament_mm3 = (rotor - heater.rotor) * heater.mm3_per_step;
                heater.rotor = rotor;
            }
            heater.state.step(heater.stuck.unwrap_or(duty), fan, filament_mm3);
        }
    }

    /// Where the head is now, as far as the motors hold it.
    fn head(&mut self, now: u64) -> [f64; 3] {
        let mut motors = [0.0; 3];
        for (motor, axis) in motors.iter_mut().zip(&mut self.axes) {
            *motor = axis.start_mm + axis.motor.place(now) * axis.step_mm;
        }
        self.gantry.head(motors)
    }

    /// Lets the carriages press their switches as they have moved since.
    fn move_carriages(&mut self, now: u64) {
        if !self.gantry.is_coupled() {
            return;
        }
        let head = self.head(now);
        for endstop in &mut self.endstops {
            if let Sits::Carriage { axis, switch, at, clock } = &mut endstop.sits {
                switch.moved(*at, head[*axis], *clock, now - *clock);
                (*at, *clock) = (head[*axis], now);
            }
        }
    }

    fn exists(&self, pin: Pin) -> Result<usize, PinError> {
        if self.profile.has_pin(pin) { Ok(usize::from(pin)) } else { Err(PinError) }
    }

    fn drive_enable(&mut self, motors: u16, level: bool) {
        for (index, axis) in self.axes.iter_mut().enumerate() {
            if motors & (1 << index) != 0
                && let Some(inverted) = axis.enable_inverted
            {
                axis.motor.energise(self.clock, level ^ inverted);
            }
        }
    }

    #[inline]
    fn drive_step(&mut self, index: usize, level: bool) {
        let Some(axis) = self.axes.get_mut(index) else { return };
        let active = level ^ axis.step_inverted;
        if active == axis.step_active {
            return;
        }
        axis.step_active = active;
        if active {
            axis.pulses += 1;
            axis.motor.step(self.clock, axis.forward);
            self.recorder.step(index, Ticks(self.clock), axis.forward, axis.motor.field());
        } else {
            self.recorder.step_end(index, Ticks(self.clock));
        }
    }

    fn drive_dir(&mut self, index: usize, level: bool) {
        let Some(axis) = self.axes.get_mut(index) else { return };
        let forward = level ^ axis.dir_inverted;
        if forward != axis.forward {
            axis.forward = forward;
            self.recorder.direction(index, Ticks(self.clock), forward);
        }
    }

    /// What the converter reads at a pin once it is done.
    fn convert(&mut self, pin: Pin) -> u16 {
        let Role::Sensor(index) = self.roles[usize::from(pin)] else {
            // An open input floats around the middle.
            return counts(0.5, 40.0 * self.noise.normal());
        };
        let heater = &self.heaters[usize::from(index)];
        let noise = heater.sensor.noise_counts * self.noise.normal();
        if let Some(reads) = heater.reads {
            return reads;
        }
        let temperature = Celsius(heater.state.sensor_c);
        counts(heater.sensor.thermistor.ratio(temperature, heater.sensor.pull_up), noise).min(ADC_MAX)
    }
}

impl<R: Recorder> Board for SimulatedBoard<R> {
    #[inline]
    fn now(&mut self) -> Clock32 {
        Ticks(self.clock).low()
    }

    fn configure_output(&mut self, pin: Pin, level: bool) -> Result<(), PinError> {
        let index = self.exists(pin)?;
        let first = self.modes[index] != Mode::Output;
        self.modes[index] = Mode::Output;
        if first && let Role::Step(axis) = self.roles[index] {
            // The level that an input happened to have before is no pulse.
            let axis = &mut self.axes[usize::from(axis)];
            axis.step_active = level ^ axis.step_inverted;
        }
        self.set_pin(pin, level);
        Ok(())
    }

    fn configure_input(&mut self, pin: Pin, pull: Pull) -> Result<(), PinError> {
        let index = self.exists(pin)?;
        self.modes[index] = Mode::Input(pull);
        Ok(())
    }

    fn configure_analog(&mut self, pin: Pin) -> Result<(), PinError> {
        let index = self.exists(pin)?;
        if !self.profile.analog_pins.contains(&pin) {
            return Err(PinError);
        }
        self.modes[index] = Mode::Analog;
        Ok(())
    }

    #[inline]
    fn set_pin(&mut self, pin: Pin, level: bool) {
        let index = usize::from(pin);
        self.levels[index] = level;
        match self.roles[index] {
            Role::Step(axis) => self.drive_step(usize::from(axis), level),
            Role::Dir(axis) => self.drive_dir(usize::from(axis), level),
            Role::Enable(motors) => self.drive_enable(motors, level),
            Role::Heater(heater) => {
                let heater = &mut self.heaters[usize::from(heater)];
                heater.meter.set(self.clock, level ^ heater.inverted);
            }
            Role::Fan(fan) => {
                let fan = &mut self.fans[usize::from(fan)];
                fan.meter.set(self.clock, level ^ fan.inverted);
            }
            Role::Nothing | Role::Endstop(_) | Role::Sensor(_) => {}
        }
    }

    fn read_pin(&mut self, pin: Pin) -> bool {
        let index = usize::from(pin);
        if let Role::Endstop(endstop) = self.roles[index] {
            let now = self.clock;
            self.move_carriages(now);
            let endstop = &self.endstops[usize::from(endstop)];
            let closed = match &endstop.sits {
                Sits::Motor(axis, switch) => self.axes[*axis].motor.switch_closed(*switch, now),
                Sits::Carriage { switch, .. } => switch.closed(now),
            };
            return endstop.stuck.unwrap_or(closed) ^ endstop.inverted;
        }
        match self.modes[index] {
            Mode::Output => self.levels[index],
            Mode::Input(Pull::Up) => true,
            _ => false,
        }
    }

    fn sample_analog(&mut self, pin: Pin) -> AnalogSample {
        let now = self.clock;
        match self.conversion {
            Some((of, ready)) if now < ready => {
                let wait = (ready - now) as u32;
                AnalogSample::Pending(if of == pin { wait } else { wait + self.conversion_ticks as u32 })
            }
            Some((of, _)) if of == pin => {
                self.conversion = None;
                AnalogSample::Ready(self.convert(pin))
            }
            // Nothing under way, or a reading that nobody fetched.
            _ => {
                self.conversion = Some((pin, now + self.conversion_ticks));
                AnalogSample::Pending(self.conversion_ticks as u32)
            }
        }
    }

    fn cancel_analog(&mut self, pin: Pin) {
        if self.conversion.is_some_and(|(of, _)| of == pin) {
            self.conversion = None;
        }
    }

    fn transmit(&mut self, block: &[u8]) -> bool {
        if !self.plugged {
            // Nobody listens: bytes go nowhere.
            return true;
        }
        if !self.up.has_room(self.clock, block.len()) {
            return false;
        }
        self.up.send(self.clock, block);
        self.sent = true;
        true
    }

    fn dictionary(&self) -> &[u8] {
        &self.dictionary
    }

    fn reset(&mut self) {
        self.restart_wanted = true;
    }
}
