//! What the page asks of a session.

use std::collections::BTreeSet;

use printer::{
    machine::EXTRUDER,
    session::{JobOptions, Request},
};
use serde::Deserialize;
use units::{Celsius, Mm, MmPerS};

use super::{HeaterName, TransformView};

/// An axis that can be jogged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
#[serde(rename_all = "lowercase")]
pub enum JogAxis {
    /// Across.
    X,
    /// Along.
    Y,
    /// Up.
    Z,
}

/// What the page may ask.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum UiRequest {
    /// Lines of G-code, typed by a user.
    Gcode {
        /// The lines.
        text: String,
    },
    /// A heater's target.
    SetTemperature {
        /// Which one.
        heater: HeaterName,
        /// 0 is off.
        target_c: f64,
    },
    /// The part fan's speed.
    SetFan {
        /// 0 … 1.
        speed: f64,
    },
    /// The speed of everything that is planned from now on.
    SetSpeedFactor {
        /// 1 is as written.
        factor: f64,
    },
    /// The extrusion of everything that is planned from now on.
    SetFlowFactor {
        /// 1 is as written.
        factor: f64,
    },
    /// Finds the endstops of these axes; none named means all.
    Home {
        /// Which ones.
        axes: Vec<JogAxis>,
    },
    /// Moves an axis from where it is. Modes and feed of what is typed stay as they are.
    Jog {
        /// Which one.
        axis: JogAxis,
        /// How far; negative is towards lower positions.
        distance_mm: f64,
        /// How fast.
        speed_mm_s: f64,
    },
    /// Pushes filament, or pulls it back.
    Extrude {
        /// How much; negative pulls it back.
        length_mm: f64,
        /// How fast.
        speed_mm_s: f64,
    },
    /// An axis stands there: the user says so, and it counts as homed.
    SetPosition {
        /// Which one.
        axis: JogAxis,
        /// Where.
        position_mm: f64,
    },
    /// Motors without current; positions are lost.
    MotorsOff,
    /// The job comes to rest and waits.
    Pause,
    /// The job goes on.
    Resume,
    /// The job comes to rest and ends; heaters and fan go off.
    Cancel,
    /// Everything stops at once.
    EmergencyStop,
    /// The board starts anew.
    FirmwareRestart,
}

impl From<UiRequest> for Request {
    fn from(request: UiRequest) -> Self {
        match request {
            UiRequest::Gcode { text } => Self::Gcode(text),
            UiRequest::SetTemperature { heater, target_c } => {
                Self::SetTemperature(heater.heater(), Celsius(target_c))
            }
            UiRequest::SetFan { speed } => Self::SetFan(speed),
            UiRequest::SetSpeedFactor { factor } => Self::SetSpeedFactor(factor),
            UiRequest::SetFlowFactor { factor } => Self::SetFlowFactor(factor),
            UiRequest::Home { axes } => {
                let words = axes.iter().flat_map(|axis| [' ', letter(*axis)]);
                Self::Gcode("G28".chars().chain(words).collect())
            }
            UiRequest::Jog { axis, distance_mm, speed_mm_s } => {
                let (distance, speed) = (Mm(distance_mm), MmPerS(speed_mm_s));
                Self::MoveBy { axis: axis as usize, distance, speed }
            }
            UiRequest::Extrude { length_mm, speed_mm_s } => {
                Self::MoveBy { axis: EXTRUDER, distance: Mm(length_mm), speed: MmPerS(speed_mm_s) }
            }
            UiRequest::SetPosition { axis, position_mm } => {
                Self::SetPosition { axis: axis as usize, position: Mm(position_mm) }
            }
            UiRequest::MotorsOff => Self::Gcode("M84".to_owned()),
            UiRequest::Pause => Self::Pause,
            UiRequest::Resume => Self::Resume,
            UiRequest::Cancel => Self::Cancel,
            UiRequest::EmergencyStop => Self::EmergencyStop,
            UiRequest::FirmwareRestart => Self::FirmwareRestart,
        }
    }
}

const fn letter(axis: JogAxis) -> char {
    match axis {
        JogAxis::X => 'X',
        JogAxis::Y => 'Y',
        JogAxis::Z => 'Z',
    }
}

/// What a job is started with.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
#[serde(deny_unknown_fields)]
pub struct JobRequest {
    /// Lines with something blocking in them that the user has confirmed: they are passed over.
    pub confirmed_lines: Vec<u32>,
    /// Confirm all of them.
    pub confirm_all: bool,
    /// The print's own number, with which a journal is kept: any that no other print has.
    #[serde(default)]
    pub journal: Option<u32>,
    /// The line with which the job begins, paused; `null`: with its file.
    #[serde(default)]
    pub start_line: Option<u32>,
    /// What makes up for skew and bed when the file begins (`InterruptionView.transform`, where a print goes on that was
    /// interrupted); left out: what is in force.
    #[serde(default)]
    #[cfg_attr(feature = "bindings", ts(optional))]
    pub transform: Option<TransformView>,
}

impl From<JobRequest> for JobOptions {
    fn from(request: JobRequest) -> Self {
        let confirmed_lines: BTreeSet<u32> = request.confirmed_lines.into_iter().collect();
        let JobRequest { confirm_all, journal, start_line, transform, .. } = request;
        Self { confirmed_lines, confirm_all, journal, start_line, transform: transform.map(Into::into) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gcode::Heater;

    fn request(json: &str) -> Request {
        serde_json::from_str::<UiRequest>(json).unwrap().into()
    }

    #[test]
    fn requests_are_read_as_the_page_writes_them() {
        assert_eq!(request(r#"{"type":"pause"}"#), Request::Pause);
        assert_eq!(request(r#"{"type":"emergency-stop"}"#), Request::EmergencyStop);
        assert_eq!(
            request(r#"{"type":"set-temperature","heater":"extruder","target_c":210}"#),
            Request::SetTemperature(Heater::Tool(0), Celsius(210.0))
        );
        assert_eq!(request(r#"{"type":"home","axes":["x","y"]}"#), Request::Gcode("G28 X Y".into()));
        assert_eq!(request(r#"{"type":"home","axes":[]}"#), Request::Gcode("G28".into()));
        assert_eq!(
            request(r#"{"type":"jog","axis":"z","distance_mm":-1e-1,"speed_mm_s":10}"#),
            Request::MoveBy { axis: 2, distance: Mm(-0.1), speed: MmPerS(10.0) }
        );
        assert_eq!(
            request(r#"{"type":"extrude","length_mm":-5,"speed_mm_s":3}"#),
            Request::MoveBy { axis: EXTRUDER, distance: Mm(-5.0), speed: MmPerS(3.0) }
        );
    }

    #[test]
    fn what_is_not_known_is_refused() {
        for json in [
            r#"{"type":"explode"}"#,
            r#"{"type":"jog","axis":"q","distance_mm":1,"speed_mm_s":1}"#,
            r#"{"type":"gcode","text":"G28","also":1}"#,
            r#"{"type":"set-fan"}"#,
            "pause",
            "",
        ] {
            assert!(serde_json::from_str::<UiRequest>(json).is_err(), "{json}");
        }
    }
}
