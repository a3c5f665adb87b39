//! `G` commands: moves, arcs, modes, offsets.

use units::{MmPerS, Seconds};

use super::{Code, FILAMENT_MAX_MM, FirmwareRetraction, INCH_MM, Interpreter, Out, POSITION_MAX_MM};
use crate::action::{Action, Position};
use crate::arc::{Arc, ArcError, Centre, Plane, TURNS_MAX, Turn};
use crate::diagnostic::DiagnosticCode;
use crate::diagnostic::Severity::{Blocking, Error, Warning};
use crate::words::{bit, bits};

const AXES: &[u8; 4] = b"XYZE";

impl Interpreter {
    #[inline]
    pub(super) fn g(&mut self, code: Code, bytes: &[u8], out: &mut Out<'_>) {
        if code.number <= 1 && code.sub.is_none() {
            if self.read_words(bytes, code, 0, out) {
                self.linear(code.number == 0, out);
            }
            return;
        }
        self.other_g(code, bytes, out);
    }

    fn other_g(&mut self, code: Code, bytes: &[u8], out: &mut Out<'_>) {
        let axes = bits(AXES);
        match (code.number, code.sub) {
            (2 | 3, None) => self.with_words(code, bytes, 0, out, |it, out| it.arc(code, out)),
            (4, None) => self.with_words(code, bytes, 0, out, |it, out| it.dwell(code, out)),
            (10, None) => self.with_words(code, bytes, 0, out, |it, out| it.retract(code, out)),
            (11, None) => self.with_words(code, bytes, 0, out, super::Interpreter::unretract),
            // All letters: Prusa adds `W`, Marlin `O` and `R`.
            (28, None) => self.with_words(code, bytes, u32::MAX, out, super::Interpreter::home),
            (92, None) => self.with_words(code, bytes, 0, out, |it, out| it.set_position(axes, out)),
            (17..=21 | 53 | 61 | 64 | 90 | 91 | 94, None) | (92, Some(1)) => {
                self.with_words(code, bytes, 0, out, |it, out| it.mode(code, out));
            }
            (29 | 30 | 32 | 33 | 34 | 35 | 80, _) => {
                let message = "Bed levelling and probing are not available here. The line would be skipped: level the bed \
                               by hand, then confirm.";
                out.say(Blocking, DiagnosticCode::UnsupportedCommand, code.columns(), message);
            }
            _ => super::unknown(code, bytes, out),
        }
    }

    /// Commands that take no words. They are read all the same, so that none is passed over in silence.
    fn mode(&mut self, code: Code, out: &mut Out<'_>) {
        self.unused_words(0, out);
        match code.number {
            17 => self.plane = Plane::Xy,
            18 => self.plane = Plane::Zx,
            19 => self.plane = Plane::Yz,
            20 => self.rescale_e(INCH_MM, self.flow_factor),
            21 => self.rescale_e(1.0, self.flow_factor),
            90 => self.relative = false,
            91 => self.relative = true,
            // `G92.1`
            92 => self.offset[..3].copy_from_slice(&[0.0, 0.0, self.hop]),
            // Alone, `G53` changes nothing; feed is per minute, and exact stop and blending are the planner's.
            _ => {}
        }
    }

    /// Reads the words, then goes on where they are right.
    pub(super) fn with_words(
        &mut self,
        code: Code,
        bytes: &[u8],
        bare_allowed: u32,
        out: &mut Out<'_>,
        then: impl FnOnce(&mut Self, &mut Out<'_>),
    ) {
        if self.read_words(bytes, code, bare_allowed, out) {
            then(self, out);
        }
    }

    /// `G0`, `G1`
    #[inline]
    fn linear(&mut self, rapid: bool, out: &mut Out<'_>) {
        const KNOWN: u32 = bits(b"XYZEF");
        self.unused_words(KNOWN, out);
        if !self.take_feed(out) || self.words.present() & bits(AXES) == 0 {
            return;
        }
        let Some(to) = self.target(out) else { return };
        let feed = self.feed();
        self.push_move(to, feed, rapid, out);
    }

    /// Takes over `F`, where there is one. `false` where it is wrong.
    #[inline]
    fn take_feed(&mut self, out: &mut Out<'_>) -> bool {
        if let Some(feed) = self.words.get(b'F') {
            if feed <= 0.0 {
                let message = "A feed must be greater than 0. The line is skipped; slice the file again.";
                out.say(Error, DiagnosticCode::ValueOutOfRange, self.words.columns(b'F'), message);
                return false;
            }
            self.feed_mm_s = feed * self.scale[0] / 60.0;
        }
        true
    }

    /// Where the words X, Y, Z and E lead.
    #[inline]
    fn target(&mut self, out: &mut Out<'_>) -> Option<[f64; 4]> {
        let mut to = self.position;
        let relative_e = self.relative | self.relative_e;
        for (axis, &letter) in AXES.iter().enumerate() {
            if let Some(value) = self.words.get(letter) {
                let relative = if axis == 3 { relative_e } else { self.relative };
                let origin = if relative { self.position[axis] } else { self.offset[axis] };
                to[axis] = value * self.scale[axis] + origin;
            }
        }
        let [x, y, z, e] = to;
        let is_within = [x, y, z].iter().all(|axis| axis.abs() <= POSITION_MAX_MM);
        if is_within && e.abs() <= FILAMENT_MAX_MM {
            return Some(to);
        }
        let letter = self.words.first_of(bits(AXES)).unwrap_or(b'X');
        let message = "This leads out of every machine. The line is skipped; slice the file again.";
        out.say(Error, DiagnosticCode::ValueOutOfRange, self.words.columns(letter), message);
        None
    }

    /// `G2`, `G3`
    fn arc(&mut self, code: Code, out: &mut Out<'_>) {
        const KNOWN: u32 = bits(b"XYZEFIJKRP");
        self.unused_words(KNOWN, out);
        let [first, second, _] = self.plane.axes();
        let (to_first, to_second) = (b"IJK"[first], b"IJK"[second]);
        let offset = self.words.has(to_first) || self.words.has(to_second);
        let centre = match (self.words.get(b'R'), offset) {
            (Some(radius), false) => Centre::Radius(radius * self.scale[0]),
            (None, true) => {
                let part = |letter| self.words.get(letter).unwrap_or(0.0) * self.scale[0];
                Centre::Offset([part(to_first), part(to_second)])
            }
            (radius, _) => {
                let message = if radius.is_some() {
                    "An arc has either a centre (I, J, K) or a radius (R), not both. The line is skipped."
                        .to_owned()
                } else {
                    let (i, j) = (char::from(to_first), char::from(to_second));
                    format!("The arc has neither a centre ({i}, {j}) nor a radius (R). The line is skipped.")
                };
                return out.say(Error, DiagnosticCode::ImpossibleArc, code.columns(), message);
            }
        };
        let turns = self.words.get(b'P').unwrap_or(1.0);
        if !(1.0..=TURNS_MAX).contains(&turns) || turns % 1.0 != 0.0 {
            let message =
                format!("An arc's number of turns is whole, from 1 to {TURNS_MAX}. The line is skipped.");
            return out.say(Error, DiagnosticCode::ValueOutOfRange, self.words.columns(b'P'), message);
        }
        let turn = Turn { plane: self.plane, clockwise: code.number == 2, centre, extra_turns: turns - 1.0 };
        if !self.take_feed(out) {
            return;
        }
        let Some([x, y, z, e]) = self.target(out) else { return };
        match Arc::new(out.line, self.position(), Position { x, y, z, e }, self.feed(), turn) {
            Ok((arc, accurate)) => {
                if !accurate {
                    let [r0, r1] = arc.radii();
                    let message = format!(
                        "The arc's ends lie {r0:.3} and {r1:.3} mm from its centre; the radius is changed evenly on the way."
                    );
                    out.say(Warning, DiagnosticCode::InaccurateArc, code.columns(), message);
                }
                self.position = [x, y, z, e];
                out.act(Action::Arc(arc));
            }
            Err(error) => {
                let message = format!("{} The line is skipped; slice the file again.", arc_error(error));
                out.say(Error, DiagnosticCode::ImpossibleArc, code.columns(), message);
            }
        }
    }

    /// `G4`: `P` in milliseconds, `S` in seconds.
    fn dwell(&mut self, code: Code, out: &mut Out<'_>) {
        self.unused_words(bits(b"PS"), out);
        let milliseconds = self.words.get(b'P').map(|p| p / 1000.0);
        let Some(seconds) = self.words.get(b'S').or(milliseconds) else {
            return; // Marlin and Klipper: as long as nothing, after the moves so far.
        };
        if (0.0..=86_400.0).contains(&seconds) {
            out.act(Action::Dwell(Seconds(seconds)));
        } else {
            let message = "A dwell is from 0 s to one day. The line is skipped.";
            out.say(Error, DiagnosticCode::ValueOutOfRange, code.columns(), message);
        }
    }

    fn home(&mut self, out: &mut Out<'_>) {
        let [x, y, z] = [b'X', b'Y', b'Z'].map(|axis| self.words.has(axis));
        let all = !(x || y || z);
        out.act(Action::Home { x: x || all, y: y || all, z: z || all });
    }

    /// `G92`: the file calls the present position by other numbers; nothing moves.
    fn set_position(&mut self, axes: u32, out: &mut Out<'_>) {
        self.unused_words(axes, out);
        let all = self.words.present() & axes == 0;
        for (axis, &letter) in AXES.iter().enumerate() {
            let value = if all { Some(0.0) } else { self.words.get(letter) };
            if let Some(value) = value {
                self.offset[axis] = self.position[axis] - value * self.scale[axis];
            }
        }
    }

    /// `G10`: draws the filament back. The file's own E and Z stay as they are, so both offsets take part.
    fn retract(&mut self, code: Code, out: &mut Out<'_>) {
        if self.words.present() & bits(b"PLRXYZ") != 0 {
            let message = "`G10` with these words sets offsets or tool temperatures on other firmwares. The line would be \
                           skipped: write it another way, or confirm.";
            return out.say(Blocking, DiagnosticCode::UnsupportedCommand, code.columns(), message);
        }
        self.unused_words(bit(b'S'), out);
        if !self.retraction_known {
            self.retraction_known = true;
            let message = format!(
                "The printer's configuration has no firmware retraction: {} mm at {} mm/s are used. Add it there, or \
                 switch firmware retraction off in the slicer.",
                self.retraction.length, self.retraction.speed.0
            );
            out.say(Warning, DiagnosticCode::AssumedRetraction, code.columns(), message);
        }
        if self.retracted {
            return;
        }
        self.retracted = true;
        self.shift(3, -self.retraction.length, self.retraction.speed, out);
        self.hop = self.retraction.z_hop;
        if self.hop > 0.0 {
            self.shift(2, self.hop, self.feed(), out);
        }
    }

    /// `G11`: undoes `G10`.
    fn unretract(&mut self, out: &mut Out<'_>) {
        self.unused_words(bit(b'S'), out);
        if !self.retracted {
            return;
        }
        self.retracted = false;
        if self.hop > 0.0 {
            self.shift(2, -self.hop, self.feed(), out);
        }
        self.hop = 0.0;
        let FirmwareRetraction { length, extra_length, unretract_speed, .. } = self.retraction;
        self.shift(3, length + extra_length, unretract_speed, out);
    }

    /// Moves one axis behind the file's back.
    fn shift(&mut self, axis: usize, by: f64, feed: MmPerS, out: &mut Out<'_>) {
        let mut to = self.position;
        to[axis] += by;
        self.offset[axis] += by;
        self.push_move(to, feed, false, out);
    }

    /// Says which word of the line a command has no use for.
    #[inline]
    pub(super) fn unused_words(&self, known: u32, out: &mut Out<'_>) {
        if self.words.present() & !known == 0 {
            return;
        }
        if let Some(letter) = self.words.first_of(!known) {
            let message = format!("`{}` has no meaning here and is passed over.", char::from(letter));
            out.say(Warning, DiagnosticCode::UnusedWord, self.words.columns(letter), message);
        }
    }
}

fn arc_error(error: ArcError) -> String {
    match error {
        ArcError::NoRadius => "The arc's centre lies on its start.".into(),
        ArcError::RadiiDiffer(start, end) => {
            format!("The arc's start lies {start:.3} mm from its centre, but its end {end:.3} mm.")
        }
        ArcError::FullCircleByRadius => {
            "A full circle needs a centre (I, J, K): a radius fits many circles.".into()
        }
        ArcError::RadiusTooSmall => "The arc's ends are farther apart than its diameter.".into(),
        ArcError::RadiusTooLarge => "The arc's radius is beyond all measure.".into(),
    }
}
