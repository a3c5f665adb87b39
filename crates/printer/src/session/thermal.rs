//! Heaters, their sensors and the part fan, on the board.
//!
//! Readings come in, duties go out, and whatever is wrong with a heater is a fault that stops everything. The loops
//! themselves are in [`crate::heater`], or on a board that regulates its heaters ([`super::board_heater`]): then targets
//! go out, and the readings are watched all the same.

use gcode::Heater as HeaterName;
use units::{Celsius, Seconds, Ticks};
use wire::Command;

use super::{
    board::Board,
    board_heater::{BoardHeater, HeaterLease, HeaterReport},
    event::Event,
    fan::Fan,
    layout::{HeaterOids, SAMPLE_COUNT},
};
use crate::{
    config::{HeaterConfig, PrinterConfig},
    error::{ErrorCode, PrinterError},
    heater::Heater,
    machine,
    thermistor::Thermistor,
};

/// How often a sensor is read.
const REPORT_INTERVAL: Seconds = Seconds(0.3);
/// The time between the readings that are added up to one report.
const SAMPLE_INTERVAL: Seconds = Seconds(0.001);
/// How many reports in a row may be out of range before the board stops everything.
const RANGE_CHECKS: u8 = 4;
/// A sensor that has not been heard of for this long is an error: longer than it takes to notice that nobody is there.
/// The board itself has switched the heater off by then.
const SILENCE_MAX: Seconds = Seconds(8.0);
/// The first reading comes this long after the configuration.
const FIRST_REPORT: Seconds = Seconds(0.5);

/// A heater on the board.
#[derive(Debug)]
struct Channel {
    name: HeaterName,
    heater: Heater,
    thermistor: Thermistor,
    oids: HeaterOids,
    last_report: Option<Seconds>,
    /// The last target that was set here; the heater's own is what is held.
    wanted: Celsius,
    /// Where the board regulates it.
    board: Option<BoardHeater>,
    /// The clock of the last `queue_digital_out`: the next must be later.
    last_update: Ticks,
    powered: bool,
}

/// All heaters and the fan.
#[derive(Debug)]
pub(super) struct Thermal {
    channels: Vec<Channel>,
    fan: Option<Fan>,
    lease: HeaterLease,
    /// Since when this session has been listening without being held up.
    listening: Seconds,
}

impl Thermal {
    /// Starts reading all sensors. Changes no target: a board that was set up before goes on with what it does, and says
    /// what that is.
    pub(super) fn start(config: &PrinterConfig, board: &mut Board, now: Seconds) -> Self {
        let mut channels = Vec::new();
        let layout = board.layout.clone();
        let standby_time = config.printer.standby_time;
        let extruder = config.extruder.as_ref().map(|extruder| &extruder.heater).zip(layout.extruder);
        if let Some((heater, oids)) = extruder {
            channels.push(Channel::start(HeaterName::Tool(0), heater, standby_time, oids, board, now));
        }
        if let Some((heater, oids)) = config.heater_bed.as_ref().zip(layout.bed) {
            channels.push(Channel::start(HeaterName::Bed, heater, standby_time, oids, board, now));
        }
        Self {
            channels,
            fan: layout.fan.zip(config.fan.clone()).map(|(output, config)| Fan::new(output, config)),
            lease: HeaterLease::default(),
            listening: now,
        }
    }

    fn channel(&mut self, name: HeaterName) -> Result<&mut Channel, PrinterError> {
        self.channels.iter_mut().find(|channel| channel.name == name).ok_or_else(|| {
            let detail = format!("{} is not in the machine file", machine::heater_name(name));
            PrinterError::new(ErrorCode::NoSuchHeater, detail)
        })
    }

    /// The heater's loop.
    pub(super) fn heater(&self, name: HeaterName) -> Option<&Heater> {
        self.channels.iter().find(|channel| channel.name == name).map(|channel| &channel.heater)
    }

    /// Whether any heater has a target.
    pub(super) fn any_target(&self) -> bool {
        self.channels.iter().any(|channel| channel.heater.target() > Celsius::ZERO)
    }

    /// A new target; the loop acts on it at its next reading, but switches off at once.
    pub(super) fn set_target(
        &mut self,
        name: HeaterName,
        target: Celsius,
        board: &mut Board,
        now: Seconds,
    ) -> Result<(), PrinterError> {
        if target == Celsius::ZERO && self.heater(name).is_none() {
            // What is not there is off: many files end with switching off whatever there might be.
            return Ok(());
        }
        self.channel(name)?.heater.set_target(target)?;
        if target > Celsius::ZERO && self.channel(name)?.board.is_some() {
            self.lease.tell(board, now);
        }
        self.channel(name)?.follow(target, board, now);
        Ok(())
    }

    /// Takes the board's word on a heater. Whether it has just lowered it because this host fell silent.
    pub(super) fn on_board_heater(&mut self, report: HeaterReport, now: Seconds) -> bool {
        let is_it = |channel: &&mut Channel| channel.board.as_ref().is_some_and(|it| it.oid() == report.oid);
        let Some(channel) = self.channels.iter_mut().find(is_it) else { return false };
        let Some((held, falls)) = channel.board.as_mut().and_then(|heater| heater.receive(report, now))
        else {
            return false;
        };
        // Beyond its limits it is not ours to hold; the board's checks are the same as the host's.
        let _ = channel.heater.set_target(held);
        falls
    }

    /// What each heater was last set to, whatever has become of it.
    pub(super) fn wanted(&self) -> Vec<(HeaterName, Celsius)> {
        self.channels.iter().map(|channel| (channel.name, channel.wanted)).collect()
    }

    /// What a heater is going to be heated to by [`Self::reheat`].
    pub(super) fn goal(&self, name: HeaterName, before: &[(HeaterName, Celsius)]) -> Celsius {
        let Some(channel) = self.channels.iter().find(|channel| channel.name == name) else {
            return Celsius::ZERO;
        };
        let before = before.iter().find(|(of, _)| *of == name).map_or(Celsius::ZERO, |&(_, target)| target);
        // What the user has set since counts for more.
        if channel.wanted > Celsius::ZERO { channel.wanted } else { before }
    }

    /// Heats what is off or at stand-by to what it was `before`; whether there was any.
    pub(super) fn reheat(
        &mut self,
        before: &[(HeaterName, Celsius)],
        board: &mut Board,
        now: Seconds,
    ) -> Result<bool, PrinterError> {
        let mut any = false;
        for &(name, _) in before {
            let goal = self.goal(name, before);
            let channel = self.channel(name)?;
            if goal > Celsius::ZERO && (channel.has_fallen() || channel.heater.target() == Celsius::ZERO) {
                any = true;
                self.set_target(name, goal, board, now)?;
            } else if goal > Celsius::ZERO {
                // The board has gone on with it all the time.
                channel.wanted = goal;
            }
        }
        Ok(any)
    }

    /// Whether the board has lowered any heater because its host fell silent.
    pub(super) fn has_fallen(&self) -> bool {
        self.channels.iter().any(Channel::has_fallen)
    }

    /// Whether every heater has reached its target, by what was read since the last long pause.
    pub(super) fn is_heated(&self) -> bool {
        let is_fresh = |channel: &Channel| channel.last_report.is_some_and(|at| at >= self.listening);
        self.channels.iter().all(|channel| is_fresh(channel) && channel.heater.is_heated())
    }

    /// Everything off.
    pub(super) fn all_off(&mut self, board: &mut Board, now: Seconds) {
        for channel in &mut self.channels {
            channel.heater.switch_off();
            channel.follow(Celsius::ZERO, board, now);
        }
    }

    /// The fan's speed at a clock, or as soon as is safe.
    pub(super) fn set_fan(&mut self, speed: f64, at: Option<Ticks>, board: &mut Board, now: Seconds) {
        if let Some(fan) = &mut self.fan {
            fan.set(speed, at, board, now);
        }
    }

    /// The board has dropped the fan's orders.
    pub(super) const fn forget_fan_orders(&mut self) {
        if let Some(fan) = &mut self.fan {
            fan.forget_orders();
        }
    }

    /// Sends what has waited for its time.
    pub(super) fn poll(&mut self, board: &mut Board, now: Seconds) {
        if let Some(fan) = &mut self.fan {
            fan.poll(board, now);
        }
        let is_on = |channel: &Channel| channel.board.is_some() && channel.heater.target() > Celsius::ZERO;
        if self.channels.iter().any(is_on) {
            self.lease.renew(board, now);
        }
    }

    /// This session was held up until now: what it did not hear of meanwhile is not silence.
    pub(super) const fn listens_again(&mut self, now: Seconds) {
        self.listening = now;
    }

    /// The fan's last speed.
    pub(super) fn fan_speed(&self) -> f64 {
        self.fan.as_ref().map_or(0.0, Fan::speed)
    }

    /// A report of a sensor: the sum of several readings.
    pub(super) fn receive(
        &mut self,
        oid: u8,
        next_clock: Ticks,
        sum: u16,
        board: &mut Board,
        now: Seconds,
    ) -> Option<Result<Event, PrinterError>> {
        let adc_max = board.adc_max;
        let channel = self.channels.iter_mut().find(|channel| channel.oids.sensor.0 == oid)?;
        let ratio = f64::from(sum) / (adc_max * f64::from(SAMPLE_COUNT));
        let temperature = channel.thermistor.temperature(ratio);
        // When the readings were made, not when they arrived: a late report must not look like a slope.
        let read_at = board.sync.time_of(next_clock) - REPORT_INTERVAL;
        // A reading from the future is a damaged one, and would make all that follow look old. Those that have waited for
        // this session in a long pause may be of any time: 32 bits of a clock do not say which.
        let has_waited = now - self.listening < REPORT_INTERVAL || read_at < self.listening;
        let is_elsewhen = has_waited || read_at > now + REPORT_INTERVAL;
        if is_elsewhen || channel.last_report.is_some_and(|last| read_at <= last) {
            return None;
        }
        channel.last_report = Some(read_at);
        match channel.heater.sample(temperature, read_at) {
            Ok(duty) => {
                let duty = if let Some(heater) = &channel.board {
                    heater.duty()
                } else {
                    channel.power(duty, board, now);
                    duty
                };
                Some(Ok(Event::Temperature {
                    heater: channel.name,
                    temperature,
                    target: channel.heater.target(),
                    duty,
                    standby: channel.has_fallen(),
                }))
            }
            Err(fault) => Some(Err(channel.heater.error(fault))),
        }
    }

    /// A sensor that fell silent.
    pub(super) fn check_silence(&self, now: Seconds) -> Result<(), PrinterError> {
        for channel in &self.channels {
            let heard = channel.last_report.unwrap_or(self.listening).max(self.listening);
            if now - heard > SILENCE_MAX {
                let detail =
                    format!("no reading of {} for {:.1} s", channel.heater.config().name, (now - heard).0);
                return Err(PrinterError::new(ErrorCode::LinkTimeout, detail));
            }
        }
        Ok(())
    }

    /// What the sensors read when the board found one of them out of range.
    pub(super) fn describe(&self) -> String {
        let reading = |channel: &Channel| match channel.heater.temperature() {
            Some(temperature) => format!("{} {:.1} °C", channel.heater.config().name, temperature.0),
            None => format!("{} not read yet", channel.heater.config().name),
        };
        self.channels.iter().map(reading).collect::<Vec<_>>().join(", ")
    }
}

impl Channel {
    fn start(
        name: HeaterName,
        config: &HeaterConfig,
        standby_time: Seconds,
        oids: HeaterOids,
        board: &mut Board,
        now: Seconds,
    ) -> Self {
        let thermistor = config.thermistor;
        let samples = u32::from(SAMPLE_COUNT);
        let (min_value, max_value) =
            thermistor.adc_range(config.min_temp, config.max_temp, board.adc_max as u32, samples);
        let clock = board.clock_at(now) + board.ticks(FIRST_REPORT);
        let command = Command::QueryAnalogIn {
            oid: oids.sensor.0,
            clock: clock.low().0,
            sample_ticks: board.ticks(SAMPLE_INTERVAL).0 as u32,
            sample_count: SAMPLE_COUNT,
            rest_ticks: board.ticks(REPORT_INTERVAL).0 as u32,
            bytes_per_report: 2,
            min_value,
            max_value,
            range_check_count: RANGE_CHECKS,
        };
        board.control(&command);
        let heater = oids.board.map(|oid| BoardHeater::start(oid, config.standby_temp, standby_time, board));
        Self {
            name,
            heater: Heater::new(config.clone()),
            thermistor,
            oids,
            last_report: None,
            wanted: Celsius::ZERO,
            board: heater,
            last_update: Ticks(0),
            powered: false,
        }
    }

    fn has_fallen(&self) -> bool {
        self.board.as_ref().is_some_and(BoardHeater::has_fallen)
    }

    /// Goes for a new target of its heater's: the board at once, the loop here with its next reading, but off at once.
    fn follow(&mut self, target: Celsius, board: &mut Board, now: Seconds) {
        self.wanted = target;
        match &mut self.board {
            Some(heater) => heater.set(target, board, now),
            None if target == Celsius::ZERO => self.power(0.0, board, now),
            None => {}
        }
    }

    /// Sets the share of time that the heater is on, from as soon as is safe.
    fn power(&mut self, duty: f64, board: &mut Board, now: Seconds) {
        if duty == 0.0 && !self.powered {
            return;
        }
        let output = self.oids.power;
        let clock = board.output_clock(now).max(Ticks(self.last_update.0 + u64::from(output.cycle_ticks)));
        self.last_update = clock;
        self.powered = duty > 0.0;
        let command = Command::QueueDigitalOut {
            oid: output.oid.0,
            clock: clock.low().0,
            on_ticks: output.on_ticks(duty),
        };
        board.control_at(&command, clock);
    }
}
