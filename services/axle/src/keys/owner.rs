//! Whose certificate it is: a service of a robot, the router or the page of a computer, or a person with a role.

use crate::catalog::{self, Scope};
use axle_schema::RobotId;
use axle_schema::id::ALL;
use clap::ValueEnum;
use serde::{Deserialize, Serialize};
use std::fmt;

/// What an owner may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Role {
    /// What its wires in the catalogue say
    #[value(skip)]
    Service,
    /// Carries what others say
    #[value(skip)]
    Router,
    /// Is shown to browsers
    #[value(skip)]
    Page,
    /// Hears everything and says nothing: taps
    Viewer,
    /// Gives tasks, drives by the contract, stops and enables
    Operator,
    /// An operator that may also hold the gate: programs of one's own that command the wheels
    Commander,
}

impl Role {
    /// How certificates and tables name it.
    pub(crate) const fn word(self) -> &'static str {
        match self {
            Self::Service => "service",
            Self::Router => "router",
            Self::Page => "page",
            Self::Viewer => "viewer",
            Self::Operator => "operator",
            Self::Commander => "commander",
        }
    }
}

/// An owner of certificates.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Owner {
    /// `d-corrector@r1`, `pathfinder@all`.
    Service { kind: &'static str, robot: Option<RobotId> },
    /// `router@onboard`.
    Router { host: String },
    /// `page@onboard`.
    Page { host: String },
    /// `ann`.
    Person { name: String },
}

impl fmt::Display for Owner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Service { kind, robot } => {
                write!(f, "{kind}@{}", robot.as_ref().map_or(ALL, RobotId::as_str))
            }
            Self::Router { host } => write!(f, "router@{host}"),
            Self::Page { host } => write!(f, "page@{host}"),
            Self::Person { name } => f.write_str(name),
        }
    }
}

impl Owner {
    /// Reads `d-corrector@r1`, `pathfinder@all`, `router@onboard`, `page@onboard` or `ann`.
    ///
    /// # Errors
    /// Says which of these it cannot be, and why.
    pub(crate) fn parse(text: &str) -> anyhow::Result<Self> {
        let is_name = |name: &str| {
            (1..=64).contains(&name.len())
                && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte))
                && !name.starts_with('.')
        };
        let shown: String = text.chars().take(80).collect();
        let Some((kind, of)) = text.split_once('@') else {
            anyhow::ensure!(
                is_name(text),
                "{shown:?} is no name: 1 to 64 letters, digits, - _ . for a person; SERVICE@ROBOT for a service; \
                 router@HOST for a router, page@HOST for the page of a browser"
            );
            return Ok(Self::Person { name: text.to_owned() });
        };
        if kind == "router" || kind == "page" {
            anyhow::ensure!(is_name(of), "{shown:?}: write {kind}@HOST with a host of the topology");
            let host = of.to_owned();
            return Ok(if kind == "router" { Self::Router { host } } else { Self::Page { host } });
        }
        let entry = catalog::find(kind)
            .ok_or_else(|| anyhow::anyhow!("{shown:?}: unknown service; known: {}", catalog::names()))?;
        let robot = if of == ALL { None } else { Some(RobotId::new(of)?) };
        anyhow::ensure!(
            entry.scope == Scope::AllRobots || robot.is_some(),
            "{shown:?}: {kind} works for one robot; write {kind}@r1"
        );
        Ok(Self::Service { kind: entry.name, robot })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_owner_is_read_back_and_a_wrong_one_is_refused_by_name() {
        for text in [
            "d-corrector@r1",
            "pathfinder@all",
            "pathfinder@r1",
            "router@onboard",
            "page@onboard",
            "ann",
            "ann.b-2",
        ] {
            assert_eq!(Owner::parse(text).expect(text).to_string(), text);
        }
        for (text, words) in [
            ("parrot@r1", "unknown service"),
            ("d-corrector@all", "works for one robot"),
            ("d-corrector@R 1", "robot"),
            ("router@../x", "router@HOST"),
            ("../x", "is no name"),
            ("ann~2", "is no name"),
            ("", "is no name"),
        ] {
            let fault = format!("{:#}", Owner::parse(text).expect_err(text));
            assert!(fault.contains(words), "{text:?}: {fault}");
        }
    }
}
