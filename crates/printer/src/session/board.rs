//! The board as the rest of the session sees it: commands out, clocks both ways.
//!
//! Joins link, dictionary, clock and layout; knows nothing of what the commands are for.

use units::{Hertz, Seconds, Ticks};
use wire::{Command, dictionary::Dictionary};

use super::{
    layout::Layout,
    motion_time::{Heard, MotionReport, MotionTime},
};
use crate::{
    clock_sync::ClockSync,
    link::{Clocks, Lane, Link, Outgoing, SCHEDULE_AHEAD_TICKS_MAX},
    machine::MOTORS,
    pace::RATE_ONE,
};

/// How far ahead of its clock an output is set on a link that works: several round trips …
const OUTPUT_LEAD: Seconds = Seconds(0.3);
/// … and on one that has been losing blocks, where a message may have to be sent again more than once.
const OUTPUT_LEAD_LOSSY: Seconds = Seconds(1.0);
/// How far ahead a run of motion starts on a link that works …
const RUN_LEAD: Seconds = Seconds(0.25);
/// … and on one that has been losing blocks.
const RUN_LEAD_LOSSY: Seconds = Seconds(1.2);

/// How much motion is planned and sent ahead of the board's clock, where it can be held at any place …
const HORIZON: Seconds = Seconds(10.0);
/// … and this much less than half of the clock's range, which is little on fast boards …
const HORIZON_SPARE: Seconds = Seconds(0.25);
/// … and where a pause runs it empty.
const HORIZON_PLAIN: Seconds = Seconds(4.0);

/// A board's word on its motion clock cannot come from further ahead than this: the clock is an estimate.
const REPORT_SLACK: Seconds = Seconds(0.1);

/// A link counts as lossy for this long after it last had to send something again.
const LOSSY_FOR: Seconds = Seconds(30.0);

/// The motion lane of the part fan, where that follows the motion clock: behind those of the motors.
pub(super) const FAN_LANE: usize = MOTORS;

/// A board that has been identified.
#[derive(Debug)]
pub(super) struct Board {
    pub(super) link: Link,
    pub(super) dictionary: Dictionary,
    pub(super) sync: ClockSync,
    pub(super) clock: Hertz,
    pub(super) adc_max: f64,
    pub(super) layout: Layout,
    pub(super) losses: Losses,
    /// The clock of steps.
    pub(super) motion: MotionTime,
    /// It has started with its power, as far as is known: nobody has had it start anew.
    pub(super) since_power_up: bool,
    /// What arrives now was said after this: the board answered what was sent then.
    pub(super) said_after: Seconds,
}

/// When the link last had to send something again.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Losses {
    seen: u64,
    last: Option<Seconds>,
}

impl Board {
    /// The board's clock now, as far as it is known.
    pub(super) fn clock_at(&self, now: Seconds) -> Ticks {
        self.sync.clock_at(now)
    }

    /// The motion clock now, as far as it is known.
    pub(super) fn motion_at(&self, now: Seconds) -> Ticks {
        self.motion.at(self.clock_at(now))
    }

    /// The hardware clock of a motion clock at the earliest: should motion go on at its full rate.
    pub(super) fn hardware_of(&self, motion: Ticks, now: Seconds) -> Ticks {
        self.motion.hardware(motion, self.clock_at(now))
    }

    /// Both clocks now.
    pub(super) fn clocks(&self, now: Seconds) -> Clocks {
        let hardware = self.clock_at(now);
        Clocks { hardware, motion: self.motion.at(hardware), rate: self.motion.even_rate() }
    }

    /// How much motion is planned and sent ahead of the motion clock, at most.
    pub(super) fn horizon(&self) -> Ticks {
        if self.layout.has_motion_clock {
            let range = SCHEDULE_AHEAD_TICKS_MAX.saturating_sub(self.ticks(HORIZON_SPARE));
            self.ticks(HORIZON).min(range)
        } else {
            self.ticks(HORIZON_PLAIN)
        }
    }

    /// The board is set up, with room for so many moves.
    pub(super) fn begin(&mut self, move_count: u16) {
        self.link.set_board(self.clock, move_count);
        self.link.set_horizon(self.clock.duration_of(self.horizon()));
    }

    /// Takes the board's word on its motion clock; its hardware clock then, if that can be.
    pub(super) fn on_motion(&mut self, report: &MotionReport, now: Seconds) -> Option<Ticks> {
        let heard = Heard {
            clock_now: self.clock_at(now),
            said_after: self.clock_at(self.said_after),
            slack: self.ticks(REPORT_SLACK),
        };
        self.motion.report(report, heard)
    }

    /// Has motion come to rest on its path, by a ramp of so many ticks.
    pub(super) fn hold_motion(&mut self, ramp: Ticks, now: Seconds) {
        self.motion.tell_rest(true, self.clock_at(now));
        self.control(&Command::MotionHold { ramp: ramp.0 as u32 });
    }

    /// Has motion go on, by a ramp of so many ticks.
    pub(super) fn resume_motion(&mut self, ramp: Ticks, now: Seconds) {
        self.motion.tell_rest(false, self.clock_at(now));
        self.control(&Command::MotionResume { ramp: ramp.0 as u32 });
    }

    /// Has motion go at this rate, by a ramp of so many ticks.
    pub(super) fn set_rate(&mut self, rate: u16, ramp: Ticks, now: Seconds) {
        self.motion.tell(rate, self.clock_at(now));
        self.control(&Command::MotionRate { rate, ramp: ramp.0 as u32 });
    }

    /// A duration in ticks of the nominal clock: what every plan is made in.
    pub(super) fn ticks(&self, duration: Seconds) -> Ticks {
        self.clock.ticks_in(duration)
    }

    /// The clock at which an output that is to change "now" changes.
    pub(super) fn output_clock(&self, now: Seconds) -> Ticks {
        let lead = if self.is_lossy(now) { OUTPUT_LEAD_LOSSY } else { OUTPUT_LEAD };
        self.clock_at(now) + self.ticks(lead)
    }

    /// The motion clock at which the part fan changes that is to change "now": the same, where it follows that clock.
    pub(super) fn fan_clock(&self, now: Seconds) -> Ticks {
        self.motion.latest(self.output_clock(now))
    }

    /// The motion clock in so much time, at the rate that motion has or is about to have.
    pub(super) fn motion_in(&self, ahead: Seconds, now: Seconds) -> Ticks {
        let part = self.motion.even_rate().map_or(1.0, |rate| f64::from(rate.get()) / f64::from(RATE_ONE));
        self.motion_at(now) + self.ticks(ahead * part)
    }

    /// The motion clock at which a run of motion that is to start "now" starts.
    pub(super) fn run_clock(&self, now: Seconds) -> Ticks {
        let lead = if self.is_lossy(now) { RUN_LEAD_LOSSY } else { RUN_LEAD };
        self.motion_at(now) + self.ticks(lead)
    }

    fn is_lossy(&self, now: Seconds) -> bool {
        self.losses.last.is_some_and(|last| now - last < LOSSY_FOR)
    }

    /// Notes whether the link has been losing blocks.
    pub(super) fn note_losses(&mut self, now: Seconds) {
        let seen = self.link.stats().retransmissions;
        if seen != self.losses.seen {
            self.losses = Losses { seen, last: Some(now) };
        }
    }

    /// Sends a command ahead of all motion.
    pub(super) fn control(&mut self, command: &Command<'_>) {
        self.send(Lane::Control, command, |message| message);
    }

    /// Sends a command that takes effect at a clock and holds an entry of the move queue until then.
    pub(super) fn control_at(&mut self, command: &Command<'_>, clock: Ticks) {
        self.send(Lane::Control, command, |message| message.due(clock).entry_until(clock));
    }

    /// Sets an output at a motion clock: in its place among the steps, where the board ties it to them.
    pub(super) fn fan_at(&mut self, command: &Command<'_>, clock: Ticks) {
        if self.layout.has_motion_clock {
            self.send(Lane::Motion(FAN_LANE as u8), command, |message| {
                message.due(clock).entry_until(clock).beside()
            });
        } else {
            self.control_at(command, clock);
        }
    }

    /// Asks motors how far they have come in their rows.
    pub(super) fn ask_queues(&mut self, wanted: impl Fn(usize) -> bool) {
        for (motor, oids) in self.layout.steppers.into_iter().enumerate() {
            if let Some(oids) = oids.filter(|_| wanted(motor)) {
                self.control(&Command::StepperGetQueue { oid: oids.stepper.0 });
            }
        }
    }

    /// Sends a command ahead of everything.
    pub(super) fn immediate(&mut self, command: &Command<'_>) {
        self.send(Lane::Immediate, command, |message| message);
    }

    /// Sends a command of a motor's, in order: what it is for happens at `due`, and until `entry_until` it holds an
    /// entry of the move queue.
    pub(super) fn motion(
        &mut self,
        motor: usize,
        command: &Command<'_>,
        due: Ticks,
        entry_until: Option<Ticks>,
    ) {
        self.send(Lane::Motion(motor as u8), command, |message| match entry_until {
            Some(end) => message.due(due).entry_until(end),
            None => message.due(due),
        });
    }

    fn send(&mut self, lane: Lane, command: &Command<'_>, shape: impl FnOnce(Outgoing) -> Outgoing) {
        // The layout has checked every command against the dictionary, and every lane is only filled while it has
        // room; a control lane that overflows all the same belongs to a link that is dead, which is noticed there.
        if let Ok(message) = Outgoing::command(lane, &self.dictionary, command) {
            let _ = self.link.queue(shape(message));
        }
    }
}

#[cfg(test)]
impl Board {
    /// A board that nobody answers for, laid out as a machine file says.
    pub(super) fn for_tests(config: &crate::config::PrinterConfig) -> Self {
        let profile = virtual_printer::BoardProfile::rp2040();
        let dictionary = Dictionary::parse(&profile.description().compressed()).expect("a dictionary");
        let layout = Layout::new(config, &dictionary, f64::from(profile.clock.0)).expect("a layout");
        let mut sync = ClockSync::new(profile.clock);
        sync.uptime(1, units::Clock32(0), Some(Seconds::ZERO), Seconds::ZERO);
        let mut link = Link::new();
        link.set_board(profile.clock, 1000);
        let losses = Losses::default();
        let motion = MotionTime::default();
        Self {
            link,
            dictionary,
            sync,
            clock: profile.clock,
            adc_max: 4095.0,
            layout,
            losses,
            motion,
            since_power_up: true,
            said_after: Seconds(f64::NEG_INFINITY),
        }
    }
}
