//! `axle tournament --tune NAME`: looks for better gains on training seeds, and reports on seeds that it has not seen.

use super::{Args, build, play, players};
use crate::out::{data, note, usage};
use anyhow::Context as _;
use axle_sim::{EVALUATIONS, Interval, Run, Seat, cost, minimise};
use std::cell::RefCell;

/// How often each course is driven in each scenario for one try.
const RUNS: u16 = 3;
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
    let played = |seat: &Seat, seed: u64, what: &'static str| -> anyhow::Result<Vec<Run>> {
        play(&build(args, vec![seat.clone()], runs, seed)?, args, what)
    };
    // The search knows of costs only; the first thing that goes wrong is kept for the end.
    let fault = RefCell::new(None);
    let tries = RefCell::new(0);
    let evaluate = |values: &[f64]| {
        let costs =
            seat.tuned(values).map_err(Into::into).and_then(|seat| played(&seat, args.seed, "tuning"));
        let cost = costs.as_deref().map_or(f64::MAX, cost);
        let knobs = seat.knobs.iter().zip(values).map(|(knob, value)| format!("{} {value:.4}", knob.field));
        *tries.borrow_mut() += 1;
        note(&format!("try {}: {}: cost {cost:.4}", tries.borrow(), knobs.collect::<Vec<_>>().join(", ")));
        if let Err(wrong) = costs {
            fault.borrow_mut().get_or_insert(wrong);
        }
        cost
    };
    let begin = seat.values();
    let (found, trained) = minimise(seat.knobs, &begin, evaluate);
    if let Some(fault) = fault.into_inner() {
        return Err(fault.context("tuning"));
    }
    let found: Vec<f64> = found.iter().map(|value| (value * 1e3).round() / 1e3).collect();
    let tuned = seat.tuned(&found)?;
    let others = args.seed ^ OTHERS;
    let (before, after) = (played(&seat, others, "before")?, played(&tuned, others, "after")?);
    let gained: Vec<f64> = before
        .iter()
        .zip(&after)
        .map(|(before, after)| cost(std::slice::from_ref(before)) - cost(std::slice::from_ref(after)))
        .collect();
    let gain = Interval::of(&gained, args.seed);
    let verdict = if gain.low > 0.0 {
        "better, beyond doubt"
    } else if gain.high < 0.0 {
        "worse, beyond doubt: keep the parameters that you have"
    } else {
        "cannot be told from before"
    };
    let report = format!(
        "# {name}, tuned by `axle tournament --tune {name} --runs {runs} --seed {}`, {} tries of at most {EVALUATIONS}.\n\
         # Cost on the training seeds: {trained:.4}. On others: {:.4} before, {:.4} after;\n\
         # less by {:.4} [{:.4}, {:.4}] with 95 %: {verdict}.",
        args.seed,
        tries.borrow(),
        cost(&before),
        cost(&after),
        gain.mean,
        gain.low,
        gain.high,
    );
    data(&report)?;
    Ok(data(toml::to_string(&tuned.params)?.trim_end())?)
}
