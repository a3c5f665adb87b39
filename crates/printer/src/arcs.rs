//! Arcs between the file and the look-ahead: the pieces of a file's arc as ways of moves.
//!
//! mm and radians, in machine coordinates.

use gcode::ArcPiece;
use motion::Bend;

use crate::planner::Position;

/// A piece of an arc as the way of a move.
pub(crate) fn bend(piece: &ArcPiece) -> Bend {
    let ArcPiece { chord, arc, start_angle, turn, radii, is_first } = piece;
    let [_, _, normal] = arc.plane.axes();
    Bend {
        normal: normal as u8,
        centre: arc.centre,
        start_angle: *start_angle,
        turn: *turn,
        radii: *radii,
        rise: chord.to.to_array()[normal] - chord.from.to_array()[normal],
        continues: !is_first,
        arc_length: arc.length().0,
    }
}

/// Where straight moves of the same length would end that ask of the motors what this one does: one, but for an arc.
pub(crate) fn straight_ends(
    from: Position,
    to: Position,
    bend: Option<&Bend>,
) -> impl Iterator<Item = Position> {
    let length = bend.map_or(0.0, Bend::length);
    let bent = bend
        .map(Bend::directions)
        .into_iter()
        .flatten()
        .map(move |[x, y, z]| [from[0] + x * length, from[1] + y * length, from[2] + z * length, to[3]]);
    bend.is_none().then_some(to).into_iter().chain(bent)
}
