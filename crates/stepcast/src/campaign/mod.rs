//! `stepcast campaign`: many short prints on the virtual printer, each with a fault at a random moment, each compared
//! with the same print without.
//!
//! A run takes a window of a file, prints it clean, and then once with each scenario's fault. All of it follows from the
//! run's seed, so that one that fails can be had alone.

mod chance;
mod judge;
mod power_loss;
mod report;
mod scenario;
mod window;

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt::Write as _,
    fs,
    path::PathBuf,
    process::ExitCode,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicU32, Ordering},
    },
    thread,
};

use anyhow::Context;
use clap::ValueEnum;
use printer::{
    config::{Kinematics, PrinterConfig},
    session::JobOptions,
};
use units::{MmPerS2, Seconds};
use virtual_printer::BoardProfile;

pub(crate) use self::{chance::Chance, scenario::Scenario};
use self::{
    judge::{Finding, Print, judge},
    report::{Broken, Class},
    scenario::{Case, Times},
    window::{Source, Window},
};
use crate::{
    cli::CampaignArgs,
    config_file,
    console::{self, Progress},
    input::Input,
    simulate::{Outcome, Setup, Simulation, Successor},
};

/// The files that windows are taken from where none is given.
const SAMPLES: [(&str, &str); 2] = [
    ("test-part.gcode", include_str!("../../../../samples/test-part.gcode")),
    ("test-part-small.gcode", include_str!("../../../../samples/test-part-small.gcode")),
];
/// The largest file that windows are taken from, in bytes.
const FILE_BYTES_MAX: u64 = 256 << 20;
/// The part of the prints that is generated.
const FAST_PART: f64 = 0.4;
/// Heaters of the campaign's machine are kept at stand-by for so long: both what comes before and after happens in it.
const STANDBY: Seconds = Seconds(10.0);
/// The machine is watched for so long after its host is gone: until it is at stand-by, and that is over.
const WATCHED: Seconds = Seconds(18.0);
/// The longest window with the longest fault takes less than half of this.
const TIME_MAX: Seconds = Seconds(3600.0);
/// The number of the print in its journal.
const JOURNAL: u32 = 1;
/// After a clean print there is nothing to be seen.
const WATCHED_CLEAN: Seconds = Seconds(0.5);
/// Streams of chance: what is printed, and what goes wrong in the scenario of each number from here on.
const WINDOW_STREAM: u64 = 1;
const SCENARIO_STREAM: u64 = 100;

/// What all runs have in common.
struct Campaign {
    config: PrinterConfig,
    /// Where generated prints move, X and Y.
    fast_range: [f64; 2],
    sources: Vec<Source>,
    scenarios: Vec<Scenario>,
    save: Option<PathBuf>,
}

/// Runs the command.
pub(crate) fn run(args: &CampaignArgs) -> anyhow::Result<ExitCode> {
    let campaign = Campaign::new(args)?;
    let progress = Progress::new("campaign", u64::from(args.runs));
    let classes: BTreeMap<Scenario, Class> =
        campaign.scenarios.iter().map(|&scenario| (scenario, Class::new(scenario))).collect();
    let classes = Mutex::new(classes);
    let failure = Mutex::new(None);
    let next = AtomicU32::new(0);
    let work = || {
        loop {
            let run = next.fetch_add(1, Ordering::Relaxed);
            if run >= args.runs || lock(&failure).is_some() {
                return;
            }
            let seed = args.seed.wrapping_add(u64::from(run));
            if let Err(error) = campaign.run(seed, &classes) {
                lock(&failure).get_or_insert(error.context(format!("the run with the seed {seed}")));
            }
            progress.set(u64::from(run));
        }
    };
    thread::scope(|scope| {
        for _ in 1..args.jobs {
            scope.spawn(work);
        }
        work();
    });
    if let Some(error) = lock(&failure).take() {
        return Err(error);
    }
    let mut classes: Vec<Class> = std::mem::take(&mut *lock(&classes)).into_values().collect();
    classes.iter_mut().for_each(Class::sort);
    if args.json {
        console::print_json(&classes)?;
    } else {
        console::print(&report::text(&classes));
    }
    Ok(if classes.iter().all(Class::is_kept) { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Campaign {
    fn new(args: &CampaignArgs) -> anyhow::Result<Self> {
        let mut config = if let Some(path) = &args.config {
            config_file::load(path)?
        } else {
            let (config, _) = printer::config::parse(demo_machine::USUAL_MACHINE);
            config.context("the usual machine's file is damaged")?
        };
        config.printer.standby_time = STANDBY;
        let mut sources = Vec::new();
        for path in &args.files {
            let mut input = Input::open(path)?;
            anyhow::ensure!(input.size() <= FILE_BYTES_MAX, "{} is too large for a campaign", path.display());
            let mut bytes = Vec::new();
            while let chunk = input.next_chunk()?
                && !chunk.is_empty()
            {
                bytes.extend_from_slice(chunk);
                anyhow::ensure!(
                    bytes.len() as u64 <= FILE_BYTES_MAX,
                    "{} unpacks to too much",
                    path.display()
                );
            }
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let source = Source::new(&name, &String::from_utf8_lossy(&bytes));
            sources.push(source.with_context(|| format!("nothing is printed in {}", path.display()))?);
        }
        if sources.is_empty() {
            sources.extend(SAMPLES.iter().filter_map(|(name, text)| Source::new(name, text)));
        }
        let wanted: BTreeSet<Scenario> = args.scenarios.iter().copied().collect();
        let is_cartesian = config.printer.kinematics == Kinematics::Cartesian;
        anyhow::ensure!(
            is_cartesian || !wanted.contains(&Scenario::PowerLoss),
            "power_loss: where a nozzle was when the power went is only followed on cartesian machines"
        );
        let all = Scenario::value_variants().iter().copied();
        let may = |scenario: &Scenario| is_cartesian || *scenario != Scenario::PowerLoss;
        let scenarios =
            all.filter(|it| if wanted.is_empty() { may(it) } else { wanted.contains(it) }).collect();
        let fast_range = window::fast_range(&config);
        Ok(Self { config, fast_range, sources, scenarios, save: args.save.clone() })
    }

    /// One window, clean and with each scenario's fault.
    fn run(&self, seed: u64, classes: &Mutex<BTreeMap<Scenario, Class>>) -> anyhow::Result<()> {
        let mut chance = Chance::new(seed, WINDOW_STREAM);
        let window = if chance.part() < FAST_PART {
            window::fast(&mut chance, self.fast_range)
        } else {
            chance.pick(&self.sources).window(&mut chance)
        };
        let mut clean: Vec<(BoardProfile, Print)> = Vec::new();
        for &scenario in &self.scenarios {
            let mut chance = Chance::new(seed, SCENARIO_STREAM + scenario as u64);
            let board = scenario.board(&mut chance);
            if scenario == Scenario::PowerLoss {
                self.lose_power(seed, &board, &mut chance, classes)?;
                continue;
            }
            if clean.iter().all(|(known, _)| *known != board) {
                clean.push((board.clone(), self.clean(&window, &board, seed)?));
            }
            let Some((_, clean)) = clean.iter().find(|(known, _)| *known == board) else { continue };
            let times = times(clean, &board);
            let case = scenario.case(board, times, &mut chance);
            let print = self.print(&window, &case, seed, WATCHED)?;
            let finding = judge(&case, clean, &print, STANDBY);
            self.save(seed, &window, &finding)?;
            if let Some(class) = lock(classes).get_mut(&scenario) {
                class.add(&finding, |what| Broken {
                    seed,
                    board: board_name(&case.board),
                    window: window.name.clone(),
                    faults: faults_text(&case),
                    what,
                });
            }
        }
        Ok(())
    }

    /// A window of a file, since a part is to be seen, that loses its power.
    fn lose_power(
        &self,
        seed: u64,
        board: &BoardProfile,
        chance: &mut Chance,
        classes: &Mutex<BTreeMap<Scenario, Class>>,
    ) -> anyhow::Result<()> {
        let window = chance.pick(&self.sources).window(chance);
        let power_loss::Judged { finding, about } =
            power_loss::run(&self.config, &window, board, seed, chance)?;
        self.save(seed, &window, &finding)?;
        if let Some(class) = lock(classes).get_mut(&Scenario::PowerLoss) {
            class.add(&finding, |what| Broken {
                seed,
                board: board_name(board),
                window: window.name.clone(),
                faults: about,
                what,
            });
        }
        Ok(())
    }

    /// Keeps what broke a promise, where that is wanted.
    fn save(&self, seed: u64, window: &Window, finding: &Finding) -> anyhow::Result<()> {
        let Some(folder) = self.save.as_ref().filter(|_| !finding.broken.is_empty()) else { return Ok(()) };
        let path = folder.join(format!("{seed}.gcode"));
        fs::write(&path, &window.gcode).with_context(|| format!("cannot write {}", path.display()))
    }

    /// The print without a fault, which has to be sound for anything to be learned from it.
    fn clean(&self, window: &Window, board: &BoardProfile, seed: u64) -> anyhow::Result<Print> {
        let case = Case::clean(board.clone());
        let print = self.print(window, &case, seed, WATCHED_CLEAN)?;
        if print.report.result != Outcome::Done {
            let reason = print.report.reason.as_deref().unwrap_or("no reason");
            anyhow::bail!("{} fails without any fault on {}: {reason}", window.name, board_name(board));
        }
        Ok(print)
    }

    fn print(&self, window: &Window, case: &Case, seed: u64, watched: Seconds) -> anyhow::Result<Print> {
        let mut config = self.config.clone();
        if window.fast {
            config.printer.max_accel = MmPerS2(config.printer.max_accel.0.max(window::FAST_ACCEL_MM_S2));
        }
        let setup = Setup {
            config,
            board: Some(case.board.clone()),
            faults: case.faults.clone(),
            seed,
            options: JobOptions { confirm_all: true, journal: Some(JOURNAL), ..JobOptions::default() },
            consent_after: case.consent_after,
            host_dies: case.host_dies,
            successor: case.successor.map(|(after, journal_part)| Successor {
                after,
                job: Input::memory(&window.name, window.gcode.clone()),
                journal_part,
            }),
            watched,
            time_max: Some(TIME_MAX),
            quiet: true,
        };
        let input = || Input::memory(&window.name, window.gcode.clone());
        let mut simulation = Simulation::new(setup, input(), input())?;
        simulation.run()?;
        let aftermath = simulation.aftermath();
        Ok(Print { report: simulation.into_report(), aftermath })
    }
}

fn times(clean: &Print, board: &BoardProfile) -> Times {
    let since = |at: units::Ticks| board.clock.duration_of(at.saturating_sub(clean.aftermath.start));
    let ended = since(clean.aftermath.ended);
    Times { began: clean.aftermath.began.map_or(ended, since), ended }
}

fn board_name(board: &BoardProfile) -> String {
    format!("{}{}", board.name, if board.motion_clock { "" } else { "-plain" })
}

/// A fault as `stepcast simulate --fault` takes it, and what it knows no word for.
fn faults_text(case: &Case) -> String {
    let mut text = String::new();
    let bytes = case.faults.bytes;
    let named = [
        ("corrupt", bytes.corrupt),
        ("flip", bytes.flip),
        ("drop", bytes.drop),
        ("duplicate", bytes.duplicate),
        ("delay", bytes.delay),
    ];
    for (name, share) in named.into_iter().filter(|(_, share)| *share > 0.0) {
        let _ = write!(text, "{name}={share:.5} ");
    }
    for failure in &case.faults.failures {
        let _ = write!(text, "{:?}@{:.4} ", failure.kind, failure.at.0);
    }
    for stall in &case.faults.host_stalls {
        let _ = write!(text, "host-stall={:.4}@{:.4} ", stall.lasts.0, stall.at.0);
    }
    for pause in &case.faults.pauses {
        let _ = write!(text, "pause={:.4}@{:.4} ", pause.lasts.0, pause.at.0);
    }
    if let Some(at) = case.host_dies {
        let _ = write!(text, "the host dies@{:.4} ", at.0);
    }
    if let Some((after, part)) = case.successor {
        let _ = write!(text, "another comes {:.4} s later with {part:.4} of the journal ", after.0);
    }
    text.trim_end().to_owned()
}
