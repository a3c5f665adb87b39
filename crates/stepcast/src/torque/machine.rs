//! A heavy machine whose motors are those of data sheets: what the planner is told of them, and what is simulated.
//!
//! A frame of 1150 x 1150 mm: a head of 1.5 kg on X, a gantry of 6 kg on Y, belts on pulleys of 40 mm a turn, 36 V.
//! The motors: Trinamic QSH6018 manual V1.20, tables 1.1 and 5.1 (torque in proportion to the current) and section 5.4 (back
//! EMF: holding torque over twice the rated current, in V·s/rad). What data sheets do not say was fixed before anything was
//! simulated: a swing's damping of a twentieth of the critical one, friction of a few hundredths of the torque.

use core::f64::consts::TAU;
use core::fmt::Write as _;

use anyhow::{Context, anyhow};
use printer::config::{self, PrinterConfig};
use virtual_printer::Mechanics;

use crate::campaign::Chance;

const SUPPLY_V: f64 = 36.0;
const FULL_STEPS: u32 = 200;
/// Electrical periods a turn.
const PERIODS: f64 = 50.0;
pub(super) const MICROSTEPS: u32 = 8;
pub(super) const MM_PER_TURN: f64 = 40.0;
/// By how much parts differ, either way.
const SPREAD: f64 = 0.1;
/// The table of the torque goes up to this many times the rate at which it begins to fall …
const TABLE_REACH: f64 = 8.0;
/// … in steps of this ratio.
const TABLE_RATIO: f64 = 1.08;

/// A motor of the data sheet, and what it moves.
pub(super) struct Axle {
    name: &'static str,
    /// Holding torque at the rated current, N·m.
    rated_nm: f64,
    /// A, root mean square.
    rated_a: f64,
    /// The driver's current, the same.
    set_a: f64,
    ohms: f64,
    henries: f64,
    rotor_gcm2: f64,
    moved_kg: f64,
    friction_nm: f64,
}

/// X and Y.
pub(super) const AXLES: [Axle; 2] = [
    // QSH6018-56-28-165 at 2.16 A: 1.27 N·m.
    Axle {
        name: "stepper_x",
        rated_nm: 1.65,
        rated_a: 2.8,
        set_a: 2.155,
        ohms: 0.9,
        henries: 3.6e-3,
        rotor_gcm2: 400.0,
        moved_kg: 1.5,
        friction_nm: 0.04,
    },
    // QSH6018-65-28-210 at 2.93 A, below its 3.0 A: 2.2 N·m.
    Axle {
        name: "stepper_y",
        rated_nm: 2.1,
        rated_a: 2.8,
        set_a: 2.933,
        ohms: 1.2,
        henries: 4.6e-3,
        rotor_gcm2: 570.0,
        moved_kg: 6.0,
        friction_nm: 0.08,
    },
];

impl Axle {
    fn holding_nm(&self) -> f64 {
        self.rated_nm * self.set_a / self.rated_a
    }

    fn inertia_kg_m2(&self) -> f64 {
        let lever_m = MM_PER_TURN / 1000.0 / TAU;
        self.rotor_gcm2 * 1e-7 + self.moved_kg * lever_m * lever_m
    }

    /// Turns a second at which the supply is used up: V² = (I·R + C·ω)² + (p·ω·L·I)², for the current's peak.
    fn corner_rev_s(&self) -> f64 {
        let peak_a = self.set_a * core::f64::consts::SQRT_2;
        let emf = self.rated_nm / (2.0 * self.rated_a);
        let (drop, reactance) = (peak_a * self.ohms, PERIODS * self.henries * peak_a);
        let a = emf * emf + reactance * reactance;
        let b = 2.0 * drop * emf;
        let c = drop * drop - SUPPLY_V * SUPPLY_V;
        ((b * b - 4.0 * a * c).sqrt() - b) / (2.0 * a) / TAU
    }

    /// As simulated, by the middle of its parts' tolerances.
    fn mechanics(&self) -> Mechanics {
        Mechanics {
            full_steps_per_rotation: FULL_STEPS,
            microsteps: MICROSTEPS,
            holding_torque_nm: self.holding_nm(),
            corner_speed_rev_s: self.corner_rev_s(),
            inertia_kg_m2: self.inertia_kg_m2(),
            friction_nm: self.friction_nm,
            drag_nm_s: 0.0,
            damping_ratio: 0.05,
            load_nm: 0.0,
            detent_nm: 0.0,
        }
    }

    /// One of its kind: every part is off by its own share.
    pub(super) fn specimen(&self, chance: &mut Chance) -> Mechanics {
        let middle = self.mechanics();
        let mut off = || chance.between(1.0 - SPREAD..1.0 + SPREAD);
        Mechanics {
            holding_torque_nm: middle.holding_torque_nm * off(),
            corner_speed_rev_s: middle.corner_speed_rev_s * off(),
            inertia_kg_m2: middle.inertia_kg_m2 * off(),
            friction_nm: middle.friction_nm * off(),
            damping_ratio: middle.damping_ratio * off(),
            ..middle
        }
    }

    /// Its section in the machine file.
    fn section(&self, margin: Option<f64>) -> String {
        let margin = margin.map_or(String::new(), |margin| format!("torque_margin: {margin}\n"));
        let corner = self.corner_rev_s() * f64::from(FULL_STEPS);
        let mut table = format!("0: {0:.3}, {corner:.0}: {0:.3}", self.holding_nm());
        let mut times = 1.0;
        while times < TABLE_REACH {
            times *= TABLE_RATIO;
            let _ = write!(table, ", {:.0}: {:.3}", corner * times, self.holding_nm() / times);
        }
        format!(
            "\n[motor_torque {}]\npull_out_torque: {table}\ninertia: {:.0}\nload_torque: {}\n{margin}",
            self.name,
            self.inertia_kg_m2() * 1e7,
            self.friction_nm
        )
    }
}

/// How the machine is driven.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Drive {
    /// At one acceleration (mm/s²) up to one speed (mm/s).
    Constant { accel: f64, velocity: f64 },
    /// As the motors' torque allows, of which a share is asked for.
    Torque { margin: Option<f64> },
}

/// The machine file.
pub(super) fn config(drive: Drive) -> anyhow::Result<PrinterConfig> {
    let (accel, velocity, sections) = match drive {
        Drive::Constant { accel, velocity } => (accel, velocity, String::new()),
        Drive::Torque { margin } => (1e6, 2e3, AXLES.iter().map(|axle| axle.section(margin)).collect()),
    };
    let axis = |name: &str, pins: usize, turn: f64| {
        format!(
            "\n[{name}]\nstep_pin: gpio{}\ndir_pin: gpio{}\nendstop_pin: gpio{}\nrotation_distance: {turn}\n\
             microsteps: {MICROSTEPS}\nposition_endstop: 0\nposition_max: 1150\n",
            pins,
            pins + 1,
            pins + 2
        )
    };
    let text = format!(
        "[mcu]\nserial: /dev/null\n[printer]\nkinematics: cartesian\nmax_velocity: {velocity}\nmax_accel: {accel}\n\
         minimum_cruise_ratio: 0\n{}{}{}{sections}",
        axis("stepper_x", 0, MM_PER_TURN),
        axis("stepper_y", 3, MM_PER_TURN),
        axis("stepper_z", 6, 8.0),
    );
    let (config, diagnostics) = config::parse(&text);
    config.with_context(|| anyhow!("the heavy machine's file: {diagnostics:?}"))
}
