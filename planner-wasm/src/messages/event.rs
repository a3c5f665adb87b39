//! What a session tells.

use gcode::Heater;
use printer::session::{Event, PhaseName};
use serde::{Deserialize, Serialize};

use super::{ErrorMessage, Finding};

/// A heater, by its section in the machine file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
#[serde(rename_all = "snake_case")]
pub enum HeaterName {
    /// The nozzle.
    Extruder,
    /// The bed.
    HeaterBed,
}

impl HeaterName {
    /// The same, as the planner calls it.
    pub const fn heater(self) -> Heater {
        match self {
            Self::Extruder => Heater::Tool(0),
            Self::HeaterBed => Heater::Bed,
        }
    }

    /// `None` for heaters that no machine file can have yet.
    pub const fn of(heater: Heater) -> Option<Self> {
        match heater {
            Heater::Tool(0) => Some(Self::Extruder),
            Heater::Bed => Some(Self::HeaterBed),
            Heater::Tool(_) | Heater::Chamber => None,
        }
    }
}

/// How far a connection is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS), ts(rename = "Phase"))]
#[serde(rename_all = "kebab-case")]
pub enum PhaseLabel {
    /// The board's dictionary is being read.
    Identifying,
    /// The board's clock is being measured.
    Synchronising,
    /// The board is restarting.
    Restarting,
    /// The board's pins are being set up.
    Configuring,
    /// The board holds a print whose page is gone: it can be taken up with its journal, or the board restarted.
    Holding,
    /// Ready for commands.
    Ready,
    /// The board has stopped everything and says why; a firmware restart is needed.
    Shutdown,
    /// The connection is of no use any more.
    Failed,
}

impl From<PhaseName> for PhaseLabel {
    fn from(phase: PhaseName) -> Self {
        match phase {
            PhaseName::Identifying => Self::Identifying,
            PhaseName::Synchronising => Self::Synchronising,
            PhaseName::Restarting => Self::Restarting,
            PhaseName::Configuring => Self::Configuring,
            PhaseName::Holding => Self::Holding,
            PhaseName::Ready => Self::Ready,
            PhaseName::Shutdown => Self::Shutdown,
            PhaseName::Failed => Self::Failed,
        }
    }
}

/// What happened.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "bindings", derive(ts_rs::TS))]
#[serde(tag = "type", rename_all = "kebab-case")]
pub enum UiEvent {
    /// The phase of the connection changed.
    Phase {
        /// The new one.
        phase: PhaseLabel,
    },
    /// The board said who it is.
    Identified {
        /// Its firmware's version.
        version: String,
        /// Its chip.
        mcu: String,
        /// Its clock.
        clock_freq_hz: f64,
    },
    /// A heater's latest reading.
    Temperature {
        /// Which one.
        heater: HeaterName,
        /// What its sensor says.
        temperature_c: f64,
        /// What it should be; 0 is off.
        target_c: f64,
        /// The share of time that it is on.
        duty: f64,
        /// The board has lowered it, or switched it off, because it was out of touch with its host.
        standby: bool,
    },
    /// An axis found its endstop.
    Homed {
        /// 0, 1, 2 for X, Y, Z.
        axis: u8,
        /// Where it is now.
        position_mm: f64,
    },
    /// The job passed this line.
    Progress {
        /// The line of the last move that has been made.
        line: u32,
        /// Print time so far.
        elapsed_s: f64,
    },
    /// A text of the file or the firmware for the user.
    Message {
        /// The text.
        text: String,
    },
    /// Something in the G-code that the user should know of.
    Notice {
        /// What and where.
        finding: Finding,
    },
    /// The job was paused, and the machine is at rest.
    Paused,
    /// The board brought motion to rest on its path and waits for the user: to resume or to cancel.
    Held {
        /// Why.
        error: ErrorMessage,
    },
    /// The job, or what was held, goes on.
    Resumed,
    /// The job ended; all its moves have been made.
    JobDone,
    /// The job ended early because the user said so.
    JobCancelled,
    /// Something failed.
    Error {
        /// What.
        error: ErrorMessage,
    },
    /// Events were lost because nobody took them.
    Dropped {
        /// How many.
        count: u64,
    },
}

impl UiEvent {
    /// What the page is told of an event; `None` for what crosses as numbers (moves) or is in the preview (comments).
    pub fn of(event: &Event) -> Option<Self> {
        Some(match event {
            Event::Phase(phase) => Self::Phase { phase: (*phase).into() },
            Event::Identified { version, mcu, clock_freq } => {
                Self::Identified { version: version.clone(), mcu: mcu.clone(), clock_freq_hz: *clock_freq }
            }
            Event::Temperature { heater, temperature, target, duty, standby } => Self::Temperature {
                heater: HeaterName::of(*heater)?,
                temperature_c: temperature.0,
                target_c: target.0,
                duty: *duty,
                standby: *standby,
            },
            Event::Homed { axis, position_mm, .. } => {
                Self::Homed { axis: *axis as u8, position_mm: *position_mm }
            }
            Event::Progress { line, elapsed } => Self::Progress { line: *line, elapsed_s: elapsed.0 },
            Event::Message(text) => Self::Message { text: text.clone() },
            Event::Notice(diagnostic) => Self::Notice { finding: diagnostic.into() },
            Event::Paused => Self::Paused,
            Event::Held(error) => Self::Held { error: error.into() },
            Event::Resumed => Self::Resumed,
            Event::JobDone => Self::JobDone,
            Event::JobCancelled => Self::JobCancelled,
            Event::Error(error) => Self::Error { error: error.into() },
            Event::Dropped(count) => Self::Dropped { count: *count },
            Event::RunStarted { .. }
            | Event::Move(_)
            | Event::RunEnded { .. }
            | Event::RunBroken { .. }
            | Event::RunResumed { .. }
            | Event::Annotation(_)
            | Event::Object(_) => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use printer::error::{ErrorCode, PrinterError};
    use units::{Celsius, Seconds};

    #[test]
    fn events_carry_their_type_and_units() {
        let json = |event: &Event| serde_json::to_value(UiEvent::of(event)).unwrap();
        assert_eq!(
            json(&Event::Phase(PhaseName::Ready)),
            serde_json::json!({ "type": "phase", "phase": "ready" })
        );
        let reading = Event::Temperature {
            heater: Heater::Bed,
            temperature: Celsius(59.5),
            target: Celsius(60.0),
            duty: 0.25,
            standby: false,
        };
        let expected = serde_json::json!({
            "type": "temperature", "heater": "heater_bed", "temperature_c": 59.5, "target_c": 60.0, "duty": 0.25,
            "standby": false
        });
        assert_eq!(json(&reading), expected);
        let progress = json(&Event::Progress { line: 7, elapsed: Seconds(1.5) });
        assert_eq!(progress, serde_json::json!({ "type": "progress", "line": 7, "elapsed_s": 1.5 }));
        assert_eq!(json(&Event::JobDone), serde_json::json!({ "type": "job-done" }));
        let error = json(&Event::Error(PrinterError::from(ErrorCode::LinkLost)));
        assert_eq!(error["error"]["code"], "link-lost");
    }
}
