//! A serial port that comes and goes: opened, read and written by a task of its own, and opened again when it was gone.
//!
//! What comes is stamped when it arrives, and waits in a bounded queue for the beat; what the queue has no room for is
//! left out and counted. A write that blocks is given up, and with it the port.

use axle_mesh::Clock;
use axle_schema::{Refusal, Seconds};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use std::time::Duration;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, ReadHalf, WriteHalf};
use tokio::sync::{Notify, mpsc};
use tokio::time::{Instant, sleep, timeout};
use tokio_serial::{ClearBuffer, SerialPort as _, SerialPortBuilderExt as _, SerialStream};

/// The first and the longest pause before the port is tried again; one that was open for `STEADY` begins anew.
const PAUSES: (Duration, Duration) = (Duration::from_millis(100), Duration::from_secs(2));
const STEADY: Duration = Duration::from_secs(5);
/// Pieces that wait for a beat, and bytes of each.
const PIECES: usize = 64;
const PIECE: usize = 512;
/// What waits to be written: each is what one beat said.
const ORDERS: usize = 8;
/// A write that takes longer is stuck.
const STUCK: Duration = Duration::from_millis(200);

/// Why a port cannot be used.
#[derive(Debug, thiserror::Error)]
pub(crate) enum PortFault {
    #[error(
        "there is no such port; is the board plugged in? `ls /dev/serial/by-id` shows the boards that are"
    )]
    Absent,
    #[error("no permission to open it; `sudo usermod -aG dialout $USER` and a new login give it")]
    Denied,
    #[error("another program has it open")]
    Busy,
    #[error("it cannot be opened as a serial port: {0}")]
    Unusable(String),
    #[error("it was unplugged: {0}")]
    Gone(String),
    #[error("it takes no more bytes: the board does not read, or its flow control holds it")]
    Stuck,
}

impl PortFault {
    fn of(fault: &tokio_serial::Error) -> Self {
        use std::io::ErrorKind::{NotFound, PermissionDenied};
        use tokio_serial::ErrorKind::{Io, NoDevice};
        match fault.kind {
            Io(NotFound) => Self::Absent,
            Io(PermissionDenied) => Self::Denied,
            // What the library says for a port that somebody else has locked.
            NoDevice => Self::Busy,
            _ => Self::Unusable(fault.to_string()),
        }
    }
    fn refusal(&self, port: &Path) -> Refusal {
        match self {
            Self::Busy => Refusal::Busy { holder: format!("another program ({})", port.display()) },
            fault => Refusal::unavailable(format!("the port {}", port.display()), fault.to_string()),
        }
    }
}

/// What the task tells the beat.
#[derive(Debug)]
pub(crate) enum Arrival {
    /// The port is open.
    Opened,
    /// Bytes, and when they came.
    Bytes(Seconds, Vec<u8>),
    /// The port is not open; why, unless the beat hung up itself and knows.
    Closed(Option<Refusal>),
}

/// The beat's end of a port.
pub(crate) struct Port {
    path: PathBuf,
    arrivals: mpsc::Receiver<Arrival>,
    orders: mpsc::Sender<Vec<u8>>,
    flooded: Arc<AtomicU32>,
    hang_up: Arc<Notify>,
}

impl Port {
    /// Begins to open the port, and never gives up; ends with this value.
    pub(crate) fn open(path: &Path, baud: u32, clock: Clock) -> Self {
        let (arriving, arrivals) = mpsc::channel(PIECES);
        let (orders, ordered) = mpsc::channel(ORDERS);
        let (flooded, hang_up) = (Arc::new(AtomicU32::new(0)), Arc::new(Notify::new()));
        let task = Task {
            path: path.to_owned(),
            baud,
            clock,
            arriving,
            ordered,
            flooded: Arc::clone(&flooded),
            hang_up: Arc::clone(&hang_up),
        };
        tokio::spawn(task.run());
        Self { path: path.to_owned(), arrivals, orders, flooded, hang_up }
    }
    /// What has arrived, once.
    pub(crate) fn take(&mut self) -> Option<Arrival> {
        self.arrivals.try_recv().ok()
    }
    /// How many pieces had no room, since this was asked last.
    pub(crate) fn flooded(&self) -> u32 {
        self.flooded.swap(0, Relaxed)
    }
    /// Writes bytes.
    ///
    /// # Errors
    /// When those of many beats wait already: the port is then given up.
    pub(crate) fn say(&self, bytes: Vec<u8>) -> Result<(), Refusal> {
        self.orders.try_send(bytes).map_err(|_| {
            self.hang_up();
            PortFault::Stuck.refusal(&self.path)
        })
    }
    /// Closes the port and opens it anew.
    pub(crate) fn hang_up(&self) {
        self.hang_up.notify_one();
    }
}

/// How a conversation ended.
#[derive(Debug)]
enum End {
    /// The port has failed.
    Fault(PortFault),
    /// The beat wants it opened anew.
    HungUp,
    /// The beat is no more, and everything is written.
    Over,
}

/// The task's end of a port.
struct Task {
    path: PathBuf,
    baud: u32,
    clock: Clock,
    arriving: mpsc::Sender<Arrival>,
    ordered: mpsc::Receiver<Vec<u8>>,
    flooded: Arc<AtomicU32>,
    hang_up: Arc<Notify>,
}

impl Task {
    async fn run(mut self) {
        let mut pause = PAUSES.0;
        while !self.arriving.is_closed() {
            let begun = Instant::now();
            let why = match self.open() {
                Ok(stream) => {
                    // What was said to a port that is gone is not said to this one.
                    while self.ordered.try_recv().is_ok() {}
                    if self.arriving.send(Arrival::Opened).await.is_err() {
                        return;
                    }
                    match self.talk(stream).await {
                        End::Fault(fault) => Some(fault),
                        End::HungUp => None,
                        End::Over => return,
                    }
                }
                Err(fault) => Some(PortFault::of(&fault)),
            };
            let why = why.map(|fault| fault.refusal(&self.path));
            if self.arriving.send(Arrival::Closed(why)).await.is_err() {
                return;
            }
            if begun.elapsed() >= STEADY {
                pause = PAUSES.0;
            }
            sleep(pause).await;
            pause = (pause * 2).min(PAUSES.1);
        }
    }

    fn open(&self) -> tokio_serial::Result<SerialStream> {
        let stream = tokio_serial::new(self.path.to_string_lossy(), self.baud).open_native_async()?;
        // What waited in the system since somebody else read it is old.
        stream.clear(ClearBuffer::All)?;
        Ok(stream)
    }

    /// Reads and writes until the port fails, or nobody wants it any more.
    async fn talk(&mut self, stream: SerialStream) -> End {
        let (reading, writing) = tokio::io::split(stream);
        let Self { clock, arriving, ordered, flooded, hang_up, .. } = self;
        tokio::select! {
            fault = read(reading, *clock, arriving, flooded) => End::Fault(fault),
            fault = write(writing, ordered) => fault.map_or(End::Over, End::Fault),
            () = hang_up.notified() => End::HungUp,
        }
    }
}

async fn read(
    mut from: ReadHalf<SerialStream>,
    clock: Clock,
    arriving: &mpsc::Sender<Arrival>,
    flooded: &AtomicU32,
) -> PortFault {
    let mut bytes = [0; PIECE];
    loop {
        match from.read(&mut bytes).await {
            Ok(0) => return PortFault::Gone("it ended".into()),
            Ok(count) => {
                let piece = bytes.get(..count).unwrap_or_default().to_vec();
                if arriving.try_send(Arrival::Bytes(clock.now(), piece)).is_err() {
                    flooded.fetch_add(1, Relaxed);
                    // A stream that never ends must not keep others from running.
                    tokio::task::yield_now().await;
                }
            }
            Err(fault) => return PortFault::Gone(fault.to_string()),
        }
    }
}

/// Writes until it fails; nothing when the beat has ended and everything is written.
async fn write(mut to: WriteHalf<SerialStream>, ordered: &mut mpsc::Receiver<Vec<u8>>) -> Option<PortFault> {
    while let Some(bytes) = ordered.recv().await {
        match timeout(STUCK, to.write_all(&bytes)).await {
            Ok(Ok(())) => {}
            Ok(Err(fault)) => return Some(PortFault::Gone(fault.to_string())),
            Err(_) => return Some(PortFault::Stuck),
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The task's end of a port, the beat's end of it, and a clock.
    fn ends() -> (Task, Port) {
        let (arriving, arrivals) = mpsc::channel(PIECES);
        let (orders, ordered) = mpsc::channel(ORDERS);
        let (flooded, hang_up) = (Arc::new(AtomicU32::new(0)), Arc::new(Notify::new()));
        let (path, clock) = (PathBuf::from("port"), Clock::start());
        let task = Task {
            path: path.clone(),
            baud: 115_200,
            clock,
            arriving,
            ordered,
            flooded: Arc::clone(&flooded),
            hang_up: Arc::clone(&hang_up),
        };
        (task, Port { path, arrivals, orders, flooded, hang_up })
    }

    #[test]
    fn what_is_wrong_with_a_port_is_said_with_what_to_do() {
        use std::io::ErrorKind::{NotFound, PermissionDenied};
        use tokio_serial::{Error, ErrorKind};
        for (kind, words) in [
            (ErrorKind::Io(NotFound), "is the board plugged in"),
            (ErrorKind::Io(PermissionDenied), "usermod -aG dialout"),
            (ErrorKind::NoDevice, "another program (ttyUSB0)"),
            (ErrorKind::Unknown, "cannot be opened as a serial port"),
        ] {
            let refusal = PortFault::of(&Error::new(kind, "x")).refusal(Path::new("ttyUSB0")).to_string();
            assert!(
                refusal.contains(words) && refusal.contains("ttyUSB0"),
                "{refusal:?} does not say {words:?}"
            );
        }
    }

    #[tokio::test]
    async fn a_write_that_blocks_gives_the_port_up_and_keeps_few_orders() {
        let (mut task, port) = ends();
        let (stream, _nobody_reads) = SerialStream::pair().expect("a pseudo-terminal");
        let begun = Instant::now();
        port.say(vec![0; 1 << 20]).expect("room for an order");
        let fault = task.talk(stream).await;
        assert!(matches!(fault, End::Fault(PortFault::Stuck)), "{fault:?}");
        assert!(begun.elapsed() < STUCK * 10);
        while port.say(vec![0]).is_ok() {}
        let refusal = port.say(vec![0]).expect_err("too many orders").to_string();
        assert!(refusal.contains("takes no more bytes"), "{refusal}");
        let (other, _line) = SerialStream::pair().expect("a pseudo-terminal");
        assert!(matches!(task.talk(other).await, End::HungUp), "the beat has given the port up");
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_flood_is_left_out_and_counted_and_the_end_of_the_line_is_noticed() {
        let (mut task, mut port) = ends();
        let (stream, mut other) = SerialStream::pair().expect("a pseudo-terminal");
        let flood = tokio::spawn(async move {
            let whole = other.write_all(&vec![b'x'; 1 << 20]).await;
            drop(other);
            whole
        });
        let talking = tokio::spawn(async move { task.talk(stream).await });
        flood.await.expect("a task").expect("everything is taken from the line, whoever reads it");
        let fault = talking.await.expect("a task");
        assert!(matches!(fault, End::Fault(PortFault::Gone(_))), "{fault:?}");
        assert!(port.flooded() > 0, "some pieces had no room");
        assert_eq!(port.flooded(), 0, "told once");
        let mut pieces = 0;
        while let Some(Arrival::Bytes(_, piece)) = port.take() {
            assert!(piece.len() <= PIECE);
            pieces += 1;
        }
        assert!((1..=PIECES).contains(&pieces), "{pieces}");
    }
}
