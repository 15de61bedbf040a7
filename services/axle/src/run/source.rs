//! Source as a process: hears measurements, says the newest, answers for older ones.

use super::Context;
use super::tracer::{Tracer, setting};
use crate::params::load;
use axle_mesh::Publisher;
use axle_schema::key;
use axle_schema::meta::{Cause, Meta};
use axle_schema::trace::Named;
use axle_schema::window::{Window, WindowAsk};
use axle_source::{Source, SourceParams};
use std::time::Duration;
use tokio::time::Instant;

/// How many measurements may wait: Source takes them as they come.
const WAITING: usize = 256;
/// Encoders set the pace of what is said. When they fall silent, others do, but no faster than this.
const PACE: Duration = Duration::from_millis(200);

/// Buffers until it is told to stop.
pub(crate) async fn run(mut context: Context) -> anyhow::Result<()> {
    let params: SourceParams = load(context.params.as_deref())?;
    let robot = context.one_robot()?;
    let mesh = &context.mesh;
    let encoders = mesh.inbox(&key::ENCODERS.of(&robot), WAITING)?;
    let inertial = mesh.inbox(&key::INERTIAL.of(&robot), WAITING)?;
    let fixes = mesh.inbox(&key::FIX.of(&robot), WAITING)?;
    let ranges = mesh.inbox(&key::RANGE.of(&robot), WAITING)?;
    let positions = mesh.inbox(&key::POSITION.of(&robot), 1)?;
    let windows = mesh.server::<WindowAsk, Window>(&key::WINDOW.of(Some(&robot)))?;
    let mut voice = Voice {
        recent: mesh.publisher(&key::RECENT.of(&robot))?,
        tracer: Tracer::new(mesh, &robot, context.service, setting(&params, None))?,
        said: Instant::now(),
    };
    let _visible = context.ready()?;
    let span = params.recent;
    let mut source = Source::new(&params)?;
    loop {
        tokio::select! {
            heard = encoders.next() => {
                source.take_encoders(heard.meta, heard.message);
                // What else came since is in the same window.
                voice.tracer.took(key::ENCODERS.port(), heard.meta);
                voice.say(&source.recent(span), heard.meta);
            }
            heard = inertial.next() => {
                source.take_inertial(heard.meta, heard.message);
                voice.tracer.took(key::INERTIAL.port(), heard.meta);
                voice.say_instead(|| source.recent(span), heard.meta);
            }
            heard = fixes.next() => {
                source.take_fix(heard.meta, heard.message);
                voice.tracer.took(key::FIX.port(), heard.meta);
                voice.say_instead(|| source.recent(span), heard.meta);
            }
            heard = ranges.next() => {
                source.take_range(heard.meta, heard.message);
                voice.tracer.took(key::RANGE.port(), heard.meta);
                voice.say_instead(|| source.recent(span), heard.meta);
            }
            // No part of what is said by itself.
            heard = positions.next() => source.take_position(heard.message),
            asked = windows.next() => {
                let answer = asked.question().and_then(|ask| source.window(&ask));
                asked.reply(answer);
            }
            () = context.stop.wait() => return Ok(()),
        }
    }
}

/// What Source says without being asked.
struct Voice {
    recent: Publisher<Window>,
    tracer: Tracer,
    said: Instant,
}

impl Voice {
    fn say(&mut self, window: &Window, meta: Option<Meta>) {
        self.said = Instant::now();
        let cause = meta.map(|meta| Cause { source: meta.source, seq: meta.seq });
        let said = self.recent.put(window, cause);
        if let Err(refusal) = &said {
            tracing::warn!("the newest measurements could not be said: {refusal}");
        }
        self.tracer.said(said.ok().map(|said| Named::new(key::RECENT.port(), said)));
    }
    /// Whoever hears nothing of the encoders shall at least hear that others still speak.
    fn say_instead(&mut self, window: impl FnOnce() -> Window, meta: Option<Meta>) {
        if self.said.elapsed() >= PACE {
            self.say(&window(), meta);
        }
    }
}
