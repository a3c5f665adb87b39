//! The path of an axis over a move along an arc: position as a polynomial of time that follows the circle.
//!
//! Each phase of the move is cut into parts of equal time. In a part an axis that turns follows the cubic that has the true
//! path's positions and velocities at both ends (Hermite), so that path and velocity go on without a jump. It strays
//! from the true path by at most h⁴/384 · max|P⁗| (P. Davis, "Interpolation and Approximation", 3.5; for a part of the angle φ
//! at even speed that is r·φ⁴/384), where on a circle with ω, α and j, the first three derivatives of its angle,
//! |P⁗| ≤ r·(ω⁴ + 6·ω²·|α| + 3·α² + 4·ω·|j|). The number of parts follows from [`ERROR_MAX_MM`].
//!
//! The axis along the arc's normal and the filament follow the length of the path, as on a straight line.
//!
//! mm, seconds, radians.

use crate::Segment;
use motion::{Bend, Phase, PlannedMove};

/// How far an axis may be from the true arc: a thousandth of a fine step.
const ERROR_MAX_MM: f64 = 1e-6;
/// More parts of one phase are not needed for any piece of an arc.
const PARTS_MAX: f64 = 64.0;

/// Whether an axis turns with the move, as the first or the second of its arc's coordinates.
pub(crate) fn turning_axis(planned: &PlannedMove, axis: usize) -> Option<(&Bend, usize)> {
    let bend = planned.bend.as_deref()?;
    let coordinate = bend.axes()[..2].iter().position(|&turning| turning == axis)?;
    Some((bend, coordinate))
}

/// Appends the path of an axis that turns.
pub(crate) fn bent_segments(
    planned: &PlannedMove,
    (bend, coordinate): (&Bend, usize),
    [from, to]: [f64; 2],
    out: &mut impl FnMut(Segment),
) {
    let per_mm = 1.0 / planned.length;
    let mut start_time = planned.start_time;
    let mut start = from;
    let mut velocity: Option<f64> = None;
    for phase in planned.phases() {
        let parts = parts(&phase, bend, per_mm);
        let duration = phase.duration / parts;
        let is_last = phase.end_distance == planned.length;
        let mut part = 0.0;
        while part < parts {
            part += 1.0;
            let ends = part == parts;
            let time = if ends { phase.duration } else { duration * part };
            let distance = if ends { phase.end_distance } else { phase.distance_at(time) };
            let share = (distance * per_mm).clamp(0.0, 1.0);
            let end = if ends && is_last { to } else { bend.turning(coordinate, share) };
            let begins = velocity
                .unwrap_or_else(|| phase.velocity * bend.slope(coordinate, phase.start_distance * per_mm));
            let arrives = phase.velocity_at(time) * bend.slope(coordinate, share);
            out(hermite(start_time, duration, [start, end], [begins, arrives]));
            start_time += duration;
            start = end;
            velocity = Some(arrives);
        }
    }
}

/// How many parts a phase needs.
fn parts(phase: &Phase, bend: &Bend, per_mm: f64) -> f64 {
    let turn_per_mm = (bend.turn * per_mm).abs();
    let end_accel = phase.accel + phase.jerk * phase.duration;
    // The speed may be highest within, where the acceleration changes its sign; by no more than this.
    let within = if phase.accel * end_accel < 0.0 { 0.5 * phase.accel.abs() * phase.duration } else { 0.0 };
    let velocity = phase.velocity.max(phase.velocity_at(phase.duration)) + within;
    let omega = velocity * turn_per_mm;
    let alpha = phase.accel.abs().max(end_accel.abs()) * turn_per_mm;
    let jerk = phase.jerk.abs() * turn_per_mm;
    let omega2 = omega * omega;
    let fourth = omega2 * omega2 + 6.0 * omega2 * alpha + 3.0 * alpha * alpha + 4.0 * omega * jerk;
    let error = bend.radius() * fourth / (384.0 * ERROR_MAX_MM);
    // Two square roots are the same on every platform, which a fourth root need not be.
    let parts = (error.sqrt().sqrt() * phase.duration).ceil();
    // Written so that what is no number is one part.
    if parts > 1.0 { parts.min(PARTS_MAX) } else { 1.0 }
}

/// Shorter phases are the dust of rounding, in s: the way they make is, too, and says nothing of a speed.
const DUST_S: f64 = 1e-9;

/// The cubic between two positions with two velocities.
fn hermite(start_time: f64, duration: f64, [start, end]: [f64; 2], [begins, arrives]: [f64; 2]) -> Segment {
    if duration < DUST_S {
        let powers = [0.5 * (begins + arrives), 0.0, 0.0, 0.0, 0.0];
        return Segment { start_time, duration, start, end, powers };
    }
    let mean = (end - start) / duration;
    let bend = (3.0 * mean - 2.0 * begins - arrives) / duration;
    let twist = (begins + arrives - 2.0 * mean) / (duration * duration);
    Segment { start_time, duration, start, end, powers: [begins, bend, twist, 0.0, 0.0] }
}
