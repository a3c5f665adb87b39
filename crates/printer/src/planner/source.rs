//! One stream of G-code with its own modal state: a job's file, or what a user types.

use gcode::{
    Action, Arc, ArcPiece, CHORD_TOLERANCE, Chords, Diagnostic, Interpreter, LineNumber, Lines, Settings,
};
use units::{Mm, MmPerS};

use super::Position;
use crate::{pace::Pace, transform::Pieces};

/// The most bytes a source holds before it says that it wants no more.
pub const SOURCE_BYTES_MAX: usize = 64 * 1024;

/// A stream of G-code: fed in chunks, read line by line.
#[derive(Debug)]
pub struct Source {
    lines: Lines,
    fed: u64,
    ended: bool,
    /// The modal state.
    pub interpreter: Interpreter,
    actions: Vec<Action>,
    next_action: usize,
    diagnostics: Vec<Diagnostic>,
    /// The pieces of an arc that is being drawn, one at a time: a large arc has tens of thousands.
    chords: Option<Chords>,
    /// What is left of a move that the machine makes in pieces.
    pieces: Option<Box<Piecewise>>,
    /// The toolhead's extruder position less the interpreter's, which counts from its own start, in mm of filament.
    pub(super) e_offset: f64,
    line: LineNumber,
    /// The speed factor of that line's moves.
    pace: Pace,
    /// Whether a factor may have made them faster than the file asks.
    is_sped_up: bool,
    /// As the user set it last.
    wanted: Pace,
}

/// A move of the G-code in pieces.
#[derive(Debug)]
struct Piecewise {
    pieces: Pieces,
    feed: MmPerS,
    line: LineNumber,
}

/// One of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    /// Where it ends, in machine coordinates.
    pub(super) to: Position,
    pub(super) feed: MmPerS,
    pub(super) line: LineNumber,
}

/// What a source has next.
#[derive(Debug)]
pub(crate) enum Next {
    Action(Action),
    Diagnostic(Diagnostic),
    NeedsInput,
    End,
}

impl Default for Source {
    fn default() -> Self {
        Self::new(Settings::default())
    }
}

impl Source {
    /// A source that starts with the usual modal state (absolute, millimetres).
    pub fn new(settings: Settings) -> Self {
        Self {
            lines: Lines::new(),
            fed: 0,
            ended: false,
            interpreter: Interpreter::new(settings),
            actions: Vec::new(),
            next_action: 0,
            diagnostics: Vec::new(),
            chords: None,
            pieces: None,
            e_offset: 0.0,
            line: LineNumber(0),
            pace: Pace::default(),
            is_sped_up: false,
            wanted: Pace::default(),
        }
    }

    /// How many bytes may be fed now.
    pub fn wants(&self) -> usize {
        if self.ended { 0 } else { SOURCE_BYTES_MAX.saturating_sub(self.lines.buffered()) }
    }

    /// Takes the next bytes of the stream.
    pub fn feed(&mut self, bytes: &[u8]) {
        self.fed += bytes.len() as u64;
        self.lines.feed(bytes);
    }

    /// Bytes fed so far.
    pub const fn fed(&self) -> u64 {
        self.fed
    }

    /// Takes a text of its own, of which the first line is line 1. Everything before has been read.
    pub fn begin_text(&mut self, text: &[u8]) {
        debug_assert!(self.is_drained(), "what was fed before is read first");
        self.lines = Lines::new();
        self.lines.feed(text);
        self.lines.feed(b"\n");
    }

    /// Takes a move of one axis, or of the filament, that no line asks for. Everything before has been read.
    pub fn move_by(&mut self, axis: usize, distance: Mm, feed: MmPerS) {
        debug_assert!(self.is_drained(), "what was fed before is read first");
        let mut by = [0.0; 4];
        by[axis] = distance.0;
        self.line = LineNumber(0);
        self.next_action = 0;
        self.is_sped_up = false;
        self.actions = vec![Action::Move(self.interpreter.move_by(by, feed))];
    }

    /// Whether everything that was fed has been read.
    pub fn is_drained(&self) -> bool {
        self.lines.buffered() == 0
            && self.next_action >= self.actions.len()
            && self.chords.is_none()
            && self.pieces.is_none()
    }

    /// Says that no more bytes come: a last line without a line break counts.
    pub fn end(&mut self) {
        self.lines.end();
        self.ended = true;
    }

    /// The line that was read last.
    pub const fn line(&self) -> LineNumber {
        self.line
    }

    /// The user sets the speed factor of the lines that follow.
    pub fn set_speed_factor(&mut self, factor: f64) {
        self.interpreter.set_speed_factor(factor);
        let factor = self.interpreter.speed_factor();
        self.wanted = Pace { factor, changes: self.wanted.changes.wrapping_add(1) };
    }

    /// What the user set last.
    pub const fn wanted_pace(&self) -> Pace {
        self.wanted
    }

    /// That of the moves of the line that was read last.
    pub(super) const fn pace(&self) -> Pace {
        self.pace
    }

    /// Whether a factor may have made the moves of that line faster than the file asks, however it is set by now.
    pub(super) const fn is_sped_up(&self) -> bool {
        self.is_sped_up
    }

    /// Forgets everything that was fed and not yet read.
    pub fn clear(&mut self) {
        self.lines = Lines::new();
        self.actions.clear();
        self.next_action = 0;
        self.diagnostics.clear();
        self.chords = None;
        self.pieces = None;
    }

    /// Begins to make a move in pieces.
    pub(super) fn take_apart(&mut self, pieces: Pieces, feed: MmPerS, line: LineNumber) {
        self.pieces = Some(Box::new(Piecewise { pieces, feed, line }));
    }

    /// What is left of the move that is being made is not made.
    pub(super) fn drop_pieces(&mut self) {
        self.pieces = None;
    }

    /// The next piece of it.
    pub(super) fn next_piece(&mut self) -> Option<Piece> {
        let Piecewise { pieces, feed, line } = self.pieces.as_deref_mut()?;
        let piece = pieces.next().map(|to| Piece { to, feed: *feed, line: *line });
        if piece.is_none() {
            self.pieces = None;
        }
        piece
    }

    /// Begins to draw an arc.
    pub(super) fn draw(&mut self, arc: &Arc) {
        self.chords = Some(arc.chords(CHORD_TOLERANCE));
    }

    /// The next piece of the arc that is being drawn.
    pub(super) fn next_arc_piece(&mut self) -> Option<ArcPiece> {
        let piece = self.chords.as_mut()?.next_piece();
        if piece.is_none() {
            self.chords = None;
        }
        piece
    }

    /// The next thing in the stream.
    pub(super) fn next(&mut self) -> Next {
        // No file has so many lines.
        self.next_before(LineNumber(u32::MAX)).unwrap_or(Next::End)
    }

    /// The next thing in the stream before a line; nothing once that line is the next.
    pub(crate) fn next_before(&mut self, until: LineNumber) -> Option<Next> {
        loop {
            if let Some(diagnostic) = self.diagnostics.pop() {
                return Some(Next::Diagnostic(diagnostic));
            }
            if let Some(action) = self.actions.get_mut(self.next_action) {
                self.next_action += 1;
                return Some(Next::Action(core::mem::replace(action, Action::WaitForMoves)));
            }
            self.actions.clear();
            self.next_action = 0;
            if self.lines.next_number() >= until {
                return None;
            }
            let Some(line) = self.lines.next() else {
                return Some(if self.ended { Next::End } else { Next::NeedsInput });
            };
            self.line = line.number;
            self.interpreter.line(line.number, line.bytes, &mut self.actions, &mut self.diagnostics);
            self.diagnostics.reverse();
            let factor = self.interpreter.speed_factor();
            self.pace = Pace { factor, changes: self.wanted.changes };
            self.is_sped_up = factor > 1.0 || self.interpreter.flow_factor() > 1.0;
        }
    }
}
