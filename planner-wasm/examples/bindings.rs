//! Writes the TypeScript types of the messages to stdout; `cargo xtask bindings` puts them in their place.
//!
//! Numbers get their unit from the suffix of their name, so that seconds and millimetres are not mixed up in TypeScript
//! either. The units are tags that only the compiler sees.

use std::collections::BTreeSet;

use planner_wasm::messages as m;
use printer::error::ErrorCode;
use ts_rs::{Config, TS};

/// Suffixes of names and the unit that they stand for.
const UNITS: [(&str, &str, &str); 7] = [
    ("_mm_s2", "MmPerS2", "mm/s²"),
    ("_mm_s", "MmPerS", "mm/s"),
    ("_mm", "Mm", "mm"),
    ("_hz", "Hertz", "Hz"),
    ("_bytes", "Bytes", "bytes"),
    ("_s", "Seconds", "s"),
    ("_c", "Celsius", "°C"),
];

/// A type's file: its name and what it holds, without the first lines.
struct File {
    name: String,
    text: String,
}

fn main() {
    let config = Config::new().with_large_int("number");
    let mut files = vec![units(), error_codes()];
    files.extend(declarations(&config));
    let names: Vec<String> = files.iter().map(|file| file.name.clone()).collect();
    for file in &files {
        // `cargo xtask bindings` cuts the files apart at these lines.
        println!("=== {}.ts", file.name);
        println!("// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.");
        for import in imports(file, &names) {
            println!("{import}");
        }
        println!("\n{}", file.text.trim_end());
    }
}

fn units() -> File {
    let lines = UNITS
        .map(|(_, name, unit)| format!("export type {name} = number & {{ readonly [unit]?: '{unit}' }};\n"));
    let text = format!("declare const unit: unique symbol;\n{}", lines.concat());
    File { name: "units".to_owned(), text }
}

fn error_codes() -> File {
    let codes: Vec<String> = ErrorCode::ALL.iter().map(|code| format!("  | '{code}'")).collect();
    let text =
        format!("/** Everything that can go wrong. */\nexport type ErrorCode =\n{};", codes.join("\n"));
    File { name: "ErrorCode".to_owned(), text }
}

/// The imports of the types that a file names.
fn imports(file: &File, names: &[String]) -> Vec<String> {
    let code: String = file.text.lines().filter(|line| !is_comment(line)).collect();
    let words: BTreeSet<&str> = code.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).collect();
    let used: Vec<&str> =
        UNITS.iter().map(|(_, name, _)| *name).filter(|name| words.contains(name)).collect();
    let mut lines = Vec::new();
    for name in names.iter().filter(|name| **name != file.name && words.contains(name.as_str())) {
        lines.push(format!("import type {{ {name} }} from './{name}';"));
    }
    if !used.is_empty() && file.name != "units" {
        lines.push(format!("import type {{ {} }} from './units';", used.join(", ")));
    }
    lines
}

fn is_comment(line: &str) -> bool {
    let line = line.trim_start();
    line.starts_with("/*") || line.starts_with('*')
}

fn declarations(config: &Config) -> Vec<File> {
    fn one<T: TS>(config: &Config) -> File {
        let docs = T::docs().unwrap_or_default();
        File { name: T::name(config), text: with_units(&format!("{docs}export {}", T::decl(config))) }
    }
    vec![
        one::<m::ErrorMessage>(config),
        one::<m::HeaterName>(config),
        one::<m::PhaseLabel>(config),
        one::<m::UiEvent>(config),
        one::<m::JogAxis>(config),
        one::<m::UiRequest>(config),
        one::<m::JobRequest>(config),
        one::<m::Snapshot>(config),
        one::<m::BoardView>(config),
        one::<m::TemperatureView>(config),
        one::<m::JobPhase>(config),
        one::<m::JobView>(config),
        one::<m::StartView>(config),
        one::<m::LinkView>(config),
        one::<m::ConfigReport>(config),
        one::<m::ConfigSeverity>(config),
        one::<m::ConfigFinding>(config),
        one::<m::MachineSummary>(config),
        one::<m::HeaterSummary>(config),
        one::<m::FileKindReport>(config),
        one::<m::FindingSeverity>(config),
        one::<m::Finding>(config),
        one::<m::Blocking>(config),
        one::<m::LayerSummary>(config),
        one::<m::FeatureSummary>(config),
        one::<m::PreviewSummary>(config),
        one::<m::JournalView>(config),
        one::<m::InterruptionView>(config),
        one::<m::TransformView>(config),
        one::<m::VirtualState>(config),
        one::<m::MotorState>(config),
        one::<m::HeaterState>(config),
        one::<m::FanState>(config),
        one::<m::EndstopState>(config),
    ]
}

/// Gives every number whose name ends in a unit that unit's type.
fn with_units(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(at) = rest.find("number") {
        let (before, after) = rest.split_at(at);
        out += before;
        let field = field_before(&out);
        let unit = UNITS.iter().find(|(suffix, _, _)| field.is_some_and(|field| field.ends_with(suffix)));
        out += unit.map_or("number", |(_, name, _)| name);
        rest = &after["number".len()..];
    }
    out + rest
}

/// The name of the field whose type is being written: what stands before the last colon, with nothing but brackets and
/// members of a tuple in between.
fn field_before(text: &str) -> Option<&str> {
    let (head, tail) = text.rsplit_once(':')?;
    let is_type = |c: char| c.is_ascii_alphanumeric() || "[]<>, |".contains(c);
    let start = head.rfind(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).map_or(0, |at| at + 1);
    (tail.chars().all(is_type) && !head[start..].is_empty()).then_some(&head[start..])
}
