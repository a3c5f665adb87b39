//! What a host sent for a whole small print, replayed from a text of decoded commands, one a line.
//!
//! The endstops never trigger. *Kept alive*, the homing time-outs are renewed as a live host does, and every step is
//! made. *Bare*, each homing ends by its time-out, and the steps after it are ignored.

use std::collections::BTreeMap;

use wire::{Response, messages::CommandKind, vlq};

use crate::bench::{Bench, SECOND};

/// How long before it is due a command reaches the board.
const LEAD_TICKS: u64 = SECOND / 10;
const RENEW_TICKS: u64 = SECOND / 10;
const TIMEOUT_TICKS: u64 = SECOND / 4;
const EXPIRED: u8 = 4;

struct Line {
    kind: CommandKind,
    fields: BTreeMap<String, i64>,
}

impl Line {
    fn parse(text: &str) -> Self {
        let mut words = text.split_whitespace();
        let name = words.next().expect("a command");
        let kind = *CommandKind::ALL.iter().find(|kind| kind.spec().name == name).expect("a known command");
        let fields = words.map(|word| {
            let (key, value) = word.split_once('=').expect("key=value");
            (key.to_owned(), value.trim_start_matches("gpio").parse().expect("a number"))
        });
        Self { kind, fields: fields.collect() }
    }

    fn get(&self, field: &str) -> i64 {
        self.fields[field]
    }

    fn oid(&self) -> u8 {
        self.get("oid") as u8
    }

    fn payload(&self) -> Vec<u8> {
        let spec = self.kind.spec();
        let mut bytes = Vec::new();
        vlq::encode(i32::from(spec.id), &mut bytes);
        for field in spec.fields {
            vlq::encode(self.get(field.name) as i32, &mut bytes);
        }
        bytes
    }

    fn ends_homing(&self) -> bool {
        self.kind == CommandKind::EndstopHome && self.get("sample_count") == 0
    }
}

/// A recorded session with what it means.
struct Recording {
    lines: Vec<Line>,
    /// When each line is sent: early enough for it and all that follow.
    send_at: Vec<u64>,
    /// By stepper: the direction and clock of every step.
    steps: BTreeMap<u8, Vec<(i32, u64)>>,
    /// By trigger: when each homing's time-out was set to be.
    timeouts: Vec<(u8, u64)>,
    end: u64,
}

impl Recording {
    fn read(text: &str) -> Self {
        let lines: Vec<Line> = text.lines().filter(|line| !line.is_empty()).map(Line::parse).collect();
        let mut steps: BTreeMap<u8, Vec<(i32, u64)>> = BTreeMap::new();
        let mut forward: BTreeMap<u8, i32> = BTreeMap::new();
        let mut timeouts = Vec::new();
        let mut due = Vec::new();
        for line in &lines {
            let clock = line.fields.get("clock").map(|&clock| clock as u64);
            due.push(match line.kind {
                CommandKind::QueueStep => {
                    let made = steps.entry(line.oid()).or_default();
                    let mut clock = made.last().map_or(0, |step| step.1);
                    let mut interval = line.get("interval");
                    let first = clock + interval as u64;
                    for _ in 0..line.get("count") {
                        clock += interval as u64;
                        interval += line.get("add");
                        made.push((forward.get(&line.oid()).copied().unwrap_or(-1), clock));
                    }
                    Some(first)
                }
                CommandKind::SetNextStepDir => {
                    forward.insert(line.oid(), if line.get("dir") == 0 { -1 } else { 1 });
                    None
                }
                CommandKind::TrsyncSetTimeout => {
                    timeouts.push((line.oid(), clock.expect("a clock")));
                    clock
                }
                CommandKind::TrsyncStart => Some(line.get("report_clock") as u64),
                CommandKind::EndstopHome if line.ends_homing() => None,
                _ => clock,
            });
        }
        let end = due.iter().flatten().chain(steps.values().flatten().map(|step| &step.1)).max();
        let end = end.copied().unwrap_or(0);
        let mut earliest = end;
        let mut send_at: Vec<u64> = due
            .iter()
            .rev()
            .map(|due| {
                earliest = earliest.min(due.unwrap_or(u64::MAX));
                earliest.saturating_sub(LEAD_TICKS)
            })
            .collect();
        send_at.reverse();
        Self { lines, send_at, steps, timeouts, end }
    }

    /// Plays it; the triggers that fired, in order: oid and reason.
    fn play(&self, bench: &mut Bench, keep_alive: bool) -> Vec<(u8, u8)> {
        let mut fired = Fired::default();
        let mut homing = None;
        let mut renew_at = 0;
        for (line, &at) in self.lines.iter().zip(&self.send_at) {
            while let Some(oid) = homing.filter(|_| keep_alive && renew_at <= at) {
                bench.run_until(renew_at);
                let clock = (bench.board.now + TIMEOUT_TICKS) as u32;
                bench.send(&wire::Command::TrsyncSetTimeout { oid, clock });
                renew_at += RENEW_TICKS;
            }
            bench.run_until(at);
            fired.look(bench);
            bench.send_payload(&line.payload());
            assert_eq!(bench.shutdown(), None, "{} at {at}", line.kind.spec().name);
            if line.kind == CommandKind::TrsyncSetTimeout {
                homing = Some(line.oid());
                renew_at = at + RENEW_TICKS;
            } else if line.ends_homing() {
                homing = None;
            }
        }
        bench.run_until(self.end + SECOND);
        fired.look(bench);
        assert_eq!(bench.shutdown(), None);
        fired.order
    }
}

/// Triggers that fired, each counted once however often it is reported.
#[derive(Default)]
struct Fired {
    states: BTreeMap<u8, bool>,
    order: Vec<(u8, u8)>,
}

impl Fired {
    fn look(&mut self, bench: &mut Bench) {
        let reports = bench.pick(|response| match *response {
            Response::TrsyncState { oid, can_trigger, trigger_reason, .. } => {
                Some((oid, can_trigger != 0, trigger_reason))
            }
            _ => None,
        });
        for (oid, is_armed, reason) in reports {
            if self.states.insert(oid, is_armed) == Some(true) && !is_armed {
                self.order.push((oid, reason));
            }
        }
    }
}

fn check_both_ways(text: &str, homings: usize) {
    let recording = Recording::read(text);

    let mut bench = Bench::at(0);
    let fired = recording.play(&mut bench, true);
    let mut plain = Bench::plain(0);
    assert_eq!(recording.play(&mut plain, true), fired);
    assert!(plain.board.edges == bench.board.edges, "a board without the motion clock makes other edges");
    assert_eq!(fired, [], "kept alive, no trigger fires");
    for (&oid, steps) in &recording.steps {
        assert_eq!(
            bench.position(oid),
            steps.iter().map(|step| step.0).sum::<i32>(),
            "stepper {oid}, kept alive"
        );
    }

    let mut bench = Bench::at(0);
    let fired = recording.play(&mut bench, false);
    let triggers: Vec<(u8, u8)> = recording.timeouts.iter().map(|timeout| (timeout.0, EXPIRED)).collect();
    assert_eq!(fired, triggers, "each homing ends by its time-out");
    assert_eq!(triggers.len(), homings);
    for (&oid, steps) in &recording.steps {
        let stop = recording.first_timeout_of(oid);
        let made = steps.iter().filter(|step| stop.is_none_or(|stop| step.1 < stop));
        assert_eq!(bench.position(oid), made.map(|step| step.0).sum::<i32>(), "stepper {oid}, bare");
    }
}

impl Recording {
    /// When the first homing of a stepper expires.
    fn first_timeout_of(&self, stepper: u8) -> Option<u64> {
        let obeys = |line: &&Line| {
            line.kind == CommandKind::StepperStopOnTrigger && line.get("oid") == i64::from(stepper)
        };
        let trigger = self.lines.iter().find(obeys)?.get("trsync_oid") as u8;
        self.timeouts.iter().find(|timeout| timeout.0 == trigger).map(|timeout| timeout.1)
    }
}

#[test]
fn a_small_print_of_our_own_replays_both_ways() {
    check_both_ways(include_str!("../data/homing-and-moves.txt"), 2);
}

#[test]
fn a_recorded_klippy_session_replays_both_ways() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let shared = std::env::var_os("STEPCAST_SHARED").map_or_else(|| root.join("../shared"), Into::into);
    let path = shared.join("data/klippy-tiny-commands.txt.gz");
    let Ok(packed) = std::fs::read(&path) else {
        println!("not run: {} is not there", path.display());
        return;
    };
    let text = gunzip(&packed);
    check_both_ways(&text, 6);
}

/// Unpacks a gzip file that has no optional header fields but a name.
fn gunzip(packed: &[u8]) -> String {
    use std::io::Read;
    let mut text = String::new();
    flate2::read::GzDecoder::new(packed).read_to_string(&mut text).expect("a gzip file");
    text
}
