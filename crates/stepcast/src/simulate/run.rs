//! The loop between a session and the virtual printer, in virtual time.

mod reckoning;
mod user;
mod watch;

use std::time::Instant;

use printer::{
    config::PrinterConfig,
    error::{ErrorCode, PrinterError},
    journal::{Journal, JournalError},
    session::{JobOptions, JobStatus, Request, Session},
};
use units::{Celsius, Hertz, Seconds, Ticks};
use virtual_printer::{BoardProfile, Faults, HostStall, VirtualPrinter};
use watch::SAMPLE_INTERVAL;

use super::{
    course::Course,
    host_clock::HostClock,
    lease_tap::LeaseTap,
    observer::{Observer, Wish},
    pauses::Pauses,
    report::After,
    tally::Tally,
};
use crate::{console::Progress, input::Input};

/// The session is called again after this time at the earliest, whatever it asks for.
const WAKE_MIN: Seconds = Seconds(50e-6);
/// After the end the machine is watched for so long: long enough for the board's own watch over its heaters.
pub(super) const AFTER: Seconds = Seconds(6.0);
/// A pause that is asked for so shortly before the print's end need not come.
const PAUSE_COMES: Seconds = Seconds(1.0);
/// The path may be this far off, or by a step of each axis where that is more.
pub(crate) const PATH_ERROR_MAX_MM: f64 = 0.02;
/// The progress bar is drawn this often, in rounds of the loop.
const ROUNDS_PER_DRAW: u32 = 256;

/// How far the simulation is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Connecting,
    Printing,
    /// Over; the machine is watched until then.
    Watching(Ticks),
}

/// What is simulated.
pub(crate) struct Setup {
    /// The machine.
    pub(crate) config: PrinterConfig,
    /// The board; without one, that whose pins the machine file names.
    pub(crate) board: Option<BoardProfile>,
    /// What goes wrong.
    pub(crate) faults: Faults,
    /// What all chance follows from.
    pub(crate) seed: u64,
    /// The user's confirmations before the print.
    pub(crate) options: JobOptions,
    /// The user confirms that a held print goes on, so long after it was shown as such; never without.
    pub(crate) consent_after: Option<Seconds>,
    /// The host is gone for good from this time of the board's on.
    pub(crate) host_dies: Option<Seconds>,
    /// Another host takes its place then.
    pub(crate) successor: Option<Successor>,
    /// The machine is watched for so long after the end.
    pub(crate) watched: Seconds,
    /// A print that has not ended after so long is given up as failed.
    pub(crate) time_max: Option<Seconds>,
    /// Nothing is shown on the terminal.
    pub(crate) quiet: bool,
}

/// A host that takes the place of one that is gone.
pub(crate) struct Successor {
    /// So long after that.
    pub(crate) after: Seconds,
    /// The file, from its beginning.
    pub(crate) job: Input,
    /// Of the journal there is only this share; all of it is 1.
    pub(crate) journal_part: f64,
}

/// What came of a print whose host is gone, or was held up.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Aftermath {
    /// The first run of motion began then; `None` without any.
    pub(crate) began: Option<Ticks>,
    /// The host was gone.
    pub(crate) host_died: Option<Ticks>,
    /// The lease that the board was told last brings motion to rest by then.
    pub(crate) lease_rest: Option<Ticks>,
    /// The last step of any motor.
    pub(crate) last_step: Option<Ticks>,
    /// When a heater was on last.
    pub(crate) heated: Ticks,
    /// When one was on last that was warmer than its stand-by.
    pub(crate) overheated: Ticks,
    /// Motion that began again without the user's word after a hold was shown.
    pub(crate) restarts: u32,
    /// The longest time from the user's wish for a pause to the last step before it, and whether any was longer than the
    /// ramp and a little.
    pub(crate) pause_rest: Option<Ticks>,
    pub(crate) pause_is_late: bool,
    /// A pause was accepted and never came.
    pub(crate) pause_is_forgotten: bool,
    /// The end of the job, before the machine was watched.
    pub(crate) ended: Ticks,
    /// The pulses that came while no line was being executed.
    pub(crate) strays: u64,
    /// The board's clock at power-up.
    pub(crate) start: Ticks,
}

/// A print on the virtual printer.
pub(crate) struct Simulation {
    printer: VirtualPrinter<Tally>,
    session: Session,
    clock: HostClock,
    observer: Observer,
    job: Input,
    job_fed: bool,
    options: JobOptions,
    consent_after: Option<Seconds>,
    /// The user will say yes then to what was held …
    consent_at: Option<Ticks>,
    /// … and until then nothing moves: the last step when the hold was shown.
    held_at: Option<Ticks>,
    /// Z is being homed, and then the print begins.
    homes: bool,
    host_dies: Option<Ticks>,
    successor: Option<Successor>,
    config: PrinterConfig,
    journal: String,
    /// When the host does nothing: from and until when; soonest last.
    stalls: Vec<(Ticks, Ticks)>,
    pauses: Pauses,
    stage: Stage,
    watched: Seconds,
    time_max: Option<Seconds>,
    /// It has been given up for taking longer.
    is_overdue: bool,
    quiet: bool,
    /// The temperatures at which heaters are safe without a host.
    standby: [(&'static str, Celsius); 2],
    lease: LeaseTap,
    aftermath: Aftermath,
    course: Course,
    next_sample: Ticks,
    seed: u64,
    path_error_max_mm: f64,
    wall_s: f64,
    after: After,
}

impl Simulation {
    /// Powers the machine up. `job` is what the host is fed, `reference` the same, for the path that it should draw.
    pub(crate) fn new(setup: Setup, job: Input, reference: Input) -> anyhow::Result<Self> {
        let Setup {
            mut config,
            board,
            faults,
            seed,
            options,
            consent_after,
            host_dies,
            successor,
            watched,
            time_max,
            quiet,
        } = setup;
        let board = demo_machine::fit(&mut config, board.as_ref())?;
        let machine = demo_machine::machine(&config)?;
        let step_distances = printer::machine::step_distances(&config).map(|distance| distance.0);
        let mut tally = Tally::new(step_distances, board.clock, config.shaper_reach());
        tally.path.set_gantry(machine.gantry);
        let reach = config.shaper_reach().0;
        // Where an input shaper has the head at most, off its path.
        let limits = &config.printer;
        let shaped_off = (limits.square_corner_velocity.0 + 0.5 * limits.max_accel.0 * reach) * reach;
        let host_hz = board.clock;
        let printer = VirtualPrinter::new(board, &machine, &faults, seed, tally)?;
        let start = printer.start();
        let clock = HostClock::new(start, host_hz);
        let step_mm = machine.gantry.head_step(step_distances);
        let standby = [
            ("extruder", config.extruder.as_ref().map(|extruder| extruder.heater.standby_temp)),
            ("heater_bed", config.heater_bed.as_ref().map(|bed| bed.standby_temp)),
        ]
        .map(|(name, standby)| (name, standby.unwrap_or(Celsius(0.0))));
        let mut observer = Observer::new(&config, machine.gantry, reference, start, quiet);
        if let Some(line) = options.start_line {
            observer.begin_with(line);
        }
        Ok(Self {
            observer,
            session: Session::new(config.clone(), clock.at(printer.now())),
            clock,
            job,
            job_fed: false,
            options,
            consent_after,
            consent_at: None,
            held_at: None,
            homes: false,
            host_dies: host_dies.map(|at| start + host_hz.ticks_in(at)),
            successor,
            config,
            journal: String::new(),
            stalls: stalls(&faults.host_stalls, start, host_hz),
            pauses: Pauses::new(&faults.pauses, start, host_hz),
            stage: Stage::Connecting,
            watched,
            time_max,
            is_overdue: false,
            quiet,
            standby,
            lease: LeaseTap::default(),
            aftermath: Aftermath { start, ..Aftermath::default() },
            course: Course::default(),
            next_sample: start,
            seed,
            path_error_max_mm: PATH_ERROR_MAX_MM.max(step_mm) + shaped_off,
            wall_s: 0.0,
            after: After::default(),
            printer,
        })
    }

    /// Prints the file to its end, or until something fails.
    pub(crate) fn run(&mut self) -> anyhow::Result<()> {
        let began = Instant::now();
        let progress = (!self.quiet).then(|| Progress::new("simulating", self.job.size()));
        let mut to_host = Vec::new();
        let mut to_board = Vec::new();
        let mut rounds = 0u32;
        loop {
            let wake = match self.away_until() {
                Some(until) => self.clock.at(until),
                None => self.attend(&mut to_board)?,
            };
            if let Stage::Watching(until) = self.stage
                && self.printer.now() >= until
            {
                break;
            }
            self.check_stall()?;
            self.give_up_late();
            let now = self.printer.now();
            let earliest = now + self.ticks(WAKE_MIN);
            let until = self.clock.ticks_at(wake).max(earliest).min(self.next_sample.max(earliest));
            self.printer.run_until(until, &mut to_host);
            let now = self.printer.now();
            if !to_host.is_empty() && self.away_until().is_none() {
                self.session.receive(&to_host, self.clock.at(now));
                to_host.clear();
            }
            if now >= self.next_sample {
                self.sample(now);
            }
            rounds = rounds.wrapping_add(1);
            if let Some(progress) = progress.as_ref().filter(|_| rounds.is_multiple_of(ROUNDS_PER_DRAW)) {
                self.draw(progress);
            }
        }
        self.wall_s = began.elapsed().as_secs_f64();
        Ok(())
    }

    /// Lets the session work: its bytes, its events, the file that it wants. Returns when it wants to be called again.
    fn attend(&mut self, to_board: &mut Vec<u8>) -> anyhow::Result<Seconds> {
        loop {
            let now = self.clock.at(self.printer.now());
            let wake = self.session.poll(now, to_board);
            self.journal += &self.session.take_journal();
            if !to_board.is_empty() {
                self.lease.watch(to_board, self.printer.now());
                self.printer.write(to_board);
                to_board.clear();
            }
            let acted = self.take_events(now) | self.consent(now) | self.set_out(now) | self.pause(now);
            let fed = self.feed()?;
            if !acted && !fed {
                let queued = self.session.motion_queued(now);
                self.observer.queued(queued);
                if let Some(ahead) = queued {
                    self.course.queued(ahead);
                }
                let users = self.consent_at.into_iter().chain(self.pauses.next()).min();
                return Ok(users.map_or(wake, |at| wake.min(self.clock.at(at))));
            }
        }
    }

    /// Whether anything came of the session's events.
    fn take_events(&mut self, now: Seconds) -> bool {
        let mut acted = false;
        for event in self.session.take_events() {
            let wish = self.observer.take(event, &mut self.printer);
            self.note_rest();
            let Some(wish) = wish else { continue };
            acted = true;
            let result = match wish {
                Wish::Start if self.stage == Stage::Connecting => {
                    self.stage = Stage::Printing;
                    self.session.start_job(self.options.clone(), now)
                }
                Wish::Held => match self.consent_after {
                    Some(after) => {
                        // It is what a pause comes to while what is held is heated again.
                        self.pauses.is_refused();
                        self.consent_at = Some(self.printer.now() + self.ticks(after));
                        self.held_at = self.printer.recorder().last_step;
                        Ok(())
                    }
                    None => Err(self.observer.held.clone().unwrap_or(ErrorCode::HeldHostAway.into())),
                },
                Wish::Resume if self.session.pending_start().is_some() => {
                    // There is nothing on the bed: the user has Z homed first, and X and Y are homed on the way.
                    self.homes = true;
                    self.session.request(Request::Gcode("G28 Z".to_owned()), now)
                }
                Wish::Resume => {
                    self.pauses.is_paused(self.printer.now());
                    Ok(())
                }
                Wish::End => {
                    self.end();
                    Ok(())
                }
                Wish::TakeUp => self.take_up(),
                Wish::Start if self.observer.is_taken_up && self.session.job_status() == JobStatus::None => {
                    Err(PrinterError::new(ErrorCode::ContinuationRefused, "the board held nothing"))
                }
                Wish::Start => Ok(()),
            };
            if let Err(error) = result {
                self.observer.error.get_or_insert(error);
                self.end();
            }
        }
        acted
    }

    /// The board holds a print: the host that is there now has its journal.
    fn take_up(&mut self) -> Result<(), PrinterError> {
        let refused =
            |error: JournalError| PrinterError::new(ErrorCode::ContinuationRefused, error.to_string());
        let journal = Journal::read(self.journal.as_bytes()).map_err(refused)?;
        self.session.take_up(&journal)
    }

    /// Another host takes the place of the one that is gone, if it is time for that.
    fn succeed(&mut self, died: Ticks) -> Option<Ticks> {
        let now = self.printer.now();
        let at = died + self.ticks(self.successor.as_ref()?.after);
        if at > now {
            return Some(at);
        }
        let Successor { job, journal_part, .. } = self.successor.take()?;
        self.host_dies = None;
        self.job = job;
        self.job_fed = false;
        let kept = (self.journal.len() as f64 * journal_part) as usize;
        // A journal is plain ASCII.
        self.journal.truncate(kept);
        self.session = Session::new(self.config.clone(), self.clock.at(now));
        self.observer.is_taken_up = true;
        self.pauses.host_is_gone();
        None
    }

    fn end(&mut self) {
        if !matches!(self.stage, Stage::Watching(_)) {
            self.aftermath.ended = self.printer.now();
            let before = self.aftermath.ended.saturating_sub(self.ticks(PAUSE_COMES));
            self.aftermath.pause_is_forgotten = self.pauses.is_forgotten(before);
            self.stage = Stage::Watching(self.printer.now() + self.ticks(self.watched));
        }
    }

    /// Feeds the session what it wants of the file.
    fn feed(&mut self) -> Result<bool, PrinterError> {
        if self.job_fed || self.stage != Stage::Printing {
            return Ok(false);
        }
        let wants = self.session.job_wants();
        if wants == 0 {
            return Ok(false);
        }
        let chunk = self.job.next(wants)?;
        if chunk.is_empty() {
            self.session.job_end();
            self.job_fed = true;
        } else {
            self.session.job_feed(chunk);
        }
        Ok(true)
    }

    /// Until when the host does nothing, if it is held up now or gone.
    fn away_until(&mut self) -> Option<Ticks> {
        let now = self.printer.now();
        if self.host_dies.is_some_and(|at| at <= now) {
            let died = *self.aftermath.host_died.get_or_insert(now);
            if self.stage == Stage::Printing && self.successor.is_some() {
                return self.succeed(died);
            }
            self.end();
            let Stage::Watching(until) = self.stage else { return None };
            return Some(until.max(now + self.ticks(SAMPLE_INTERVAL)));
        }
        while self.stalls.pop_if(|(_, until)| *until <= now).is_some() {}
        self.stalls.last().filter(|(from, _)| *from <= now).map(|(_, until)| *until)
    }

    fn ticks(&self, duration: Seconds) -> Ticks {
        self.printer.profile().clock.ticks_in(duration)
    }

    fn virtual_time(&self) -> Seconds {
        self.printer.profile().clock.duration_of(self.printer.now() - self.printer.start())
    }

    fn draw(&self, progress: &Progress) {
        progress.set(self.job.position());
        progress.say(format!("line {}, {:.0} s", self.observer.line, self.virtual_time().0));
    }
}

/// From and until when the host is held up; soonest last.
fn stalls(stalls: &[HostStall], start: Ticks, clock: Hertz) -> Vec<(Ticks, Ticks)> {
    let span = |stall: &HostStall| {
        let from = start + clock.ticks_in(stall.at);
        (from, from + clock.ticks_in(stall.lasts))
    };
    let mut spans: Vec<_> = stalls.iter().map(span).collect();
    spans.sort_by_key(|&(from, _)| core::cmp::Reverse(from));
    spans
}
