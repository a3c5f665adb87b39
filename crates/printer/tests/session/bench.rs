//! A session and a virtual printer on one table, in virtual time.
//!
//! The host's clock and the board's differ, as they do: the host's starts anywhere, the board's crystal is a little off.
//! What a test asserts about the machine it reads from the virtual printer, never from the session.

use std::collections::VecDeque;

use printer::{
    error::{ErrorCode, PrinterError},
    session::{Event, JobOptions, JobStatus, PhaseName, Request, Session},
};
use units::{Seconds, Ticks};
use virtual_printer::{BoardProfile, Faults, Recorder, State, VirtualPrinter};

use crate::machine;

/// The host's clock when the board's starts.
const HOST_START: Seconds = Seconds(4321.0);
/// How much faster than it says the board's clock runs.
const CRYSTAL_ERROR: f64 = 30e-6;
/// The session is called again after this time at the earliest.
const WAKE_MIN: Seconds = Seconds(50e-6);
/// Events of these kinds are only counted, so that the log can be read.
const LOG_MAX: usize = 100_000;

/// One pulse: when, which motor, which way.
pub(crate) type Pulse = (u64, usize, bool);

/// Every pulse of every motor, on the motion clock; that is the board's as long as nothing is held.
#[derive(Debug, Default)]
pub(crate) struct Pulses(pub(crate) Vec<Pulse>, Ticks);

impl Recorder for Pulses {
    fn step(&mut self, motor: usize, at: Ticks, forward: bool, _count: i64) {
        self.0.push(((at - self.1).0, motor, forward));
    }

    fn motion_behind(&mut self, behind: Ticks) {
        self.1 = behind;
    }
}

/// How a bench is set up.
#[derive(Clone, Debug)]
pub(crate) struct Setup {
    pub(crate) board: BoardProfile,
    pub(crate) config: String,
    pub(crate) faults: String,
    pub(crate) seed: u64,
}

impl Default for Setup {
    fn default() -> Self {
        Self {
            board: BoardProfile::rp2040(),
            config: machine::CONFIG.to_owned(),
            faults: String::new(),
            seed: 1,
        }
    }
}

impl Setup {
    /// The usual machine with these faults.
    pub(crate) fn faults(faults: &str) -> Self {
        Self { faults: faults.to_owned(), ..Self::default() }
    }

    /// The usual machine with a line of its configuration replaced.
    pub(crate) fn config(from: &str, to: &str) -> Self {
        let config = machine::CONFIG.replacen(from, to, 1);
        assert_ne!(config, machine::CONFIG, "{from}");
        Self { config, ..Self::default() }
    }

    pub(crate) fn bench(&self) -> Bench {
        Bench::new(self)
    }

    /// A bench whose session is ready.
    pub(crate) fn ready(&self) -> Bench {
        let mut bench = self.bench();
        bench.connect();
        bench
    }
}

/// See the module.
pub(crate) struct Bench {
    pub(crate) printer: VirtualPrinter<Pulses>,
    pub(crate) session: Session,
    pub(crate) events: Vec<Event>,
    start: Ticks,
    ticks_per_s: f64,
    file: VecDeque<u8>,
    file_ended: bool,
    /// No more than this much of the job's file is fed.
    pub(crate) feed_max: usize,
    fed: usize,
    /// The session is not called.
    pub(crate) stalled: bool,
    /// What the host writes stays on its way, for as long as this holds.
    pub(crate) is_line_stuck: bool,
    to_board: Vec<u8>,
    to_host: Vec<u8>,
    /// The job's journal, as it is kept.
    pub(crate) journal: String,
}

impl Bench {
    fn new(setup: &Setup) -> Self {
        let config = machine::config(&setup.config, &setup.board);
        let faults: Faults = match setup.faults.as_str() {
            "" => Faults::default(),
            text => text.parse().unwrap(),
        };
        let parts = machine::parts(&config);
        let printer =
            VirtualPrinter::new(setup.board.clone(), &parts, &faults, setup.seed, Pulses::default()).unwrap();
        let session = Session::new(config, HOST_START);
        Self {
            start: printer.start(),
            ticks_per_s: f64::from(setup.board.clock.0) * (1.0 + CRYSTAL_ERROR),
            printer,
            session,
            events: Vec::new(),
            file: VecDeque::new(),
            file_ended: false,
            feed_max: usize::MAX,
            fed: 0,
            stalled: false,
            is_line_stuck: false,
            to_board: Vec::new(),
            to_host: Vec::new(),
            journal: String::new(),
        }
    }

    /// The host's time.
    pub(crate) fn now(&self) -> Seconds {
        let ticks = self.printer.now().saturating_sub(self.start).0 as f64;
        Seconds(HOST_START.0 + ticks / self.ticks_per_s)
    }

    /// Seconds since power-up.
    pub(crate) fn age(&self) -> f64 {
        (self.now() - HOST_START).0
    }

    fn ticks_at(&self, time: Seconds) -> Ticks {
        Ticks(self.start.0 + ((time - HOST_START).0 * self.ticks_per_s).ceil().max(0.0) as u64)
    }

    /// Another session takes the place of this one, with a machine file of its own: the first host is gone.
    pub(crate) fn replace_session(&mut self, config: &str) {
        let board = self.printer.profile().clone();
        self.session = Session::new(machine::config(config, &board), self.now());
        self.events.clear();
    }

    /// Lets this many seconds pass.
    pub(crate) fn run(&mut self, seconds: f64) {
        let until = self.now() + Seconds(seconds);
        while self.now() < until {
            self.round(until);
        }
    }

    /// Lets time pass until something holds.
    #[track_caller]
    pub(crate) fn until(&mut self, what: &str, seconds_max: f64, mut holds: impl FnMut(&mut Self) -> bool) {
        let until = self.now() + Seconds(seconds_max);
        while !holds(self) {
            assert!(
                self.now() < until,
                "{what} did not come within {seconds_max} s; {:?} {:?}; last events: {:?}",
                self.session.phase(),
                self.session.job_status(),
                &self.remarkable()[self.remarkable().len().saturating_sub(6)..]
            );
            let next = until.min(self.now() + Seconds(0.02));
            self.round(next);
        }
    }

    fn round(&mut self, until: Seconds) {
        let wake = if self.stalled { until } else { self.attend() };
        let earliest = self.now() + WAKE_MIN;
        let wake = self.ticks_at(wake.min(until).max(earliest));
        self.printer.run_until(wake, &mut self.to_host);
        if !self.stalled && !self.to_host.is_empty() {
            let now = self.now();
            self.session.receive(&self.to_host, now);
            self.to_host.clear();
        }
        self.take_events();
    }

    /// Calls the session until it has nothing more to do now.
    fn attend(&mut self) -> Seconds {
        loop {
            let now = self.now();
            let wake = self.session.poll(now, &mut self.to_board);
            self.journal += &self.session.take_journal();
            if !self.is_line_stuck {
                self.printer.write(&self.to_board);
                self.to_board.clear();
            }
            self.take_events();
            if !self.feed() {
                return wake;
            }
        }
    }

    fn take_events(&mut self) {
        self.events.extend(self.session.take_events());
        assert!(self.events.len() < LOG_MAX, "far too many events");
    }

    fn feed(&mut self) -> bool {
        let wants = self.session.job_wants();
        let wants = wants.min(self.feed_max - self.fed);
        if wants == 0 {
            return false;
        }
        if self.file.is_empty() {
            let ends = !std::mem::replace(&mut self.file_ended, true);
            if ends {
                self.session.job_end();
            }
            return ends;
        }
        // Small pieces, so that lines are cut everywhere.
        let piece: Vec<u8> = self.file.drain(..self.file.len().min(wants).min(100)).collect();
        self.session.job_feed(&piece);
        self.fed += piece.len();
        true
    }

    #[track_caller]
    pub(crate) fn connect(&mut self) {
        self.until("ready", 12.0, |bench| bench.session.phase() == PhaseName::Ready);
    }

    pub(crate) fn request(&mut self, request: Request) -> Result<(), PrinterError> {
        let now = self.now();
        let result = self.session.request(request, now);
        self.take_events();
        result
    }

    #[track_caller]
    pub(crate) fn ask(&mut self, request: Request) {
        self.request(request).unwrap();
    }

    /// Types G-code and waits until it has been carried out.
    #[track_caller]
    pub(crate) fn gcode(&mut self, text: &str) {
        self.ask(Request::Gcode(text.to_owned()));
        self.settle();
    }

    /// Waits until nothing moves any more, for a second.
    #[track_caller]
    pub(crate) fn settle(&mut self) {
        let mut quiet_since = (self.printer.recorder().0.len(), self.now());
        self.until("rest", 200.0, |bench| {
            let pulses = bench.printer.recorder().0.len();
            if pulses != quiet_since.0 {
                quiet_since = (pulses, bench.now());
            }
            bench.now() - quiet_since.1 > Seconds(1.5)
        });
    }

    #[track_caller]
    pub(crate) fn home(&mut self) {
        self.gcode("G28");
        let position = self.session.position();
        assert!(position.is_some_and(|(_, homed)| homed == [true; 3]), "{:?}", self.remarkable());
    }

    /// The file that is fed to the job, from its beginning.
    pub(crate) fn load(&mut self, file: &str) {
        self.file = file.bytes().collect();
        self.file_ended = false;
        self.fed = 0;
    }

    pub(crate) fn start_with(&mut self, file: &str, options: JobOptions) -> Result<(), PrinterError> {
        self.load(file);
        let now = self.now();
        self.session.start_job(options, now)
    }

    #[track_caller]
    pub(crate) fn start(&mut self, file: &str) {
        self.start_with(file, JobOptions::default()).unwrap();
    }

    /// Prints a file to its end, whatever that is.
    #[track_caller]
    pub(crate) fn print(&mut self, file: &str) {
        self.start(file);
        self.job_over();
    }

    #[track_caller]
    pub(crate) fn job_over(&mut self) {
        self.until("the end of the job", 600.0, |bench| bench.session.job_status() == JobStatus::None);
    }

    #[track_caller]
    pub(crate) fn job_done(&mut self) {
        self.job_over();
        assert!(self.events.contains(&Event::JobDone), "{:?}", self.errors());
        assert_eq!(self.errors(), []);
    }

    /// Waits until the job is at this line, as progress tells.
    #[track_caller]
    pub(crate) fn line(&mut self, wanted: u32) {
        self.until("the line", 600.0, |bench| {
            bench.events.iter().any(|event| matches!(event, Event::Progress { line, .. } if *line >= wanted))
        });
    }

    pub(crate) fn errors(&self) -> Vec<PrinterError> {
        let error = |event: &Event| match event {
            Event::Error(error) => Some(error.clone()),
            _ => None,
        };
        self.events.iter().filter_map(error).collect()
    }

    /// The one error that there was.
    #[track_caller]
    pub(crate) fn error(&self) -> PrinterError {
        let errors = self.errors();
        assert_eq!(errors.len(), 1, "{errors:#?}");
        errors[0].clone()
    }

    /// The one error had this code and came from this line.
    #[track_caller]
    pub(crate) fn failed(&self, code: ErrorCode, line: Option<u32>) {
        let error = self.error();
        assert_eq!((error.code, error.line), (code, line), "{error}");
    }

    /// Events without those that come in masses.
    pub(crate) fn remarkable(&self) -> Vec<&Event> {
        let bulk = |event: &&Event| {
            !matches!(event, Event::Temperature { .. } | Event::Move(_) | Event::Progress { .. })
        };
        self.events.iter().filter(bulk).collect()
    }

    pub(crate) fn state(&mut self) -> State {
        self.printer.state()
    }

    pub(crate) fn pulses(&self) -> &[Pulse] {
        &self.printer.recorder().0
    }

    /// Pulses from the first one, with times from there. Those of one tick, of different motors, have no order.
    pub(crate) fn relative_pulses(&self, from: usize) -> Vec<Pulse> {
        let pulses = &self.pulses()[from..];
        let first = pulses.first().map_or(0, |pulse| pulse.0);
        let mut pulses: Vec<Pulse> =
            pulses.iter().map(|&(at, motor, forward)| (at - first, motor, forward)).collect();
        pulses.sort_unstable();
        pulses
    }

    /// Forward less backward pulses of each motor.
    pub(crate) fn counts(&mut self) -> Vec<i64> {
        self.state().motors.iter().map(|motor| motor.count.0).collect()
    }

    /// No pulse, no heat, no fan, no lost step from now on, for longer than the board's own watch over its heaters.
    #[track_caller]
    pub(crate) fn assert_safe(&mut self) {
        self.run(1.2);
        let (pulses, before) = (self.pulses().len(), self.state());
        let mut heated = false;
        for _ in 0..400 {
            self.run(0.01);
            heated |= self.state().heaters.iter().any(|heater| heater.duty > 0.0);
        }
        let after = self.state();
        assert_eq!(self.pulses().len(), pulses, "motors move");
        assert!(!heated, "a heater is on");
        for (before, after) in before.motors.iter().zip(&after.motors) {
            assert!((before.rotor - after.rotor).abs() < 0.5, "{} moves", after.name);
        }
    }

    /// As [`Self::assert_safe`], and the fan is off.
    #[track_caller]
    pub(crate) fn assert_all_off(&mut self) {
        self.assert_safe();
        assert_eq!(self.state().fans[0].duty, 0.0, "the fan is on");
    }

    /// Each axis is where the session says, as the load stands and as its pulses count.
    #[track_caller]
    pub(crate) fn assert_position(&mut self, x: f64, y: f64, z: f64) {
        let (claimed, homed) = self.session.position().unwrap();
        assert_eq!(homed, [true; 3]);
        let state = self.state();
        for (axis, wanted) in [x, y, z].into_iter().enumerate() {
            assert!((claimed[axis] - wanted).abs() < 1e-6, "{axis}: {} is claimed", claimed[axis]);
            let motor = &state.motors[axis];
            // The switch bounces and the approach has its speed: a few steps.
            assert!((motor.position.0 - wanted).abs() < 0.1, "{}: at {}", motor.name, motor.position.0);
            assert_eq!(motor.lost.0, 0, "{}", motor.name);
        }
    }

    /// The latest reading of a heater, 0 the nozzle, 1 the bed.
    pub(crate) fn celsius(&mut self, heater: usize) -> f64 {
        self.state().heaters[heater].sensor.0
    }
}
