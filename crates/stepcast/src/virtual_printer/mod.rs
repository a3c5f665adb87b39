//! `stepcast virtual-printer`: the virtual printer on a pseudo-terminal, for any host that speaks its protocol.

#[cfg(unix)]
mod pty;
#[cfg(unix)]
mod serve;

use std::process::ExitCode;

use crate::cli::VirtualPrinterArgs;

/// Runs the command.
#[cfg(unix)]
pub(crate) fn run(args: &VirtualPrinterArgs) -> anyhow::Result<ExitCode> {
    serve::run(args)
}

/// Runs the command.
#[cfg(not(unix))]
pub(crate) fn run(args: &VirtualPrinterArgs) -> anyhow::Result<ExitCode> {
    anyhow::bail!(
        "{}: pseudo-terminals exist on Linux and macOS only; on this system use the virtual printer in the page",
        args.pty.display()
    )
}
