//! `axle tournament --tune NAME`: looks for better gains on training seeds, and reports on seeds that it has not seen.
//!
//! The search begins at values that were set by hand, whatever is shipped; so the same command finds the same values, and
//! what is found can be found again. Beside the scenarios, unless some are chosen, it drives trials: robots that are slow in
//! several ways, on which quick gains hunt.

use super::{Args, build, play, players};
use crate::out::{data, note, usage};
use anyhow::Context as _;
use axle_sim::{EVALUATIONS, Interval, Run, Seat, TRIALS, cost, minimise};
use std::cell::RefCell;

/// How often each course is driven in each scenario for one try, and for the report how many times as often.
const RUNS: u16 = 1;
const REPORT: u16 = 10;
/// The seeds of the report are as far from those of the training as can be.
const OTHERS: u64 = 1 << 63;

pub(super) fn tune(args: &Args, name: &str) -> anyhow::Result<()> {
    let seat = players(&[name.to_owned()])
        .map_err(|fault| usage(fault.to_string().replace("--only", "--tune")))?
        .pop()
        .context("a corrector")?;
    if seat.knobs.is_empty() {
        return Err(usage(format!("--tune {name}: it has no gains that could be tuned")));
    }
    let runs = args.runs.unwrap_or(RUNS);
    let played = |seat: &Seat, runs: u16, seed: u64, what: &'static str| -> anyhow::Result<Vec<Run>> {
        let mut tournament = build(args, vec![seat.clone()], runs, seed)?;
        if args.scenarios.is_empty() {
            tournament.scenarios.extend(TRIALS);
        }
        play(&tournament, args, what)
    };
    // The search knows of costs only; the first thing that goes wrong is kept for the end.
    let fault = RefCell::new(None);
    let tries = RefCell::new(0);
    let evaluate = |values: &[f64]| {
        let tried = seat.tuned(values).map_err(Into::into);
        let costs = tried.and_then(|seat| played(&seat, runs, args.seed, "tuning"));
        let cost = costs.as_deref().map_or(f64::MAX, cost);
        *tries.borrow_mut() += 1;
        note(&format!("try {}: {}: cost {cost:.4}", tries.borrow(), named(&seat, values)));
        if let Err(wrong) = costs {
            fault.borrow_mut().get_or_insert(wrong);
        }
        cost
    };
    let by_hand = seat.by_hand()?;
    let (found, trained) = minimise(seat.knobs, &by_hand.values(), evaluate);
    if let Some(fault) = fault.into_inner() {
        return Err(fault.context("tuning"));
    }
    let found: Vec<f64> = found.iter().map(|value| (value * 1e3).round() / 1e3).collect();
    let tuned = seat.tuned(&found)?;
    let reported = |seat: &Seat, what| played(seat, runs.saturating_mul(REPORT), args.seed ^ OTHERS, what);
    let (before, after, shipped) =
        (reported(&by_hand, "by hand")?, reported(&tuned, "found")?, reported(&seat, "shipped")?);
    let head = format!(
        "# {name}: {}, found by `axle tournament --tune {name} --runs {runs} --seed {}` in {} tries of at most {EVALUATIONS}.\n\
         # Cost on the training seeds: {trained:.4}. On other seeds:\n\
         # found {:.4}; {}\n\
         # found {:.4}; {}",
        named(&seat, &found),
        args.seed,
        tries.borrow(),
        cost(&after),
        compared("by hand", &by_hand, (&before, &after), args.seed),
        cost(&after),
        compared("shipped", &seat, (&shipped, &after), args.seed),
    );
    data(&head)?;
    Ok(data(toml::to_string(&tuned.params)?.trim_end())?)
}

/// The names and values of the knobs.
fn named(seat: &Seat, values: &[f64]) -> String {
    let knobs = seat.knobs.iter().zip(values);
    knobs.map(|(knob, value)| format!("{} {value:.3}", knob.field)).collect::<Vec<_>>().join(", ")
}

/// How much less what was found costs than other values, run by run.
fn compared(what: &str, seat: &Seat, (before, after): (&[Run], &[Run]), seed: u64) -> String {
    let one = |run: &Run| cost(std::slice::from_ref(run));
    let gained: Vec<f64> = before.iter().zip(after).map(|(before, after)| one(before) - one(after)).collect();
    let gain = Interval::of(&gained, seed);
    let verdict = if gain.low > 0.0 {
        "better, beyond doubt"
    } else if gain.high < 0.0 {
        "worse, beyond doubt"
    } else {
        "they cannot be told apart"
    };
    format!(
        "{what} ({}) {:.4}; less by {:.4} [{:.4}, {:.4}] with 95 %: {verdict}.",
        named(seat, &seat.values()),
        cost(before),
        gain.mean,
        gain.low,
        gain.high,
    )
}
