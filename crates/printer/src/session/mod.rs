//! One connection to one board, from the first byte to the end of the last print.
//!
//! Sans-I/O: [`Session::receive`] takes bytes from the port, [`Session::poll`] gives bytes for it and says when it wants
//! to be called again, and both are told the time. The owner feeds the job's file in pieces, asks for things
//! ([`Request`]) and takes what happened ([`Event`]). Knows nothing of ports, files or screens.
//!
//! Nothing here restarts a print by itself: after a shutdown or a lost link the job is gone, and only the owner can
//! start another.

mod attach;
mod board;
mod board_heater;
mod connect;
mod console;
mod diary;
mod event;
mod fan;
mod homing;
mod inbox;
mod job;
mod kept;
mod layout;
mod lease;
mod motion_time;
mod ready;
mod request;
mod run;
mod stream;
mod thermal;

use std::collections::VecDeque;

use units::{Seconds, Ticks};
use wire::Command;

pub use console::CONSOLE_BYTES_MAX;
pub use event::{EVENTS_MAX, Event, PhaseName, Request, ScheduledMove, SpeedProfile};
pub use job::{JobOptions, JobStatus, PendingStart};

use self::{
    attach::Holding,
    board::Board,
    connect::{Connecting, Identifying, Outcome},
    event::Events,
    inbox::Message,
    ready::{Failure, Ready},
};
use crate::{
    config::PrinterConfig,
    error::{Ended, ErrorCode, PrinterError},
    journal::{Continuation, Journal, PENDING_BYTES_MAX},
    link::LinkStats,
};

/// With nothing to do, the owner is asked to come back after this long.
const IDLE_WAKE: Seconds = Seconds(1.0);
/// A restart that had no effect is tried this often in all: its one message may be lost on a bad line.
const RESTARTS_MAX: u32 = 5;

#[derive(Debug)]
enum Stage {
    Identifying(Box<Identifying>),
    Connecting(Box<Connecting>),
    Holding(Box<Holding>),
    Ready(Box<Ready>),
    /// The board has stopped; it is still listened to, and a restart can be sent.
    Shutdown(Box<Board>),
    Failed,
}

/// A connection to a board.
#[derive(Debug)]
pub struct Session {
    config: PrinterConfig,
    stage: Stage,
    events: Events,
    /// The phase that the owner has been told of.
    told: PhaseName,
    error: Option<PrinterError>,
    /// How often a restart of the board may still be tried before it counts as failed …
    restarts_left: u32,
    /// … and whether its owner asked for one, which also ends a shutdown.
    restart_wanted: bool,
    /// The board was told to start anew, which its drivers do not notice.
    has_restarted: bool,
    /// Bytes that are still to be sent to a board that restarts.
    parting: Vec<u8>,
    /// What is to be added to the job's journal.
    journal: String,
}

impl Session {
    /// A session on a port that has just been opened.
    pub fn new(config: PrinterConfig, now: Seconds) -> Self {
        let stage = Stage::Identifying(Box::new(Identifying::new(now)));
        let mut events = Events::default();
        events.push(Event::Phase(PhaseName::Identifying));
        Self {
            config,
            stage,
            events,
            told: PhaseName::Identifying,
            error: None,
            restarts_left: RESTARTS_MAX,
            restart_wanted: false,
            has_restarted: false,
            parting: Vec::new(),
            journal: String::new(),
        }
    }

    /// How far the connection is.
    pub fn phase(&self) -> PhaseName {
        match &self.stage {
            Stage::Identifying(identifying) => identifying.phase(),
            Stage::Connecting(connecting) => connecting.phase(),
            Stage::Holding(_) => PhaseName::Holding,
            Stage::Ready(_) => PhaseName::Ready,
            Stage::Shutdown(_) => PhaseName::Shutdown,
            Stage::Failed => PhaseName::Failed,
        }
    }

    /// What ended the connection or stopped the board, if anything did.
    pub const fn error(&self) -> Option<&PrinterError> {
        self.error.as_ref()
    }

    /// What happened since this was last asked.
    pub fn take_events(&mut self) -> VecDeque<Event> {
        self.collect_events();
        self.tell_phase();
        self.events.take()
    }

    fn tell_phase(&mut self) {
        let phase = self.phase();
        if phase != self.told {
            self.told = phase;
            self.events.push(Event::Phase(phase));
        }
    }

    fn collect_events(&mut self) {
        if let Stage::Ready(ready) = &mut self.stage {
            self.events.append(&mut ready.events);
            // An owner that takes none keeps no journal, and the writer has a bound of its own.
            if self.journal.len() < PENDING_BYTES_MAX {
                self.journal.push_str(&ready.diary.take());
            }
        }
    }

    /// What is to be added to the journal of the present print. It must have been stored before the bytes are sent that
    /// [`Self::poll`] gave at the same time, and before anything else is asked of the session.
    pub fn take_journal(&mut self) -> String {
        self.collect_events();
        core::mem::take(&mut self.journal)
    }

    fn enter(&mut self, stage: Stage) {
        self.collect_events();
        self.stage = stage;
        self.tell_phase();
    }

    fn fail(&mut self, error: PrinterError) {
        self.enter(Stage::Failed);
        self.events.push(Event::Error(error.clone()));
        self.error = Some(error);
    }

    /// The board has stopped everything; what was queued for it is forgotten.
    fn stopped(&mut self, mut board: Board, error: PrinterError) {
        board.link.forget_all();
        self.enter(Stage::Shutdown(Box::new(board)));
        self.events.push(Event::Error(error.clone()));
        self.error = Some(error);
    }

    fn take_stage(&mut self) -> Stage {
        self.collect_events();
        core::mem::replace(&mut self.stage, Stage::Failed)
    }

    /// Takes bytes from the port.
    pub fn receive(&mut self, bytes: &[u8], now: Seconds) {
        match &mut self.stage {
            Stage::Identifying(identifying) => match identifying.receive(bytes, now) {
                Ok(None) => {}
                Ok(Some(dictionary)) => {
                    let Stage::Identifying(identifying) = self.take_stage() else { return };
                    match Connecting::new(
                        identifying.into_link(),
                        dictionary,
                        &self.config,
                        !self.has_restarted,
                    ) {
                        Ok((connecting, identified)) => {
                            self.enter(Stage::Connecting(Box::new(connecting)));
                            self.events.push(identified);
                        }
                        Err(error) => self.fail(error),
                    }
                }
                Err(error) => self.fail(error),
            },
            Stage::Connecting(connecting) => connecting.receive(bytes, now),
            Stage::Holding(holding) => {
                if let Err(failure) = holding.receive(bytes, now) {
                    self.on_failure(failure, now);
                }
            }
            Stage::Ready(ready) => {
                if let Err(failure) = ready.receive(bytes, now) {
                    self.on_failure(failure, now);
                }
            }
            Stage::Shutdown(board) => {
                for (message, sent) in inbox::receive(&mut board.link, &board.dictionary, bytes, now) {
                    match message {
                        Message::Clock(low) => board.sync.clock(low, sent, now),
                        Message::Uptime { high, low } => board.sync.uptime(high, low, sent, now),
                        _ => {}
                    }
                }
            }
            Stage::Failed => {}
        }
    }

    fn on_failure(&mut self, failure: Failure, now: Seconds) {
        if let Stage::Ready(ready) = &mut self.stage {
            ready.diary.tell_last(now);
        }
        let mut board = match self.take_stage() {
            Stage::Ready(ready) => ready.board,
            Stage::Holding(holding) => holding.board,
            stage => {
                self.stage = stage;
                return;
            }
        };
        match failure {
            Failure::Stop(error) => {
                board.link.forget_all();
                board.immediate(&Command::EmergencyStop {});
                self.stopped(board, error.ending(Ended::Everything));
            }
            Failure::Shutdown(error) => self.stopped(board, error),
            Failure::Lost(error) => {
                if error.code == ErrorCode::LinkLost {
                    // Perhaps only the way back is cut.
                    self.part(&mut board, &Command::EmergencyStop {}, now);
                }
                self.fail(error);
            }
        }
    }

    /// Does what is due, appends bytes for the port to `out`, and says when to call again if nothing arrives before.
    pub fn poll(&mut self, now: Seconds, out: &mut Vec<u8>) -> Seconds {
        out.append(&mut self.parting);
        match &mut self.stage {
            Stage::Identifying(identifying) => match identifying.poll(now, out) {
                Ok(wake) => wake,
                Err(error) => {
                    self.fail(error);
                    now + IDLE_WAKE
                }
            },
            Stage::Connecting(connecting) => match connecting.poll(now, out) {
                Ok(Outcome::Pending(wake)) => wake,
                Ok(outcome) => {
                    self.on_connected(&outcome, now);
                    now
                }
                Err(error) => {
                    self.fail(error);
                    now + IDLE_WAKE
                }
            },
            Stage::Holding(holding) => match holding.poll(&mut self.events, now, out) {
                Ok(Err(wake)) => wake,
                Ok(Ok((taken, options))) => {
                    self.taken_up(taken, options, now);
                    now
                }
                Err(failure) => {
                    self.on_failure(failure, now);
                    now
                }
            },
            Stage::Ready(ready) => match ready.poll(now, out) {
                Ok(wake) => wake,
                Err(failure) => {
                    self.on_failure(failure, now);
                    now
                }
            },
            // Whether a board that was told to stop has done so is not known until it answers.
            Stage::Shutdown(board) if board.sync.is_silent(now) => {
                self.fail(PrinterError::new(ErrorCode::LinkTimeout, "it was stopped, and answers no more"));
                now + IDLE_WAKE
            }
            Stage::Shutdown(board) => {
                connect::ask_clock(board, now);
                let clock_now = board.clock_at(now);
                board.link.poll(now, clock_now, out).unwrap_or(now + IDLE_WAKE).min(now + IDLE_WAKE)
            }
            Stage::Failed => now + IDLE_WAKE,
        }
    }

    fn on_connected(&mut self, outcome: &Outcome, now: Seconds) {
        let Stage::Connecting(connecting) = self.take_stage() else { return };
        let Connecting { board, .. } = *connecting;
        match *outcome {
            Outcome::Pending(_) => {}
            Outcome::Holds(queue) => self.enter(Stage::Holding(Box::new(Holding::new(board, queue)))),
            Outcome::Ready => match Ready::new(self.config.clone(), board, now) {
                Ok(ready) => {
                    self.restarts_left = RESTARTS_MAX;
                    self.restart_wanted = false;
                    self.enter(Stage::Ready(Box::new(ready)));
                }
                Err(error) => self.fail(error),
            },
            Outcome::NeedsRestart | Outcome::Shutdown(_) if self.restarts_left == 0 => {
                let detail = "the board was asked to restart and did not";
                self.fail(PrinterError::new(ErrorCode::ConfigMismatch, detail));
            }
            Outcome::NeedsRestart => self.restart(Some(board), now),
            Outcome::Shutdown(_) if self.restart_wanted => self.restart(Some(board), now),
            Outcome::Shutdown(reason) => {
                let text = board.dictionary.enumeration_name("static_string_id", i64::from(reason));
                let error = PrinterError::from_shutdown_text(text.unwrap_or("unknown reason"));
                self.stopped(board, error);
            }
        }
    }

    /// The number of the print that a board holds whose host is gone: [`Journal::knows`] whose it is.
    pub fn held_print(&self) -> Option<u32> {
        match &self.stage {
            Stage::Holding(holding) => Some(holding.queue.id),
            _ => None,
        }
    }

    /// Takes up the print that the board holds: its file is then fed from the beginning, as a job's is, and the plan is made
    /// again up to where the board is. That moves nothing. Then the print is held in this session, and goes on or is
    /// ended at the user's word. What does not fit comes as an error, and the board goes on holding.
    pub fn take_up(&mut self, journal: &Journal) -> Result<(), PrinterError> {
        let Stage::Holding(holding) = &mut self.stage else { return Err(ErrorCode::NoJob.into()) };
        holding.begin(journal, &self.config)
    }

    /// The plan is where the board is.
    fn taken_up(&mut self, taken: Continuation, options: JobOptions, now: Seconds) {
        let Stage::Holding(holding) = self.take_stage() else { return };
        let Holding { board, queue, .. } = *holding;
        match Ready::take_up(self.config.clone(), board, taken, &queue, options, now) {
            Ok(ready) => self.enter(Stage::Ready(Box::new(ready))),
            Err((board, error)) => {
                self.stage = Stage::Holding(Box::new(Holding::new(*board, queue)));
                self.events.push(Event::Error(error));
            }
        }
    }

    /// The owner wants the board to start anew.
    fn restart_wanted(&mut self, now: Seconds) {
        let board = match self.take_stage() {
            Stage::Ready(ready) => {
                if ready.job.is_some() {
                    self.events.push(Event::JobCancelled);
                }
                Some(ready.board)
            }
            Stage::Shutdown(board) => Some(*board),
            Stage::Holding(holding) => Some(holding.board),
            Stage::Connecting(connecting) => Some(connecting.board),
            Stage::Identifying(_) | Stage::Failed => None,
        };
        self.restarts_left = RESTARTS_MAX;
        self.restart_wanted = true;
        self.restart(board, now);
    }

    /// Has the board start anew, and reads it from scratch.
    fn restart(&mut self, board: Option<Board>, now: Seconds) {
        if let Some(mut board) = board {
            self.restarts_left = self.restarts_left.saturating_sub(1);
            self.has_restarted = true;
            self.part(&mut board, &Command::Reset {}, now);
        }
        self.error = None;
        self.enter(Stage::Identifying(Box::new(Identifying::after_restart(now))));
    }

    /// A last command to a board that is then no longer listened to.
    fn part(&mut self, board: &mut Board, command: &Command<'_>, now: Seconds) {
        board.link.forget_all();
        board.immediate(command);
        let clock_now = board.clock_at(now);
        board.link.poll(now, clock_now, &mut self.parting);
    }

    /// Counts of the link.
    pub fn link_stats(&self) -> Option<LinkStats> {
        match &self.stage {
            Stage::Connecting(connecting) => Some(connecting.board.link.stats()),
            Stage::Holding(holding) => Some(holding.board.link.stats()),
            Stage::Ready(ready) => Some(ready.board.link.stats()),
            Stage::Shutdown(board) => Some(board.link.stats()),
            Stage::Identifying(_) | Stage::Failed => None,
        }
    }

    /// The board's motion clock now, as far as it is known: that of moves and runs. It is the board's clock, less the
    /// time that motion was held.
    pub fn motion_clock(&self, now: Seconds) -> Option<Ticks> {
        match &self.stage {
            Stage::Ready(ready) => Some(ready.board.motion_at(now)),
            _ => None,
        }
    }
}
