//! Heaters, their sensors and the part fan, on the board.
//!
//! Readings come in, duties go out, and whatever is wrong with a heater is a fault that stops everything. The loops
//! themselves are in [`crate::heater`].

use gcode::Heater as HeaterName;
use units::{Celsius, Seconds, Ticks};
use wire::Command;

use super::{board::Board, event::Event, fan::Fan, layout::HeaterOids};
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
/// How many readings are added up.
const SAMPLE_COUNT: u8 = 8;
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
    /// The clock of the last `queue_digital_out`: the next must be later.
    last_update: Ticks,
    powered: bool,
}

/// All heaters and the fan.
#[derive(Debug)]
pub(super) struct Thermal {
    channels: Vec<Channel>,
    fan: Option<Fan>,
    started: Seconds,
}

impl Thermal {
    /// Starts reading all sensors.
    pub(super) fn start(config: &PrinterConfig, board: &mut Board, now: Seconds) -> Self {
        let mut channels = Vec::new();
        let layout = board.layout.clone();
        let extruder = config.extruder.as_ref().map(|extruder| &extruder.heater).zip(layout.extruder);
        if let Some((heater, oids)) = extruder {
            channels.push(Channel::start(HeaterName::Tool(0), heater, oids, board, now));
        }
        if let Some((heater, oids)) = config.heater_bed.as_ref().zip(layout.bed) {
            channels.push(Channel::start(HeaterName::Bed, heater, oids, board, now));
        }
        Self {
            channels,
            fan: layout.fan.zip(config.fan.clone()).map(|(output, config)| Fan::new(output, config)),
            started: now,
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
        let channel = self.channel(name)?;
        channel.heater.set_target(target)?;
        if target == Celsius::ZERO {
            channel.power(0.0, board, now);
        }
        Ok(())
    }

    /// Everything off.
    pub(super) fn all_off(&mut self, board: &mut Board, now: Seconds) {
        for channel in &mut self.channels {
            channel.heater.switch_off();
            channel.power(0.0, board, now);
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
        // A reading from the future is a damaged one, and would make all that follow look old.
        if read_at > now + REPORT_INTERVAL || channel.last_report.is_some_and(|last| read_at <= last) {
            return None;
        }
        channel.last_report = Some(read_at);
        match channel.heater.sample(temperature, read_at) {
            Ok(duty) => {
                channel.power(duty, board, now);
                Some(Ok(Event::Temperature {
                    heater: channel.name,
                    temperature,
                    target: channel.heater.target(),
                    duty,
                }))
            }
            Err(fault) => Some(Err(channel.heater.error(fault))),
        }
    }

    /// A sensor that fell silent.
    pub(super) fn check_silence(&self, now: Seconds) -> Result<(), PrinterError> {
        for channel in &self.channels {
            let heard = channel.last_report.unwrap_or(self.started).max(self.started);
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
        Self {
            name,
            heater: Heater::new(config.clone()),
            thermistor,
            oids,
            last_report: None,
            last_update: Ticks(0),
            powered: false,
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
