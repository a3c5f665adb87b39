//! Linear deltas: three carriages on upright towers hold the head by arms of fixed length.
//!
//! A carriage stands at z + √(arm² − (x − tx)² − (y − ty)²) over its tower's foot (tx, ty). Along a path that is no
//! polynomial of time, so it is followed by pieces of degree 5 that meet position, speed and acceleration at their ends,
//! within [`ERROR_MAX`]. The head is found from the carriages as the lower of the two points that are an arm's length from
//! all three (trilateration).
//!
//! Source: C. C. Clavel's delta robot in its linear form; Hermite interpolation as in any textbook of numerics.

use nalgebra::{Vector2, Vector3};
use units::Mm;

use super::{AXES, Kinematics};
use crate::Segment;

/// A carriage is never farther from where it should be than this, mm: a thousandth of a usual microstep.
const ERROR_MAX: f64 = 1e-5;
/// Where the error is looked at within a piece, as shares of its time: the polynomial's own is largest in the middle.
const LOOKED_AT: [f64; 3] = [0.25, 0.5, 0.75];
/// A stretch is halved so often at most: even one that goes across the whole machine needs 4 or 5.
const HALVINGS_MAX: u32 = 10;
/// The carriage may go so much faster than the head: farther out arms lie so flat that little is left of their hold.
pub const STRETCH_RATIO_MAX: f64 = 3.0;
/// The filament's motor.
const EXTRUDER: usize = 3;

/// One tower.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tower {
    /// In which direction it stands, from the middle, in degrees from X towards Y.
    pub angle: f64,
    /// How long its arms are.
    pub arm_length: Mm,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Foot {
    at: Vector2<f64>,
    arm_squared: f64,
    arm: f64,
}

/// A linear delta.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Delta {
    feet: [Foot; 3],
    radius: f64,
}

/// Position, speed and acceleration.
#[derive(Clone, Copy, Debug)]
struct Course {
    at: f64,
    velocity: f64,
    accel: f64,
}

impl Delta {
    /// Towers on a circle; none where arms are no longer than that circle's radius, or nothing is a length.
    pub fn new(radius: Mm, towers: [Tower; 3]) -> Option<Self> {
        let radius = radius.0;
        let feet = towers.map(|tower| {
            let angle = tower.angle.to_radians();
            let arm = tower.arm_length.0;
            let at = Vector2::new(libm::cos(angle), libm::sin(angle)) * radius;
            Foot { at, arm_squared: arm * arm, arm }
        });
        let is_sound = radius > 0.0 && feet.iter().all(|foot| foot.arm.is_finite() && foot.arm > radius);
        // Towers in one line hold nothing.
        let [a, b, c] = feet.map(|foot| foot.at);
        let area = (b - a).perp(&(c - a)).abs();
        (is_sound && area > 1e-3 * radius * radius).then_some(Self { feet, radius })
    }

    /// Where a tower stands, X and Y.
    pub fn foot(&self, tower: usize) -> [f64; 2] {
        self.feet[tower].at.into()
    }

    /// How far from the middle the head may be so that no arm lies flatter than [`STRETCH_RATIO_MAX`] allows.
    pub fn reach(&self) -> f64 {
        let flattest = STRETCH_RATIO_MAX / libm::sqrt(1.0 + STRETCH_RATIO_MAX * STRETCH_RATIO_MAX);
        self.feet.iter().map(|foot| foot.arm * flattest - self.radius).fold(f64::INFINITY, f64::min)
    }

    /// How much faster than the head a carriage goes at most where the head moves within the plane, at a place.
    pub fn stretch_ratio(&self, tower: usize, x: f64, y: f64) -> f64 {
        let foot = &self.feet[tower];
        let away = (Vector2::new(x, y) - foot.at).norm_squared();
        libm::sqrt(away / (foot.arm_squared - away).max(f64::MIN_POSITIVE))
    }

    /// How far a tower's carriage is above the head; not a number where the arm does not reach.
    fn above(&self, tower: usize, x: f64, y: f64) -> f64 {
        let foot = &self.feet[tower];
        libm::sqrt(foot.arm_squared - (Vector2::new(x, y) - foot.at).norm_squared())
    }

    /// The highest that a tower's carriage gets on a straight way of the head.
    pub fn highest(&self, tower: usize, from: [f64; 3], to: [f64; 3]) -> f64 {
        let [x, y, z] = from;
        let way = Vector2::new(to[0] - x, to[1] - y);
        let rise = to[2] - z;
        let length = way.norm();
        let at = |share: f64| z + rise * share + self.above(tower, x + way.x * share, y + way.y * share);
        let ends = at(0.0).max(at(1.0));
        if length == 0.0 {
            return ends;
        }
        // Seen along the way the carriage is on a circle, of which the slope of the way touches the top.
        let foot = &self.feet[tower];
        let along = way / length;
        let middle = (foot.at - Vector2::new(x, y)).dot(&along);
        let beside = (foot.at - Vector2::new(x, y)).perp(&along);
        let circle = libm::sqrt((foot.arm_squared - beside * beside).max(0.0));
        let slope = rise / length;
        let top = (middle + circle * slope / libm::sqrt(1.0 + slope * slope)) / length;
        if top > 0.0 && top < 1.0 { ends.max(at(top)) } else { ends }
    }

    /// Where the head is when the carriages are there; none where no arms could hold it.
    pub fn position(&self, motors: &[f64; AXES]) -> Option<[f64; AXES]> {
        let carriage = |tower: usize| self.feet[tower].at.push(motors[tower]);
        let [a, b, c] = core::array::from_fn(carriage);
        let [arm_a, arm_b, arm_c] = self.feet.map(|foot| foot.arm_squared);
        let (to_b, to_c) = (b - a, c - a);
        let distance = to_b.norm();
        let along = to_b / distance;
        let across = to_c - along * along.dot(&to_c);
        let beside = across.norm();
        let across = across / beside;
        let u = (arm_a - arm_b + distance * distance) / (2.0 * distance);
        let v = (arm_a - arm_c + to_c.norm_squared() - 2.0 * u * along.dot(&to_c)) / (2.0 * beside);
        let below = libm::sqrt(arm_a - u * u - v * v);
        let up = along.cross(&across);
        let down: Vector3<f64> = if up.z > 0.0 { -up } else { up };
        let head = a + along * u + across * v + down * below;
        let position = [head.x, head.y, head.z, motors[EXTRUDER]];
        position.iter().all(|at| at.is_finite()).then_some(position)
    }

    /// A carriage at a time of a stretch, s from its start. Beyond the arms' reach it is as at its edge.
    fn course(&self, tower: usize, stretch: &[Segment; AXES], t: f64) -> Course {
        let foot = &self.feet[tower];
        let [x, y, z] = [0, 1, 2].map(|axis: usize| of_axis(&stretch[axis], t));
        let away = Vector2::new(x.at, y.at) - foot.at;
        let speed = Vector2::new(x.velocity, y.velocity);
        let accel = Vector2::new(x.accel, y.accel);
        let above = libm::sqrt((foot.arm_squared - away.norm_squared()).max(1e-6 * foot.arm_squared));
        let velocity = -away.dot(&speed) / above;
        let accel = -(speed.norm_squared() + away.dot(&accel) + velocity * velocity) / above;
        Course { at: z.at + above, velocity: z.velocity + velocity, accel: z.accel + accel }
    }

    /// The pieces of a stretch from one time to another.
    fn follow(
        &self,
        tower: usize,
        stretch: &[Segment; AXES],
        [from, to]: [(f64, Course); 2],
        halvings: u32,
        out: &mut Vec<Segment>,
    ) {
        let piece = hermite(stretch[0].start_time, from, to);
        let mut middle = from.1;
        let mut is_near = true;
        for share in LOOKED_AT {
            let t = share * piece.duration;
            let true_course = self.course(tower, stretch, from.0 + t);
            is_near &= (piece.start + piece.way(t) - true_course.at).abs() <= 0.5 * ERROR_MAX;
            if share == 0.5 {
                middle = true_course;
            }
        }
        if is_near || halvings == 0 {
            out.push(piece);
            return;
        }
        let middle = (from.0 + 0.5 * piece.duration, middle);
        self.follow(tower, stretch, [from, middle], halvings - 1, out);
        self.follow(tower, stretch, [middle, to], halvings - 1, out);
    }
}

/// An axis at a time of its segment.
fn of_axis(segment: &Segment, t: f64) -> Course {
    if t >= segment.duration {
        return Course { at: segment.end, ..course_of(segment, segment.duration) };
    }
    course_of(segment, t)
}

fn course_of(segment: &Segment, t: f64) -> Course {
    let [c1, c2, c3, c4, c5] = segment.powers;
    Course {
        at: segment.start + segment.way(t),
        velocity: c1 + (2.0 * c2 + (3.0 * c3 + (4.0 * c4 + 5.0 * c5 * t) * t) * t) * t,
        accel: 2.0 * c2 + (6.0 * c3 + (12.0 * c4 + 20.0 * c5 * t) * t) * t,
    }
}

/// The polynomial of degree 5 from one course to another.
fn hermite(start_time: f64, (from_t, from): (f64, Course), (to_t, to): (f64, Course)) -> Segment {
    let h = to_t - from_t;
    let way = to.at - from.at - (from.velocity + 0.5 * from.accel * h) * h;
    let speed = (to.velocity - from.velocity - from.accel * h) * h;
    let accel = 0.5 * (to.accel - from.accel) * h * h;
    let h3 = h * h * h;
    Segment {
        start_time: start_time + from_t,
        duration: h,
        start: from.at,
        end: to.at,
        powers: [
            from.velocity,
            0.5 * from.accel,
            (10.0 * way - 4.0 * speed + accel) / h3,
            (-15.0 * way + 7.0 * speed - 2.0 * accel) / (h3 * h),
            (6.0 * way - 3.0 * speed + accel) / (h3 * h * h),
        ],
    }
}

impl Kinematics for Delta {
    fn motors(&self) -> usize {
        AXES
    }

    fn axes(&self, motor: usize) -> [bool; AXES] {
        if motor == EXTRUDER { [false, false, false, true] } else { [true, true, true, false] }
    }

    fn motor_position(&self, motor: usize, position: &[f64; AXES]) -> f64 {
        match motor {
            EXTRUDER => position[EXTRUDER],
            tower => position[2] + self.above(tower, position[0], position[1]),
        }
    }

    fn motor_segments(&self, motor: usize, stretch: &[Segment; AXES], out: &mut Vec<Segment>) {
        let [x, y, z, e] = stretch;
        if motor == EXTRUDER {
            out.push(*e);
        } else if x.is_rest() && y.is_rest() {
            let above = self.above(motor, x.start, y.start);
            if !z.is_rest() {
                out.push(Segment { start: z.start + above, end: z.end + above, ..*z });
            }
        } else {
            let ends = [0.0, x.duration].map(|t| (t, self.course(motor, stretch, t)));
            self.follow(motor, stretch, ends, HALVINGS_MAX, out);
        }
    }
}
