//! What takes part in homing: switches, and the motors that each of them stops; and what homing is made of.
//!
//! Knows the machine's kinematics. Steps are the board's.

use steps::Geometry;
use units::{Seconds, Ticks};
use wire::Command;

use super::{EXPIRE, REASON_ENDSTOP, REASON_EXPIRED, REASON_HOST, REPORT, SAMPLE, SAMPLES};
use crate::{
    config::{Kinematics, PrinterConfig},
    machine::{self, MOTORS, Motors},
    planner::Position,
    session::{board::Board, layout::EndstopOids},
};

/// Less than this is rounding, in mm …
const DUST_MM: f64 = 1e-9;
/// … and in steps.
const DUST_STEPS: f64 = 1e-6;
/// What it counts that the axis itself is moved off its home by a step, beside an axis that is to be where it was: it has
/// just been found anew, to half a step.
const OWN_SHARE: f64 = 1e-3;

/// How the machine stands before an axis is homed.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::session) struct Standing {
    /// Where the planner has it …
    pub(in crate::session) position: Position,
    /// … which means something for these axes …
    pub(in crate::session) homed: [bool; 3],
    /// … and how far they are from there, in mm: what homing others could not put right with whole steps.
    pub(in crate::session) off_mm: [f64; 3],
}

/// A straight move that homing wants made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::session) struct HomingMove {
    /// Where the axis is taken to be, in mm.
    pub(in crate::session) from_mm: f64,
    /// Where it goes, in mm.
    pub(in crate::session) to_mm: f64,
    /// How fast, in mm/s.
    pub(in crate::session) speed: units::MmPerS,
}

/// What homing wants next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::session) enum Wish {
    /// Nothing but time.
    Wait,
    /// Plan this move and make a run of it; then call `AxisHoming::run_started`.
    Move(HomingMove),
    /// The motor has been stopped by the trigger: forget what was planned.
    Abandon,
    /// The board stopped the motor because it had heard nothing; it now goes on. The user should know of it.
    GoesOn,
    /// The motors have not stopped where other axes are where they were: have each make so many steps more, as
    /// [`Self::Move`].
    Straighten([i32; MOTORS]),
    /// The axis is home.
    Done,
    /// The axis stands still because it was told to; where, nobody knows.
    Cancelled,
}

/// How far it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Stage {
    /// Ask where the motor stands.
    PositionBefore,
    /// Have the approach planned.
    Plan,
    /// On the way; `end` is when the move would end without an endstop.
    Approach {
        start: Ticks,
        end: Option<Ticks>,
        kept_alive: Seconds,
    },
    /// The trigger has fired: ask where the motor stopped.
    PositionAfter,
    /// Have the way back planned.
    PlanRetract,
    /// On the way back.
    Retract,
    /// Ask whether the endstop has been let go.
    Released,
    /// Have other axes moved back, by so many steps of the motors.
    PlanStraight([i32; MOTORS]),
    /// On that way.
    Straight,
    Done,
}

/// A switch with its trigger.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stop {
    pub(super) oids: EndstopOids,
    /// In the present approach its trigger has fired.
    pub(super) has_fired: bool,
    /// When the board last said anything of it.
    pub(super) heard: Seconds,
    /// After backing off it is open.
    pub(super) is_released: bool,
}

impl Stop {
    /// Its motors stop when it closes.
    pub(super) fn arm(&self, index: usize, movers: &[Mover], start: Ticks, rest: Seconds, board: &mut Board) {
        let oids = self.oids;
        let (trsync, clock) = (oids.trsync.0, start.low().0);
        board.control(&Command::TrsyncStart {
            oid: trsync,
            report_clock: clock,
            report_ticks: board.ticks(REPORT).0 as u32,
            expire_reason: REASON_EXPIRED,
        });
        for mover in movers.iter().filter(|mover| mover.stop == index) {
            board.control(&Command::StepperStopOnTrigger { oid: mover.oid, trsync_oid: trsync });
        }
        board.control(&Command::TrsyncSetTimeout {
            oid: trsync,
            clock: (start + board.ticks(EXPIRE)).low().0,
        });
        board.control(&Command::EndstopHome {
            oid: oids.endstop.0,
            clock,
            sample_ticks: board.ticks(SAMPLE).0 as u32,
            sample_count: SAMPLES,
            rest_ticks: board.ticks(rest).0 as u32,
            pin_value: u8::from(!oids.inverted),
            trsync_oid: trsync,
            trigger_reason: REASON_ENDSTOP,
        });
    }

    /// Its motors stop now. One that has stopped says why it has.
    pub(super) fn trigger(&self, board: &mut Board) {
        board.control(&Command::TrsyncTrigger { oid: self.oids.trsync.0, reason: REASON_HOST });
    }

    /// It watches nothing any more.
    pub(super) fn disarm(&self, board: &mut Board) {
        board.control(&Command::EndstopHome {
            oid: self.oids.endstop.0,
            clock: 0,
            sample_ticks: 0,
            sample_count: 0,
            rest_ticks: 0,
            pin_value: 0,
            trsync_oid: 0,
            trigger_reason: 0,
        });
        // Armed anew without reports: it has nothing more to say.
        board.control(&Command::TrsyncStart {
            oid: self.oids.trsync.0,
            report_clock: 0,
            report_ticks: 0,
            expire_reason: 0,
        });
    }
}

/// A motor on its way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mover {
    pub(super) motor: usize,
    pub(super) oid: u8,
    /// The switch that stops it, by its place.
    pub(super) stop: usize,
    pub(super) step_mm: f64,
    pub(super) invert_dir: bool,
    /// Where it stood before anything was done …
    pub(super) first: Option<i32>,
    /// … and where the board last said that it stands, and whether it has answered the present question.
    pub(super) position: i32,
    pub(super) has_answered: bool,
    /// Steps that it has made in the present approach, and in both.
    pub(super) approach_steps: u64,
    pub(super) steps: u64,
}

/// The switches of an axis and all motors that move with it. A delta's towers have one each.
pub(super) fn parts(axis: usize, config: &PrinterConfig, board: &Board) -> Option<(Vec<Stop>, Vec<Mover>)> {
    let stop = |axis: usize| Stop {
        oids: board.layout.endstops[axis],
        has_fired: false,
        heard: Seconds::ZERO,
        is_released: false,
    };
    let mover = |motor: usize, stop: usize| {
        Some(Mover {
            motor,
            oid: board.layout.steppers[motor]?.stepper.0,
            stop,
            step_mm: machine::step_distances(config)[motor].0,
            invert_dir: board.layout.steppers[motor]?.invert_dir,
            first: None,
            position: 0,
            has_answered: false,
            approach_steps: 0,
            steps: 0,
        })
    };
    if matches!(config.printer.kinematics, Kinematics::Delta(_)) {
        let movers: Option<Vec<Mover>> = (0..3).map(|tower| mover(tower, tower)).collect();
        return Some(((0..3).map(stop).collect(), movers?));
    }
    let motors = machine::geometry(config).motors_of(axis);
    let movers: Option<Vec<Mover>> =
        (0..MOTORS).filter(|&motor| motors[motor]).map(|motor| mover(motor, 0)).collect();
    Some((vec![stop(axis)], movers?))
}

/// The steps that motors have yet to make so that the axes that were homed before are where the planner has them, and how
/// far they are from that afterwards, in mm.
///
/// What counts is the difference between the steps that a motor has made and those from the planner's step before to its
/// step with the axis at home. So whatever rounding there is at either place, it is never added up.
pub(super) fn missing(
    axis: usize,
    home_mm: f64,
    movers: &[Mover],
    motors: &Motors,
    standing: &Standing,
) -> ([i32; MOTORS], [f64; 3]) {
    let Geometry::Linear(linear) = motors.geometry() else {
        // An axis with a motor of its own moves nothing else; towers are all homed.
        return ([0; MOTORS], [0.0; 3]);
    };
    let mut home = standing.position;
    home[axis] = home_mm;
    let (before, after) = (motors.counts(&standing.position), motors.counts(&home));
    let mut over = [0.0; MOTORS];
    let mut steps_mm = [0.0; MOTORS];
    for mover in movers {
        let steps = mover.first.map_or(0, |first| mover.position.wrapping_sub(first));
        let steps = if mover.invert_dir { steps.wrapping_neg() } else { steps };
        over[mover.motor] = f64::from(steps) - (after[mover.motor] - before[mover.motor]);
        steps_mm[mover.motor] = mover.step_mm;
    }
    let off = |made: &[f64; MOTORS]| {
        let at =
            linear.position(&core::array::from_fn(|motor| (over[motor] + made[motor]) * steps_mm[motor]));
        let off: [f64; 3] = core::array::from_fn(|other| standing.off_mm[other] + at[other]);
        let matters = |other: usize| other != axis && standing.homed[other];
        let others: [f64; 3] = core::array::from_fn(|other| if matters(other) { off[other] } else { 0.0 });
        (others, at[axis].abs())
    };
    // The way back of the other axes alone, in steps; each motor makes the whole ones on either side of that.
    let [x, y, z] = off(&[0.0; MOTORS]).0.map(|by| -by);
    let back = motors.geometry().motor_positions(&[x, y, z, 0.0]);
    let mut best = ([0.0; MOTORS], f64::INFINITY);
    for choice in 0..1_u32 << movers.len().min(MOTORS) {
        let mut made = [0.0; MOTORS];
        for (bit, mover) in movers.iter().enumerate() {
            let wanted = back[mover.motor] / mover.step_mm;
            let is_up = choice >> bit & 1 == 1;
            made[mover.motor] =
                if is_up { libm::ceil(wanted - DUST_STEPS) } else { libm::floor(wanted + DUST_STEPS) };
        }
        let (others, own) = off(&made);
        let cost = others.iter().map(|by| by.abs()).sum::<f64>() + OWN_SHARE * own;
        if cost < best.1 {
            best = (made, cost);
        }
    }
    let left = off(&best.0).0.map(|by| if by.abs() > DUST_MM { by } else { 0.0 });
    (best.0.map(|steps| steps as i32), left)
}

/// How far its carriage is taken to be from its endstop at most, for an axis of this length, in mm.
pub(super) fn length_mm(axis: usize, config: &PrinterConfig) -> f64 {
    let stepper = &config.steppers[axis];
    let length = (stepper.position_max - stepper.position_min).0;
    match &config.printer.kinematics {
        // Carriages far from the head are lower than those above it, by no more than their arms' length.
        Kinematics::Delta(delta) => {
            length + delta.towers.iter().map(|tower| tower.arm_length.0).fold(0.0, f64::max)
        }
        _ => length,
    }
}
