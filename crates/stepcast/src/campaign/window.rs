//! Short prints: windows cut out of real files, and fast to and fro.
//!
//! A window of a file is its head, whose wait for the bed is left out, then the way to a line of its middle, in the state
//! that the file would be in there, then some of the lines from there on. Knows as much G-code as that takes; whether it
//! is read rightly does not matter, as long as what comes out is a file that can be printed. Lengths in mm.

use std::{fmt::Write as _, sync::Arc};

use printer::config::{Kinematics, PrinterConfig};

use super::chance::Chance;

/// The most lines of a file that windows are taken from.
const LINES_MAX: usize = 2_000_000;
/// The fewest and the most lines of a window.
const WINDOW_LINES: [usize; 2] = [30, 400];
/// A window that takes longer is cut off, in seconds of motion without acceleration.
const WINDOW_S_MAX: f64 = 15.0;
/// The highest speed of generated prints, in mm/s.
const FAST_MM_S: f64 = 300.0;
/// Their highest acceleration, in mm/s².
pub(super) const FAST_ACCEL_MM_S2: f64 = 10_000.0;
/// Where they move: a square of the bed, in mm.
const FAST_RANGE_MM: [f64; 2] = [10.0, 180.0];

/// Where generated prints move on a machine: around the middle of a round bed, as far as a square goes.
pub(super) fn fast_range(config: &PrinterConfig) -> [f64; 2] {
    match &config.printer.kinematics {
        Kinematics::Delta(delta) => {
            let far = delta.print_radius.0 / core::f64::consts::SQRT_2 - 1.0;
            [-far, far]
        }
        _ => FAST_RANGE_MM,
    }
}

/// A print.
#[derive(Clone, Debug)]
pub(super) struct Window {
    /// Where it is from, for messages.
    pub(super) name: String,
    pub(super) gcode: Arc<[u8]>,
    /// It wants the highest accelerations.
    pub(super) fast: bool,
}

/// The state at a line.
#[derive(Clone, Debug, Default)]
struct At {
    line: usize,
    /// X, Y, Z, filament; `None` where it is not known.
    place: [Option<f64>; 4],
    feed: f64,
    relative_e: bool,
    /// Filament that is pulled back.
    retracted: f64,
    retracted_by_firmware: bool,
    accel: Option<usize>,
    fan: Option<usize>,
}

/// A file that windows are taken from.
pub(super) struct Source {
    name: String,
    lines: Vec<String>,
    /// The first line that is not head.
    body: usize,
    /// Lines at which a window may begin.
    starts: Vec<At>,
}

impl Source {
    /// Reads a file; `None` where nothing is printed in it.
    pub(super) fn new(name: &str, text: &str) -> Option<Self> {
        let lines: Vec<String> = text.lines().take(LINES_MAX).map(str::to_owned).collect();
        let mut at = At::default();
        let (mut body, mut starts) = (None, Vec::new());
        for (number, line) in lines.iter().enumerate() {
            at.line = number;
            let words = Words::of(line);
            let moves = matches!(words.command, "G0" | "G1") && (words.get('X').or(words.get('Y'))).is_some();
            let is_known = at.place.iter().all(Option::is_some) && at.feed > 0.0;
            if moves && words.get('E').is_some() {
                body = body.or(Some(number));
            }
            if moves && is_known && body.is_some() && at.retracted.abs() < 1e-6 && !at.retracted_by_firmware {
                starts.push(at.clone());
            }
            at.take(&words, number);
        }
        let body = body.filter(|_| !starts.is_empty())?;
        Some(Self { name: name.to_owned(), lines, body, starts })
    }

    /// A window of it.
    pub(super) fn window(&self, chance: &mut Chance) -> Window {
        let at = chance.pick(&self.starts);
        let [fewest, most] = WINDOW_LINES;
        let count = fewest + chance.below(most - fewest);
        let mut text = String::new();
        for line in &self.lines[..self.body] {
            // The bed warms on its way: nothing is learned by waiting for it.
            let line = line.replacen("M190", "M140", 1);
            let _ = writeln!(text, "{line}");
        }
        let [x, y, z, e] = at.place.map(Option::unwrap_or_default);
        let _ = writeln!(text, "G90\n{}\nG92 E{e}", if at.relative_e { "M83" } else { "M82" });
        let _ = writeln!(text, "G1 Z{z} F600\nG1 X{x} Y{y} F9000\nG1 F{}", at.feed);
        for line in [at.accel, at.fan].into_iter().flatten() {
            let _ = writeln!(text, "{}", self.lines[line]);
        }
        let (mut now, mut took_s) = (at.clone(), 0.0);
        for (number, line) in self.lines.iter().enumerate().skip(at.line).take(count) {
            let words = Words::of(line);
            if took_s > WINDOW_S_MAX || ends_print(words.command) {
                break;
            }
            let from = now.place;
            now.take(&words, number);
            if words.command.starts_with("G1") || words.command == "G0" {
                took_s += distance(from, now.place) / (now.feed / 60.0).max(0.1);
            }
            let _ = writeln!(text, "{line}");
        }
        text.push_str("M107\nM104 S0\nM140 S0\nM84\n");
        let name = format!("{} from line {}", self.name, at.line + 1);
        Window { name, gcode: text.into_bytes().into(), fast: false }
    }
}

/// What a window of the middle has no use for: the end of the file's own.
fn ends_print(command: &str) -> bool {
    matches!(command, "M84" | "M104" | "M109" | "M140" | "M190" | "M600" | "M0" | "M1" | "G28")
}

fn distance(from: [Option<f64>; 4], to: [Option<f64>; 4]) -> f64 {
    let way = from.iter().zip(to).take(3).map(|(from, to)| to.unwrap_or(0.0) - from.unwrap_or(0.0));
    way.map(|way| way * way).sum::<f64>().sqrt()
}

impl At {
    fn take(&mut self, words: &Words<'_>, number: usize) {
        match words.command {
            "G0" | "G1" | "G2" | "G3" => self.go(words),
            "G92" => {
                for (axis, letter) in ['X', 'Y', 'Z', 'E'].into_iter().enumerate() {
                    self.place[axis] = words.get(letter).or(self.place[axis]);
                }
            }
            "G10" => self.retracted_by_firmware = true,
            "G11" => self.retracted_by_firmware = false,
            "M82" => self.relative_e = false,
            "M83" => self.relative_e = true,
            "M204" => self.accel = Some(number),
            "M106" | "M107" => self.fan = Some(number),
            _ => {}
        }
    }

    fn go(&mut self, words: &Words<'_>) {
        for (axis, letter) in ['X', 'Y', 'Z'].into_iter().enumerate() {
            self.place[axis] = words.get(letter).or(self.place[axis]);
        }
        self.feed = words.get('F').unwrap_or(self.feed);
        let Some(e) = words.get('E') else { return };
        let pushed = if self.relative_e { e } else { e - self.place[3].unwrap_or(0.0) };
        if words.get('X').or(words.get('Y')).is_none() {
            self.retracted -= pushed;
        }
        self.place[3] = Some(if self.relative_e { 0.0 } else { e });
    }
}

/// A line's command and its words.
struct Words<'a> {
    command: &'a str,
    words: &'a str,
}

impl<'a> Words<'a> {
    fn of(line: &'a str) -> Self {
        let code = line.split(';').next().unwrap_or_default().trim();
        let (command, words) = code.split_once(' ').unwrap_or((code, ""));
        Self { command, words }
    }

    fn get(&self, letter: char) -> Option<f64> {
        self.words.split_whitespace().find_map(|word| word.strip_prefix(letter)?.parse().ok())
    }
}

/// To and fro over the bed, at any speed and acceleration that a machine may have, without heat.
pub(super) fn fast(chance: &mut Chance, [low, high]: [f64; 2]) -> Window {
    let mut text = "G28\nG90\nG1 Z5 F900\n".to_owned();
    let mut place = [chance.between(low..high), chance.between(low..high)];
    let _ = writeln!(text, "G1 X{:.3} Y{:.3} F9000", place[0], place[1]);
    let mut took_s = 0.0;
    while took_s < WINDOW_S_MAX / 2.0 {
        let _ = writeln!(text, "M204 S{:.0}", chance.magnitude(500.0..FAST_ACCEL_MM_S2));
        let speed = chance.between(0.1 * FAST_MM_S..1.0 * FAST_MM_S);
        let reach = chance.magnitude(0.2..high - low);
        let straight = chance.part() < 0.5;
        for turn in 0..2 + chance.below(30) {
            let sign = if turn % 2 == 0 { 1.0 } else { -1.0 };
            let way = [sign * reach, if straight { 0.0 } else { chance.between(-reach..reach) }];
            let next = [0, 1].map(|axis: usize| (place[axis] + way[axis]).clamp(low, high));
            let _ = writeln!(text, "G1 X{:.3} Y{:.3} F{:.0}", next[0], next[1], 60.0 * speed);
            took_s += libm::hypot(next[0] - place[0], next[1] - place[1]) / speed + 0.02;
            place = next;
        }
    }
    text.push_str("M84\n");
    Window { name: "fast to and fro".to_owned(), gcode: text.into_bytes().into(), fast: true }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "M83\nM190 S60\nG28\nM109 S200\nG92 E0\nG1 Z0.3 F600\nG1 X5 Y10 F9000\nG1 X45 E6 F1200\n\
        M204 S800\nG1 X50 E.5\nG1 E-.8 F2400\nG1 X90 F9000\nG1 E.8 F2400\nG1 X91 E.1 F1200\nM104 S0\n";

    #[test]
    fn windows_begin_where_filament_is_at_the_nozzle() {
        let source = Source::new("file", FILE).unwrap();
        assert_eq!(source.body, 7);
        let lines: Vec<usize> = source.starts.iter().map(|at| at.line + 1).collect();
        assert_eq!(lines, [8, 10, 14]);
        assert_eq!(source.starts[2].place, [Some(90.0), Some(10.0), Some(0.3), Some(0.0)]);
        let window = source.window(&mut Chance::new(1, 1));
        let text = String::from_utf8(window.gcode.to_vec()).unwrap();
        assert!(
            !text.contains("M190") && text.contains("M204 S800") && text.contains("G1 X91 E.1"),
            "{text}"
        );
        assert_eq!(text.matches("M104 S0").count(), 1);
    }

    #[test]
    fn a_file_without_a_print_gives_none() {
        assert!(Source::new("file", "G28\nG1 X5\n").is_none());
    }

    #[test]
    fn fast_ones_stay_on_the_bed_and_below_their_limits() {
        for seed in 0..50 {
            let window = fast(&mut Chance::new(seed, 1), FAST_RANGE_MM);
            for line in std::str::from_utf8(&window.gcode).unwrap().lines() {
                let words = Words::of(line);
                assert!(words.get('F').is_none_or(|feed| feed <= 60.0 * FAST_MM_S), "{line}");
                assert!(words.get('S').is_none_or(|accel| accel <= FAST_ACCEL_MM_S2), "{line}");
                for letter in ['X', 'Y'] {
                    let place = words.get(letter);
                    assert!(
                        place.is_none_or(|at| (FAST_RANGE_MM[0]..=FAST_RANGE_MM[1]).contains(&at)),
                        "{line}"
                    );
                }
            }
        }
    }
}
