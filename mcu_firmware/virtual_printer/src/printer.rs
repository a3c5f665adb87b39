//! The virtual printer: firmware, board and machine in virtual time.
//!
//! An event loop that goes from one event to the next: a timer of the firmware, bytes that arrive, a step of the thermal
//! model, a failure. Between events nothing happens and nothing is computed; motors are integrated when somebody asks.
//! The same bytes at the same times give the same run, however the caller cuts the time into pieces.
//!
//! Does not know a real clock, a port or a file.

use crate::board::{Axis, EndstopWiring, FanWiring, HeaterWiring, SimulatedBoard, Sits};
use crate::faults::{Failure, FailureKind, Faults};
use crate::heater::THERMAL_STEP_S;
use crate::machine::{Machine, WiringError};
use crate::pipe::Pipe;
use crate::profile::{BoardProfile, LinkProfile, MOVES_MAX};
use crate::random::{Random, Source};
use crate::recorder::Recorder;
use crate::state::{EndstopView, FanView, HeaterView, MotorView, State};
use crate::thermistor::ADC_MAX;
use crate::wiring;
use firmware_core::Firmware;
use units::{Celsius, Mm, Seconds, StepCount, Ticks};

/// Objects (oids) that the boards have room for.
pub const OBJECTS_MAX: usize = 96;
/// A task that could not finish (no room to transmit) is tried again after this time.
const TASK_RETRY_S: f64 = 0.0005;
/// No event.
const NEVER: u64 = u64::MAX;
/// The end of a restart that waits for power.
const WITHOUT_POWER: u64 = NEVER - 1;

/// A simulated printer. See the module.
pub struct VirtualPrinter<R: Recorder> {
    firmware: Box<Firmware<OBJECTS_MAX, MOVES_MAX>>,
    board: SimulatedBoard<R>,
    down: Pipe,
    /// The firmware's next timer, its next retry of tasks, the end of its restart.
    next_timer: u64,
    next_task: u64,
    restart_at: u64,
    next_thermal: u64,
    thermal_ticks: u64,
    retry_ticks: u64,
    /// What fails, soonest last.
    failures: Vec<(u64, FailureKind)>,
    arrived: Vec<u8>,
    /// How far the motion clock is behind the board's.
    behind: u64,
    balance: Random,
}

impl<R: Recorder> VirtualPrinter<R> {
    /// Powers a machine up. All chance comes from `seed`.
    pub fn new(
        profile: BoardProfile,
        machine: &Machine,
        faults: &Faults,
        seed: u64,
        recorder: R,
    ) -> Result<Self, WiringError> {
        if !faults.bytes.are_probabilities() {
            return Err(WiringError::Unsound { part: "faults".to_owned() });
        }
        let clock = profile.clock;
        let pipe = |latency, chance| {
            Pipe::new(
                profile.link,
                clock,
                faults.bytes,
                Random::new(seed, latency),
                Random::new(seed, chance),
            )
        };
        let down = pipe(Source::LatencyDown, Source::LinkDown);
        let up = pipe(Source::LatencyUp, Source::LinkUp);
        let thermal_ticks = clock.ticks_in(Seconds(THERMAL_STEP_S)).0.max(1);
        let retry_ticks = clock.ticks_in(Seconds(TASK_RETRY_S)).0.max(1);
        let start = profile.clock_at_start.0;
        let firmware = new_firmware(&profile);
        let mut board = SimulatedBoard::new(profile, Random::new(seed, Source::Noise), up, recorder);
        wiring::wire(&mut board, machine, seed)?;
        let mut printer = Self {
            firmware,
            board,
            down,
            next_timer: start,
            next_task: NEVER,
            restart_at: NEVER,
            next_thermal: start + thermal_ticks,
            thermal_ticks,
            retry_ticks,
            failures: Vec::new(),
            arrived: Vec::new(),
            behind: 0,
            balance: Random::new(seed, Source::Balance),
        };
        printer.schedule(&faults.failures)?;
        Ok(printer)
    }

    fn schedule(&mut self, failures: &[Failure]) -> Result<(), WiringError> {
        for failure in failures {
            self.check_target(&failure.kind)?;
            let at = self.board.clock.saturating_add(self.board.profile.clock.ticks_in(failure.at).0);
            self.failures.push((at, failure.kind.clone()));
        }
        // Stable: what is given for the same time happens in the order given.
        self.failures.reverse();
        self.failures.sort_by_key(|failure| core::cmp::Reverse(failure.0));
        Ok(())
    }

    fn check_target(&self, kind: &FailureKind) -> Result<(), WiringError> {
        let (name, known) = match kind {
            FailureKind::Unplug
            | FailureKind::Replug
            | FailureKind::BoardReset
            | FailureKind::PowerLoss
            | FailureKind::PowerReturn => return Ok(()),
            FailureKind::SensorOpen(name)
            | FailureKind::SensorShort(name)
            | FailureKind::HeaterDead(name)
            | FailureKind::HeaterStuckOn(name) => (name, self.heater(name).is_some()),
            FailureKind::EndstopStuckOn(name) | FailureKind::EndstopStuckOff(name) => {
                (name, self.endstop(name).is_some())
            }
        };
        if known { Ok(()) } else { Err(WiringError::UnknownFaultTarget { name: name.clone() }) }
    }

    fn heater(&self, name: &str) -> Option<usize> {
        self.board.heaters.iter().position(|heater| heater.name == name)
    }

    /// Endstops go by their own name or, for short, without the "stepper_" before it.
    fn endstop(&self, name: &str) -> Option<usize> {
        let is = |own: &str| own == name || own.strip_prefix("stepper_") == Some(name);
        self.board.endstops.iter().position(|endstop| is(&endstop.name))
    }

    /// The board's clock.
    pub fn now(&self) -> Ticks {
        Ticks(self.board.clock)
    }

    /// The clock at power-up.
    pub fn start(&self) -> Ticks {
        self.board.profile.clock_at_start
    }

    /// The board.
    pub fn profile(&self) -> &BoardProfile {
        &self.board.profile
    }

    /// Whether the host has a connection: the cable is in, and a board on USB is not restarting.
    pub fn connected(&self) -> bool {
        let on_usb = self.board.profile.link == LinkProfile::Usb;
        self.board.plugged && !(on_usb && self.restart_at != NEVER)
    }

    /// Bytes leave the host now. They are lost where there is no connection.
    pub fn write(&mut self, bytes: &[u8]) {
        if self.connected() {
            self.down.send(self.board.clock, bytes);
        }
    }

    /// Lets virtual time pass until `until`, or until bytes reach the host (appended to `to_host`), whichever comes
    /// first, or until the connection comes or goes; returns the time reached.
    pub fn run_until(&mut self, until: Ticks, to_host: &mut Vec<u8>) -> Ticks {
        let had_connection = self.connected();
        let before = to_host.len();
        loop {
            let next = self.next_event().min(until.0);
            self.run_timers_before(next);
            if self.board.sent || self.board.restart_wanted {
                // What the timers sent may arrive before what was next.
                self.board.sent = false;
                self.restart_if_wanted();
                continue;
            }
            self.board.clock = self.board.clock.max(next);
            self.happen();
            self.board.up.take(self.board.clock, to_host);
            let stop = to_host.len() > before || self.connected() != had_connection;
            if stop || self.board.clock >= until.0 {
                return self.now();
            }
        }
    }

    /// The next event apart from the firmware's timers.
    fn next_event(&self) -> u64 {
        let arrival = |pipe: &Pipe| pipe.next_arrival().unwrap_or(NEVER);
        let failure = self.failures.last().map_or(NEVER, |failure| failure.0);
        arrival(&self.down)
            .min(arrival(&self.board.up))
            .min(self.next_thermal)
            .min(self.next_task)
            .min(self.restart_at)
            .min(failure)
    }

    /// Runs the firmware's timers up to and including `end`, or until something was sent.
    #[inline]
    fn run_timers_before(&mut self, end: u64) {
        while self.next_timer <= end {
            self.board.clock = self.board.clock.max(self.next_timer);
            self.run_timers();
            if self.firmware.has_tasks() {
                self.run_tasks();
            }
            if self.board.sent || self.board.restart_wanted {
                return;
            }
        }
    }

    #[inline]
    fn run_timers(&mut self) {
        let now = self.board.clock;
        let behind = self.motion_behind();
        if behind != self.behind {
            self.behind = behind;
            self.board.recorder.motion_behind(Ticks(behind));
        }
        let next = self.firmware.run_timers(&mut self.board);
        // A timer that is still due is asked for again a tick later: time always moves on.
        self.next_timer = Ticks(now).nearest(next).0.max(now + 1);
    }

    /// How far the motion clock is behind now. It falls further behind while motion is slow, and is level again after a
    /// reset.
    fn motion_behind(&self) -> u64 {
        let clock = Ticks(self.board.clock).low();
        let behind = clock.0.wrapping_sub(self.firmware.motion_clock(clock).0);
        let more = behind.wrapping_sub(self.behind as u32);
        if more < 1 << 31 { self.behind + u64::from(more) } else { u64::from(behind) }
    }

    /// The board's motion clock, by which steps are made: the board's clock, less the time that motion was held.
    pub fn motion_now(&self) -> Ticks {
        Ticks(self.board.clock - self.motion_behind())
    }

    fn run_tasks(&mut self) {
        self.firmware.run_tasks(&mut self.board);
        let again = self.firmware.has_tasks();
        self.next_task = if again { self.board.clock + self.retry_ticks } else { NEVER };
        // Tasks may have set timers.
        self.run_timers();
    }

    /// Everything but timers that is due at the present clock.
    fn happen(&mut self) {
        let now = self.board.clock;
        while self.failures.last().is_some_and(|failure| failure.0 <= now) {
            if let Some((_, kind)) = self.failures.pop() {
                self.fail(&kind);
            }
        }
        if self.restart_at <= now {
            self.restart_at = NEVER;
            self.start_firmware();
        }
        if self.down.next_arrival().is_some_and(|at| at <= now) {
            self.deliver();
        }
        if self.next_task <= now {
            self.next_task = NEVER;
            self.run_tasks();
        }
        if self.next_thermal <= now {
            self.board.thermal_step(self.thermal_ticks);
            self.next_thermal += self.thermal_ticks;
        }
        self.board.sent = false;
        self.restart_if_wanted();
    }

    fn deliver(&mut self) {
        let mut bytes = core::mem::take(&mut self.arrived);
        bytes.clear();
        self.down.take(self.board.clock, &mut bytes);
        // A board that is restarting is deaf.
        if self.restart_at == NEVER {
            self.firmware.receive(&mut self.board, &bytes);
            self.run_tasks();
        }
        self.arrived = bytes;
    }

    fn restart_if_wanted(&mut self) {
        if !self.board.restart_wanted {
            return;
        }
        self.board.restart_wanted = false;
        self.board.release_pins();
        self.firmware = new_firmware(&self.board.profile);
        self.next_timer = NEVER;
        self.next_task = NEVER;
        self.restart_at = if self.board.powered { self.restart_clock() } else { WITHOUT_POWER };
        if self.board.profile.link == LinkProfile::Usb {
            self.down.clear();
            self.board.up.clear();
        }
    }

    /// When a board that starts now has started.
    fn restart_clock(&self) -> u64 {
        self.board.clock + self.board.profile.clock.ticks_in(self.board.profile.restart).0.max(1)
    }

    fn start_firmware(&mut self) {
        self.run_timers();
        self.run_tasks();
    }

    fn fail(&mut self, kind: &FailureKind) {
        let heater = |name: &str| self.heater(name);
        let endstop = |name: &str| self.endstop(name);
        match kind {
            FailureKind::Unplug => {
                self.board.plugged = false;
                self.down.clear();
                self.board.up.clear();
            }
            FailureKind::Replug => self.board.plugged = true,
            FailureKind::BoardReset => self.board.restart_wanted |= self.board.powered,
            FailureKind::PowerLoss => self.board.lose_power(),
            FailureKind::PowerReturn if self.board.powered => {}
            FailureKind::PowerReturn => {
                self.board.regain_power(&mut self.balance);
                self.restart_at = self.restart_clock();
            }
            FailureKind::SensorOpen(name) | FailureKind::SensorShort(name) => {
                let reads = if matches!(kind, FailureKind::SensorOpen(_)) { ADC_MAX } else { 0 };
                if let Some(index) = heater(name) {
                    self.board.heaters[index].reads = Some(reads);
                }
            }
            FailureKind::HeaterDead(name) | FailureKind::HeaterStuckOn(name) => {
                let duty = if matches!(kind, FailureKind::HeaterDead(_)) { 0.0 } else { 1.0 };
                if let Some(index) = heater(name) {
                    self.board.heaters[index].stuck = Some(duty);
                }
            }
            FailureKind::EndstopStuckOn(name) | FailureKind::EndstopStuckOff(name) => {
                let closed = matches!(kind, FailureKind::EndstopStuckOn(_));
                if let Some(index) = endstop(name) {
                    self.board.endstops[index].stuck = Some(closed);
                }
            }
        }
    }

    /// What watches the pins.
    pub fn recorder(&self) -> &R {
        &self.board.recorder
    }

    /// What watches the pins.
    pub fn recorder_mut(&mut self) -> &mut R {
        &mut self.board.recorder
    }

    /// Ends the simulation.
    pub fn into_recorder(self) -> R {
        self.board.recorder
    }

    /// The machine as an onlooker sees it now. Looking changes nothing.
    pub fn state(&mut self) -> State {
        let now = self.board.clock;
        for axis in &mut self.board.axes {
            axis.motor.advance(now);
        }
        let board = &self.board;
        State {
            at: Ticks(now),
            motors: board.axes.iter().map(motor_view).collect(),
            heaters: board.heaters.iter().map(heater_view).collect(),
            fans: board.fans.iter().map(fan_view).collect(),
            endstops: board.endstops.iter().map(|endstop| self.endstop_view(endstop)).collect(),
            shutdown: self.firmware.shutdown_reason(),
            damaged_bytes: [self.down.damaged, board.up.damaged],
        }
    }

    fn endstop_view(&self, endstop: &EndstopWiring) -> EndstopView {
        let now = self.board.clock;
        let (closed, position) = match &endstop.sits {
            Sits::Motor(axis, switch) => {
                let axis = &self.board.axes[*axis];
                let switch = axis.motor.switches.get(*switch);
                (switch.is_some_and(|switch| switch.closed(now)), motor_view(axis).position)
            }
            Sits::Carriage { axis, switch, .. } => {
                let motors: [f64; 3] = core::array::from_fn(|motor| {
                    self.board.axes.get(motor).map_or(0.0, |it| motor_view(it).position.0)
                });
                (switch.closed(now), Mm(self.board.gantry.head(motors)[*axis]))
            }
        };
        EndstopView { name: endstop.name.clone(), triggered: endstop.stuck.unwrap_or(closed), position }
    }
}

fn new_firmware(profile: &BoardProfile) -> Box<Firmware<OBJECTS_MAX, MOVES_MAX>> {
    let firmware = Firmware::new(profile.clock).with_move_count(profile.move_count);
    let firmware = if profile.motion_clock { firmware } else { firmware.without_motion_clock() };
    let firmware = if profile.block_check { firmware } else { firmware.without_block_check() };
    Box::new(if profile.board_heaters { firmware } else { firmware.without_heaters() })
}

fn motor_view(axis: &Axis) -> MotorView {
    let rotor = axis.motor.rotor();
    MotorView {
        name: axis.name.clone(),
        count: StepCount(axis.motor.field()),
        pulses: axis.pulses,
        rotor,
        lost: StepCount(axis.motor.lost()),
        position: Mm(axis.start_mm + rotor * axis.step_mm),
        energised: axis.motor.energised(),
    }
}

fn heater_view(heater: &HeaterWiring) -> HeaterView {
    HeaterView {
        name: heater.name.clone(),
        temperature: Celsius(heater.state.body_c),
        sensor: Celsius(heater.state.sensor_c),
        duty: heater.state.duty,
    }
}

fn fan_view(fan: &FanWiring) -> FanView {
    FanView { name: fan.name.clone(), duty: fan.state.duty, speed: fan.state.speed }
}
