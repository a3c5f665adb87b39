//! What a print's plan depends on besides its file and the machine file, written down before it takes effect.
//!
//! The plan is a function of file, machine and what is journaled here, so that a host that has lost everything else can
//! make the same plan again ([`Replay`]) and go on where the board holds. A journal is text: a line is a record, the
//! CRC-32 of its JSON before it. It is only ever added to, so one that was torn off is right up to where it was torn.
//!
//! Knows no board, no time and no storage: the owner keeps the bytes, and must have kept them before it sends what it got
//! at the same time.

mod replay;
mod rows;

use core::fmt::Write as _;
use std::collections::BTreeSet;

use crc::{CRC_32_ISO_HDLC, Crc};
use serde::{Deserialize, Serialize};
use units::{Hertz, Seconds};

pub(crate) use self::{
    replay::{Advance, Continuation, Replay, TimedDue},
    rows::{BoardQueue, MotorQueue, Row},
};

use crate::{
    config::PrinterConfig,
    machine::MOTORS,
    planner::{Position, Source},
    transform::TransformRecord,
};

/// The format that is written.
pub const FORMAT: u32 = 2;
/// The formats that are read. The first does not say where Z's motor stands.
const FORMATS: core::ops::RangeInclusive<u32> = 1..=FORMAT;
/// The most bytes that wait for the owner. One that takes none keeps no journal.
pub const PENDING_BYTES_MAX: usize = 1024 * 1024;
/// The most bytes of a journal that are read: a print of weeks.
pub const JOURNAL_BYTES_MAX: usize = 64 * 1024 * 1024;
/// Progress is written no more often than this, and with no more delay than this: some 5 MB in a day of printing …
pub const PROGRESS_INTERVAL: Seconds = Seconds(1.0);
/// … but for progress at another height, which is written sooner: 20 MB where it goes up and down all the time.
pub const HEIGHT_INTERVAL: Seconds = Seconds(0.25);

static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// A place in a job's plan, at which something changed it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Place {
    /// Items of the plan before it.
    pub items: u64,
    /// Everything in this many bytes of the file had been read; where nothing is said, no more than the items took.
    pub drained: Option<u64>,
}

/// What changed a plan.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Input {
    /// The run of motion was brought to its end.
    FinishRun,
    /// The speed factor, 1 is as written.
    Speed(f64),
    /// The extrusion factor.
    Flow(f64),
    /// The user set the fan, 0 ..= 1. Not part of the plan either.
    Fan(f64),
    /// The user set a heater, in °C. Not part of the plan, but of what it is carried out with.
    Target(HeaterName, f64),
}

impl Input {
    /// Gives a factor to what reads the file; everything else is none of its business.
    fn apply_factor(self, source: &mut Source) {
        match self {
            Self::Speed(factor) => source.set_speed_factor(factor),
            Self::Flow(factor) => source.interpreter.set_flow_factor(factor),
            Self::FinishRun | Self::Fan(_) | Self::Target(..) => {}
        }
    }
}

/// How far a motor has come in the rows of a run of motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RowPlace {
    /// Rows that have been made.
    pub done: u32,
    /// Of the next, the steps that are left; 0 where none of them has been made.
    pub left: u16,
}

impl RowPlace {
    /// The place of a motor whose rows the board counts from here.
    pub(crate) const fn after(self, queue: &MotorQueue) -> Self {
        // The first row that is counted may be the rest of one: then that has not been made whole before.
        let left = if queue.done == 0 && queue.left == 0 { self.left } else { queue.left };
        Self { done: self.done.saturating_add(queue.done), left }
    }
}

/// Where a motor stood in its rows when the board dropped them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Dropped {
    /// Rows that it had received …
    pub received: u32,
    /// … and made.
    pub done: u32,
    /// Steps of the next that it had not made.
    pub left: u16,
    /// The level of its direction pin for them.
    pub dir: bool,
    /// Steps counted since power-up.
    pub position: i32,
    /// The check over its rows.
    pub crc: u32,
}

/// A heater in a journal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HeaterName {
    /// The nozzle.
    Nozzle,
    /// The bed.
    Bed,
}

impl HeaterName {
    /// As everywhere else.
    pub(crate) const fn heater(self) -> gcode::Heater {
        match self {
            Self::Nozzle => gcode::Heater::Tool(0),
            Self::Bed => gcode::Heater::Bed,
        }
    }
}

/// A print that was put aside in the middle of a run of motion, or just behind it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parked {
    /// The board's number while the head is anywhere else.
    pub id: u32,
    /// The number under which it counted before.
    pub of: u32,
    /// Motion had been brought to rest; else the run had come to its end.
    pub is_cut: bool,
    /// Where each motor stood.
    pub motors: [Dropped; MOTORS],
    /// The low half of the motion clock then.
    pub rest: u32,
    /// The filament that is pulled back, in mm.
    pub retract: f64,
}

/// A line of a journal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Record {
    /// A print began.
    Began {
        /// [`FORMAT`].
        format: u32,
        /// The print's own number.
        print: u32,
        /// [`machine_check`] of its machine.
        machine: u32,
        /// The board's nominal clock in Hz.
        clock: u32,
        /// Where the machine stood, and which axes were homed.
        position: Position,
        /// See `position`.
        homed: [bool; 3],
        /// What made up for skew and bed.
        #[serde(default, skip_serializing_if = "TransformRecord::is_none")]
        transform: TransformRecord,
        /// Blocking lines that were confirmed …
        confirmed: BTreeSet<u32>,
        /// … or all of them.
        confirm_all: bool,
        /// The line with which the print begins, where that is not the first.
        start_line: Option<u32>,
    },
    /// Something changed the plan.
    Input {
        /// Where.
        at: Place,
        /// What.
        input: Input,
    },
    /// The board counts the rows of a run of motion from here on, under this number.
    Run {
        /// The board's number.
        id: u32,
        /// The run's place among those of the print, from 1.
        run: u32,
        /// The low half of the motion clock of the run's begin.
        start: u32,
        /// Where each motor's count begins.
        from: [RowPlace; MOTORS],
    },
    /// The print was put aside, and the head leaves the part: meanwhile the board counts under this number.
    Parked(Parked),
    /// A host that began anew took up the plan: of the inputs so far only so many had come into force.
    Continued {
        /// See the record.
        inputs: usize,
    },
    /// The print got so far.
    Progress {
        /// The line of the last move that has been made.
        line: u32,
        /// Print time in seconds.
        elapsed: f64,
    },
    /// What is known of where the Z axis stands.
    Height(Height),
    /// So far are axes from where the plan has them, in mm: what homing others could not put right in whole steps. Written
    /// where it changes; nothing at first.
    Off([f64; 3]),
    /// The print is over, one way or another.
    Ended,
}

/// What is known of where the Z axis stands: its position is one thing, how far its motor has been turned another.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Height {
    /// At this position in mm …
    pub z: f64,
    /// … the board counted its motor here, in microsteps towards higher positions.
    pub count: i32,
    /// The board has counted since its drivers were powered up, as far as is known: from the count follows how they have
    /// set the motor's coils.
    pub since_power_up: bool,
    /// Who moves it.
    pub by: MovedBy,
}

/// Who moves the Z axis from a place of the journal on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MovedBy {
    /// The lines of the file.
    File,
    /// Nobody: it rests there.
    Nobody,
    /// Something that is not in the journal: homing, or the user in a pause. Position and count are those before.
    Others,
}

/// What distinguishes a machine from others, as far as a plan depends on it.
pub fn machine_check(config: &PrinterConfig) -> u32 {
    struct Check(crc::Digest<'static, u32>);
    impl core::fmt::Write for Check {
        fn write_str(&mut self, text: &str) -> core::fmt::Result {
            self.0.update(text.as_bytes());
            Ok(())
        }
    }
    let mut check = Check(CRC.digest());
    // Nothing that is written there can fail.
    let _ = write!(check, "{config:?}");
    check.0.finalize()
}

/// Writes records.
#[derive(Clone, Debug, Default)]
pub struct Writer {
    pending: String,
    /// More came than the owner took: what follows would make no sense.
    is_broken: bool,
}

impl Writer {
    /// Adds a record.
    pub fn write(&mut self, record: &Record) {
        let Ok(json) = serde_json::to_string(record) else { return };
        self.is_broken |= self.pending.len() + json.len() > PENDING_BYTES_MAX;
        if !self.is_broken {
            // Writing to a string does not fail.
            let _ = writeln!(self.pending, "{:08x} {json}", CRC.checksum(json.as_bytes()));
        }
    }

    /// What was written since this was last asked.
    pub fn take(&mut self) -> String {
        core::mem::take(&mut self.pending)
    }
}

/// Why a journal is of no use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum JournalError {
    /// It has no readable begin.
    #[error("its begin is missing or damaged")]
    NoBegin,
    /// Another version of the program wrote it.
    #[error("it was written in format {0}, which this version does not read")]
    Format(u32),
    /// It is longer than any print's.
    #[error("it is too long")]
    TooLong,
    /// The print is over.
    #[error("its print has ended")]
    Ended,
}

/// A journal that has been read.
#[derive(Clone, Debug, PartialEq)]
pub struct Journal {
    /// The print's own number.
    pub print: u32,
    machine: u32,
    clock: Hertz,
    position: Position,
    homed: [bool; 3],
    transform: TransformRecord,
    /// Blocking lines that were confirmed.
    pub confirmed: BTreeSet<u32>,
    /// Whether all of them were.
    pub confirm_all: bool,
    /// The line with which the print begins, where that is not the first.
    pub start_line: Option<u32>,
    inputs: Vec<(Place, Input)>,
    runs: Vec<CountedRun>,
    parked: Vec<Parked>,
    /// The last of the board's numbers.
    last_id: u32,
    /// The line of the last move that was seen to be made, and the print time then.
    pub progress: Option<(u32, Seconds)>,
    /// What was last known of where the Z axis stands.
    pub height: Option<Height>,
    /// See [`Record::Off`].
    off_mm: [f64; 3],
    /// Whether the print is over.
    pub has_ended: bool,
    /// Bytes that could be read; what follows them was torn off or damaged.
    pub bytes: usize,
}

/// See [`Record::Run`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct CountedRun {
    id: u32,
    run: u32,
    start: u32,
    from: [RowPlace; MOTORS],
}

impl Journal {
    /// Reads a journal up to where it is torn off.
    pub fn read(bytes: &[u8]) -> Result<Self, JournalError> {
        if bytes.len() > JOURNAL_BYTES_MAX {
            return Err(JournalError::TooLong);
        }
        let mut rest = bytes;
        let mut journal = None;
        while let Some((record, tail)) = next_record(rest) {
            match (&mut journal, record) {
                (None, record) => journal = Some(Self::begin(record)?),
                (Some(journal), record) => journal.add(&record),
            }
            rest = tail;
        }
        let mut journal = journal.ok_or(JournalError::NoBegin)?;
        journal.bytes = bytes.len() - rest.len();
        Ok(journal)
    }

    fn begin(record: Record) -> Result<Self, JournalError> {
        let Record::Began {
            format,
            print,
            machine,
            clock,
            position,
            homed,
            transform,
            confirmed,
            confirm_all,
            start_line,
        } = record
        else {
            return Err(JournalError::NoBegin);
        };
        if !FORMATS.contains(&format) {
            return Err(JournalError::Format(format));
        }
        Ok(Self {
            print,
            machine,
            clock: Hertz(clock),
            position,
            homed,
            transform,
            confirmed,
            confirm_all,
            start_line,
            inputs: Vec::new(),
            runs: Vec::new(),
            parked: Vec::new(),
            last_id: print,
            progress: None,
            height: None,
            off_mm: [0.0; 3],
            has_ended: false,
            bytes: 0,
        })
    }

    fn add(&mut self, record: &Record) {
        match *record {
            Record::Input { at, input } => self.inputs.push((at, input)),
            Record::Continued { inputs } => self.inputs.truncate(inputs),
            Record::Run { id, run, start, from } => {
                self.last_id = id;
                self.runs.push(CountedRun { id, run, start, from });
            }
            Record::Parked(parked) => {
                self.last_id = parked.id;
                self.parked.push(parked);
            }
            Record::Progress { line, elapsed } => self.progress = Some((line, Seconds(elapsed))),
            Record::Height(height) => self.height = Some(height),
            Record::Off(off_mm) => self.off_mm = off_mm,
            // A second begin belongs to another print, which has no place in this journal.
            Record::Began { .. } | Record::Ended => self.has_ended = true,
        }
    }

    /// The speed and flow factors that the user set last, where they did.
    pub fn factors(&self) -> [Option<f64>; 2] {
        let mut factors = [None; 2];
        for (_, input) in &self.inputs {
            match *input {
                Input::Speed(factor) => factors[0] = Some(factor),
                Input::Flow(factor) => factors[1] = Some(factor),
                Input::FinishRun | Input::Fan(_) | Input::Target(..) => {}
            }
        }
        factors
    }

    /// Where the machine stood when the print began, where it began with its file.
    pub(crate) fn began_at(&self) -> Option<Position> {
        self.start_line.is_none().then_some(self.position)
    }

    /// What made up for skew and bed when it began.
    pub(crate) const fn transform(&self) -> &TransformRecord {
        &self.transform
    }

    /// Whether it was begun on this machine.
    pub(crate) fn is_of(&self, config: &PrinterConfig) -> bool {
        self.machine == machine_check(config)
    }

    /// Whether a board that counts under this number carries out this print.
    pub fn knows(&self, id: u32) -> bool {
        self.runs.iter().any(|run| run.id == id) || self.parked.iter().any(|parked| parked.id == id)
    }

    /// What a board would say of the print had it not been put aside, and how it was, if it was.
    fn unparked(&self, queue: BoardQueue) -> (BoardQueue, Option<Parked>) {
        let Some(&parked) = self.parked.iter().rfind(|parked| parked.id == queue.id) else {
            return (queue, None);
        };
        let motors = parked.motors.map(|motor| {
            let Dropped { received, done, left, dir, position, crc } = motor;
            MotorQueue { received, done, left, dir, position, crc, ..MotorQueue::default() }
        });
        (BoardQueue { id: parked.of, is_held: parked.is_cut, motors }, Some(parked))
    }
}

/// The first record of a text, and what follows it.
fn next_record(bytes: &[u8]) -> Option<(Record, &[u8])> {
    let end = bytes.iter().position(|&byte| byte == b'\n')?;
    let line = core::str::from_utf8(&bytes[..end]).ok()?;
    let (check, json) = line.split_once(' ')?;
    let check = (check.len() == 8).then(|| u32::from_str_radix(check, 16).ok())??;
    let record = (CRC.checksum(json.as_bytes()) == check).then(|| serde_json::from_str(json).ok())??;
    Some((record, &bytes[end + 1..]))
}

#[cfg(test)]
mod tests;
