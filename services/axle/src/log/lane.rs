//! The way to stderr, on which nobody waits.
//!
//! Writing to a terminal that is held (Ctrl-S), to a pipe that nobody empties or to a supervisor that is frozen takes until
//! somebody lets it go on. Were that the thread of the gate with a word about a stop, the wheels would keep on turning.
//! So lines are left here, in bounded room, and a thread of their own writes them; what finds no room is counted, and
//! told with the next line that does.

use std::collections::VecDeque;
use std::io::Write;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;
use tracing_subscriber::fmt::MakeWriter;

/// Lines that may wait, and how many bytes they may have together.
const LINES: usize = 1024;
const BYTES: usize = 1 << 20;
/// The last lines of a process have this long to be written.
const FAREWELL: Duration = Duration::from_millis(500);

/// The lane of this process; none where no thread could be had, and then lines are written where they arise.
static STDERR: OnceLock<Option<Lane>> = OnceLock::new();

/// The lane of this process, which begins with the first call.
fn stderr() -> Option<&'static Lane> {
    STDERR.get_or_init(|| Lane::start(std::io::stderr()).ok()).as_ref()
}

/// Leaves a line for stderr.
pub(crate) fn line(text: &str) {
    leave(format!("{text}\n").as_bytes());
}

/// Waits until what was left is written, but not for long.
pub(crate) fn end() {
    if let Some(Some(lane)) = STDERR.get() {
        lane.end(FAREWELL);
    }
}

fn leave(line: &[u8]) {
    match stderr() {
        Some(lane) => lane.leave(line),
        // A stderr that is closed is nobody's fault.
        None => drop(std::io::stderr().write_all(line)),
    }
}

/// Stderr, for the layer that formats lines.
pub(super) struct Stderr;

impl Write for Stderr {
    /// The layer writes a line at a time.
    fn write(&mut self, line: &[u8]) -> std::io::Result<usize> {
        leave(line);
        Ok(line.len())
    }
    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl MakeWriter<'_> for Stderr {
    type Writer = Self;
    fn make_writer(&self) -> Self {
        Self
    }
}

/// Lines between those who say them and a thread that writes them.
struct Lane {
    shared: Arc<Shared>,
}

#[derive(Default)]
struct Shared {
    waiting: Mutex<Waiting>,
    left: Condvar,
    written: Condvar,
}

#[derive(Default)]
struct Waiting {
    lines: VecDeque<Vec<u8>>,
    bytes: usize,
    /// Lines that found no room since the last one that did.
    lost: u64,
    /// A line is being written.
    is_writing: bool,
}

impl Lane {
    fn start(mut to: impl Write + Send + 'static) -> std::io::Result<Self> {
        let shared = Arc::new(Shared::default());
        let writing = Arc::clone(&shared);
        std::thread::Builder::new().name("log".into()).spawn(move || {
            loop {
                let line = writing.next();
                // A stderr that is closed is nobody's fault.
                drop(to.write_all(&line));
            }
        })?;
        Ok(Self { shared })
    }

    fn leave(&self, line: &[u8]) {
        let mut waiting = self.shared.lock();
        if waiting.lines.len() >= LINES || waiting.bytes + line.len() > BYTES {
            waiting.lost = waiting.lost.saturating_add(1);
            return;
        }
        waiting.bytes += line.len();
        waiting.lines.push_back(line.to_vec());
        drop(waiting);
        self.shared.left.notify_one();
    }

    /// Waits until everything is written, or for so long.
    fn end(&self, patience: Duration) {
        let is_open = |waiting: &mut Waiting| waiting.is_writing || !waiting.lines.is_empty();
        drop(self.shared.written.wait_timeout_while(self.shared.lock(), patience, is_open));
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The next line, as soon as there is one; whoever asks for it has written the one before.
    fn next(&self) -> Vec<u8> {
        let mut waiting = self.lock();
        waiting.is_writing = false;
        loop {
            if let Some(line) = waiting.lines.pop_front() {
                waiting.bytes -= line.len();
                waiting.is_writing = true;
                let lost = std::mem::take(&mut waiting.lost);
                return match lost {
                    0 => line,
                    lost => [&line, format!("({lost} lines of the log found no room)\n").as_bytes()].concat(),
                };
            }
            self.written.notify_all();
            waiting = self.left.wait(waiting).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc;

    /// A reader that takes nothing until it is told to.
    struct Held {
        goes_on: mpsc::Receiver<()>,
        begun: mpsc::Sender<()>,
        text: Arc<Mutex<Vec<u8>>>,
    }

    impl Write for Held {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            let _ = self.begun.send(());
            // An error is the end of the test: from then on everything passes.
            let _ = self.goes_on.recv();
            self.text.lock().expect("the text").extend_from_slice(bytes);
            Ok(bytes.len())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_reader_that_holds_up_everything_holds_up_nobody_who_logs() {
        let (go_on, goes_on) = mpsc::channel();
        let (begun, begins) = mpsc::channel();
        let text = Arc::new(Mutex::new(Vec::new()));
        let lane = Lane::start(Held { goes_on, begun, text: Arc::clone(&text) }).expect("a thread");
        lane.leave(b"first\n");
        begins.recv().expect("the first line is being written");
        for number in 0..LINES + 7 {
            lane.leave(format!("{number}\n").as_bytes());
        }
        lane.end(Duration::from_millis(1));
        assert!(text.lock().expect("the text").is_empty(), "nothing has passed yet");
        drop(go_on);
        lane.end(Duration::from_secs(60));
        let text = String::from_utf8(text.lock().expect("the text").clone()).expect("lines");
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 1 + LINES + 1, "the first, those that had room, and how many had none");
        assert!(lines.contains(&"(7 lines of the log found no room)"), "{text}");
        assert_eq!((lines[0], lines[1]), ("first", "0"));
        assert_eq!(lines[lines.len() - 1], (LINES - 1).to_string());
    }

    #[test]
    fn lines_that_are_too_long_together_find_no_room_either() {
        let (_go_on, goes_on) = mpsc::channel();
        let (begun, _begins) = mpsc::channel();
        let lane = Lane::start(Held { goes_on, begun, text: Arc::default() }).expect("a thread");
        for _ in 0..10 {
            lane.leave(&vec![b'x'; BYTES / 4]);
        }
        let waiting = lane.shared.lock();
        assert!(
            waiting.bytes <= BYTES && waiting.lost >= 5,
            "{} bytes, {} lost",
            waiting.bytes,
            waiting.lost
        );
    }
}
