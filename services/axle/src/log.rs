//! The log of a process: on stderr, for people or as JSON lines, and on the mesh, where it can be tapped.
//!
//! How much is logged can be changed while the process runs (`axle log SERVICE LEVEL`). On the mesh the log is a stream like
//! any other: bounded, never waited for, and what comes too fast is counted and left out; stderr has all of it. What Zenoh
//! itself logs stays on stderr, or each line said would cause the next. Nobody who logs waits for stderr either (`lane`).

use anyhow::Context as _;
use axle_mesh::{Mesh, Publisher, Server};
use axle_schema::command::Done;
use axle_schema::log::{LogLevel, LogLine, MAX_FIELD, MAX_FIELDS, MAX_TEXT, SetLog, cut};
use axle_schema::{Refusal, RobotId, key};
use clap::ValueEnum;
use std::collections::BTreeMap;
use std::fmt::{Debug, Write as _};
use std::io::IsTerminal as _;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Duration;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use tokio::time::Instant;
use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::layer::{Context, SubscriberExt as _};
use tracing_subscriber::registry::LookupSpan;
use tracing_subscriber::util::SubscriberInitExt as _;
use tracing_subscriber::{EnvFilter, Layer, Registry, reload};

pub(crate) mod lane;

/// Lines that may wait for the mesh, and the most that go there in a second.
const WAITING: usize = 256;
const PACE: u32 = 200;

/// How lines stand on stderr.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    // Comments that clap does not see: it would make pages of every help.
    // For people.
    #[default]
    Human,
    // One JSON object a line.
    Json,
}

impl Format {
    /// Its name on the command line.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Human => "human",
            Self::Json => "json",
        }
    }
}

/// What the log of this process is made of, once it has begun.
struct Begun {
    filter: reload::Handle<EnvFilter, Registry>,
    format: Format,
}

static BEGUN: OnceLock<Begun> = OnceLock::new();
/// Where lines wait for the mesh; none before the process is a service.
static MESH: OnceLock<mpsc::Sender<LogLine>> = OnceLock::new();
static DROPPED: AtomicU64 = AtomicU64::new(0);
/// Service and robot, for JSON lines.
static OWN: OnceLock<(&'static str, String)> = OnceLock::new();

/// Starts the log on stderr.
pub(crate) fn start(level: &str, format: Format) {
    let parsed = filter(level);
    let wrong = parsed.as_ref().err().map(ToString::to_string);
    let (own, handle) = reload::Layer::new(parsed.unwrap_or_else(|_| EnvFilter::new("info,zenoh=off")));
    let human = (format == Format::Human).then(|| {
        let colours = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
        tracing_subscriber::fmt::layer().with_writer(lane::Stderr).with_target(false).with_ansi(colours)
    });
    let begun = tracing_subscriber::registry().with(own).with(human).with(Lines { format }).try_init();
    if begun.is_ok() {
        drop(BEGUN.set(Begun { filter: handle, format }));
    }
    if let Some(wrong) = wrong {
        tracing::warn!("--log {level}: {wrong}; logging at info");
    }
}

/// How lines stand on the stderr of this process, and so of those that it starts.
pub(crate) fn format() -> Format {
    BEGUN.get().map_or(Format::Human, |begun| begun.format)
}

/// What a level lets through.
fn filter(level: &str) -> Result<EnvFilter, Refusal> {
    const LEVELS: [&str; 6] = ["off", "error", "warn", "info", "debug", "trace"];
    let known = || LEVELS.join(", ") + ", or per part: info,axle_mesh=debug";
    for part in level.split(',') {
        // A word that is no level would be taken for the name of a part, and hide everything else.
        let word = part.rsplit_once('=').map_or(part, |(_, level)| level);
        if !LEVELS.contains(&word.trim()) {
            return Err(Refusal::Unknown { what: "level".into(), got: cut(word, 40), known: known() });
        }
    }
    // Zenoh's own log says what happens on links; its errors are told by Axle in its own words.
    let all = if level.contains('=') { level.to_owned() } else { format!("{level},zenoh=off") };
    EnvFilter::builder().parse(all).map_err(|fault| Refusal::malformed("level", fault))
}

/// Logs more or less from now on.
fn set(level: &str) -> Result<(), Refusal> {
    let filter = filter(level)?;
    let begun = BEGUN.get().ok_or_else(|| Refusal::internal("the log has not begun"))?;
    begun.filter.reload(filter).map_err(Refusal::internal)?;
    tracing::info!("logs at {level} from now on");
    Ok(())
}

/// The log of a service on the mesh; it ends with this value.
pub(crate) struct Travelling {
    tasks: [JoinHandle<()>; 2],
}

impl Drop for Travelling {
    fn drop(&mut self) {
        self.tasks.iter().for_each(JoinHandle::abort);
    }
}

/// Says on the mesh what the process logs, and lets others change how much that is.
pub(crate) fn travel(
    mesh: &Mesh,
    service: &'static str,
    robot: Option<&RobotId>,
) -> anyhow::Result<Travelling> {
    let stream = key::log_of(service);
    let key = robot.map_or_else(|| stream.of_all_robots(), |robot| stream.of(robot));
    let publisher = mesh.publisher(&key).context("declare the log")?;
    let server = mesh.server::<SetLog, Done>(&mesh.presence().log_level()).context("declare the log")?;
    drop(OWN.set((service, mesh.presence().robot.clone())));
    let (sender, lines) = mpsc::channel(WAITING);
    drop(MESH.set(sender));
    Ok(Travelling { tasks: [tokio::spawn(say(publisher, lines)), tokio::spawn(obey(server))] })
}

/// Says lines, not too many. Never ends.
async fn say(publisher: Publisher<LogLine>, mut lines: mpsc::Receiver<LogLine>) {
    let (mut since, mut count) = (Instant::now(), 0);
    while let Some(mut line) = lines.recv().await {
        if since.elapsed() >= Duration::from_secs(1) {
            (since, count) = (Instant::now(), 0);
        }
        count += 1;
        if count > PACE {
            DROPPED.fetch_add(1, Relaxed);
            continue;
        }
        line.dropped = DROPPED.swap(0, Relaxed);
        // A line about a line that was not said would be the next not to be said.
        drop(publisher.put(&line, None));
    }
}

/// Changes levels as it is told. Never ends.
async fn obey(server: Server<SetLog, Done>) {
    loop {
        let asked = server.next().await;
        let answer = asked.question().and_then(|SetLog { level }| set(&level));
        asked.reply(answer.map(|()| Done {}));
    }
}

/// Makes lines of events.
struct Lines {
    format: Format,
}

/// The fields of a span, kept with it.
struct Fields(BTreeMap<String, String>);

impl<S: Subscriber + for<'a> LookupSpan<'a>> Layer<S> for Lines {
    fn on_new_span(&self, attributes: &Attributes<'_>, id: &Id, context: Context<'_, S>) {
        if let Some(span) = context.span(id) {
            let mut seen = Seen::default();
            attributes.record(&mut seen);
            span.extensions_mut().insert(Fields(seen.fields));
        }
    }

    fn on_event(&self, event: &Event<'_>, context: Context<'_, S>) {
        let target = event.metadata().target();
        let travels = MESH.get().is_some() && !target.starts_with("zenoh");
        if !travels && self.format == Format::Human {
            return;
        }
        let mut seen = Seen::default();
        let mut spans = Vec::new();
        for span in context.event_scope(event).into_iter().flat_map(|scope| scope.from_root()) {
            spans.push(span.name());
            if let Some(Fields(fields)) = span.extensions().get() {
                seen.fields.extend(fields.clone());
            }
        }
        event.record(&mut seen);
        let level = match *event.metadata().level() {
            Level::ERROR => LogLevel::Error,
            Level::WARN => LogLevel::Warn,
            Level::INFO => LogLevel::Info,
            Level::DEBUG => LogLevel::Debug,
            Level::TRACE => LogLevel::Trace,
        };
        let Seen { text, mut fields } = seen;
        while fields.len() > MAX_FIELDS {
            fields.pop_last();
        }
        let span = (!spans.is_empty()).then(|| cut(&spans.join(":"), MAX_FIELD));
        let line = LogLine { level, text: cut(&text, MAX_TEXT), fields, span, dropped: 0 };
        if self.format == Format::Json {
            print(&line, target);
        }
        if travels && MESH.get().is_none_or(|mesh| mesh.try_send(line).is_err()) {
            DROPPED.fetch_add(1, Relaxed);
        }
    }
}

/// One JSON line on stderr.
fn print(line: &LogLine, target: &str) {
    let (service, robot) = OWN.get().map_or((None, None), |(service, robot)| (Some(service), Some(robot)));
    let LogLine { level, text, fields, span, .. } = line;
    let json = serde_json::json!({
        "time": axle_mesh::clock::wall(), "level": level, "service": service, "robot": robot, "part": target,
        "span": span, "fields": fields, "text": text,
    });
    lane::line(&json.to_string());
}

/// What an event or a span says.
#[derive(Default)]
struct Seen {
    text: String,
    fields: BTreeMap<String, String>,
}

impl Seen {
    fn take(&mut self, field: &Field, value: &str) {
        if field.name() == "message" {
            value.clone_into(&mut self.text);
        } else {
            self.fields.insert(cut(field.name(), MAX_FIELD), cut(value, MAX_FIELD));
        }
    }
}

impl Visit for Seen {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        let mut text = String::new();
        // Writing to a text cannot fail.
        let _ = write!(text, "{value:?}");
        self.take(field, &text);
    }
    fn record_str(&mut self, field: &Field, value: &str) {
        self.take(field, value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_that_is_no_level_is_refused() {
        for level in ["info", "off", "trace", "info,axle_mesh=debug", "axle=debug,zenoh=warn"] {
            assert!(filter(level).is_ok(), "{level}");
        }
        for level in ["", "loud", "info,loud", "axle=loud", "info,", "\u{1b}[2J"] {
            let refusal = filter(level).expect_err(level).to_string();
            assert!(refusal.contains("unknown level") && !refusal.contains('\u{1b}'), "{refusal}");
        }
    }
}
