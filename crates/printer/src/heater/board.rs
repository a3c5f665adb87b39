//! A heater's configuration in the words of a board that regulates it by itself (docs/board-heaters.md): the sensor's
//! curve as points, gains and limits as whole numbers.
//!
//! Knows no oids but those it is given, and no state. On the wire temperatures are in 1/1000 °C, gains in 1/2²⁴ of full
//! power for each °C, °C·s and °C/s, power in 1/4096.

use units::{Celsius, Seconds};
use wire::Command;

use super::{PidGains, control::KLIPPER_GAIN_SCALE};
use crate::{
    config::{ControlConfig, HeaterConfig},
    thermistor::Thermistor,
};

/// The most points of a curve that a board takes.
const POINTS_MAX: usize = 32;
/// No more points than it takes to be this close everywhere.
const CURVE_ERROR: Celsius = Celsius(0.02);
/// Between two points the curve is looked at in so many places.
const LOOKS: u32 = 16;
/// What a board takes of a temperature.
const MILLI_MIN: f64 = -300_000.0;
const MILLI_MAX: f64 = 2_000_000.0;
/// Full power on the wire.
const POWER_ONE: f64 = 4096.0;
const GAIN_ONE: f64 = (1 << 24) as f64;

/// A temperature on the wire.
pub(crate) fn milli(temperature: Celsius) -> i32 {
    libm::round((temperature.0 * 1000.0).clamp(MILLI_MIN, MILLI_MAX)) as i32
}

/// A temperature off the wire.
pub(crate) fn celsius(milli: i32) -> Celsius {
    Celsius(f64::from(milli) / 1000.0)
}

/// A power off the wire, 0 ..= 1.
pub(crate) fn duty(power: u16) -> f64 {
    (f64::from(power) / POWER_ONE).min(1.0)
}

/// Which objects make a heater.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Objects {
    pub(crate) heater: u8,
    pub(crate) sensor: u8,
    pub(crate) output: u8,
}

/// The commands that configure a heater. Nothing for a sensor whose curve a board cannot have.
pub(crate) fn commands(
    config: &HeaterConfig,
    objects: Objects,
    adc_max: f64,
    samples: u8,
) -> Option<Vec<Command<'static>>> {
    let Objects { heater: oid, sensor: adc_oid, output: out_oid } = objects;
    let points = curve(&config.thermistor, config.min_temp, config.max_temp, adc_max, samples);
    if points.len() < 2 {
        return None;
    }
    let max_power = libm::round(config.max_power * POWER_ONE).clamp(1.0, POWER_ONE) as u16;
    let smooth = ms(config.smooth_time).max(1) as u16;
    let mut commands =
        vec![Command::ConfigHeater { oid, adc_oid, out_oid, sample_count: samples, max_power, smooth }];
    let point = |&(sum, temperature): &(u16, i32)| Command::HeaterPoint { oid, sum, temperature };
    commands.extend(points.iter().map(point));
    commands.push(match config.control {
        ControlConfig::Pid(PidGains { kp, ki, kd }) => {
            let [kp, ki, kd] = [kp, ki, kd].map(gain);
            Command::HeaterPid { oid, kp, ki, kd }
        }
        ControlConfig::Watermark { max_delta } => {
            Command::HeaterWatermark { oid, delta: milli(max_delta).max(1) as u32 }
        }
    });
    let verify = config.verify;
    commands.push(Command::HeaterCheck {
        oid,
        max_error: libm::round(verify.max_error_c_s * 1000.0) as u32,
        gain_time: ms(verify.check_gain_time),
        hysteresis: milli(verify.hysteresis).max(0) as u32,
        gain: milli(verify.heating_gain).max(1) as u32,
    });
    Some(commands)
}

/// `as` saturates: a gain beyond what a board takes is full power for the least error.
fn gain(klipper: f64) -> u32 {
    libm::round(klipper / KLIPPER_GAIN_SCALE * GAIN_ONE) as u32
}

fn ms(duration: Seconds) -> u32 {
    libm::round(duration.0 * 1000.0).min(f64::from(u16::MAX) * 1000.0) as u32
}

/// Points between which the curve is straight, as near to the real one as so many can be.
fn curve(sensor: &Thermistor, min: Celsius, max: Celsius, adc_max: f64, samples: u8) -> Vec<(u16, i32)> {
    let full_scale = adc_max * f64::from(samples);
    let at = |sum: u16| sensor.temperature(f64::from(sum) / full_scale).0;
    let (low, high) = sensor.adc_range(min, max, adc_max as u32, u32::from(samples));
    let mut sums = vec![low, high];
    while sums.len() < POINTS_MAX {
        let spans = sums.windows(2).map(|pair| worst(pair[0], pair[1], &at));
        let found = spans.enumerate().max_by(|one, other| one.1.1.total_cmp(&other.1.1));
        match found {
            Some((span, (sum, error))) if error > CURVE_ERROR.0 => sums.insert(span + 1, sum),
            _ => break,
        }
    }
    let mut points: Vec<_> = sums.into_iter().map(|sum| (sum, milli(Celsius(at(sum))))).collect();
    points.dedup_by_key(|point| point.1);
    points.dedup_by_key(|point| point.0);
    points
}

/// Where between two sums a straight line is farthest off, and by how much, in °C.
fn worst(low: u16, high: u16, at: &impl Fn(u16) -> f64) -> (u16, f64) {
    let (from, to) = (at(low), at(high));
    let span = u32::from(high.saturating_sub(low));
    let look = |part: u32| {
        let sum = low + (span * part / LOOKS) as u16;
        let line = from + (to - from) * f64::from(sum - low) / f64::from(span.max(1));
        (sum, (at(sum) - line).abs())
    };
    let places = (1..LOOKS).map(look).filter(|&(sum, _)| sum > low && sum < high);
    places.max_by(|one, other| one.1.total_cmp(&other.1)).unwrap_or((low, 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thermistor::SensorCurve;

    #[test]
    fn straight_lines_are_near_every_sensors_curve() {
        for name in SensorCurve::names() {
            let sensor = Thermistor::named(name).unwrap();
            for adc_max in [1023.0, 4095.0] {
                let points = curve(&sensor, Celsius(0.0), Celsius(300.0), adc_max, 8);
                assert!((2..=POINTS_MAX).contains(&points.len()), "{name}");
                let mut error = 0.0_f64;
                for pair in points.windows(2) {
                    let ((s0, t0), (s1, t1)) = (pair[0], pair[1]);
                    assert!(s1 > s0 && (t1 > t0) == (points[1].1 > points[0].1) && t1 != t0, "{name}");
                    for sum in s0..=s1 {
                        let exact = sensor.temperature(f64::from(sum) / (adc_max * 8.0)).0;
                        let line =
                            f64::from(t0) + f64::from(t1 - t0) * f64::from(sum - s0) / f64::from(s1 - s0);
                        error = error.max((line / 1000.0 - exact).abs());
                    }
                }
                assert!(error < 0.5, "{name}: {error} °C off with {} points", points.len());
                let ends = [points[0].1, points[points.len() - 1].1];
                assert!(ends.iter().any(|&end| end <= 0) && ends.iter().any(|&end| end >= 300_000), "{name}");
            }
        }
    }

    #[test]
    fn gains_are_klippers_in_the_boards_units() {
        assert_eq!(gain(255.0), 1 << 24);
        assert_eq!(gain(1e6), u32::MAX);
        assert_eq!((gain(0.0), milli(Celsius(-1e9)), milli(Celsius(199.9996))), (0, -300_000, 200_000));
        assert_eq!((duty(4096), duty(1024), celsius(-1500)), (1.0, 0.25, Celsius(-1.5)));
    }
}
