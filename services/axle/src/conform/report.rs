//! The report: one line a clause.

use super::clause::{Clause, Finding};
use crate::cli::Conform;
use crate::out::{data, table};
use axle_schema::RobotId;
use axle_schema::differential_drive::DriveState;
use std::fmt::Write as _;

pub(super) struct Report {
    robot: String,
    lines: Vec<(&'static str, &'static str, Finding)>,
}

impl Report {
    /// The contract says that a drive is enabled at first; that can be seen only by whoever comes first.
    pub(super) fn of(robot: &RobotId, before: &DriveState) -> Self {
        let initially = if before.enabled {
            Finding::Pass("it is enabled".into())
        } else {
            let words =
                "it is disabled: wheels that move after a restart without a person's word are not safe";
            Finding::Optional(words.into())
        };
        let text = "Initially the drive should be enabled (a robot of metal had better not be).";
        Self { robot: robot.to_string(), lines: vec![("initially-enabled", text, initially)] }
    }

    pub(super) fn add(&mut self, clause: &Clause, finding: Finding) {
        self.lines.push((clause.name, clause.text, finding));
    }

    fn count(&self, verdict: &str) -> usize {
        self.lines.iter().filter(|(_, _, finding)| finding.verdict() == verdict).count()
    }

    fn summary(&self) -> String {
        let counts =
            ["pass", "fail", "optional", "not offered"].map(|verdict| (self.count(verdict), verdict));
        counts.map(|(count, verdict)| format!("{count} {verdict}")).join(", ")
    }

    fn markdown(&self) -> String {
        let mut text =
            format!("# The Generic Differential Drive of {}\n\n{}.\n\n", self.robot, self.summary());
        text.push_str("| clause | verdict | what the contract says | what was seen |\n|---|---|---|---|\n");
        for (name, says, finding) in &self.lines {
            // Words of a drive may hold anything; a bar or a line break would end the cell.
            let seen: String =
                finding.detail().chars().map(|c| if c == '|' || c.is_control() { ' ' } else { c }).collect();
            let _ = writeln!(text, "| {name} | {} | {says} | {seen} |", finding.verdict());
        }
        text
    }

    pub(super) fn print(&self, args: &Conform) -> anyhow::Result<()> {
        if let Some(file) = &args.markdown {
            std::fs::write(file, self.markdown())
                .map_err(|fault| anyhow::anyhow!("cannot write {}: {fault}", file.display()))?;
        }
        if args.json {
            for (name, says, finding) in &self.lines {
                let line = serde_json::json!({
                    "robot": self.robot, "clause": name, "verdict": finding.verdict(), "contract": says,
                    "seen": finding.detail(),
                });
                data(&line.to_string())?;
            }
        } else {
            let rows = self.lines.iter().map(|(name, _, finding)| {
                vec![(*name).to_owned(), finding.verdict().to_owned(), finding.detail().to_owned()]
            });
            table(&["clause", "verdict", "seen"], rows)?;
            data(&self.summary())?;
        }
        let failed: Vec<_> = self
            .lines
            .iter()
            .filter(|(_, _, finding)| matches!(finding, Finding::Fail(_)))
            .map(|(name, _, _)| *name)
            .collect();
        anyhow::ensure!(
            failed.is_empty(),
            "{} of the contract's clauses do not hold: {}",
            failed.len(),
            failed.join(", ")
        );
        Ok(())
    }
}
