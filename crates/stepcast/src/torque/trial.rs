//! One plan on the motors of one machine: whether they keep step.

use core::fmt::Write as _;

use anyhow::anyhow;
use motion::PlannedMove;
use printer::planner::{Planned, Planner, Source};
use steps::{StepCommand, StepCommandKind};
use units::Hertz;
use virtual_printer::{Mechanics, Rotor};

use super::machine::{self, AXLES, Drive};
use crate::campaign::Chance;

const CLOCK: Hertz = Hertz(12_000_000);
/// A motor that has lost steps is found out after so many more.
const PULSES_PER_LOOK: usize = 1000;
/// After the last step motors swing for so long.
const SETTLE_TICKS: u64 = 6_000_000;
/// Long ways across the bed, and short ones between.
const MOVES: u32 = 120;
const LONG_SHARE: f64 = 0.6;

/// A file of little else than travel.
pub(super) fn travels() -> String {
    let mut chance = Chance::new(1, 0);
    let mut text = String::from("G90\n");
    let mut at = [575.0, 575.0];
    let _ = writeln!(text, "G1 X575 Y575 F120000");
    for _ in 0..MOVES {
        let length =
            if chance.part() < LONG_SHARE { chance.between(150.0..900.0) } else { chance.between(5.0..60.0) };
        let angle = chance.between(0.0..core::f64::consts::TAU);
        let to = [
            (at[0] + length * libm::cos(angle)).clamp(5.0, 1145.0),
            (at[1] + length * libm::sin(angle)).clamp(5.0, 1145.0),
        ];
        let _ = writeln!(text, "G1 X{:.3} Y{:.3} F120000", to[0], to[1]);
        at = to;
    }
    text
}

/// What a plan makes of a file.
pub(super) struct Plan {
    pub(super) time_s: f64,
    /// The strongest acceleration of any axis, mm/s², and the highest speed, mm/s.
    pub(super) accel_max: f64,
    pub(super) velocity_max: f64,
    /// Clock and direction of every step of X and Y.
    pulses: [Vec<(u64, bool)>; AXLES.len()],
    end: u64,
}

/// Plans a file.
pub(super) fn plan(text: &str, drive: Drive) -> anyhow::Result<Plan> {
    let config = machine::config(drive)?;
    let mut planner = Planner::new(&config, CLOCK)?;
    (0..3).for_each(|axis| planner.set_axis(axis, 0.0, true));
    let mut source = Source::default();
    planner.begin_job(&mut source);
    source.feed(text.as_bytes());
    source.end();
    let mut plan =
        Plan { time_s: 0.0, accel_max: 0.0, velocity_max: 0.0, pulses: Default::default(), end: 0 };
    let mut forward = [true; AXLES.len()];
    loop {
        match planner.next(&mut source).map_err(|error| anyhow!("{error}"))? {
            Planned::Steps(command) => plan.take(&command, &mut forward),
            Planned::Move(planned, _) => plan.judge(&planned),
            Planned::RunEnded(at) => {
                plan.time_s = at.0;
                plan.end = CLOCK.ticks_in(at).0 + SETTLE_TICKS;
            }
            Planned::EndOfSource => return Ok(plan),
            _ => {}
        }
    }
}

impl Plan {
    fn take(&mut self, command: &StepCommand, forward: &mut [bool; AXLES.len()]) {
        let Some(pulses) = self.pulses.get_mut(command.motor) else { return };
        match command.kind {
            StepCommandKind::SetDir { forward: is_forward } => forward[command.motor] = is_forward,
            StepCommandKind::QueueStep { interval, count, add } => {
                let mut clock = command.end.0;
                // Backward from the last step, whose clock is exact however long the rest before was.
                let mut last = i64::from(interval) + i64::from(add) * (i64::from(count) - 1);
                let from = pulses.len();
                for _ in 0..count {
                    pulses.push((clock, forward[command.motor]));
                    clock = clock.saturating_sub_signed(last);
                    last -= i64::from(add);
                }
                pulses[from..].reverse();
            }
        }
    }

    fn judge(&mut self, planned: &PlannedMove) {
        for phase in planned.phases() {
            for share in &planned.direction[..AXLES.len()] {
                self.accel_max = self.accel_max.max(phase.accel.abs() * share.abs());
            }
        }
        self.velocity_max = self.velocity_max.max(planned.cruise_velocity);
    }

    /// Whether any of these motors loses a step.
    pub(super) fn loses_steps(&self, motors: &[Mechanics; AXLES.len()]) -> bool {
        self.pulses.iter().zip(motors).any(|(pulses, mechanics)| {
            let mut rotor = Rotor::new(mechanics, CLOCK.0);
            for chunk in pulses.chunks(PULSES_PER_LOOK) {
                for &(clock, forward) in chunk {
                    rotor.step(clock, forward);
                }
                if rotor.lost() != 0 {
                    return true;
                }
            }
            rotor.run_until(self.end);
            rotor.lost() != 0
        })
    }
}
