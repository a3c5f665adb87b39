//! From a port to a machine that is ready: dictionary, clock, configuration.

use units::{Hertz, Seconds};
use wire::{
    Command, Response,
    block::BLOCK_BYTES_MAX,
    dictionary::{Dictionary, Received},
};

use super::{
    attach::{Answer, Asking},
    board::{Board, Losses},
    event::{Event, PhaseName},
    inbox::{self, Message},
    layout::{self, Layout},
    motion_time::MotionTime,
};
use crate::{
    clock_sync::{ClockRequest, ClockSync},
    config::PrinterConfig,
    error::{ErrorCode, PrinterError},
    identify::{Identify, IdentifyError, PIECE_BYTES},
    journal::BoardQueue,
    link::{Lane, Link, Outgoing},
};

/// Questions that are not answered are asked again after this long.
const ASK_AGAIN: Seconds = Seconds(0.25);
/// A board that was asked to restart gets this long before it is spoken to.
const RESTART: Seconds = Seconds(1.0);
/// Eight readings are added up in 16 bits.
const ADC_MAX_MAX: f64 = 8191.0;
/// A board that has not taken its configuration in after this long never will.
const CONNECT_MAX: Seconds = Seconds(60.0);
/// With so large a share of printable bytes, what a board says is text; noise has a third.
const TEXT_SHARE_MIN: f64 = 0.9;
/// With fewer moves in its queue a board cannot be kept supplied.
const MOVE_COUNT_MIN: u16 = 64;

/// Reading the dictionary.
#[derive(Debug)]
pub(super) struct Identifying {
    link: Link,
    bootstrap: Dictionary,
    identify: Identify,
    not_before: Seconds,
    /// It has been spoken to.
    has_begun: bool,
    heard: Heard,
}

/// What came from a board that has not said who it is.
#[derive(Clone, Copy, Debug, Default)]
struct Heard {
    bytes: u64,
    /// Those that a text is made of.
    printable: u64,
}

impl Heard {
    fn take(&mut self, bytes: &[u8]) {
        let is_printable = |byte: &&u8| matches!(byte, b' '..=b'~' | b'\t' | b'\r' | b'\n');
        self.bytes += bytes.len() as u64;
        self.printable += bytes.iter().filter(is_printable).count() as u64;
    }

    /// Why such a board could not be identified; `answered` says that sound blocks came.
    fn explain(self, answered: bool) -> PrinterError {
        let Self { bytes, printable } = self;
        let (code, detail) = if bytes == 0 {
            (ErrorCode::BoardSilent, "nothing came from it")
        } else if answered {
            (ErrorCode::WrongFirmware, "it speaks the protocol, but does not say who it is")
        } else if printable as f64 >= TEXT_SHARE_MIN * bytes as f64 {
            (ErrorCode::WrongFirmware, "it answers in text")
        } else {
            (ErrorCode::BoardUnreadable, "what came is neither text nor a sound message")
        };
        PrinterError::new(code, detail)
    }
}

impl Identifying {
    /// A board on a port that has just been opened.
    pub(super) fn new(now: Seconds) -> Self {
        let bootstrap = Dictionary::bootstrap();
        // The first question of all, asked until the board's number is known: a board that checks blocks for a host before
        // us takes this one without a check, and asks for none from then on.
        let question = Command::Identify { offset: 0, count: PIECE_BYTES };
        let greeting = Outgoing::command(Lane::Control, &bootstrap, &question);
        let link = greeting.map_or_else(|_| Link::new(), |greeting| Link::greeting(greeting.payload()));
        Self {
            link,
            bootstrap,
            identify: Identify::new(),
            not_before: now,
            has_begun: true,
            heard: Heard::default(),
        }
    }

    /// A board that has been asked to restart.
    pub(super) fn after_restart(now: Seconds) -> Self {
        Self { not_before: now + RESTART, has_begun: false, ..Self::new(now) }
    }

    pub(super) fn receive(&mut self, bytes: &[u8], now: Seconds) -> Result<Option<Dictionary>, PrinterError> {
        let Self { link, bootstrap, identify, heard, .. } = self;
        heard.take(bytes);
        let mut result = Ok(None);
        link.receive(bytes, now, |payload| {
            let mut rest = payload.bytes;
            while let Ok(Received::Known(Response::IdentifyResponse { offset, data })) =
                bootstrap.decode(&mut rest)
            {
                match identify.receive(offset, data, now) {
                    Ok(None) => {}
                    Ok(Some(dictionary)) => result = Ok(Some(dictionary)),
                    Err(error) => result = Err(dictionary_error(&error)),
                }
            }
        });
        result
    }

    pub(super) fn poll(&mut self, now: Seconds, out: &mut Vec<u8>) -> Result<Seconds, PrinterError> {
        if now < self.not_before {
            return Ok(self.not_before);
        }
        self.has_begun = true;
        let asked = self.identify.poll(now).map_err(|error| match error {
            IdentifyError::Silent => self.heard.explain(self.link.stats().last_received.is_some()),
            error => dictionary_error(&error),
        });
        if let Some(request) = asked? {
            let command = Command::Identify { offset: request.offset, count: request.count };
            if let Ok(message) = Outgoing::command(Lane::Control, &self.bootstrap, &command) {
                let _ = self.link.queue(message);
            }
        }
        let wake = self.link.poll(now, units::Ticks(0), out);
        let ask = self.identify.next_wake().unwrap_or(now);
        Ok(wake.map_or(ask, |wake| wake.min(ask)))
    }

    pub(super) const fn phase(&self) -> PhaseName {
        if self.has_begun { PhaseName::Identifying } else { PhaseName::Restarting }
    }

    pub(super) fn into_link(self) -> Link {
        self.link
    }
}

fn dictionary_error(error: &IdentifyError) -> PrinterError {
    PrinterError::new(ErrorCode::DictionaryInvalid, error.to_string())
}

/// What is being waited for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// The state of the configuration and a clock that can be trusted.
    State,
    /// Whether a board that has been set up holds a print.
    Asking,
    /// The configuration to be taken in.
    Sent,
}

/// What came of it.
#[derive(Debug)]
pub(super) enum Outcome {
    Pending(Seconds),
    /// The machine is set up.
    Ready,
    /// The board has been set up by somebody else: it has to start anew.
    NeedsRestart,
    /// The board has stopped on the path of a print whose host is gone.
    Holds(BoardQueue),
    /// The board is in shutdown for this reason.
    Shutdown(u16),
}

/// Setting up a board that has been identified.
#[derive(Debug)]
pub(super) struct Connecting {
    pub(super) board: Board,
    step: Step,
    asked: Option<Seconds>,
    began: Option<Seconds>,
    config: Option<Message>,
    asking: Asking,
}

impl Connecting {
    pub(super) fn new(
        link: Link,
        dictionary: Dictionary,
        config: &PrinterConfig,
        since_power_up: bool,
    ) -> Result<(Self, Event), PrinterError> {
        let wrong = |detail: &str| PrinterError::new(ErrorCode::DictionaryIncomplete, detail);
        let clock_freq =
            dictionary.number("CLOCK_FREQ").ok_or_else(|| wrong("the board does not tell CLOCK_FREQ"))?;
        if !(1000.0..=1e9).contains(&clock_freq) {
            return Err(wrong("the board's CLOCK_FREQ makes no sense"));
        }
        let adc_max = layout::adc_max(&dictionary);
        if !(1.0..=ADC_MAX_MAX).contains(&adc_max) {
            return Err(wrong("the board's ADC_MAX makes no sense"));
        }
        let window = dictionary.number("RECEIVE_WINDOW");
        if window.is_some_and(|bytes| !(BLOCK_BYTES_MAX as f64..=1e6).contains(&bytes)) {
            return Err(wrong("the board's RECEIVE_WINDOW makes no sense"));
        }
        let layout = Layout::new(config, &dictionary, clock_freq)?;
        let clock = Hertz(clock_freq as u32);
        let event = Event::Identified {
            version: dictionary.version.clone(),
            mcu: dictionary.text("MCU").unwrap_or_default(),
            clock_freq,
        };
        let mut board = Board {
            link,
            sync: ClockSync::new(clock),
            clock,
            adc_max,
            dictionary,
            layout,
            losses: Losses::default(),
            motion: MotionTime::default(),
            since_power_up,
            said_after: Seconds(f64::NEG_INFINITY),
        };
        if let Some(window) = window {
            board.link.set_receive_window(window as usize);
        }
        if let Some(checks) = board.dictionary.block_checks() {
            board.link.set_checks(checks);
        }
        let asking = Asking::default();
        Ok((Self { board, step: Step::State, asked: None, began: None, config: None, asking }, event))
    }

    pub(super) const fn phase(&self) -> PhaseName {
        match self.step {
            Step::State | Step::Asking => PhaseName::Synchronising,
            Step::Sent => PhaseName::Configuring,
        }
    }

    pub(super) fn receive(&mut self, bytes: &[u8], now: Seconds) {
        for (message, sent) in inbox::receive(&mut self.board.link, &self.board.dictionary, bytes, now) {
            match message {
                Message::Clock(low) => self.board.sync.clock(low, sent, now),
                Message::Uptime { high, low } => self.board.sync.uptime(high, low, sent, now),
                Message::Config { .. } | Message::Shutdown { .. } => self.config = Some(message),
                _ => self.asking.receive(message, &mut self.board, now),
            }
        }
    }

    pub(super) fn poll(&mut self, now: Seconds, out: &mut Vec<u8>) -> Result<Outcome, PrinterError> {
        if self.board.sync.is_silent(now) {
            return Err(ErrorCode::BoardSilent.into());
        }
        if now - *self.began.get_or_insert(now) > CONNECT_MAX {
            return Err(PrinterError::new(ErrorCode::WrongFirmware, "it does not take its configuration in"));
        }
        ask_clock(&mut self.board, now);
        match self.config.take() {
            Some(Message::Shutdown { reason }) => return Ok(Outcome::Shutdown(reason)),
            // The reason follows as the answer to a command that is not carried out in that state.
            Some(Message::Config { is_shutdown: true, .. }) => {
                self.board.control(&Command::AllocateOids { count: 0 });
            }
            Some(Message::Config { is_config, crc, move_count, .. }) => {
                if let Some(outcome) = self.advance(is_config, crc, move_count)? {
                    return Ok(outcome);
                }
            }
            _ => {}
        }
        if self.step == Step::Asking {
            match self.asking.poll(&mut self.board, now) {
                Answer::Pending => {}
                Answer::Nothing => return Ok(Outcome::NeedsRestart),
                Answer::Holds(queue) => return Ok(Outcome::Holds(queue)),
            }
        }
        let idle = self.step != Step::Sent || self.board.link.is_idle();
        if idle && self.asked.is_none_or(|asked| now - asked >= ASK_AGAIN) {
            self.asked = Some(now);
            self.board.control(&Command::GetConfig {});
        }
        let clock_now = self.board.clock_at(now);
        let wake = self.board.link.poll(now, clock_now, out);
        let ask = self.board.sync.next_wake().min(now + ASK_AGAIN);
        Ok(Outcome::Pending(wake.map_or(ask, |wake| wake.min(ask))))
    }

    fn advance(
        &mut self,
        is_config: bool,
        crc: u32,
        move_count: u16,
    ) -> Result<Option<Outcome>, PrinterError> {
        match self.step {
            Step::State if is_config => {
                if crc != self.board.layout.crc || !self.board.layout.has_motion_clock {
                    return Ok(Some(Outcome::NeedsRestart));
                }
                self.board.begin(move_count);
                self.step = Step::Asking;
                Ok(None)
            }
            Step::State if self.board.sync.is_settled() => {
                let commands = self.board.layout.commands.clone();
                for command in &commands {
                    self.board.control(command);
                }
                let crc = self.board.layout.crc;
                self.board.control(&Command::FinalizeConfig { crc });
                self.step = Step::Sent;
                Ok(None)
            }
            Step::Sent if is_config && move_count < MOVE_COUNT_MIN => {
                let detail = format!("it has room for {move_count} moves, {MOVE_COUNT_MIN} are needed");
                Err(PrinterError::new(ErrorCode::BoardTooSmall, detail))
            }
            Step::Sent if is_config && crc == self.board.layout.crc => {
                self.board.begin(move_count);
                Ok(Some(Outcome::Ready))
            }
            Step::Sent if is_config => Err(ErrorCode::ConfigMismatch.into()),
            Step::State | Step::Asking | Step::Sent => Ok(None),
        }
    }
}

/// Asks the board for its clock when that is due.
pub(super) fn ask_clock(board: &mut Board, now: Seconds) {
    match board.sync.poll(now) {
        Some(ClockRequest::Uptime) => board.control(&Command::GetUptime {}),
        Some(ClockRequest::Clock) => board.control(&Command::GetClock {}),
        None => {}
    }
}
