//! A pseudo-terminal in raw mode with a name of the user's choice.
//!
//! Knows bytes, not what they mean. Other programs open, close and reopen the terminal as they like: this end keeps it
//! open, so nothing breaks meanwhile.

use std::{
    io,
    os::fd::OwnedFd,
    path::{Path, PathBuf},
    time::Duration,
};

use anyhow::Context;
use rustix::{
    event::{PollFd, PollFlags, Timespec},
    fs::{Mode, OFlags},
    io::Errno,
    pty::OpenptFlags,
    termios::OptionalActions,
};

/// The controlling end of a pseudo-terminal. Its name is removed when it goes.
#[derive(Debug)]
pub(super) struct Pty {
    controller: OwnedFd,
    /// Kept open so that the terminal outlives the programs that use it.
    _user: OwnedFd,
    link: PathBuf,
    target: PathBuf,
}

impl Pty {
    /// A new terminal, to be opened as `link`.
    pub(super) fn open(link: &Path) -> anyhow::Result<Self> {
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY;
        let controller = rustix::pty::openpt(flags).context("cannot open a pseudo-terminal")?;
        rustix::pty::grantpt(&controller).context("cannot open a pseudo-terminal")?;
        rustix::pty::unlockpt(&controller).context("cannot open a pseudo-terminal")?;
        let name =
            rustix::pty::ptsname(&controller, Vec::new()).context("the pseudo-terminal has no name")?;
        let target = PathBuf::from(name.to_string_lossy().into_owned());
        let open = OFlags::RDWR | OFlags::NOCTTY;
        let user = rustix::fs::open(&target, open, Mode::empty())
            .with_context(|| format!("cannot open {}", target.display()))?;
        let mut settings = rustix::termios::tcgetattr(&user)?;
        settings.make_raw();
        rustix::termios::tcsetattr(&user, OptionalActions::Now, &settings)?;
        rustix::io::ioctl_fionbio(&controller, true)?;
        publish(&target, link)?;
        Ok(Self { controller, _user: user, link: link.to_owned(), target })
    }

    /// Its own name.
    pub(super) fn target(&self) -> &Path {
        &self.target
    }

    /// Waits until bytes have come, or for so long.
    pub(super) fn wait(&self, at_most: Duration) -> io::Result<()> {
        let mut ends = [PollFd::new(&self.controller, PollFlags::IN)];
        let timeout =
            Timespec { tv_sec: at_most.as_secs() as i64, tv_nsec: i64::from(at_most.subsec_nanos()) };
        match rustix::event::poll(&mut ends, Some(&timeout)) {
            Ok(_) | Err(Errno::INTR) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }

    /// The bytes that have come; none is no error.
    pub(super) fn read<'a>(&self, buffer: &'a mut [u8]) -> io::Result<&'a [u8]> {
        match rustix::io::read(&self.controller, &mut *buffer) {
            Ok(count) => Ok(&buffer[..count]),
            // EIO: nobody has the other end open.
            Err(Errno::AGAIN | Errno::INTR | Errno::IO) => Ok(&[]),
            Err(error) => Err(error.into()),
        }
    }

    /// Writes as much as there is room for, and says how much that was.
    pub(super) fn write(&self, bytes: &[u8]) -> io::Result<usize> {
        match rustix::io::write(&self.controller, bytes) {
            Ok(count) => Ok(count),
            Err(Errno::AGAIN | Errno::INTR | Errno::IO) => Ok(0),
            Err(error) => Err(error.into()),
        }
    }
}

impl Drop for Pty {
    fn drop(&mut self) {
        // Somebody else's by now, perhaps.
        if std::fs::read_link(&self.link).is_ok_and(|target| target == self.target) {
            let _ = std::fs::remove_file(&self.link);
        }
    }
}

/// Makes `link` a name of `target`; a symbolic link of an earlier run is replaced, anything else is not.
fn publish(target: &Path, link: &Path) -> anyhow::Result<()> {
    match std::fs::symlink_metadata(link) {
        Ok(about) if about.file_type().is_symlink() => {
            std::fs::remove_file(link).with_context(|| format!("cannot replace {}", link.display()))?;
        }
        Ok(_) => anyhow::bail!("{} exists and is no symbolic link: choose another path", link.display()),
        Err(_) => {}
    }
    std::os::unix::fs::symlink(target, link).with_context(|| format!("cannot create {}", link.display()))
}
