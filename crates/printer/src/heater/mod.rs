//! One heater: its loop, its limits and its runaway check. Temperatures and times in, a duty out.
//!
//! Knows nothing of pins, converters or the wire; the caller turns readings into temperatures
//! ([`crate::thermistor`]) and duties into pulses. Temperatures in °C, times in host seconds, duty 0..=1.
//!
//! The rule of this module: a fault is for good. Once anything is wrong the duty is 0 and stays 0 until the caller
//! makes a new [`Heater`], which it does only after the user has confirmed.

pub(crate) mod board;
mod control;
mod verify;

pub use control::{Pid, PidGains, Watermark};
pub use verify::{VerifyHeater, VerifyHeaterConfig};

use units::{Celsius, Seconds};

use crate::config::{ControlConfig, HeaterConfig};
use crate::error::{ErrorCode, PrinterError};

/// Samples further apart than this count as this far: a stalled host must not integrate over its own absence.
pub const SAMPLE_GAP_MAX: Seconds = Seconds(2.0);

/// The board switches heaters off after 3 s without orders, so a heater that had none for longer starts anew.
const SAMPLE_GAP_RESTART: Seconds = Seconds(3.0);

/// A PID heater has arrived when its averaged reading stays this near its target …
const SETTLED_BAND: Celsius = Celsius(1.0);

/// … for this long …
const SETTLED_TIME: Seconds = Seconds(3.0);

/// … and moves less than this meanwhile: one that crosses the band on its way to an overshoot has not arrived.
const SETTLED_DRIFT: Celsius = Celsius(0.4);

/// What a heater does that it must not. Each is final.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeaterFault {
    /// The reading is no number, or lies below min_temp: a broken or unplugged sensor.
    BelowMin,
    /// The reading lies above max_temp: a shorted sensor, or a heater that cannot be switched off.
    AboveMax,
    /// Told to heat, it never warmed.
    NotHeating,
    /// It was warm and lost its temperature although it is being heated.
    Drifted,
}

impl HeaterFault {
    /// The entry of the error catalogue.
    pub const fn code(self) -> ErrorCode {
        match self {
            Self::BelowMin => ErrorCode::SensorBelowMin,
            Self::AboveMax => ErrorCode::SensorAboveMax,
            Self::NotHeating => ErrorCode::HeaterNotHeating,
            Self::Drifted => ErrorCode::HeaterDrifted,
        }
    }
}

/// One heater with its sensor's latest readings.
#[derive(Clone, Debug)]
pub struct Heater {
    config: HeaterConfig,
    control: Control,
    verify: VerifyHeater,
    target: Celsius,
    temperature: Option<Celsius>,
    smoothed: Celsius,
    last_sample: Option<Seconds>,
    /// When and where the averaged reading came to rest in the band around the target.
    resting: Option<(Seconds, Celsius)>,
    /// The target was set while the heater was already at least that warm.
    set_from_above: bool,
    duty: f64,
    fault: Option<HeaterFault>,
}

#[derive(Clone, Debug)]
enum Control {
    Pid(Pid),
    Watermark(Watermark),
}

impl Heater {
    /// A heater that is off and has not been measured.
    pub fn new(config: HeaterConfig) -> Self {
        let control = match config.control {
            ControlConfig::Pid(gains) => Control::Pid(Pid::new(gains, config.max_power, config.smooth_time)),
            ControlConfig::Watermark { max_delta } => {
                Control::Watermark(Watermark::new(max_delta, config.max_power))
            }
        };
        Self {
            control,
            verify: VerifyHeater::new(config.verify),
            target: Celsius::ZERO,
            temperature: None,
            smoothed: Celsius::ZERO,
            last_sample: None,
            resting: None,
            set_from_above: false,
            duty: 0.0,
            fault: None,
            config,
        }
    }

    /// What the printer.cfg says about this heater.
    pub const fn config(&self) -> &HeaterConfig {
        &self.config
    }

    /// Sets the target; 0 °C is off. Refused, with the target unchanged, where it is no number or outside
    /// min_temp..=max_temp, or where the heater has failed.
    pub fn set_target(&mut self, target: Celsius) -> Result<(), PrinterError> {
        // Off is always allowed, whatever min_temp says.
        let allowed =
            target == Celsius::ZERO || (target >= self.config.min_temp && target <= self.config.max_temp);
        if !allowed || target < Celsius::ZERO {
            return Err(PrinterError::new(
                ErrorCode::TargetOutOfRange,
                format!(
                    "{}: {target} was asked for, {} to {} is allowed",
                    self.config.name, self.config.min_temp, self.config.max_temp
                ),
            ));
        }
        if target > Celsius::ZERO
            && let Some(fault) = self.fault
        {
            return Err(self.error(fault));
        }
        if target != self.target {
            self.resting = None;
            self.set_from_above = self.temperature.is_some() && self.smoothed >= target - self.band();
        }
        self.target = target;
        if target == Celsius::ZERO {
            self.switch_off();
        }
        Ok(())
    }

    /// Target 0 and duty 0, whatever state the heater is in.
    pub fn switch_off(&mut self) {
        self.target = Celsius::ZERO;
        self.duty = 0.0;
        match &mut self.control {
            Control::Pid(pid) => pid.reset(),
            Control::Watermark(watermark) => watermark.reset(),
        }
    }

    /// Takes a sample at host time `now`; gives the duty (0..=max_power) to set now.
    ///
    /// On a fault the heater is off for good and this and every later call gives the fault.
    pub fn sample(&mut self, temperature: Celsius, now: Seconds) -> Result<f64, HeaterFault> {
        // A host clock that stands still or goes back must not undo what was learnt.
        let last = self.last_sample;
        let now = last.map_or(now, |last| if now > last { now } else { last });
        let gap = last.map_or(Seconds::ZERO, |last| now - last);
        if gap > SAMPLE_GAP_RESTART {
            // Cooled behind our back: what was known of its climb is void.
            self.verify = VerifyHeater::new(self.config.verify);
        }
        let dt = gap.min(SAMPLE_GAP_MAX);
        self.last_sample = Some(now);
        self.note_temperature(temperature, now, dt);
        let fault = self.fault.or_else(|| self.judge(temperature, now, dt).err());
        if let Some(fault) = fault {
            self.fault = Some(fault);
            self.switch_off();
            return Err(fault);
        }
        self.duty = match &mut self.control {
            Control::Pid(pid) => pid.update(temperature, self.target, dt),
            Control::Watermark(watermark) => watermark.update(temperature, self.target),
        };
        Ok(self.duty)
    }

    fn note_temperature(&mut self, temperature: Celsius, now: Seconds, dt: Seconds) {
        if !temperature.0.is_finite() {
            return;
        }
        let smooth_time = self.config.smooth_time;
        self.smoothed = if self.temperature.is_none() || smooth_time.0 <= 0.0 {
            temperature
        } else {
            self.smoothed + (temperature - self.smoothed) * (dt.0 / smooth_time.0).min(1.0)
        };
        self.temperature = Some(temperature);
        let resting = self.resting.filter(|(_, at)| (self.smoothed - *at).abs() <= SETTLED_DRIFT);
        let is_within = (self.smoothed - self.target).abs() <= self.band();
        self.resting = is_within.then(|| resting.unwrap_or((now, self.smoothed)));
    }

    fn judge(&mut self, temperature: Celsius, now: Seconds, dt: Seconds) -> Result<(), HeaterFault> {
        if !temperature.0.is_finite() || temperature < self.config.min_temp {
            return Err(HeaterFault::BelowMin);
        }
        if temperature > self.config.max_temp {
            return Err(HeaterFault::AboveMax);
        }
        self.verify.check(temperature, self.target, now, dt)
    }

    /// A fault of this heater as the user is to read it.
    pub fn error(&self, fault: HeaterFault) -> PrinterError {
        let reading = self.temperature.map_or_else(|| "no reading".to_owned(), |t| format!("{:.1} °C", t.0));
        PrinterError::new(fault.code(), format!("{} reads {reading}", self.config.name))
    }

    /// The latest reading, if there was one.
    pub const fn temperature(&self) -> Option<Celsius> {
        self.temperature
    }

    /// The reading averaged over smooth_time, if there was one.
    pub fn smoothed_temperature(&self) -> Option<Celsius> {
        self.temperature.map(|_| self.smoothed)
    }

    /// The target; 0 °C when off.
    pub const fn target(&self) -> Celsius {
        self.target
    }

    /// The duty last ordered, 0..=1.
    pub const fn duty(&self) -> f64 {
        self.duty
    }

    /// What ended this heater, if anything.
    pub const fn fault(&self) -> Option<HeaterFault> {
        self.fault
    }

    /// Whether filament may be pushed: measured, sound, and no colder than min_extrude_temp.
    pub fn can_extrude(&self) -> bool {
        self.fault.is_none() && self.temperature.is_some() && self.smoothed >= self.config.min_extrude_temp
    }

    /// Whether a wait for "at least the target" (M109 S, M190 S) is over. Also true when off.
    pub fn is_heated(&self) -> bool {
        let is_above = self.set_from_above && self.smoothed >= self.target - self.band();
        self.is_settled() || (is_above && self.fault.is_none())
    }

    /// Whether a wait for "the target from either side" (M109 R, M190 R) is over. Also true when off.
    pub fn is_settled(&self) -> bool {
        if self.target <= Celsius::ZERO {
            return true;
        }
        let rest_time = match self.control {
            Control::Pid(_) => SETTLED_TIME,
            // It never rests: it swings through its band for ever.
            Control::Watermark(_) => Seconds::ZERO,
        };
        let rested =
            self.resting.zip(self.last_sample).is_some_and(|((since, _), now)| now - since >= rest_time);
        rested && self.fault.is_none()
    }

    const fn band(&self) -> Celsius {
        match self.config.control {
            ControlConfig::Pid(_) => SETTLED_BAND,
            ControlConfig::Watermark { max_delta } => max_delta,
        }
    }
}

#[cfg(test)]
mod tests;
