//! Arcs and helices (`G2`, `G3`): exact geometry, and its chords within a tolerance.
//!
//! Source: NIST RS274/NGC, section 3.5.3. Seen from the positive end of the plane's normal, `G2` turns clockwise: the
//! planes are X-Y, Z-X and Y-Z, in this order of axes.

use core::f64::consts::{PI, TAU};

use units::{Mm, MmPerS};

use crate::{LineNumber, Move, Position};

/// How far a chord may lie from its arc, unless the caller says otherwise: well below what a nozzle can show.
pub const CHORD_TOLERANCE: Mm = Mm(0.005);
/// The finest tolerance that is heeded; it bounds the number of chords.
pub const CHORD_TOLERANCE_MIN: Mm = Mm(0.0001);
/// The most full turns in one line (`P`).
pub(crate) const TURNS_MAX: f64 = 100.0;
/// The largest radius: beyond it, `f64` and a machine both stop making sense.
const RADIUS_MAX_MM: f64 = 1e6;
/// Ends that differ in radius by more than this are worth a word …
const RADIUS_SLACK_MM: f64 = 0.05;
/// … or by more than this part of the radius …
const RADIUS_SLACK_RATIO: f64 = 0.005;
/// … and by ten times either, are no arc.
const RADIUS_ERROR_FACTOR: f64 = 10.0;
/// Ends nearer to each other than this are one point: the dust of adding up relative moves, far below a step.
const SAME_POINT_MM: f64 = 1e-9;
/// A chord turns by at most this much, however loose the tolerance.
const CHORD_ANGLE_MAX: f64 = PI / 4.0;

/// The plane an arc lies in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Plane {
    /// `G17`.
    #[default]
    Xy,
    /// `G18`.
    Zx,
    /// `G19`.
    Yz,
}

impl Plane {
    /// Indices (x 0, y 1, z 2) of the plane's first and second axis and of its normal: a right-handed system.
    pub const fn axes(self) -> [usize; 3] {
        match self {
            Self::Xy => [0, 1, 2],
            Self::Zx => [2, 0, 1],
            Self::Yz => [1, 2, 0],
        }
    }
}

/// An arc, or a helix where the ends differ along the plane's normal. Where slicers rounded, the radius goes evenly from
/// that at the start to that at the end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arc {
    /// The line it comes from.
    pub line: LineNumber,
    /// Where it begins.
    pub from: Position,
    /// Where it ends.
    pub to: Position,
    /// The plane it turns in.
    pub plane: Plane,
    /// The centre, mm, along the plane's first and second axis.
    pub centre: [f64; 2],
    /// The angle turned by, radians; positive turns the first axis towards the second (counter-clockwise, `G3`).
    pub angle: f64,
    /// Speed along the path, with the speed factor.
    pub feed: MmPerS,
}

/// Why there is no such arc.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ArcError {
    /// The centre lies on the start: no radius.
    NoRadius,
    /// The ends lie at these two distances from the centre.
    RadiiDiffer(f64, f64),
    /// Start and end are the same point, so that a radius fits any number of circles.
    FullCircleByRadius,
    /// The ends are farther apart than twice the radius.
    RadiusTooSmall,
    /// The radius is absurd.
    RadiusTooLarge,
}

/// Where an arc's centre comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Centre {
    /// `I`, `J`, `K`: from the start to the centre, in the plane.
    Offset([f64; 2]),
    /// `R`: negative takes the longer way.
    Radius(f64),
}

/// What `Arc::new` needs beside the ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Turn {
    pub(crate) plane: Plane,
    pub(crate) clockwise: bool,
    pub(crate) centre: Centre,
    /// Whole turns before the arc proper.
    pub(crate) extra_turns: f64,
}

impl Arc {
    /// The arc between two positions, and whether its ends agree well on the radius.
    pub(crate) fn new(
        line: LineNumber,
        from: Position,
        to: Position,
        feed: MmPerS,
        turn: Turn,
    ) -> Result<(Self, bool), ArcError> {
        let [first, second, _] = turn.plane.axes();
        let (a, b) = (from.to_array(), to.to_array());
        let start = [a[first], a[second]];
        let end = [b[first], b[second]];
        let centre = match turn.centre {
            Centre::Offset(offset) => [start[0] + offset[0], start[1] + offset[1]],
            Centre::Radius(radius) => centre_from_radius(start, end, radius, turn.clockwise)?,
        };
        let r0 = distance(start, centre);
        let r1 = distance(end, centre);
        if r0 < 1e-9 {
            return Err(ArcError::NoRadius);
        }
        if r0 > RADIUS_MAX_MM {
            return Err(ArcError::RadiusTooLarge);
        }
        let slack = RADIUS_SLACK_MM.max(r0 * RADIUS_SLACK_RATIO);
        let gap = (r1 - r0).abs();
        if gap > slack * RADIUS_ERROR_FACTOR || r1 < 1e-9 {
            return Err(ArcError::RadiiDiffer(r0, r1));
        }
        let mut angle = angle_of(end, centre) - angle_of(start, centre);
        if distance(start, end) < SAME_POINT_MM {
            angle = 0.0;
        }
        // Into (0, 2π] in the direction of turning: the same point means a full circle.
        if turn.clockwise {
            angle = if angle >= 0.0 { angle - TAU } else { angle };
            angle -= TAU * turn.extra_turns;
        } else {
            angle = if angle <= 0.0 { angle + TAU } else { angle };
            angle += TAU * turn.extra_turns;
        }
        Ok((Self { line, from, to, plane: turn.plane, centre, angle, feed }, gap <= slack))
    }

    /// Radius at the start and at the end, mm.
    pub fn radii(&self) -> [f64; 2] {
        let [first, second, _] = self.plane.axes();
        let (a, b) = (self.from.to_array(), self.to.to_array());
        [distance([a[first], a[second]], self.centre), distance([b[first], b[second]], self.centre)]
    }

    /// Length of the path, mm.
    pub fn length(&self) -> Mm {
        let [_, _, normal] = self.plane.axes();
        let rise = self.to.to_array()[normal] - self.from.to_array()[normal];
        let [r0, r1] = self.radii();
        let around = self.angle.abs() * (r0 + r1) / 2.0;
        let inward = r1 - r0;
        Mm((around * around + rise * rise + inward * inward).sqrt())
    }

    /// The lowest and highest X, Y, Z that it goes through, mm.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        const QUARTER: f64 = PI / 2.0;
        let [first, second, _] = self.plane.axes();
        let (from, to) = (self.from.to_array(), self.to.to_array());
        let mut low: [f64; 3] = core::array::from_fn(|axis| from[axis].min(to[axis]));
        let mut high: [f64; 3] = core::array::from_fn(|axis| from[axis].max(to[axis]));
        let start = angle_of([from[first], from[second]], self.centre);
        let end = start + self.angle;
        let [r0, r1] = self.radii();
        let radius = r0.max(r1);
        // It is farthest out where it meets an axis, of which there are four; the fifth is the first again.
        let quarter = libm::ceil(start.min(end) / QUARTER);
        for turn in [0.0, 1.0, 2.0, 3.0] {
            if (quarter + turn) * QUARTER <= start.max(end) {
                let (sin, cos) = libm::sincos((quarter + turn) * QUARTER);
                for (axis, at) in
                    [(first, self.centre[0] + radius * cos), (second, self.centre[1] + radius * sin)]
                {
                    low[axis] = low[axis].min(at);
                    high[axis] = high[axis].max(at);
                }
            }
        }
        [low, high]
    }

    /// The places between its ends where it turns back along an axis: its own ends and these are all that has to be
    /// within reach. At most four a turn.
    pub fn extremes(&self) -> impl Iterator<Item = Position> {
        const QUARTER: f64 = PI / 2.0;
        let chords = self.whole();
        let end = chords.start_angle + self.angle;
        let (low, high) = (chords.start_angle.min(end), chords.start_angle.max(end));
        let first = libm::ceil(low / QUARTER);
        let count = (4.0 * (TURNS_MAX + 1.0)) as u32;
        let quarters = (0..count).map(move |quarter| (first + f64::from(quarter)) * QUARTER);
        quarters
            .take_while(move |&turned| turned <= high)
            .map(move |turned| chords.point((turned - chords.start_angle) / chords.arc.angle))
    }

    /// The arc as a single piece.
    fn whole(&self) -> Chords {
        let [first, second, _] = self.plane.axes();
        let start = self.from.to_array();
        let start_angle = angle_of([start[first], start[second]], self.centre);
        Chords { arc: *self, radii: self.radii(), start_angle, count: 1, done: 0, at: self.from }
    }

    /// Straight moves that stay within `tolerance` of the arc and end exactly where it does.
    pub fn chords(&self, tolerance: Mm) -> Chords {
        let [r0, r1] = self.radii();
        let radius = r0.max(r1);
        let tolerance =
            if tolerance.0 >= CHORD_TOLERANCE_MIN.0 { tolerance.0 } else { CHORD_TOLERANCE_MIN.0 };
        // A chord's middle is r(1 − cos(θ/2)) from the arc. sin² keeps its digits where θ is small.
        let step =
            if tolerance >= radius { PI } else { 4.0 * libm::asin((tolerance / (2.0 * radius)).sqrt()) };
        let count = (self.angle.abs() / step.min(CHORD_ANGLE_MAX)).ceil().max(1.0);
        Chords { count: count as u64, ..self.whole() }
    }
}

/// A piece of an arc: between two angles, with the straight move from its start to its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArcPiece {
    /// From its start to its end.
    pub chord: Move,
    /// The whole arc.
    pub arc: Arc,
    /// The angle at its start, seen from the centre, from the plane's first axis towards its second.
    pub start_angle: f64,
    /// The angle that it turns by.
    pub turn: f64,
    /// Distance from the centre at its start and at its end, mm.
    pub radii: [f64; 2],
    /// Whether the arc starts with it.
    pub is_first: bool,
}

/// The chords of an arc, one after another; nothing is stored.
#[derive(Clone, Debug)]
pub struct Chords {
    arc: Arc,
    radii: [f64; 2],
    start_angle: f64,
    count: u64,
    done: u64,
    at: Position,
}

impl Chords {
    /// The next chord with the piece of the arc that it stands for.
    pub fn next_piece(&mut self) -> Option<ArcPiece> {
        if self.done == self.count {
            return None;
        }
        let is_first = self.done == 0;
        let [low, high] = [self.done, self.done + 1].map(|done| done as f64 / self.count as f64);
        self.done += 1;
        let to = if self.done == self.count { self.arc.to } else { self.point(high) };
        let from = core::mem::replace(&mut self.at, to);
        let radius = |part: f64| self.radii[0] + (self.radii[1] - self.radii[0]) * part;
        Some(ArcPiece {
            chord: Move { line: self.arc.line, from, to, feed: self.arc.feed, rapid: false },
            arc: self.arc,
            start_angle: self.start_angle + self.arc.angle * low,
            turn: self.arc.angle * (high - low),
            radii: [radius(low), radius(high)],
            is_first,
        })
    }

    fn point(&self, part: f64) -> Position {
        let Arc { from, to, plane, centre, angle, .. } = &self.arc;
        let [first, second, normal] = plane.axes();
        let (a, b) = (from.to_array(), to.to_array());
        let turned = self.start_angle + angle * part;
        let radius = self.radii[0] + (self.radii[1] - self.radii[0]) * part;
        let mut p = [0.0; 3];
        p[first] = centre[0] + radius * libm::cos(turned);
        p[second] = centre[1] + radius * libm::sin(turned);
        p[normal] = a[normal] + (b[normal] - a[normal]) * part;
        Position { x: p[0], y: p[1], z: p[2], e: from.e + (to.e - from.e) * part }
    }
}

impl Iterator for Chords {
    type Item = Move;

    fn next(&mut self) -> Option<Move> {
        self.next_piece().map(|piece| piece.chord)
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let left = usize::try_from(self.count - self.done).unwrap_or(usize::MAX);
        (left, Some(left))
    }
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    libm::hypot(a[0] - b[0], a[1] - b[1])
}

fn angle_of(point: [f64; 2], centre: [f64; 2]) -> f64 {
    libm::atan2(point[1] - centre[1], point[0] - centre[0])
}

/// The centre lies on the perpendicular through the middle of the chord; which side follows from the direction of turning
/// and from the sign of the radius.
fn centre_from_radius(
    start: [f64; 2],
    end: [f64; 2],
    radius: f64,
    clockwise: bool,
) -> Result<[f64; 2], ArcError> {
    let half = [(end[0] - start[0]) / 2.0, (end[1] - start[1]) / 2.0];
    let half_chord = libm::hypot(half[0], half[1]);
    if half_chord < SAME_POINT_MM {
        return Err(ArcError::FullCircleByRadius);
    }
    if radius.abs() > RADIUS_MAX_MM {
        return Err(ArcError::RadiusTooLarge);
    }
    // A half circle whose ends were rounded may need a hair more than the radius given.
    let slack = RADIUS_SLACK_MM.max(radius.abs() * RADIUS_SLACK_RATIO);
    if half_chord > radius.abs() + slack {
        return Err(ArcError::RadiusTooSmall);
    }
    let height = (radius * radius - half_chord * half_chord).max(0.0).sqrt();
    let side = if clockwise == (radius < 0.0) { 1.0 } else { -1.0 };
    let scale = side * height / half_chord;
    Ok([start[0] + half[0] - scale * half[1], start[1] + half[1] + scale * half[0]])
}

#[cfg(test)]
mod tests;
