//! How the motors of the simulated machine hold its head: belts that run past two axes, or three towers.
//!
//! Written from the geometry of the machines alone: whoever plans for them has formulas of its own, which this is to prove
//! wrong. Millimetres. A motor's position is how far its belt has run.

/// How motors and head hang together. Motors and axes beyond the first three are nobody's business here.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Gantry {
    /// Each motor has an axis of its own.
    #[default]
    Cartesian,
    /// Two belts across X and Y: their motors run together for X, against each other for Y.
    CoreXy,
    /// The same across X and Z, whose motors are the first and the third.
    CoreXz,
    /// Y has its own motor; the first motor's belt runs past Y, so it turns back what Y does.
    HybridCoreXy,
    /// Z has its own motor; the first motor's belt runs past Z.
    HybridCoreXz,
    /// Three carriages on towers.
    Delta(Towers),
}

/// The towers of a delta.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Towers {
    /// Where each stands, X and Y.
    pub feet: [[f64; 2]; 3],
    /// How long the arms of each are.
    pub arms: [f64; 3],
}

impl Gantry {
    /// Whether the head's axes are moved by several motors each, by belts.
    pub const fn is_coupled(&self) -> bool {
        !matches!(self, Self::Cartesian | Self::Delta(_))
    }

    /// Where the head is; not a number where these motors can hold none.
    pub fn head(&self, motors: [f64; 3]) -> [f64; 3] {
        let [a, b, c] = motors;
        match self {
            Self::Cartesian => motors,
            Self::CoreXy => [0.5 * a + 0.5 * b, 0.5 * a - 0.5 * b, c],
            Self::CoreXz => [0.5 * a + 0.5 * c, b, 0.5 * a - 0.5 * c],
            Self::HybridCoreXy => [a + b, b, c],
            Self::HybridCoreXz => [a + c, b, c],
            Self::Delta(towers) => towers.head(motors),
        }
    }

    /// Where the motors are when the head is there.
    pub fn motors(&self, head: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = head;
        match self {
            Self::Cartesian => head,
            Self::CoreXy => [x + y, x - y, z],
            Self::CoreXz => [x + z, y, x - z],
            Self::HybridCoreXy => [x - y, y, z],
            Self::HybridCoreXz => [x - z, y, z],
            Self::Delta(towers) => towers.carriages(head),
        }
    }

    /// How far the head goes at most where each of its motors makes a step, in the middle of the machine.
    pub fn head_step(&self, [a, b, c, _]: [f64; 4]) -> f64 {
        let middle = [0.0, 0.0, 10.0];
        let squares = [a, b, c].into_iter().enumerate().map(|(motor, step)| {
            let mut motors = self.motors(middle);
            motors[motor] += step;
            let head = self.head(motors);
            (0..3).map(|axis| (head[axis] - middle[axis]) * (head[axis] - middle[axis])).sum::<f64>()
        });
        // Axes of their own go at right angles.
        let is_square = matches!(self, Self::Cartesian);
        if is_square { squares.sum::<f64>().sqrt() } else { squares.map(f64::sqrt).sum() }
    }

    /// Whether all of it is numbers, and towers stand apart.
    pub(crate) fn is_sound(&self) -> bool {
        let Self::Delta(towers) = self else { return true };
        let [[ax, ay], [bx, by], [cx, cy]] = towers.feet;
        let area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
        let numbers = towers.feet.iter().flatten().chain(&towers.arms);
        numbers.clone().all(|number| number.is_finite()) && area.abs() > 1.0
    }
}

impl Towers {
    /// Each carriage is above the head by what its arm's length leaves.
    fn carriages(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        core::array::from_fn(|tower| {
            let [tx, ty] = self.feet[tower];
            let (dx, dy) = (x - tx, y - ty);
            z + (self.arms[tower] * self.arms[tower] - dx * dx - dy * dy).sqrt()
        })
    }

    /// The lower of the two points that are an arm's length from all three carriages. The difference of two of the
    /// spheres' equations is linear: X and Y follow from Z, which one sphere then determines.
    fn head(&self, carriages: [f64; 3]) -> [f64; 3] {
        let square = |tower: usize| {
            let [x, y] = self.feet[tower];
            x * x + y * y + carriages[tower] * carriages[tower] - self.arms[tower] * self.arms[tower]
        };
        let row = |tower: usize| {
            let ([x0, y0], [x, y]) = (self.feet[0], self.feet[tower]);
            let rise = carriages[tower] - carriages[0];
            (x - x0, y - y0, 0.5 * (square(tower) - square(0)), rise)
        };
        let ((a1, b1, c1, d1), (a2, b2, c2, d2)) = (row(1), row(2));
        let det = a1 * b2 - a2 * b1;
        // X = px + qx·Z, Y = py + qy·Z.
        let (px, qx) = ((c1 * b2 - c2 * b1) / det, (d2 * b1 - d1 * b2) / det);
        let (py, qy) = ((a1 * c2 - a2 * c1) / det, (a2 * d1 - a1 * d2) / det);
        let ([x0, y0], z0) = (self.feet[0], carriages[0]);
        let (ex, ey) = (px - x0, py - y0);
        let a = qx * qx + qy * qy + 1.0;
        let half_b = qx * ex + qy * ey - z0;
        let c = ex * ex + ey * ey + z0 * z0 - self.arms[0] * self.arms[0];
        let z = (-half_b - (half_b * half_b - a * c).sqrt()) / a;
        [px + qx * z, py + qy * z, z]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn delta() -> Gantry {
        let foot = |degrees: f64| {
            let angle = degrees.to_radians();
            [130.0 * libm::cos(angle), 130.0 * libm::sin(angle)]
        };
        Gantry::Delta(Towers { feet: [210.0, 331.0, 90.0].map(foot), arms: [260.0, 261.0, 259.5] })
    }

    #[test]
    fn heads_and_motors_agree() {
        let all = [
            Gantry::Cartesian,
            Gantry::CoreXy,
            Gantry::CoreXz,
            Gantry::HybridCoreXy,
            Gantry::HybridCoreXz,
            delta(),
        ];
        for gantry in all {
            assert!(gantry.is_sound());
            for place in 0..1000 {
                let at = |step: i32, span: f64| f64::from((place * step) % 997) / 997.0 * span;
                let head = [at(7, 180.0) - 90.0, at(31, 100.0) - 50.0, at(113, 300.0)];
                let back = gantry.head(gantry.motors(head));
                let off = (0..3).map(|axis| (back[axis] - head[axis]).abs()).fold(0.0, f64::max);
                assert!(off < 1e-9, "{gantry:?} {head:?} {back:?}");
            }
        }
    }

    #[test]
    fn belts_run_as_they_lie() {
        assert_eq!(Gantry::CoreXy.motors([1.0, 0.0, 0.0]), [1.0, 1.0, 0.0]);
        assert_eq!(Gantry::CoreXy.motors([0.0, 1.0, 0.0]), [1.0, -1.0, 0.0]);
        assert_eq!(Gantry::CoreXz.motors([0.0, 0.0, 1.0]), [1.0, 0.0, -1.0]);
        assert_eq!(Gantry::HybridCoreXy.motors([0.0, 1.0, 0.0]), [-1.0, 1.0, 0.0]);
        let [a, b, c] = delta().motors([0.0, 0.0, 10.0]);
        assert!(a > 10.0 && b > a && c < a);
        assert!(delta().head([0.0, 900.0, 0.0])[0].is_nan());
    }
}
