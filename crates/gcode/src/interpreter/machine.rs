//! `M` and `T` commands: temperatures, fans, motors, limits, objects.

use units::{Celsius, Mm, MmPerS, MmPerS2};

use super::{Code, FACTOR_RANGE, INDEX_MAX, Interpreter, Out, Said, unknown};
use crate::action::{
    Action, AxisValues, Heater, MachineLimits, ObjectAction, ObjectId, PauseReason, VelocityLimit, Wait,
};
use crate::annotation::text_of;
use crate::diagnostic::DiagnosticCode;
use crate::diagnostic::Severity::{Blocking, Error, Info};
use crate::words::{bit, bits};

/// Commands whose absence changes nothing in a print from this host: motors on (they are whenever they move), card,
/// progress and timers, model checks, reports, sensors that are not there, sounds, lights, stored settings. Sorted.
const HARMLESS: [u32; 35] = [
    17, 20, 21, 22, 27, 31, 73, 74, 75, 76, 77, 78, 85, 108, 111, 113, 115, 118, 119, 145, 149, 150, 155,
    211, 300, 355, 412, 413, 500, 501, 502, 503, 555, 862, 876,
];

/// Settings of another firmware's insides (steps, PID, currents, shapers, jerk): passed over, with a word. Sorted.
const IGNORED: [u32; 18] =
    [92, 301, 302, 304, 309, 350, 566, 569, 570, 593, 851, 906, 907, 908, 911, 913, 914, 915];

/// Targets beyond this are a mistake (tungsten would still be solid).
const CELSIUS_MAX: f64 = 2000.0;

impl Interpreter {
    pub(super) fn m(&mut self, code: Code, bytes: &[u8], out: &mut Out<'_>) {
        // Not even their words are read: `M862.3 P "MK3S"` has texts.
        if HARMLESS.binary_search(&code.number).is_ok() {
            return;
        }
        if code.sub.is_some() {
            return unknown(code, bytes, out);
        }
        match code.number {
            0 | 1 | 25 | 226 | 601 => out.act(Action::Pause(PauseReason::Requested)),
            600 => out.act(Action::Pause(PauseReason::FilamentChange)),
            18 | 84 => self.with_words(code, bytes, u32::MAX, out, |it, out| it.motors_off(code, out)),
            82 | 83 => self.with_words(code, bytes, 0, out, |it, out| {
                it.unused_words(0, out);
                it.relative_e = code.number == 83;
            }),
            104 | 140 | 141 => self.temperature(code, bytes, Wait::No, out),
            109 | 190 | 191 => self.temperature(code, bytes, Wait::UntilHeated, out),
            105 => out.act(Action::ReportTemperatures),
            106 | 107 => self.with_words(code, bytes, 0, out, |it, out| it.fan(code, out)),
            110 => self.with_words(code, bytes, 0, out, |it, _| {
                it.last_number = it.words.get(b'N').map_or(it.last_number, |number| Some(number as i64));
            }),
            112 => out.act(Action::EmergencyStop),
            114 => out.act(Action::ReportPosition),
            117 => {
                let end = memchr::memchr(b';', bytes).unwrap_or(bytes.len());
                out.act(Action::Message(text_of(bytes[code.end..end.max(code.end)].trim_ascii())));
            }
            400 => self.with_words(code, bytes, 0, out, |it, out| {
                it.unused_words(0, out);
                out.act(Action::WaitForMoves);
            }),
            486 => self.objects(code, bytes, out),
            _ => self.m_setting(code, bytes, out),
        }
    }

    fn m_setting(&mut self, code: Code, bytes: &[u8], out: &mut Out<'_>) {
        let then: fn(&mut Self, Code, &mut Out<'_>) = match code.number {
            200 => Self::volumetric,
            201 | 203 | 205 => Self::machine_limits,
            204 => Self::acceleration,
            207 | 208 => Self::retraction_settings,
            209 => Self::automatic_retraction,
            220 => Self::speed_percent,
            221 => Self::flow_percent,
            572 | 900 => Self::linear_advance,
            number if IGNORED.binary_search(&number).is_ok() => {
                let message = format!(
                    "M{number} sets up another firmware and is passed over: the printer's configuration counts."
                );
                return out.say(Info, DiagnosticCode::IgnoredSetting, code.columns(), message);
            }
            _ => return unknown(code, bytes, out),
        };
        let bare_allowed = if code.number == 220 { bits(b"BR") } else { 0 };
        self.with_words(code, bytes, bare_allowed, out, |it, out| then(it, code, out));
    }

    /// `T0`
    pub(super) fn t(&mut self, code: Code, bytes: &[u8], out: &mut Out<'_>) {
        if f64::from(code.number) > INDEX_MAX || code.sub.is_some() {
            return unknown(code, bytes, out);
        }
        self.with_words(code, bytes, 0, out, |it, out| {
            it.unused_words(0, out);
            it.tool = code.number;
            out.act(Action::SelectTool(code.number));
        });
    }

    /// A letter's number where it is a count.
    fn index(&self, letter: u8, out: &mut Out<'_>) -> Result<Option<u32>, Said> {
        let Some(value) = self.words.get(letter) else { return Ok(None) };
        if (0.0..=INDEX_MAX).contains(&value) && value % 1.0 == 0.0 {
            return Ok(Some(value as u32));
        }
        let name = char::from(letter);
        let message = format!("`{name}` must be a whole number from 0 to {INDEX_MAX}. The line is skipped.");
        out.say(Error, DiagnosticCode::ValueOutOfRange, self.words.columns(letter), message);
        Err(Said)
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
                Ok(tool) => Heater::Tool(tool.unwrap_or(self.tool)),
                Err(Said) => return,
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

    fn fan(&mut self, code: Code, out: &mut Out<'_>) {
        let Ok(index) = self.index(b'P', out) else { return };
        let Ok(index) = u8::try_from(index.unwrap_or(0)) else {
            let message = "No printer has so many fans. The line is skipped; slice the file again.";
            return out.say(Error, DiagnosticCode::ValueOutOfRange, self.words.columns(b'P'), message);
        };
        let on = if code.number == 106 { 1.0 } else { 0.0 };
        let speed = on * (self.words.get(b'S').unwrap_or(255.0) / 255.0).clamp(0.0, 1.0);
        out.act(Action::Fan { index, speed });
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
        let on = self.words.get(b'S').or(self.words.get(b'D')).is_some_and(|value| value != 0.0);
        if on {
            let message = "Volumetric extrusion is not available: far too much or too little would be fed. Switch it off in \
                           the slicer (`Use volumetric E`).";
            out.say(Error, DiagnosticCode::UnsupportedCommand, code.columns(), message);
        }
    }

    /// `M209`: only switching it off can be done by doing nothing.
    fn automatic_retraction(&mut self, code: Code, out: &mut Out<'_>) {
        if self.words.get(b'S').is_some_and(|s| s != 0.0) {
            let message = "Automatic retraction is not available. Let the slicer retract, or confirm that the print is right \
                           without it.";
            out.say(Blocking, DiagnosticCode::UnsupportedCommand, code.columns(), message);
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

    fn speed_percent(&mut self, _: Code, out: &mut Out<'_>) {
        if self.words.has(b'B') {
            self.stored_speed_factor = self.speed_factor;
        }
        let restored = self.words.has(b'R').then_some(self.stored_speed_factor);
        if let Some(factor) = restored.or_else(|| self.percent(out)) {
            self.set_speed_factor(factor);
            out.act(Action::SpeedFactor(self.speed_factor));
        }
    }

    fn flow_percent(&mut self, _: Code, out: &mut Out<'_>) {
        if let Some(factor) = self.percent(out) {
            self.set_flow_factor(factor);
            out.act(Action::FlowFactor(self.flow_factor));
        }
    }

    /// `M900 K` (Marlin) and `M572 S` (`RepRapFirmware`) in seconds, as pressure advance is.
    fn linear_advance(&mut self, code: Code, out: &mut Out<'_>) {
        let letter = if code.number == 572 { b'S' } else { b'K' };
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
        if let Ok(list) = self.object_actions(label, out) {
            list.into_iter().flatten().for_each(|action| out.act(Action::Object(action)));
        }
    }

    fn object_actions(
        &mut self,
        label: Option<String>,
        out: &mut Out<'_>,
    ) -> Result<[Option<ObjectAction>; 6], Said> {
        let by_index = |index: Option<u32>| index.map(ObjectId::Index);
        let none_starts = self.words.get(b'S').is_some_and(|value| value < 0.0);
        let started = if none_starts { None } else { self.index(b'S', out)? };
        if none_starts || started.is_some() {
            self.object = started;
        }
        // A label alone is that of the object in hand.
        let define = by_index(self.object).filter(|_| label.is_some()).map(|id| ObjectAction::Define {
            id,
            label,
            centre: None,
            polygon: Vec::new(),
        });
        let start = if none_starts {
            Some(ObjectAction::End(None))
        } else {
            by_index(started).map(ObjectAction::Start)
        };
        let count = self.index(b'T', out)?.map(ObjectAction::Count);
        let cancel = by_index(self.index(b'P', out)?).map(|id| ObjectAction::Cancel(Some(id)));
        let current = self.words.has(b'C').then_some(ObjectAction::Cancel(None));
        let restore = by_index(self.index(b'U', out)?).map(|id| ObjectAction::Restore(Some(id)));
        Ok([count, define, start, cancel, current, restore])
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_lists_of_commands_are_sorted() {
        assert!(super::HARMLESS.is_sorted() && super::IGNORED.is_sorted());
    }
}
