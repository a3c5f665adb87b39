//! Where a print was when it was interrupted, for those who go on with it from a line: the board has lost everything.
//!
//! Reads the journal, and the print's file as far as it may have got. What was made is known up to the journal's last
//! progress; the machine may have gone on for some seconds ([`REACH`]), in which Z may have changed. Of Z's motor is known
//! how far it was turned, and from that where it can stand once it has current again ([`standing`]). Knows no board and
//! moves nothing. Units: mm, seconds of print time.

mod standing;
#[cfg(test)]
mod tests;

use gcode::{Action, Annotation, LineNumber};
use units::{Mm, Seconds};

pub use self::standing::{STANDINGS_MAX, Standings};
use crate::{
    config::PrinterConfig,
    error::{ErrorCode, PrinterError},
    journal::{Journal, MovedBy, PROGRESS_INTERVAL},
    machine,
    planner::{Next, Source},
    preview::layers::Layers,
    transform::{Transform, TransformRecord},
};

/// Things in the file that are read in one go.
const THINGS_MAX: usize = 65_536;
/// A machine whose host is gone moves for no longer than this: its lease, the ramp, or what is left in a plain board until
/// its heaters stop it.
const ALONE: Seconds = Seconds(3.0);
/// So much print time after the journal's last progress nothing can have been made.
pub const REACH: Seconds = Seconds(PROGRESS_INTERVAL.0 + ALONE.0);
/// The most lines that are looked at beyond the last known one.
const REACH_LINES_MAX: u32 = 100_000;

/// Where a print was.
#[derive(Clone, Debug, PartialEq)]
pub struct Interruption {
    /// The line of the last move that is known to have been made, 0 where none is.
    pub line: u32,
    /// The line to begin with: nothing is left out, and some seconds may be made twice.
    pub start_line: u32,
    /// It has not got beyond this line.
    pub reach_line: u32,
    /// Print time when the last progress was noted.
    pub elapsed: Seconds,
    /// The layer of the line, counted from 1 …
    pub layer: u32,
    /// … its nozzle's height, and the line with which it begins.
    pub layer_z: Mm,
    /// See `layer_z`.
    pub layer_line: u32,
    /// Where the machine stands at the end of `line`: X, Y, Z.
    pub position: [Mm; 3],
    /// The lowest and highest Z at which the power may have gone, by file and journal; `None` where Z was being moved by
    /// something else.
    pub z_range: Option<[Mm; 2]>,
    /// Where Z can stand once its motor has current again.
    pub standings: Standings,
    /// The speed and flow factors that held.
    pub factors: [f64; 2],
    /// What made up for skew and bed before the file's first line: what was loaded by hand.
    pub transform: TransformRecord,
}

/// Finds that out.
#[derive(Debug)]
pub struct Survey {
    journal: Journal,
    config: PrinterConfig,
    source: Source,
    endstops: [f64; 3],
    /// From the file's coordinates to the machine's, at the line that was read last.
    transform: Transform,
    /// The last line that is known to have been made.
    known: u32,
    layers: Layers,
    /// How it was at the end of that line, once that has been read.
    at_known: Option<Known>,
    /// The line of the journal's last progress: where it is made in pieces, one of them is known to have been made, no more.
    told: Option<u32>,
    /// The lowest and highest Z of that line, where it is the last that was read and is made in pieces.
    in_pieces: Option<[f64; 2]>,
    /// Since then: print time at least, the last line, and the lowest and highest Z.
    since: Seconds,
    reach_line: u32,
    z_range: [f64; 2],
    is_done: bool,
}

#[derive(Clone, Copy, Debug)]
struct Known {
    position: [f64; 3],
    layer: u32,
    layer_z: Mm,
    layer_line: u32,
    factors: [f64; 2],
    /// The line may have been made in part.
    is_in_part: bool,
}

impl Survey {
    /// Of a print on the machine on which it was begun.
    pub fn new(config: &PrinterConfig, journal: Journal) -> Result<Self, PrinterError> {
        let refused = |detail: &str| PrinterError::new(ErrorCode::ContinuationRefused, detail);
        if journal.has_ended {
            return Err(refused("its journal says that the print has ended"));
        }
        if !journal.is_of(config) {
            return Err(refused("the machine file is not the one it was begun with"));
        }
        let transform = Transform::recorded(journal.transform(), &config.profiles)
            .map_err(|problem| PrinterError::new(ErrorCode::NoSuchProfile, problem))?;
        let mut source = Source::new(machine::gcode_settings(config));
        if let Some([x, y, z, _]) = journal.began_at() {
            let [x, y, z] = transform.gcode_from_machine([x, y, z]);
            source.interpreter.set_axes(Some(x), Some(y), Some(z));
        }
        let before = journal.start_line.map_or(0, |line| line.saturating_sub(1));
        let told = journal.progress.map(|(line, _)| line).filter(|&line| line > before);
        let known = told.unwrap_or(before);
        Ok(Self {
            endstops: config.steppers.each_ref().map(|stepper| stepper.position_endstop.0),
            journal,
            config: config.clone(),
            source,
            transform,
            known,
            layers: Layers::new(),
            at_known: None,
            told,
            in_pieces: None,
            since: Seconds::ZERO,
            reach_line: known,
            z_range: [f64::INFINITY, f64::NEG_INFINITY],
            is_done: false,
        })
    }

    /// How many bytes of the file may be fed now.
    pub fn wants(&self) -> usize {
        if self.is_done { 0 } else { self.source.wants() }
    }

    /// The next bytes of the file, no more than that.
    pub fn feed(&mut self, bytes: &[u8]) {
        self.source.feed(bytes);
    }

    /// The file has ended.
    pub fn end(&mut self) {
        self.source.end();
    }

    /// How many bytes have been fed.
    pub const fn fed(&self) -> u64 {
        self.source.fed()
    }

    /// Reads a piece; whether there is more to do with what was fed.
    pub fn advance(&mut self) -> Result<bool, PrinterError> {
        for _ in 0..THINGS_MAX {
            if self.is_done {
                return Ok(false);
            }
            let until = if self.at_known.is_some() { u32::MAX } else { self.known.saturating_add(1) };
            match self.source.next_before(LineNumber(until)) {
                Some(Next::Action(action)) => self.pass(&action),
                Some(Next::Diagnostic(_)) => {}
                Some(Next::NeedsInput) => return Ok(false),
                None => self.arrive(),
                Some(Next::End) => {
                    if self.at_known.is_none() && self.source.line().0 < self.known {
                        let detail = format!("it has no line {}", self.known);
                        return Err(PrinterError::new(ErrorCode::InvalidGcode, detail));
                    }
                    self.arrive();
                    self.is_done = true;
                }
            }
        }
        Ok(!self.is_done)
    }

    /// Everything up to the last known line has been read.
    fn arrive(&mut self) {
        if self.at_known.is_some() {
            return;
        }
        let gcode::Position { x, y, z, .. } = self.source.interpreter.position();
        let [x, y, z] = self.transform.machine_from_gcode([x, y, z]);
        // What the user set is not in the file, what the file set later holds.
        let [speed, flow] = self.journal.factors();
        let interpreter = &mut self.source.interpreter;
        if let Some(factor) = speed {
            interpreter.set_speed_factor(factor);
        }
        if let Some(factor) = flow {
            interpreter.set_flow_factor(factor);
        }
        let layer = self.layers.current();
        self.at_known = Some(Known {
            position: [x, y, z],
            layer: self.layers.number() + 1,
            layer_z: layer.z,
            layer_line: layer.first_line,
            factors: [interpreter.speed_factor(), interpreter.flow_factor()],
            is_in_part: self.in_pieces.is_some(),
        });
        let [low, high] = self.in_pieces.unwrap_or([z, z]);
        self.z_range = [low.min(z), high.max(z)];
    }

    fn pass(&mut self, action: &Action) {
        let line = self.source.line().0;
        let interval = match action {
            Action::Move(mv) => {
                let extrudes = mv.to.e > mv.from.e;
                let [x, y, z] = [mv.to.x - mv.from.x, mv.to.y - mv.from.y, mv.to.z - mv.from.z];
                let way = libm::sqrt(x * x + y * y + z * z);
                if way > 0.0 {
                    self.layers.segment(0, line, extrudes, mv.to.z);
                }
                let is_in_pieces = way > 0.0 && self.transform.mesh().is_some();
                let way = if way > 0.0 { way } else { (mv.to.e - mv.from.e).abs() };
                let span = self.span(mv.from.z, mv.to.z);
                self.in_pieces = (is_in_pieces && self.told == Some(line)).then_some(span);
                Some((way, mv.feed, span))
            }
            Action::Arc(arc) => {
                self.layers.segment(0, line, arc.to.e > arc.from.e, arc.to.z);
                let [[_, _, low], [_, _, high]] = arc.bounds();
                let span = self.span(low, high);
                self.in_pieces = (self.told == Some(line)).then_some(span);
                Some((arc.length().0, arc.feed, span))
            }
            Action::Annotation(Annotation::LayerChange | Annotation::Layer(_)) => {
                self.layers.announce(line);
                None
            }
            Action::Home { x, y, z } => {
                let axes = machine::homed_together(&self.config, [*x, *y, *z]);
                self.transform.home(&mut self.source.interpreter, axes, self.endstops);
                None
            }
            Action::Skew(_) | Action::BedMesh(_) => {
                // One that cannot be loaded has ended the print there.
                let _ = self.transform.set(action, &self.config.profiles);
                None
            }
            _ => None,
        };
        if let Some((way, feed, span)) = interval.filter(|_| self.at_known.is_some()) {
            self.reach_line = line;
            let [low, high] = self.z_range;
            self.z_range = [low.min(span[0]), high.max(span[1])];
            // Without acceleration it is faster than it can have been.
            let speed = feed.0.min(self.config.printer.max_velocity.0).max(f64::MIN_POSITIVE);
            self.since += Seconds(way / speed);
            self.is_done = self.since > REACH || line > self.known.saturating_add(REACH_LINES_MAX);
        }
    }

    /// The lowest and highest Z that the machine can have on a way between two heights of the file.
    fn span(&self, one: f64, other: f64) -> [f64; 2] {
        let [least, most] = self.transform.added_to_z();
        [one.min(other) + least, one.max(other) + most]
    }

    /// What was found out, once nothing more is wanted.
    pub fn report(&self) -> Option<Interruption> {
        let known = self.at_known.filter(|_| self.is_done)?;
        let height = self.journal.height;
        let z_range = match height.map(|height| height.by) {
            Some(MovedBy::Others) => None,
            Some(MovedBy::Nobody) => height.map(|height| [height.z, height.z]),
            Some(MovedBy::File) | None => Some(self.z_range),
        };
        let again = u32::from(known.is_in_part);
        Some(Interruption {
            line: self.known,
            start_line: (self.known + 1 - again).max(1),
            reach_line: self.reach_line,
            elapsed: self.journal.progress.map_or(Seconds::ZERO, |(_, elapsed)| elapsed),
            layer: known.layer,
            layer_z: known.layer_z,
            layer_line: known.layer_line,
            position: known.position.map(Mm),
            z_range: z_range.map(|range| range.map(Mm)),
            standings: Standings::new(
                &self.config.steppers[2].motor,
                // Without a motor of its own the place of no coil says where Z is.
                height.filter(|_| machine::has_z_motor(&self.config)),
                z_range,
            ),
            factors: known.factors,
            transform: self.journal.transform().clone(),
        })
    }
}
