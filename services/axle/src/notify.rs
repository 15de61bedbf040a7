//! Telling systemd that a process is ready, and that it still works: the protocol of sd_notify, a datagram of text.
//!
//! The watchdog is fed from the beat: who has one is fed only while it goes on, so that a process whose runtime turns
//! but whose beat is stuck is started anew. Without systemd nothing happens here.

use crate::signal::Stop;
use axle_mesh::Mesh;
use std::ffi::OsString;
use std::os::linux::net::SocketAddrExt as _;
use std::os::unix::ffi::OsStrExt as _;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::time::Duration;
use tokio::task::JoinHandle;

/// Where systemd listens.
const SOCKET: &str = "NOTIFY_SOCKET";
/// How long it waits for a word, in microseconds.
const PATIENCE: &str = "WATCHDOG_USEC";

/// Feeds the watchdog as long as it is kept, and says when the process ends.
pub(crate) struct Fed {
    feeding: Option<JoinHandle<()>>,
}

impl Drop for Fed {
    fn drop(&mut self) {
        if let Some(feeding) = &self.feeding {
            feeding.abort();
            say("STOPPING=1");
        }
    }
}

/// Says that this process is ready, and feeds the watchdog from now on.
pub(crate) fn ready(stop: Stop) -> Fed {
    begin(stop, || None)
}

/// The same for a service: with a beat, the watchdog is fed while the beat goes on.
pub(crate) fn service_ready(stop: Stop, mesh: &Mesh) -> Fed {
    let mesh = mesh.clone();
    begin(stop, move || Some(mesh.counters().beats()).filter(|beats| *beats > 0))
}

fn begin(mut stop: Stop, beats: impl Fn() -> Option<u64> + Send + 'static) -> Fed {
    if std::env::var_os(SOCKET).is_none() {
        return Fed { feeding: None };
    }
    say("READY=1");
    let patience = std::env::var(PATIENCE).ok().and_then(|text| text.parse().ok());
    let feeding = tokio::spawn(async move {
        let Some(patience) = patience.map(Duration::from_micros) else { return stop.wait().await };
        let mut last = None;
        loop {
            let next = beats();
            if next.is_none() || next != last {
                say("WATCHDOG=1");
            }
            last = next;
            // Four times as often as needed: one that is late is no reason to end a robot.
            tokio::time::sleep(patience / 4).await;
        }
    });
    Fed { feeding: Some(feeding) }
}

/// Sends one word; a service manager that does not listen is not the service's trouble.
fn say(word: &str) {
    if let Some(socket) = std::env::var_os(SOCKET) {
        drop(send(&socket, word));
    }
}

fn send(socket: &OsString, word: &str) -> std::io::Result<()> {
    let address = match socket.as_bytes() {
        [b'@', name @ ..] => SocketAddr::from_abstract_name(name)?,
        _ => SocketAddr::from_pathname(socket)?,
    };
    let own = UnixDatagram::unbound()?;
    // A manager whose queue is full must not hold up a robot.
    own.set_nonblocking(true)?;
    own.send_to_addr(word.as_bytes(), &address).map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_arrives_by_path_and_by_abstract_name() {
        let directory = std::env::temp_dir().join(format!("axle-notify-{}", std::process::id()));
        let name = format!("axle-notify-{}", std::process::id());
        let by_path = UnixDatagram::bind(&directory).expect("a socket");
        let by_name = SocketAddr::from_abstract_name(&name).expect("an address");
        let by_name = UnixDatagram::bind_addr(&by_name).expect("a socket");
        for (socket, address) in
            [(&by_path, directory.clone().into_os_string()), (&by_name, format!("@{name}").into())]
        {
            send(&address, "READY=1").expect("sent");
            let mut bytes = [0; 16];
            let count = socket.recv(&mut bytes).expect("a word");
            assert_eq!(&bytes[..count], b"READY=1");
        }
        std::fs::remove_file(directory).expect("removed");
    }
}
