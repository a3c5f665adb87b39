//! Moves whose places are not those of the motors: axes that are not square, a bed that is not flat.
//!
//! A line that changes what is in force moves nothing: the head stands where it stands, and the next move leads from there to
//! where that line's coordinates are now. A move of the filament alone leaves the head where it is.

use gcode::{Action, Arc, CHORD_TOLERANCE, LineNumber, Move};

use super::{Planner, Position, Said, Source, source::Piece};
use crate::{
    error::{ErrorCode, PrinterError},
    machine::EXTRUDER,
    transform::{Pieces, Transform, TransformRecord},
};

/// A motor that would be moved by less than this, in mm, stays: it is the dust of the way to the G-code's coordinates and
/// back.
const DUST_MM: f64 = 1e-9;

impl Planner {
    /// Where the last accepted move ends, in the G-code's coordinates.
    pub fn gcode_position(&self) -> Position {
        self.gcode_from_machine(self.position)
    }

    /// Where the G-code has what is there for the motors, by the skew and the bed that are in force.
    pub fn gcode_from_machine(&self, [x, y, z, e]: Position) -> Position {
        let [x, y, z] = self.transform.gcode_from_machine([x, y, z]);
        [x, y, z, e]
    }

    /// Makes a source continue from where the machine is: before its first line, and whenever another source moved. Its
    /// offsets are forgotten.
    pub fn adopt(&mut self, source: &mut Source) {
        let [x, y, z, e] = self.gcode_position();
        source.interpreter.set_axes(Some(x), Some(y), Some(z));
        source.e_offset = e - source.interpreter.position().e;
        self.said = Said::default();
    }

    /// Tells a source whose move was refused, or stopped, that the machine stands here. Its offsets hold.
    pub fn correct(&mut self, source: &mut Source) {
        let [x, y, z, e] = self.gcode_position();
        source.interpreter.stand_at(x, y, z);
        source.e_offset = e - source.interpreter.position().e;
    }

    /// What makes up for skew and bed in the moves that are read from now on.
    pub const fn transform(&self) -> &Transform {
        &self.transform
    }

    /// Takes over what another planner has in force.
    pub fn set_same_transform(&mut self, other: &Self) {
        self.transform.clone_from(&other.transform);
    }

    /// Puts in force what a journal tells of.
    pub(crate) fn set_recorded_transform(&mut self, record: &TransformRecord) -> Result<(), PrinterError> {
        self.transform = Transform::recorded(record, &self.profiles).map_err(no_profile)?;
        Ok(())
    }

    /// A line that changes it; what there is to say to that.
    pub(super) fn set_transform(
        &mut self,
        action: &Action,
        line: LineNumber,
    ) -> Result<Option<String>, PrinterError> {
        self.transform.set(action, &self.profiles).map_err(|problem| no_profile(problem).at_line(line.0))
    }

    /// Tells a source that these axes have been homed, and stand where they stand.
    pub fn tell_homed(&self, axes: [bool; 3], source: &mut Source) {
        let [x, y, z, _] = self.position;
        self.transform.set_homed(&mut source.interpreter, axes, [x, y, z]);
    }

    /// Judges a move as a whole, and has it made piece by piece.
    pub(super) fn judge_and_take_apart(
        &mut self,
        mv: &Move,
        source: &mut Source,
    ) -> Result<(), PrinterError> {
        let (pieces, _) = self.judge_line(self.position, mv, source)?;
        source.take_apart(pieces, mv.feed, mv.line);
        Ok(())
    }

    /// The same of all that an arc is made of.
    pub(super) fn judge_chords(&self, arc: &Arc, source: &Source) -> Result<(), PrinterError> {
        let mut at = self.position;
        let mut chords = arc.chords(CHORD_TOLERANCE);
        while let Some(piece) = chords.next_piece() {
            (_, at) = self.judge_line(at, &piece.chord, source)?;
        }
        Ok(())
    }

    /// Judges a straight move of the G-code from where the machine is by then: its pieces, and where the last one ends.
    fn judge_line(
        &self,
        at: Position,
        mv: &Move,
        source: &Source,
    ) -> Result<(Pieces, Position), PrinterError> {
        let [x, y, z] = self.begin_of(at, mv);
        let e = at[EXTRUDER];
        let begin = gcode::Position { x, y, z, e: e - source.e_offset };
        self.guard.judge_extrusion(&Move { from: begin, ..*mv })?;
        let to = [mv.to.x, mv.to.y, mv.to.z, mv.to.e + source.e_offset];
        let pieces = self.transform.pieces([x, y, z, e], to);
        let end = self.judge_pieces(at, pieces.clone(), mv, source)?;
        Ok((pieces, end))
    }

    /// Where a move begins in the G-code's coordinates: to the bit where the line before left it, unless the head stands
    /// elsewhere.
    fn begin_of(&self, at: Position, mv: &Move) -> [f64; 3] {
        let [x, y, z, _] = at;
        let said = [mv.from.x, mv.from.y, mv.from.z];
        let at = self.transform.machine_from_gcode(said);
        let is_there = at.into_iter().zip([x, y, z]).all(|(one, other)| (one - other).abs() < DUST_MM);
        if is_there { said } else { self.transform.gcode_from_machine([x, y, z]) }
    }

    /// No piece of a move is made where one of them may not.
    fn judge_pieces(
        &self,
        mut at: Position,
        pieces: Pieces,
        mv: &Move,
        source: &Source,
    ) -> Result<Position, PrinterError> {
        for to in pieces {
            let to = undusted(at, to);
            self.guard.judge_travel([at[0], at[1], at[2]], [to[0], to[1], to[2]], mv.line)?;
            if to != at {
                let feed =
                    if source.is_sped_up() { self.step_rates.slowed(at, to, mv.feed) } else { mv.feed };
                self.reject_torque(at, to, feed, mv.line)?;
                self.step_rates.judge_request(at, to, feed, &self.limits, mv.line)?;
            }
            at = to;
        }
        Ok(at)
    }

    /// Plans a piece of a move that has been judged.
    pub(super) fn push_piece(&mut self, piece: &Piece, source: &mut Source) -> Result<(), PrinterError> {
        let to = undusted(self.position, piece.to);
        let result = self.push_judged(to, piece, source);
        if result.is_err() {
            source.drop_pieces();
        }
        result
    }

    fn push_judged(&mut self, to: Position, piece: &Piece, source: &Source) -> Result<(), PrinterError> {
        let feed = self.feed(piece.feed, piece.line, to, source);
        self.judge_torque(to, feed, piece.line)?;
        self.push(to, None, feed, piece.line, source.pace())
    }
}

fn undusted(from: Position, to: Position) -> Position {
    core::array::from_fn(|axis| {
        let is_dust = axis < 3 && (to[axis] - from[axis]).abs() < DUST_MM;
        if is_dust { from[axis] } else { to[axis] }
    })
}

fn no_profile(problem: String) -> PrinterError {
    PrinterError::new(ErrorCode::NoSuchProfile, problem)
}
