//! Source as a process: hears measurements, says the newest, answers for older ones.

use super::Context;
use crate::params::load;
use axle_schema::key;
use axle_schema::meta::Cause;
use axle_schema::window::{Window, WindowAsk};
use axle_source::{Source, SourceParams};

/// How many measurements may wait: Source takes them as they come.
const WAITING: usize = 256;

/// Buffers until it is told to stop.
pub(crate) async fn run(mut context: Context) -> anyhow::Result<()> {
    let params: SourceParams = load(context.params.as_deref())?;
    let robot = context.one_robot()?;
    let mesh = &context.mesh;
    let encoders = mesh.inbox(&key::ENCODERS.of(&robot), WAITING)?;
    let inertial = mesh.inbox(&key::INERTIAL.of(&robot), WAITING)?;
    let fixes = mesh.inbox(&key::FIX.of(&robot), WAITING)?;
    let recent = mesh.publisher(&key::RECENT.of(&robot))?;
    let windows = mesh.server::<WindowAsk, Window>(&key::WINDOW.of(Some(&robot)))?;
    let _visible = context.ready()?;
    let span = params.recent;
    let mut source = Source::new(&params)?;
    loop {
        tokio::select! {
            heard = encoders.next() => {
                source.take_encoders(heard.meta, heard.message);
                // Encoders set the pace: what else came since is in the same window.
                let cause = heard.meta.map(|meta| Cause { source: meta.source, seq: meta.seq });
                if let Err(refusal) = recent.put(&source.recent(span), cause) {
                    tracing::warn!("the newest measurements could not be said: {refusal}");
                }
            }
            heard = inertial.next() => source.take_inertial(heard.meta, heard.message),
            heard = fixes.next() => source.take_fix(heard.meta, heard.message),
            asked = windows.next() => {
                let answer = asked.question().and_then(|ask| source.window(&ask));
                asked.reply(answer);
            }
            () = context.stop.wait() => return Ok(()),
        }
    }
}
