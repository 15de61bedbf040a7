//! Seats: a corrector of any kind, with its parameters, as one type.

use crate::course::Brief;
use axle_correctors::{ArcCorrector, DCorrector, GCorrector, LtvCorrector, PursuitCorrector, WCorrector};
use axle_schema::contract::{Corrector, Params, Seen, Step};
use axle_schema::{Drive, Plan, Refusal, Seconds, Task, TaskId};
use std::sync::Arc;
use toml::{Table, Value};

/// A parameter that may be tuned, and between what.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Knob {
    /// Its name in the parameter file; `table.name` where it is in a table.
    pub field: &'static str,
    /// The least and the largest value that is tried.
    pub range: (f64, f64),
    /// The value that was set by hand, where every search begins.
    pub hand: f64,
}

/// The correctors of the tournament: each is one line, with the parameters that may be tuned.
#[must_use]
pub fn seats() -> Vec<Seat> {
    vec![
        Seat::of::<DCorrector>("d-corrector", D),
        Seat::of::<GCorrector>("g-corrector", G),
        Seat::of::<WCorrector>("w-corrector", W),
        Seat::of::<ArcCorrector>("arc-corrector", ARC),
        Seat::of::<PursuitCorrector>("pursuit-corrector", PURSUIT),
        Seat::of::<LtvCorrector>("ltv-corrector", LTV),
    ]
}

/// With a pole below 0.6 the D-corrector does not settle in the closed loops with two periods of delay and slow motors.
const D: &[Knob] = &[knob("pole", (0.6, 0.92), 0.7), LEAD];
const G: &[Knob] =
    &[knob("ratio.proportional", (0.0, 1.0), 0.1), knob("ratio.integral", (0.5, 15.0), 5.0), LEAD];
const W: &[Knob] = &[knob("pull", (1.0, 12.0), 5.0), knob("turning", (1.0, 10.0), 4.0), LEAD];
const ARC: &[Knob] = &[knob("sharpening", (1.0, 9.0), 3.0), knob("hump", (0.05, 0.6), 0.25), LEAD];
/// A lookahead of less than 0.3 s is too short for beats of 0.2 s.
const PURSUIT: &[Knob] = &[knob("lookahead", (0.3, 1.5), 0.5), knob("nearest", (0.05, 0.3), 0.12), LEAD];
const LTV: &[Knob] = &[
    knob("along", (0.01, 0.5), 0.06),
    knob("aside", (0.01, 0.5), 0.06),
    knob("heading", (0.05, 2.0), 0.4),
    LEAD,
];
const LEAD: Knob = knob("lead", (0.0, 0.2), 0.06);

const fn knob(field: &'static str, range: (f64, f64), hand: f64) -> Knob {
    Knob { field, range, hand }
}

/// A kind of plan that a course can be told as.
pub trait Told: Sized {
    /// The course as this kind of plan.
    fn of(brief: &Brief) -> Self;
}
impl Told for Drive {
    fn of(brief: &Brief) -> Self {
        brief.drive.clone()
    }
}
impl Told for Plan {
    fn of(brief: &Brief) -> Self {
        brief.plan.clone()
    }
}

/// A corrector at work, whatever its plan is.
pub trait Running {
    /// One beat.
    fn step(&mut self, seen: &Seen) -> Step;
    /// Goes on after the gate had taken the wheels back.
    fn resume(&mut self, seen: &Seen, pause: Seconds);
}
impl<C: Corrector> Running for C {
    fn step(&mut self, seen: &Seen) -> Step {
        Corrector::step(self, seen)
    }
    fn resume(&mut self, seen: &Seen, pause: Seconds) {
        Corrector::resume(self, seen, pause);
    }
}

type Begin = dyn Fn(&Brief, &Seen) -> Result<Box<dyn Running>, Refusal> + Send + Sync;
type Tune = dyn Fn(&[f64]) -> Result<Seat, Refusal> + Send + Sync;

/// A corrector with its parameters.
#[derive(Clone)]
pub struct Seat {
    /// Its name, as in the catalogue of services.
    pub name: &'static str,
    /// The time from beat to beat.
    pub period: Seconds,
    /// What of it may be tuned.
    pub knobs: &'static [Knob],
    /// Its parameters, as its file has them.
    pub params: Table,
    begin: Arc<Begin>,
    tune: Arc<Tune>,
}

impl Seat {
    /// A corrector with its default parameters.
    #[must_use]
    pub fn of<C: Corrector<Plan: Told>>(name: &'static str, knobs: &'static [Knob]) -> Self {
        Self::with::<C>(name, knobs, C::Params::default())
    }

    /// A corrector with parameters of its own.
    #[must_use]
    pub fn with<C: Corrector<Plan: Told>>(
        name: &'static str,
        knobs: &'static [Knob],
        params: C::Params,
    ) -> Self {
        let period = C::period(&params);
        // What has no table (it would be no parameters) is shown and tuned as having none.
        let table = Table::try_from(&params).unwrap_or_default();
        let untuned = table.clone();
        Self {
            name,
            period,
            knobs,
            params: table,
            begin: Arc::new(move |brief, seen| {
                let task = Task { id: TaskId(1), plan: C::Plan::of(brief) };
                Ok(Box::new(C::begin(&params, period, task, seen)?))
            }),
            tune: Arc::new(move |values| {
                let params = turned::<C::Params>(untuned.clone(), knobs, values)?;
                Ok(Self::with::<C>(name, knobs, params))
            }),
        }
    }

    /// Gives the corrector its task.
    ///
    /// # Errors
    /// What the corrector refuses.
    pub fn begin(&self, brief: &Brief, seen: &Seen) -> Result<Box<dyn Running>, Refusal> {
        (self.begin)(brief, seen)
    }

    /// The same corrector with these values of its knobs.
    ///
    /// # Errors
    /// A value that its parameters refuse.
    pub fn tuned(&self, values: &[f64]) -> Result<Self, Refusal> {
        (self.tune)(values)
    }

    /// The same corrector with the values that were set by hand.
    ///
    /// # Errors
    /// None in fact: those are within the bounds of its parameters.
    pub fn by_hand(&self) -> Result<Self, Refusal> {
        let values: Vec<f64> = self.knobs.iter().map(|knob| knob.hand).collect();
        self.tuned(&values)
    }

    /// The values of its knobs.
    #[must_use]
    pub fn values(&self) -> Vec<f64> {
        let value = |knob: &Knob| match knob.field.split_once('.') {
            Some((table, field)) => self.params.get(table)?.get(field)?.as_float(),
            None => self.params.get(knob.field)?.as_float(),
        };
        self.knobs.iter().map(|knob| value(knob).unwrap_or(knob.range.0)).collect()
    }
}

/// Parameters with other values of some fields.
fn turned<P: Params>(mut table: Table, knobs: &[Knob], values: &[f64]) -> Result<P, Refusal> {
    for (knob, value) in knobs.iter().zip(values) {
        let (place, field) = match knob.field.split_once('.') {
            Some((inner, field)) => (table.get_mut(inner).and_then(Value::as_table_mut), field),
            None => (Some(&mut table), knob.field),
        };
        if let Some(place) = place {
            place.insert(field.to_owned(), Value::Float(*value));
        }
    }
    let params: P = table.try_into().map_err(|fault| Refusal::malformed("tuned parameters", fault))?;
    params.check()?;
    Ok(params)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_knob_is_a_field_within_its_range_and_turns_it() {
        for seat in seats() {
            let values = seat.values();
            for (knob, value) in seat.knobs.iter().zip(&values) {
                assert!((knob.range.0..=knob.range.1).contains(value), "{}: {knob:?} is {value}", seat.name);
            }
            for end in [|knob: &Knob| knob.range.0, |knob: &Knob| knob.range.1, |knob: &Knob| knob.hand] {
                let values: Vec<f64> = seat.knobs.iter().map(end).collect();
                let tuned = seat.tuned(&values).expect("the ends of the ranges are allowed");
                assert_eq!(tuned.values(), values);
            }
            let wrong = vec![f64::NAN; seat.knobs.len()];
            assert!(seat.knobs.is_empty() || seat.tuned(&wrong).is_err(), "{}", seat.name);
        }
    }
}
