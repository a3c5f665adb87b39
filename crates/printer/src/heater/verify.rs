//! Does the heater do what it is told? A heater that does not warm has a loose sensor or a dead cartridge, and
//! full power on a loose sensor is how fires start.
//!
//! Source: the meaning of `[verify_heater]` in Klipper's public documentation (docs/Config_Reference.md): while
//! heating up the temperature must rise by `heating_gain` within every `check_gain_time`; once there, the time
//! integral of how far it lies below `target − hysteresis` must stay under `max_error`.

use units::{Celsius, Seconds};

use super::HeaterFault;

/// Limits of the check, one set a heater.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VerifyHeaterConfig {
    /// °C·s below the tolerated band before it is a fault.
    pub max_error_c_s: f64,
    /// Time within which a heater that is on its way must gain `heating_gain`.
    pub check_gain_time: Seconds,
    /// How far below its target still counts as there.
    pub hysteresis: Celsius,
    /// What a heater on its way must gain.
    pub heating_gain: Celsius,
}

impl VerifyHeaterConfig {
    /// Klipper's defaults for an extruder: quick to warm.
    pub const EXTRUDER: Self = Self {
        max_error_c_s: 120.0,
        check_gain_time: Seconds(20.0),
        hysteresis: Celsius(5.0),
        heating_gain: Celsius(2.0),
    };

    /// Klipper's defaults for a bed: slow to warm.
    pub const BED: Self = Self { check_gain_time: Seconds(60.0), ..Self::EXTRUDER };
}

/// The running check of one heater.
#[derive(Clone, Debug)]
pub struct VerifyHeater {
    config: VerifyHeaterConfig,
    target: Celsius,
    state: State,
    /// °C·s below the band since the last time all was well.
    error_c_s: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    /// Within the band, or off: nothing to watch.
    Content,
    /// On its way up: must reach `goal` by `deadline`.
    Climbing { goal: Celsius, deadline: Seconds, first: bool },
    /// Below the band without climbing: the error adds up.
    Low { never_rose: bool },
}

impl VerifyHeater {
    /// A check of a heater that is off.
    pub const fn new(config: VerifyHeaterConfig) -> Self {
        Self { config, target: Celsius::ZERO, state: State::Content, error_c_s: 0.0 }
    }

    /// Looks at a sample taken `dt` after the one before, at host time `now`.
    pub fn check(
        &mut self,
        temperature: Celsius,
        target: Celsius,
        now: Seconds,
        dt: Seconds,
    ) -> Result<(), HeaterFault> {
        let retargeted = target != self.target;
        self.target = target;
        let below = (target - self.config.hysteresis - temperature).0;
        if target <= Celsius::ZERO || below <= 0.0 {
            self.state = State::Content;
            self.error_c_s = 0.0;
            return Ok(());
        }
        // A climb goes on whatever the new target is: one that changes all the time must not keep putting the check off.
        if retargeted && !matches!(self.state, State::Climbing { .. }) {
            self.climb_from(temperature, now, true);
            return Ok(());
        }
        self.error_c_s += below * dt.0.max(0.0);
        match self.state {
            State::Content => self.state = State::Low { never_rose: false },
            State::Climbing { goal, .. } if temperature >= goal => self.climb_from(temperature, now, false),
            State::Climbing { deadline, first, .. } if now >= deadline => {
                // The error of the climb counts: a heater far below its target has none of it to spare.
                self.state = State::Low { never_rose: first };
            }
            State::Climbing { goal, deadline, first: true } => {
                // A block that still cools from before may fall first: the gain counts from the lowest point.
                let goal = goal.min(temperature + self.config.heating_gain);
                self.state = State::Climbing { goal, deadline, first: true };
            }
            State::Climbing { .. } | State::Low { .. } => {}
        }
        match self.state {
            State::Low { never_rose } if self.error_c_s >= self.config.max_error_c_s => {
                Err(if never_rose { HeaterFault::NotHeating } else { HeaterFault::Drifted })
            }
            _ => Ok(()),
        }
    }

    fn climb_from(&mut self, temperature: Celsius, now: Seconds, first: bool) {
        self.error_c_s = 0.0;
        self.state = State::Climbing {
            goal: temperature + self.config.heating_gain,
            deadline: now + self.config.check_gain_time,
            first,
        };
    }
}
