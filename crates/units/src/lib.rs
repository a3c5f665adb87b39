//! Physical quantities and protocol numbers as types, so that a millimetre is never taken for a tick.
//!
//! Knows nothing of files, wires or machines. `no_std`, no allocation. Every float is SI but for lengths, which
//! are in millimetres as everywhere in this field.
//!
//! Three words for time, never mixed: **print time** ([`Seconds`] along the plan), **host time** ([`Seconds`] of a
//! monotonic clock that only the shell reads) and the board's **clock** ([`Ticks`], 64 bits, of which
//! [`Clock32`] are the low 32 that travel on the wire).
#![no_std]

mod clock;

pub use clock::{Clock32, Ticks};

macro_rules! quantity {
    ($(#[$doc:meta])* $name:ident, $unit:literal) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
        #[repr(transparent)]
        pub struct $name(pub f64);

        impl $name {
            /// Zero of this quantity.
            pub const ZERO: Self = Self(0.0);

            /// The bare number, in the unit the type's name says.
            pub const fn get(self) -> f64 {
                self.0
            }

            /// The smaller of two.
            #[must_use]
            pub const fn min(self, other: Self) -> Self {
                Self(self.0.min(other.0))
            }

            /// The larger of two.
            #[must_use]
            pub const fn max(self, other: Self) -> Self {
                Self(self.0.max(other.0))
            }

            /// Distance from zero.
            #[must_use]
            pub const fn abs(self) -> Self {
                Self(self.0.abs())
            }
        }

        impl core::ops::Add for $name {
            type Output = Self;
            fn add(self, other: Self) -> Self {
                Self(self.0 + other.0)
            }
        }

        impl core::ops::Sub for $name {
            type Output = Self;
            fn sub(self, other: Self) -> Self {
                Self(self.0 - other.0)
            }
        }

        impl core::ops::Neg for $name {
            type Output = Self;
            fn neg(self) -> Self {
                Self(-self.0)
            }
        }

        impl core::ops::Mul<f64> for $name {
            type Output = Self;
            fn mul(self, factor: f64) -> Self {
                Self(self.0 * factor)
            }
        }

        impl core::ops::Div<f64> for $name {
            type Output = Self;
            fn div(self, divisor: f64) -> Self {
                Self(self.0 / divisor)
            }
        }

        impl core::ops::AddAssign for $name {
            fn add_assign(&mut self, other: Self) {
                self.0 += other.0;
            }
        }

        impl core::ops::SubAssign for $name {
            fn sub_assign(&mut self, other: Self) {
                self.0 -= other.0;
            }
        }

        impl core::fmt::Display for $name {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                core::fmt::Display::fmt(&self.0, f)?;
                f.write_str($unit)
            }
        }
    };
}

quantity!(
    /// A length or a position along an axis, in millimetres.
    Mm, " mm"
);
quantity!(
    /// A speed in millimetres per second.
    MmPerS, " mm/s"
);
quantity!(
    /// An acceleration in millimetres per second squared.
    MmPerS2, " mm/s²"
);
quantity!(
    /// A jerk: how fast an acceleration changes.
    MmPerS3, " mm/s³"
);
quantity!(
    /// A duration or a point in time, in seconds.
    Seconds, " s"
);
quantity!(
    /// A temperature in degrees Celsius.
    Celsius, " °C"
);
quantity!(
    /// An electrical resistance in ohms.
    Ohms, " Ω"
);

/// A frequency in hertz, as boards state their clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(transparent)]
pub struct Hertz(pub u32);

impl Hertz {
    /// How many ticks of this clock a duration takes, to the nearest tick. Negative durations give zero.
    pub fn ticks_in(self, duration: Seconds) -> Ticks {
        // `as` saturates, so a negative or absurd duration cannot wrap.
        Ticks((duration.0 * f64::from(self.0) + 0.5) as u64)
    }

    /// How long a number of ticks of this clock is.
    pub fn duration_of(self, ticks: Ticks) -> Seconds {
        Seconds(ticks.0 as f64 / f64::from(self.0))
    }
}

/// The number by which host and board name one configured object (a stepper, a heater pin …).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct Oid(pub u8);

/// A signed number of motor steps (microsteps, as the driver counts them).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct StepCount(pub i64);
