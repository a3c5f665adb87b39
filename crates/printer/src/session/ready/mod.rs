//! A machine that is set up: it heats, homes, moves and prints.
//!
//! One thing at a time: G-code comes from the job or from the console, and a barrier in it (homing, a wait) is dealt
//! with before anything that follows.

mod ending;
mod plan;
mod waiting;

use gcode::LineNumber;
use units::{Seconds, Ticks};

use self::waiting::{Held, Wait};
use super::{
    board::Board,
    connect,
    console::Console,
    event::{Event, Events},
    inbox::{self, Message},
    job::{Job, JobStatus, PROGRESS_INTERVAL},
    stream::{Due, MotionStream},
    thermal::Thermal,
};
use crate::{
    config::PrinterConfig,
    error::{ErrorCode, PrinterError},
    machine,
    planner::{Planner, Source, TimedAction},
};

/// While motion is being made, the planner is asked for more at least this often.
const PUMP_INTERVAL: Seconds = Seconds(0.05);
/// How often a machine at rest looks after itself.
const IDLE_INTERVAL: Seconds = Seconds(0.25);

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
    pub(super) last_active: Seconds,
}

impl Ready {
    pub(super) fn new(config: PrinterConfig, mut board: Board, now: Seconds) -> Result<Self, PrinterError> {
        let mut planner = Planner::new(&config, board.clock)?;
        let thermal = Thermal::start(&config, &mut board, now);
        let mut console = Console::new(Source::new(machine::gcode_settings(&config)));
        planner.adopt(&mut console.source);
        Ok(Self {
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
            last_active: now,
        })
    }

    /// What the job is doing.
    pub(super) fn job_status(&self) -> JobStatus {
        self.job.as_ref().map_or(JobStatus::None, Job::status)
    }

    /// Motion that the board has, in seconds, while a run is being made and more of it is to come.
    pub(super) fn motion_queued(&self, now: Seconds) -> Option<Seconds> {
        let clock_now = self.board.clock_at(now);
        let run = self.stream.run()?;
        if run.homing || run.end.is_some() || clock_now < run.start {
            return None;
        }
        self.stream.queued_on_board(self.planner.generated_until(), clock_now, &self.board)
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

    pub(super) fn receive(&mut self, bytes: &[u8], now: Seconds) -> Result<(), Failure> {
        for (message, sent) in inbox::receive(&mut self.board.link, &self.board.dictionary, bytes, now) {
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
        let Wait::Homing { axis, .. } = &mut self.wait else { return };
        let result = match message {
            Message::Position { oid, position } => axis.on_position(oid, position),
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
        self.thermal.check_silence(now).map_err(Failure::Stop)?;
        connect::ask_clock(&mut self.board, now);
        self.board.note_losses(now);
        let clock_now = self.board.clock_at(now);
        while let Some(due) = self.stream.pop_due(clock_now) {
            self.on_due(due, now);
        }
        self.thermal.poll(&mut self.board, now);
        self.stream.take_finished(clock_now, &self.board);
        self.advance_wait(now);
        self.pump(now)?;
        self.rest(now);
        let clock_now = self.board.clock_at(now);
        let link_wake = self.board.link.poll(now, clock_now, out);
        let busy = self.stream.run().is_some() || !matches!(self.wait, Wait::Nothing);
        let own_wake = now + if busy { PUMP_INTERVAL } else { IDLE_INTERVAL };
        let wake = own_wake.min(self.board.sync.next_wake());
        Ok(link_wake.map_or(wake, |link| link.min(wake)))
    }

    fn on_due(&mut self, due: Due, now: Seconds) {
        match due {
            Due::MoveEnd(made) => {
                let elapsed = self.stream.elapsed(made.end, &self.board);
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
                if let Err(error) = self.thermal.set_target(heater, target, &mut self.board, now) {
                    self.source_failed(error.at_line(line.0), now);
                }
            }
            TimedAction::TurnOffHeaters => self.thermal.all_off(&mut self.board, now),
            TimedAction::Fan { speed, .. } => self.thermal.set_fan(speed, None, &mut self.board, now),
            TimedAction::Message(text) => self.events.push(Event::Message(text)),
            TimedAction::Annotation(annotation) => self.events.push(Event::Annotation(annotation)),
            TimedAction::Object(object) => self.events.push(Event::Object(object)),
            TimedAction::ReportTemperatures => self.events.push(Event::Message(self.thermal.describe())),
            TimedAction::ReportPosition => {
                let [x, y, z, e] = self.planner.position();
                self.events.push(Event::Message(format!("X:{x:.3} Y:{y:.3} Z:{z:.3} E:{e:.3}")));
            }
        }
    }

    /// The source whose G-code is being carried out.
    fn source_mut(&mut self) -> &mut Source {
        match &mut self.job {
            Some(job) if job.is_active() => &mut job.source,
            _ => &mut self.console.source,
        }
    }

    /// The clock of the end of everything that has been planned.
    pub(super) fn clock_at(&self, now: Seconds) -> Ticks {
        self.board.clock_at(now)
    }
}
