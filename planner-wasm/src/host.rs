//! A session as the page sees it: the session itself, and the last of everything that it told.
//!
//! Sorts events into those that cross as JSON and moves, which cross as numbers. Host time is in seconds. Every list is
//! bounded: where nobody takes what waits, the oldest goes.

use std::collections::VecDeque;

use printer::{
    config::PrinterConfig,
    error::{ErrorCode, PrinterError},
    journal::{Journal, JournalError},
    session::{Event, JobOptions, JobStatus, PhaseName, ScheduledMove, Session},
};
use units::{Seconds, Ticks};
use wasm_bindgen::prelude::{JsError, wasm_bindgen};

use crate::{
    messages::{
        BoardView, ErrorMessage, JobRequest, JobView, LinkView, Snapshot, TemperatureView, UiEvent,
        UiRequest, json,
    },
    read_config, simulation,
    speed::SpeedRecord,
    thrown,
};

/// The most events that wait.
const EVENTS_MAX: usize = 4096;
/// The most moves that wait, and the most that are remembered until they have been made.
const MOVES_MAX: usize = 16_384;
/// Numbers that describe a move: line, start and end (host time, s), from x y z e, to x y z e (mm).
pub const MOVE_NUMBERS: usize = 11;

/// A session with a memory.
pub struct Host {
    session: Session,
    events: VecDeque<UiEvent>,
    dropped: u64,
    moves: VecDeque<ScheduledMove>,
    /// Moves that have not ended.
    ahead: VecDeque<ScheduledMove>,
    speeds: SpeedRecord,
    board: Option<BoardView>,
    temperatures: Vec<TemperatureView>,
    line: u32,
    elapsed_s: f64,
    fed_bytes: u64,
    queued_least: Option<Seconds>,
}

impl Host {
    /// A session on a port that has just been opened.
    pub fn new(config: PrinterConfig, now: Seconds) -> Self {
        Self {
            session: Session::new(config, now),
            events: VecDeque::new(),
            dropped: 0,
            moves: VecDeque::new(),
            ahead: VecDeque::new(),
            speeds: SpeedRecord::default(),
            board: None,
            temperatures: Vec::new(),
            line: 0,
            elapsed_s: 0.0,
            fed_bytes: 0,
            queued_least: None,
        }
    }

    /// Takes bytes from the port.
    pub fn receive(&mut self, bytes: &[u8], now: Seconds) {
        self.session.receive(bytes, now);
        self.sort_events();
    }

    /// Does what is due; bytes for the port go to `out`. Returns when to call again if nothing arrives before.
    pub fn poll(&mut self, now: Seconds, out: &mut Vec<u8>) -> Seconds {
        self.note_queued(now);
        let wake = self.session.poll(now, out);
        self.sort_events();
        wake
    }

    /// Before the session adds to it: the board's queue is shortest now.
    fn note_queued(&mut self, now: Seconds) {
        if self.session.job_status() == JobStatus::Printing
            && let Some(queued) = self.session.motion_queued(now)
        {
            self.queued_least = Some(self.queued_least.map_or(queued, |least| least.min(queued)));
        }
    }

    /// Asks for something.
    pub fn request(&mut self, request: UiRequest, now: Seconds) -> Result<(), PrinterError> {
        let result = self.session.request(request.into(), now);
        self.sort_events();
        result
    }

    /// Starts a job.
    pub fn start_job(&mut self, options: JobOptions, now: Seconds) -> Result<(), PrinterError> {
        self.session.start_job(options, now)?;
        self.line = 0;
        self.elapsed_s = 0.0;
        self.fed_bytes = 0;
        self.queued_least = None;
        self.sort_events();
        Ok(())
    }

    /// How many bytes of the job's file may be fed now.
    pub fn job_wants(&self) -> usize {
        self.session.job_wants()
    }

    /// The next bytes of the job's file.
    pub fn job_feed(&mut self, bytes: &[u8]) {
        self.fed_bytes += bytes.len() as u64;
        self.session.job_feed(bytes);
    }

    /// The job's file has ended.
    pub fn job_end(&mut self) {
        self.session.job_end();
    }

    /// What is to be added to the present print's journal.
    pub fn take_journal(&mut self) -> String {
        self.session.take_journal()
    }

    /// The number under which the board holds a print whose host is gone.
    pub fn held_print(&self) -> Option<u32> {
        self.session.held_print()
    }

    /// Takes up the print that the board holds; its file is then fed from the beginning.
    pub fn take_up(&mut self, journal: &[u8]) -> Result<(), PrinterError> {
        let refused =
            |error: JournalError| PrinterError::new(ErrorCode::ContinuationRefused, error.to_string());
        let journal = Journal::read(journal).map_err(refused)?;
        self.session.take_up(&journal)?;
        let (line, elapsed) = journal.progress.unwrap_or_default();
        (self.line, self.elapsed_s, self.fed_bytes) = (line, elapsed.0, 0);
        self.queued_least = None;
        Ok(())
    }

    fn sort_events(&mut self) {
        for event in self.session.take_events() {
            self.remember(&event);
            if let Some(event) = UiEvent::of(&event) {
                self.events.push_back(event);
            }
        }
        while self.events.len() > EVENTS_MAX {
            self.events.pop_front();
            self.dropped += 1;
        }
    }

    fn remember(&mut self, event: &Event) {
        match event {
            Event::Phase(phase) if *phase != PhaseName::Ready => {
                self.moves.clear();
                self.ahead.clear();
                self.speeds.clear();
                if *phase == PhaseName::Identifying {
                    self.board = None;
                    self.temperatures.clear();
                }
            }
            Event::Identified { version, mcu, clock_freq } => {
                let (version, mcu) = (version.clone(), mcu.clone());
                self.board = Some(BoardView { version, mcu, clock_freq_hz: *clock_freq });
            }
            Event::Progress { line, elapsed } => {
                self.line = *line;
                self.elapsed_s = elapsed.0;
            }
            Event::Move(mv) => {
                push_bounded(&mut self.moves, *mv);
                push_bounded(&mut self.ahead, *mv);
                self.speeds.push(mv);
            }
            Event::RunBroken { at } => {
                self.ahead.clear();
                self.speeds.stop(*at);
            }
            Event::Temperature { .. } => {
                if let Some(UiEvent::Temperature { heater, temperature_c, target_c, duty, standby }) =
                    UiEvent::of(event)
                {
                    self.temperatures.retain(|known| known.heater != heater);
                    self.temperatures.push(TemperatureView {
                        heater,
                        temperature_c,
                        target_c,
                        duty,
                        standby,
                    });
                    self.temperatures.sort_by_key(|known| known.heater as u8);
                }
            }
            _ => {}
        }
    }

    /// What happened since this was last asked.
    pub fn take_events(&mut self) -> Vec<UiEvent> {
        let mut events: Vec<UiEvent> = self.events.drain(..).collect();
        if self.dropped > 0 {
            events.push(UiEvent::Dropped { count: core::mem::take(&mut self.dropped) });
        }
        events
    }

    /// The moves planned since this was last asked, [`MOVE_NUMBERS`] each; nothing while the clock is not known.
    pub fn take_moves(&mut self, now: Seconds) -> Vec<f64> {
        let moves = core::mem::take(&mut self.moves);
        let Some((clock_now, freq)) = self.clock(now) else { return Vec::new() };
        let mut numbers = Vec::with_capacity(moves.len() * MOVE_NUMBERS);
        for mv in moves {
            let at = |ticks: Ticks| now.0 + ticks_between(clock_now, ticks) / freq;
            numbers.extend([f64::from(mv.line), at(mv.start), at(mv.end)]);
            numbers.extend(mv.from);
            numbers.extend(mv.to);
        }
        numbers
    }

    fn clock(&self, now: Seconds) -> Option<(Ticks, f64)> {
        let freq = self.board.as_ref()?.clock_freq_hz;
        Some((self.session.motion_clock(now)?, freq)).filter(|_| freq > 0.0)
    }

    /// Where the head is now, in the G-code's coordinates, going evenly through the present move.
    fn live(&mut self, now: Seconds) -> Option<[f64; 4]> {
        let (clock_now, _) = self.clock(now)?;
        while self.ahead.pop_front_if(|mv| mv.end <= clock_now).is_some() {}
        let Some(mv) = self.ahead.front() else {
            return self.session.position().map(|(position, _)| position);
        };
        let part = ticks_between(mv.start, clock_now) / ticks_between(mv.start, mv.end);
        let part = part.clamp(0.0, 1.0);
        let at = [0, 1, 2, 3].map(|axis| mv.from[axis] + part * (mv.to[axis] - mv.from[axis]));
        Some(self.session.gcode_from_machine(at))
    }

    /// The toolhead's planned speed around now, pairs of time (s, relative to now) and speed (mm/s); nothing while the
    /// board's clock is not known.
    pub fn planned_speed(&self, now: Seconds, behind: Seconds, ahead: Seconds) -> Vec<f64> {
        let clock = self.clock(now);
        clock.map_or_else(Vec::new, |(now, freq)| self.speeds.around(now, freq, behind, ahead))
    }

    /// Everything that a panel shows.
    pub fn snapshot(&mut self, now: Seconds) -> Snapshot {
        let position = self.session.position();
        let [speed_factor, flow_factor] = self.session.factors();
        Snapshot {
            phase: self.session.phase().into(),
            error: self.session.error().map(ErrorMessage::from),
            board: self.board.clone(),
            temperatures: self.temperatures.clone(),
            position_mm: position.map(|(position, _)| position),
            live_mm: self.live(now),
            z_lift_mm: self.session.z_lift(),
            homed: position.map_or([false; 3], |(_, homed)| homed),
            job: JobView {
                status: self.session.job_status().into(),
                line: self.line,
                elapsed_s: self.elapsed_s,
                fed_bytes: self.fed_bytes as f64,
                queued_least_s: self.queued_least.map(|time| time.0),
                start: self.session.pending_start().map(Into::into),
            },
            queued_s: self.session.motion_queued(now).map(|time| time.0),
            speed_factor,
            flow_factor,
            fan: self.session.fan_speed(),
            link: self.session.link_stats().map(LinkView::from),
        }
    }
}

fn push_bounded(moves: &mut VecDeque<ScheduledMove>, mv: ScheduledMove) {
    if moves.len() >= MOVES_MAX {
        moves.pop_front();
    }
    moves.push_back(mv);
}

fn ticks_between(from: Ticks, to: Ticks) -> f64 {
    to.0 as f64 - from.0 as f64
}

/// A connection to a board. The owner of the port and the clock is a loop around it: `receive` what came, `poll` and send
/// what that returns, sleep until `wake_s` at most.
#[wasm_bindgen]
pub struct PrinterSession {
    host: Host,
    wake: Seconds,
}

#[wasm_bindgen]
impl PrinterSession {
    /// A session on a port that has just been opened, for the machine that the text of a `printer.cfg` describes.
    #[wasm_bindgen(constructor)]
    pub fn new(printer_cfg: &str, now_s: f64) -> Result<PrinterSession, JsError> {
        let config = read_config(printer_cfg).map_err(|error| thrown(&error))?;
        Ok(Self { host: Host::new(config, Seconds(now_s)), wake: Seconds(now_s) })
    }

    /// The same for a `VirtualPrinter` made from the same file and board: where the file is for another board, the
    /// virtual one has the machine on its own pins, and so has this.
    pub fn for_virtual_printer(
        printer_cfg: &str,
        board: Option<String>,
        now_s: f64,
    ) -> Result<PrinterSession, JsError> {
        let fitted = read_config(printer_cfg).and_then(|config| simulation::fit(config, board.as_deref()));
        let (config, _) = fitted.map_err(|error| thrown(&error))?;
        Ok(Self { host: Host::new(config, Seconds(now_s)), wake: Seconds(now_s) })
    }

    /// Takes bytes from the port.
    pub fn receive(&mut self, bytes: &[u8], now_s: f64) {
        self.host.receive(bytes, Seconds(now_s));
    }

    /// Does what is due, and returns bytes for the port.
    pub fn poll(&mut self, now_s: f64) -> Vec<u8> {
        let mut out = Vec::new();
        self.wake = self.host.poll(Seconds(now_s), &mut out);
        out
    }

    /// When to poll again if nothing arrives before, as of the last poll.
    pub fn wake_s(&self) -> f64 {
        self.wake.0
    }

    /// What happened since this was last asked: an array of `UiEvent` as JSON.
    pub fn take_events(&mut self) -> String {
        json(&self.host.take_events())
    }

    /// The moves planned since this was last asked, 11 numbers each: line (0: none), start and end in host time (s), from
    /// x, y, z, e and to x, y, z, e (mm).
    pub fn take_moves(&mut self, now_s: f64) -> Vec<f64> {
        self.host.take_moves(Seconds(now_s))
    }

    /// The toolhead's planned speed from `behind_s` before now to `ahead_s` after it: pairs of time (s, relative to now,
    /// ascending) and speed (mm/s), between which it changes evenly. At most 4096 pairs, peaks kept; rest is zero, and
    /// the curve ends early where the plan does while the head still moves. Empty while the board is not ready.
    pub fn planned_speed(&self, now_s: f64, behind_s: f64, ahead_s: f64) -> Vec<f64> {
        self.host.planned_speed(Seconds(now_s), Seconds(behind_s), Seconds(ahead_s))
    }

    /// Asks for something: a `UiRequest` as JSON. What it leads to comes as events; an error means that nothing was done.
    pub fn request(&mut self, request: &str, now_s: f64) -> Result<(), JsError> {
        let request = serde_json::from_str(request).map_err(|error| unreadable(&error))?;
        self.host.request(request, Seconds(now_s)).map_err(|error| thrown(&error))
    }

    /// Starts a job: a `JobRequest` as JSON. Its file is then fed as far as it is wanted.
    pub fn start_job(&mut self, options: &str, now_s: f64) -> Result<(), JsError> {
        let options: JobRequest = serde_json::from_str(options).map_err(|error| unreadable(&error))?;
        self.host.start_job(options.into(), Seconds(now_s)).map_err(|error| thrown(&error))
    }

    /// How many bytes of the job's file may be fed now.
    pub fn job_wants(&self) -> usize {
        self.host.job_wants()
    }

    /// The next bytes of the job's file.
    pub fn job_feed(&mut self, bytes: &[u8]) {
        self.host.job_feed(bytes);
    }

    /// The job's file has ended.
    pub fn job_end(&mut self) {
        self.host.job_end();
    }

    /// What is to be added to the present print's journal, where one is kept: text, to be stored before the bytes of the
    /// last `poll` are sent.
    pub fn take_journal(&mut self) -> String {
        self.host.take_journal()
    }

    /// In the phase `holding`: the number under which the board holds a print (`journal_knows`).
    pub fn held_print(&self) -> Option<u32> {
        self.host.held_print()
    }

    /// In the phase `holding`: takes up the print with its journal. Its file is then fed as far as it is wanted, which
    /// moves nothing; then the print is held here, until the user resumes or cancels it. What does not fit comes as an
    /// error, and the board goes on holding.
    pub fn take_up(&mut self, journal: &[u8]) -> Result<(), JsError> {
        self.host.take_up(journal).map_err(|error| thrown(&error))
    }

    /// Everything that a panel shows: a `Snapshot` as JSON.
    pub fn snapshot(&mut self, now_s: f64) -> String {
        json(&self.host.snapshot(Seconds(now_s)))
    }
}

fn unreadable(error: &serde_json::Error) -> JsError {
    thrown(&PrinterError::new(ErrorCode::Internal, format!("a request of the page cannot be read: {error}")))
}

#[cfg(test)]
mod tests;
