//! The command line: what can be asked, and what it is called.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use virtual_printer::{BoardProfile, FAULT_ITEMS, Faults};

use crate::campaign::Scenario;

/// Checks, plans and simulates G-code for a printer, and serves a virtual one.
#[derive(Debug, Parser)]
#[command(
    name = "stepcast",
    version,
    arg_required_else_help = true,
    after_help = "Exit status: 0 done, 1 the job failed (why is on stderr), 2 wrong usage."
)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: CommandLine,
}

#[derive(Debug, Subcommand)]
pub(crate) enum CommandLine {
    /// Read a G-code file and say by line what is wrong with it
    Check(CheckArgs),
    /// Plan a G-code file for a machine: print time, steps, bytes
    Plan(PlanArgs),
    /// Print a G-code file on the virtual printer, in virtual time, and measure what its pulses draw
    Simulate(SimulateArgs),
    /// Let things go wrong at random moments of many short prints, and check that every promise is kept
    Campaign(CampaignArgs),
    /// Hold plans by the motors' torque against the best constant acceleration, on simulated motors of a heavy machine
    Torque(TorqueArgs),
    /// Serve the virtual printer on a pseudo-terminal, in real time
    VirtualPrinter(VirtualPrinterArgs),
    /// Write a completion script for a shell to stdout
    Completions {
        /// Which shell
        shell: clap_complete::Shell,
    },
}

#[derive(Args, Debug)]
pub(crate) struct CheckArgs {
    /// The G-code, plain or gzip
    pub(crate) file: PathBuf,
    /// The machine, so that its limits are checked too
    #[arg(long, value_name = "PRINTER.CFG")]
    pub(crate) config: Option<PathBuf>,
    /// Write the result as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct PlanArgs {
    /// The G-code, plain or gzip
    pub(crate) file: PathBuf,
    /// The machine
    #[arg(long, value_name = "PRINTER.CFG")]
    pub(crate) config: PathBuf,
    /// Write the result as JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// Multiply every feed of the file by this
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = factor)]
    pub(crate) feed_scale: f64,
    /// Work out the least time that the same moves could take under the same limits, on a fine grid
    #[arg(long)]
    pub(crate) bound: bool,
    /// How speed goes up and down, where not as the machine file says
    #[arg(long, value_enum)]
    pub(crate) profile: Option<Profile>,
    /// With `--profile jerk`: the jerk in mm/s³, instead of the machine file's max_jerk
    #[arg(long, value_name = "MM/S3", value_parser = jerk, requires = "profile")]
    pub(crate) max_jerk: Option<f64>,
    /// Plan with this minimum_cruise_ratio instead of the machine's
    #[arg(long, value_name = "RATIO", value_parser = ratio)]
    pub(crate) minimum_cruise_ratio: Option<f64>,
    /// How early or late a step may come, in µs (and never more than a quarter of the gap to its neighbours); 25 is usual
    #[arg(long, value_name = "US", value_parser = step_error)]
    pub(crate) step_error_us: Option<f64>,
    /// How step commands are searched for, instead of as the machine file says
    #[arg(long, value_name = "SEARCH", value_enum)]
    pub(crate) step_search: Option<Search>,
    /// With `--json`: say what each layer takes, too
    #[arg(long, requires = "json")]
    pub(crate) layers: bool,
    /// Write position, speed and acceleration of each axis over time into this file (CSV), as the motors get them: behind
    /// pressure advance and input shapers
    #[arg(long, value_name = "FILE")]
    pub(crate) trace: Option<PathBuf>,
    /// How far apart the rows of `--trace` are, in ms
    #[arg(long, value_name = "MS", default_value_t = 1.0, value_parser = trace_step, requires = "trace")]
    pub(crate) trace_step_ms: f64,
    /// Write the blocks that would be sent to a board into this file
    #[arg(long, value_name = "FILE")]
    pub(crate) dump_stream: Option<PathBuf>,
}

#[derive(Args, Debug)]
pub(crate) struct TorqueArgs {
    /// How many machines, whose parts differ by up to 10 %
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) seeds: u32,
    /// The share of the torque that the plan asks for, instead of the machine file's default
    #[arg(long, value_name = "SHARE", value_parser = share)]
    pub(crate) torque_margin: Option<f64>,
    /// Write the result as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// How speed goes up and down along the path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Profile {
    /// At a constant acceleration
    Trapezoid,
    /// As the motors' torque allows, from the machine file's [motor_torque …]
    Torque,
    /// With a limited jerk
    Jerk,
}

/// How step commands are searched for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Search {
    /// Each by itself
    Usual,
    /// With a look at the next one: fewer bytes for more work
    Ahead,
}

/// The board that is simulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Board {
    /// Raspberry Pi RP2040 on USB
    Rp2040,
    /// STM32F103 on a UART, with little memory
    Stm32f103,
    /// The same RP2040 with plain Klipper firmware
    Rp2040Plain,
    /// The same STM32F103 with plain Klipper firmware
    Stm32f103Plain,
}

impl Board {
    /// The board's clock, pins, memory and link.
    pub(crate) fn profile(self) -> BoardProfile {
        match self {
            Self::Rp2040 => BoardProfile::rp2040(),
            Self::Stm32f103 => BoardProfile::stm32f103(),
            Self::Rp2040Plain => BoardProfile::rp2040().plain(),
            Self::Stm32f103Plain => BoardProfile::stm32f103().plain(),
        }
    }
}

/// What the simulated machine is like.
#[derive(Args, Debug)]
pub(crate) struct MachineArgs {
    /// The board; when left out, the one whose pins the machine file names
    #[arg(long, value_enum)]
    pub(crate) board: Option<Board>,
    /// What all chance follows from: the same seed gives the same run
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
    /// Something that goes wrong; may be given several times
    #[arg(long = "fault", value_name = "FAULT", long_help = fault_help())]
    pub(crate) faults: Vec<Faults>,
}

impl MachineArgs {
    /// All faults in one script.
    pub(crate) fn faults(&self) -> Faults {
        let mut all = Faults::default();
        for faults in &self.faults {
            all += faults.clone();
        }
        all
    }
}

fn fault_help() -> String {
    format!("Something that goes wrong; may be given several times. Known faults: {FAULT_ITEMS}")
}

#[derive(Args, Debug)]
pub(crate) struct SimulateArgs {
    /// The G-code, plain or gzip
    pub(crate) file: PathBuf,
    /// The machine
    #[arg(long, value_name = "PRINTER.CFG")]
    pub(crate) config: PathBuf,
    /// Write the result as JSON
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) machine: MachineArgs,
    /// Print although this line has a command that is not known; may be given several times
    #[arg(long = "confirm-line", value_name = "LINE")]
    pub(crate) confirm_lines: Vec<u32>,
    /// Print although lines have commands that are not known
    #[arg(long)]
    pub(crate) confirm_all: bool,
    /// Begin with this line, as if those before had been made
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), conflicts_with = "repeat")]
    pub(crate) start_line: Option<u32>,
    /// Begin with the first line of this layer; the lowest is 1
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), conflicts_with_all = ["start_line", "repeat"])]
    pub(crate) start_layer: Option<u32>,
    /// Print the file so many times, one after the other, as one print
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) repeat: u32,
    /// Resume a print that the board holds because its host was held up, as a user would; it ends there otherwise
    #[arg(long)]
    pub(crate) confirm_holds: bool,
}

#[derive(Args, Debug)]
pub(crate) struct CampaignArgs {
    /// How many prints of each scenario
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) runs: u32,
    /// What all chance follows from; run I of a campaign is the only one of a campaign with the seed S + I
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub(crate) seed: u64,
    /// What goes wrong; all scenarios when left out
    #[arg(long = "scenario", value_name = "NAME", value_enum, value_delimiter = ',')]
    pub(crate) scenarios: Vec<Scenario>,
    /// A G-code file of which windows are printed, besides generated ones; the two samples when left out. May be given
    /// several times
    #[arg(long = "file", value_name = "FILE")]
    pub(crate) files: Vec<PathBuf>,
    /// The machine; a usual one when left out
    #[arg(long, value_name = "PRINTER.CFG")]
    pub(crate) config: Option<PathBuf>,
    /// Write the result as JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// Write the G-code of prints that break a promise into this folder, by their seed
    #[arg(long, value_name = "FOLDER")]
    pub(crate) save: Option<PathBuf>,
    /// How many prints run at the same time
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    pub(crate) jobs: u16,
}

#[derive(Args, Debug)]
pub(crate) struct VirtualPrinterArgs {
    /// Where the terminal appears: a symbolic link, removed at the end
    #[arg(long, value_name = "PATH")]
    pub(crate) pty: PathBuf,
    /// How much faster than real time its clock runs
    #[arg(long, value_name = "FACTOR", default_value = "1", value_parser = speed)]
    pub(crate) speed: f64,
    /// The machine; a usual one when left out
    #[arg(long, value_name = "PRINTER.CFG")]
    pub(crate) config: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) machine: MachineArgs,
}

/// The slowest and fastest clock of a virtual printer that is served in real time.
const SPEED_RANGE: std::ops::RangeInclusive<f64> = 0.01..=200.0;

fn speed(text: &str) -> Result<f64, String> {
    let (min, max) = (SPEED_RANGE.start(), SPEED_RANGE.end());
    match text.parse::<f64>() {
        Ok(factor) if SPEED_RANGE.contains(&factor) => Ok(factor),
        _ => Err(format!("a number from {min} to {max} is needed")),
    }
}

fn factor(text: &str) -> Result<f64, String> {
    number(text, "a factor from 0.01 to 100", |value| (0.01..=100.0).contains(&value))
}

fn share(text: &str) -> Result<f64, String> {
    number(text, "a share from 0.05 to 1", |value| (0.05..=1.0).contains(&value))
}

fn jerk(text: &str) -> Result<f64, String> {
    number(text, "a jerk from 1000 to 1e7 mm/s³", |value| (1e3..=1e7).contains(&value))
}

fn ratio(text: &str) -> Result<f64, String> {
    number(text, "a ratio from 0 to below 1", |value| (0.0..1.0).contains(&value))
}

fn step_error(text: &str) -> Result<f64, String> {
    number(text, "a time from 0 to 1000 µs", |value| (0.0..=1000.0).contains(&value))
}

fn trace_step(text: &str) -> Result<f64, String> {
    number(text, "a time from 0.01 to 10000 ms", |value| (0.01..=1e4).contains(&value))
}

fn number(text: &str, what: &str, fits: impl Fn(f64) -> bool) -> Result<f64, String> {
    text.parse().ok().filter(|&value| fits(value)).ok_or_else(|| format!("write {what}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_sound() {
        Cli::command().debug_assert();
    }

    #[test]
    fn faults_add_up() {
        let cli = Cli::try_parse_from([
            "stepcast",
            "simulate",
            "a.gcode",
            "--config",
            "p.cfg",
            "--fault",
            "corrupt=0.01",
            "--fault",
            "unplug@30",
            "--board",
            "stm32f103",
            "--confirm-line",
            "3",
            "--confirm-line",
            "4",
        ])
        .unwrap();
        let CommandLine::Simulate(args) = cli.command else { panic!("another command") };
        let faults = args.machine.faults();
        assert_eq!(faults.bytes.corrupt, 0.01);
        assert_eq!(faults.failures.len(), 1);
        assert_eq!(args.machine.board.unwrap().profile().name, "stm32f103");
        assert_eq!(args.confirm_lines, [3, 4]);
    }

    #[test]
    fn nonsense_is_refused() {
        for arguments in [
            &["stepcast", "simulate", "a", "--config", "p", "--fault", "meteor"][..],
            &["stepcast", "simulate", "a"],
            &["stepcast", "virtual-printer", "--pty", "p", "--speed", "0"],
            &["stepcast", "virtual-printer", "--pty", "p", "--speed", "nan"],
            &["stepcast", "plan", "a", "--config", "p", "--board", "avr"],
            &["stepcast"],
        ] {
            assert!(Cli::try_parse_from(arguments).is_err(), "{arguments:?}");
        }
    }
}
