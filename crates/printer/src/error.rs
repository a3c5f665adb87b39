//! The one catalogue of everything that can go wrong: what happened, what is safe now, what to do.
//!
//! Knows nothing of where errors come from or how they are shown. The codes are stable and travel to the page;
//! the texts are for the user, who stands beside a hot machine and wants to know whether to run.

use wire::ShutdownReason;

macro_rules! catalogue {
    ($($name:ident, $code:literal: $happened:literal, $safe:expr, $todo:literal;)*) => {
        /// What went wrong, as a stable code.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
        #[non_exhaustive]
        pub enum ErrorCode {
            $(
                #[doc = $happened]
                #[serde(rename = $code)]
                $name,
            )*
        }

        impl ErrorCode {
            /// Every code, for tables and tests.
            pub const ALL: &'static [Self] = &[$(Self::$name,)*];

            /// The stable name, as in JSON.
            pub const fn as_str(self) -> &'static str {
                match self { $(Self::$name => $code,)* }
            }

            /// One sentence, without its full stop: what happened.
            pub const fn what_happened(self) -> &'static str {
                match self { $(Self::$name => $happened,)* }
            }

            /// What the machine does now and what is not in danger.
            pub const fn what_is_safe(self) -> &'static str {
                match self { $(Self::$name => $safe,)* }
            }

            /// What the user should do.
            pub const fn what_to_do(self) -> &'static str {
                match self { $(Self::$name => $todo,)* }
            }
        }
    };
}

/// The board is in shutdown.
const ALL_STOPPED: &str =
    "The board has stopped every motor and switched every heater off. The print cannot go on from here.";
/// The host found it before or while printing and shut the board down.
const STOPPED_BY_HOST: &str =
    "The board was told to stop: motors do not move and heaters are off. The print cannot go on from here.";
/// The board or the host stopped it, whoever saw it first.
const STOPPED: &str =
    "Everything was stopped: motors do not move and heaters are off. The print cannot go on from here.";
/// Refused before anything happened.
const NOTHING_MOVED: &str = "Nothing was sent to the printer: it did not move and no heater was switched on.";
/// One command refused in a running session.
const REFUSED: &str =
    "The command was not carried out. The printer waits where it was, its heaters as they were.";
/// An axis could not be homed.
const AXIS_STOPPED: &str =
    "The axis stands still, and its position is not known until it is homed. Heaters stay as they were.";
/// A job that ran has come to its end.
const JOB_ENDED: &str = "The print has ended: the moves before that place were made, the motors stand still, the heaters \
                         and the fan are off.";
/// The board holds its motion.
const HELD: &str = "The head rests on its path, no step was lost and the position is known. The board goes \
                    on watching the heaters; those that it has lowered to stand-by are heated again before anything \
                    goes on, which nothing does by itself.";
/// Contact is gone, so nothing can be claimed but what the board does by itself.
const ON_ITS_OWN: &str = "The printer is on its own: after a few seconds without orders its board switches the \
                          heaters off, or keeps them at stand-by for a while and then switches them off. Its motion \
                          comes to rest; it may have lost its position.";

catalogue! {
    SensorBelowMin, "sensor-below-min":
        "A temperature sensor reads below its min_temp, as a broken or unplugged sensor does", STOPPED_BY_HOST,
        "Let the printer cool, check the sensor's cable and plug, and that sensor_type and min_temp in printer.cfg are right. Then restart the board.";
    SensorAboveMax, "sensor-above-max":
        "A temperature sensor reads above its max_temp: its wires touch, or the heater cannot be switched off", STOPPED_BY_HOST,
        "If anything still gets hotter, cut the printer's mains power now. Then check the sensor's cable and the heater's output. Restart the board only when it is cold.";
    HeaterNotHeating, "heater-not-heating":
        "A heater was switched on but did not get warmer", STOPPED,
        "Check that the heater is connected and powered, and that its sensor sits firmly in the heater block or bed. Then restart the board.";
    HeaterDrifted, "heater-drifted":
        "A heater does not reach or hold its temperature although it is being heated", STOPPED,
        "Check that the sensor has not come loose, that the heater's wires are sound, and that no fan blows at the block. Then restart the board.";
    TargetOutOfRange, "target-out-of-range":
        "A temperature outside the heater's limits was asked for", REFUSED,
        "Correct the temperature in the slicer, or min_temp and max_temp in printer.cfg if the hardware allows more.";
    NoSuchHeater, "no-such-heater":
        "The file heats something that this printer does not have", REFUSED,
        "Slice for this printer, or add the heater to printer.cfg.";
    NoSuchProfile, "no-such-profile":
        "A line loads a skew or a bed mesh that cannot be had", REFUSED,
        "Write that section into printer.cfg, or take the line out of the slicer's start G-code.";
    ColdExtrusion, "cold-extrusion":
        "Filament was to be pushed through a nozzle below min_extrude_temp", REFUSED,
        "Heat the nozzle first (M109 before the first extrusion). Lower min_extrude_temp only for materials that melt colder.";
    ExtrusionTooLong, "extrusion-too-long":
        "More filament was to be pushed or pulled back in one move than max_extrude_only_distance allows", REFUSED,
        "Check that the file uses relative or absolute extrusion as it says (M82, M83); if the length is meant, raise max_extrude_only_distance.";
    ExtrusionTooThick, "extrusion-too-thick":
        "A move extrudes more than max_extrude_cross_section allows", REFUSED,
        "Check the filament diameter and the extrusion mode (M82, M83) in the slicer; if the amount is meant, raise max_extrude_cross_section.";
    MoveOutOfRange, "move-out-of-range":
        "A move leaves the range of the machine", REFUSED,
        "Slice for this printer's bed size, or correct position_min and position_max in printer.cfg.";
    NotHomed, "not-homed":
        "A move was asked for before the machine was homed", REFUSED,
        "Home first (G28); a file from a slicer needs G28 in its start G-code.";
    EndstopNotReached, "endstop-not-reached":
        "The endstop did not trigger over the whole homing travel", AXIS_STOPPED,
        "Check that the axis moves and moves towards its endstop, that the switch clicks and is plugged in, and that endstop_pin is right.";
    EndstopStillTriggered, "endstop-still-triggered":
        "The endstop is still triggered after moving away from it", AXIS_STOPPED,
        "Check the switch and its cable, whether endstop_pin needs a `!` or a `^`, and that the motor moves away from the switch.";
    EndstopBeforeMove, "endstop-before-move":
        "The endstop triggered before the axis had moved at all", AXIS_STOPPED,
        "Check whether endstop_pin needs a `!`, and that the switch is not held down by something.";
    HomingTimeout, "homing-timeout":
        "The connection was too slow to watch the endstop, so the board stopped the homing move", AXIS_STOPPED,
        "Connect the printer directly, without a hub, close other heavy programs, and home again.";
    StepRateTooHigh, "step-rate-too-high":
        "A move is so fast that a motor would have to step more often than any driver can", REFUSED,
        "Lower max_velocity or max_extrude_only_velocity in printer.cfg, or use fewer microsteps or a larger rotation_distance.";
    UnknownCommand, "unknown-command":
        "The file has a command or macro that this program does not know", NOTHING_MOVED,
        "Check what the line should do. If the print is right without it, confirm that line; otherwise put plain G-code in its place in the slicer's start or end G-code.";
    InvalidGcode, "invalid-gcode":
        "A line of the file cannot be read as G-code", NOTHING_MOVED,
        "Slice and export the file again; if a script changed it, correct that line.";
    FileEmpty, "file-empty":
        "The file has no moves in it", NOTHING_MOVED,
        "Export the G-code again and wait until the slicer has finished writing.";
    FileBinary, "file-binary":
        "The file is not plain G-code", NOTHING_MOVED,
        "Export plain G-code (.gcode) from the slicer; in PrusaSlicer switch off \"binary G-code\" in the printer settings.";
    FileCutOff, "file-cut-off":
        "The file ends in the middle", NOTHING_MOVED,
        "Copy or export the file again: the last part is missing.";
    FileUnreadable, "file-unreadable":
        "The file could not be read to its end",
        "The moves sent so far are carried out, then the printer stops with its position known and its heaters as they were.",
        "Make the file readable again (disk, network drive, permission), then decide whether to cancel the print.";
    ConfigInvalid, "config-invalid":
        "The printer.cfg has errors", NOTHING_MOVED,
        "Correct the lines listed and load the file again.";
    ConfigUnsupported, "config-unsupported":
        "The printer.cfg asks for something that is not supported yet", NOTHING_MOVED,
        "Take the section out if the machine works without it; otherwise print with its own software for now.";
    PinUnknown, "pin-unknown":
        "The printer.cfg names a pin that this board does not have", NOTHING_MOVED,
        "Check that the right printer.cfg is loaded for this board, and correct the pin on that line.";
    BoardSilent, "board-silent":
        "The board does not answer", NOTHING_MOVED,
        "Check that the printer has power, that this is its port and its baud rate, and that it runs Klipper-compatible firmware.";
    WrongFirmware, "wrong-firmware":
        "The board answers, but not as Klipper-compatible firmware does", NOTHING_MOVED,
        "Flash Klipper-compatible firmware, or connect with a program that speaks this board's language.";
    BoardUnreadable, "board-unreadable":
        "The board answers, but nothing that can be read", NOTHING_MOVED,
        "The baud rate is probably wrong: take the one that the firmware was built with (250000 and 115200 are common). Otherwise use a shorter cable without a hub.";
    DictionaryInvalid, "dictionary-invalid":
        "The board's description of itself cannot be read", NOTHING_MOVED,
        "Connect again; if it stays so, flash the firmware again.";
    DictionaryIncomplete, "dictionary-incomplete":
        "The board's firmware lacks a command that this printer needs", NOTHING_MOVED,
        "Flash a newer firmware, or one built with that feature.";
    ConfigMismatch, "config-mismatch":
        "The board is already configured for another printer.cfg", NOTHING_MOVED,
        "Restart the board (it forgets its configuration), then connect again.";
    BoardTooSmall, "board-too-small":
        "The board has not enough memory for this printer.cfg", NOTHING_MOVED,
        "Take parts out of printer.cfg, or use a board with more memory.";
    LinkLost, "link-lost":
        "The connection to the printer broke", ON_ITS_OWN,
        "Check cable and power, connect again, and home before anything else.";
    LinkTimeout, "link-timeout":
        "The board stopped answering", ON_ITS_OWN,
        "If the printer still heats or moves, cut its power. Check the cable, connect again, and home before anything else.";
    ClockLost, "clock-lost":
        "The board's clock cannot be followed: its answers come too irregularly", STOPPED_BY_HOST,
        "Connect without a hub or adapter; if it stays so, the board's crystal or firmware is faulty.";
    BoardRestarted, "board-restarted":
        "The board restarted by itself",
        "A board that starts has its heaters off and its motors still. Its position is lost, the print cannot go on from here.",
        "Check the printer's power supply and for short circuits; home before anything else.";
    QueueStarved, "queue-starved":
        "The moves did not reach the board in time, so the motors stopped in the middle", STOPPED_BY_HOST,
        "Close other heavy programs, keep the page open, connect without a hub. Home before printing again.";
    QueueOverflow, "queue-overflow":
        "The board ran out of room for moves", ALL_STOPPED,
        "This is a fault of this program or of the firmware: please report it with the session's log.";
    EmergencyStop, "emergency-stop":
        "The emergency stop was asked for", STOPPED_BY_HOST,
        "When the reason is dealt with, restart the board and home.";
    BoardTooSlow, "board-too-slow":
        "The board could not keep up with its moves", ALL_STOPPED,
        "Lower max_velocity or microsteps in printer.cfg, then restart the board and home.";
    OrdersTooLate, "orders-too-late":
        "Orders reached the board too late", ALL_STOPPED,
        "Close other heavy programs, keep the page open, connect without a hub. Then restart the board and home.";
    HeaterUnattended, "heater-unattended":
        "The board had no orders for a heater in time and switched everything off, as it should", ALL_STOPPED,
        "Keep the page open and the computer awake, connect without a hub. Then restart the board and home.";
    BoardSensorRange, "board-sensor-range":
        "The board measured a temperature outside min_temp to max_temp", ALL_STOPPED,
        "If anything still gets hotter, cut the printer's mains power. Let it cool, check the sensor's cable and plug, then restart the board.";
    ProtocolFault, "protocol-fault":
        "The board got a message that it could not understand or carry out", ALL_STOPPED,
        "Restart the board and connect again. If it happens again, please report it with the session's log.";
    BoardPinRefused, "board-pin-refused":
        "The board cannot use a pin as printer.cfg asks", ALL_STOPPED,
        "Correct the pin in printer.cfg: a sensor needs an analog pin, an output one that is free. Then restart the board.";
    BoardShutdown, "board-shutdown":
        "The board stopped for a reason of its own", ALL_STOPPED,
        "Deal with the reason it gives, restart the board and home.";
    HeldHostAway, "held-host-away":
        "The computer did not reach the printer in time, so the board brought its motion to rest", HELD,
        "Keep the page open and the computer awake. Look at the print, then resume it or cancel it.";
    HeldQueueDry, "held-queue-dry":
        "Moves did not reach the printer in time, so the board brought its motion to rest", HELD,
        "Close other heavy programs, connect without a hub. Look at the print, then resume it or cancel it.";
    HeldForHost, "held-for-host":
        "The program that was printing went away, and the board holds the print", HELD,
        "Look at the print, then resume it or cancel it.";
    ContinuationRefused, "continuation-refused":
        "The print cannot be taken up with its next step", HELD,
        "Restart the board, home, and start again from a line or layer of the file.";
    BusyPrinting, "busy-printing":
        "That cannot be done while a print is running", REFUSED,
        "Pause or cancel the print first.";
    NoJob, "no-job":
        "There is no print that this could be done to", REFUSED,
        "Start a print first; one that has ended or was cancelled cannot be resumed.";
    NotConnected, "not-connected":
        "No printer is connected and ready", NOTHING_MOVED,
        "Connect the printer and wait until it is ready.";
    Internal, "internal":
        "This program contradicted itself and stopped to be safe", STOPPED_BY_HOST,
        "Please report it with the session's log. Restart the board and home before printing again.";
}

impl core::fmt::Display for ErrorCode {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.as_str())
    }
}

impl From<ShutdownReason> for ErrorCode {
    fn from(reason: ShutdownReason) -> Self {
        use ShutdownReason as R;
        match reason {
            R::EmergencyStop => Self::EmergencyStop,
            R::TimerTooClose => Self::OrdersTooLate,
            R::TimerInPast | R::StepperTooFarInPast => Self::BoardTooSlow,
            R::MissedOutput => Self::HeaterUnattended,
            R::AdcOutOfRange | R::HeaterSensor => Self::BoardSensorRange,
            R::HeaterNotHeating => Self::HeaterNotHeating,
            R::HeaterDrifted => Self::HeaterDrifted,
            R::AlreadyConfigured => Self::ConfigMismatch,
            R::OutOfObjects => Self::BoardTooSmall,
            R::MoveQueueOverflow => Self::QueueOverflow,
            R::InvalidPin | R::InvalidAdcPin => Self::BoardPinRefused,
            R::CommandParser
            | R::NotConfigured
            | R::OidAllocation
            | R::InvalidOid
            | R::InvalidStepInterval
            | R::StepperActive
            | R::StepperAlreadyTriggered
            | R::OutputTooFarAhead
            | R::InvalidPwm
            | R::InvalidAdcTiming
            | R::InvalidTrsync
            | R::InvalidEndstop
            | R::InvalidMotion
            | R::MotionNotHeld
            | R::InvalidHeater => Self::ProtocolFault,
        }
    }
}

/// One error: its code and what is special about this case (which heater, which line, which value).
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct PrinterError {
    /// The entry in the catalogue.
    pub code: ErrorCode,
    /// Which one, where, how much; may be empty. Without a full stop.
    pub detail: String,
    /// The line of the G-code that led to it, if one did.
    pub line: Option<u32>,
    /// What it brought to an end, where that is not the same for every error of this code.
    #[serde(default)]
    pub ended: Ended,
}

/// What an error brought to an end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ended {
    /// Nothing but what its code says.
    #[default]
    Nothing,
    /// A job that ran: it came to rest, and heaters and fan went off.
    Job,
    /// Everything: the board was told to stop.
    Everything,
}

impl PrinterError {
    /// An error with its particulars.
    pub fn new(code: ErrorCode, detail: impl Into<String>) -> Self {
        Self { code, detail: detail.into(), line: None, ended: Ended::Nothing }
    }

    /// The same, with the line of the G-code that led to it; 0 where none did.
    #[must_use]
    pub fn at_line(mut self, line: u32) -> Self {
        self.line = Some(line).filter(|&line| line > 0);
        self
    }

    /// The same, with what it brought to an end.
    #[must_use]
    pub fn ending(mut self, ended: Ended) -> Self {
        self.ended = ended;
        self
    }

    /// An error from the text with which a board explains its shutdown, which firmware other than ours may word
    /// in its own way.
    pub fn from_shutdown_text(text: &str) -> Self {
        let known = ShutdownReason::ALL.iter().find(|reason| reason.text() == text);
        let code = known.map_or(ErrorCode::BoardShutdown, |&reason| reason.into());
        Self::new(code, text)
    }

    /// What happened, with the particulars of this case.
    pub fn what_happened(&self) -> String {
        let place = self.line.map(|line| format!("Line {line}: ")).unwrap_or_default();
        if self.detail.is_empty() {
            format!("{place}{}.", self.code.what_happened())
        } else {
            format!("{place}{}: {}.", self.code.what_happened(), self.detail.trim_end_matches('.'))
        }
    }

    /// What the machine does now and what is not in danger.
    pub fn what_is_safe(&self) -> &'static str {
        let usual = self.code.what_is_safe();
        match self.ended {
            Ended::Job => JOB_ENDED,
            // Where the code speaks of a stop or of a lost connection already, it knows more.
            Ended::Everything if [NOTHING_MOVED, REFUSED, AXIS_STOPPED].contains(&usual) => STOPPED_BY_HOST,
            Ended::Everything | Ended::Nothing => usual,
        }
    }

    /// What the user should do.
    pub const fn what_to_do(&self) -> &'static str {
        self.code.what_to_do()
    }
}

impl From<ErrorCode> for PrinterError {
    fn from(code: ErrorCode) -> Self {
        Self::new(code, String::new())
    }
}

impl From<ShutdownReason> for PrinterError {
    fn from(reason: ShutdownReason) -> Self {
        Self::new(reason.into(), reason.text())
    }
}

impl core::fmt::Display for PrinterError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(&self.what_happened())
    }
}

impl core::error::Error for PrinterError {}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_code_is_unique_and_says_all_three_things() {
        let mut names = BTreeSet::new();
        for &code in ErrorCode::ALL {
            assert!(names.insert(code.as_str()), "{code} twice");
            assert!(code.as_str().chars().all(|c| c.is_ascii_lowercase() || c == '-'), "{code}");
            assert!(code.what_happened().len() > 15 && !code.what_happened().ends_with('.'), "{code}");
            for text in [code.what_is_safe(), code.what_to_do()] {
                assert!(text.len() > 20 && text.ends_with('.'), "{code}: {text}");
                assert!(!text.contains("  "), "{code}: {text}");
            }
        }
    }

    #[test]
    fn every_shutdown_reason_leads_to_an_entry_and_back_from_its_text() {
        for &reason in ShutdownReason::ALL {
            let error = PrinterError::from_shutdown_text(reason.text());
            assert_eq!(error, PrinterError::from(reason));
            assert_ne!(error.code, ErrorCode::BoardShutdown, "{reason:?}");
        }
        assert_eq!(PrinterError::from_shutdown_text("Thermal doom").code, ErrorCode::BoardShutdown);
    }

    #[test]
    fn the_detail_is_part_of_what_happened() {
        let error = PrinterError::new(ErrorCode::NotHomed, "axis X").at_line(12);
        assert_eq!(error.to_string(), "Line 12: A move was asked for before the machine was homed: axis X.");
        let error = PrinterError::new(ErrorCode::InvalidGcode, "`Y` has no number.");
        assert_eq!(error.to_string(), "A line of the file cannot be read as G-code: `Y` has no number.");
        let error = PrinterError::from(ErrorCode::NotHomed);
        assert_eq!(error.to_string(), "A move was asked for before the machine was homed.");
    }

    #[test]
    fn what_is_safe_depends_on_what_has_ended() {
        let safe = |code, ended| PrinterError::from(code).ending(ended).what_is_safe();
        assert_eq!(safe(ErrorCode::InvalidGcode, Ended::Nothing), NOTHING_MOVED);
        assert_eq!(safe(ErrorCode::InvalidGcode, Ended::Job), JOB_ENDED);
        assert_eq!(safe(ErrorCode::StepRateTooHigh, Ended::Everything), STOPPED_BY_HOST);
        assert_eq!(safe(ErrorCode::LinkTimeout, Ended::Everything), ON_ITS_OWN);
    }
}
