//! The virtual printer against the real clock: virtual time follows it, times the speed that was asked for.

use std::{
    process::ExitCode,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use printer::config;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use units::{Seconds, Ticks};
use virtual_printer::VirtualPrinter;

use super::pty::Pty;
use crate::{
    cli::{Board, VirtualPrinterArgs},
    config_file, console,
};

/// The board answers within this time of its own at the latest.
const TICK: Duration = Duration::from_millis(1);
/// How much is read at once.
const READ_BYTES: usize = 4096;
/// Bytes for a host that does not read them; more are lost, as on a wire.
const UNREAD_BYTES_MAX: usize = 64 * 1024;
/// Virtual time falls behind rather than jump by more than this, after the computer slept for instance.
const CATCH_UP_MAX: Seconds = Seconds(1.0);

/// Serves until a signal ends it.
pub(super) fn run(args: &VirtualPrinterArgs) -> anyhow::Result<ExitCode> {
    let mut machine_file = match &args.config {
        Some(path) => config_file::load(path)?,
        None => config::parse(demo_machine::USUAL_MACHINE)
            .0
            .ok_or_else(|| anyhow::anyhow!("the built-in machine file cannot be read: please report this"))?,
    };
    let board = demo_machine::fit(&mut machine_file, args.machine.board.map(Board::profile).as_ref())?;
    let machine = demo_machine::machine(&machine_file)?;
    let name = board.name;
    let printer = VirtualPrinter::new(board, &machine, &args.machine.faults(), args.machine.seed, ())?;
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        signal_hook::flag::register(signal, Arc::clone(&stop))?;
    }
    let pty = Pty::open(&args.pty)?;
    console::note(&format!(
        "virtual printer ({name}) on {} -> {}, {} times real speed; end it with Ctrl-C",
        args.pty.display(),
        pty.target().display(),
        args.speed
    ));
    serve(printer, &pty, args.speed, &stop)?;
    Ok(ExitCode::SUCCESS)
}

fn serve(mut printer: VirtualPrinter<()>, pty: &Pty, speed: f64, stop: &AtomicBool) -> anyhow::Result<()> {
    let clock = printer.profile().clock;
    let catch_up_max = clock.ticks_in(CATCH_UP_MAX * speed.max(1.0));
    let mut began = (Instant::now(), printer.now());
    let mut buffer = [0; READ_BYTES];
    let mut to_host = Vec::new();
    while !stop.load(Ordering::Relaxed) {
        pty.wait(TICK)?;
        let real = Seconds(began.0.elapsed().as_secs_f64() * speed);
        let mut target = began.1 + clock.ticks_in(real);
        if target.saturating_sub(printer.now()) > catch_up_max {
            target = printer.now() + catch_up_max;
            began = (Instant::now(), target);
        }
        advance(&mut printer, target, &mut to_host);
        loop {
            let bytes = pty.read(&mut buffer)?;
            if bytes.is_empty() {
                break;
            }
            printer.write(bytes);
        }
        let written = if to_host.is_empty() { 0 } else { pty.write(&to_host)? };
        to_host.drain(..written);
        if to_host.len() > UNREAD_BYTES_MAX {
            to_host.clear();
        }
    }
    Ok(())
}

fn advance(printer: &mut VirtualPrinter<()>, target: Ticks, to_host: &mut Vec<u8>) {
    while printer.now() < target {
        printer.run_until(target, to_host);
    }
}
