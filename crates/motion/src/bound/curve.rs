//! An arc as the bound sees it: from the derivatives of its path at many points, with none of the look-ahead's formulas.
//!
//! With the path P over a parameter, the direction is P′/|P′| and turns by (P″·|P′|² − P′·(P′·P″))/|P′|⁴ per length
//! (M. do Carmo, "Differential Geometry of Curves and Surfaces", 1.5).

use crate::Bend;

/// Stretches between the points.
const STRETCHES: u32 = 128;

/// What an arc asks for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Curve {
    pub(super) length: f64,
    /// The directions at its start and at its end.
    pub(super) headings: [[f64; 3]; 2],
    /// The most that x, y and z change per mm.
    pub(super) shares: [f64; 3],
    /// The most that those change per mm.
    pub(super) bends: [f64; 3],
    /// The most that the direction turns per mm.
    pub(super) curvature: f64,
}

type Vector = [f64; 3];

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Curve {
    pub(super) fn new(bend: &Bend) -> Self {
        let mut curve =
            Self { length: 0.0, headings: [[0.0; 3]; 2], shares: [0.0; 3], bends: [0.0; 3], curvature: 0.0 };
        for point in 0..=STRETCHES {
            let (first, second) = derivatives(bend, f64::from(point) / f64::from(STRETCHES));
            let square = dot(first, first);
            let speed = square.sqrt();
            let along = dot(first, second);
            let heading = first.map(|part| part / speed);
            let turning: Vector = core::array::from_fn(|axis| {
                (second[axis] * square - first[axis] * along) / (square * square)
            });
            for axis in 0..3 {
                curve.shares[axis] = curve.shares[axis].max(heading[axis].abs());
                curve.bends[axis] = curve.bends[axis].max(turning[axis].abs());
            }
            curve.curvature = curve.curvature.max(dot(turning, turning).sqrt());
            if point == 0 {
                curve.headings[0] = heading;
            }
            curve.headings[1] = heading;
            // The trapezium rule.
            let weight = if point == 0 || point == STRETCHES { 0.5 } else { 1.0 };
            curve.length += weight * speed / f64::from(STRETCHES);
        }
        curve
    }
}

/// First and second derivative of the path over its share.
fn derivatives(bend: &Bend, share: f64) -> (Vector, Vector) {
    let growth = bend.radii[1] - bend.radii[0];
    let radius = bend.radii[0] + growth * share;
    let (sin, cos) = libm::sincos(bend.start_angle + bend.turn * share);
    let turn = bend.turn;
    let first = [growth * cos - radius * turn * sin, growth * sin + radius * turn * cos, bend.rise];
    let second = [
        -2.0 * growth * turn * sin - radius * turn * turn * cos,
        2.0 * growth * turn * cos - radius * turn * turn * sin,
        0.0,
    ];
    let spread = |of: Vector| {
        let mut out = [0.0; 3];
        for (place, part) in of.into_iter().enumerate() {
            out[(usize::from(bend.normal) + 1 + place) % 3] = part;
        }
        out
    };
    (spread(first), spread(second))
}
