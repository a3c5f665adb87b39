//! The two temperature loops: PID and on–off with a dead band. From temperatures to a power, nothing else.
//!
//! In whole numbers: a chip may have no floating point. Temperatures in 1/1000 °C, times in 1/1024 s, power in
//! [`FULL`]ths. They are the loops of the host's, and give the same power within a thousandth.

/// Full power. A gain is in 1/2²⁴ of it for each °C, temperatures come in 1/1000 °C: their product needs no division.
pub(crate) const FULL: i64 = 1000 << GAIN_BITS;
const GAIN_BITS: u32 = 24;
/// A second is so many bits of the unit of time.
pub(crate) const SECOND_BITS: u32 = 10;
/// The slope has so many bits below 1/1000 °C a second.
const SLOPE_BITS: u32 = 8;

pub(crate) enum Control {
    /// None was given.
    None,
    Pid(Pid),
    Watermark(Watermark),
}

impl Control {
    /// Forgets what was learnt, as for a heater that was off.
    pub(crate) const fn reset(&mut self) {
        match self {
            Self::None => {}
            Self::Pid(pid) => pid.integral = 0,
            Self::Watermark(watermark) => watermark.heats = false,
        }
    }

    /// The power, 0 to `power_max`, after a reading `dt` after the one before.
    pub(crate) fn update(&mut self, milli: i32, target: i32, dt: i64, power_max: i64) -> i64 {
        match self {
            Self::None => 0,
            Self::Pid(pid) => pid.update(milli, target, dt, power_max),
            Self::Watermark(watermark) => watermark.update(milli, target, power_max),
        }
    }
}

pub(crate) struct Pid {
    kp: i64,
    ki: i64,
    kd: i64,
    /// Over how long the slope is averaged.
    smooth: i64,
    /// The integral's part of the power.
    integral: i64,
    slope: i64,
    last: Option<i32>,
}

impl Pid {
    /// Gains in 1/2²⁴ of full power for each °C, °C·s and °C/s.
    pub(crate) fn new(kp: u32, ki: u32, kd: u32, smooth: i64) -> Self {
        let [kp, ki, kd] = [kp, ki, kd].map(i64::from);
        Self { kp, ki, kd, smooth: smooth.max(1), integral: 0, slope: 0, last: None }
    }

    fn update(&mut self, milli: i32, target: i32, dt: i64, power_max: i64) -> i64 {
        let last = self.last.replace(milli).unwrap_or(milli);
        let rise = (i64::from(milli) - i64::from(last)) << (SECOND_BITS + SLOPE_BITS);
        self.slope += (rise - self.slope * dt) / dt.max(self.smooth);
        if target <= 0 {
            return 0;
        }
        let error = i64::from(target) - i64::from(milli);
        let added = (self.ki * error).saturating_mul(dt) >> SECOND_BITS;
        let integral = (self.integral + added).clamp(0, power_max);
        let damping = self.kd.saturating_mul(self.slope) >> SLOPE_BITS;
        let wanted = (self.kp * error).saturating_add(integral).saturating_sub(damping);
        let power = wanted.clamp(0, power_max);
        // While the power is cut off, the integral may only move back towards the range.
        if power == wanted || (wanted > power) != (integral > self.integral) {
            self.integral = integral;
        }
        power
    }
}

pub(crate) struct Watermark {
    delta: i32,
    heats: bool,
}

impl Watermark {
    pub(crate) const fn new(delta: i32) -> Self {
        Self { delta, heats: false }
    }

    const fn update(&mut self, milli: i32, target: i32, power_max: i64) -> i64 {
        if target <= 0 || milli >= target.saturating_add(self.delta) {
            self.heats = false;
        } else if milli <= target.saturating_sub(self.delta) {
            self.heats = true;
        }
        if self.heats { power_max } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;

    /// The same in floating point, by the book.
    struct Exact {
        gains: [f64; 3],
        smooth_s: f64,
        integral: f64,
        slope: f64,
        last: Option<f64>,
    }

    impl Exact {
        fn update(&mut self, celsius: f64, target: f64, dt: f64, power_max: f64) -> f64 {
            let last = self.last.replace(celsius).unwrap_or(celsius);
            self.slope += (celsius - last - self.slope * dt) / dt.max(self.smooth_s);
            let error = target - celsius;
            let integral = (self.integral + self.gains[1] * error * dt).clamp(0.0, power_max);
            let wanted = self.gains[0] * error + integral - self.gains[2] * self.slope;
            let power = wanted.clamp(0.0, power_max);
            if power == wanted || (wanted - power) * (integral - self.integral) < 0.0 {
                self.integral = integral;
            }
            power
        }
    }

    proptest! {
        #[test]
        fn whole_numbers_give_what_exact_ones_do(
            gains in [0.01_f64..0.5, 0.0005_f64..0.02, 0.0_f64..1.0],
            target in 100_000..260_000_i32,
            moves in prop::collection::vec(-400..900_i32, 50..300),
        ) {
            let [kp, ki, kd] = gains.map(|gain| (gain * f64::from(1 << GAIN_BITS)) as u32);
            let mut pid = Pid::new(kp, ki, kd, 1 << SECOND_BITS);
            let mut exact = Exact { gains, smooth_s: 1.0, integral: 0.0, slope: 0.0, last: None };
            let mut milli = target - 30_000;
            let dt = 307;
            for by in moves {
                milli += by;
                let power = pid.update(milli, target, dt, FULL) as f64 / FULL as f64;
                let celsius = f64::from(milli) / 1000.0;
                let expected = exact.update(celsius, f64::from(target) / 1000.0, dt as f64 / 1024.0, 1.0);
                prop_assert!((power - expected).abs() < 1e-3, "{} for {}", power, expected);
            }
        }

        #[test]
        fn no_gain_and_no_jump_overflows(
            gains: [u32; 3],
            smooth in 0..70_000_i64,
            readings in prop::collection::vec((-300_000..=2_000_000_i32, 0..=2048_i64), 1..50),
            target in 0..2_000_000_i32,
        ) {
            let mut pid = Pid::new(gains[0], gains[1], gains[2], smooth);
            for (milli, dt) in readings {
                let power = pid.update(milli, target, dt, FULL);
                prop_assert!((0..=FULL).contains(&power));
            }
        }
    }

    #[test]
    fn far_below_full_power_far_above_none() {
        let mut pid = Pid::new(1_460_000, 71_000, 0, 1024);
        assert_eq!(pid.update(20_000, 200_000, 307, FULL / 2), FULL / 2);
        assert_eq!(pid.integral, 0, "it does not wind up");
        assert_eq!(pid.update(250_000, 200_000, 307, FULL), 0);
        assert_eq!(pid.update(20_000, 0, 307, FULL), 0);
    }

    #[test]
    fn a_dead_band_is_left_alone() {
        let mut control = Control::Watermark(Watermark::new(2_000));
        let powers = [50_000, 59_000, 61_999, 62_000, 59_000, 58_000, 70_000]
            .map(|milli| control.update(milli, 60_000, 307, 9));
        assert_eq!(powers, [9, 9, 9, 0, 0, 9, 0]);
        assert_eq!(control.update(10, 0, 307, 9), 0);
    }
}
