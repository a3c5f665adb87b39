//! A board that has been set up already, by a host that is gone: whether it holds a print, and what is known of it.
//!
//! Nothing here moves anything or tells the board anything but questions. Who wants the print to go on brings its journal
//! and its file; the plan is then made again up to where the board is, and only where both agree there is something to
//! go on with. Everybody else restarts the board.

use units::Seconds;
use wire::Command;

use super::{
    board::Board,
    connect,
    event::Events,
    inbox::{self, Message},
    job::JobOptions,
    motion_time::{MotionReport, MotionState},
    ready::Failure,
};
use crate::{
    config::PrinterConfig,
    error::{ErrorCode, PrinterError},
    journal::{Advance, BoardQueue, Continuation, Journal, MotorQueue, Replay},
    machine::MOTORS,
};

/// Questions are asked again after this long: answers may get lost, and motion takes its time to come to rest.
const ASK_AGAIN: Seconds = Seconds(0.3);
/// A host that is gone leaves motion of a few seconds; a board that moves for longer does what nobody here knows.
const REST_MAX: Seconds = Seconds(15.0);
/// While the plan is made again the session wants to be called soon.
const REPLAY_WAKE: Seconds = Seconds(0.002);

/// What a board that has been set up already does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Answer {
    Pending,
    /// Nothing that could be gone on with.
    Nothing,
    /// It is at rest on the path of a print.
    Holds(BoardQueue),
}

/// Asking a board what it does.
#[derive(Debug, Default)]
pub(super) struct Asking {
    since: Option<Seconds>,
    asked: Option<Seconds>,
    report: Option<MotionReport>,
    queues: [Option<(u32, MotorQueue)>; MOTORS],
}

impl Asking {
    pub(super) fn receive(&mut self, message: Message, board: &mut Board, now: Seconds) {
        match message {
            Message::Motion(report) => {
                board.on_motion(&report, now);
                // What was said of the motors before the first word of the rest may be older than that rest.
                let is_news = |last: MotionReport| last.state != report.state;
                if self.report.replace(report).is_none_or(is_news) {
                    self.forget(|queue| queue.done < queue.received);
                }
            }
            Message::Queue { oid, job, queue } => {
                let is_it =
                    |motor: &usize| board.layout.steppers[*motor].is_some_and(|oids| oids.stepper.0 == oid);
                if let Some(motor) = (0..MOTORS).find(is_it) {
                    self.queues[motor] = Some((job, queue));
                }
            }
            _ => {}
        }
    }

    pub(super) fn poll(&mut self, board: &mut Board, now: Seconds) -> Answer {
        if now - *self.since.get_or_insert(now) > REST_MAX {
            return Answer::Nothing;
        }
        match self.judge(board) {
            Answer::Pending => {}
            answer => return answer,
        }
        if self.asked.is_none_or(|asked| now - asked >= ASK_AGAIN) {
            self.asked = Some(now);
            if self.report.is_none_or(|report| report.state != MotionState::Held) {
                self.forget(|queue| queue.done < queue.received);
            }
            self.forget(in_pulse);
            board.control(&Command::MotionGetState {});
            // Only those who have not answered: a small board has no room for all answers at once, and drops some.
            board.ask_queues(|motor| self.queues[motor].is_none());
        }
        Answer::Pending
    }

    /// Forgets what was said of motors that may have moved since.
    fn forget(&mut self, is_old: impl Fn(&MotorQueue) -> bool) {
        for queue in &mut self.queues {
            queue.take_if(|(_, queue)| is_old(queue));
        }
    }

    /// What the answers say, once all are there and nothing moves.
    fn judge(&self, board: &Board) -> Answer {
        let Some(report) = self.report else { return Answer::Pending };
        let mut queue = BoardQueue::default();
        for (motor, oids) in board.layout.steppers.iter().enumerate() {
            match self.queues[motor] {
                _ if oids.is_none() => {}
                Some((job, place)) => {
                    queue.id = job;
                    queue.motors[motor] = place;
                }
                None => return Answer::Pending,
            }
        }
        let is_absurd = |motor: &MotorQueue| motor.done > motor.received;
        if queue.id == 0 || queue.motors.iter().any(is_absurd) {
            return Answer::Nothing;
        }
        queue.is_held = report.state == MotionState::Held;
        let is_at_rest = match report.state {
            MotionState::Held => true,
            MotionState::Running => queue.motors.iter().all(|motor| motor.done == motor.received),
            MotionState::Slowing | MotionState::Speeding => false,
        };
        if is_at_rest && !queue.motors.iter().any(in_pulse) && board.sync.is_settled() {
            Answer::Holds(queue)
        } else {
            Answer::Pending
        }
    }
}

/// In the last pulse of a row: that will be over by the next round.
const fn in_pulse(motor: &MotorQueue) -> bool {
    motor.done < motor.received && motor.left == 0
}

/// A board that holds a print whose host is gone.
#[derive(Debug)]
pub(super) struct Holding {
    pub(super) board: Board,
    pub(super) queue: BoardQueue,
    replay: Option<(Replay, JobOptions)>,
}

impl Holding {
    pub(super) const fn new(board: Board, queue: BoardQueue) -> Self {
        Self { board, queue, replay: None }
    }

    /// Begins to make the plan again.
    pub(super) fn begin(&mut self, journal: &Journal, config: &PrinterConfig) -> Result<(), PrinterError> {
        let replay = Replay::new(config, self.board.clock, journal, self.queue)?;
        let options = JobOptions {
            confirmed_lines: journal.confirmed.clone(),
            confirm_all: journal.confirm_all,
            journal: Some(journal.print),
            start_line: journal.start_line,
            transform: Some(journal.transform().clone()),
        };
        self.replay = Some((replay, options));
        Ok(())
    }

    /// The plan that is being made again.
    pub(super) fn replay(&mut self) -> Option<&mut Replay> {
        self.replay.as_mut().map(|(replay, _)| replay)
    }

    pub(super) fn wants(&self) -> usize {
        self.replay.as_ref().map_or(0, |(replay, _)| replay.wants())
    }

    pub(super) fn receive(&mut self, bytes: &[u8], now: Seconds) -> Result<(), Failure> {
        for (message, sent) in inbox::receive(&mut self.board.link, &self.board.dictionary, bytes, now) {
            match message {
                Message::Clock(low) => self.board.sync.clock(low, sent, now),
                Message::Uptime { high, low } => self.board.sync.uptime(high, low, sent, now),
                Message::Motion(report) => drop(self.board.on_motion(&report, now)),
                Message::Starting => return Err(Failure::Lost(ErrorCode::BoardRestarted.into())),
                Message::Shutdown { reason } => {
                    let text = self.board.dictionary.enumeration_name("static_string_id", i64::from(reason));
                    let error = PrinterError::from_shutdown_text(text.unwrap_or("unknown reason"));
                    return Err(Failure::Shutdown(error));
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Does what is due; what there is to go on with, once that is known, else when to call again.
    pub(super) fn poll(
        &mut self,
        events: &mut Events,
        now: Seconds,
        out: &mut Vec<u8>,
    ) -> Result<Result<(Continuation, JobOptions), Seconds>, Failure> {
        if self.board.sync.is_silent(now) {
            return Err(Failure::Lost(ErrorCode::LinkLost.into()));
        }
        connect::ask_clock(&mut self.board, now);
        let clocks = self.board.clocks(now);
        let wake = self.board.link.poll(now, clocks, out).unwrap_or(now + ASK_AGAIN).min(now + ASK_AGAIN);
        let wake = wake.min(self.board.sync.next_wake());
        let Some((mut replay, options)) = self.replay.take() else { return Ok(Err(wake)) };
        match replay.advance() {
            Ok(Advance::Done) => return Ok(Ok((replay.finish(), options))),
            Ok(Advance::NeedsInput | Advance::Working) => {
                self.replay = Some((replay, options));
                return Ok(Err(now + REPLAY_WAKE));
            }
            Err(error) => events.push(super::Event::Error(refusal(error))),
        }
        Ok(Err(wake))
    }
}

/// Whatever is wrong with the plan, the print is not gone on with.
fn refusal(error: PrinterError) -> PrinterError {
    if error.code == ErrorCode::ContinuationRefused {
        return error;
    }
    PrinterError::new(ErrorCode::ContinuationRefused, error.what_happened())
}
