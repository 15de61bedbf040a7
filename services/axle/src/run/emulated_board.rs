//! An emulated robot behind a serial line: its board on a pseudo-terminal, which programs open as they open a real port.
//!
//! The gate is then in the process that opens it, as with a real board. The terminal's path is printed, and a link
//! to it is made where one is asked for. When the program at the other end has gone, there is a new terminal, as
//! when a cable is plugged in again.

use super::Context;
use super::board::Paced;
use crate::out::{data, usage};
use crate::params::load;
use anyhow::Context as _;
use axle_emulator::{EmulatedBoard, EmulatorParams};
use axle_mesh::Alarm;
use axle_robot::BoardKind;
use axle_schema::{Seconds, key};
use nix::fcntl::OFlag;
use nix::pty::{PtyMaster, grantpt, posix_openpt, ptsname_r, unlockpt};
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
use std::io::{ErrorKind, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// Emulates the board until it is told to stop.
pub(crate) async fn run(mut context: Context, kind: BoardKind) -> anyhow::Result<()> {
    let params: EmulatorParams = load(context.params.as_deref())?;
    let robot = context.one_robot()?;
    let mesh = context.mesh.clone();
    let run = u32::try_from(mesh.boot().0 % 0xFFFF).unwrap_or_default();
    let mut board = EmulatedBoard::new(&params, kind, run)?;
    if params.walls.solid {
        board = board.among(&super::emulator::map(&mesh, &robot).await?)?;
    }
    let mut truth = Paced::new(mesh.publisher(&key::TRUTH.of(&robot))?, params.rates.truth_hz);
    let mut terminal = Terminal::open(context.port.clone())?;
    data(&format!("{} at {}", kind.name(), terminal.shown()))?;
    tracing::info!("{} is at {}", kind.name(), terminal.shown());
    let stopping = Arc::new(AtomicBool::new(false));
    let is_stopping = Arc::clone(&stopping);
    // The last servo that was turned: one that is told the same again and again is logged once.
    let mut servo = None;
    let thread =
        mesh.beat_on_own_thread("board", params.rates.beat, Alarm::default(), move |now: Seconds| {
            let mut said = Vec::new();
            let heard = terminal.read(board.room(now));
            board.advance(now, &heard, &mut said);
            terminal.write(&said);
            if let Some(turned) = board.turned()
                && servo.replace(turned) != Some(turned)
            {
                let (pin, angle) = turned;
                tracing::info!("the servo at pin {pin} turns to {:.3} rad", angle.0);
            }
            truth.put(now, None, || board.truth());
            !is_stopping.load(Relaxed)
        })?;
    let _visible = context.ready()?;
    context.stop.wait().await;
    stopping.store(true, Relaxed);
    tokio::task::spawn_blocking(move || drop(thread.join())).await?;
    Ok(())
}

/// A pseudo-terminal, and the link to it; the link goes with it.
struct Terminal {
    master: PtyMaster,
    path: String,
    link: Option<PathBuf>,
}

/// A raw terminal that nobody has opened, and its path.
pub(crate) fn terminal() -> anyhow::Result<(PtyMaster, String)> {
    let flags = OFlag::O_RDWR | OFlag::O_NOCTTY | OFlag::O_NONBLOCK | OFlag::O_CLOEXEC;
    let master = posix_openpt(flags).context("open a pseudo-terminal")?;
    grantpt(&master).and_then(|()| unlockpt(&master)).context("unlock a pseudo-terminal")?;
    let mut settings = tcgetattr(&master).context("read the settings of a pseudo-terminal")?;
    cfmakeraw(&mut settings);
    tcsetattr(&master, SetArg::TCSANOW, &settings).context("make a pseudo-terminal raw")?;
    let path = ptsname_r(&master).context("name a pseudo-terminal")?;
    Ok((master, path))
}

impl Terminal {
    fn open(link: Option<PathBuf>) -> anyhow::Result<Self> {
        let (master, path) = terminal()?;
        if let Some(link) = &link {
            point(link, &path)?;
        }
        Ok(Self { master, path, link })
    }
    fn shown(&self) -> String {
        self.link.as_ref().map_or_else(|| self.path.clone(), |link| link.display().to_string())
    }
    /// What was written to the other end, at most `room` bytes.
    fn read(&mut self, room: usize) -> Vec<u8> {
        let mut bytes = vec![0; room];
        match self.master.read(&mut bytes) {
            Ok(count) => {
                bytes.truncate(count);
                bytes
            }
            // The program at the other end has closed it.
            Err(fault) if !matches!(fault.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {
                self.renew();
                Vec::new()
            }
            Err(_) => Vec::new(),
        }
    }
    /// Gives bytes to the other end; what nobody reads is lost, as on a line.
    fn write(&mut self, bytes: &[u8]) {
        if !bytes.is_empty() {
            drop(self.master.write(bytes));
        }
    }
    fn renew(&mut self) {
        let renewed = terminal().and_then(|(master, path)| {
            if let Some(link) = &self.link {
                point(link, &path)?;
            }
            Ok((master, path))
        });
        match renewed {
            Ok((master, path)) => {
                (self.master, self.path) = (master, path);
                tracing::info!("the port was closed; the board is at {} again", self.shown());
            }
            Err(fault) => tracing::warn!("{fault:#}"),
        }
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        // A link that somebody else has made in its place is theirs.
        if let Some(link) = &self.link
            && std::fs::read_link(link).is_ok_and(|to| to == Path::new(&self.path))
        {
            drop(std::fs::remove_file(link));
        }
    }
}

/// Makes `link` lead to `path`, in one step, so that nobody finds it missing.
fn point(link: &Path, path: &str) -> anyhow::Result<()> {
    if std::fs::symlink_metadata(link).is_ok_and(|there| !there.is_symlink()) {
        return Err(usage(format!(
            "--port {}: something is there that is no link; the emulator makes a link to its terminal there",
            link.display()
        )));
    }
    let made = link.with_extension("new");
    drop(std::fs::remove_file(&made));
    std::os::unix::fs::symlink(path, &made)
        .and_then(|()| std::fs::rename(&made, link))
        .map_err(|fault| usage(format!("--port {}: cannot make a link there: {fault}", link.display())))
}
