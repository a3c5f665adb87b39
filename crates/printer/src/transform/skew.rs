//! Axes that are not square to each other, and what makes up for it.
//!
//! Y may lean in X, and Z in X and in Y: where the motors take Y up by 1 mm, the head also goes `xy` mm in X. The head is
//! to go where the G-code says, so that the motors are asked for the inverse of that. Lengths in mm, factors in mm/mm.
//!
//! Source of what is measured: Klipper's public documentation (docs/Skew_Correction.md): the diagonals AC and BD and the
//! side AD of a printed parallelogram with A towards the origin. Its angle follows from the parallelogram law and the law
//! of cosines.

use serde::{Deserialize, Serialize};

/// Factors beyond this are no printer's: an axis that leans by 14°.
pub const SKEW_MAX: f64 = 0.25;

/// How far each axis leans in another one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Skew {
    /// Y in X.
    pub xy: f64,
    /// Z in X.
    pub xz: f64,
    /// Z in Y.
    pub yz: f64,
}

impl Skew {
    /// The factor that the lengths AC, BD and AD tell of, in any unit; `None` where no parallelogram has them, or one that
    /// leans by more than [`SKEW_MAX`].
    pub fn measured([ac, bd, ad]: [f64; 3]) -> Option<f64> {
        let side_squared = (ac * ac + bd * bd - 2.0 * ad * ad) / 2.0;
        let side = libm::sqrt(side_squared);
        let cosine = (ac * ac - bd * bd) / (4.0 * side * ad);
        let factor = cosine / libm::sqrt(1.0 - cosine * cosine);
        // What is not a number is in no range.
        (ad > 0.0 && side > 0.0 && factor.abs() <= SKEW_MAX).then_some(factor)
    }

    /// Whether these are factors that axes can have.
    pub fn is_possible(&self) -> bool {
        // What is not a number is in no range.
        [self.xy, self.xz, self.yz].iter().all(|factor| factor.abs() <= SKEW_MAX)
    }

    /// Where the motors have to go for the head to get there.
    pub fn machine_from_gcode(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let y = y - self.yz * z;
        [x - self.xy * y - self.xz * z, y, z]
    }

    /// Where the head is when the motors are there.
    pub fn gcode_from_machine(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        [x + self.xy * y + self.xz * z, y + self.yz * z, z]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parallelogram_printed_by_a_skewed_machine_tells_its_factor() {
        for factor in [-0.2, -0.01, 0.0, 0.003, 0.2] {
            // A machine whose Y leans so, and does not stretch: AB along X, AD along Y.
            let (ab, ad) = (100.0, 90.0);
            let length = libm::sqrt(1.0 + factor * factor);
            let d = [ad * factor / length, ad / length];
            let ac = libm::hypot(ab + d[0], d[1]);
            let bd = libm::hypot(d[0] - ab, d[1]);
            let found = Skew::measured([ac, bd, ad]).expect("a parallelogram");
            assert!((found - factor).abs() < 1e-12, "{factor}: {found}");
        }
    }

    #[test]
    fn lengths_of_no_parallelogram_are_refused() {
        for lengths in [
            [0.0; 3],
            [1.0, 1.0, 0.0],
            [1.0, 1.0, 5.0],
            [10.0, 100.0, 50.0],
            [f64::NAN, 140.0, 100.0],
            [f64::INFINITY, 140.0, 100.0],
        ] {
            assert_eq!(Skew::measured(lengths), None, "{lengths:?}");
        }
    }

    #[test]
    fn the_head_of_a_skewed_machine_gets_where_it_is_wanted() {
        let skew = Skew { xy: 0.02, xz: -0.01, yz: 0.03 };
        let [x, y, z] = skew.machine_from_gcode([10.0, 20.0, 30.0]);
        // The machine itself: Y takes the head along in X, Z in X and Y.
        let head = [x + 0.02 * y - 0.01 * z, y + 0.03 * z, z];
        for (is, wanted) in head.into_iter().zip([10.0, 20.0, 30.0]) {
            assert!((is - wanted).abs() < 1e-12, "{head:?}");
        }
    }
}
