//! Heaters and fans: a heating element, the mass it warms, a sensor that follows late, loss to the air.
//!
//! Three masses in a row, each step of time of [`THERMAL_STEP_S`] integrated with the mean power of that step:
//! element → body → air, and body → sensor (which takes no heat). A fan adds to the body's loss; filament that is pushed
//! through takes the heat it needs to reach the body's temperature.
//!
//! Units: °C, W, J/K, s, mm³. Does not know: pins, converters, control loops.
//! Source: lumped thermal capacity; figures from usual hot ends (40 W, 200 °C in a little over a minute) and beds.

use crate::thermistor::Thermistor;
use units::{Celsius, Ohms};

/// Step of time of the thermal model, in seconds.
pub(crate) const THERMAL_STEP_S: f64 = 0.01;
/// How fast a fan follows its duty.
const FAN_TIME_CONSTANT_S: f64 = 0.6;
/// Heat that a cubic millimetre of filament takes per kelvin: PLA, 1.24 g/cm³ and 1.9 J/(g·K) with its melting.
const FILAMENT_J_MM3_K: f64 = 2.4e-3;

/// What a heater is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct Plant {
    /// Electrical power at full duty, W.
    pub power_w: f64,
    /// Heat capacity of the heating element, J/K.
    pub element_j_k: f64,
    /// Conductance from element to body, W/K.
    pub element_w_k: f64,
    /// Heat capacity of the body, J/K.
    pub body_j_k: f64,
    /// Loss to the air, W/K.
    pub loss_w_k: f64,
    /// Additional loss with the part fan at full speed, W/K.
    pub fan_loss_w_k: f64,
    /// How late the sensor follows the body, s.
    pub sensor_lag_s: f64,
    /// The air around, °C.
    pub ambient: Celsius,
}

impl Plant {
    /// A usual 40 W hot end.
    pub fn hot_end() -> Self {
        Self {
            power_w: 40.0,
            element_j_k: 1.5,
            element_w_k: 1.5,
            body_j_k: 11.0,
            loss_w_k: 0.06,
            fan_loss_w_k: 0.02,
            sensor_lag_s: 1.0,
            ambient: Celsius(22.0),
        }
    }

    /// A usual 250 W bed of 235 mm: 3 mm of aluminium (400 J/K), a sheet of spring steel and the heater itself.
    pub fn bed() -> Self {
        Self {
            power_w: 250.0,
            element_j_k: 60.0,
            element_w_k: 30.0,
            body_j_k: 600.0,
            loss_w_k: 1.4,
            fan_loss_w_k: 0.05,
            sensor_lag_s: 2.5,
            ambient: Celsius(22.0),
        }
    }

    /// Whether the values make a plant that can be integrated.
    pub fn is_sound(&self) -> bool {
        let positive = [self.element_j_k, self.element_w_k, self.body_j_k, self.sensor_lag_s];
        let not_negative = [self.power_w, self.loss_w_k, self.fan_loss_w_k];
        positive.iter().all(|v| v.is_finite() && *v > 0.0)
            && not_negative.iter().all(|v| v.is_finite() && *v >= 0.0)
            && self.ambient.0.is_finite()
            // The explicit step must be far below every time constant.
            && self.element_j_k / self.element_w_k > 5.0 * THERMAL_STEP_S
            && self.body_j_k / (self.element_w_k + self.loss_w_k + self.fan_loss_w_k) > 5.0 * THERMAL_STEP_S
            && self.sensor_lag_s > 5.0 * THERMAL_STEP_S
    }
}

/// The sensor of a heater.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    /// Its curve.
    pub thermistor: Thermistor,
    /// The resistor to the converter's reference.
    pub pull_up: Ohms,
    /// Standard deviation of the converter's noise, counts.
    pub noise_counts: f64,
}

impl Default for Sensor {
    fn default() -> Self {
        Self { thermistor: Thermistor::epcos_100k(), pull_up: Ohms(4700.0), noise_counts: 1.5 }
    }
}

/// An output's share of on-time within the current step of time.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct DutyMeter {
    on: bool,
    on_ticks: u64,
    since: u64,
}

impl DutyMeter {
    pub(crate) fn new(now: u64) -> Self {
        Self { since: now, ..Self::default() }
    }

    pub(crate) fn set(&mut self, now: u64, on: bool) {
        if self.on {
            self.on_ticks += now - self.since;
        }
        self.since = now;
        self.on = on;
    }

    /// The share since the last call, `ticks` ago.
    pub(crate) fn take(&mut self, now: u64, ticks: u64) -> f64 {
        self.set(now, self.on);
        let duty = self.on_ticks as f64 / ticks as f64;
        self.on_ticks = 0;
        duty
    }
}

/// A fan's speed.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct FanState {
    /// 0 to 1.
    pub(crate) speed: f64,
    /// The duty of the last step of time, 0 to 1.
    pub(crate) duty: f64,
}

impl FanState {
    pub(crate) fn step(&mut self, duty: f64) {
        self.duty = duty;
        self.speed += (duty - self.speed) * (THERMAL_STEP_S / FAN_TIME_CONSTANT_S);
    }
}

/// A heater's temperatures.
#[derive(Clone, Debug)]
pub(crate) struct HeaterState {
    plant: Plant,
    element_c: f64,
    pub(crate) body_c: f64,
    pub(crate) sensor_c: f64,
    /// The duty of the last step of time, 0 to 1.
    pub(crate) duty: f64,
}

impl HeaterState {
    /// At the temperature of the air.
    pub(crate) fn new(plant: Plant) -> Self {
        let ambient = plant.ambient.0;
        Self { plant, element_c: ambient, body_c: ambient, sensor_c: ambient, duty: 0.0 }
    }

    /// One step of time with this mean duty and fan speed, and filament pushed through within it.
    pub(crate) fn step(&mut self, duty: f64, fan: f64, filament_mm3: f64) {
        const DT: f64 = THERMAL_STEP_S;
        self.duty = duty;
        let plant = &self.plant;
        let to_body_w = plant.element_w_k * (self.element_c - self.body_c);
        let over_air = self.body_c - plant.ambient.0;
        let loss_w = (plant.loss_w_k + plant.fan_loss_w_k * fan) * over_air;
        let filament_j = (filament_mm3.max(0.0) * FILAMENT_J_MM3_K).min(0.5 * plant.body_j_k) * over_air;
        self.sensor_c += (self.body_c - self.sensor_c) * (DT / plant.sensor_lag_s);
        self.element_c += (duty * plant.power_w - to_body_w) * (DT / plant.element_j_k);
        self.body_c += ((to_body_w - loss_w) * DT - filament_j) / plant.body_j_k;
    }
}

#[cfg(test)]
#[path = "heater_tests.rs"]
mod tests;
