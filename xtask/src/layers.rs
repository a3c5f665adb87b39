//! Who may use whom: the last column of ARCHITECTURE.md as a program.
//!
//! Checks that every crate has a row here, uses only what its row lists, that there are no circles, that the pure
//! crates' sources reach for no file, clock, thread or terminal, and that the paths ARCHITECTURE.md names exist.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use anyhow::{Context, Result, bail};

use crate::sources;
use crate::workspace::{self, Package};

/// What a crate may use.
struct Layer {
    name: &'static str,
    /// Its place, relative to the root.
    folder: &'static str,
    /// Crates of this workspace that it may be built from.
    may_use: &'static [&'static str],
    /// Further crates that its tests may use.
    tests_may_use: &'static [&'static str],
    /// It touches no file, clock, thread or terminal: time and bytes are arguments.
    pure: bool,
}

const BOARD: &[&str] = &["firmware-core", "virtual-printer"];

const LAYERS: &[Layer] = &[
    Layer { name: "units", folder: "crates/units", may_use: &[], tests_may_use: &[], pure: true },
    Layer { name: "wire", folder: "crates/wire", may_use: &["units"], tests_may_use: &[], pure: true },
    Layer { name: "gcode", folder: "crates/gcode", may_use: &["units"], tests_may_use: &[], pure: true },
    Layer {
        name: "motion",
        folder: "crates/motion",
        may_use: &["units", "gcode"],
        tests_may_use: &[],
        pure: true,
    },
    Layer {
        name: "steps",
        folder: "crates/steps",
        may_use: &["units", "motion", "wire"],
        tests_may_use: &["gcode"],
        pure: true,
    },
    Layer {
        name: "printer",
        folder: "crates/printer",
        may_use: &["units", "wire", "gcode", "motion", "steps"],
        tests_may_use: BOARD,
        pure: true,
    },
    Layer {
        name: "firmware-core",
        folder: "mcu_firmware/core",
        may_use: &["units", "wire"],
        tests_may_use: &[],
        pure: true,
    },
    Layer {
        name: "virtual-printer",
        folder: "mcu_firmware/virtual_printer",
        may_use: &["units", "wire", "firmware-core"],
        tests_may_use: &[],
        pure: true,
    },
    Layer {
        name: "planner-wasm",
        folder: "planner-wasm",
        may_use: &["units", "gcode", "printer", "firmware-core", "virtual-printer", "demo-machine"],
        tests_may_use: &[],
        pure: true,
    },
    Layer {
        name: "demo-machine",
        folder: "crates/demo_machine",
        may_use: &["units", "printer", "firmware-core", "virtual-printer"],
        tests_may_use: &[],
        pure: true,
    },
    Layer {
        name: "stepcast",
        folder: "crates/stepcast",
        may_use: &[
            "units",
            "wire",
            "gcode",
            "motion",
            "steps",
            "printer",
            "firmware-core",
            "virtual-printer",
            "demo-machine",
        ],
        tests_may_use: &[],
        pure: false,
    },
    Layer { name: "instruments", folder: "viz/instruments", may_use: &[], tests_may_use: &[], pure: true },
    Layer { name: "xtask", folder: "xtask", may_use: &[], tests_may_use: &[], pure: false },
];

/// `cargo xtask layers`.
pub(crate) fn run() -> Result<()> {
    let packages = workspace::packages()?;
    let mut findings = check(&packages);
    findings.extend(circles(&packages));
    for layer in LAYERS.iter().filter(|layer| layer.pure) {
        findings.extend(sources::impurities(&workspace::root().join(layer.folder).join("src"))?);
    }
    let architecture = workspace::root().join("ARCHITECTURE.md");
    let text = fs::read_to_string(&architecture)
        .with_context(|| format!("cannot read {}", architecture.display()))?;
    let paths = paths_named(&text);
    for path in &paths {
        if !workspace::root().join(path).exists() {
            findings.push(format!("ARCHITECTURE.md names `{path}`, which does not exist"));
        }
    }
    if findings.is_empty() {
        println!(
            "{} crates keep to their layers; {} paths of ARCHITECTURE.md exist",
            packages.len(),
            paths.len()
        );
        return Ok(());
    }
    for finding in &findings {
        eprintln!("{finding}");
    }
    bail!("{} findings", findings.len())
}

fn check(packages: &[Package]) -> Vec<String> {
    let mut findings = Vec::new();
    for package in packages {
        let Some(layer) = LAYERS.iter().find(|layer| layer.name == package.name) else {
            findings.push(format!(
                "{}: no row in xtask/src/layers.rs: add one, and one in ARCHITECTURE.md",
                package.name
            ));
            continue;
        };
        if layer.folder != package.folder {
            findings
                .push(format!("{}: lies in {}, its row says {}", package.name, package.folder, layer.folder));
        }
        for used in package.uses.iter().filter(|used| !layer.may_use.contains(&used.as_str())) {
            findings.push(format!("{}: uses {used}, may use {}", package.name, layer.may_use.join(", ")));
        }
        for used in &package.tests_use {
            if !layer.may_use.contains(&used.as_str()) && !layer.tests_may_use.contains(&used.as_str()) {
                findings.push(format!("{}: its tests use {used}, which its row does not list", package.name));
            }
        }
    }
    findings
}

/// Crates that are built from themselves, by whatever way round. Tests are left out: cargo allows them to.
fn circles(packages: &[Package]) -> Vec<String> {
    let uses: BTreeMap<&str, &BTreeSet<String>> =
        packages.iter().map(|package| (package.name.as_str(), &package.uses)).collect();
    let reaches_itself = |start: &str| {
        let mut seen = BTreeSet::new();
        let mut open = vec![start];
        while let Some(name) = open.pop() {
            for next in uses.get(name).into_iter().flat_map(|used| used.iter()) {
                if next == start {
                    return true;
                }
                if seen.insert(next.as_str()) {
                    open.push(next);
                }
            }
        }
        false
    };
    let in_circles = packages.iter().filter(|package| reaches_itself(&package.name));
    in_circles.map(|package| format!("{}: is part of a circle of crates", package.name)).collect()
}

/// The paths in a text's `code`: words of path characters with a `/` inside or at the end, or with a file's suffix.
fn paths_named(markdown: &str) -> BTreeSet<String> {
    const SUFFIXES: [&str; 10] =
        [".rs", ".toml", ".md", ".mjs", ".json", ".cfg", ".gcode", ".stl", ".ini", ".lock"];
    let is_path = |word: &str| {
        let plain = word.chars().all(|c| c.is_ascii_alphanumeric() || "._-/".contains(c));
        let from_root = !word.starts_with('/') && !word.starts_with("..");
        plain && from_root && (word.contains('/') || SUFFIXES.iter().any(|suffix| word.ends_with(suffix)))
    };
    let mut fenced = false;
    let mut found = BTreeSet::new();
    for line in markdown.lines() {
        if line.starts_with("```") {
            fenced = !fenced;
        } else if !fenced {
            let code = line.split('`').skip(1).step_by(2);
            found.extend(code.filter(|word| is_path(word)).map(str::to_owned));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn package(name: &str, folder: &str, uses: &[&str], tests_use: &[&str]) -> Package {
        let set = |names: &[&str]| names.iter().map(|&used| used.to_owned()).collect();
        Package { name: name.into(), folder: folder.into(), uses: set(uses), tests_use: set(tests_use) }
    }

    #[test]
    fn a_crate_that_keeps_to_its_row_is_fine() {
        let packages = [
            package("units", "crates/units", &[], &[]),
            package("printer", "crates/printer", &["units", "steps"], &["virtual-printer"]),
        ];
        assert_eq!(check(&packages), Vec::<String>::new());
    }

    #[test]
    fn upward_use_a_moved_crate_and_a_crate_without_a_row_are_found() {
        let packages = [
            package("wire", "crates/wire", &["printer"], &["stepcast"]),
            package("gcode", "elsewhere", &[], &[]),
            package("stranger", "crates/stranger", &[], &[]),
        ];
        let findings = check(&packages);
        assert_eq!(findings.len(), 4, "{findings:?}");
        assert!(findings[0].starts_with("wire: uses printer"));
        assert!(findings[1].starts_with("wire: its tests use stepcast"));
        assert!(findings[2].starts_with("gcode: lies in elsewhere"));
        assert!(findings[3].starts_with("stranger: no row"));
    }

    #[test]
    fn circles_are_found_whatever_their_length() {
        let packages = [
            package("a", "a", &["b"], &[]),
            package("b", "b", &["c"], &[]),
            package("c", "c", &["a"], &[]),
            package("d", "d", &["a"], &["d"]),
        ];
        assert_eq!(circles(&packages).len(), 3);
        assert_eq!(circles(&packages[1..]).len(), 0);
    }

    #[test]
    fn every_row_lists_only_rows_and_no_row_is_twice() {
        let names: BTreeSet<_> = LAYERS.iter().map(|layer| layer.name).collect();
        assert_eq!(names.len(), LAYERS.len());
        for layer in LAYERS {
            for used in layer.may_use.iter().chain(layer.tests_may_use) {
                assert!(names.contains(used), "{} lists {used}", layer.name);
            }
        }
    }

    #[test]
    fn paths_are_told_from_other_code() {
        let text = "See `crates/wire`, `ARCHITECTURE.md` and `a b/c`.\n```\n`fenced/path`\n```\n`queue_step` `../shared` `x(t)`";
        let expected: BTreeSet<String> = ["ARCHITECTURE.md", "crates/wire"].map(String::from).into();
        assert_eq!(paths_named(text), expected);
    }
}
