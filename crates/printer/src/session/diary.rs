//! The journal of the present job: where its plan is, and what is written of it.
//!
//! Knows when something is to be written, not what it means: that is [`crate::journal`]. A job that keeps none leaves
//! everything here at rest.

#[cfg(test)]
mod tests;

use units::{Seconds, Ticks};
use wire::Command;

use super::{board::Board, job::JobOptions};
use crate::{
    config::PrinterConfig,
    journal::{
        Continuation, Dropped, FORMAT, HEIGHT_INTERVAL, HeaterName, Height, Input, MotorQueue, MovedBy,
        PROGRESS_INTERVAL, Parked, Place, Record, RowPlace, Writer, machine_check,
    },
    machine::MOTORS,
    planner::{Planned, Planner},
};

/// The number under which the board counts what is in no journal.
const NO_JOB: u32 = 0;
/// What the board says is this old at most, on a link that works.
const HEARD_LATE: Seconds = Seconds(0.1);
/// Position and count of an axis agree to so many microsteps: both are rounded.
const ROUNDING_STEPS: f64 = 1.5;
/// Heights that are nearer than this, in mm, are one: half a usual layer. Over a bed that is not flat, each piece of a line
/// ends at another height.
const SAME_HEIGHT_MM: f64 = 0.05;

/// See the module.
#[derive(Debug, Default)]
pub(super) struct Diary {
    writer: Writer,
    job: Option<Job>,
}

#[derive(Debug)]
struct Job {
    place: Place,
    /// Runs of motion so far.
    runs: u32,
    /// The number under which the board counts.
    id: u32,
    told: Seconds,
    /// The last progress by this host's clock, which the board need not have lived to see …
    seen: Option<Progress>,
    /// … that of a moment at which the board was heard of …
    waiting: Option<(Progress, Seconds)>,
    /// … and that after which it was heard of again: it has not been written.
    made: Option<Progress>,
    /// The height of the last that was written.
    told_z: f64,
    /// What was last written of where Z stands.
    height: Option<Height>,
    /// What was last written of how far axes are from where the plan has them.
    off_mm: [f64; 3],
    /// The board counts since its drivers were powered up, as far as is known.
    since_power_up: bool,
    /// It is put aside, and can be taken up from there.
    parked: Option<Parked>,
}

impl Job {
    /// Another number for the board.
    fn next_id(&mut self) -> u32 {
        self.id = self.id.wrapping_add(1).max(NO_JOB + 1);
        self.id
    }
}

/// The end of a line's move.
#[derive(Clone, Copy, Debug)]
pub(super) struct Progress {
    pub(super) line: u32,
    /// Print time.
    pub(super) elapsed: Seconds,
    /// In mm.
    pub(super) z: f64,
}

impl Diary {
    /// What was written since this was last asked.
    pub(super) fn take(&mut self) -> String {
        self.writer.take()
    }

    /// A job begins, which is journaled where it has a number.
    pub(super) fn begin(
        &mut self,
        options: &JobOptions,
        config: &PrinterConfig,
        planner: &Planner,
        since_power_up: bool,
        now: Seconds,
    ) {
        let Some(print) = options.journal else { return };
        self.writer.write(&Record::Began {
            format: FORMAT,
            print,
            machine: machine_check(config),
            clock: planner.clock().0,
            position: planner.position(),
            transform: options.transform.clone().unwrap_or_else(|| planner.transform().record()),
            homed: planner.guard.homed(),
            confirmed: options.confirmed_lines.clone(),
            confirm_all: options.confirm_all,
            start_line: options.start_line.filter(|&line| line > 1),
        });
        self.job = Some(Job {
            place: Place::default(),
            runs: 0,
            id: print,
            told: now,
            seen: None,
            waiting: None,
            made: None,
            told_z: f64::NAN,
            height: None,
            off_mm: [0.0; 3],
            since_power_up,
            parked: None,
        });
    }

    /// A job is taken up again.
    pub(super) fn take_up(&mut self, taken: &Continuation, now: Seconds) {
        self.writer.write(&Record::Continued { inputs: taken.inputs });
        let (place, runs, id) = (taken.place, taken.runs, taken.id);
        for &input in &taken.adopted {
            self.writer.write(&Record::Input { at: place, input });
        }
        let height = taken.height;
        let since_power_up = height.is_some_and(|height| height.since_power_up);
        self.job = Some(Job {
            place,
            runs,
            id,
            told: now,
            seen: None,
            waiting: None,
            made: None,
            told_z: f64::NAN,
            height,
            off_mm: taken.off_mm,
            since_power_up,
            parked: taken.parked,
        });
    }

    /// The job is over, at rest: the board holds nothing any more that could be gone on with.
    pub(super) fn end(&mut self, board: &mut Board) {
        self.lose_place(board);
        if self.job.take().is_some() {
            self.writer.write(&Record::Ended);
        }
    }

    /// The job's planner gave an item; `fed` bytes of its file have been handed over.
    pub(super) const fn planned(&mut self, planned: &Planned, fed: u64) {
        let Some(job) = &mut self.job else { return };
        if matches!(planned, Planned::NeedsInput) {
            job.place.drained = Some(fed);
        } else {
            job.place = Place { items: job.place.items + 1, drained: None };
        }
    }

    /// Something changes the job's plan here.
    pub(super) fn input(&mut self, input: Input) {
        if let Some(job) = &self.job {
            self.writer.write(&Record::Input { at: job.place, input });
        }
    }

    /// The user sets a heater.
    pub(super) fn target(&mut self, heater: gcode::Heater, celsius: f64) {
        let name = match heater {
            gcode::Heater::Tool(0) => HeaterName::Nozzle,
            gcode::Heater::Bed => HeaterName::Bed,
            _ => return,
        };
        self.input(Input::Target(name, celsius));
    }

    /// A run of the job's motion begins at a motion clock: the board counts its rows, whether or not they are journaled.
    pub(super) fn run(&mut self, start: Ticks, board: &mut Board) {
        if let Some(job) = &mut self.job {
            job.runs += 1;
        }
        self.count(start, [RowPlace::default(); MOTORS], board);
    }

    /// The board counts the rows of the present run anew, from there.
    pub(super) fn count(&mut self, start: Ticks, from: [RowPlace; MOTORS], board: &mut Board) {
        if !board.layout.has_motion_clock {
            return;
        }
        let Some(job) = &mut self.job else { return board.control(&Command::MotionJob { id: NO_JOB }) };
        job.parked = None;
        let id = job.next_id();
        board.control(&Command::MotionJob { id });
        self.writer.write(&Record::Run { id, run: job.runs, start: start.low().0, from });
    }

    /// The job is put aside where its motors stand so; then the head is moved. It can be taken up as long as only the
    /// planner moves it.
    pub(super) fn park(
        &mut self,
        queues: &[MotorQueue; MOTORS],
        is_cut: bool,
        rest: Ticks,
        retract: f64,
        board: &mut Board,
    ) {
        let Some(job) = &mut self.job else { return };
        let of = job.id;
        let id = job.next_id();
        board.control(&Command::MotionJob { id });
        let motors = queues.map(|queue| {
            let MotorQueue { received, done, left, dir, position, crc, .. } = queue;
            Dropped { received, done, left, dir, position, crc }
        });
        let parked = Parked { id, of, is_cut, motors, rest: rest.low().0, retract };
        job.parked = Some(parked);
        self.writer.write(&Record::Parked(parked));
    }

    /// What moved the head of a job that is put aside was broken off, and the board has dropped it: it counts anew.
    pub(super) fn stay_parked(&mut self, board: &mut Board) {
        let Some(job) = &mut self.job else { return };
        let Some(parked) = job.parked else { return };
        let parked = Parked { id: job.next_id(), ..parked };
        job.parked = Some(parked);
        board.control(&Command::MotionJob { id: parked.id });
        self.writer.write(&Record::Parked(parked));
    }

    /// A run begins that is none of the job's. Unless the job was put aside, it cannot be taken up any more.
    pub(super) fn other_run(&mut self, board: &mut Board) {
        if self.job.as_ref().is_none_or(|job| job.parked.is_none()) {
            self.lose_place(board);
        }
    }

    /// Where the machine stands is told by other things than its motors' counts: the job cannot be taken up.
    pub(super) fn lose_place(&mut self, board: &mut Board) {
        if let Some(job) = self.job.as_mut().filter(|_| board.layout.has_motion_clock) {
            job.parked = None;
            board.control(&Command::MotionJob { id: NO_JOB });
        }
    }

    /// By this host's clock, the print got to the end of a line's move.
    pub(super) const fn progress(&mut self, progress: Progress) {
        if let Some(job) = &mut self.job {
            job.seen = Some(progress);
        }
    }

    /// The board was heard of: what had been made a little before has been made.
    pub(super) fn heard(&mut self, now: Seconds) {
        let Some(job) = &mut self.job else { return };
        if let Some((made, _)) = job.waiting.take_if(|(_, at)| now - *at >= HEARD_LATE) {
            job.made = Some(made);
        }
        if job.waiting.is_none() {
            job.waiting = job.seen.take().map(|seen| (seen, now));
        }
    }

    /// Writes how far the print is, from time to time, and soon after it has got to another height: whoever goes on below
    /// what has been made already goes through it.
    pub(super) fn tell_progress(&mut self, now: Seconds) {
        let is_due = |job: &Job| {
            let is_told = |z: f64| (z - job.told_z).abs() <= SAME_HEIGHT_MM;
            let is_new_height = job.made.is_some_and(|made| !is_told(made.z));
            now - job.told >= if is_new_height { HEIGHT_INTERVAL } else { PROGRESS_INTERVAL }
        };
        if self.job.as_ref().is_some_and(is_due) {
            self.tell_last(now);
        }
    }

    /// Writes how far the print is: it may be the last that is heard of it.
    pub(super) fn tell_last(&mut self, now: Seconds) {
        let Some(job) = &mut self.job else { return };
        if let Some(Progress { line, elapsed, z }) = job.made.take() {
            (job.told, job.told_z) = (now, z);
            self.writer.write(&Record::Progress { line, elapsed: elapsed.0 });
        }
    }

    /// The Z axis is at a position in mm where its motor's count is `count`, in microsteps of `step_mm` towards higher
    /// positions. Written where it says something new.
    pub(super) fn height(&mut self, z: f64, count: i32, by: MovedBy, step_mm: f64) {
        let Some(job) = &mut self.job else { return };
        let is_known = |told: &Height| {
            let turned = f64::from(count.wrapping_sub(told.count));
            let agrees = ((z - told.z) / step_mm - turned).abs() <= ROUNDING_STEPS;
            told.by == by && agrees && (by == MovedBy::File || count == told.count)
        };
        if !job.height.as_ref().is_some_and(is_known) {
            let height = Height { z, count, since_power_up: job.since_power_up, by };
            job.height = Some(height);
            self.writer.write(&Record::Height(height));
        }
    }

    /// How far axes are from where the planner has them, in mm. Written where it is not what was written last.
    pub(super) fn off(&mut self, off_mm: [f64; 3]) {
        let Some(job) = self.job.as_mut().filter(|job| job.off_mm != off_mm) else { return };
        job.off_mm = off_mm;
        self.writer.write(&Record::Off(off_mm));
    }

    /// Whether Z is where something has moved it that is not in the journal.
    pub(super) fn is_z_moved_by_others(&self) -> bool {
        let height = self.job.as_ref().and_then(|job| job.height);
        height.is_some_and(|height| height.by == MovedBy::Others)
    }
}
