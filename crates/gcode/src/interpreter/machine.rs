//! `M` and `T` commands: temperatures, fans, motors, limits, objects.

use units::{Celsius, Mm, MmPerS, MmPerS2};

use super::{Code, FACTOR_RANGE, INDEX_MAX, Interpreter, Out};
use crate::action::{
    Action, AxisValues, Heater, MachineLimits, ObjectAction, ObjectId, PauseReason, VelocityLimit, Wait,
};
use crate::annotation::text_of;
use crate::diagnostic::DiagnosticCode;
use crate::diagnostic::Severity::{Blocking, Error, Info};
use crate::words::{bit, bits};

/// Commands whose absence changes nothing in a print from this host: reports, power panic, progress, model checks, motors
/// on (they are whenever they move), sounds, lights, stored settings. Sorted.
const HARMLESS: [u32; 39] = [
    17, 20, 21, 22, 27, 31, 73, 75, 76, 77, 78, 85, 108, 111, 113, 115, 118, 119, 120, 121, 150, 155, 211,
    300, 355, 413, 415, 500, 501, 502, 503, 504, 555, 569, 575, 862, 863, 876, 928,
];

/// Settings of another firmware's insides: passed over, with a word.
const IGNORED: [u32; 9] = [92, 210, 301, 302, 304, 309, 570, 593, 851];

/// Targets beyond this are a mistake (tungsten would still be solid).
const CELSIUS_MAX: f64 = 2000.0;

impl Interpreter {
    #[allow(clippy::too_many_lines)] // A table, read from top to bottom.
    pub(super) fn m(&mut self, code: Code, bytes: &[u8], out: &mut Out<'_>) {
        // `M862.3 P "MK3S"`: texts that are no words.
        if HARMLESS.binary_search(&code.number).is_ok() {
            return;
        }
        if code.sub.is_some() {
            return self.unknown(code, bytes, out);
        }
        match code.number {
            0 | 1 | 25 | 226 | 601 => out.act(Action::Pause(PauseReason::Requested)),
            600 => out.act(Action::Pause(PauseReason::FilamentChange)),
            18 | 84 => self.with_words(code, bytes, u32::MAX, out, |it, out| it.motors_off(code, out)),
            82 => self.relative_e = false,
            83 => self.relative_e = true,
            104 => self.temperature(code, bytes, Wait::No, out),
            109 | 190 | 191 => self.temperature(code, bytes, Wait::UntilHeated, out),
            140 | 141 => self.temperature(code, bytes, Wait::No, out),
            105 => out.act(Action::ReportTemperatures),
            106 => self.with_words(code, bytes, 0, out, super::Interpreter::fan),
            107 => self.with_words(code, bytes, 0, out, |it, out| {
                if let Some(index) = it.index(b'P', out) {
                    out.act(Action::Fan { index: index.unwrap_or(0) as u8, speed: 0.0 });
                }
            }),
            110 => self.with_words(code, bytes, 0, out, |it, _| {
                if let Some(number) = it.words.get(b'N') {
                    it.last_number = Some(number as i64);
                }
            }),
            112 => out.act(Action::EmergencyStop),
            114 => out.act(Action::ReportPosition),
            117 => {
                let text = &bytes[code.end..memchr::memchr(b';', bytes).unwrap_or(bytes.len()).max(code.end)];
                out.act(Action::Message(text_of(text.trim_ascii())));
            }
            200 => self.with_words(code, bytes, 0, out, |it, out| it.volumetric(code, out)),
            201 | 203 | 205 => self.with_words(code, bytes, 0, out, |it, out| it.machine_limits(code, out)),
            204 => self.with_words(code, bytes, 0, out, |it, out| it.acceleration(code, out)),
            207 | 208 => self.with_words(code, bytes, 0, out, |it, out| it.retraction_settings(code, out)),
            209 => self.with_words(code, bytes, 0, out, |it, out| {
                if it.words.get(b'S').is_some_and(|s| s != 0.0) {
                    it.unknown(code, bytes, out);
                }
            }),
            220 => self.with_words(code, bytes, bits(b"BR"), out, super::Interpreter::speed_percent),
            221 => self.with_words(code, bytes, 0, out, super::Interpreter::flow_percent),
            400 => out.act(Action::WaitForMoves),
            486 => self.objects(code, bytes, out),
            572 => self.with_words(code, bytes, 0, out, |it, out| it.linear_advance(b'S', code, out)),
            900 => self.with_words(code, bytes, 0, out, |it, out| it.linear_advance(b'K', code, out)),
            number if IGNORED.contains(&number) => {
                let message = format!(
                    "M{number} sets up another firmware and is passed over: the printer's configuration counts."
                );
                out.say(Info, DiagnosticCode::IgnoredSetting, code.columns(), message);
            }
            _ => self.unknown(code, bytes, out),
        }
    }

    /// `T0`
    pub(super) fn t(&mut self, code: Code, bytes: &[u8], out: &mut Out<'_>) {
        if f64::from(code.number) > INDEX_MAX || code.sub.is_some() {
            return self.unknown(code, bytes, out);
        }
        self.with_words(code, bytes, 0, out, |it, out| {
            it.unused_words(0, out);
            it.tool = code.number;
            out.act(Action::SelectTool(code.number));
        });
    }

    /// A command that is not known may have been what heats or homes: it blocks.
    #[cold]
    pub(super) fn unknown(&mut self, code: Code, bytes: &[u8], out: &mut Out<'_>) {
        let name = String::from_utf8_lossy(&bytes[code.columns()]).into_owned();
        let message = format!(
            "`{name}` is not known here and would be skipped. Remove it from the slicer's custom G-code, or confirm that the \
             print is right without it."
        );
        out.say(Blocking, DiagnosticCode::UnknownCommand, code.columns(), message);
    }

    /// A letter's number where it is a count; the outer `None` says that it was wrong, the inner that there is none.
    fn index(&mut self, letter: u8, out: &mut Out<'_>) -> Option<Option<u32>> {
        let Some(value) = self.words.get(letter) else { return Some(None) };
        let max = if letter == b'P' { 255.0 } else { INDEX_MAX };
        if (0.0..=max).contains(&value) && value % 1.0 == 0.0 {
            return Some(Some(value as u32));
        }
        let letter_name = char::from(letter);
        let message = format!("`{letter_name}` must be a whole number from 0 to {max}. The line is skipped.");
        out.say(Error, DiagnosticCode::ValueOutOfRange, self.words.columns(letter), message);
        None
    }

    fn missing(code: Code, words: &str, out: &mut Out<'_>) {
        let message = format!("The command needs {words}. The line is skipped; slice the file again.");
        out.say(Error, DiagnosticCode::MissingValue, code.columns(), message);
    }

    fn temperature(&mut self, code: Code, bytes: &[u8], wait: Wait, out: &mut Out<'_>) {
        if !self.read_words(bytes, code, 0, out) {
            return;
        }
        let heater = match code.number {
            104 | 109 => match self.index(b'T', out) {
                Some(tool) => Heater::Tool(tool.unwrap_or(self.tool)),
                None => return,
            },
            140 | 190 => Heater::Bed,
            _ => Heater::Chamber,
        };
        let (letter, wait) = match (self.words.has(b'S'), self.words.has(b'R')) {
            (false, true) if wait == Wait::UntilHeated => (b'R', Wait::UntilReached),
            _ => (b'S', wait),
        };
        let Some(target) = self.words.get(letter) else {
            return Self::missing(code, "a temperature (S)", out);
        };
        if (0.0..=CELSIUS_MAX).contains(&target) {
            out.act(Action::SetTemperature { heater, target: Celsius(target), wait });
        } else {
            let message = format!(
                "{target} °C is no temperature for a printer. The line is skipped; slice the file again."
            );
            out.say(Error, DiagnosticCode::ValueOutOfRange, self.words.columns(letter), message);
        }
    }

    fn fan(&mut self, out: &mut Out<'_>) {
        let Some(index) = self.index(b'P', out) else { return };
        let speed = (self.words.get(b'S').unwrap_or(255.0) / 255.0).clamp(0.0, 1.0);
        out.act(Action::Fan { index: index.unwrap_or(0) as u8, speed });
    }

    fn motors_off(&mut self, code: Code, out: &mut Out<'_>) {
        let [x, y, z, e] = [b'X', b'Y', b'Z', b'E'].map(|axis| self.words.has(axis));
        if x || y || z || e {
            out.act(Action::MotorsOff { x, y, z, e });
        } else if self.words.has(b'S') {
            let message =
                "`S` sets an idle time-out, which the printer's configuration has. The motors stay on.";
            out.say(Info, DiagnosticCode::IgnoredSetting, code.columns(), message);
        } else {
            out.act(Action::MotorsOff { x: true, y: true, z: true, e: true });
        }
    }

    /// `M200`: only switching volumetric extrusion off can be done by doing nothing.
    fn volumetric(&mut self, code: Code, out: &mut Out<'_>) {
        let off = self.words.get(b'S') == Some(0.0) || self.words.get(b'D').unwrap_or(0.0) == 0.0;
        if !off {
            let message = "Volumetric extrusion is not available: far too much or too little would be fed. Switch it off in \
                           the slicer (`Use volumetric E`).";
            out.say(Error, DiagnosticCode::UnsupportedCommand, code.columns(), message);
        }
    }

    fn machine_limits(&mut self, code: Code, out: &mut Out<'_>) {
        let value = |letter| self.words.get(letter).filter(|&v| v > 0.0);
        let axes = AxisValues { x: value(b'X'), y: value(b'Y'), z: value(b'Z'), e: value(b'E') };
        let mut limits = MachineLimits::default();
        match code.number {
            201 => limits.accel_mm_s2 = axes,
            203 => limits.velocity_mm_s = axes,
            _ => {
                limits.jerk_mm_s = axes;
                limits.junction_deviation = value(b'J').map(Mm);
            }
        }
        if limits != MachineLimits::default() {
            out.act(Action::MachineLimits(Box::new(limits)));
        }
    }

    /// `M204`: `S`, else the smaller of printing (`P`) and travel (`T`), as Klipper does.
    fn acceleration(&mut self, code: Code, out: &mut Out<'_>) {
        let [s, p, t] = [b'S', b'P', b'T'].map(|letter| self.words.get(letter));
        let accel = match (s, p, t) {
            (Some(s), _, _) => s,
            (None, Some(p), Some(t)) => p.min(t),
            (None, Some(one), None) | (None, None, Some(one)) => one,
            // Retracts (`R`) have limits of their own.
            (None, None, None) if self.words.has(b'R') => return,
            (None, None, None) => return Self::missing(code, "an acceleration (S, or P and T)", out),
        };
        if accel > 0.0 {
            self.accel = Some(accel);
            out.act(Action::VelocityLimit(VelocityLimit {
                accel: Some(MmPerS2(accel)),
                ..VelocityLimit::default()
            }));
        } else {
            let message = "An acceleration must be greater than 0. The line is skipped.";
            out.say(Error, DiagnosticCode::ValueOutOfRange, code.columns(), message);
        }
    }

    /// `M207` sets retracting, `M208` feeding again.
    fn retraction_settings(&mut self, code: Code, out: &mut Out<'_>) {
        let scale = self.scale[0];
        let word = |letter| self.words.get(letter).map(|value| value * scale);
        let (length, feed, hop) = (word(b'S'), word(b'F'), word(b'Z'));
        let sane = length.is_none_or(|l| (0.0..=100.0).contains(&l))
            && feed.is_none_or(|f| f > 0.0)
            && hop.is_none_or(|h| (0.0..=100.0).contains(&h));
        if !sane || self.retracted {
            let message = if sane {
                "Retraction cannot be changed between `G10` and `G11`. The line is skipped."
            } else {
                "Lengths are from 0 to 100 mm, feeds greater than 0. The line is skipped."
            };
            return out.say(Error, DiagnosticCode::ValueOutOfRange, code.columns(), message);
        }
        let retraction = &mut self.retraction;
        if code.number == 207 {
            self.retraction_known |= length.is_some();
            retraction.length = length.unwrap_or(retraction.length);
            retraction.speed = feed.map_or(retraction.speed, |f| MmPerS(f / 60.0));
            retraction.z_hop = hop.unwrap_or(retraction.z_hop);
        } else {
            retraction.extra_length = length.unwrap_or(retraction.extra_length);
            retraction.unretract_speed = feed.map_or(retraction.unretract_speed, |f| MmPerS(f / 60.0));
        }
    }

    /// A factor from `S` in per cent.
    fn percent(&mut self, out: &mut Out<'_>) -> Option<f64> {
        let factor = self.words.get(b'S')? / 100.0;
        if FACTOR_RANGE.contains(&factor) {
            return Some(factor);
        }
        let message = "A factor is from 1 to 1000 per cent. The line is skipped.";
        out.say(Error, DiagnosticCode::ValueOutOfRange, self.words.columns(b'S'), message);
        None
    }

    fn speed_percent(&mut self, out: &mut Out<'_>) {
        if self.words.has(b'B') {
            self.stored_speed_factor = self.speed_factor;
        }
        let restored = self.words.has(b'R').then_some(self.stored_speed_factor);
        if let Some(factor) = restored.or_else(|| self.percent(out)) {
            self.set_speed_factor(factor);
            out.act(Action::SpeedFactor(self.speed_factor));
        }
    }

    fn flow_percent(&mut self, out: &mut Out<'_>) {
        if let Some(factor) = self.percent(out) {
            self.set_flow_factor(factor);
            out.act(Action::FlowFactor(self.flow_factor));
        }
    }

    /// `M900 K` (Marlin) and `M572 S` (`RepRapFirmware`) in seconds, as pressure advance is.
    fn linear_advance(&mut self, letter: u8, code: Code, out: &mut Out<'_>) {
        match self.words.get(letter) {
            Some(advance) if (0.0..=2.0).contains(&advance) => {
                out.act(Action::PressureAdvance { advance: Some(advance), smooth_time: None });
            }
            Some(_) => {
                let message = "This value belongs to another kind of pressure advance (Marlin's 1.0) and is passed over.";
                out.say(Info, DiagnosticCode::IgnoredSetting, code.columns(), message);
            }
            None => {}
        }
    }

    /// `M486`: `T` count, `S` start (−1: none), `A` label, `P` and `C` cancel, `U` restore.
    fn objects(&mut self, code: Code, bytes: &[u8], out: &mut Out<'_>) {
        // The label is text to the end of the line, or in quotes: cut it off before reading words.
        let mut label = None;
        let mut end = memchr::memchr(b';', bytes).unwrap_or(bytes.len());
        if let Some(at) = bytes[code.end..end].iter().position(|b| b.eq_ignore_ascii_case(&b'A')) {
            let text = bytes[code.end + at + 1..end].trim_ascii();
            let text = text
                .strip_prefix(b"\"")
                .map_or(text, |text| text.split(|&b| b == b'"').next().unwrap_or(text));
            label = Some(text_of(text));
            end = code.end + at;
        }
        if !self.read_words(&bytes[..end], code, bit(b'C'), out) {
            return;
        }
        let started = match self.words.get(b'S') {
            Some(value) if value < 0.0 => {
                out.act(Action::Object(ObjectAction::End(None)));
                None
            }
            _ => match self.index(b'S', out) {
                Some(started) => started,
                None => return,
            },
        };
        if let (Some(index), Some(_)) = (started, &label) {
            let id = ObjectId::Index(index);
            out.act(Action::Object(ObjectAction::Define { id, label, centre: None, polygon: Vec::new() }));
        }
        if let Some(index) = started {
            out.act(Action::Object(ObjectAction::Start(ObjectId::Index(index))));
        }
        let count = self.index(b'T', out).flatten().map(ObjectAction::Count);
        let cancel = self.index(b'P', out).flatten().map(|i| ObjectAction::Cancel(Some(ObjectId::Index(i))));
        let current = self.words.has(b'C').then_some(ObjectAction::Cancel(None));
        let restore =
            self.index(b'U', out).flatten().map(|i| ObjectAction::Restore(Some(ObjectId::Index(i))));
        for action in [count, cancel, current, restore].into_iter().flatten() {
            out.act(Action::Object(action));
        }
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_list_of_harmless_commands_is_sorted() {
        assert!(super::HARMLESS.is_sorted());
    }
}
