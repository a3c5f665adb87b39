//! Where the head may be: a box, or what a delta's arms and towers leave.
//!
//! Knows positions, no moves of filament and no speeds. Machine coordinates in mm.

use core::f64::consts::TAU;

use motion::Bend;
use steps::Delta;

use crate::config::{Kinematics, PrinterConfig};

/// Names of the axes in messages.
pub(crate) const AXES: [&str; 3] = ["X", "Y", "Z"];
/// How far beyond a limit still counts as on it, in mm: the dust of decimal arithmetic, far below a step.
const LIMIT_SLACK_MM: f64 = 1e-6;
/// An upright piece of an arc is looked at in so many places.
const UPRIGHT_PLACES: u32 = 32;
/// Halvings of a lift that does not fit: a millionth of it is left.
const HALVINGS: u32 = 20;

/// Where the head may be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    limits_mm: [(f64, f64); 3],
    towers: Option<Towers>,
}

/// A delta's towers.
#[derive(Clone, Copy, Debug)]
struct Towers {
    delta: Delta,
    /// How high each carriage may be.
    endstops_mm: [f64; 3],
    /// How far the head may be from the middle.
    radius_mm: f64,
}

impl Reach {
    /// Of a machine.
    pub(crate) fn new(config: &PrinterConfig) -> Self {
        let limits_mm = config.steppers.each_ref().map(|axis| (axis.position_min.0, axis.position_max.0));
        let towers = match &config.printer.kinematics {
            Kinematics::Delta(delta) => delta.delta().map(|geometry| Towers {
                delta: geometry,
                endstops_mm: delta.endstops().map(|at| at.0),
                radius_mm: delta.print_radius.0,
            }),
            _ => None,
        };
        Self { limits_mm, towers }
    }

    /// Whether an axis may go to a position, and why not.
    pub(crate) fn judge_axis(&self, axis: usize, to: f64) -> Result<(), String> {
        let (min, max) = self.limits_mm[axis];
        // Written so that NaN is refused too.
        if (min - LIMIT_SLACK_MM..=max + LIMIT_SLACK_MM).contains(&to) {
            return Ok(());
        }
        Err(format!("{} {to:.3} mm lies outside {min:.3} to {max:.3} mm", AXES[axis]))
    }

    /// Whether a straight way from a place within reach stays there, as far as that does not follow from its axes.
    pub(crate) fn judge_way(&self, from: [f64; 3], to: [f64; 3]) -> Result<(), String> {
        let Some(Towers { delta, endstops_mm, radius_mm }) = &self.towers else { return Ok(()) };
        let [x, y, z] = to;
        let away = libm::hypot(x, y);
        if away > radius_mm + LIMIT_SLACK_MM || away.is_nan() {
            return Err(format!(
                "X {x:.3} Y {y:.3} mm lies {away:.3} mm from the middle, which is more than {radius_mm:.3} mm"
            ));
        }
        for (tower, endstop) in endstops_mm.iter().enumerate() {
            let highest = delta.highest(tower, from, to);
            if highest > endstop + LIMIT_SLACK_MM || highest.is_nan() {
                let name = ["stepper_a", "stepper_b", "stepper_c"][tower];
                let over = highest - endstop;
                return Err(format!(
                    "on the way to X {x:.3} Y {y:.3} Z {z:.3} mm the carriage of {name} would go {over:.3} mm beyond its \
                     endstop: so high up only the middle can be reached"
                ));
            }
        }
        Ok(())
    }

    /// Whether a piece of an arc whose chord is within reach stays there too: it bulges out of a round bed, or towards a
    /// tower. What an axis has to say of it is judged elsewhere.
    pub(crate) fn judge_bend(&self, bend: &Bend, from: [f64; 3], to: [f64; 3]) -> Result<(), String> {
        let Some(towers) = &self.towers else { return Ok(()) };
        let [first, second, normal] = bend.axes();
        let place = |share: f64| {
            let mut at = [0.0; 3];
            (at[first], at[second]) = (bend.turning(0, share), bend.turning(1, share));
            at[normal] = from[normal] + (to[normal] - from[normal]) * share;
            at
        };
        if normal != 2 {
            // An upright one is nowhere farther from its places than the height of the bows between them.
            let half = 0.5 * bend.turn / f64::from(UPRIGHT_PLACES);
            let bow = bend.radius() * (1.0 - libm::cos(half));
            return (0..=UPRIGHT_PLACES).try_for_each(|part| {
                let [x, y, z] = place(f64::from(part) / f64::from(UPRIGHT_PLACES));
                self.judge_way([x, y, z + bow], [x, y, z + bow])
            });
        }
        let z = from[2].max(to[2]);
        let [x, y] = bend.centre;
        let outward = core::iter::once(libm::atan2(y, x));
        let to_towers = (0..3).map(|tower| {
            let [foot_x, foot_y] = towers.delta.foot(tower);
            libm::atan2(foot_y - y, foot_x - x)
        });
        outward.chain(to_towers).try_for_each(|angle| {
            // Counted on in the direction of the arc, from its start.
            let ahead = (angle - bend.start_angle) * bend.turn.signum();
            let share = (ahead - TAU * libm::floor(ahead / TAU)) / bend.turn.abs();
            if share >= 1.0 || share.is_nan() {
                return Ok(());
            }
            let [x, y, _] = place(share);
            self.judge_way([x, y, z], [x, y, z])
        })
    }

    /// How high the way across from one place to another can be: as high as wanted, or as high as it goes without coming
    /// below `floor`. None where even that is too high.
    pub(crate) fn across(&self, from: [f64; 2], to: [f64; 2], wanted: f64, floor: f64) -> Option<f64> {
        let fits = |z: f64| self.judge_way([from[0], from[1], z], [to[0], to[1], z]).is_ok();
        if fits(wanted) {
            return Some(wanted);
        }
        if !fits(floor) {
            return None;
        }
        let mut z = floor;
        let mut step = wanted - floor;
        for _ in 0..HALVINGS {
            step *= 0.5;
            if fits(z + step) {
                z += step;
            }
        }
        Some(z)
    }

    /// How high the head can be lifted from a place, by no more than this; never lower than it is.
    pub(crate) fn lifted(&self, at: [f64; 3], by: f64) -> f64 {
        let [x, y, z] = at;
        let wanted = (z + by).min(self.limits_mm[2].1).max(z);
        if self.judge_way(at, [x, y, wanted]).is_ok() {
            return wanted;
        }
        let mut fits = z;
        let mut step = wanted - z;
        for _ in 0..HALVINGS {
            step *= 0.5;
            if self.judge_way(at, [x, y, fits + step]).is_ok() {
                fits += step;
            }
        }
        fits
    }

    /// The nearest place that X and Y may go to.
    pub(crate) fn clamped(&self, place: [f64; 2]) -> [f64; 2] {
        let [x, y] = [0, 1].map(|axis: usize| {
            let (min, max) = self.limits_mm[axis];
            place[axis].clamp(min, max)
        });
        let radius = self.towers.map_or(f64::INFINITY, |towers| towers.radius_mm);
        let share = (radius / libm::hypot(x, y)).min(1.0);
        [x * share, y * share]
    }

    /// Four places far from each other and so far from the ends.
    pub(crate) fn corners(&self, from_ends: f64) -> [[f64; 2]; 4] {
        if let Some(towers) = &self.towers {
            let far = (towers.radius_mm - from_ends).max(0.0);
            return [[-far, 0.0], [far, 0.0], [0.0, -far], [0.0, far]];
        }
        let [x, y] = [0, 1].map(|axis: usize| {
            let (min, max) = self.limits_mm[axis];
            [min + from_ends, max - from_ends]
        });
        [0, 1, 2, 3].map(|at: usize| [x[at % 2], y[at / 2]])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl Reach {
        fn judge(&self, from: [f64; 3], to: [f64; 3]) -> Result<(), String> {
            (0..3).try_for_each(|axis| self.judge_axis(axis, to[axis]))?;
            self.judge_way(from, to)
        }
    }

    fn delta() -> Reach {
        Reach::new(&crate::config::parse(crate::config::SMALL_DELTA).0.expect("a delta"))
    }

    #[test]
    fn a_delta_reaches_less_the_higher_it_is() {
        let reach = delta();
        let home = [0.0, 0.0, 300.0];
        assert!(reach.judge(home, [0.0, 0.0, 300.1]).is_err());
        assert!(reach.judge(home, [100.0, 0.0, 290.0]).unwrap_err().contains("stepper_b"));
        assert!(reach.judge(home, [100.0, 0.0, 200.0]).is_ok());
        assert!(reach.judge([0.0; 3], [0.0, -111.0, 0.0]).is_err());
        assert!(reach.judge([0.0; 3], [77.8, 77.8, 0.0]).unwrap_err().contains("from the middle"));
        assert!(reach.judge([0.0; 3], [0.0, 0.0, -1.0]).unwrap_err().contains("Z -1.000"));
        assert!(reach.judge([0.0; 3], [f64::NAN, 0.0, 0.0]).is_err());
    }

    #[test]
    fn a_way_may_leave_what_its_ends_do_not() {
        let reach = delta();
        let (mut over, mut within) = (0, 0);
        for turn in 0..72 {
            let angle = f64::from(turn) * 5.0_f64.to_radians();
            // Across, at a height that both ends have.
            let [from, to] = [angle, angle + 1.5].map(|at| [108.0 * libm::cos(at), 108.0 * libm::sin(at)]);
            let z =
                [from, to].map(|[x, y]| reach.lifted([x, y, 0.0], 400.0)).into_iter().fold(400.0, f64::min);
            let fits = (0..=400).all(|part| {
                let at = |axis: usize| from[axis] + (to[axis] - from[axis]) * f64::from(part) / 400.0;
                let place = [at(0), at(1), z];
                reach.judge(place, place).is_ok()
            });
            let judged = reach.judge([from[0], from[1], z], [to[0], to[1], z]);
            assert!(judged.is_ok() == fits, "{from:?} {to:?} {z} {judged:?}");
            *(if fits { &mut within } else { &mut over }) += 1;
        }
        assert!(over > 10 && within > 10, "{over} {within}");
    }

    #[test]
    fn the_head_is_lifted_as_far_as_it_goes() {
        let reach = delta();
        assert_eq!(reach.lifted([0.0, 0.0, 299.0], 5.0), 300.0);
        assert_eq!(reach.lifted([50.0, 0.0, 10.0], 5.0), 15.0);
        let z = reach.lifted([100.0, 0.0, 200.0], 100.0);
        assert!(reach.judge([100.0, 0.0, 200.0], [100.0, 0.0, z]).is_ok());
        assert!(reach.judge([100.0, 0.0, 200.0], [100.0, 0.0, z + 0.01]).is_err());
    }

    #[test]
    fn the_way_across_is_as_high_as_it_goes() {
        let reach = delta();
        let [home, place] = [[0.0, 0.0], [80.0, 60.0]];
        assert_eq!(reach.across(home, place, 20.0, 10.0), Some(20.0));
        let z = reach.across(home, place, 300.0, 10.0).unwrap();
        assert!(z > 200.0 && reach.judge([0.0, 0.0, z], [80.0, 60.0, z]).is_ok());
        assert!(reach.judge([0.0, 0.0, z + 0.01], [80.0, 60.0, z + 0.01]).is_err());
        assert_eq!(reach.across(home, place, 300.0, 299.0), None);
    }

    #[test]
    fn places_are_brought_within_reach() {
        let reach = delta();
        assert_eq!(reach.clamped([30.0, 40.0]), [30.0, 40.0]);
        assert_eq!(reach.clamped([0.0, 500.0]), [0.0, 110.0]);
        let [x, y] = reach.clamped([500.0, 500.0]);
        assert!((libm::hypot(x, y) - 110.0).abs() < 1e-9);
        assert!(reach.corners(1.0).iter().all(|&[x, y]| libm::hypot(x, y) == 109.0));
        let small = Reach::new(&crate::config::parse(crate::config::SMALL_MACHINE).0.unwrap());
        assert_eq!(small.clamped([-5.0, 310.0]), [0.0, 300.0]);
        assert_eq!(small.corners(1.0), [[1.0, 1.0], [299.0, 1.0], [1.0, 299.0], [299.0, 299.0]]);
        assert_eq!(small.lifted([1.0, 2.0, 249.0], 5.0), 250.0);
    }
}
