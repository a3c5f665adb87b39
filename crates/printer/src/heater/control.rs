//! The two temperature loops: PID and on–off with a dead band. From temperatures to a duty, nothing else.

use units::{Celsius, Seconds};

/// Klipper counts PID gains in 255ths of full power.
pub(super) const KLIPPER_GAIN_SCALE: f64 = 255.0;

/// Shorter smoothing would make a slope of the converter's noise, and of two samples at once a division by nothing.
const SMOOTH_TIME_MIN_S: f64 = 0.01;

/// Gains of a PID loop in Klipper's units: duty out of 255 per °C, per °C·s and per °C/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PidGains {
    /// Proportional.
    pub kp: f64,
    /// Integral.
    pub ki: f64,
    /// Derivative.
    pub kd: f64,
}

/// A PID loop on the temperature, with the derivative taken of the measurement (a new target gives no kick) and
/// smoothed, and an integral that only grows while the heater can follow.
#[derive(Clone, Debug)]
pub struct Pid {
    /// Duty per °C, per °C·s, per °C/s.
    kp: f64,
    ki: f64,
    kd: f64,
    max_power: f64,
    smooth_time_s: f64,
    /// The integral's part of the duty.
    integral: f64,
    slope_c_per_s: f64,
    last: Option<Celsius>,
}

impl Pid {
    /// A loop at rest. `smooth_time` is the time constant over which the temperature's slope is averaged.
    pub fn new(gains: PidGains, max_power: f64, smooth_time: Seconds) -> Self {
        Self {
            kp: gains.kp / KLIPPER_GAIN_SCALE,
            ki: gains.ki / KLIPPER_GAIN_SCALE,
            kd: gains.kd / KLIPPER_GAIN_SCALE,
            max_power,
            smooth_time_s: smooth_time.0.max(SMOOTH_TIME_MIN_S),
            integral: 0.0,
            slope_c_per_s: 0.0,
            last: None,
        }
    }

    /// Forgets what was learnt, as for a heater that was off.
    pub fn reset(&mut self) {
        self.integral = 0.0;
    }

    /// The duty (0..=max_power) after a sample taken `dt` after the one before.
    pub fn update(&mut self, temperature: Celsius, target: Celsius, dt: Seconds) -> f64 {
        let last = self.last.replace(temperature).unwrap_or(temperature);
        // (slope now − slope so far)·dt/smooth_time, written without a division by a dt that may be tiny.
        let window = dt.0.max(self.smooth_time_s);
        if dt.0 > 0.0 {
            self.slope_c_per_s += ((temperature - last).0 - self.slope_c_per_s * dt.0) / window;
        }
        if target <= Celsius::ZERO {
            return 0.0;
        }
        let error = (target - temperature).0;
        let integral = (self.integral + self.ki * error * dt.0.max(0.0)).clamp(0.0, self.max_power);
        let wanted = self.kp * error + integral - self.kd * self.slope_c_per_s;
        let duty = wanted.clamp(0.0, self.max_power);
        // Anti-windup: while the output is cut off, the integral may only move back towards the range.
        if duty == wanted || (wanted - duty) * (integral - self.integral) < 0.0 {
            self.integral = integral;
        }
        duty
    }
}

/// On below `target − max_delta`, off above `target + max_delta`, and as it was in between.
#[derive(Clone, Debug)]
pub struct Watermark {
    max_delta: Celsius,
    max_power: f64,
    heating: bool,
}

impl Watermark {
    /// A loop at rest.
    pub const fn new(max_delta: Celsius, max_power: f64) -> Self {
        Self { max_delta, max_power, heating: false }
    }

    /// Forgets whether it was heating.
    pub const fn reset(&mut self) {
        self.heating = false;
    }

    /// The duty after a sample: 0 or `max_power`.
    pub fn update(&mut self, temperature: Celsius, target: Celsius) -> f64 {
        if target <= Celsius::ZERO || temperature >= target + self.max_delta {
            self.heating = false;
        } else if temperature <= target - self.max_delta {
            self.heating = true;
        }
        if self.heating { self.max_power } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GAINS: PidGains = PidGains { kp: 22.2, ki: 1.08, kd: 114.0 };

    #[test]
    fn far_below_full_power_far_above_none() {
        let mut pid = Pid::new(GAINS, 0.8, Seconds(1.0));
        assert_eq!(pid.update(Celsius(20.0), Celsius(200.0), Seconds(0.3)), 0.8);
        let mut pid = Pid::new(GAINS, 1.0, Seconds(1.0));
        assert_eq!(pid.update(Celsius(250.0), Celsius(200.0), Seconds(0.3)), 0.0);
        assert_eq!(pid.update(Celsius(20.0), Celsius(0.0), Seconds(0.3)), 0.0);
    }

    #[test]
    fn the_integral_does_not_wind_up_while_saturated() {
        let mut pid = Pid::new(GAINS, 1.0, Seconds(1.0));
        for _ in 0..1000 {
            pid.update(Celsius(20.0), Celsius(200.0), Seconds(0.3));
        }
        assert_eq!(pid.integral, 0.0);
    }

    #[test]
    fn a_steady_error_is_integrated_away() {
        let mut pid = Pid::new(GAINS, 1.0, Seconds(1.0));
        let first = pid.update(Celsius(199.0), Celsius(200.0), Seconds(0.3));
        let second = pid.update(Celsius(199.0), Celsius(200.0), Seconds(0.3));
        assert!((second - first - 1.08 / 255.0 * 0.3).abs() < 1e-12);
    }

    #[test]
    fn a_rising_temperature_lowers_the_duty_by_the_derivative() {
        let mut pid = Pid::new(PidGains { ki: 0.0, ..GAINS }, 1.0, Seconds(1.0));
        pid.update(Celsius(195.0), Celsius(200.0), Seconds(0.5));
        let duty = pid.update(Celsius(195.2), Celsius(200.0), Seconds(0.5));
        // Slope 0.4 °C/s, half of it seen after half the smoothing time.
        assert!((duty - (22.2 * 4.8 - 114.0 * 0.2) / 255.0).abs() < 1e-12);
    }

    #[test]
    fn watermark_switches_at_both_edges_only() {
        let mut loop_ = Watermark::new(Celsius(2.0), 1.0);
        let duties: Vec<f64> = [20.0, 59.0, 61.9, 62.0, 59.0, 58.1, 58.0, 61.0]
            .map(|temperature| loop_.update(Celsius(temperature), Celsius(60.0)))
            .to_vec();
        assert_eq!(duties, [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0]);
        assert_eq!(loop_.update(Celsius(20.0), Celsius(0.0)), 0.0);
    }
}
