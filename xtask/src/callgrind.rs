//! Reads a callgrind profile: how many instructions each source file and function spent itself.
//!
//! Self cost, not inclusive: with optimisation the stages' functions are inlined into each other, and only the source
//! file of an instruction still says which stage it belongs to.
//!
//! Source: "Callgrind Format Specification" in Valgrind's manual.

use std::collections::{BTreeMap, HashMap};

use anyhow::{Context, Result};

/// Instructions by (source file, function).
pub(crate) type SelfCosts = BTreeMap<(String, String), u64>;

/// Names are written out once, as `(7) name`, and later called `(7)`.
#[derive(Default)]
struct Names(HashMap<String, String>);

impl Names {
    fn resolve(&mut self, value: &str) -> String {
        let Some((id, rest)) = value.strip_prefix('(').and_then(|value| value.split_once(')')) else {
            return value.to_owned();
        };
        let rest = rest.trim_start();
        if !rest.is_empty() {
            self.0.insert(id.to_owned(), rest.to_owned());
        }
        self.0.get(id).cloned().unwrap_or_default()
    }
}

/// The self costs in a profile with one event (instructions) and one position (line).
pub(crate) fn self_costs(profile: &str) -> Result<SelfCosts> {
    let (mut files, mut functions) = (Names::default(), Names::default());
    let (mut file, mut function) = (String::new(), String::new());
    let mut costs = SelfCosts::new();
    let mut is_call = false;
    for line in profile.lines() {
        if let Some((key, value)) = line.split_once('=') {
            match key {
                "fl" | "fi" | "fe" => file = files.resolve(value),
                "fn" => function = functions.resolve(value),
                "cfl" | "cfi" => drop(files.resolve(value)),
                "cfn" => drop(functions.resolve(value)),
                // The next line holds what the callee cost, which the callee's own lines hold already.
                "calls" => is_call = true,
                _ => {}
            }
        } else if line.starts_with(|first: char| first.is_ascii_digit() || "+-*".contains(first)) {
            let cost = line.split_whitespace().nth(1).map_or(Ok(0), str::parse::<u64>);
            let cost = cost.with_context(|| format!("not a cost: {line}"))?;
            if !std::mem::take(&mut is_call) {
                *costs.entry((file.clone(), function.clone())).or_default() += cost;
            }
        }
    }
    Ok(costs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adds_up_self_costs_over_inlined_files_and_leaves_calls_out() {
        let profile = "events: Ir\npositions: line\n\nfl=(1) a.rs\nfn=(1) main\n10 5\ncfi=(2) b.rs\ncfn=(2) work\n\
                       calls=3 20\n+1 900\n* 7\nfi=(2)\n22 11\nfe=(1)\n-2 1\n\nfl=(2)\nfn=(2)\n20 900\n\ntotals: 924\n";
        let costs = self_costs(profile).unwrap();
        let of = |file: &str, function: &str| costs[&(file.to_owned(), function.to_owned())];
        assert_eq!(of("a.rs", "main"), 13);
        assert_eq!(of("b.rs", "main"), 11);
        assert_eq!(of("b.rs", "work"), 900);
        assert_eq!(costs.values().sum::<u64>(), 924);
    }

    #[test]
    fn what_is_no_number_is_an_error() {
        assert!(self_costs("fl=a\nfn=b\n1 many\n").is_err());
    }
}
