//! What a simulated print amounts to, as JSON with stable keys and as text.

use std::{collections::BTreeMap, fmt::Write as _};

use printer::machine::{EXTRUDER, MOTOR_NAMES};
use serde::Serialize;

use super::course::Hour;
use crate::console::{self, ErrorReport};

/// How a simulated print ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Outcome {
    /// The whole file was printed, and its pulses are where they should be.
    Done,
    /// It ended early, or wrong.
    Failed,
    /// The file was not fit to be printed: nothing was sent.
    Refused,
}

/// The result.
#[derive(Debug, Serialize)]
pub(crate) struct Report {
    pub(crate) result: Outcome,
    /// Why it is not done, in one line.
    pub(crate) reason: Option<String>,
    /// The same, taken apart.
    pub(crate) error: Option<ErrorReport>,
    /// Lines that have to be confirmed.
    pub(crate) blocking_lines: Vec<u32>,
    pub(crate) board: &'static str,
    pub(crate) seed: u64,
    /// Print time of all runs of motion but homing.
    pub(crate) print_time_s: f64,
    /// From power-up to the end.
    pub(crate) virtual_time_s: f64,
    /// Virtual time over the time that the computer took.
    pub(crate) speed_ratio: f64,
    pub(crate) moves: u64,
    pub(crate) motors: BTreeMap<&'static str, Motor>,
    pub(crate) path_error_max_mm: f64,
    /// Where that was.
    pub(crate) path_error_line: Option<u32>,
    /// Of the extruder at the ends of lines, in mm of filament.
    pub(crate) filament_error_max_mm: f64,
    /// `null` where no filament ran through a nozzle that had settled.
    pub(crate) temperature_error_max_c: Option<f64>,
    pub(crate) temperature_overshoot_max_c: f64,
    pub(crate) sent_bytes: u64,
    pub(crate) retransmitted_bytes: u64,
    /// Bytes that the link damaged, to the board and to the host.
    pub(crate) damaged_bytes: [u64; 2],
    /// `null` where the motion was too short to be queued ahead of itself.
    pub(crate) min_queued_s: Option<f64>,
    /// A fingerprint of every edge on the motors' pins but homing's, on the motion clock.
    pub(crate) pulse_digest: String,
    /// The same of the pulses with their directions, whenever the direction pins changed before them.
    pub(crate) step_digest: String,
    pub(crate) homing: Vec<Homing>,
    pub(crate) pauses: u32,
    /// How often the board brought its motion to rest because its host was held up.
    pub(crate) holds: u32,
    pub(crate) after: After,
    /// Hour by hour.
    pub(crate) course: Vec<Hour>,
}

/// One motor's share.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Motor {
    pub(crate) planned_steps: u64,
    pub(crate) counted_steps: u64,
    pub(crate) lost_steps: i64,
    pub(crate) end_position_mm: f64,
}

/// One axis that was homed.
#[derive(Debug, Serialize)]
pub(crate) struct Homing {
    pub(crate) motor: &'static str,
    /// Where the printer believes the axis to be.
    pub(crate) position_mm: f64,
    /// How far the carriage is from there.
    pub(crate) error_mm: f64,
    pub(crate) steps: u64,
}

/// The machine when all is over.
#[derive(Debug, Default, Serialize)]
pub(crate) struct After {
    pub(crate) heaters_off: bool,
    pub(crate) motors_still: bool,
    /// Why the board has stopped everything, if it has.
    pub(crate) shutdown: Option<String>,
}

impl Report {
    /// As text for people.
    pub(crate) fn text(&self) -> String {
        let mut text = String::new();
        let word = match self.result {
            Outcome::Done => "done",
            Outcome::Failed => "failed",
            Outcome::Refused => return "Result       refused: nothing was sent to the printer\n".to_owned(),
        };
        let time = console::duration_text(self.print_time_s);
        let _ = writeln!(text, "Result       {word}");
        let _ = writeln!(text, "Print time   {time} ({:.2} s)", self.print_time_s);
        let _ = writeln!(text, "Motor            planned      counted     lost    end position");
        let is_extruder = |name: &str| name == MOTOR_NAMES[EXTRUDER];
        let (last, first): (Vec<_>, Vec<_>) = self.motors.iter().partition(|(name, _)| is_extruder(name));
        for (name, motor) in first.into_iter().chain(last) {
            let Motor { planned_steps, counted_steps, lost_steps, end_position_mm } = motor;
            let _ = writeln!(
                text,
                "  {name:<10} {planned_steps:>11} {counted_steps:>12} {lost_steps:>8} {end_position_mm:>12.4} mm"
            );
        }
        let line = self.path_error_line.map(|line| format!(" (line {line})")).unwrap_or_default();
        let _ = writeln!(text, "Path         at most {:.4} mm off{line}", self.path_error_max_mm);
        if let Some(error) = self.temperature_error_max_c {
            let over = self.temperature_overshoot_max_c;
            let _ = writeln!(
                text,
                "Nozzle       at most {error:.1} °C off while extruding, overshoot {over:.1} °C"
            );
        }
        let (sent, again) = (self.sent_bytes, self.retransmitted_bytes);
        let _ = writeln!(text, "Link         {sent} bytes sent, {again} of them again");
        if let Some(queued) = self.min_queued_s {
            let _ = writeln!(text, "Queue        at least {queued:.2} s ahead");
        }
        let _ = writeln!(
            text,
            "Simulated    {} at {:.0} times real speed, pulses {}",
            console::duration_text(self.virtual_time_s),
            self.speed_ratio,
            self.pulse_digest
        );
        self.course_text(&mut text);
        text
    }

    /// Where it took longer than an hour.
    fn course_text(&self, text: &mut String) {
        if self.course.len() < 2 {
            return;
        }
        let _ = writeln!(text, "Until h   memory KiB   journal KiB   queued least, most s   clock off us");
        for hour in &self.course {
            let memory = hour.memory_kib.map_or_else(|| "-".to_owned(), |kib| kib.to_string());
            let seconds = |of: Option<f64>| of.map_or_else(|| "-".to_owned(), |s| format!("{s:.2}"));
            let (least, most) = (seconds(hour.queued_min_s), seconds(hour.queued_max_s));
            let _ = writeln!(
                text,
                "{:>7.2} {memory:>12} {:>13} {least:>12} {most:>9} {:>14.1}",
                hour.until_h, hour.journal_kib, hour.clock_error_max_us
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(crate) fn report() -> Report {
        Report {
            result: Outcome::Done,
            reason: None,
            error: None,
            blocking_lines: Vec::new(),
            board: "rp2040",
            seed: 1,
            print_time_s: 12.0,
            virtual_time_s: 100.0,
            speed_ratio: 250.0,
            moves: 9,
            motors: MOTOR_NAMES.iter().map(|&name| (name, Motor::default())).collect(),
            path_error_max_mm: 0.01,
            path_error_line: Some(5),
            filament_error_max_mm: 0.001,
            temperature_error_max_c: Some(1.25),
            temperature_overshoot_max_c: 2.0,
            sent_bytes: 1000,
            retransmitted_bytes: 10,
            damaged_bytes: [1, 2],
            min_queued_s: Some(2.5),
            pulse_digest: "0123456789abcdef".to_owned(),
            step_digest: "fedcba9876543210".to_owned(),
            homing: Vec::new(),
            pauses: 0,
            holds: 0,
            after: After::default(),
            course: vec![Hour::default(); 2],
        }
    }

    #[test]
    fn the_json_has_the_keys_that_are_documented() {
        let json = serde_json::to_value(report()).unwrap();
        for key in [
            "result",
            "reason",
            "print_time_s",
            "motors",
            "path_error_max_mm",
            "temperature_error_max_c",
            "retransmitted_bytes",
            "min_queued_s",
            "pulse_digest",
            "speed_ratio",
        ] {
            assert!(json.get(key).is_some(), "{key}");
        }
        assert_eq!(json["result"], "done");
        let motor = json["motors"]["stepper_x"].as_object().unwrap();
        let keys: Vec<_> = motor.keys().map(String::as_str).collect();
        assert_eq!(keys, ["counted_steps", "end_position_mm", "lost_steps", "planned_steps"]);
    }

    #[test]
    fn the_text_says_the_same() {
        let text = report().text();
        for part in ["done", "0.0100 mm off (line 5)", "1.2 °C", "at least 2.50 s", "250 times"] {
            assert!(text.contains(part), "{part} in\n{text}");
        }
    }
}
