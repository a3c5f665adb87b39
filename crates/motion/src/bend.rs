//! The way of a move that is a piece of an arc or of a helix: where it leads, how fast its direction changes.
//!
//! Along the piece the angle, the radius and the height grow evenly. The radius only does where a file's ends were rounded;
//! otherwise this is the circle itself, and its length is exact.
//!
//! Lengths in mm, angles in radians, curvatures in 1/mm. Coordinates are x, y, z.

use core::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use nalgebra::Vector3;

/// A piece turns by no more than this, either way.
pub const BEND_ANGLE_MAX: f64 = FRAC_PI_2;
/// Its ends are this near to those of its move.
const GAP_MAX_MM: f64 = 1e-6;
/// Larger numbers are none that a machine has a use for.
const LENGTH_MAX_MM: f64 = 1e9;
/// More eighths of a turn are not between its directions at its ends.
const EIGHTHS_MAX: usize = 8;

/// A piece of an arc, as the way of a move. See the module's head.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bend {
    /// The coordinate that the arc turns around: 0, 1 or 2. The two that follow it, around the end, are those that turn.
    pub normal: u8,
    /// The centre, in the two coordinates that turn.
    pub centre: [f64; 2],
    /// Angle at its start, seen from the centre, from the first towards the second coordinate.
    pub start_angle: f64,
    /// The angle that it turns by; positive from the first towards the second coordinate.
    pub turn: f64,
    /// Distance from the centre at its start and at its end.
    pub radii: [f64; 2],
    /// How far it goes along the normal.
    pub rise: f64,
    /// Whether the move before it is the piece of the same arc that comes before.
    pub continues: bool,
    /// Length of the whole arc.
    pub arc_length: f64,
}

impl Bend {
    /// The coordinates that turn, and the one along the normal.
    pub const fn axes(&self) -> [usize; 3] {
        let normal = self.normal as usize;
        [(normal + 1) % 3, (normal + 2) % 3, normal % 3]
    }

    /// How far it leads inward or outward.
    fn outward(&self) -> f64 {
        self.radii[1] - self.radii[0]
    }

    /// Length of its path.
    pub fn length(&self) -> f64 {
        let around = 0.5 * (self.radii[0] + self.radii[1]) * self.turn;
        (around * around + self.outward() * self.outward() + self.rise * self.rise).sqrt()
    }

    /// The greatest distance from its centre.
    pub const fn radius(&self) -> f64 {
        self.radii[0].max(self.radii[1])
    }

    /// Whether it leads from one place to another, and is no more than a piece.
    pub fn fits(&self, from: &[f64; 4], to: &[f64; 4]) -> bool {
        let numbers = [self.radii[0], self.radii[1], self.rise.abs(), self.arc_length];
        let [first, second, normal] = self.axes();
        let leads = |share: f64, place: &[f64; 4]| {
            let (sin, cos) = libm::sincos(self.start_angle + self.turn * share);
            let radius = self.radii[0] + self.outward() * share;
            (self.centre[0] + radius * cos - place[first]).abs() <= GAP_MAX_MM
                && (self.centre[1] + radius * sin - place[second]).abs() <= GAP_MAX_MM
        };
        // Written so that NaN does not fit.
        self.normal < 3
            && self.turn.abs() <= BEND_ANGLE_MAX
            && numbers.iter().all(|number| (0.0..=LENGTH_MAX_MM).contains(number))
            && leads(0.0, from)
            && leads(1.0, to)
            && (to[normal] - from[normal] - self.rise).abs() <= GAP_MAX_MM
    }

    /// Where it is after a share of its length, in one of the two coordinates that turn (0 or 1 of [`Self::axes`]).
    pub fn turning(&self, coordinate: usize, share: f64) -> f64 {
        let angle = self.start_angle + self.turn * share;
        let round = if coordinate == 0 { libm::cos(angle) } else { libm::sin(angle) };
        self.centre[coordinate] + (self.radii[0] + self.outward() * share) * round
    }

    /// Its direction there, as an angle in its plane, and the part of its length that lies in the plane.
    fn heading(&self, share: f64) -> (f64, f64) {
        let radius = self.radii[0] + self.outward() * share;
        let (around, outward) = (radius * self.turn, self.outward());
        let in_plane = (around * around + outward * outward).sqrt();
        let whole = (in_plane * in_plane + self.rise * self.rise).sqrt();
        let part = if whole > 0.0 { in_plane / whole } else { 0.0 };
        (self.start_angle + self.turn * share + libm::atan2(around, outward), part)
    }

    /// The change of a coordinate that turns (0 or 1) per mm of path, after a share of its length.
    pub fn slope(&self, coordinate: usize, share: f64) -> f64 {
        let (heading, part) = self.heading(share);
        part * if coordinate == 0 { libm::cos(heading) } else { libm::sin(heading) }
    }

    /// The direction at its start, or at its end: the change of x, y and z per mm of path.
    pub fn tangent(&self, at_end: bool) -> [f64; 3] {
        let (heading, part) = self.heading(if at_end { 1.0 } else { 0.0 });
        self.vector(heading, part)
    }

    fn vector(&self, heading: f64, part: f64) -> [f64; 3] {
        let (sin, cos) = libm::sincos(heading);
        let [first, second, normal] = self.axes();
        let mut out = [0.0; 3];
        out[first] = part * cos;
        out[second] = part * sin;
        // Where it leads nowhere in the plane, it is a line along the normal.
        out[normal] = (1.0 - part * part).max(0.0).sqrt().copysign(self.rise);
        if self.rise == 0.0 {
            out[normal] = 0.0;
        }
        out
    }

    /// Angles of its direction within the plane: its ends', and every eighth of a turn between.
    fn headings(&self) -> impl Iterator<Item = f64> {
        let (start, end) = (self.heading(0.0).0, self.heading(1.0).0);
        [start, end].into_iter().chain(eighths(start, end))
    }

    /// Directions among which are those in which a motor that follows one coordinate, or two alike, goes fastest.
    pub fn directions(&self) -> impl Iterator<Item = [f64; 3]> {
        let ((start, start_part), (end, end_part)) = (self.heading(0.0), self.heading(1.0));
        let between = eighths(start, end).map(move |heading| self.vector(heading, start_part.max(end_part)));
        [self.vector(start, start_part), self.vector(end, end_part)].into_iter().chain(between)
    }

    /// The most that x, y and z change per mm of path, without sign.
    pub(crate) fn shares(&self) -> Vector3<f64> {
        let zero = Vector3::zeros();
        self.directions().fold(zero, |most, one| most.sup(&Vector3::from(one).abs()))
    }

    /// How fast its direction turns at most.
    pub(crate) fn curvature(&self) -> f64 {
        let turn = self.turn.abs();
        if turn == 0.0 {
            return 0.0;
        }
        let radius = self.radii[0].min(self.radii[1]);
        let part = self.heading(0.0).1.max(self.heading(1.0).1);
        // Of a radius that grows by k a radian: (r² + 2k²)/(r² + k²)^1.5, which is 1/r of a circle.
        let growth = self.outward() / turn;
        let (r2, k2) = (radius * radius, growth * growth);
        let sum = r2 + k2;
        let flat = if k2 == 0.0 { 1.0 / radius } else { (r2 + 2.0 * k2) / (sum * sum.sqrt()) };
        flat * part * part
    }

    /// The same for each of x, y and z: the most that its share changes per mm of path.
    pub(crate) fn curvatures(&self) -> Vector3<f64> {
        let curvature = self.curvature();
        let [first, second, _] = self.axes();
        let mut out = Vector3::zeros();
        for heading in self.headings() {
            let (sin, cos) = libm::sincos(heading);
            out[first] = f64::max(out[first], curvature * sin.abs());
            out[second] = f64::max(out[second], curvature * cos.abs());
        }
        out
    }
}

/// The whole eighths of a turn between two angles.
fn eighths(start: f64, end: f64) -> impl Iterator<Item = f64> {
    let first = libm::ceil(start.min(end) / FRAC_PI_4);
    let all = (0..EIGHTHS_MAX).map(move |eighth| (first + eighth as f64) * FRAC_PI_4);
    all.take_while(move |&angle| angle <= start.max(end))
}
