//! The modal state of one G-code source, and what each line means in it.
//!
//! Knows nothing of machines (see the crate's header). A line either takes effect as a whole or not at all.

mod extended;
mod level;
mod machine;
mod moves;
mod report;
#[cfg(test)]
mod tests;

use core::ops::Range;

use units::MmPerS;

use crate::action::{Action, Move, Position};
use crate::annotation;
use crate::arc::Plane;
use crate::diagnostic::{Diagnostic, DiagnosticCode, Severity};
use crate::lines::{LINE_BYTES_MAX, LineNumber};
use crate::words::{Words, WordsEnd};

/// Millimetres in an inch.
const INCH_MM: f64 = 25.4;
/// Speed of moves before the first `F`.
const FEED_DEFAULT: MmPerS = MmPerS(25.0);
/// Bounds of the speed and flow factors.
const FACTOR_RANGE: core::ops::RangeInclusive<f64> = 0.01..=10.0;
/// How far from the origin a move may lead, mm. The machine's own range is checked by the host; this keeps arithmetic exact
/// to less than a nanometre.
const POSITION_MAX_MM: f64 = 1e6;
/// Filament in one print, mm: a thousand kilometres.
const FILAMENT_MAX_MM: f64 = 1e9;
/// The highest number of a tool, fan or object.
const INDEX_MAX: f64 = 65_535.0;

/// What `G10` and `G11` do; `M207` and `M208` change it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirmwareRetraction {
    /// Filament drawn back, mm.
    pub length: f64,
    /// At this speed.
    pub speed: MmPerS,
    /// Filament fed beyond the length drawn back, mm.
    pub extra_length: f64,
    /// Speed of feeding it again.
    pub unretract_speed: MmPerS,
    /// How far Z rises meanwhile, mm.
    pub z_hop: f64,
}

impl Default for FirmwareRetraction {
    /// Short enough for direct drive, so that it can do no harm.
    fn default() -> Self {
        Self {
            length: 1.0,
            speed: MmPerS(35.0),
            extra_length: 0.0,
            unretract_speed: MmPerS(35.0),
            z_hop: 0.0,
        }
    }
}

/// What a file does not say about itself.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settings {
    /// The printer's firmware retraction; where it is `None` a default is used, and said.
    pub retraction: Option<FirmwareRetraction>,
}

/// Reads lines in their order and keeps what one means for the next.
#[derive(Clone, Debug)]
pub struct Interpreter {
    words: Words,
    /// x, y, z, e as commanded.
    position: [f64; 4],
    /// Machine position = value · scale + offset.
    offset: [f64; 4],
    scale: [f64; 4],
    relative: bool,
    relative_e: bool,
    /// Without the speed factor.
    feed_mm_s: f64,
    speed_factor: f64,
    flow_factor: f64,
    /// What `M220 B` stored.
    stored_speed_factor: f64,
    plane: Plane,
    tool: u32,
    retraction: FirmwareRetraction,
    retraction_known: bool,
    retracted: bool,
    /// Z is this much higher than the file says, until `G11`.
    hop: f64,
    /// Acceleration last set, for `ACCEL_TO_DECEL`.
    accel: Option<f64>,
    /// The `N` of the last line that had one.
    last_number: Option<i64>,
    in_thumbnail: bool,
}

/// Where a line's results go.
struct Out<'a> {
    line: LineNumber,
    actions: &'a mut Vec<Action>,
    diagnostics: &'a mut Vec<Diagnostic>,
}

impl Out<'_> {
    #[cold]
    fn say(
        &mut self,
        severity: Severity,
        code: DiagnosticCode,
        at: Range<usize>,
        message: impl Into<String>,
    ) {
        let columns = at.start as u32..at.end as u32;
        self.diagnostics.push(Diagnostic {
            line: self.line,
            columns,
            severity,
            code,
            message: message.into(),
        });
    }

    fn act(&mut self, action: Action) {
        self.actions.push(action);
    }
}

/// What is wrong has been said.
#[derive(Clone, Copy, Debug)]
struct Said;

/// The letter and number that begin a line.
#[derive(Clone, Copy, Debug)]
struct Code {
    number: u32,
    /// What follows a point: 1 in `G92.1`.
    sub: Option<u32>,
    /// Where it stands.
    start: usize,
    end: usize,
}

impl Code {
    fn columns(self) -> Range<usize> {
        self.start..self.end
    }
}

impl Interpreter {
    /// The state before the first line: millimetres, absolute, everything at 0.
    pub fn new(settings: Settings) -> Self {
        Self {
            words: Words::default(),
            position: [0.0; 4],
            offset: [0.0; 4],
            scale: [1.0; 4],
            relative: false,
            relative_e: false,
            feed_mm_s: FEED_DEFAULT.0,
            speed_factor: 1.0,
            flow_factor: 1.0,
            stored_speed_factor: 1.0,
            plane: Plane::Xy,
            tool: 0,
            retraction: settings.retraction.unwrap_or_default(),
            retraction_known: settings.retraction.is_some(),
            retracted: false,
            hop: 0.0,
            accel: None,
            last_number: None,
            in_thumbnail: false,
        }
    }

    /// Reads one line, without its line end. Actions and diagnostics are appended in order, a handful
    /// at most.
    pub fn line(
        &mut self,
        line: LineNumber,
        bytes: &[u8],
        actions: &mut Vec<Action>,
        diagnostics: &mut Vec<Diagnostic>,
    ) {
        let mut out = Out { line, actions, diagnostics };
        if bytes.len() > LINE_BYTES_MAX {
            return Self::too_long(bytes, &mut out);
        }
        let mut at = 0;
        while let Some(&(b' ' | b'\t')) = bytes.get(at) {
            at += 1;
        }
        let Some(&first) = bytes.get(at) else { return };
        match first {
            b'N' | b'n' if bytes.get(at + 1).is_some_and(|b| b.is_ascii_digit() || *b == b'-') => {
                self.numbered(bytes, at, &mut out);
            }
            b'A'..=b'Z' | b'a'..=b'z' | b'_' => self.command(bytes, at, &mut out),
            b';' => {
                annotation::read(&bytes[at + 1..], &mut self.in_thumbnail, |a| {
                    out.act(Action::Annotation(a));
                });
            }
            _ => self.odd(bytes, at, &mut out),
        }
    }

    /// The position commanded so far. `e` is the running total of filament.
    pub fn position(&self) -> Position {
        let [x, y, z, e] = self.position;
        Position { x, y, z, e }
    }

    /// After homing, or where a position was forced: these axes now are at these machine positions (mm), and their `G92`
    /// offsets vanish.
    pub fn set_axes(&mut self, x: Option<f64>, y: Option<f64>, z: Option<f64>) {
        for (axis, value) in [x, y, z].into_iter().enumerate() {
            if let Some(value) = value {
                self.position[axis] = value;
                self.offset[axis] = 0.0;
            }
        }
        if z.is_some() {
            self.hop = 0.0;
        }
    }

    /// Where a move was not made: the machine stands here (mm), whatever was commanded. `G92` offsets hold.
    pub fn stand_at(&mut self, x: f64, y: f64, z: f64) {
        self.position[..3].copy_from_slice(&[x, y, z]);
    }

    /// A move that no line asks for, by this much from where the last one ended (mm; `e` of filament). Modes, factors,
    /// offsets and the feed of the lines that follow stay as they are, and have no part in it.
    pub fn move_by(&mut self, by: [f64; 4], feed: MmPerS) -> Move {
        let from = self.position();
        self.position = core::array::from_fn(|axis| self.position[axis] + by[axis]);
        Move { line: LineNumber(0), from, to: self.position(), feed, rapid: false }
    }

    /// The speed factor, 1 = as the file says.
    pub fn speed_factor(&self) -> f64 {
        self.speed_factor
    }

    /// Sets the speed factor for the moves that follow, within 0.01 ..= 10.
    pub fn set_speed_factor(&mut self, factor: f64) {
        if !factor.is_nan() {
            self.speed_factor = factor.clamp(*FACTOR_RANGE.start(), *FACTOR_RANGE.end());
        }
    }

    /// The flow factor, 1 = as the file says.
    pub fn flow_factor(&self) -> f64 {
        self.flow_factor
    }

    /// Sets the flow factor for the moves that follow, within 0.01 ..= 10. What was fed already does not change.
    pub fn set_flow_factor(&mut self, factor: f64) {
        if !factor.is_nan() {
            self.rescale_e(self.scale[0], factor.clamp(*FACTOR_RANGE.start(), *FACTOR_RANGE.end()));
        }
    }

    /// The tool in use, counted from 0.
    pub fn tool(&self) -> u32 {
        self.tool
    }

    /// Whether `G10` drew the filament back and `G11` has not fed it again.
    pub fn is_retracted(&self) -> bool {
        self.retracted
    }

    /// The feed of moves that follow, with the speed factor.
    pub fn feed(&self) -> MmPerS {
        MmPerS(self.feed_mm_s * self.speed_factor)
    }

    /// A line that begins with a command.
    #[inline]
    fn command(&mut self, bytes: &[u8], at: usize, out: &mut Out<'_>) {
        self.in_thumbnail = false;
        let letter = bytes[at].to_ascii_uppercase();
        let (number, end) = digits(bytes, at + 1);
        let Some(number) = number else {
            return self.extended(bytes, at, out);
        };
        let mut code = Code { number, sub: None, start: at, end };
        match bytes.get(end) {
            Some(b'.') => {
                let (sub, end) = digits(bytes, end + 1);
                code.sub = Some(sub.unwrap_or(0));
                code.end = end;
            }
            // `A1_B`, but not `G1X0`: a macro's name.
            Some(b'_') => return self.extended(bytes, at, out),
            _ => {}
        }
        match letter {
            b'G' => self.g(code, bytes, out),
            b'M' => self.m(code, bytes, out),
            b'T' => self.t(code, bytes, out),
            _ => unknown(code, bytes, out),
        }
    }

    /// Reads the words behind a command. `false` where they are wrong, which has then been said.
    #[inline]
    fn read_words(&mut self, bytes: &[u8], code: Code, bare_allowed: u32, out: &mut Out<'_>) -> bool {
        match self.words.scan(bytes, code.end) {
            Ok(end) => {
                let bare = self.words.bare() & !bare_allowed;
                (bare == 0 && matches!(end, WordsEnd::Line | WordsEnd::Comment))
                    || self.check_words(bytes, bare, end, out)
            }
            Err(fault) => {
                report::word_fault(&fault, bytes, out);
                false
            }
        }
    }
}

/// A command that is not known may have been what heats or homes: it blocks.
#[cold]
fn unknown(code: Code, bytes: &[u8], out: &mut Out<'_>) {
    let name = String::from_utf8_lossy(&bytes[code.columns()]).into_owned();
    let message = format!(
        "`{name}` is not known here and would be skipped. Remove it from the slicer's custom G-code, or confirm that the \
         print is right without it."
    );
    out.say(Severity::Blocking, DiagnosticCode::UnknownCommand, code.columns(), message);
}

/// A whole number of up to nine digits, and the place behind it.
#[inline]
fn digits(bytes: &[u8], at: usize) -> (Option<u32>, usize) {
    let mut end = at;
    let mut number: u32 = 0;
    while let Some(digit) = bytes.get(end).map(|b| b.wrapping_sub(b'0')).filter(|&d| d < 10) {
        number = number.saturating_mul(10).saturating_add(u32::from(digit));
        end += 1;
    }
    ((end > at).then_some(number), end)
}

impl Interpreter {
    fn push_move(&mut self, to: [f64; 4], feed: MmPerS, rapid: bool, out: &mut Out<'_>) {
        let from = self.position();
        self.position = to;
        out.actions.push(Action::Move(Move { line: out.line, from, to: self.position(), feed, rapid }));
    }

    /// Changes units or flow without moving the extruder or what the file takes its position to be.
    fn rescale_e(&mut self, units: f64, flow: f64) {
        let e_units = self.scale[0];
        let logical_mm = (self.position[3] - self.offset[3]) / self.scale[3] * e_units;
        self.scale = [units, units, units, units * flow];
        self.flow_factor = flow;
        self.offset[3] = self.position[3] - logical_mm * flow;
    }
}
