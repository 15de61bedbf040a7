//! Navigator as a process: hears the newest measurements, says where the robot is and what is not as it should be.
//!
//! One that starts anew asks Source for the last position that was said and for what was measured since then, and goes on
//! from there. Without a Source that remembers, or after the robot itself has restarted, it begins at `start`.

use super::Context;
use super::tracer::{Tracer, setting};
use crate::params::load;
use axle_mesh::{Heard, Mesh, Publisher, Retry};
use axle_navigator::{Event, Navigator, NavigatorParams};
use axle_schema::meta::Cause;
use axle_schema::trace::Named;
use axle_schema::window::{Window, WindowAsk};
use axle_schema::{
    GetPosition, NavigatorData, NavigatorEvent, Pose, Position, Refusal, RobotId, Seconds, SetPosition, key,
};
use std::time::Duration;
use tokio::time::{Instant, MissedTickBehavior, interval};

/// How long Source has to answer before the navigator begins without it.
const PATIENCE: Duration = Duration::from_millis(500);
/// From one look at the silence to the next.
const LOOK: Duration = Duration::from_millis(100);
/// The position is said so often, in s of the robot's clock, and whenever a fix has moved it.
const PACE: f64 = 0.1;

/// Integrates until it is told to stop.
pub(crate) async fn run(mut context: Context) -> anyhow::Result<()> {
    let params: NavigatorParams = load(context.params.as_deref())?;
    let robot = context.one_robot()?;
    let mesh = &context.mesh;
    // Each window repeats the measurements of the last moments, so that a lost one is made up for by the next.
    let recent = mesh.inbox(&key::RECENT.of(&robot), 16)?;
    let gets = mesh.server::<GetPosition, Position>(&key::GET_POSITION.of(Some(&robot)))?;
    let sets = mesh.server::<SetPosition, Position>(&key::SET_POSITION.of(Some(&robot)))?;
    let mut post = Post {
        navigator: Navigator::new(params.clone())?,
        pose: mesh.publisher(&key::POSE.of(&robot))?,
        position: mesh.publisher(&key::POSITION.of(&robot))?,
        events: mesh.publisher(&key::NAVIGATOR_EVENT.of(&robot))?,
        tracer: Tracer::new(mesh, &robot, context.service, setting(&params, None))?,
        said: None,
        heard: Instant::now(),
    };
    let _visible = context.ready()?;
    tokio::select! {
        () = post.resume(mesh, &robot, params) => {}
        () = context.stop.wait() => return Ok(()),
    }
    let mut look = interval(LOOK);
    look.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            heard = recent.next() => post.hear(heard),
            asked = gets.next() => {
                let answer = asked.question().and_then(|_| post.position());
                asked.reply(answer);
            }
            asked = sets.next() => {
                let answer = asked.question().and_then(|set| post.set(&set));
                asked.reply(answer);
            }
            _ = look.tick() => post.look(),
            () = context.stop.wait() => return Ok(()),
        }
    }
}

/// A navigator and what it says.
struct Post {
    navigator: Navigator,
    pose: Publisher<NavigatorData>,
    position: Publisher<Position>,
    events: Publisher<NavigatorEvent>,
    tracer: Tracer,
    /// When the position was said last, by the robot's clock, and how `odom` lay in `map`.
    said: Option<(Seconds, Pose)>,
    heard: Instant,
}

impl Post {
    /// Goes on from where the last navigator was.
    async fn resume(&mut self, mesh: &Mesh, robot: &RobotId, params: NavigatorParams) {
        let asked =
            mesh.ask(&key::WINDOW, Some(robot), &WindowAsk::default(), PATIENCE, Retry::Idempotent).await;
        let window: Window = match asked {
            Ok(window) => window,
            Err(refusal) => {
                tracing::info!("begins at its start: {refusal}");
                return;
            }
        };
        let Some(position) = window.position.filter(|position| position.boot == window.boot) else { return };
        match Navigator::resume(params, &position, &window) {
            Ok(navigator) => {
                tracing::info!("goes on from the position of {}", position.wheels.stamp);
                self.navigator = navigator;
                // What it knows from before is no sample: a replay cannot begin here.
                self.tracer.goes_on();
                // What it concludes from the past was said by the one before.
                drop((self.navigator.events(), self.navigator.innovations()));
            }
            Err(refusal) => tracing::warn!("begins at its start, since the last position is none: {refusal}"),
        }
    }

    fn hear(&mut self, heard: Heard<Window>) {
        self.heard = Instant::now();
        let cause = heard.meta.map(|meta| Cause { source: meta.source, seq: meta.seq });
        let newest = self.navigator.hear(&heard.message);
        drop(self.navigator.innovations());
        self.notice(cause);
        self.tracer.took(key::RECENT.port(), heard.meta);
        let said = newest.map(|data| self.pose.put(&data, cause));
        let is_new = said.is_some();
        let sample = said.as_ref().and_then(|said| said.as_ref().ok());
        self.tracer.said(sample.map(|sample| Named::new(key::POSE.port(), *sample)));
        if let Some(said) = said {
            warn("the pose", said);
        }
        if is_new {
            self.place(cause);
        }
    }

    /// Nothing may have come for a while.
    fn look(&mut self) {
        self.navigator.wait(Seconds(self.heard.elapsed().as_secs_f64()));
        self.notice(None);
    }

    fn notice(&mut self, cause: Option<Cause>) {
        for event in self.navigator.events() {
            self.say(event, cause);
        }
    }

    fn say(&self, event: Event, cause: Option<Cause>) {
        tracing::warn!("{event}");
        let event = NavigatorEvent::new(event, self.navigator.stops(&event));
        warn("an event", self.events.put(&event, cause));
    }

    /// Says the position, if it is time or if a fix has moved it.
    fn place(&mut self, cause: Option<Cause>) {
        let Ok(position) = self.position() else { return };
        let now = position.wheels.stamp;
        let is_due = self.said.is_none_or(|(at, origin)| {
            now < at || (now - at).0 >= PACE || origin.distance(position.map_to_odom).0 > 1e-3
        });
        if is_due {
            self.said = Some((now, position.map_to_odom));
            warn("the position", self.position.put(&position, cause));
        }
    }

    fn position(&self) -> Result<Position, Refusal> {
        let hint = "none were heard; are `axle run source` and the robot up?";
        self.navigator.position().ok_or_else(|| Refusal::unavailable("encoders", hint))
    }

    fn set(&mut self, set: &SetPosition) -> Result<Position, Refusal> {
        let stamp = set.stamp.or_else(|| self.navigator.newest()).unwrap_or(Seconds::ZERO);
        // Without a reading there is nothing yet that the pose could be the pose of.
        self.position()?;
        self.navigator.set_position(stamp, set.pose, &set.covariance())?;
        // A question has no name by which a replay could find it.
        self.tracer.took(key::SET_POSITION.port(), None);
        tracing::info!("the position was set");
        self.said = None;
        self.place(None);
        self.position()
    }
}

fn warn(what: &str, said: Result<Cause, Refusal>) {
    if let Err(refusal) = said {
        tracing::warn!("{what} could not be said: {refusal}");
    }
}
