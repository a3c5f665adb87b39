//! How well the nozzle keeps its temperature while filament runs through it.
//!
//! After each change of the target the error counts from the second time that the nozzle comes into the band around it,
//! so that heating up and its overshoot are not mistaken for bad control; or, where it never leaves the band again, from
//! [`SETTLED`] after the first time. The overshoot itself is stated apart.
//!
//! Temperatures in °C; those of the nozzle itself, not what its sensor says.

use units::{Celsius, Seconds};

/// Half the width of the band around the target.
pub(crate) const BAND: Celsius = Celsius(3.0);
/// A nozzle that stayed in the band for so long has settled.
const SETTLED: Seconds = Seconds(30.0);

/// Watches one heater.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TemperatureWatch {
    target: f64,
    inside: bool,
    entries: u32,
    entered_at: f64,
    /// It came from below, so that going beyond is an overshoot.
    heating: bool,
    error_max: Option<f64>,
    overshoot_max: f64,
}

impl TemperatureWatch {
    /// The heater is to be at this temperature from now on.
    pub(crate) fn set_target(&mut self, target: Celsius, now_at: Celsius) {
        if target.0 == self.target {
            return;
        }
        let kept = (self.error_max, self.overshoot_max);
        *self = Self { target: target.0, heating: now_at.0 < target.0, ..Self::default() };
        (self.error_max, self.overshoot_max) = kept;
    }

    /// The heater is at this temperature, and filament runs or does not.
    pub(crate) fn sample(&mut self, now: Seconds, at: Celsius, extruding: bool) {
        if self.target <= 0.0 {
            return;
        }
        let off = at.0 - self.target;
        let inside = off.abs() <= BAND.0;
        if inside && !self.inside {
            self.entries += 1;
            self.entered_at = now.0;
        }
        self.inside = inside;
        if self.heating {
            self.overshoot_max = self.overshoot_max.max(off);
        }
        let settled =
            self.entries >= 2 || (self.entries == 1 && inside && now.0 - self.entered_at >= SETTLED.0);
        if settled {
            // From now on every excursion counts.
            self.entries = self.entries.max(2);
            if extruding {
                self.error_max = Some(self.error_max.unwrap_or(0.0).max(off.abs()));
            }
        }
    }

    /// The worst error while filament ran; `None` where none did.
    pub(crate) fn error_max(&self) -> Option<Celsius> {
        self.error_max.map(Celsius)
    }

    /// How far the heater went beyond a target that it was heated to.
    pub(crate) fn overshoot_max(&self) -> Celsius {
        Celsius(self.overshoot_max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn watch(samples: &[(f64, f64)]) -> TemperatureWatch {
        let mut watch = TemperatureWatch::default();
        watch.set_target(Celsius(200.0), Celsius(20.0));
        for &(now, at) in samples {
            watch.sample(Seconds(now), Celsius(at), true);
        }
        watch
    }

    #[test]
    fn heating_up_and_overshoot_do_not_count_but_what_follows_does() {
        let found = watch(&[(0.0, 20.0), (60.0, 198.0), (62.0, 204.5), (70.0, 202.0), (80.0, 195.0)]);
        assert_eq!(found.error_max(), Some(Celsius(5.0)));
        assert_eq!(found.overshoot_max(), Celsius(4.5));
        assert_eq!(watch(&[(0.0, 20.0), (60.0, 198.0), (62.0, 204.5)]).error_max(), None);
    }

    #[test]
    fn a_nozzle_that_never_overshoots_counts_once_it_has_settled() {
        let found = watch(&[(0.0, 20.0), (60.0, 198.0), (75.0, 200.5), (91.0, 200.0), (95.0, 196.0)]);
        assert_eq!(found.error_max(), Some(Celsius(4.0)));
    }

    #[test]
    fn only_extrusion_counts_and_a_new_target_starts_anew() {
        let mut watch = TemperatureWatch::default();
        watch.set_target(Celsius(200.0), Celsius(20.0));
        for (now, at) in [(0.0, 200.0), (40.0, 201.0), (50.0, 190.0)] {
            watch.sample(Seconds(now), Celsius(at), false);
        }
        assert_eq!(watch.error_max(), None);
        watch.set_target(Celsius(230.0), Celsius(201.0));
        watch.sample(Seconds(60.0), Celsius(201.0), true);
        assert_eq!(watch.error_max(), None);
        watch.set_target(Celsius::ZERO, Celsius(230.0));
        watch.sample(Seconds(90.0), Celsius(100.0), true);
        assert_eq!(watch.error_max(), None);
    }
}
