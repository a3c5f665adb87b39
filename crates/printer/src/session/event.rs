//! What a session tells its owner, and what the owner asks of it.

use std::collections::VecDeque;

use gcode::{Annotation, Diagnostic, Heater, ObjectAction};
use motion::PlannedMove;
use units::{Celsius, Mm, MmPerS, Seconds, Ticks};

use crate::{error::PrinterError, machine::MOTORS, planner::Position};

/// The most events that wait for their owner. Beyond that the oldest of those that come in masses (readings, moves,
/// progress, comments) are dropped first, and the owner is told how many.
pub const EVENTS_MAX: usize = 16_384;

/// Events that wait for their owner.
#[derive(Debug, Default)]
pub(super) struct Events {
    queue: VecDeque<Event>,
    dropped: u64,
}

impl Events {
    pub(super) fn push(&mut self, event: Event) {
        if self.queue.len() >= EVENTS_MAX {
            self.make_room();
        }
        self.queue.push_back(event);
    }

    /// Takes over what another queue holds.
    pub(super) fn append(&mut self, other: &mut Self) {
        self.dropped += core::mem::take(&mut other.dropped);
        other.queue.drain(..).for_each(|event| self.push(event));
    }

    /// Hands everything out.
    pub(super) fn take(&mut self) -> VecDeque<Event> {
        if self.dropped > 0 {
            self.queue.push_front(Event::Dropped(core::mem::take(&mut self.dropped)));
        }
        core::mem::take(&mut self.queue)
    }

    /// Frees at least a quarter, so that what it costs is shared by many.
    fn make_room(&mut self) {
        let before = self.queue.len();
        let mut surplus = before / 2;
        self.queue.retain(|event| {
            let goes = surplus > 0 && event.is_one_of_many();
            surplus -= usize::from(goes);
            !goes
        });
        let excess = self.queue.len().saturating_sub(EVENTS_MAX / 4 * 3);
        self.queue.drain(..excess);
        self.dropped += (before - self.queue.len()) as u64;
    }
}

/// What happened.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// The phase of the connection changed.
    Phase(PhaseName),
    /// The board said who it is.
    Identified {
        /// Its firmware's version.
        version: String,
        /// Its chip.
        mcu: String,
        /// Its clock in Hz.
        clock_freq: f64,
    },
    /// A heater's latest reading.
    Temperature {
        /// Which heater.
        heater: Heater,
        /// What its sensor says.
        temperature: Celsius,
        /// What it should be; 0 is off.
        target: Celsius,
        /// The share of time that it is on.
        duty: f64,
        /// The board has lowered it, or switched it off, because its host fell silent.
        standby: bool,
    },
    /// A run of motion starts at this motion clock and position.
    RunStarted {
        /// The board's motion clock.
        at: Ticks,
        /// The machine's position, in mm.
        position: Position,
    },
    /// A move will be made between these motion clocks. Told when it is planned, some seconds ahead.
    Move(ScheduledMove),
    /// A run of motion ends at rest at this motion clock. Told when it is planned.
    RunEnded {
        /// The board's motion clock.
        at: Ticks,
    },
    /// A run of motion was broken off before its end: its motors stood still at this motion clock at the latest.
    RunBroken {
        /// The board's motion clock.
        at: Ticks,
    },
    /// A run of motion that was broken off in a pause goes on from there: all that was still to be made of it is made
    /// at motion clocks that are so much later. Its moves are told again.
    RunResumed {
        /// The board's motion clock when it was broken off …
        broken: Ticks,
        /// … and when it goes on.
        at: Ticks,
    },
    /// An axis found its endstop: it is at this position now.
    Homed {
        /// 0, 1, 2 for X, Y, Z.
        axis: usize,
        /// Where it is, in mm.
        position_mm: f64,
        /// How many steps of the homing move each motor made, both approaches together; of a delta's towers, the one of
        /// that number.
        steps: [u64; MOTORS],
    },
    /// The job passed this line.
    Progress {
        /// The line of the last move that has been made.
        line: u32,
        /// Print time of the runs so far.
        elapsed: Seconds,
    },
    /// The slicer's comment at the place where the print is now.
    Annotation(Annotation),
    /// An object begins or ends where the print is now.
    Object(ObjectAction),
    /// A text for the user.
    Message(String),
    /// Something in the G-code that the user should know of.
    Notice(Diagnostic),
    /// The job was paused, and the machine is at rest.
    Paused,
    /// The board has brought motion to rest on its path, and says why; it waits for [`Request::Resume`] or
    /// [`Request::Cancel`].
    Held(PrinterError),
    /// The job, or what was held, goes on.
    Resumed,
    /// The job ended; all its moves have been made.
    JobDone,
    /// The job ended early because the user said so.
    JobCancelled,
    /// Something failed. What it stopped is part of the error's text.
    Error(PrinterError),
    /// Events were lost because nobody took them.
    Dropped(u64),
}

impl Event {
    /// Whether there are many of its kind, each of little weight.
    const fn is_one_of_many(&self) -> bool {
        matches!(
            self,
            Self::Temperature { .. }
                | Self::Move(_)
                | Self::Progress { .. }
                | Self::Annotation(_)
                | Self::Object(_)
        )
    }
}

/// A planned move on the board's motion clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScheduledMove {
    /// The line of the source that asked for it; 0 for moves that no line asked for (homing).
    pub line: u32,
    /// When it starts.
    pub start: Ticks,
    /// When it ends.
    pub end: Ticks,
    /// Where it starts.
    pub from: Position,
    /// Where it ends.
    pub to: Position,
    /// How fast.
    pub speed: SpeedProfile,
    /// Whether it belongs to homing, where a trigger may cut it short.
    pub homing: bool,
}

/// How fast the toolhead is during a move: a trapezoid on the board's motion clock, between the move's start and its end. Zero
/// throughout where only filament moves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpeedProfile {
    /// At the move's start.
    pub start: MmPerS,
    /// The highest.
    pub cruise: MmPerS,
    /// At the move's end.
    pub end: MmPerS,
    /// When it has sped up.
    pub cruise_from: Ticks,
    /// When it begins to slow down.
    pub cruise_until: Ticks,
}

impl ScheduledMove {
    /// The same move at other times.
    pub(super) fn at(self, time: impl Fn(Ticks) -> Ticks) -> Self {
        let SpeedProfile { cruise_from, cruise_until, .. } = self.speed;
        let speed =
            SpeedProfile { cruise_from: time(cruise_from), cruise_until: time(cruise_until), ..self.speed };
        Self { start: time(self.start), end: time(self.end), speed, ..self }
    }
}

impl SpeedProfile {
    /// Of a planned move; `at` turns print time into the board's clock.
    pub(super) fn new(planned: &PlannedMove, at: impl Fn(f64) -> Ticks) -> Self {
        let [x, y, z, _] = planned.direction;
        // 1 or 0: a path with travel in it is measured along the travel.
        let share = (x * x + y * y + z * z).sqrt();
        // Summed up as the move's end is, so that no rounding brings them out of order.
        let cruise_until = planned.accel_time + planned.cruise_time;
        Self {
            start: MmPerS(planned.start_velocity * share),
            cruise: MmPerS(planned.cruise_velocity * share),
            end: MmPerS(planned.end_velocity * share),
            cruise_from: at(planned.start_time + planned.accel_time),
            cruise_until: at(planned.start_time + cruise_until),
        }
    }
}

/// How far a connection is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhaseName {
    /// The board's dictionary is being read.
    Identifying,
    /// The board's clock is being measured, and its state asked for.
    Synchronising,
    /// The board is restarting.
    Restarting,
    /// The board's pins are being set up.
    Configuring,
    /// The board holds a print whose host is gone. Whoever has its journal can take it up
    /// ([`super::Session::take_up`]); everybody else restarts the board.
    Holding,
    /// Ready for commands.
    Ready,
    /// The board has stopped everything and says why; a firmware restart is needed.
    Shutdown,
    /// The connection is of no use any more.
    Failed,
}

/// What an owner may ask.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// Lines of G-code, typed by a user. Each text's lines are counted from 1.
    Gcode(String),
    /// A move by hand, from where the last one will have ended. Modes, factors and the feed of what is typed stay as they
    /// are, and have no part in it.
    MoveBy {
        /// 0, 1, 2 for X, Y, Z; 3 for the filament.
        axis: usize,
        /// How far; negative is towards lower positions.
        distance: Mm,
        /// How fast.
        speed: MmPerS,
    },
    /// An axis, 0, 1, 2 for X, Y, Z, stands there in the G-code's coordinates: the user says so, and it counts as homed.
    SetPosition {
        /// Which.
        axis: usize,
        /// Where.
        position: Mm,
    },
    /// A heater's target; 0 is off.
    SetTemperature(Heater, Celsius),
    /// The part fan's speed, 0 ..= 1.
    SetFan(f64),
    /// The speed factor of everything that is planned from now on, 1 is as written.
    SetSpeedFactor(f64),
    /// The extrusion factor of everything that is planned from now on.
    SetFlowFactor(f64),
    /// The job comes to rest and waits; a wait for a temperature is broken off and taken up again afterwards.
    Pause,
    /// The job goes on from where it paused, or what is held with its next step.
    Resume,
    /// The job comes to rest and ends; heaters and fan go off. Without a job, what was typed is. What is held ends where
    /// it stands.
    Cancel,
    /// Everything stops at once.
    EmergencyStop,
    /// The board starts anew, after a shutdown or because the user wants it.
    FirmwareRestart,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_that_nobody_takes_stay_bounded_and_rare_ones_survive() {
        let mut events = Events::default();
        events.push(Event::JobDone);
        let progress = |line| Event::Progress { line, elapsed: Seconds::ZERO };
        for line in 0..100_000 {
            events.push(progress(line));
        }
        let mut taken = events.take();
        assert!(taken.len() <= EVENTS_MAX + 1);
        let Some(Event::Dropped(dropped)) = taken.pop_front() else { panic!() };
        assert_eq!(dropped as usize + taken.len(), 100_001);
        assert_eq!((taken.front(), taken.back()), (Some(&Event::JobDone), Some(&progress(99_999))));
        assert!(events.take().is_empty());
    }

    #[test]
    fn even_rare_ones_are_bounded() {
        let mut events = Events::default();
        (0..50_000).for_each(|n| events.push(Event::Message(n.to_string())));
        let taken = events.take();
        assert!(taken.len() <= EVENTS_MAX + 1);
        assert_eq!(taken.back(), Some(&Event::Message("49999".into())));
    }
}
