//! A machine that is set up: it heats, homes, moves and prints.
//!
//! One thing at a time: G-code comes from the job or from the console, and a barrier in it (homing, a wait) is dealt
//! with before anything that follows.

mod calls;
mod drop;
mod ending;
mod hold;
mod pause;
mod plan;
mod rate;
mod start;
mod take_up;
mod take_up_parked;
mod waiting;

use gcode::LineNumber;
use units::Seconds;

use self::{
    calls::{Calls, GAP_LONG},
    hold::Hold,
    rate::Rate,
    waiting::{Held, Wait},
};
use super::{
    board::Board,
    connect,
    console::Console,
    diary::{Diary, Progress},
    event::{Event, Events},
    inbox::{self, Message},
    job::{Job, JobStatus, PROGRESS_INTERVAL},
    layout::StepperOids,
    lease::Lease,
    stream::{Due, MotionStream},
    thermal::Thermal,
};
use crate::{
    config::PrinterConfig,
    error::{ErrorCode, PrinterError},
    journal::Input,
    machine,
    planner::{Planner, Source, TimedAction},
};

/// While motion is being made, the planner is asked for more at least this often.
const PUMP_INTERVAL: Seconds = Seconds(0.05);
/// While lines are passed over, the owner is asked for more of the file this often.
const SKIP_INTERVAL: Seconds = Seconds(0.002);
/// So much more motion ahead than what the board may make once it is left alone, it has the fan's changes.
const FAN_AHEAD_SPARE: Seconds = Seconds(0.75);
/// How often a machine at rest looks after itself.
const IDLE_INTERVAL: Seconds = Seconds(0.25);
/// Motion that is due this long ago and has not been sent is none that the board could make.
const LATE_MAX: Seconds = Seconds(1.0);

/// What a failure leads to.
#[derive(Debug)]
pub(super) enum Failure {
    /// Everything must stop at once.
    Stop(PrinterError),
    /// The board has stopped everything by itself.
    Shutdown(PrinterError),
    /// Nobody is there any more.
    Lost(PrinterError),
}

/// A machine that is set up.
#[derive(Debug)]
pub(super) struct Ready {
    pub(super) config: PrinterConfig,
    pub(super) board: Board,
    pub(super) planner: Planner,
    pub(super) stream: MotionStream,
    pub(super) thermal: Thermal,
    pub(super) console: Console,
    /// Gives nothing: for homing, and for coming to rest.
    silence: Source,
    pub(super) job: Option<Job>,
    wait: Wait,
    /// What a paused job was waiting for.
    held: Held,
    pub(super) events: Events,
    pub(super) diary: Diary,
    /// How far axes are from where the planner has them, in mm: what homing another could not put right in whole steps.
    pub(super) off_mm: [f64; 3],
    pub(super) last_active: Seconds,
    /// When the last run of motion came to its end, by this host's clock.
    rested: Seconds,
    lease: Lease,
    rate: Rate,
    /// Motion is held.
    hold: Option<Hold>,
    /// The board has lowered its heaters, which has not been dealt with.
    have_heaters_fallen: bool,
    calls: Calls,
}

impl Ready {
    pub(super) fn new(config: PrinterConfig, board: Board, now: Seconds) -> Result<Self, PrinterError> {
        let planner = Planner::new(&config, board.clock)?;
        let mut ready = Self::with_planner(config, board, planner, now);
        ready.planner.adopt(&mut ready.console.source);
        Ok(ready)
    }

    fn with_planner(config: PrinterConfig, mut board: Board, planner: Planner, now: Seconds) -> Self {
        let thermal = Thermal::start(&config, &mut board, now);
        let console = Console::new(Source::new(machine::gcode_settings(&config)));
        let lease = Lease::new(&config);
        Self {
            config,
            board,
            planner,
            stream: MotionStream::default(),
            thermal,
            console,
            silence: Source::default(),
            job: None,
            wait: Wait::Nothing,
            held: Held::default(),
            events: Events::default(),
            diary: Diary::default(),
            off_mm: [0.0; 3],
            last_active: now,
            rested: Seconds(f64::NEG_INFINITY),
            lease,
            rate: Rate::new(),
            hold: None,
            have_heaters_fallen: false,
            calls: Calls::default(),
        }
    }

    /// What the job is doing.
    pub(super) fn job_status(&self) -> JobStatus {
        let of_job = || self.job.as_ref().map_or(JobStatus::None, Job::status);
        self.hold_status().unwrap_or_else(of_job)
    }

    /// Motion that the board has, in seconds, while a run is being made and more of it is to come.
    pub(super) fn motion_queued(&self, now: Seconds) -> Option<Seconds> {
        let motion_now = self.board.motion_at(now);
        let run = self.stream.run()?;
        if run.homing || run.end.is_some() || motion_now < run.start || !self.board.motion.is_running() {
            return None;
        }
        let covered = self.stream.covered(self.planner.generated_until(), &self.board)?;
        Some(self.board.clock.duration_of(covered.saturating_sub(motion_now)))
    }

    /// Whether what was typed is still being carried out.
    pub(super) fn is_console_busy(&self) -> bool {
        !self.is_at_rest() || !matches!(self.wait, Wait::Nothing) || !self.console.is_drained()
    }

    /// The job whose G-code is being carried out.
    fn active_job(&mut self) -> Option<&mut Job> {
        self.job.as_mut().filter(|job| job.is_active())
    }

    /// Whether nothing moves and nothing is about to.
    pub(super) fn is_at_rest(&self) -> bool {
        self.planner.is_at_rest() && self.stream.run().is_none()
    }

    /// What came during a long pause has waited: it tells nothing of now.
    fn note_call(&mut self, now: Seconds) {
        let Some(gap) = self.calls.note(now) else { return };
        self.has_not_listened(gap);
        if gap >= GAP_LONG {
            self.thermal.listens_again(now);
        }
    }

    pub(super) fn receive(&mut self, bytes: &[u8], now: Seconds) -> Result<(), Failure> {
        self.note_call(now);
        // After a long pause nothing may be claimed of the motion clock, whose 32 bits say little then.
        self.lease.is_in_doubt(&mut self.board, now);
        let messages = inbox::receive(&mut self.board.link, &self.board.dictionary, bytes, now);
        if !messages.is_empty() {
            self.diary.heard(now);
        }
        for (message, sent) in messages {
            if let Some(sent) = sent {
                self.board.said_after = self.board.said_after.max(sent);
            }
            self.on_message(message, sent, now)?;
        }
        Ok(())
    }

    fn on_message(&mut self, message: Message, sent: Option<Seconds>, now: Seconds) -> Result<(), Failure> {
        match message {
            Message::Clock(low) => self.board.sync.clock(low, sent, now),
            Message::Uptime { high, low } => self.board.sync.uptime(high, low, sent, now),
            Message::Analog { oid, next_clock, sum } => {
                let next_clock = self.board.clock_at(now).nearest(next_clock);
                match self.thermal.receive(oid, next_clock, sum, &mut self.board, now) {
                    Some(Ok(event)) => self.events.push(event),
                    Some(Err(error)) => return Err(Failure::Stop(error)),
                    None => {}
                }
            }
            Message::Shutdown { reason } => return Err(Failure::Shutdown(self.shutdown_error(reason))),
            Message::Starting => return Err(Failure::Lost(ErrorCode::BoardRestarted.into())),
            Message::Config { .. } => {}
            Message::Heater(report) => {
                self.have_heaters_fallen |= self.thermal.on_board_heater(report, now);
            }
            Message::Motion(report) => self.on_motion(&report, now),
            Message::Queue { oid, queue, .. } => self.on_queue(oid, &queue),
            Message::Position { .. } | Message::Endstop { .. } | Message::Trigger { .. } => {
                self.on_homing_message(message, now);
            }
        }
        Ok(())
    }

    /// Why the board stopped, with what the sensors read where that is why.
    pub(super) fn shutdown_error(&self, reason: u16) -> PrinterError {
        let text = self.board.dictionary.enumeration_name("static_string_id", i64::from(reason));
        let mut error = PrinterError::from_shutdown_text(text.unwrap_or("unknown reason"));
        if error.code == ErrorCode::BoardSensorRange {
            error.detail = self.thermal.describe();
        }
        error
    }

    fn on_homing_message(&mut self, message: Message, now: Seconds) {
        if let Message::Position { oid, position } = message {
            let is_it = |oids: &Option<StepperOids>| oids.is_some_and(|oids| oids.stepper.0 == oid);
            let motor = self.board.layout.steppers.iter().position(is_it);
            if let Some(motor) = motor {
                self.stream.set_count(motor, position);
            }
        }
        let Wait::Homing { axis, .. } = &mut self.wait else { return };
        let result = match message {
            Message::Position { oid, position } => axis.on_position(oid, position, now),
            Message::Endstop { oid, homing, pin_value } => {
                axis.on_endstop(oid, homing, pin_value, now, &mut self.board)
            }
            Message::Trigger { oid, can_trigger, reason } => {
                axis.on_trigger(oid, can_trigger, reason, now, &mut self.board)
            }
            _ => Ok(()),
        };
        if let Err(error) = result {
            self.homing_failed(error, now);
        }
    }

    pub(super) fn poll(&mut self, now: Seconds, out: &mut Vec<u8>) -> Result<Seconds, Failure> {
        if self.board.sync.is_silent(now) {
            return Err(Failure::Lost(ErrorCode::LinkLost.into()));
        }
        self.note_call(now);
        self.thermal.check_silence(now).map_err(Failure::Stop)?;
        connect::ask_clock(&mut self.board, now);
        self.board.note_losses(now);
        self.thermal.poll(&mut self.board, now);
        if !self.lease.is_in_doubt(&mut self.board, now) {
            self.go_on(now)?;
        }
        self.check_late(now)?;
        let link_wake = self.board.link.poll(now, self.board.clocks(now), out);
        let busy = self.stream.run().is_some() || !matches!(self.wait, Wait::Nothing);
        let own_wake = now
            + match busy {
                _ if self.skips() => SKIP_INTERVAL,
                true => PUMP_INTERVAL,
                false => IDLE_INTERVAL,
            };
        let wake = own_wake.min(self.board.sync.next_wake());
        Ok(link_wake.map_or(wake, |link| link.min(wake)))
    }

    /// Steps that were due long ago must not be sent: beyond half of its clock's range a board takes what is past for what
    /// is to come.
    fn check_late(&self, now: Seconds) -> Result<(), Failure> {
        let due = self.board.link.motion_waiting();
        let late = due.is_some_and(|due| due + self.board.ticks(LATE_MAX) < self.board.motion_at(now));
        if late { Err(Failure::Stop(ErrorCode::OrdersTooLate.into())) } else { Ok(()) }
    }

    /// Does what is due by the motion clock, and what follows from it.
    fn go_on(&mut self, now: Seconds) -> Result<(), Failure> {
        if self.waits_to_rejoin() {
            if core::mem::take(&mut self.have_heaters_fallen) {
                self.heaters_fell(now);
            }
            return self.advance_hold(now);
        }
        let motion_now = self.board.motion_at(now);
        if !self.plans_nothing() {
            self.give_fan_orders(now);
            self.stream.send_again(&mut self.board, now);
        }
        self.stream.forget_made(motion_now, &self.board);
        while let Some(due) = self.stream.pop_due(motion_now) {
            self.on_due(due, now);
        }
        if let Some(run) = self.stream.take_finished(motion_now, &self.board) {
            self.rested = now;
            self.lease.end(run, &mut self.board);
        }
        if core::mem::take(&mut self.have_heaters_fallen) {
            self.heaters_fell(now);
        }
        self.advance_wait(now);
        self.advance_hold(now)?;
        self.diary.tell_progress(now);
        self.pump(now)?;
        self.renew_lease(now);
        self.keep_rate(now);
        self.rest(now);
        Ok(())
    }

    /// The board gets changes of the fan's speed as late as is safe: what the user sets comes behind those that it has.
    fn give_fan_orders(&mut self, now: Seconds) {
        let ahead = self.lease.alone_max() + FAN_AHEAD_SPARE;
        let until = self.board.motion_in(ahead, now);
        while let Some((at, speed)) = self.stream.kept.next_fan(until) {
            self.thermal.set_fan(speed, Some(at), &mut self.board, now);
        }
    }

    fn on_due(&mut self, due: Due, now: Seconds) {
        match due {
            Due::MoveEnd(made, _) => {
                let elapsed = self.stream.elapsed(made.end, &self.board);
                if made.line > 0 && self.plans_job() {
                    self.diary.progress(Progress { line: made.line, elapsed, z: made.to[2] });
                }
                if let Some(job) =
                    self.job.as_mut().filter(|job| made.line > 0 && now - job.told >= PROGRESS_INTERVAL)
                {
                    job.told = now;
                    self.events.push(Event::Progress { line: made.line, elapsed });
                }
            }
            Due::Action(line, action) => self.act(line, action, now),
        }
    }

    /// What heaters and fan have been set to before a job begins holds until its file says something else.
    pub(super) fn note_preheating(&mut self) {
        for (heater, target) in self.thermal.wanted() {
            self.diary.target(heater, target.0);
        }
        self.diary.input(Input::Fan(self.thermal.fan_speed()));
    }

    /// Whether a job that has been ended may still do this: what was read of it ahead must not switch anything on.
    fn is_allowed(&self, action: &TimedAction) -> bool {
        let is_ending = self.job.as_ref().is_some_and(Job::is_ending);
        !(is_ending && matches!(action, TimedAction::SetTemperature { .. } | TimedAction::Fan { .. }))
    }

    fn act(&mut self, line: LineNumber, action: TimedAction, now: Seconds) {
        if !self.is_allowed(&action) {
            return;
        }
        match action {
            TimedAction::SetTemperature { heater, target } => {
                if !self.plans_job() {
                    self.diary.target(heater, target.0);
                }
                if let Err(error) = self.thermal.set_target(heater, target, &mut self.board, now) {
                    self.source_failed(error.at_line(line.0), now);
                }
            }
            TimedAction::TurnOffHeaters => self.thermal.all_off(&mut self.board, now),
            TimedAction::Fan { speed, .. } => {
                if !self.plans_job() {
                    self.diary.input(Input::Fan(speed));
                }
                self.set_fan_now(speed, now);
            }
            TimedAction::Message(text) => self.events.push(Event::Message(text)),
            TimedAction::Annotation(annotation) => self.events.push(Event::Annotation(annotation)),
            TimedAction::Object(object) => self.events.push(Event::Object(object)),
            TimedAction::ReportTemperatures => self.events.push(Event::Message(self.thermal.describe())),
            TimedAction::ReportPosition => {
                let [x, y, z, e] = self.planner.gcode_position();
                let text = format!("X:{x:.3} Y:{y:.3} Z:{z:.3} E:{e:.3}");
                let [x, y, z, _] = self.planner.position();
                self.events.push(Event::Message(if self.planner.transform().is_identity() {
                    text
                } else {
                    format!("{text} (motors X:{x:.3} Y:{y:.3} Z:{z:.3})")
                }));
            }
        }
    }
}
