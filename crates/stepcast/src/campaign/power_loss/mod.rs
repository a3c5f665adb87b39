//! The scenario `power_loss`: the power goes at a random moment of a print, comes back, and a user goes on with it from a
//! line.
//!
//! Judged by the way that the nozzle really took, whatever anybody claims: what is laid lies where the clean print has laid
//! it, all of it is there, and the nozzle has not gone through it.

mod part;
mod rig;
#[cfg(test)]
mod tests;
mod trace;

use std::collections::{BTreeMap, BTreeSet};

use printer::config::PrinterConfig;
use units::{Mm, MmPerS, Seconds};
use virtual_printer::BoardProfile;

use self::{
    part::{Heights, Laid, OFF_MAX_MM},
    rig::Rig,
    trace::Doing,
};
use super::{chance::Chance, judge::Finding, window::Window};

/// The power is gone for so long.
const GONE_S: std::ops::Range<f64> = 2.0..600.0;
/// The user comes so long after it is back.
const USER_S: std::ops::Range<f64> = 0.5..30.0;
/// The torque that pulls a rotor without current to the next full step: less than friction, or more, in N·m.
const DETENTS_NM: [f64; 3] = [0.0, 0.02, 0.05];
/// In a part of the prints, what hangs on Z sinks by up to so much, in mm.
const SAG_PART: f64 = 0.25;
const SAG_MM: f64 = 0.5;
/// Whoever measures Z is off by up to so much, in mm: a sheet of paper.
const MEASURED_MM: f64 = 0.04;
/// X and Y are as exact as they are homed: no faster than so, in mm/s.
const SECOND_HOMING: MmPerS = MmPerS(5.0);
/// The filament of a line may be off by so many steps: where its ends lie between two steps is not the same.
const FILAMENT_STEPS_OFF_MAX: i64 = 3;
/// In so many prints the host has the same power.
const HOST_DIES_PART: f64 = 0.5;

/// What happens to a print, and what its user does.
#[derive(Clone, Debug)]
pub(super) struct Loss {
    /// Since power-up.
    at: Seconds,
    lasts: Seconds,
    sag: Mm,
    detent_nm: f64,
    host_dies: bool,
    user_comes: Seconds,
    measured_off: Mm,
    /// The user is wrong about Z by so much: for tests of the judgement.
    claim_off: Mm,
}

impl Loss {
    /// At a random moment of a print that takes from and until then.
    fn new(began: Seconds, ended: Seconds, chance: &mut Chance) -> Self {
        let sags = chance.part() < SAG_PART;
        Self {
            at: Seconds(chance.between(began.0..ended.0)),
            lasts: Seconds(chance.magnitude(GONE_S)),
            sag: Mm(if sags { chance.between(0.0..SAG_MM) } else { 0.0 }),
            detent_nm: *chance.pick(&DETENTS_NM),
            host_dies: chance.part() < HOST_DIES_PART,
            user_comes: Seconds(chance.between(USER_S)),
            measured_off: Mm(chance.between(-MEASURED_MM..MEASURED_MM)),
            claim_off: Mm(0.0),
        }
    }

    /// For whoever reads of a print that broke its promise.
    fn text(&self) -> String {
        let host = if self.host_dies { ", and the host with it" } else { "" };
        let Self { at, lasts, sag, detent_nm, .. } = self;
        format!(
            "power-loss={:.1}@{:.4}{host}; Z sinks by {:.3} mm, detent {detent_nm} N·m",
            lasts.0, at.0, sag.0
        )
    }
}

/// The clean print.
struct Clean {
    laid: Laid,
    /// The steps of filament that each line was given.
    filament: BTreeMap<u32, i64>,
}

impl Clean {
    /// Whether the lines from there on were given another amount of filament.
    fn misfed(&self, again: &BTreeMap<u32, i64>, from: u32) -> Option<String> {
        let (mut all, mut worst) = (0, (0, 0));
        let lines: BTreeSet<u32> = self.filament.keys().chain(again.keys()).copied().collect();
        for &line in lines.range(from..) {
            let [clean, again] = [&self.filament, again].map(|of| of.get(&line).copied().unwrap_or_default());
            let off = again - clean;
            all += off;
            worst = if off.abs() > worst.1 { (line, off.abs()) } else { worst };
        }
        let is_off = all.abs() > FILAMENT_STEPS_OFF_MAX || worst.1 > FILAMENT_STEPS_OFF_MAX;
        is_off.then(|| {
            format!("line {} was given {} steps of filament more or less, all {all}", worst.0, worst.1)
        })
    }
}

/// A print that lost its power, judged.
pub(super) struct Judged {
    pub(super) finding: Finding,
    pub(super) about: String,
}

/// Prints a window clean, and with a loss of power.
pub(super) fn run(
    config: &PrinterConfig,
    window: &Window,
    board: &BoardProfile,
    seed: u64,
    chance: &mut Chance,
) -> anyhow::Result<Judged> {
    let mut config = config.clone();
    for stepper in &mut config.steppers {
        stepper.second_homing_speed = stepper.second_homing_speed.min(SECOND_HOMING);
    }
    let mut clean = Rig::new(config.clone(), board, window.gcode.clone(), None, seed)?;
    clean.print()?;
    let (ended, filament, way) = (clean.age(), clean.filament(), clean.way());
    let first = way.iter().find(|(_, doing)| matches!(doing, Doing::Line { .. }));
    let first = first.map_or(clean.printer.start(), |(sample, _)| sample.at);
    let began = board.clock.duration_of(first.saturating_sub(clean.printer.start()));
    let loss = Loss::new(began, ended, chance);
    let clean = Clean { laid: Laid::of(&way), filament };
    let about = loss.text();
    let finding = interrupted(&config, window, board, seed, &loss, &clean)
        .unwrap_or_else(|error| Finding { broken: vec![format!("{error:#}")], ..Finding::default() });
    Ok(Judged { finding, about })
}

/// The print that loses its power, against what the clean one has laid.
fn interrupted(
    config: &PrinterConfig,
    window: &Window,
    board: &BoardProfile,
    seed: u64,
    loss: &Loss,
    clean: &Clean,
) -> anyhow::Result<Finding> {
    let mut rig = Rig::new(config.clone(), board, window.gcode.clone(), Some(loss), seed)?;
    rig.print()?;
    rig.filament();
    let before = rig.way();
    let Some(gone_on) = rig.go_on(loss)? else { return Ok(Finding::default()) };
    let (filament, after) = (rig.filament(), rig.way());

    let mut broken = gone_on.broken;
    let mut heights = Heights::default();
    heights.follow(&before, 0);
    let (depth_mm, times) = heights.follow(&after, gone_on.found.reach_line);
    if times > 0 {
        broken.push(format!(
            "the nozzle went through the part or the bed {times} times, {depth_mm:.3} mm deep"
        ));
    }
    let [laid, again] = [&before, &after].map(|way| Laid::of(way));
    let off = again.off(&clean.laid);
    if off.xy_mm > OFF_MAX_MM || off.z_mm > OFF_MAX_MM || off.strays > 0 {
        broken.push(format!("what was laid again is off: {off:?}"));
    }
    // Whatever line it began with, all of the clean print is there.
    let [_, behind] = clean.laid.clone().split(gone_on.found.start_line);
    let missing = [clean.laid.off(&laid.and(&again)), behind.off(&again)];
    for missing in missing {
        if missing.xy_mm > OFF_MAX_MM || missing.strays > 0 {
            broken.push(format!("something is missing: {missing:?}"));
        }
    }
    broken.extend(clean.misfed(&filament, gone_on.found.start_line));
    if config.extruder.as_ref().is_some_and(|extruder| rig.coldest < extruder.heater.min_extrude_temp) {
        broken.push(format!("filament was pushed through a nozzle of {:.0} °C", rig.coldest.0));
    }
    let mut lost_steps = 0;
    for (motor, lost) in rig.lost_steps().into_iter().filter(|(_, lost)| *lost > 0) {
        lost_steps += lost;
        broken.push(format!("{motor} lost {lost} steps"));
    }
    if !rig.is_cold() {
        broken.push("a heater is still on".to_owned());
    }
    Ok(Finding {
        lost_steps,
        path_error_mm: off.xy_mm.max(missing[0].xy_mm),
        z_error_mm: Some(gone_on.z_error_mm.map_or(off.z_mm, |error| off.z_mm.max(error.abs()))),
        gone_on: 1,
        measured: u32::from(gone_on.z_error_mm.is_some()),
        broken,
        ..Finding::default()
    })
}
