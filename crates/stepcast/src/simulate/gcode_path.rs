//! The path that a file asks for, read a second time and apart from the session that prints it.
//!
//! The session says which move it makes when; each of them must be the file's next move, from its first to its last. Knows
//! G-code and nothing of pulses. Positions in mm, filament counted from the start of the file.

use std::{collections::VecDeque, sync::Arc};

use gcode::{Action, CHORD_TOLERANCE, Chords, Interpreter, Lines, Move, Settings};
use printer::transform::{Profiles, Transform};

use super::{arc_way::ArcWay, bent_path::BentMove};

/// How far a move's end may be from the file's, in mm: the dust of arithmetic, far below a step.
pub(super) const SAME_PLACE_MM: f64 = 1e-6;
/// X, Y, Z.
const AXES: usize = 3;
/// The most homed positions that wait for their line: one an axis, and an axis may be homed again.
const HOMED_MAX: usize = 64;

/// Where more of the file comes from.
pub(crate) trait MoreGcode {
    /// The next bytes; none at the end.
    fn more(&mut self) -> anyhow::Result<&[u8]>;
}

impl MoreGcode for crate::input::Input {
    fn more(&mut self) -> anyhow::Result<&[u8]> {
        Ok(self.next_chunk()?)
    }
}

/// A piece of the path: a move of the look-ahead's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Piece {
    pub(crate) line: u32,
    pub(crate) from: [f64; 4],
    pub(crate) to: [f64; 4],
    /// The way between its ends, where it is not straight.
    pub(crate) arc: Option<ArcWay>,
}

impl Piece {
    fn new(mv: &Move, arc: Option<ArcWay>) -> Self {
        Self { line: mv.line.0, from: mv.from.to_array(), to: mv.to.to_array(), arc }
    }

    /// Whether it moves anything by more than dust.
    fn has_length(&self) -> bool {
        self.from.iter().zip(&self.to).any(|(from, to)| (from - to).abs() > SAME_PLACE_MM)
    }
}

/// The moves of a file, in order.
pub(crate) struct GcodePath<R> {
    source: R,
    lines: Lines,
    interpreter: Interpreter,
    actions: Vec<Action>,
    next_action: usize,
    /// The line that they are of.
    line: u32,
    /// The arc that is being cut into pieces.
    chords: Option<Chords>,
    homed: VecDeque<(usize, f64)>,
    /// From the file's coordinates to the machine's …
    transform: Transform,
    /// … what can be loaded …
    profiles: Arc<Profiles>,
    /// … and the move that is being made in pieces for it.
    bent: Option<BentMove>,
    /// A line has changed where places are, and the head has not moved since.
    is_moved_over: bool,
    /// Where the motors stand, as far as that is known.
    head: Option<[f64; AXES]>,
    /// Lines before this one are read, not made; where axes are once they are homed there.
    begins: (u32, [f64; AXES]),
    /// The machine homes all axes together.
    pub(crate) homes_together: bool,
    fed_all: bool,
    ended: bool,
    /// The file has changed pressure advance or an input shaper on the way.
    pub(crate) filters: bool,
}

impl<R: MoreGcode> GcodePath<R> {
    /// The path of a file, for a machine that stands at 0 and understands it by these settings and profiles.
    pub(crate) fn new(source: R, settings: Settings, profiles: Arc<Profiles>) -> Self {
        Self {
            source,
            lines: Lines::new(),
            interpreter: Interpreter::new(settings),
            actions: Vec::new(),
            next_action: 0,
            line: 0,
            chords: None,
            homed: VecDeque::new(),
            transform: Transform::default(),
            profiles,
            bent: None,
            is_moved_over: false,
            head: Some([0.0; AXES]),
            begins: (0, [0.0; AXES]),
            homes_together: false,
            fed_all: false,
            ended: false,
            filters: false,
        }
    }

    /// The print begins with this line; those before are read as if axes had been homed to these positions.
    pub(crate) fn begin_with(&mut self, line: u32, endstops: [f64; AXES]) {
        self.begins = (line, endstops);
        self.head = None;
    }

    /// The axes that the machine homes where the file wants these to be.
    fn homed_by(&self, axes: [bool; AXES]) -> [bool; AXES] {
        if self.homes_together && axes.contains(&true) { [true; AXES] } else { axes }
    }

    /// The printer found this axis' endstop and says that it is here.
    pub(crate) fn homed(&mut self, axis: usize, position_mm: f64) {
        if self.homed.len() == HOMED_MAX {
            self.homed.pop_front();
        }
        self.homed.push_back((axis, position_mm));
    }

    /// Takes the file's next move, which must be this one.
    pub(crate) fn take(&mut self, line: u32, from: [f64; 4], to: [f64; 4]) -> anyhow::Result<Piece> {
        let taken = self.take_next(line, from, to)?;
        self.head = Some([to[0], to[1], to[2]]);
        Ok(taken)
    }

    fn take_next(&mut self, line: u32, from: [f64; 4], to: [f64; 4]) -> anyhow::Result<Piece> {
        loop {
            if let Some(bent) = &mut self.bent {
                let taken = bent.take(&self.transform, line, from, to);
                self.bent.take_if(|bent| bent.is_made());
                return taken;
            }
            let Some(mut piece) = self.next()? else {
                anyhow::bail!("the printer makes a move for line {line}, but the file has no more moves");
            };
            let is_level = self.transform.is_identity();
            if piece.from[..AXES] == piece.to[..AXES] {
                if self.is_moved_over || !is_level {
                    // Filament alone leaves the head where it is.
                    piece.from[..AXES].copy_from_slice(&from[..AXES]);
                    piece.to[..AXES].copy_from_slice(&from[..AXES]);
                }
            } else if !is_level {
                self.bent = Some(BentMove::new(piece, &self.transform, from));
                continue;
            } else if self.is_moved_over && piece.has_length() {
                // It leads there from where the head stood.
                piece.from[..AXES].copy_from_slice(&from[..AXES]);
                self.is_moved_over = false;
            }
            let filament = (piece.to[AXES] - piece.from[AXES]) - (to[AXES] - from[AXES]);
            let same = piece.line == line
                && (0..AXES).all(|axis| (piece.to[axis] - to[axis]).abs() <= SAME_PLACE_MM)
                && filament.abs() <= SAME_PLACE_MM;
            if same {
                return Ok(piece);
            }
            if piece.has_length() {
                anyhow::bail!(
                    "line {} asks for a move to {}, the printer makes one to {} for line {line}",
                    piece.line,
                    place(piece.to),
                    place(to)
                );
            }
        }
    }

    /// Makes sure that no moves are left.
    pub(crate) fn finish(&mut self) -> anyhow::Result<()> {
        if self.bent.is_some() {
            anyhow::bail!("a move of line {} was not made to its end", self.line);
        }
        while let Some(piece) = self.next()? {
            if piece.has_length() {
                anyhow::bail!("the move to {} of line {} was never made", place(piece.to), piece.line);
            }
        }
        Ok(())
    }

    fn next(&mut self) -> anyhow::Result<Option<Piece>> {
        loop {
            if let Some(chords) = &mut self.chords {
                if let Some(piece) = chords.next_piece() {
                    return Ok(Some(Piece::new(&piece.chord, Some(ArcWay::new(&piece)))));
                }
                self.chords = None;
            }
            if let Some(action) = self.actions.get_mut(self.next_action) {
                self.next_action += 1;
                let action = std::mem::replace(action, Action::WaitForMoves);
                if self.line < self.begins.0 {
                    self.pass(&action);
                    continue;
                }
                match action {
                    Action::Move(mv) => return Ok(Some(Piece::new(&mv, None))),
                    Action::Arc(arc) => self.chords = Some(arc.chords(CHORD_TOLERANCE)),
                    Action::Home { x, y, z } => self.home([x, y, z])?,
                    Action::Cancel => self.ended = true,
                    Action::Skew(_) | Action::BedMesh(_) => self.set_transform(&action),
                    Action::PressureAdvance { .. } | Action::InputShaper(_) => self.filters = true,
                    _ => {}
                }
                continue;
            }
            if self.ended || !self.read_line()? {
                return Ok(None);
            }
        }
    }

    /// An action of a line that is not made.
    fn pass(&mut self, action: &Action) {
        if let Action::Home { x, y, z } = *action {
            let axes = self.homed_by([x, y, z]);
            self.transform.home(&mut self.interpreter, axes, self.begins.1);
        }
        if matches!(action, Action::Skew(_) | Action::BedMesh(_)) {
            self.set_transform(action);
        }
    }

    /// What cannot be loaded ends the print, which is told elsewhere.
    fn set_transform(&mut self, action: &Action) {
        let before = self.transform.clone();
        let _ = self.transform.set(action, &self.profiles);
        self.is_moved_over |= self.transform != before;
    }

    /// Reads the next line into `actions`; `false` at the end.
    fn read_line(&mut self) -> anyhow::Result<bool> {
        self.actions.clear();
        self.next_action = 0;
        loop {
            if let Some(line) = self.lines.next() {
                self.line = line.number.0;
                // What is wrong with the file has been said by the check before.
                self.interpreter.line(line.number, line.bytes, &mut self.actions, &mut Vec::new());
                return Ok(true);
            }
            if self.fed_all {
                self.ended = true;
                return Ok(false);
            }
            let chunk = self.source.more()?;
            if chunk.is_empty() {
                self.fed_all = true;
                self.lines.end();
            } else {
                self.lines.feed(chunk);
            }
        }
    }

    fn home(&mut self, axes: [bool; AXES]) -> anyhow::Result<()> {
        let axes = self.homed_by(axes);
        let gcode::Position { x, y, z, .. } = self.interpreter.position();
        let mut motors = self.head.unwrap_or_else(|| self.transform.machine_from_gcode([x, y, z]));
        for axis in (0..AXES).filter(|&axis| axes[axis]) {
            let Some(found) = self.homed.iter().position(|&(homed, _)| homed == axis) else {
                anyhow::bail!("the file homes axis {}, but the printer did not", ["X", "Y", "Z"][axis]);
            };
            if let Some((_, position_mm)) = self.homed.remove(found) {
                motors[axis] = position_mm;
            }
        }
        self.head = Some(motors);
        self.transform.set_homed(&mut self.interpreter, axes, motors);
        Ok(())
    }
}

pub(super) fn place([x, y, z, e]: [f64; 4]) -> String {
    format!("X{x:.4} Y{y:.4} Z{z:.4} (filament {e:.4})")
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Text(&'static [u8], usize);

    impl MoreGcode for Text {
        fn more(&mut self) -> anyhow::Result<&[u8]> {
            // Pieces that end in the middle of lines.
            let count = self.1.min(self.0.len());
            let (now, later) = self.0.split_at(count);
            self.0 = later;
            Ok(now)
        }
    }

    fn path(text: &'static str) -> GcodePath<Text> {
        GcodePath::new(Text(text.as_bytes(), 7), Settings::default(), Arc::default())
    }

    const FILE: &str = "G28\nG92 E0\nG1 X10 F600\nG1 X10\nM117 hello\nG1 X10 Y5 E0.5\n";

    #[test]
    fn the_files_own_moves_are_taken_one_after_another() {
        let mut path = path(FILE);
        for axis in 0..3 {
            path.homed(axis, 0.0);
        }
        let first = path.take(3, [0.0; 4], [10.0, 0.0, 0.0, 0.0]).unwrap();
        assert_eq!((first.line, first.to[0], first.arc), (3, 10.0, None));
        // Line 4 leads nowhere and is passed over. The filament counts by its difference.
        path.take(6, [10.0, 0.0, 0.0, 100.0], [10.0, 5.0, 0.0, 100.5]).unwrap();
        path.finish().unwrap();
    }

    #[test]
    fn another_move_than_the_files_is_found_out() {
        for (line, to) in [
            (3, [10.1, 0.0, 0.0, 0.0]),
            (3, [10.0, 0.0, 0.0, 0.1]),
            (4, [10.0, 0.0, 0.0, 0.0]),
            (6, [10.0, 5.0, 0.0, 0.5]),
        ] {
            let mut path = path(FILE);
            for axis in 0..3 {
                path.homed(axis, 0.0);
            }
            let error = path.take(line, [0.0; 4], to).unwrap_err().to_string();
            assert!(error.starts_with("line 3 asks for a move to X10.0000"), "{error}");
        }
    }

    #[test]
    fn homing_that_never_was_and_moves_that_never_were_are_found_out() {
        let error = path(FILE).take(3, [0.0; 4], [10.0, 0.0, 0.0, 0.0]).unwrap_err();
        assert!(error.to_string().contains("homes axis X"), "{error}");
        let mut left = path("G1 X5\nG1 X6\n");
        left.take(1, [0.0; 4], [5.0, 0.0, 0.0, 0.0]).unwrap();
        assert!(left.finish().unwrap_err().to_string().contains("line 2 was never made"));
        let error = path("").take(1, [0.0; 4], [1.0, 0.0, 0.0, 0.0]).unwrap_err();
        assert!(error.to_string().contains("no more moves"));
    }

    #[test]
    fn homed_positions_count_as_the_printer_says() {
        let mut path = path("G28 X\nG91\nG1 X1\n");
        path.homed(0, 250.0);
        assert_eq!(path.take(3, [250.0, 0.0, 0.0, 0.0], [251.0, 0.0, 0.0, 0.0]).unwrap().from[0], 250.0);
    }

    #[test]
    fn arcs_come_in_pieces_of_themselves() {
        let mut path = path("G1 X10 F600\nG3 X-10 Y0 I-10 J0\n");
        path.take(1, [0.0; 4], [10.0, 0.0, 0.0, 0.0]).unwrap();
        let mut count = 0;
        while let Some(piece) = path.next().unwrap() {
            let middle = [0, 1].map(|axis| 0.5 * (piece.from[axis] + piece.to[axis]));
            let bulge = piece.arc.unwrap().distance_squared([middle[0], middle[1], 0.0], 0.5).sqrt();
            assert!(bulge > 0.0 && bulge <= CHORD_TOLERANCE.0 + 1e-9, "{piece:?}");
            count += 1;
        }
        assert!(count > 30);
    }

    #[test]
    fn filament_alone_is_where_the_head_stands_after_a_skew_was_cleared() {
        let mut path =
            path("SET_SKEW XY=140.4,142.8,99.8\nG1 X50 Y50 F600\nSET_SKEW CLEAR=1\nG1 E1\nG1 X50.5\n");
        let mut skewed = Transform::default();
        let lengths = Some([140.4, 142.8, 99.8]);
        let change = gcode::SkewChange::Measured { xy: lengths, xz: None, yz: None };
        skewed.set(&Action::Skew(change), &Profiles::default()).unwrap();
        let [x, y, z] = skewed.machine_from_gcode([50.0, 50.0, 0.0]);
        assert!((x - 50.0).abs() > 0.1);
        path.take(2, [0.0; 4], [x, y, z, 0.0]).unwrap();
        path.take(4, [x, y, z, 0.0], [x, y, z, 1.0]).unwrap();
        path.take(5, [x, y, z, 1.0], [50.5, 50.0, 0.0, 1.0]).unwrap();
        path.finish().unwrap();
    }

    #[test]
    fn an_axis_that_leans_is_elsewhere_once_another_is_homed() {
        let mut path = path("SET_SKEW XY=140.4,142.8,99.8\nG1 X50 Y50 F600\nG28 Y\nG1 Z5\n");
        let lengths = Some([140.4, 142.8, 99.8]);
        let change = gcode::SkewChange::Measured { xy: lengths, xz: None, yz: None };
        let mut skewed = Transform::default();
        skewed.set(&Action::Skew(change), &Profiles::default()).unwrap();
        let [x, y, z] = skewed.machine_from_gcode([50.0, 50.0, 0.0]);
        path.take(2, [0.0; 4], [x, y, z, 0.0]).unwrap();
        path.homed(1, 200.0);
        // Of X the motors stay where they were.
        path.take(4, [x, 200.0, z, 0.0], [x, 200.0, 5.0, 0.0]).unwrap();
        path.finish().unwrap();
    }
}
