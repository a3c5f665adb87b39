//! What takes part in homing: switches, and the motors that each of them stops; and what homing is made of.
//!
//! Knows the machine's kinematics. Steps are the board's.

use steps::Geometry;
use units::{Seconds, Ticks};
use wire::Command;

use crate::{
    config::{Kinematics, PrinterConfig},
    machine::{self, MOTORS},
    session::{board::Board, layout::EndstopOids},
};

/// Less than this is rounding, no motion.
const DRIFT_MIN_MM: f64 = 1e-9;

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
    /// The motors of other axes have not stopped at the very same step, which has moved those axes by so much, in mm: have
    /// them moved back, as [`Self::Move`], or call `AxisHoming::is_straight`.
    Straighten([f64; 3]),
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
    /// Have other axes moved back.
    PlanStraight([f64; 3]),
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

/// By how much all of that has moved axes that are not homed, in mm.
pub(super) fn drift(axis: usize, movers: &[Mover], geometry: &Geometry) -> [f64; 3] {
    let mut gone = [0.0; MOTORS];
    for mover in movers {
        let steps = mover.first.map_or(0, |first| mover.position.wrapping_sub(first));
        let steps = if mover.invert_dir { steps.wrapping_neg() } else { steps };
        gone[mover.motor] = f64::from(steps) * mover.step_mm;
    }
    match geometry {
        Geometry::Linear(linear) => {
            let [x, y, z, _] = linear.position(&gone);
            let mut drift = [x, y, z].map(|by| if by.abs() > DRIFT_MIN_MM { by } else { 0.0 });
            drift[axis] = 0.0;
            drift
        }
        // An axis with a motor of its own moves nothing else; towers are all homed.
        Geometry::Cartesian | Geometry::Delta(_) => [0.0; 3],
    }
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
