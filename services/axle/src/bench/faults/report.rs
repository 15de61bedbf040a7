//! What came of each fault, as a table or as JSON.

use super::scenario::Scenario;
use crate::out::{data, note, table};

/// What came of a fault.
#[derive(Clone, Debug)]
pub(super) struct Outcome {
    pub(super) name: &'static str,
    pub(super) seed: u64,
    /// What must not have been.
    pub(super) violations: Vec<String>,
    /// Why it could not be tried.
    pub(super) skipped: Option<String>,
    /// What the person at the terminal was told last.
    pub(super) told: String,
    /// From the fault to braking, in ms.
    pub(super) brake: Option<f64>,
    /// From the fault to the word that the process has gone, in ms.
    pub(super) known: Option<f64>,
    /// When the fault was over, in s.
    pub(super) healed: Option<f64>,
    /// From then to the first pose at the workstation, in ms.
    pub(super) resumed: Option<f64>,
    /// The oldest command that was obeyed, in ms, and how many were judged.
    pub(super) oldest: f64,
    pub(super) judged: usize,
    /// What commands lost to stuck taps, in ms.
    pub(super) slower: Option<f64>,
    /// What else was found.
    pub(super) figure: Option<String>,
}

impl Outcome {
    pub(super) const fn of(scenario: &Scenario, seed: u64) -> Self {
        Self {
            name: scenario.name,
            seed,
            violations: Vec::new(),
            skipped: None,
            told: String::new(),
            brake: None,
            known: None,
            healed: None,
            resumed: None,
            oldest: 0.0,
            judged: 0,
            slower: None,
            figure: None,
        }
    }
    /// One that could not be tried.
    pub(super) fn skipped(scenario: &Scenario, seed: u64, why: &anyhow::Error) -> Self {
        Self { skipped: Some(format!("{why:#}")), ..Self::of(scenario, seed) }
    }
    /// One on which nothing could be judged.
    pub(super) fn broken(scenario: &Scenario, seed: u64, why: &anyhow::Error) -> Self {
        Self { violations: vec![format!("{why:#}")], ..Self::of(scenario, seed) }
    }
    const fn verdict(&self) -> &'static str {
        match (&self.skipped, self.violations.is_empty()) {
            (Some(_), _) => "skipped",
            (None, true) => "ok",
            (None, false) => "FAILED",
        }
    }
    fn json(&self) -> serde_json::Value {
        serde_json::json!({
            "name": self.name, "seed": self.seed, "verdict": self.verdict(), "violations": self.violations,
            "skipped": self.skipped, "told": self.told, "brake_ms": self.brake, "known_ms": self.known,
            "resumed_ms": self.resumed, "oldest_obeyed_ms": self.oldest, "commands_judged": self.judged,
            "command_p99_slower_ms": self.slower, "figure": self.figure,
        })
    }
    fn row(&self) -> Vec<String> {
        let ms = |value: Option<f64>| value.map_or_else(String::new, |ms| format!("{ms:.0}"));
        let figure = self.figure.as_deref().or(self.skipped.as_deref());
        let words = figure.unwrap_or(&self.told);
        let short: String = words.chars().take(90).collect();
        let age = if self.judged > 0 { format!("{:.0}", self.oldest) } else { String::new() };
        [self.name.to_owned(), self.seed.to_string(), self.verdict().to_owned()]
            .into_iter()
            .chain([ms(self.brake), ms(self.known), ms(self.resumed), age, short])
            .collect()
    }
}

/// The value that a share of the values does not exceed; 0 of none.
pub(in crate::bench) fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "an index"
    )]
    let index = (sorted.len().saturating_sub(1) as f64 * share).ceil() as usize;
    sorted.get(index).copied().unwrap_or(0.0)
}

/// Tells what came of one as soon as it is known.
pub(super) fn say(outcome: &Outcome, json: bool) -> anyhow::Result<()> {
    if json {
        data(&outcome.json().to_string())?;
    }
    note(&format!("{:<28} {}", outcome.name, outcome.verdict()));
    for violation in &outcome.violations {
        note(&format!("    {violation}"));
    }
    Ok(())
}

/// The table of all.
///
/// # Errors
/// How many failed.
pub(super) fn sum_up(outcomes: &[Outcome], json: bool) -> anyhow::Result<()> {
    if !json {
        let head = [
            "fault",
            "seed",
            "",
            "brake ms",
            "known ms",
            "resumed ms",
            "oldest ms",
            "what was told or found",
        ];
        table(&head, outcomes.iter().map(Outcome::row))?;
    }
    let count = |verdict: &str| outcomes.iter().filter(|outcome| outcome.verdict() == verdict).count();
    let judged: usize = outcomes.iter().map(|outcome| outcome.judged).sum();
    let sum = format!(
        "{} faults: {} ok, {} failed, {} skipped; {judged} obeyed commands were judged",
        outcomes.len(),
        count("ok"),
        count("FAILED"),
        count("skipped")
    );
    note(&sum);
    anyhow::ensure!(count("FAILED") == 0, "{sum}");
    Ok(())
}
