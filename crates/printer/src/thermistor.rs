//! Resistive temperature sensors behind a voltage divider: from what the converter reads to a temperature and back.
//!
//! Knows nothing of boards or heaters. A reading is a ratio 0..=1 of the converter's full scale; the sensor lies
//! between the pin and ground, a pull-up between the pin and the supply that is also the converter's reference, so
//! the supply's voltage cancels.
//!
//! Sources: Steinhart and Hart, "Calibration curves for thermistors", Deep-Sea Research 15 (1968); IEC 60751 for
//! platinum; the manufacturers' resistance tables for the named parts.

use units::{Celsius, Ohms};

/// 0 °C in kelvin.
const ZERO_CELSIUS_K: f64 = 273.15;

/// Readings closer than this to either rail are taken as this close: beyond it lies only a broken or shorted wire.
const RATIO_MARGIN: f64 = 1e-5;

/// What nearly every printer's board has.
pub const PULLUP_DEFAULT: Ohms = Ohms(4_700.0);

/// Callendar–Van Dusen coefficients of IEC 60751 platinum, above 0 °C.
const PLATINUM_A: f64 = 3.9083e-3;
const PLATINUM_B: f64 = -5.775e-7;

/// How a sensor's resistance depends on its temperature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorCurve {
    curve: Curve,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Curve {
    /// 1/T = a + b·ln R + c·(ln R)³, T in kelvin. `c` may be zero: the Beta equation.
    SteinhartHart { a: f64, b: f64, c: f64 },
    /// R = r0·(1 + A·t + B·t²), t in °C.
    Platinum { r0: f64 },
}

/// Why three points, or a point and a Beta, make no sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ThermistorError {
    /// A resistance at or below zero, a temperature below absolute zero, or a number that is none.
    #[error("resistances must be above 0 Ω, temperatures above -273.15 °C, and Beta above 0")]
    OutOfRange,
    /// Two points with the same temperature or resistance, or resistance that grows with temperature.
    #[error("each point needs a higher temperature and a lower resistance than the one before")]
    NotFalling,
}

/// A named part: Klipper's `sensor_type` and its data-sheet points.
struct Part {
    name: &'static str,
    data: PartData,
}

enum PartData {
    /// (°C, Ω) three times.
    Points([(f64, f64); 3]),
    /// °C, Ω, Beta in kelvin.
    Beta(f64, f64, f64),
    /// Ω at 0 °C.
    Platinum(f64),
}

const PARTS: &[Part] = &[
    Part {
        name: "EPCOS 100K B57560G104F",
        data: PartData::Points([(25.0, 100_000.0), (150.0, 1_641.9), (250.0, 226.15)]),
    },
    Part {
        name: "ATC Semitec 104GT-2",
        data: PartData::Points([(20.0, 126_800.0), (150.0, 1_360.0), (300.0, 80.65)]),
    },
    Part {
        name: "ATC Semitec 104NT-4-R025H42G",
        data: PartData::Points([(25.0, 100_000.0), (160.0, 1_074.0), (300.0, 82.78)]),
    },
    Part {
        name: "Generic 3950",
        data: PartData::Points([(25.0, 100_000.0), (150.0, 1_770.0), (250.0, 230.0)]),
    },
    Part { name: "Honeywell 100K 135-104LAG-J01", data: PartData::Beta(25.0, 100_000.0, 3_974.0) },
    Part { name: "NTC 100K MGB18-104F39050L32", data: PartData::Beta(25.0, 100_000.0, 4_100.0) },
    Part {
        name: "SliceEngineering 450",
        data: PartData::Points([(25.0, 500_000.0), (200.0, 3_734.0), (400.0, 240.0)]),
    },
    Part {
        name: "TDK NTCG104LH104JT1",
        data: PartData::Points([(25.0, 100_000.0), (50.0, 31_230.0), (125.0, 2_066.0)]),
    },
    Part { name: "PT1000", data: PartData::Platinum(1_000.0) },
];

impl SensorCurve {
    /// The sensor that a printer.cfg calls by this `sensor_type`, or none of that name.
    pub fn named(sensor_type: &str) -> Option<Self> {
        let part = PARTS.iter().find(|part| part.name == sensor_type)?;
        match part.data {
            PartData::Points(points) => {
                Self::from_points(points.map(|(celsius, ohms)| (Celsius(celsius), Ohms(ohms)))).ok()
            }
            PartData::Beta(celsius, ohms, beta) => Self::from_beta(Celsius(celsius), Ohms(ohms), beta).ok(),
            PartData::Platinum(r0) => Some(Self { curve: Curve::Platinum { r0 } }),
        }
    }

    /// Every name that [`Self::named`] knows.
    pub fn names() -> impl Iterator<Item = &'static str> {
        PARTS.iter().map(|part| part.name)
    }

    /// Fits the Steinhart–Hart equation through three points with rising temperature and falling resistance.
    ///
    /// Points whose cubic term comes out negative (the curve would turn back outside them) are fitted by the Beta
    /// equation through the outer two.
    pub fn from_points(points: [(Celsius, Ohms); 3]) -> Result<Self, ThermistorError> {
        for (temperature, resistance) in points {
            if !is_possible(temperature, resistance) {
                return Err(ThermistorError::OutOfRange);
            }
        }
        let [p1, p2, p3] = points;
        if !(p1.0 < p2.0 && p2.0 < p3.0 && p1.1 > p2.1 && p2.1 > p3.1) {
            return Err(ThermistorError::NotFalling);
        }
        let inverse = points.map(|(temperature, _)| 1.0 / (temperature.0 + ZERO_CELSIUS_K));
        let log = points.map(|(_, resistance)| libm::log(resistance.0));
        // Divided differences: the slopes of 1/T over ln R, and how the slope changes.
        let slope_12 = (inverse[1] - inverse[0]) / (log[1] - log[0]);
        let slope_13 = (inverse[2] - inverse[0]) / (log[2] - log[0]);
        let c = (slope_13 - slope_12) / ((log[2] - log[1]) * (log[0] + log[1] + log[2]));
        let b = slope_12 - c * (log[0] * log[0] + log[0] * log[1] + log[1] * log[1]);
        let a = inverse[0] - (b + c * log[0] * log[0]) * log[0];
        if c >= 0.0 && b > 0.0 && a.is_finite() {
            return Ok(Self { curve: Curve::SteinhartHart { a, b, c } });
        }
        Self::from_beta(p1.0, p1.1, (log[0] - log[2]) / (inverse[0] - inverse[2]))
    }

    /// The Beta equation through one point: R = R₀·exp(β·(1/T − 1/T₀)), `beta` in kelvin.
    pub fn from_beta(temperature: Celsius, resistance: Ohms, beta: f64) -> Result<Self, ThermistorError> {
        if !(is_possible(temperature, resistance) && beta.is_finite() && beta > 0.0) {
            return Err(ThermistorError::OutOfRange);
        }
        let b = 1.0 / beta;
        let a = 1.0 / (temperature.0 + ZERO_CELSIUS_K) - b * libm::log(resistance.0);
        Ok(Self { curve: Curve::SteinhartHart { a, b, c: 0.0 } })
    }

    /// The temperature at which the sensor has this resistance. Always finite: what no temperature explains is
    /// pinned to absolute zero or to [`HOTTEST`](Self::HOTTEST).
    pub fn temperature(&self, resistance: Ohms) -> Celsius {
        let celsius = match self.curve {
            Curve::SteinhartHart { a, b, c } => {
                let log = libm::log(resistance.0.max(f64::MIN_POSITIVE));
                let inverse = a + (b + c * log * log) * log;
                // A resistance below that of infinite temperature: as hot as can be.
                if inverse <= 0.0 { Self::HOTTEST.0 } else { 1.0 / inverse - ZERO_CELSIUS_K }
            }
            Curve::Platinum { r0 } => {
                let discriminant = PLATINUM_A * PLATINUM_A - 4.0 * PLATINUM_B * (1.0 - resistance.0 / r0);
                if discriminant <= 0.0 {
                    Self::HOTTEST.0
                } else {
                    (discriminant.sqrt() - PLATINUM_A) / (2.0 * PLATINUM_B)
                }
            }
        };
        if celsius.is_nan() {
            return Self::HOTTEST;
        }
        Celsius(celsius.clamp(-ZERO_CELSIUS_K, Self::HOTTEST.0))
    }

    /// The hottest temperature ever reported; no sensor of these kinds survives it.
    pub const HOTTEST: Celsius = Celsius(2_000.0);

    /// The resistance at a temperature.
    pub fn resistance(&self, temperature: Celsius) -> Ohms {
        match self.curve {
            Curve::SteinhartHart { a, b, c } => {
                let inverse = 1.0 / (temperature.0 + ZERO_CELSIUS_K).max(1.0);
                Ohms(libm::exp(log_resistance(a - inverse, b, c)))
            }
            Curve::Platinum { r0 } => {
                let t = temperature.0;
                Ohms(r0 * (1.0 + (PLATINUM_A + PLATINUM_B * t) * t).max(0.0))
            }
        }
    }

    /// Whether resistance falls as temperature rises (NTC), so that an open wire reads cold.
    pub const fn falls_with_temperature(&self) -> bool {
        matches!(self.curve, Curve::SteinhartHart { .. })
    }
}

fn is_possible(temperature: Celsius, resistance: Ohms) -> bool {
    temperature.0.is_finite()
        && temperature.0 > -ZERO_CELSIUS_K
        && resistance.0.is_finite()
        && resistance.0 > 0.0
}

/// The real root x of c·x³ + b·x + d = 0 with b > 0 and c ≥ 0, of which there is exactly one.
///
/// Newton's steps rather than Cardano's formula, whose difference of cube roots loses digits where `c` is tiny.
fn log_resistance(d: f64, b: f64, c: f64) -> f64 {
    let mut x = -d / b;
    if c > 0.0 {
        // |x| cannot exceed either term's own root; starting at the smaller keeps the steps few and one-sided.
        let cubic = libm::cbrt(-d / c);
        if cubic.abs() < x.abs() {
            x = cubic;
        }
        for _ in 0..ROOT_STEPS_MAX {
            let step = ((c * x * x + b) * x + d) / (3.0 * c * x * x + b);
            x -= step;
            if step.abs() <= 1e-14 * x.abs().max(1.0) {
                break;
            }
        }
    }
    x
}

/// From the start chosen, a convex monotone cubic takes five or six; the bound is against surprises.
const ROOT_STEPS_MAX: u32 = 40;

/// A sensor together with the resistors around it: what a board's converter sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thermistor {
    /// The sensor.
    pub curve: SensorCurve,
    /// From the pin to the supply.
    pub pullup: Ohms,
    /// In series with the sensor; usually 0.
    pub inline: Ohms,
}

impl Thermistor {
    /// A sensor of this `sensor_type` behind the usual resistors: 4.7 kΩ to the supply, none in series.
    pub fn named(sensor_type: &str) -> Option<Self> {
        let curve = SensorCurve::named(sensor_type)?;
        Some(Self { curve, pullup: PULLUP_DEFAULT, inline: Ohms::ZERO })
    }

    /// The temperature behind a reading of `ratio` (0..=1 of full scale). Always finite.
    pub fn temperature(&self, ratio: f64) -> Celsius {
        let ratio = if ratio.is_nan() { 1.0 } else { ratio.clamp(RATIO_MARGIN, 1.0 - RATIO_MARGIN) };
        let resistance = self.pullup.0 * ratio / (1.0 - ratio) - self.inline.0;
        self.curve.temperature(Ohms(resistance.max(0.0)))
    }

    /// What the converter reads at a temperature, as a ratio 0..=1 of full scale.
    pub fn adc_ratio(&self, temperature: Celsius) -> f64 {
        let resistance = self.curve.resistance(temperature).0 + self.inline.0;
        if resistance.is_finite() { resistance / (resistance + self.pullup.0) } else { 1.0 }
    }

    /// The lowest and highest reading of a converter with `adc_max` steps, summed over `samples`, that a temperature
    /// between `min` and `max` can give: what the board checks by itself.
    pub fn adc_range(&self, min: Celsius, max: Celsius, adc_max: u32, samples: u32) -> (u16, u16) {
        let full_scale = f64::from(adc_max) * f64::from(samples);
        let (one, other) = (self.adc_ratio(min) * full_scale, self.adc_ratio(max) * full_scale);
        // Outwards to whole readings; `as` saturates.
        (libm::floor(one.min(other)) as u16, libm::ceil(one.max(other)) as u16)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn every_named_sensor_exists_and_passes_through_its_points() {
        for part in PARTS {
            let sensor = SensorCurve::named(part.name).unwrap();
            let points = match part.data {
                PartData::Points(points) => points.to_vec(),
                PartData::Beta(celsius, ohms, _) => vec![(celsius, ohms)],
                PartData::Platinum(r0) => vec![(0.0, r0), (100.0, 1.38506 * r0)],
            };
            for (celsius, ohms) in points {
                let temperature = sensor.temperature(Ohms(ohms));
                assert!((temperature.0 - celsius).abs() < 0.01, "{}: {temperature} at {ohms}", part.name);
                let resistance = sensor.resistance(Celsius(celsius));
                assert!((resistance.0 / ohms - 1.0).abs() < 1e-4, "{}: {resistance}", part.name);
            }
        }
        assert_eq!(SensorCurve::names().count(), PARTS.len());
        assert!(Thermistor::named("epcos").is_none());
    }

    #[test]
    fn the_fit_agrees_with_a_figure_that_it_was_not_made_from() {
        // The maker states B(25/100) = 4092 K ± 1 % for B57560G104F; 100 °C is none of the three points.
        let curve = SensorCurve::named("EPCOS 100K B57560G104F").unwrap();
        let ratio = curve.resistance(Celsius(25.0)).0 / curve.resistance(Celsius(100.0)).0;
        let beta = libm::log(ratio) / (1.0 / 298.15 - 1.0 / 373.15);
        assert!((beta / 4_092.0 - 1.0).abs() < 0.01, "{beta}");
    }

    #[test]
    fn broken_wires_read_as_impossible_temperatures() {
        for name in SensorCurve::names() {
            let circuit = Thermistor::named(name).unwrap();
            let (open, short) = (circuit.temperature(1.0), circuit.temperature(0.0));
            if circuit.curve.falls_with_temperature() {
                assert!(open < Celsius(-20.0), "{name}: open {open}");
                assert!(short > Celsius(500.0), "{name}: short {short}");
            } else {
                assert!(open > Celsius(500.0), "{name}: open {open}");
                assert!(short < Celsius(-200.0), "{name}: short {short}");
            }
        }
    }

    #[test]
    fn points_that_make_no_thermistor_are_refused() {
        let p = |celsius, ohms| (Celsius(celsius), Ohms(ohms));
        let good = [p(25.0, 1e5), p(150.0, 1641.9), p(250.0, 226.15)];
        assert!(SensorCurve::from_points(good).is_ok());
        for (points, error) in [
            ([p(25.0, 1e5), p(25.0, 1641.9), p(250.0, 226.15)], ThermistorError::NotFalling),
            ([p(25.0, 1e5), p(150.0, 2e5), p(250.0, 226.15)], ThermistorError::NotFalling),
            ([p(25.0, 0.0), p(150.0, 1641.9), p(250.0, 226.15)], ThermistorError::OutOfRange),
            ([p(f64::NAN, 1e5), p(150.0, 1641.9), p(250.0, 226.15)], ThermistorError::OutOfRange),
            ([p(-300.0, 1e5), p(150.0, 1641.9), p(250.0, 226.15)], ThermistorError::OutOfRange),
        ] {
            assert_eq!(SensorCurve::from_points(points), Err(error));
        }
        assert!(SensorCurve::from_beta(Celsius(25.0), Ohms(1e5), 0.0).is_err());
        assert!(SensorCurve::from_beta(Celsius(25.0), Ohms(1e5), f64::NAN).is_err());
    }

    #[test]
    fn the_boards_range_holds_every_good_reading_and_neither_fault() {
        let circuit = Thermistor::named("EPCOS 100K B57560G104F").unwrap();
        let (low, high) = circuit.adc_range(Celsius(0.0), Celsius(260.0), 4095, 8);
        for tenth in 0..=2600 {
            let reading = circuit.adc_ratio(Celsius(f64::from(tenth) / 10.0)) * 4095.0 * 8.0;
            assert!(reading >= f64::from(low) && reading <= f64::from(high));
        }
        assert!(low > 0 && high < 4095 * 8, "{low} {high}");
    }

    proptest! {
        #[test]
        fn temperature_and_reading_are_inverse(
            name in prop::sample::select(SensorCurve::names().collect::<Vec<_>>()),
            celsius in -20.0_f64..300.0,
            inline in 0.0_f64..100.0,
        ) {
            let circuit = Thermistor { inline: Ohms(inline), ..Thermistor::named(name).unwrap() };
            let ratio = circuit.adc_ratio(Celsius(celsius));
            prop_assert!((0.0..=1.0).contains(&ratio));
            prop_assert!((circuit.temperature(ratio).0 - celsius).abs() < 1e-6);
        }

        #[test]
        fn any_point_makes_a_monotone_finite_curve_or_an_error(
            t in prop::array::uniform3(-300.0_f64..1e4),
            r in prop::array::uniform3(-10.0_f64..1e9),
            ratio in prop::num::f64::ANY,
        ) {
            let points = [(Celsius(t[0]), Ohms(r[0])), (Celsius(t[1]), Ohms(r[1])), (Celsius(t[2]), Ohms(r[2]))];
            if let Ok(curve) = SensorCurve::from_points(points) {
                let circuit = Thermistor { curve, pullup: Ohms(4_700.0), inline: Ohms(0.0) };
                prop_assert!(circuit.temperature(ratio).0.is_finite());
                let colder = circuit.temperature(0.6);
                prop_assert!(colder <= circuit.temperature(0.4));
                prop_assert!((0.0..=1.0).contains(&circuit.adc_ratio(Celsius(t[0]))));
            }
        }
    }
}
