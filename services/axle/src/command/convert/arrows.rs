//! The arrows of the map: pure functions from JSON to JSON.

use crate::cli::Convert;
use crate::lines::{curve, read, track, words, write};
use axle_schema::motion::Shape;
use axle_schema::refusal::within;
use axle_schema::series::Datum;
use axle_schema::{
    Dwm, EncodersData, EncodersSpan, Metres, MetresPerSecond, NavigatorData, Radians, Seconds, Sides,
    Symmetric, Tolerance, Track,
};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// What a line becomes: further lines, or why not.
type Answer = Result<Vec<String>, String>;

/// A conversion at work; it may remember earlier lines.
pub(super) enum Work {
    /// Each line for itself.
    Each(Box<dyn Fn(&Value) -> Answer>),
    /// A line needs the one before it.
    Series(Box<dyn FnMut(&Value) -> Answer>),
    /// Only all spans together say what each becomes.
    Chain(Vec<EncodersSpan>, fn(&[EncodersSpan]) -> Result<Vec<Dwm>, axle_schema::Refusal>),
}

impl Work {
    /// Takes a line.
    pub(super) fn line(&mut self, value: &Value) -> Answer {
        match self {
            Self::Each(work) => work(value),
            Self::Series(work) => work(value),
            Self::Chain(spans, _) => {
                // An hour at a thousand spans a second.
                if spans.len() >= 3_600_000 {
                    return Err("too many spans for one chain: at most 3600000".into());
                }
                let span: EncodersSpan = read(value)?;
                span.to_dwm().map_err(words)?;
                spans.push(span);
                Ok(Vec::new())
            }
        }
    }
    /// What is left when no line comes any more.
    pub(super) fn end(self) -> Answer {
        match self {
            Self::Each(_) | Self::Series(_) => Ok(Vec::new()),
            Self::Chain(spans, work) => work(&spans).map_err(words)?.iter().map(write).collect(),
        }
    }
}

/// One conversion.
pub(super) struct Arrow {
    pub(super) from: &'static str,
    pub(super) to: &'static str,
    /// What a line holds.
    pub(super) takes: &'static str,
    pub(super) about: &'static str,
    make: fn(&Convert) -> Result<Work, String>,
}

impl Arrow {
    /// The conversion with the options of the command line.
    pub(super) fn work(&self, args: &Convert) -> Result<Work, String> {
        if let Some(track) = args.track {
            Track::new(Metres(track)).map_err(words)?;
        }
        within("--step in s", args.step, 1e-6, 1e6).map_err(words)?;
        for (name, value) in [("position", args.position_tolerance), ("heading", args.heading_tolerance)] {
            within(&format!("--{name}-tolerance"), value, 0.0, 1e6).map_err(words)?;
        }
        (self.make)(args)
    }
}

const DWM: &str = "v0l v0r v1l v1r T";
const DWM_AND_TRACK: &str = "v0l v0r v1l v1r T track";
const SPAN: &str = "duration left right";
const GEOMETRY: &str = "line|turn|arc|spiral|clothoid";

/// Every arrow of the map.
pub(super) const ARROWS: &[Arrow] = &[
    arrow("dwm", "pose", "v0l v0r v1l v1r T track t", "the state at the time t, left out: at the end", pose),
    arrow("dwm", "navigator-span", DWM_AND_TRACK, "the displacement", |args| {
        each(args, |value, track| write(&read::<Dwm>(value)?.navigator_span(track()?)))
    }),
    arrow("dwm", "navigator-data", DWM_AND_TRACK, "poses every --step seconds, for a chart", |args| {
        let step = Seconds(args.step);
        many(args, move |value, track| {
            let dwm: Dwm = read(value)?;
            dwm.poses(NavigatorData::default(), track()?, step).map(|data| write(&data)).collect()
        })
    }),
    arrow("dwm", "encoders-span", DWM, "what encoders count", |args| {
        each(args, |value, _| write(&read::<Dwm>(value)?.encoders_span()))
    }),
    arrow("dwm", "geometry", DWM_AND_TRACK, "the curve it drives, within the tolerances", |args| {
        let tolerance =
            Tolerance { position: Metres(args.position_tolerance), heading: Radians(args.heading_tolerance) };
        each(args, move |value, track| write(&read::<Dwm>(value)?.curve(track()?, tolerance).map_err(words)?))
    }),
    arrow("dwm", "halves", DWM, "left and right", |args| {
        each(args, |value, _| write(&read::<Dwm>(value)?.split()))
    }),
    arrow("halves", "dwm", "left right: v0 v1 T", "both wheels together", |args| each(args, join::<Dwm>)),
    arrow("geometry", "dwm", GEOMETRY, "the normalized movement", |args| {
        each(args, |value, track| write(&curve(value)?.normalized_dwm(track()?).map_err(words)?))
    }),
    arrow("geometry", "navigator-span", GEOMETRY, "the displacement", |args| {
        each(args, |value, _| write(&curve(value)?.navigator_span()))
    }),
    arrow("geometry", "navigator-data", GEOMETRY, "poses every --step of the normalized movement", |args| {
        let step = Seconds(args.step);
        many(args, move |value, track| {
            let poses = curve(value)?.poses(NavigatorData::default().pose, track()?, step).map_err(words)?;
            poses.map(|data| write(&data)).collect()
        })
    }),
    arrow(
        "encoders-span",
        "dwm",
        SPAN,
        "at constant speeds; --speeds: from there; --chain: continuous",
        spans_to_dwm,
    ),
    arrow("encoders-span", "navigator-span", "duration left right track", "the arc", |args| {
        each(args, |value, track| write(&read::<EncodersSpan>(value)?.navigator_span(track()?)))
    }),
    arrow("encoders-span", "halves", SPAN, "left and right", |args| {
        each(args, |value, _| write(&read::<EncodersSpan>(value)?.split()))
    }),
    arrow("halves", "encoders-span", "left right: duration …", "both wheels together", |args| {
        each(args, join::<EncodersSpan>)
    }),
    arrow("encoders-data", "halves", "stamp left right", "left and right", |args| {
        each(args, |value, _| write(&read::<EncodersData>(value)?.split()))
    }),
    arrow("halves", "encoders-data", "left right: stamp …", "both wheels together", |args| {
        each(args, join::<EncodersData>)
    }),
    arrow("encoders-data", "encoders-span", "stamp left right", "spread: from each line to the next", |_| {
        Ok(spread::<EncodersData>())
    }),
    arrow(
        "encoders-span",
        "encoders-data",
        SPAN,
        "accumulate, from --start or 0",
        accumulate::<EncodersData>,
    ),
    arrow("navigator-data", "navigator-span", "stamp pose", "spread: from each line to the next", |_| {
        Ok(spread::<NavigatorData>())
    }),
    arrow(
        "navigator-span",
        "navigator-data",
        "duration x y heading",
        "accumulate, from --start or 0",
        accumulate::<NavigatorData>,
    ),
];

const fn arrow(
    from: &'static str,
    to: &'static str,
    takes: &'static str,
    about: &'static str,
    make: fn(&Convert) -> Result<Work, String>,
) -> Arrow {
    Arrow { from, to, takes, about, make }
}

// ---- Kinds of work ---------------------------------------------------------------------------------------------------

/// Gives the track of the robot: the one of the line, or the one of the command line.
type TrackOf<'a> = &'a dyn Fn() -> Result<Track, String>;

fn each(
    args: &Convert,
    convert: impl Fn(&Value, TrackOf<'_>) -> Result<String, String> + 'static,
) -> Result<Work, String> {
    many(args, move |value, track| convert(value, track).map(|line| vec![line]))
}

#[allow(clippy::unnecessary_wraps, reason = "what makes a work may refuse the command line")]
fn many(args: &Convert, convert: impl Fn(&Value, TrackOf<'_>) -> Answer + 'static) -> Result<Work, String> {
    let otherwise = args.track;
    Ok(Work::Each(Box::new(move |value| convert(value, &|| track(value, otherwise)))))
}

fn spread<D: Datum<Span: Serialize> + DeserializeOwned + 'static>() -> Work {
    let mut last: Option<D> = None;
    Work::Series(Box::new(move |value| {
        let datum: D = read(value)?;
        last.replace(datum).map(|last| write(&last.span_to(&datum))).into_iter().collect()
    }))
}

fn accumulate<D>(args: &Convert) -> Result<Work, String>
where
    D: Datum<Span: DeserializeOwned> + Default + DeserializeOwned + Serialize + 'static,
{
    let start = args.start.as_deref().map(serde_json::from_str::<D>).transpose();
    let mut last = start.map_err(|fault| format!("--start: {fault}"))?.unwrap_or_default();
    let mut first = Some(last);
    Ok(Work::Series(Box::new(move |value| {
        let span: D::Span = read(value)?;
        last = last.after(&span);
        first.take().iter().chain([&last]).map(write).collect()
    })))
}

fn spans_to_dwm(args: &Convert) -> Result<Work, String> {
    if args.chain {
        return Ok(Work::Chain(Vec::new(), |spans| axle_schema::encoders::continuous(spans, None)));
    }
    let Some(speeds) = &args.speeds else {
        return each(args, |value, _| write(&read::<EncodersSpan>(value)?.to_dwm().map_err(words)?));
    };
    let [left, right] = speeds[..] else {
        return Err("--speeds: write two speeds, left,right".into());
    };
    let mut now = Sides::new(MetresPerSecond(left), MetresPerSecond(right));
    Ok(Work::Series(Box::new(move |value| {
        let dwm = read::<EncodersSpan>(value)?.to_dwm_from(now).map_err(words)?;
        now = dwm.end();
        Ok(vec![write(&dwm)?])
    })))
}

fn join<S: Symmetric<Half: DeserializeOwned> + Serialize>(
    value: &Value,
    _: TrackOf<'_>,
) -> Result<String, String> {
    write(&S::join(read(value)?).map_err(words)?)
}

// ---- The state at a time ---------------------------------------------------------------------------------------------

/// When; the other fields of the line are those of the movement.
#[derive(Deserialize)]
struct When {
    t: Option<Seconds>,
}

/// The state of the robot, by the names of the golden vectors.
#[derive(Serialize)]
struct State {
    x: f64,
    y: f64,
    theta: f64,
    v: f64,
    omega: f64,
    path: f64,
    shape: &'static str,
}

fn pose(args: &Convert) -> Result<Work, String> {
    each(args, |value, track| {
        let (dwm, when, track): (Dwm, When, _) = (read(value)?, read(value)?, track()?);
        if dwm.duration().0 <= 0.0 {
            // A movement of no duration is the identity, whatever its speeds.
            within("t in s", when.t.unwrap_or_default().0, 0.0, 0.0).map_err(words)?;
        }
        let t = when.t.unwrap_or(dwm.duration());
        within("t in s", t.0, 0.0, dwm.duration().0).map_err(words)?;
        let motion = dwm.motion_at(track, t);
        let state = State {
            x: motion.x,
            y: motion.y,
            theta: motion.theta,
            v: motion.v,
            omega: motion.omega,
            path: motion.path,
            shape: name(dwm.shape(track)),
        };
        if [state.x, state.y, state.theta, state.v, state.omega, state.path]
            .iter()
            .all(|number| number.is_finite())
        {
            write(&state)
        } else {
            Err("the result is beyond the range of f64".into())
        }
    })
}

const fn name(shape: Shape) -> &'static str {
    match shape {
        Shape::Rest => "rest",
        Shape::Line => "line",
        Shape::Spin => "spin",
        Shape::Circle => "circle",
        Shape::Spiral => "spiral",
        Shape::Clothoid => "clothoid",
    }
}
