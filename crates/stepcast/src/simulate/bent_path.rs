//! A straight move of the file on a machine that makes it in pieces, because its axes are not square or its bed not flat.
//!
//! Each piece must end on the way that the file asks for, beyond the one before, with its share of the filament, and must
//! nowhere be farther from that way than a piece may be. Positions in mm.

use printer::transform::{Transform, Z_ERROR_MAX_MM};

use super::gcode_path::{Piece, SAME_PLACE_MM, place};

/// A piece is compared with the way at so many places.
const SAMPLES: u32 = 16;

/// What is left of a move.
#[derive(Clone, Copy, Debug)]
pub(super) struct BentMove {
    /// In the file's coordinates.
    piece: Piece,
    /// How much of it has been made, 0 ..= 1.
    share: f64,
}

impl BentMove {
    /// Of a move of the file that the machine begins here.
    pub(super) fn new(mut piece: Piece, transform: &Transform, from: [f64; 4]) -> Self {
        let [x, y, z, _] = from;
        if !is_near(lifted(transform, piece.from), from) {
            // A line has changed the way there: the head stood where it stood.
            piece.from[..3].copy_from_slice(&transform.gcode_from_machine([x, y, z]));
        }
        Self { piece, share: 0.0 }
    }

    /// Whether all of it has been made.
    pub(super) fn is_made(&self) -> bool {
        self.share >= 1.0
    }

    /// Takes the next piece, in the machine's coordinates.
    pub(super) fn take(
        &mut self,
        transform: &Transform,
        line: u32,
        from: [f64; 4],
        to: [f64; 4],
    ) -> anyhow::Result<Piece> {
        let share = self.share_at(transform, to);
        let end = self.at(transform, share);
        let filament = (self.piece.to[3] - self.piece.from[3]) * (share - self.share);
        let is_right = line == self.piece.line
            && share > self.share
            && is_near(end, to)
            && (to[3] - from[3] - filament).abs() <= SAME_PLACE_MM;
        if !is_right {
            anyhow::bail!(
                "line {} asks for a way that leads to {}, the printer makes a piece to {} for line {line}",
                self.piece.line,
                place(self.at(transform, 1.0)),
                place(to)
            );
        }
        let begin = self.at(transform, self.share);
        let mut off_mm: f64 = 0.0;
        for sample in 1..SAMPLES {
            let part = f64::from(sample) / f64::from(SAMPLES);
            let way = self.at(transform, self.share + (share - self.share) * part);
            let off = |axis: usize| (begin[axis] + (end[axis] - begin[axis]) * part - way[axis]).abs();
            off_mm = (0..3).map(off).fold(off_mm, f64::max);
        }
        if off_mm > Z_ERROR_MAX_MM {
            anyhow::bail!(
                "a piece of line {line}, to {}, is {off_mm:.5} mm off the bed's surface",
                place(to)
            );
        }
        self.share = share;
        Ok(Piece { line, from: begin, to: end, arc: None })
    }

    /// How much of the move has been made at a place of the machine.
    fn share_at(&self, transform: &Transform, machine: [f64; 4]) -> f64 {
        if is_near(lifted(transform, self.piece.to), machine) {
            return 1.0;
        }
        let [x, y, z, _] = machine;
        let at = transform.gcode_from_machine([x, y, z]);
        let (mut along, mut length) = (0.0, 0.0);
        for ((at, from), to) in at.into_iter().zip(self.piece.from).zip(self.piece.to) {
            let way = to - from;
            along += (at - from) * way;
            length += way * way;
        }
        if length > 0.0 { along / length } else { 1.0 }
    }

    /// Where the machine is when so much has been made.
    fn at(&self, transform: &Transform, share: f64) -> [f64; 4] {
        let Piece { from, to, .. } = self.piece;
        lifted(transform, core::array::from_fn(|axis| from[axis] + (to[axis] - from[axis]) * share))
    }
}

fn lifted(transform: &Transform, [x, y, z, e]: [f64; 4]) -> [f64; 4] {
    let [x, y, z] = transform.machine_from_gcode([x, y, z]);
    [x, y, z, e]
}

fn is_near(one: [f64; 4], other: [f64; 4]) -> bool {
    (0..3).all(|axis| (one[axis] - other[axis]).abs() <= SAME_PLACE_MM)
}
