//! A piece of an arc as what the G-code asks for: how far a place is from it.
//!
//! From the file's arc alone, without anything of the planner's. mm and radians.

use gcode::ArcPiece;

type Place = [f64; 3];

/// Halvings in the search for a turning point: beyond it nothing changes in the last bit.
const HALVINGS: u32 = 60;
/// The nearest place is found by so many of Newton's steps from the chord's.
const NEWTON_STEPS: u32 = 3;

/// Part of an arc or a helix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ArcWay {
    axes: [usize; 3],
    centre: [f64; 2],
    start_angle: f64,
    turn: f64,
    radii: [f64; 2],
    /// Along the normal: at its start, and how far it goes.
    height: [f64; 2],
}

impl ArcWay {
    pub(crate) fn new(piece: &ArcPiece) -> Self {
        let axes = piece.arc.plane.axes();
        let [from, to] = [piece.chord.from, piece.chord.to].map(|place| place.to_array()[axes[2]]);
        Self {
            axes,
            centre: piece.arc.centre,
            start_angle: piece.start_angle,
            turn: piece.turn,
            radii: piece.radii,
            height: [from, to - from],
        }
    }

    /// The place after a share of it, and its change with the share.
    fn at(&self, share: f64) -> (Place, Place) {
        let growth = self.radii[1] - self.radii[0];
        let radius = self.radii[0] + growth * share;
        let (sin, cos) = libm::sincos(self.start_angle + self.turn * share);
        let spread = |parts: Place| {
            let mut out = [0.0; 3];
            self.axes.iter().zip(parts).for_each(|(&axis, part)| out[axis] = part);
            out
        };
        let place = [
            self.centre[0] + radius * cos,
            self.centre[1] + radius * sin,
            self.height[0] + self.height[1] * share,
        ];
        let around = radius * self.turn;
        let change = [growth * cos - around * sin, growth * sin + around * cos, self.height[1]];
        (spread(place), spread(change))
    }

    /// Where it turns back along a sum of axes, if it does: no piece does so twice.
    pub(crate) fn turning_point(&self, along: impl Fn(Place) -> f64) -> Option<f64> {
        let slope = |share: f64| along(self.at(share).1);
        let (mut low, mut high) = (0.0, 1.0);
        let rises = slope(low) > 0.0;
        if (slope(high) > 0.0) == rises {
            return None;
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            *(if (slope(middle) > 0.0) == rises { &mut low } else { &mut high }) = middle;
        }
        Some(along(self.at(low).0))
    }

    /// The square of the distance of `point`; `share` is where it is along the chord.
    pub(crate) fn distance_squared(&self, point: Place, mut share: f64) -> f64 {
        let dot = |a: Place, b: Place| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let minus = |a: Place, b: Place| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
        for _ in 0..NEWTON_STEPS {
            let (place, change) = self.at(share);
            let square = dot(change, change);
            if square > 0.0 {
                share = (share + dot(minus(point, place), change) / square).clamp(0.0, 1.0);
            }
        }
        let rest = minus(point, self.at(share).0);
        dot(rest, rest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_beside_an_arc_is_as_far_as_it_is_from_the_circle() {
        let way = ArcWay {
            axes: [0, 1, 2],
            centre: [10.0, 0.0],
            start_angle: 0.2,
            turn: -0.7,
            radii: [5.0; 2],
            height: [1.0, 0.0],
        };
        for (angle, radius, up) in
            [(0.0, 5.0, 0.0), (-0.3, 5.013, 0.02), (0.19, 4.98, 0.0), (-0.49, 5.0, 0.1)]
        {
            let (sin, cos) = libm::sincos(angle);
            let place = [10.0 + radius * cos, radius * sin, 1.0 + up];
            let share = ((0.2 - angle) / 0.7_f64 + 0.05).clamp(0.0, 1.0);
            let found = way.distance_squared(place, share).sqrt();
            assert!((found - libm::hypot(radius - 5.0, up)).abs() < 1e-9, "{angle} {found}");
        }
        // To the right of the centre it goes farthest out.
        assert!((way.turning_point(|[x, ..]| x).unwrap() - 15.0).abs() < 1e-12);
        assert_eq!((way.turning_point(|[_, y, _]| y), way.turning_point(|[.., z]| z)), (None, None));
        // Beyond its ends, the end counts.
        let beyond = way.distance_squared([10.0, 5.0, 1.0], 0.0).sqrt();
        let end = [10.0 + 5.0 * libm::cos(0.2), 5.0 * libm::sin(0.2)];
        assert!((beyond - libm::hypot(end[0] - 10.0, end[1] - 5.0)).abs() < 1e-9);
    }
}
