//! Thermistors in a divider, read by a noisy 12-bit converter.
//!
//! Units: °C, ohms, counts of the converter. Does not know: pins, heaters, when it is read.
//! Source: Steinhart and Hart (1968); the Beta equation is its two-term form. 100 kΩ values from the data sheet of
//! the EPCOS B57560G104F.

use units::{Celsius, Ohms};

const KELVIN: f64 = 273.15;
/// Full scale of the converter.
pub(crate) const ADC_MAX: u16 = 4095;

/// A thermistor's curve: 1/T = a + b·ln R + c·(ln R)³.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thermistor {
    a: f64,
    b: f64,
    c: f64,
}

impl Thermistor {
    /// Through three points of a data sheet. `None` where no falling curve goes through them.
    pub fn steinhart_hart(points: [(Celsius, Ohms); 3]) -> Option<Self> {
        let [(l1, y1), (l2, y2), (l3, y3)] =
            points.map(|(celsius, ohms)| (libm::log(ohms.0), 1.0 / (celsius.0 + KELVIN)));
        let g2 = (y2 - y1) / (l2 - l1);
        let g3 = (y3 - y1) / (l3 - l1);
        let c = (g3 - g2) / (l3 - l2) / (l1 + l2 + l3);
        let b = g2 - c * (l1 * l1 + l1 * l2 + l2 * l2);
        let a = y1 - (b + l1 * l1 * c) * l1;
        Self { a, b, c }.checked()
    }

    /// From the resistance at 25 °C and the Beta value in kelvins. `None` where they make no thermistor.
    pub fn beta(at_25: Ohms, beta_k: f64) -> Option<Self> {
        let b = 1.0 / beta_k;
        Self { a: 1.0 / (25.0 + KELVIN) - b * libm::log(at_25.0), b, c: 0.0 }.checked()
    }

    /// The EPCOS B57560G104F: 100 kΩ at 25 °C, in many hot ends and beds.
    pub fn epcos_100k() -> Self {
        let points = [(25.0, 100_000.0), (150.0, 1641.9), (250.0, 226.15)];
        let points = points.map(|(celsius, ohms)| (Celsius(celsius), Ohms(ohms)));
        Self::steinhart_hart(points).unwrap_or(Self { a: 0.000_722, b: 0.000_216, c: 8.92e-8 })
    }

    fn checked(self) -> Option<Self> {
        let finite = self.a.is_finite() && self.b.is_finite() && self.c.is_finite();
        (finite && self.b > 0.0 && self.c >= -1e-6).then_some(self)
    }

    /// The resistance at a temperature.
    pub fn resistance(&self, temperature: Celsius) -> Ohms {
        let kelvin = (temperature.0 + KELVIN).max(1.0);
        // ln R solves c·l³ + b·l = 1/T − a; Newton from the Beta form converges fast because the cubic term is small.
        let target = 1.0 / kelvin - self.a;
        let mut l = target / self.b;
        for _ in 0..20 {
            let f = (self.b + self.c * l * l) * l - target;
            let slope = self.b + 3.0 * self.c * l * l;
            if slope <= 0.0 {
                break;
            }
            l -= f / slope;
        }
        Ohms(libm::exp(l.clamp(-20.0, 40.0)))
    }

    /// What the converter's ideal reading is, 0 to 1, with a pull-up resistor to its reference.
    pub fn ratio(&self, temperature: Celsius, pull_up: Ohms) -> f64 {
        let resistance = self.resistance(temperature).0;
        resistance / (resistance + pull_up.0)
    }
}

/// A reading: the ideal one with noise (in counts), rounded to what the converter can say.
pub(crate) fn counts(ratio: f64, noise: f64) -> u16 {
    // `as` saturates below at 0.
    ((ratio * f64::from(ADC_MAX) + noise + 0.5) as u16).min(ADC_MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_goes_through_the_data_sheets_points() {
        let thermistor = Thermistor::epcos_100k();
        for (celsius, ohms) in [(25.0, 100_000.0), (150.0, 1641.9), (250.0, 226.15)] {
            let found = thermistor.resistance(Celsius(celsius)).0;
            assert!((found / ohms - 1.0).abs() < 1e-6, "{celsius}: {found}");
        }
    }

    #[test]
    fn the_beta_form_agrees_with_its_definition() {
        let thermistor = Thermistor::beta(Ohms(100_000.0), 3950.0).expect("a thermistor");
        assert!((thermistor.resistance(Celsius(25.0)).0 - 100_000.0).abs() < 1e-3);
        assert!(thermistor.resistance(Celsius(200.0)).0 < 1000.0);
    }

    #[test]
    fn resistance_falls_over_the_whole_range() {
        let thermistor = Thermistor::epcos_100k();
        let values: Vec<f64> =
            (-40..400).map(|celsius| thermistor.resistance(Celsius(celsius.into())).0).collect();
        assert!(values.windows(2).all(|pair| pair[1] < pair[0]));
    }

    #[test]
    fn nonsense_is_refused() {
        let same = [(Celsius(25.0), Ohms(1000.0)); 3];
        assert_eq!(Thermistor::steinhart_hart(same), None);
        assert_eq!(Thermistor::beta(Ohms(-5.0), 3950.0), None);
    }

    #[test]
    fn the_converter_saturates() {
        assert_eq!(counts(1.0, 3.0), ADC_MAX);
        assert_eq!(counts(0.0, -3.0), 0);
        assert_eq!(counts(0.5, 0.0), 2048);
    }
}
