//! `stepcast plan`: what a file takes on a machine.

use std::{
    collections::BTreeMap,
    fmt::Write as _,
    fs::File,
    io::{BufWriter, Write as _},
    path::Path,
    process::ExitCode,
};

use anyhow::Context;
use printer::{
    machine::{self, MOTORS},
    planner::{LayerTotal, PlanOptions, PlanReport, PlanStream, Ramps, Total},
};
use serde::Serialize;
use steps::StepSearch;
use units::{MmPerS3, Seconds};

use crate::{
    cli::{PlanArgs, Profile, Search},
    config_file,
    console::{self, Progress},
    input::Input,
    trace_file::TraceFile,
};

/// The result as JSON; the keys are stable.
#[derive(Debug, Serialize)]
struct Report {
    print_time_s: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    bound_s: Option<f64>,
    moves: u64,
    motors: BTreeMap<&'static str, Motor>,
    bytes: u64,
    bytes_per_step: f64,
    max_step_error_us: f64,
    filament_mm: f64,
    /// Lines that were left out, and the first of them.
    skipped_lines: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    first_skipped_line: Option<u32>,
    features: Vec<Feature>,
    #[serde(skip_serializing_if = "Option::is_none")]
    layers: Option<Vec<Layer>>,
}

/// What a kind of extrusion takes; also travel, retraction and pause.
#[derive(Debug, Serialize)]
struct Feature {
    name: &'static str,
    time_s: f64,
    filament_mm: f64,
}

#[derive(Debug, Serialize)]
struct Layer {
    first_line: u32,
    z_mm: f64,
    time_s: f64,
    filament_mm: f64,
}

#[derive(Debug, Serialize)]
struct Motor {
    steps: u64,
    queue_steps: u64,
    peak_steps_per_s: f64,
}

impl Report {
    /// Of a plan for a machine whose motors have these names.
    fn of(plan: &PlanReport, names: [&'static str; MOTORS]) -> Self {
        let motors = names.into_iter().zip(&plan.motors).map(|(name, motor)| {
            let &printer::planner::MotorReport { steps, queue_steps, peak_steps_per_s } = motor;
            (name, Motor { steps, queue_steps, peak_steps_per_s })
        });
        let steps: u64 = plan.motors.iter().map(|motor| motor.steps).sum();
        Self {
            print_time_s: plan.print_time.0,
            bound_s: plan.bound.map(|bound| bound.0),
            moves: plan.moves,
            motors: motors.collect(),
            bytes: plan.bytes,
            bytes_per_step: if steps == 0 { 0.0 } else { plan.bytes as f64 / steps as f64 },
            max_step_error_us: plan.step_error_max.0 * 1e6,
            filament_mm: plan.filament_mm,
            skipped_lines: plan.skipped_lines,
            first_skipped_line: plan.first_skipped.map(|line| line.0),
            features: plan.features.iter().map(|&(name, total)| Feature::new(name, total)).collect(),
            layers: None,
        }
    }
}

impl Feature {
    const fn new(name: &'static str, total: Total) -> Self {
        Self { name, time_s: total.time.0, filament_mm: total.filament.0 }
    }
}

impl From<&LayerTotal> for Layer {
    fn from(layer: &LayerTotal) -> Self {
        let LayerTotal { first_line, z, total } = *layer;
        Self { first_line, z_mm: z.0, time_s: total.time.0, filament_mm: total.filament.0 }
    }
}

/// Runs the command.
pub(crate) fn run(args: &PlanArgs) -> anyhow::Result<ExitCode> {
    let config = config_file::load(&args.config)?;
    let mut input = Input::open(&args.file)?;
    let mut dump = args.dump_stream.as_deref().map(Dump::create).transpose()?;
    let progress = Progress::new("planning", input.size());
    let options = PlanOptions {
        feed_scale: args.feed_scale,
        bound: args.bound,
        minimum_cruise_ratio: args.minimum_cruise_ratio,
        ramps: args.profile.map(|profile| match profile {
            Profile::Trapezoid => Ramps::Even,
            Profile::Torque => Ramps::Torque,
            Profile::Jerk => Ramps::Jerk(args.max_jerk.map(MmPerS3)),
        }),
        step_error: args.step_error_us.map(|error_us| Seconds(error_us * 1e-6)),
        step_search: args.step_search.map(|search| match search {
            Search::Usual => StepSearch::Usual,
            Search::Ahead => StepSearch::Ahead,
        }),
        trace: args.trace.is_some().then_some(Seconds(args.trace_step_ms * 1e-3)),
    };
    let mut trace = TraceFile::create(args.trace.as_deref())?;
    let mut stream = PlanStream::with_options(&config, options)?;
    let mut blocks = Vec::new();
    loop {
        let chunk = input.next(stream.wants())?;
        if chunk.is_empty() {
            break;
        }
        stream.feed_to(chunk, &mut blocks, &mut trace)?;
        trace.check()?;
        flush(&mut dump, &mut blocks)?;
        progress.set(input.position());
    }
    let plan = stream.finish_to(&mut blocks, &mut trace)?;
    trace.finish()?;
    flush(&mut dump, &mut blocks)?;
    if let Some(dump) = dump {
        dump.finish()?;
    }
    drop(progress);
    let names = machine::motor_names(&config);
    let mut report = Report::of(&plan, names);
    report.layers = args.layers.then(|| plan.layers.iter().map(Layer::from).collect());
    if args.json {
        console::print_json(&report)?;
    } else {
        console::print(&text(&report, names));
    }
    Ok(ExitCode::SUCCESS)
}

/// The stream of blocks as a file.
struct Dump<'a> {
    path: &'a Path,
    file: BufWriter<File>,
}

impl<'a> Dump<'a> {
    fn create(path: &'a Path) -> anyhow::Result<Self> {
        let file = File::create(path).with_context(|| format!("cannot create {}", path.display()))?;
        Ok(Self { path, file: BufWriter::new(file) })
    }

    fn finish(mut self) -> anyhow::Result<()> {
        self.file.flush().with_context(|| format!("cannot write {}", self.path.display()))
    }
}

fn flush(dump: &mut Option<Dump<'_>>, blocks: &mut Vec<u8>) -> anyhow::Result<()> {
    if let Some(dump) = dump {
        dump.file.write_all(blocks).with_context(|| format!("cannot write {}", dump.path.display()))?;
    }
    blocks.clear();
    Ok(())
}

fn text(report: &Report, names: [&'static str; MOTORS]) -> String {
    let mut text = String::new();
    let time = console::duration_text(report.print_time_s);
    let _ = writeln!(text, "Print time   {time} ({:.2} s)", report.print_time_s);
    if let Some(bound) = report.bound_s {
        let ratio = report.print_time_s / bound;
        let _ = writeln!(
            text,
            "Least time   {} ({bound:.2} s), the plan takes {ratio:.5} times that",
            console::duration_text(bound)
        );
    }
    let _ = writeln!(text, "Filament     {:.1} mm", report.filament_mm);
    let _ = writeln!(text, "Moves        {}", report.moves);
    for Feature { name, time_s, filament_mm } in &report.features {
        let time = console::duration_text(*time_s);
        let _ = writeln!(text, "  {name:<18} {time:>14} {filament_mm:>12.1} mm");
    }
    let _ = writeln!(text, "Motor              steps  queue_steps    peak steps/s");
    for name in names {
        if let Some(motor) = report.motors.get(name) {
            let Motor { steps, queue_steps, peak_steps_per_s } = motor;
            let _ = writeln!(text, "  {name:<10} {steps:>11} {queue_steps:>12} {peak_steps_per_s:>15.0}");
        }
    }
    let _ = writeln!(text, "Stream       {} bytes, {:.3} bytes a step", report.bytes, report.bytes_per_step);
    let _ = writeln!(text, "Step times   at most {:.2} µs off", report.max_step_error_us);
    if let Some(line) = report.first_skipped_line {
        let _ = writeln!(
            text,
            "Left out     {} lines, the first is line {line}: `stepcast check` says why",
            report.skipped_lines
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use gcode::LineNumber;
    use printer::{machine::MOTOR_NAMES, planner::MotorReport};
    use units::Seconds;

    #[test]
    fn the_json_has_the_keys_that_are_documented() {
        let mut plan = PlanReport { print_time: Seconds(12.5), bytes: 300, ..PlanReport::default() };
        plan.motors[1] = MotorReport { steps: 1000, queue_steps: 10, peak_steps_per_s: 2e4 };
        plan.step_error_max = Seconds(25e-6);
        let report = Report::of(&plan, MOTOR_NAMES);
        let json = serde_json::to_value(&report).unwrap();
        let keys: Vec<_> = json.as_object().unwrap().keys().map(String::as_str).collect();
        let mut wanted = [
            "print_time_s",
            "moves",
            "motors",
            "bytes",
            "bytes_per_step",
            "max_step_error_us",
            "filament_mm",
            "skipped_lines",
            "features",
        ];
        wanted.sort_unstable();
        assert_eq!(keys, wanted);
        assert_eq!(json["motors"]["stepper_y"]["queue_steps"], 10);
        assert_eq!(json["bytes_per_step"], 0.3);
        assert!((json["max_step_error_us"].as_f64().unwrap() - 25.0).abs() < 1e-9);
        let shown = text(&report, MOTOR_NAMES);
        assert!(shown.contains("stepper_y         1000") && !shown.contains("Left out"), "{shown}");
    }

    #[test]
    fn a_plan_without_steps_divides_by_nothing() {
        assert_eq!(Report::of(&PlanReport::default(), MOTOR_NAMES).bytes_per_step, 0.0);
    }

    #[test]
    fn lines_that_are_left_out_are_told() {
        let plan =
            PlanReport { skipped_lines: 2, first_skipped: Some(LineNumber(7)), ..PlanReport::default() };
        let report = Report::of(&plan, MOTOR_NAMES);
        let shown = text(&report, MOTOR_NAMES);
        assert!(shown.contains("Left out     2 lines, the first is line 7"), "{shown}");
        assert_eq!(serde_json::to_value(&report).unwrap()["first_skipped_line"], 7);
    }
}
