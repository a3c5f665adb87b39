//! What goes wrong in each scenario, and when.
//!
//! Knows the clean print's times and nothing of what is made of the faulty one: see [`super::judge`]. Times are seconds of
//! the board's time since power-up.

use clap::ValueEnum;
use serde::Serialize;
use units::Seconds;
use virtual_printer::{BoardProfile, ByteFaults, Failure, FailureKind, Faults, HostStall, UserPause};

use super::chance::Chance;

/// The shares of bytes that are hit.
const BYTES_HIT: std::ops::Range<f64> = 0.0001..0.01;
/// Half of the prints have the worst of them.
const WORST_PART: f64 = 0.5;
/// Stalls of the host.
const STALL_S: std::ops::Range<f64> = 0.1..60.0;
/// Stalls up to here leave the pulses unchanged: the lease of 2 s, less the time since it was renewed and a line's delay.
const STALL_SHORT_S: f64 = 1.7;
/// Stalls that a plain board does not sit out.
const STALL_PLAIN_S: std::ops::Range<f64> = 3.5..60.0;
/// Pauses, from the rest to the user's word …
const PAUSE_S: std::ops::Range<f64> = 0.0..20.0;
/// … another one so long after the first was asked for …
const PAUSE_AGAIN_S: std::ops::Range<f64> = 0.0..40.0;
/// … and a host that dies about then.
const DEATH_AROUND_S: std::ops::Range<f64> = 0.0..15.0;
/// A host's place is empty for so long.
const AWAY_S: std::ops::Range<f64> = 0.01..600.0;
/// The user says yes so long after a hold was shown.
const CONSENT_S: std::ops::Range<f64> = 0.0..3.0;

/// What goes wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
#[value(rename_all = "snake_case")]
pub(crate) enum Scenario {
    /// Bytes are replaced by others; the block check is on
    Corrupt,
    /// Bytes have a bit flipped; the board's firmware is a plain one
    Flip,
    /// Bytes are lost
    Drop,
    /// Bytes come twice
    Duplicate,
    /// Bytes, and all behind them, come late
    Delay,
    /// The host does nothing for a while
    Stall,
    /// The host is gone for good
    HostDeath,
    /// The host is gone, and another takes the print up and goes on
    TakeUp,
    /// The same, with a journal that is torn off somewhere
    TornJournal,
    /// The board starts anew
    BoardReset,
    /// A temperature sensor comes off or is short-circuited
    SensorFault,
    /// The host of a board with plain firmware is gone for good
    PlainHostDeath,
    /// The host of a board with plain firmware does nothing for a while
    PlainStall,
    /// The user pauses the print, once or twice; in half of them the host dies about then, and another takes it up
    Pause,
    /// The power goes, and the print is gone on with from a line
    PowerLoss,
}

/// What has to come of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Promise {
    /// The same edges at the same ticks of each run of motion, and no hold.
    SamePulses,
    /// The same steps, after one hold and the user's word.
    SameSteps,
    /// The same steps, or a refusal with a reason.
    SameStepsOrRefused,
    /// At rest on the path in time, no step lost, the heaters off.
    AtRest,
    /// The print has failed, with a reason of the catalogue, and the heaters are off.
    Fails,
    /// The board's own watch over its heaters has stopped everything.
    Shutdown,
    /// Either the same pulses or a failure with a reason.
    SameOrFails,
}

/// One print with a fault.
#[derive(Clone, Debug)]
pub(super) struct Case {
    pub(super) board: BoardProfile,
    pub(super) faults: Faults,
    pub(super) host_dies: Option<Seconds>,
    /// Another host takes its place so long after, with so much of its journal.
    pub(super) successor: Option<(Seconds, f64)>,
    pub(super) consent_after: Option<Seconds>,
    pub(super) promise: Promise,
    /// When the fault happens, where it happens once.
    pub(super) at: Option<Seconds>,
}

impl Case {
    /// Nothing goes wrong.
    pub(super) fn clean(board: BoardProfile) -> Self {
        Self {
            board,
            faults: Faults::default(),
            host_dies: None,
            successor: None,
            consent_after: None,
            promise: Promise::SamePulses,
            at: None,
        }
    }
}

/// The clean print's times.
#[derive(Clone, Copy, Debug)]
pub(super) struct Times {
    /// The first run of motion begins.
    pub(super) began: Seconds,
    /// The job is over.
    pub(super) ended: Seconds,
}

impl Scenario {
    /// Whether its boards have plain firmware; `None` where either will do.
    const fn is_plain(self) -> Option<bool> {
        match self {
            Self::Flip | Self::PlainHostDeath | Self::PlainStall => Some(true),
            Self::Drop | Self::Duplicate | Self::Delay | Self::PowerLoss => None,
            Self::Corrupt
            | Self::Stall
            | Self::HostDeath
            | Self::TakeUp
            | Self::TornJournal
            | Self::Pause
            | Self::BoardReset
            | Self::SensorFault => Some(false),
        }
    }

    /// The board of a run.
    pub(super) fn board(self, chance: &mut Chance) -> BoardProfile {
        let board = chance.pick(&BoardProfile::all()).clone();
        let is_plain = self.is_plain().unwrap_or_else(|| chance.part() < 0.5);
        if is_plain { board.plain() } else { board }
    }

    /// What goes wrong in a print that takes these times when nothing does.
    pub(super) fn case(self, board: BoardProfile, times: Times, chance: &mut Chance) -> Case {
        let at = Seconds(chance.between(times.began.0..times.ended.0));
        let mut case = Case::clean(board);
        match self {
            Self::Corrupt | Self::Flip | Self::Drop | Self::Duplicate | Self::Delay => {
                case.faults.bytes = self.bytes(chance);
            }
            Self::Stall | Self::PlainStall => self.stall(&mut case, at, chance),
            Self::HostDeath | Self::PlainHostDeath => {
                (case.host_dies, case.at) = (Some(at), Some(at));
                case.promise = if self == Self::HostDeath { Promise::AtRest } else { Promise::Shutdown };
            }
            Self::TakeUp | Self::TornJournal => {
                let torn = self == Self::TornJournal;
                let part = if torn { chance.part() } else { 1.0 };
                (case.host_dies, case.at) = (Some(at), Some(at));
                case.successor = Some((Seconds(chance.magnitude(AWAY_S)), part));
                case.consent_after = Some(Seconds(chance.between(CONSENT_S)));
                case.promise = if torn { Promise::SameStepsOrRefused } else { Promise::SameSteps };
            }
            Self::Pause => Self::pause(&mut case, at, chance),
            // What happens there has a judge of its own.
            Self::PowerLoss => {}
            Self::BoardReset | Self::SensorFault => {
                let kind = if self == Self::BoardReset { FailureKind::BoardReset } else { sensor(chance) };
                case.faults.failures.push(Failure { at, kind });
                (case.promise, case.at) = (Promise::Fails, Some(at));
            }
        }
        case
    }

    fn bytes(self, chance: &mut Chance) -> ByteFaults {
        let worst = chance.part() < WORST_PART;
        let hit = if worst { BYTES_HIT.end } else { chance.magnitude(BYTES_HIT) };
        let mut bytes = ByteFaults::default();
        let of = match self {
            Self::Corrupt => &mut bytes.corrupt,
            Self::Flip => &mut bytes.flip,
            Self::Drop => &mut bytes.drop,
            Self::Duplicate => &mut bytes.duplicate,
            _ => &mut bytes.delay,
        };
        *of = hit;
        bytes
    }

    fn pause(case: &mut Case, at: Seconds, chance: &mut Chance) {
        let mut ask = |at: Seconds, chance: &mut Chance| {
            case.faults.pauses.push(UserPause { at, lasts: Seconds(chance.between(PAUSE_S)) });
        };
        ask(at, chance);
        if chance.part() < 0.5 {
            ask(at + Seconds(chance.between(PAUSE_AGAIN_S)), chance);
        }
        if chance.part() < 0.5 {
            case.host_dies = Some(at + Seconds(chance.between(DEATH_AROUND_S)));
            case.successor = Some((Seconds(chance.magnitude(AWAY_S)), 1.0));
            case.consent_after = Some(Seconds(chance.between(CONSENT_S)));
        }
        (case.promise, case.at) = (Promise::SameSteps, Some(at));
    }

    fn stall(self, case: &mut Case, at: Seconds, chance: &mut Chance) {
        let lasts = Seconds(chance.magnitude(if self == Self::PlainStall { STALL_PLAIN_S } else { STALL_S }));
        case.faults.host_stalls.push(HostStall { at, lasts });
        case.at = Some(at);
        case.promise = match self {
            Self::PlainStall => Promise::SameOrFails,
            _ if lasts.0 <= STALL_SHORT_S => Promise::SamePulses,
            _ => {
                case.consent_after = Some(Seconds(chance.between(CONSENT_S)));
                Promise::SameSteps
            }
        };
    }
}

fn sensor(chance: &mut Chance) -> FailureKind {
    let heater = (*chance.pick(&["extruder", "heater_bed"])).to_owned();
    if chance.part() < 0.5 { FailureKind::SensorOpen(heater) } else { FailureKind::SensorShort(heater) }
}
