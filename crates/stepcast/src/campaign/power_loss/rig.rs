//! A host, a board and a machine, and a user who does what the page would have one do: a print, whose power may go, and
//! which is gone on with.
//!
//! Knows no judgement. Host time in s, the board's time in ticks.

use std::{collections::BTreeMap, sync::Arc};

use anyhow::Context;
use printer::{
    config::PrinterConfig,
    error::PrinterError,
    interruption::{Interruption, Survey},
    journal::Journal,
    session::{Event, JobOptions, JobStatus, PhaseName, Request, Session},
};
use units::{Celsius, Mm, MmPerS, Seconds, Ticks};
use virtual_printer::{BoardProfile, Failure, FailureKind, Faults, VirtualPrinter};

use super::{
    Loss,
    trace::{Doing, Sample, Trace},
};
use crate::simulate::HostClock;

/// The session is called again after this time at the earliest.
const WAKE_MIN: Seconds = Seconds(50e-6);
/// Anything takes no longer than this.
const TIME_MAX: Seconds = Seconds(3600.0);
/// The heater of the nozzle.
const NOZZLE: &str = "extruder";
/// Z.
const Z: usize = 2;
/// To measure Z, the user first has it go up by this much: then its motor has current.
const LIFT: Mm = Mm(1.0);
const LIFT_SPEED: MmPerS = MmPerS(5.0);
/// Waiting is looked after this often.
const LOOK: Seconds = Seconds(0.05);

/// See the module.
pub(super) struct Rig {
    config: PrinterConfig,
    pub(super) printer: VirtualPrinter<Trace>,
    session: Session,
    clock: HostClock,
    gcode: Arc<[u8]>,
    fed: usize,
    has_ended: bool,
    pub(super) journal: String,
    /// The power goes then …
    loses: Option<Seconds>,
    /// … and the host with it.
    host_dies: Option<Ticks>,
    is_done: bool,
    error: Option<PrinterError>,
    to_host: Vec<u8>,
    /// The coldest nozzle that filament was pushed through.
    pub(super) coldest: Celsius,
}

/// How a print was gone on with.
pub(super) struct GoneOn {
    pub(super) found: Interruption,
    /// How far off the claimed height is, where the user has measured.
    pub(super) z_error_mm: Option<f64>,
    /// Something moved, or was warm, before the user said yes.
    pub(super) broken: Vec<String>,
}

impl Rig {
    /// Powers a machine up whose power goes then, if it does.
    pub(super) fn new(
        mut config: PrinterConfig,
        board: &BoardProfile,
        gcode: Arc<[u8]>,
        loss: Option<&Loss>,
        seed: u64,
    ) -> anyhow::Result<Self> {
        let board = demo_machine::fit(&mut config, Some(board))?;
        let mut machine = demo_machine::machine(&config)?;
        let mut faults = Faults::default();
        if let Some(loss) = loss {
            faults.failures.push(Failure { at: loss.at, kind: FailureKind::PowerLoss });
            faults.failures.push(Failure { at: loss.at + loss.lasts, kind: FailureKind::PowerReturn });
            machine.motors[Z].sag = loss.sag;
            machine.motors[Z].mechanics.detent_nm = loss.detent_nm;
        }
        let step_mm = core::array::from_fn(|axis| machine.motors[axis].step_distance.0);
        let start_mm = core::array::from_fn(|axis| machine.motors[axis].start.0);
        let (hz, dies) = (board.clock, loss.filter(|loss| loss.host_dies));
        let trace = Trace::new(step_mm, start_mm);
        let printer = VirtualPrinter::new(board, &machine, &faults, seed, trace)?;
        let clock = HostClock::new(printer.start(), hz);
        Ok(Self {
            session: Session::new(config.clone(), clock.at(printer.now())),
            config,
            clock,
            gcode,
            fed: 0,
            has_ended: false,
            journal: String::new(),
            loses: loss.map(|loss| loss.at),
            host_dies: dies.map(|loss| printer.start() + hz.ticks_in(loss.at)),
            is_done: false,
            error: None,
            to_host: Vec::new(),
            coldest: Celsius(f64::INFINITY),
            printer,
        })
    }

    fn now(&self) -> Seconds {
        self.clock.at(self.printer.now())
    }

    /// Seconds since power-up.
    pub(super) fn age(&self) -> Seconds {
        self.printer.profile().clock.duration_of(self.printer.now() - self.printer.start())
    }

    /// Lets time pass until something holds.
    fn until(&mut self, what: &str, mut holds: impl FnMut(&mut Self) -> bool) -> anyhow::Result<()> {
        let until = self.now() + TIME_MAX;
        while !holds(self) {
            if let Some(error) = &self.error {
                anyhow::bail!("{what} did not come: {error}");
            }
            anyhow::ensure!(self.now() < until, "{what} did not come within {} s", TIME_MAX.0);
            self.round(self.now() + LOOK);
        }
        Ok(())
    }

    /// Lets time pass.
    fn wait(&mut self, time: Seconds) {
        let until = self.now() + time;
        while self.now() < until {
            self.round(until.min(self.now() + LOOK));
        }
    }

    fn round(&mut self, until: Seconds) {
        let lives = self.host_dies.is_none_or(|dies| self.printer.now() < dies);
        let wake = if lives { self.attend() } else { until };
        let wake = self.clock.ticks_at(wake.min(until).max(self.now() + WAKE_MIN));
        let pushes = self.printer.recorder().pushes;
        self.printer.run_until(wake, &mut self.to_host);
        if self.printer.recorder().pushes > pushes {
            let nozzle = self.printer.state().heaters.into_iter().find(|heater| heater.name == NOZZLE);
            self.coldest = nozzle.map_or(self.coldest, |nozzle| self.coldest.min(nozzle.temperature));
        }
        if lives && !self.to_host.is_empty() {
            let now = self.now();
            self.session.receive(&self.to_host, now);
        }
        self.to_host.clear();
        self.take_events();
    }

    fn attend(&mut self) -> Seconds {
        let mut bytes = Vec::new();
        loop {
            let wake = self.session.poll(self.now(), &mut bytes);
            self.journal += &self.session.take_journal();
            self.printer.write(&bytes);
            bytes.clear();
            self.take_events();
            if !self.feed() {
                return wake;
            }
        }
    }

    fn feed(&mut self) -> bool {
        let wants = self.session.job_wants().min(self.gcode.len() - self.fed);
        if wants > 0 {
            self.session.job_feed(&self.gcode[self.fed..self.fed + wants]);
            self.fed += wants;
        } else if self.fed == self.gcode.len() && self.session.job_wants() > 0 && !self.has_ended {
            self.session.job_end();
            self.has_ended = true;
        } else {
            return false;
        }
        true
    }

    fn take_events(&mut self) {
        for event in self.session.take_events() {
            match event {
                Event::Move(mv) => {
                    let now = self.printer.motion_now();
                    self.printer.recorder_mut().expect(&mv, |at| now.nearest(at.low()));
                }
                Event::JobDone => self.is_done = true,
                Event::Error(error) => {
                    self.error.get_or_insert(error);
                }
                _ => {}
            }
        }
    }

    fn ask(&mut self, request: Request) -> anyhow::Result<()> {
        let now = self.now();
        self.session.request(request, now)?;
        self.take_events();
        Ok(())
    }

    fn start(&mut self, options: JobOptions) -> anyhow::Result<()> {
        (self.fed, self.has_ended, self.is_done) = (0, false, false);
        let now = self.now();
        self.session.start_job(options, now)?;
        Ok(())
    }

    /// Prints the file from its beginning, to its end or until the power goes.
    pub(super) fn print(&mut self) -> anyhow::Result<()> {
        self.until("the board", |rig| rig.session.phase() == PhaseName::Ready)?;
        self.start(JobOptions { confirm_all: true, journal: Some(1), ..JobOptions::default() })?;
        self.until("the end of the print", |rig| {
            let is_gone = rig.host_dies.is_some_and(|dies| rig.printer.now() >= dies);
            let is_lost = rig.error.is_some() && rig.loses.is_some_and(|at| rig.age() >= at);
            rig.is_done || is_gone || is_lost
        })
    }

    /// The steps of filament that each line was given so far; then that begins anew. To be asked for before the way.
    pub(super) fn filament(&mut self) -> BTreeMap<u32, i64> {
        self.printer.recorder_mut().take_filament()
    }

    /// What was done so far; then that begins anew.
    pub(super) fn way(&mut self) -> Vec<(Sample, Doing)> {
        self.printer.recorder_mut().take()
    }

    /// Whether nothing is warm or moves that should not be.
    fn is_quiet(&mut self, pulses: u64) -> bool {
        let state = self.printer.state();
        state.heaters.iter().all(|heater| heater.duty == 0.0) && self.printer.recorder().pulses == pulses
    }

    /// The power is back after a while, and the user has another host go on with the print.
    pub(super) fn go_on(&mut self, loss: &Loss) -> anyhow::Result<Option<GoneOn>> {
        if self.is_done {
            return Ok(None);
        }
        let mut broken = Vec::new();
        let pulses = self.printer.recorder().pulses;
        let back = loss.at + loss.lasts;
        while self.age() < back + loss.user_comes {
            let until = self.now() + LOOK;
            // The first host sees that it has lost the board, and does nothing more.
            self.round(until);
        }
        self.host_dies = None;
        self.session = Session::new(self.config.clone(), self.now());
        self.connect()?;
        self.wait(Seconds(1.0));
        if !self.is_quiet(pulses) {
            broken.push("something moves or is warm before the user has said anything".to_owned());
        }
        let found = self.survey()?;
        let lines = self.gcode.split(|&byte| byte == b'\n').count();
        if found.start_line as usize > lines || found.start_line <= 1 {
            // There is nothing left of it, or nothing has been made.
            return Ok(None);
        }
        self.start(JobOptions {
            confirm_all: true,
            journal: Some(2),
            start_line: Some(found.start_line),
            transform: Some(found.transform.clone()),
            ..JobOptions::default()
        })?;
        self.until("the line", |rig| rig.session.job_status() == JobStatus::Paused)?;
        self.wait(Seconds(1.0));
        if !self.is_quiet(pulses) {
            broken.push("something moves or is warm before the user has said yes".to_owned());
        }
        let z_error_mm = self.claim_height(&found, loss)?.then(|| self.height_error());
        self.ask(Request::Resume)?;
        self.until("the end of the print", |rig| rig.is_done)?;
        self.wait(Seconds(2.0));
        Ok(Some(GoneOn { found, z_error_mm, broken }))
    }

    /// The user connects, and has a board start anew that the first host has stopped in parting.
    fn connect(&mut self) -> anyhow::Result<()> {
        let until = self.now() + TIME_MAX;
        loop {
            match self.session.phase() {
                PhaseName::Ready => break,
                PhaseName::Shutdown => self.ask(Request::FirmwareRestart)?,
                _ => {}
            }
            anyhow::ensure!(self.now() < until, "the board does not come back: {:?}", self.error);
            self.round(self.now() + LOOK);
        }
        self.error = None;
        Ok(())
    }

    fn survey(&self) -> anyhow::Result<Interruption> {
        let journal = Journal::read(self.journal.as_bytes())?;
        let mut survey = Survey::new(&self.config, journal)?;
        let mut rest = &self.gcode[..];
        while !rest.is_empty() && survey.wants() > 0 {
            let (piece, tail) = rest.split_at(rest.len().min(survey.wants()));
            survey.feed(piece);
            rest = tail;
            while survey.advance()? {}
        }
        survey.end();
        while survey.advance()? {}
        survey.report().context("the survey has no result")
    }

    /// The user says where Z stands: what was computed where that is certain, and else what is measured, of which the nearest
    /// place that is possible is taken. Whether it was measured.
    fn claim_height(&mut self, found: &Interruption, loss: &Loss) -> anyhow::Result<bool> {
        let places = &found.standings.places;
        let middle = found.z_range.map_or(Mm(0.0), |[low, high]| (low + high) * 0.5);
        let likeliest = places.first().copied().unwrap_or(middle);
        let claim = |position: Mm| Request::SetPosition { axis: Z, position: position + loss.claim_off };
        self.ask(claim(likeliest))?;
        if places.len() == 1 && loss.sag.0 == 0.0 {
            return Ok(false);
        }
        self.ask(Request::MoveBy { axis: Z, distance: LIFT, speed: LIFT_SPEED })?;
        self.wait(LOOK);
        self.until("rest", |rig| rig.session.motion_queued(rig.now()).is_none())?;
        self.wait(Seconds(2.0));
        let measured = Mm(self.printer.state().motors[Z].position.0) + loss.measured_off;
        let place = places.first().map_or(measured, |first| {
            let pitch = found.standings.pitch.0;
            Mm(first.0 + LIFT.0 + ((measured - *first - LIFT).0 / pitch).round() * pitch)
        });
        self.ask(claim(place))?;
        Ok(true)
    }

    /// How far Z's load is from where the session has it, once its motor has current.
    fn height_error(&mut self) -> f64 {
        let claimed = self.session.position().map_or(0.0, |(position, _)| position[Z]);
        self.printer.state().motors[Z].position.0 - claimed
    }

    /// Steps that each motor has lost since the power came back.
    pub(super) fn lost_steps(&mut self) -> Vec<(String, u64)> {
        let state = self.printer.state();
        state.motors.into_iter().map(|motor| (motor.name, motor.lost.0.unsigned_abs())).collect()
    }

    /// Whether all heaters are off.
    pub(super) fn is_cold(&mut self) -> bool {
        self.printer.state().heaters.iter().all(|heater| heater.duty == 0.0)
    }
}
