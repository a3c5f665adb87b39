//! What a campaign amounts to, a class a scenario: JSON with stable keys, and text.

use std::fmt::Write as _;

use serde::Serialize;

use super::{judge::Finding, scenario::Scenario};

/// The most broken promises of a class that are told one by one.
const BROKEN_SHOWN_MAX: usize = 20;

/// All prints of one scenario.
#[derive(Debug, Serialize)]
pub(super) struct Class {
    scenario: Scenario,
    runs: u32,
    lost_steps: u64,
    path_error_max_mm: f64,
    /// From the moment at which the lease ran out; `null` where motion was not to rest.
    time_to_rest_max_s: Option<f64>,
    /// From the fault until all heaters were off; `null` where they were to stay on.
    time_to_safe_heaters_max_s: Option<f64>,
    wrong_resumes: u32,
    restarts_without_consent: u32,
    /// How often the board held its motion.
    holds: u32,
    /// Of what was printed after a loss of power, from its height; `null` where none was.
    z_error_max_mm: Option<f64>,
    /// How often the user had to measure where Z stands.
    measured: u32,
    /// How many prints were gone on with after their power was lost.
    gone_on: u32,
    /// Prints that did not keep what is promised.
    broken: u32,
    broken_runs: Vec<Broken>,
}

/// A promise that was not kept.
#[derive(Debug, Serialize)]
pub(super) struct Broken {
    /// `--runs 1 --seed SEED --scenario …` is this print alone.
    pub(super) seed: u64,
    pub(super) board: String,
    pub(super) window: String,
    pub(super) faults: String,
    pub(super) what: Vec<String>,
}

impl Class {
    pub(super) const fn new(scenario: Scenario) -> Self {
        Self {
            scenario,
            runs: 0,
            lost_steps: 0,
            path_error_max_mm: 0.0,
            time_to_rest_max_s: None,
            time_to_safe_heaters_max_s: None,
            wrong_resumes: 0,
            restarts_without_consent: 0,
            holds: 0,
            z_error_max_mm: None,
            measured: 0,
            gone_on: 0,
            broken: 0,
            broken_runs: Vec::new(),
        }
    }

    /// Adds a print; `about` says what it was, where that is wanted.
    pub(super) fn add(&mut self, finding: &Finding, about: impl FnOnce(Vec<String>) -> Broken) {
        let most = |of: &mut Option<f64>, new: Option<f64>| {
            if let Some(new) = new {
                *of = Some(of.map_or(new, |of| of.max(new)));
            }
        };
        self.runs += 1;
        self.lost_steps += finding.lost_steps;
        self.path_error_max_mm = self.path_error_max_mm.max(finding.path_error_mm);
        most(&mut self.time_to_rest_max_s, finding.time_to_rest_s);
        most(&mut self.time_to_safe_heaters_max_s, finding.time_to_safe_heaters_s);
        self.wrong_resumes += finding.wrong_resumes;
        self.restarts_without_consent += finding.restarts_without_consent;
        self.holds += finding.holds;
        most(&mut self.z_error_max_mm, finding.z_error_mm);
        self.measured += finding.measured;
        self.gone_on += finding.gone_on;
        if !finding.broken.is_empty() {
            self.broken += 1;
            if self.broken_runs.len() < BROKEN_SHOWN_MAX {
                self.broken_runs.push(about(finding.broken.clone()));
            }
        }
    }

    /// Puts the broken ones in the order of their seeds, however many ran at a time.
    pub(super) fn sort(&mut self) {
        self.broken_runs.sort_by_key(|broken| broken.seed);
    }

    pub(super) const fn is_kept(&self) -> bool {
        self.broken == 0
    }
}

/// As text for people.
pub(super) fn text(classes: &[Class]) -> String {
    let mut text = String::new();
    let _ = writeln!(
        text,
        "{:<18}{:>6}{:>8}{:>7}{:>12}{:>11}{:>10}{:>13}{:>14}",
        "scenario",
        "runs",
        "broken",
        "holds",
        "lost steps",
        "path mm",
        "rest s",
        "heaters s",
        "wrong resumes"
    );
    let seconds = |of: Option<f64>| of.map_or_else(|| "-".to_owned(), |of| format!("{of:.3}"));
    for class in classes {
        let name = serde_json::to_value(class.scenario).ok();
        let _ = writeln!(
            text,
            "{:<18}{:>6}{:>8}{:>7}{:>12}{:>11.4}{:>10}{:>13}{:>14}",
            name.as_ref().and_then(|name| name.as_str()).unwrap_or_default(),
            class.runs,
            class.broken,
            class.holds,
            class.lost_steps,
            class.path_error_max_mm,
            seconds(class.time_to_rest_max_s),
            seconds(class.time_to_safe_heaters_max_s),
            class.wrong_resumes,
        );
        if let Some(z) = class.z_error_max_mm {
            let _ = writeln!(
                text,
                "  Z {z:.4} mm off at most, {} gone on with, measured {} times",
                class.gone_on, class.measured
            );
        }
        for broken in &class.broken_runs {
            let Broken { seed, board, window, faults, what } = broken;
            let _ = writeln!(text, "  --seed {seed}: {} ({window}, {board}, {faults})", what.join("; "));
        }
    }
    text
}
