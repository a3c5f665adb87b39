//! `cargo xtask bench motion`: what the way from G-code to bytes costs, in instructions a step.
//!
//! Instructions, not seconds: the same on a busy machine as on an idle one. Needs valgrind; says so where it is
//! missing and is content.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};
use serde::{Deserialize, Serialize};

use crate::callgrind::{self, SelfCosts};
use crate::workspace;

/// Source files are shown below their stage when they take at least this share of the whole.
const FILE_SHARE_MIN: f64 = 0.01;

/// Stages below this share of the whole are shown as one.
const STAGE_SHARE_MIN: f64 = 0.001;

/// The part of `stepcast plan --json` that this needs.
#[derive(Deserialize)]
struct Plan {
    motors: BTreeMap<String, PlannedMotor>,
    bytes_per_step: f64,
    moves: u64,
}

#[derive(Deserialize)]
struct PlannedMotor {
    steps: u64,
}

/// `cargo xtask bench motion [FILE] [--config PRINTER.CFG] [--json]`.
pub(crate) fn motion(file: Option<PathBuf>, config: Option<PathBuf>, json: bool) -> Result<()> {
    if Command::new("valgrind").arg("--version").output().is_err() {
        println!("not run: valgrind is not on the PATH (Debian, Ubuntu: apt install valgrind)");
        return Ok(());
    }
    let here = std::env::current_dir().context("no current folder")?;
    let sample = |name: &str| workspace::root().join("samples").join(name);
    let file = file.map_or_else(|| sample("test-part.gcode"), |file| here.join(file));
    let config = config.map_or_else(|| sample("printer.cfg"), |config| here.join(config));
    workspace::run(workspace::cargo().args(["build", "--package=stepcast", "--release"]))?;
    let target = workspace::target_directory()?;
    let profile = target.join("callgrind.motion");
    eprintln!("planning {} under valgrind, some fifty times slower than without", file.display());
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--quiet", &format!("--callgrind-out-file={}", profile.display())])
        .arg(target.join("release").join("stepcast"))
        .args(["plan", "--json", "--config"])
        .args([&config, &file])
        .output()
        .context("cannot start valgrind")?;
    if !output.status.success() {
        bail!("stepcast plan failed under valgrind:\n{}", String::from_utf8_lossy(&output.stderr));
    }
    let plan: Plan =
        serde_json::from_slice(&output.stdout).context("stepcast plan --json wrote something else")?;
    let costs = callgrind::self_costs(&fs::read_to_string(&profile).context("valgrind wrote no profile")?)?;
    let summary = Summary::new(&plan, &costs, fs::metadata(&file)?.len());
    if json {
        println!("{}", serde_json::to_string_pretty(&summary)?);
        return Ok(());
    }
    report(&file, &plan, &costs);
    println!("\n{:<44}{:>24}", "stage", "instructions a step");
    for (stage, cost) in &summary.instructions_per_step {
        println!("  {stage:<42}{cost:>24.1}");
    }
    println!("parsing: {:.1} instructions a byte of G-code", summary.parse_instructions_per_byte);
    Ok(())
}

/// The figures by stages of the way, and of the whole of it.
#[derive(Serialize)]
struct Summary {
    moves: u64,
    steps: u64,
    bytes_per_step: f64,
    instructions_per_step: BTreeMap<&'static str, f64>,
    /// Of the file as it lies there: means nothing for a compressed one.
    parse_instructions_per_byte: f64,
}

impl Summary {
    fn new(plan: &Plan, costs: &SelfCosts, file_bytes: u64) -> Self {
        let steps = plan.motors.values().map(|motor| motor.steps).sum::<u64>();
        let mut stages = BTreeMap::<&'static str, u64>::new();
        for ((source, function), cost) in costs {
            let (krate, module) = place(source, function);
            *stages.entry(stage_of(&krate, &module)).or_default() += cost;
            *stages.entry("whole").or_default() += cost;
        }
        let parse = stages.get("parse").copied().unwrap_or(0);
        let per_step = |(stage, cost): (&'static str, u64)| (stage, cost as f64 / steps.max(1) as f64);
        Self {
            moves: plan.moves,
            steps,
            bytes_per_step: plan.bytes_per_step,
            instructions_per_step: stages.into_iter().map(per_step).collect(),
            parse_instructions_per_byte: parse as f64 / file_bytes.max(1) as f64,
        }
    }
}

/// The stage of the way that a crate's module belongs to.
fn stage_of(krate: &str, module: &str) -> &'static str {
    let packs = ["stabbing", "compressor", "windows", "ahead"];
    match krate {
        "gcode" | "memchr" => "parse",
        "motion" | "printer" => "plan",
        "steps" if packs.iter().any(|name| module.contains(name)) => "compression",
        "steps" => "step times",
        "wire" | "crc" => "encode",
        _ => "libraries",
    }
}

fn report(file: &Path, plan: &Plan, costs: &SelfCosts) {
    let steps = plan.motors.values().map(|motor| motor.steps).sum::<u64>().max(1) as f64;
    let total = costs.values().sum::<u64>() as f64;
    let mut stages: BTreeMap<String, (f64, BTreeMap<String, f64>)> = BTreeMap::new();
    for ((source, function), cost) in costs {
        let (stage, module) = place(source, function);
        let entry = stages.entry(stage).or_default();
        entry.0 += *cost as f64;
        *entry.1.entry(module).or_default() += *cost as f64;
    }
    println!(
        "{}: {} moves, {steps} steps, {:.3} bytes a step",
        file.display(),
        plan.moves,
        plan.bytes_per_step
    );
    println!("{:<44}{:>14}{:>10}", "", "instructions", "a step");
    println!("{:<44}{total:>14}{:>10.1}", "whole path", total / steps);
    let mut order: Vec<_> = stages.into_iter().collect();
    order.sort_by(|(_, a), (_, b)| b.0.total_cmp(&a.0));
    let shown = order.iter().take_while(|(_, (cost, _))| *cost >= STAGE_SHARE_MIN * total).count();
    let rest: f64 = order.drain(shown..).map(|(_, (cost, _))| cost).sum();
    for (stage, (cost, modules)) in order {
        println!("  {stage:<42}{cost:>14}{:>10.1}", cost / steps);
        let mut modules: Vec<_> =
            modules.into_iter().filter(|(_, cost)| *cost >= FILE_SHARE_MIN * total).collect();
        modules.sort_by(|(_, a), (_, b)| b.total_cmp(a));
        for (module, cost) in modules.into_iter().filter(|(module, _)| *module != stage) {
            println!("    {module:<40}{cost:>14}{:>10.1}", cost / steps);
        }
    }
    println!("  {:<42}{rest:>14}{:>10.1}", "the rest", rest / steps);
}

/// The stage (a crate of ours, or the library) and the module that an instruction belongs to.
fn place(source: &str, function: &str) -> (String, String) {
    let source = source.replace('\\', "/");
    if let Some((_, inside)) = source.split_once("/registry/src/") {
        let package = inside.split('/').nth(1).unwrap_or(inside);
        let name = package.rsplit_once('-').map_or(package, |(name, _)| name);
        return (name.to_owned(), name.to_owned());
    }
    if let Some((folder, module)) = source.rsplit_once("/src/") {
        let ours = ["crates/", "mcu_firmware/"].iter().find_map(|above| folder.rsplit_once(above));
        let ours = ours.map(|(_, name)| name).or_else(|| source.strip_prefix("crates/")?.split('/').next());
        if let Some(name) = ours.filter(|name| !name.contains('/')) {
            return (name.to_owned(), format!("{name}: {module}"));
        }
    }
    // The standard library, inlined into or instantiated for one of our functions.
    let mut owner = function.trim_start_matches(['<', '&', '*']).split("::");
    let krate = owner.next().unwrap_or_default();
    let ours = ["gcode", "motion", "steps", "printer", "wire", "stepcast", "units"];
    if ours.contains(&krate) {
        let module = owner.next().unwrap_or_default();
        return (krate.to_owned(), format!("{krate}: standard library in {module}"));
    }
    ("libraries".to_owned(), "libraries".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stage(source: &str, function: &str) -> String {
        place(source, function).0
    }

    #[test]
    fn instructions_find_their_stage() {
        assert_eq!(stage("/x/y/crates/gcode/src/words.rs", "main"), "gcode");
        assert_eq!(stage("crates/steps/src/compress.rs", "motion::LookAhead::pop"), "steps");
        assert_eq!(stage("/c/registry/src/index-1/libm-0.2.16/src/math/sin.rs", "x"), "libm");
        assert_eq!(stage("/rustc/abc/library/core/src/num/f64.rs", "<motion::LookAhead>::pop"), "motion");
        assert_eq!(stage("/rustc/abc/library/alloc/src/vec.rs", "alloc::vec::Vec::push"), "libraries");
        assert_eq!(stage("???", "memcpy"), "libraries");
        assert_eq!(stage_of("steps", "steps: standard library in stabbing"), "compression");
        assert_eq!(stage_of("steps", "steps: crossing.rs"), "step times");
        assert_eq!(place("/x/crates/steps/src/compress.rs", "f").1, "steps: compress.rs");
    }
}
