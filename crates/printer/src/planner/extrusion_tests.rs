//! The extruder follows the path that is drawn, through every ramp: measured on the pulses.

use steps::{StepCommand, StepCommandKind};

use super::{
    tests::{CLOCK, machine_file, planner},
    *,
};
use crate::machine::{MOTORS, step_distances};

/// Sharp corners of all kinds, long and short, at speeds that are reached and at such that are not.
const CORNERS: &str = "M83\nM204 S400\nG1 X20 Y20 F6000\n\
    G1 X60 E2 F6000\nG1 Y60 E2\nG1 X20 Y20 E3\nG1 X60 E2\nG1 X20.5 E2.5\nG1 Y20.4 E0.03\nG1 X20.9 E0.03\n\
    G1 X20.9 Y60 E1.2 F12000\nG1 X60 Y60.3 E5 F1200\nG1 X20 E1.4 F9000\nG1 X60 Y20 E2.6\nG1 X20 Y22 E0.7\n";

/// A motor's count over time.
#[derive(Default)]
struct Pulses {
    /// When, and where the count is from then on.
    at: Vec<(u64, i64)>,
    forward: bool,
}

impl Pulses {
    fn take(&mut self, command: &StepCommand) {
        match command.kind {
            StepCommandKind::SetDir { forward } => self.forward = forward,
            StepCommandKind::QueueStep { mut interval, count, add } => {
                let (mut tick, mut place) = (command.start.0, self.at.last().map_or(0, |&(_, place)| place));
                for _ in 0..count {
                    tick += u64::from(interval);
                    interval = interval.wrapping_add_signed(i32::from(add));
                    place += if self.forward { 1 } else { -1 };
                    self.at.push((tick, place));
                }
            }
        }
    }

    fn count(&self, tick: u64) -> i64 {
        let passed = self.at.partition_point(|&(at, _)| at <= tick);
        passed.checked_sub(1).map_or(0, |last| self.at[last].1)
    }
}

#[test]
fn at_every_pulse_the_filament_is_what_the_path_drawn_takes() {
    let (mut planner, mut source) = planner();
    source.feed(CORNERS.as_bytes());
    source.end();
    let mut pulses: [Pulses; MOTORS] = Default::default();
    let mut moves = Vec::new();
    loop {
        match planner.next(&mut source).unwrap() {
            Planned::Steps(command) => pulses[command.motor].take(&command),
            Planned::Move(made, _) => moves.push(made),
            Planned::EndOfSource => break,
            _ => {}
        }
    }
    assert_eq!(moves.len(), 13);
    let [x, y, _, e] = step_distances(&machine_file()).map(|distance| distance.0);
    let ticks = f64::from(CLOCK.0);
    let (mut looked_at, mut ramps) = (0, 0);
    for &(tick, place) in &pulses[3].at {
        let seconds = tick as f64 / ticks;
        let on = moves.iter().rfind(|made| made.start_time <= seconds).unwrap();
        let way = [on.to[0] - on.from[0], on.to[1] - on.from[1]];
        let length = libm::hypot(way[0], way[1]);
        let head =
            [pulses[0].count(tick) as f64 * x - on.from[0], pulses[1].count(tick) as f64 * y - on.from[1]];
        let drawn = (head[0] * way[0] + head[1] * way[1]) / length;
        let due = on.from[3] + (on.to[3] - on.from[3]) * drawn / length;
        assert!((place as f64 * e - due).abs() <= e, "at {seconds} s: {} mm, due {due}", place as f64 * e);
        looked_at += 1;
        let into = seconds - on.start_time;
        ramps += usize::from(into < on.accel_time || into > on.accel_time + on.cruise_time);
    }
    assert!(looked_at > 3000 && ramps > 1000, "{looked_at} pulses, {ramps} of them in ramps");
}

#[test]
fn filament_over_next_to_no_way_is_pushed_on_the_spot() {
    for way in ["X20.0000005", "X19.9999995 Y20.0000005", "Z5.0000009"] {
        let (mut planner, mut source) = planner();
        source.feed(format!("M83\nG1 X20 Y20 Z5 F6000\nG1 {way} E5 F1200\nG1 X30 E0.5\n").as_bytes());
        source.end();
        let mut moves = Vec::new();
        loop {
            match planner.next(&mut source).unwrap() {
                Planned::Move(made, _) => moves.push(made),
                Planned::EndOfSource => break,
                _ => {}
            }
        }
        let [.., pushed, drawn] = &moves[..] else { panic!("{moves:?}") };
        assert_eq!((pushed.from[..3].to_vec(), pushed.length), (pushed.to[..3].to_vec(), 5.0), "{way}");
        assert!(pushed.cruise_velocity <= 20.0, "{way}: {pushed:?}");
        assert_eq!((drawn.from, drawn.to), (pushed.to, planner.position()), "{way}");
    }
}
