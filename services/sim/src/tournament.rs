//! The tournament: every corrector on every course in every scenario, many times, and what follows from it.

use crate::course::{Brief, Course};
use crate::metrics::METRICS;
use crate::run::{Ending, Run, run};
use crate::scenario::Scenario;
use crate::seat::Seat;
use crate::statistics::Interval;
use axle_emulator::Random;
use axle_schema::Refusal;

/// The name of all courses, or of all scenarios, together.
pub const ALL: &str = "all";

/// What is played.
#[derive(Clone)]
pub struct Tournament {
    /// Who plays.
    pub seats: Vec<Seat>,
    /// On which courses.
    pub courses: Vec<&'static Course>,
    /// In which scenarios.
    pub scenarios: Vec<&'static Scenario>,
    /// How often each on each in each.
    pub runs: usize,
    /// What all accidents come from.
    pub seed: u64,
}

/// A measure over some runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Its mean.
    pub mean: Interval,
    /// How much worse than the best corrector, run by run: 0 for the best one.
    pub behind: Interval,
}

/// How one corrector did on one course in one scenario, or on all of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The corrector.
    pub corrector: &'static str,
    /// The course, or [`ALL`].
    pub course: &'static str,
    /// The scenario, or [`ALL`].
    pub scenario: &'static str,
    /// How many runs.
    pub runs: usize,
    /// The measures, in the order of [`METRICS`].
    pub estimates: [Estimate; METRICS.len()],
    /// The reason that most of the runs without success have in common, if they say one.
    pub failure: Option<String>,
}

/// Where a job belongs.
#[derive(Clone, Copy)]
struct Place {
    course: usize,
    scenario: usize,
    seat: usize,
    run: usize,
}

impl Tournament {
    /// How many runs there are.
    #[must_use]
    pub const fn jobs(&self) -> usize {
        self.courses.len() * self.scenarios.len() * self.seats.len() * self.runs
    }

    /// Plays one run: jobs are numbered from 0, and none depends on another.
    ///
    /// # Errors
    /// What a planner or the simulation refuses.
    pub fn play(&self, job: usize) -> Result<Run, Refusal> {
        let place = self.place(job);
        let world = self.scenarios[place.scenario].world(self.seed_of(place));
        run(&self.seats[place.seat], &self.brief(job)?, &world)
    }

    /// What is driven in a run.
    ///
    /// # Errors
    /// What a planner refuses.
    pub fn brief(&self, job: usize) -> Result<Brief, Refusal> {
        let place = self.place(job);
        self.courses[place.course].brief(self.seed_of(place))
    }

    fn place(&self, job: usize) -> Place {
        let (rest, run) = (job / self.runs, job % self.runs);
        let (rest, seat) = (rest / self.seats.len(), rest % self.seats.len());
        Place { course: rest / self.scenarios.len(), scenario: rest % self.scenarios.len(), seat, run }
    }

    const fn job(&self, Place { course, scenario, seat, run }: Place) -> usize {
        ((course * self.scenarios.len() + scenario) * self.seats.len() + seat) * self.runs + run
    }

    /// All correctors have the same accidents, and what else takes part does not change them: the seed is made of names.
    fn seed_of(&self, place: Place) -> u64 {
        let names = [self.courses[place.course].name, self.scenarios[place.scenario].name];
        let mut seed = self.seed;
        for byte in names.iter().flat_map(|name| name.bytes().chain([0])) {
            seed = Random::new(seed ^ u64::from(byte), 0).bits();
        }
        Random::new(seed, place.run as u64).bits()
    }

    /// What follows from all runs, in the order of the jobs: each course in each scenario, then all courses in each
    /// scenario, then all in all, where there are several; the correctors side by side. The last rows are the widest.
    #[must_use]
    pub fn rows(&self, runs: &[Run]) -> Vec<Row> {
        let (courses, scenarios) = (0..self.courses.len(), 0..self.scenarios.len());
        let mut rows = Vec::new();
        for course in courses.clone() {
            for scenario in scenarios.clone() {
                rows.extend(self.compare(runs, course..course + 1, scenario..scenario + 1));
            }
        }
        // Of one course there is nothing to sum up, nor of one scenario.
        if courses.len() > 1 {
            for scenario in scenarios.clone() {
                rows.extend(self.compare(runs, courses.clone(), scenario..scenario + 1));
            }
        }
        if scenarios.len() > 1 {
            rows.extend(self.compare(runs, courses, scenarios));
        }
        rows
    }

    /// One row for each corrector, over these courses and scenarios.
    fn compare(&self, all: &[Run], courses: Range, scenarios: Range) -> Vec<Row> {
        let of_seat = |seat: usize| -> Vec<&Run> {
            let cells = courses.clone().flat_map(|c| scenarios.clone().map(move |s| (c, s)));
            let places = cells.flat_map(|(course, scenario)| {
                (0..self.runs).map(move |run| Place { course, scenario, seat, run })
            });
            places.filter_map(|place| all.get(self.job(place))).collect()
        };
        let runs: Vec<Vec<&Run>> = (0..self.seats.len()).map(of_seat).collect();
        let of_metric = |metric: usize| self.estimates(&runs, metric);
        let estimates: Vec<Vec<Estimate>> = (0..METRICS.len()).map(of_metric).collect();
        let course = if courses.len() == 1 { self.courses[courses.start].name } else { ALL };
        let scenario = if scenarios.len() == 1 { self.scenarios[scenarios.start].name } else { ALL };
        let row = |(seat, runs): (usize, &Vec<&Run>)| Row {
            corrector: self.seats[seat].name,
            course,
            scenario,
            runs: runs.len(),
            estimates: std::array::from_fn(|metric| estimates[metric][seat]),
            failure: failure(runs),
        };
        runs.iter().enumerate().map(row).collect()
    }

    /// A measure of every corrector, and how far each is behind the best, pair by pair.
    fn estimates(&self, runs: &[Vec<&Run>], metric: usize) -> Vec<Estimate> {
        let sign = if METRICS[metric].more { -1.0 } else { 1.0 };
        let values: Vec<Vec<f64>> =
            runs.iter().map(|runs| runs.iter().map(|run| run.values[metric]).collect()).collect();
        let means: Vec<Interval> = values.iter().map(|values| Interval::of(values, self.seed)).collect();
        let better = |a: &usize, b: &usize| (sign * means[*a].mean).total_cmp(&(sign * means[*b].mean));
        let Some(best) = (0..values.len()).min_by(better).map(|best| values[best].clone()) else {
            return Vec::new();
        };
        let behind = |values: &Vec<f64>| {
            let pairs = values.iter().zip(&best);
            let differences: Vec<f64> = pairs.map(|(value, best)| sign * (value - best)).collect();
            Interval::of(&differences, self.seed)
        };
        let estimates = values.iter().zip(means.iter());
        estimates.map(|(values, mean)| Estimate { mean: *mean, behind: behind(values) }).collect()
    }
}

type Range = std::ops::Range<usize>;

/// The most frequent reason of those runs that did not succeed.
fn failure(runs: &[&Run]) -> Option<String> {
    let mut reasons: Vec<(String, usize)> = Vec::new();
    for run in runs {
        let why = match &run.ending {
            Ending::Done => continue,
            Ending::Failed(refusal) => unnumbered(&refusal.to_string()),
            Ending::Late => "it came to no end".to_owned(),
        };
        match reasons.iter_mut().find(|(reason, _)| *reason == why) {
            Some((_, count)) => *count += 1,
            None => reasons.push((why, 1)),
        }
    }
    // The first one of the most frequent, whatever the order of threads was.
    let most = reasons.iter().map(|&(_, count)| count).max()?;
    reasons.into_iter().find(|&(_, count)| count == most).map(|(why, _)| why)
}

/// A reason without its numbers, so that those of several runs can be counted as one.
fn unnumbered(why: &str) -> String {
    let mut text = String::new();
    let mut in_number = false;
    for letter in why.chars() {
        let digit = letter.is_ascii_digit() || (in_number && letter == '.');
        if !digit {
            text.push(letter);
        } else if !in_number {
            text.push('…');
        }
        in_number = digit;
    }
    text
}
