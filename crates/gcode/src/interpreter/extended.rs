//! Klipper's extended commands, `NAME KEY=VALUE …`, and macros.

use core::ops::Range;

use units::{Celsius, MmPerS, MmPerS2, Seconds};

use super::{Interpreter, Out, Said};
use crate::action::{
    Action, AxisShaper, Heater, InputShaper, MeshChange, ObjectAction, ObjectId, PauseReason, ShaperName,
    SkewChange, VelocityLimit, Wait,
};
use crate::annotation::text_of;
use crate::diagnostic::DiagnosticCode;
use crate::diagnostic::Severity::{Blocking, Error, Info};
use crate::number;

/// The most corners kept of an object's outline; slicers write convex hulls of some dozen.
const POLYGON_POINTS_MAX: usize = 1024;
/// The longest name of a command.
const NAME_BYTES_MAX: usize = 64;

/// Commands whose absence changes nothing in a print from this host: display, lights, cameras, sensors that are
/// not there. Sorted.
const HARMLESS: [&str; 11] = [
    "CLEAR_PAUSE",
    "SET_DISPLAY_GROUP",
    "SET_DISPLAY_TEXT",
    "SET_FILAMENT_SENSOR",
    "SET_IDLE_TIMEOUT",
    "SET_LED",
    "SET_LED_TEMPLATE",
    "SET_PRINT_STATS_INFO",
    "STATUS",
    "TIMELAPSE_RENDER",
    "TIMELAPSE_TAKE_FRAME",
];

/// One `KEY=VALUE`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parameter<'a> {
    key: &'a [u8],
    pub(super) value: &'a [u8],
    pub(super) start: usize,
    pub(super) end: usize,
}

impl Parameter<'_> {
    fn is(&self, key: &str) -> bool {
        self.key.eq_ignore_ascii_case(key.as_bytes())
    }

    fn number(&self) -> Option<f64> {
        number::read(self.value, 0).filter(|&(_, end)| end == self.value.len()).map(|(value, _)| value)
    }
}

/// The parameters of a line, or the place of something that is none.
struct Parameters<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Iterator for Parameters<'a> {
    type Item = Result<Parameter<'a>, Range<usize>>;

    fn next(&mut self) -> Option<Self::Item> {
        let bytes = self.bytes;
        while bytes.get(self.at).is_some_and(u8::is_ascii_whitespace) {
            self.at += 1;
        }
        let start = self.at;
        if matches!(bytes.get(start)?, b';' | b'#') {
            return None;
        }
        let word = bytes[start..].iter().take_while(|b| !b.is_ascii_whitespace() && **b != b'=').count();
        let equals = start + word;
        if word == 0 || bytes.get(equals) != Some(&b'=') {
            self.at = bytes.len();
            return Some(Err(start..equals.max(start + 1)));
        }
        let (value, end) = value_at(bytes, equals + 1);
        self.at = end;
        Some(Ok(Parameter { key: &bytes[start..equals], value, start, end }))
    }
}

/// A value up to a blank, or in quotes; and the place behind it.
fn value_at(bytes: &[u8], at: usize) -> (&[u8], usize) {
    if let Some(&quote @ (b'"' | b'\'')) = bytes.get(at) {
        let inner = &bytes[at + 1..];
        let length = memchr::memchr(quote, inner).unwrap_or(inner.len());
        return (&inner[..length], (at + length + 2).min(bytes.len()));
    }
    let length =
        bytes[at..].iter().take_while(|b| !b.is_ascii_whitespace() && !matches!(b, b';' | b'#')).count();
    (&bytes[at..at + length], at + length)
}

impl Interpreter {
    /// A line that begins with a name.
    #[cold]
    pub(super) fn extended(&mut self, bytes: &[u8], at: usize, out: &mut Out<'_>) {
        let length = bytes[at..].iter().take_while(|b| b.is_ascii_alphanumeric() || **b == b'_').count();
        let columns = at..at + length;
        let mut upper = [0; NAME_BYTES_MAX];
        let name = match upper.get_mut(..length) {
            Some(upper) => {
                upper.copy_from_slice(&bytes[columns.clone()]);
                upper.make_ascii_uppercase();
                core::str::from_utf8(upper).unwrap_or_default()
            }
            None => "",
        };
        if HARMLESS.binary_search(&name).is_ok() {
            return;
        }
        let parameters = Parameters { bytes, at: columns.end };
        let mut list = Vec::new();
        let mut malformed = None;
        for parameter in parameters {
            match parameter {
                Ok(parameter) => list.push(parameter),
                Err(place) => malformed = Some(place),
            }
        }
        if !is_known(name) {
            return unknown_macro(bytes, columns, out);
        }
        if let Some(place) = malformed {
            let message = "Parameters are written `KEY=VALUE`. The line is skipped.";
            return out.say(Error, DiagnosticCode::MalformedWord, place, message);
        }
        let call = Call { name, columns, list: &list };
        if let Ok(Some(action)) = self.call(&call, out) {
            out.act(action);
        }
    }

    fn call(&mut self, call: &Call<'_>, out: &mut Out<'_>) -> Result<Option<Action>, Said> {
        Ok(Some(match call.name {
            "SET_VELOCITY_LIMIT" => Action::VelocityLimit(self.velocity_limit(call, out)?),
            "SET_PRESSURE_ADVANCE" => Action::PressureAdvance {
                advance: call.number("ADVANCE", 0.0..=10.0, out)?,
                smooth_time: call.number("SMOOTH_TIME", 0.0..=0.2, out)?.map(Seconds),
            },
            "SET_INPUT_SHAPER" => Action::InputShaper(call.input_shaper(out)?),
            "EXCLUDE_OBJECT_DEFINE" => return Ok(call.define_object(out)?.map(Action::Object)),
            "EXCLUDE_OBJECT_START" => Action::Object(ObjectAction::Start(call.required_object(out)?)),
            "EXCLUDE_OBJECT_END" => Action::Object(ObjectAction::End(call.object())),
            "EXCLUDE_OBJECT" => {
                let reset = call.get("RESET").is_some_and(|p| p.value == b"1");
                let current = call.get("CURRENT").is_some_and(|p| p.value == b"1");
                match call.object() {
                    id if reset => Action::Object(ObjectAction::Restore(id)),
                    None if !current => return Ok(None), // A report.
                    id => Action::Object(ObjectAction::Cancel(id)),
                }
            }
            "SET_HEATER_TEMPERATURE" => Action::SetTemperature {
                heater: call.heater("HEATER", out)?,
                target: Celsius(call.number("TARGET", 0.0..=2000.0, out)?.unwrap_or(0.0)),
                wait: Wait::No,
            },
            "TEMPERATURE_WAIT" => Action::WaitForTemperature {
                heater: call.heater("SENSOR", out)?,
                minimum: call.number("MINIMUM", -273.15..=2000.0, out)?.map(Celsius),
                maximum: call.number("MAXIMUM", -273.15..=2000.0, out)?.map(Celsius),
            },
            "TURN_OFF_HEATERS" => Action::TurnOffHeaters,
            "ACTIVATE_EXTRUDER" => {
                let Heater::Tool(tool) = call.heater("EXTRUDER", out)? else { return Ok(None) };
                self.tool = tool;
                Action::SelectTool(tool)
            }
            "SET_SKEW" => Action::Skew(call.set_skew(out)?),
            "SKEW_PROFILE" => {
                return Ok(call
                    .profile("skew_correction", out)?
                    .map(|it| Action::Skew(SkewChange::Load(it))));
            }
            "GET_CURRENT_SKEW" => Action::Skew(SkewChange::Report),
            "CALC_MEASURED_SKEW" => Action::Skew(call.measured_skew(out)?),
            "BED_MESH_PROFILE" => {
                return Ok(call.profile("bed_mesh", out)?.map(|it| Action::BedMesh(MeshChange::Load(it))));
            }
            "BED_MESH_CLEAR" => Action::BedMesh(MeshChange::Clear),
            "BED_MESH_OUTPUT" => Action::BedMesh(MeshChange::Report),
            "BED_MESH_CALIBRATE" => return call.calibrate_mesh(out),
            "RESPOND" => Action::Message(call.get("MSG").map(|p| text_of(p.value)).unwrap_or_default()),
            "GET_POSITION" => Action::ReportPosition,
            "PAUSE" => Action::Pause(PauseReason::Requested),
            "CANCEL_PRINT" => Action::Cancel,
            _ => return Ok(None),
        }))
    }

    fn velocity_limit(&mut self, call: &Call<'_>, out: &mut Out<'_>) -> Result<VelocityLimit, Said> {
        let positive = f64::MIN_POSITIVE..=1e9;
        let velocity = call.number("VELOCITY", positive.clone(), out)?.map(MmPerS);
        let accel = call.number("ACCEL", positive.clone(), out)?;
        let square_corner_velocity = call.number("SQUARE_CORNER_VELOCITY", 0.0..=1e9, out)?.map(MmPerS);
        let mut minimum_cruise_ratio = call.number("MINIMUM_CRUISE_RATIO", 0.0..=0.999_999, out)?;
        self.accel = accel.or(self.accel);
        // What older Klippers had instead; Orca still writes it.
        if let Some(to_decel) = call.number("ACCEL_TO_DECEL", positive, out)? {
            match self.accel {
                Some(accel) => {
                    minimum_cruise_ratio =
                        minimum_cruise_ratio.or(Some((1.0 - to_decel / accel).clamp(0.0, 0.999_999)));
                }
                None => out.say(
                    Info,
                    DiagnosticCode::IgnoredSetting,
                    call.columns.clone(),
                    "ACCEL_TO_DECEL has no meaning before the first ACCEL and is passed over.",
                ),
            }
        }
        Ok(VelocityLimit {
            velocity,
            accel: accel.map(MmPerS2),
            square_corner_velocity,
            minimum_cruise_ratio,
        })
    }
}

fn is_known(name: &str) -> bool {
    const KNOWN: [&str; 23] = [
        "ACTIVATE_EXTRUDER",
        "BED_MESH_CALIBRATE",
        "BED_MESH_CLEAR",
        "BED_MESH_OUTPUT",
        "BED_MESH_PROFILE",
        "CALC_MEASURED_SKEW",
        "CANCEL_PRINT",
        "EXCLUDE_OBJECT",
        "EXCLUDE_OBJECT_DEFINE",
        "EXCLUDE_OBJECT_END",
        "EXCLUDE_OBJECT_START",
        "GET_CURRENT_SKEW",
        "GET_POSITION",
        "PAUSE",
        "RESPOND",
        "SET_HEATER_TEMPERATURE",
        "SET_INPUT_SHAPER",
        "SET_PRESSURE_ADVANCE",
        "SET_SKEW",
        "SET_VELOCITY_LIMIT",
        "SKEW_PROFILE",
        "TEMPERATURE_WAIT",
        "TURN_OFF_HEATERS",
    ];
    KNOWN.contains(&name)
}

/// A macro skipped in silence prints cold and un-homed: it blocks.
#[cold]
fn unknown_macro(bytes: &[u8], columns: Range<usize>, out: &mut Out<'_>) {
    let name = text_of(&bytes[columns.clone()]);
    let message = format!(
        "`{name}` is a macro or command of another firmware, not known here: it would be skipped, with whatever it heats, \
         homes or levels. Write plain commands (G28, M190, M109 …) into the slicer's start and end G-code, or confirm that \
         the print is right without it."
    );
    out.say(Blocking, DiagnosticCode::UnknownMacro, columns, message);
}

/// A known command with its parameters.
pub(super) struct Call<'a> {
    pub(super) name: &'a str,
    pub(super) columns: Range<usize>,
    list: &'a [Parameter<'a>],
}

impl Call<'_> {
    pub(super) fn get(&self, key: &str) -> Option<&Parameter<'_>> {
        self.list.iter().find(|p| p.is(key))
    }

    /// A parameter's number.
    fn number(
        &self,
        key: &str,
        range: core::ops::RangeInclusive<f64>,
        out: &mut Out<'_>,
    ) -> Result<Option<f64>, Said> {
        let Some(parameter) = self.get(key) else { return Ok(None) };
        match parameter.number() {
            Some(value) if range.contains(&value) => Ok(Some(value)),
            found => {
                let code = if found.is_some() {
                    DiagnosticCode::ValueOutOfRange
                } else {
                    DiagnosticCode::MalformedWord
                };
                let text = text_of(parameter.value);
                let message = format!("`{text}` is no value for {key}. The line is skipped.");
                out.say(Error, code, parameter.start..parameter.end, message);
                Err(Said)
            }
        }
    }

    /// `extruder`, `extruder1`, `heater_bed`.
    fn heater(&self, key: &str, out: &mut Out<'_>) -> Result<Heater, Said> {
        let parameter = self.required(key, out)?;
        match parameter.value {
            b"heater_bed" => return Ok(Heater::Bed),
            b"extruder" => return Ok(Heater::Tool(0)),
            other => {
                if let Some(rest) = other.strip_prefix(b"extruder")
                    && let (Some(tool), end) = super::digits(rest, 0)
                    && end == rest.len()
                {
                    return Ok(Heater::Tool(tool));
                }
            }
        }
        let message = format!(
            "`{}` is no heater that is known here. The line would be skipped: remove it, or confirm.",
            text_of(parameter.value)
        );
        out.say(Blocking, DiagnosticCode::UnsupportedCommand, parameter.start..parameter.end, message);
        Err(Said)
    }

    pub(super) fn required(&self, key: &str, out: &mut Out<'_>) -> Result<&Parameter<'_>, Said> {
        self.get(key).ok_or_else(|| {
            let message = format!("{} needs {key}=. The line is skipped; slice the file again.", self.name);
            out.say(Error, DiagnosticCode::MissingValue, self.columns.clone(), message);
            Said
        })
    }

    /// `SHAPER_TYPE` is for both axes, those of an axis go before it.
    fn input_shaper(&self, out: &mut Out<'_>) -> Result<InputShaper, Said> {
        let both = self.shaper_name("SHAPER_TYPE", out)?;
        let x = self.axis_shaper(["SHAPER_TYPE_X", "SHAPER_FREQ_X", "DAMPING_RATIO_X"], out)?;
        let y = self.axis_shaper(["SHAPER_TYPE_Y", "SHAPER_FREQ_Y", "DAMPING_RATIO_Y"], out)?;
        let [x, y] = [x, y].map(|axis| AxisShaper { kind: axis.kind.or(both), ..axis });
        Ok(InputShaper { x, y })
    }

    fn axis_shaper(&self, keys: [&str; 3], out: &mut Out<'_>) -> Result<AxisShaper, Said> {
        let kind = self.shaper_name(keys[0], out)?;
        // 0 is off; otherwise the lowest that a shaper can be made for.
        let frequency = match self.get(keys[1]).and_then(Parameter::number) {
            Some(0.0) => Some(0.0),
            _ => self.number(keys[1], 5.0..=1e3, out)?,
        };
        Ok(AxisShaper { kind, frequency, damping_ratio: self.number(keys[2], 0.0..=0.9, out)? })
    }

    fn shaper_name(&self, key: &str, out: &mut Out<'_>) -> Result<Option<ShaperName>, Said> {
        let Some(parameter) = self.get(key) else { return Ok(None) };
        let name = ShaperName::new(parameter.value);
        if name.is_none() {
            let text = text_of(parameter.value);
            let message = format!("`{text}` is no input shaper that is known here. The line is skipped.");
            out.say(Error, DiagnosticCode::ValueOutOfRange, parameter.start..parameter.end, message);
            return Err(Said);
        }
        Ok(name)
    }

    fn object(&self) -> Option<ObjectId> {
        self.get("NAME").map(object_id)
    }

    fn required_object(&self, out: &mut Out<'_>) -> Result<ObjectId, Said> {
        self.required("NAME", out).map(object_id)
    }

    fn define_object(&self, out: &mut Out<'_>) -> Result<Option<ObjectAction>, Said> {
        if self.get("RESET").is_some_and(|p| p.value == b"1") {
            return Ok(None);
        }
        let id = self.required_object(out)?;
        let centre = self.get("CENTER").and_then(|p| points(p.value).first().copied());
        let polygon = self.get("POLYGON").map(|p| points(p.value)).unwrap_or_default();
        Ok(Some(ObjectAction::Define { id, label: None, centre, polygon }))
    }
}

/// Whole, since names must stay distinct; the line's length bounds them.
fn object_id(parameter: &Parameter<'_>) -> ObjectId {
    ObjectId::Name(String::from_utf8_lossy(parameter.value).into_owned())
}

/// Pairs of numbers out of `1,2` or `[[1,2],[3,4]]`, up to what is none.
fn points(text: &[u8]) -> Vec<[f64; 2]> {
    let mut out = Vec::new();
    let mut first = None;
    let mut at = 0;
    while at < text.len() && out.len() < POLYGON_POINTS_MAX {
        if matches!(text[at], b'[' | b']' | b',' | b' ') {
            at += 1;
            continue;
        }
        let Some((value, end)) = number::read(text, at).filter(|(value, _)| value.is_finite()) else { break };
        at = end;
        match first.take() {
            None => first = Some(value),
            Some(first) => out.push([first, value]),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_list_of_harmless_commands_is_sorted() {
        assert!(super::HARMLESS.is_sorted());
    }
}
