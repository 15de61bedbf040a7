//! Topologies: which services run on which computer, for which robot, with which parameters.

mod wiring;

pub(crate) use wiring::{Node, Wire, check_inputs};

use crate::catalog::{self, Scope};
use crate::out::usage;
use axle_schema::contract::Bounds as _;
use axle_schema::{Drivetrain, RobotId};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The topology that `axle up` and `axle demo` start from: one emulated robot and its planners on one computer.
pub(crate) const DEFAULT: &str = include_str!("../../../deploy/topologies/demo.toml");

/// The most services of one topology.
const MAX_SERVICES: usize = 256;

/// A topology file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Topology {
    /// The computers.
    pub(crate) hosts: BTreeMap<String, Host>,
    /// The robots.
    #[serde(default)]
    pub(crate) robots: BTreeMap<RobotName, Drivetrain>,
    /// The services, in the order in which they are started.
    pub(crate) services: Vec<Service>,
}

/// A robot's name as a key of the file.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(transparent)]
pub(crate) struct RobotName(pub(crate) RobotId);

/// A computer.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Host {
    /// Where the router of this computer listens; its services connect to it.
    pub(crate) router: String,
    /// The routers of other computers that it links to. Of two computers one names the other.
    #[serde(default)]
    pub(crate) links: Vec<String>,
    /// Whether the router may listen beyond this computer without encryption; whoever reaches it can drive the robots.
    #[serde(default)]
    pub(crate) insecure_lan: bool,
}

/// A service.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Service {
    /// Its catalogue name.
    pub(crate) kind: String,
    /// The computer it runs on; needed when there are several.
    pub(crate) host: Option<String>,
    /// The robot it works for; needed for all but planners.
    pub(crate) robot: Option<RobotId>,
    /// Inputs that come from elsewhere than usual: the stream that it hears, and the one of the same type that it shall
    /// hear instead.
    #[serde(default)]
    pub(crate) inputs: BTreeMap<String, String>,
    /// Parameters that differ from the defaults.
    #[serde(default)]
    pub(crate) params: toml::Table,
}

impl Topology {
    /// Reads and checks a topology file.
    ///
    /// # Errors
    /// A usage error that names the file, and what is wrong in it.
    pub(crate) fn read(path: &Path) -> anyhow::Result<Self> {
        let text = std::fs::read_to_string(path)
            .map_err(|fault| usage(format!("cannot read the topology {}: {fault}", path.display())))?;
        Self::parse(&text).map_err(|fault| usage(format!("{}: {fault:#}", path.display())))
    }

    /// Reads and checks the text of a topology.
    ///
    /// # Errors
    /// Names what is wrong.
    pub(crate) fn parse(text: &str) -> anyhow::Result<Self> {
        let topology: Self = toml::from_str(text)?;
        topology.check()?;
        Ok(topology)
    }

    fn check(&self) -> anyhow::Result<()> {
        anyhow::ensure!(
            !self.hosts.is_empty(),
            "hosts: at least one computer is needed, for example [hosts.local]"
        );
        anyhow::ensure!(
            self.services.len() <= MAX_SERVICES,
            "services: {} are too many, at most {MAX_SERVICES}",
            self.services.len()
        );
        for (name, robot) in &self.robots {
            robot.check().map_err(|refusal| anyhow::anyhow!("robots.{}: {refusal}", name.0))?;
        }
        let mut holders = BTreeSet::new();
        for (index, service) in self.services.iter().enumerate() {
            let at = format!("services[{index}] ({})", service.kind);
            let Some(entry) = catalog::find(&service.kind) else {
                anyhow::bail!("{at}: unknown service; known: {}", catalog::names());
            };
            if entry.scope == Scope::OneRobot && service.robot.is_none() {
                anyhow::bail!("{at}: works for one robot; add robot = \"r1\"");
            }
            check_inputs(&service.inputs, entry).map_err(|fault| fault.context(at.clone()))?;
            match &service.host {
                Some(host) if !self.hosts.contains_key(host) => anyhow::bail!("{at}: unknown host {host:?}"),
                None if self.hosts.len() > 1 => anyhow::bail!("{at}: several hosts are named; add host = …"),
                _ => {}
            }
            let is_planner = entry.scope == Scope::AllRobots;
            if !holders.insert((service.kind.clone(), service.robot.clone())) && !is_planner {
                anyhow::bail!("{at}: stands twice for the same robot");
            }
        }
        Ok(())
    }

    /// The computer that `axle up` works for.
    ///
    /// # Errors
    /// A usage error for an unknown name, or none where there are several.
    pub(crate) fn host(&self, name: Option<&str>) -> anyhow::Result<(&str, &Host)> {
        let names = || self.hosts.keys().cloned().collect::<Vec<_>>().join(", ");
        match name {
            Some(name) => self
                .hosts
                .get_key_value(name)
                .map(|(name, host)| (name.as_str(), host))
                .ok_or_else(|| usage(format!("--host {name}: the topology knows {}", names()))),
            None if self.hosts.len() == 1 => self
                .hosts
                .iter()
                .next()
                .map(|(name, host)| (name.as_str(), host))
                .ok_or_else(|| usage("the topology names no host")),
            None => Err(usage(format!(
                "the topology names several computers; choose one with --host: {}",
                names()
            ))),
        }
    }

    /// The services of one computer.
    pub(crate) fn services_of<'a>(&'a self, host: &'a str) -> impl Iterator<Item = &'a Service> {
        self.services.iter().filter(move |service| service.host.as_deref().is_none_or(|name| name == host))
    }

    /// The parameters of a service: its own ones, and the description of its robot unless it has its own.
    pub(crate) fn params_of(&self, service: &Service) -> anyhow::Result<toml::Table> {
        let mut params = service.params.clone();
        let robot = service.robot.as_ref().and_then(|robot| self.robots.get(&RobotName(robot.clone())));
        let takes_robot =
            catalog::find(&service.kind).is_some_and(|entry| entry.params.contains("\n[robot]"));
        if let Some(robot) = robot
            && takes_robot
            && !params.contains_key("robot")
        {
            params.insert("robot".into(), toml::Value::try_from(robot)?);
        }
        Ok(params)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_topologies_are_right() {
        for text in [DEFAULT, include_str!("../../../deploy/topologies/composed.toml")] {
            let topology = Topology::parse(text).expect("a shipped file");
            let (host, _) = topology.host(None).expect("one host");
            assert!(topology.services_of(host).count() >= 8);
            for service in &topology.services {
                assert!(topology.params_of(service).is_ok());
            }
        }
    }

    #[test]
    fn a_wrong_topology_is_refused_by_name() {
        let check = |text: &str, words: &str| {
            let text = format!("[hosts.local]\nrouter = \"tcp/127.0.0.1:7447\"\n{text}");
            let fault = format!("{:#}", Topology::parse(&text).expect_err(&text));
            assert!(fault.contains(words), "{fault:?} does not say {words:?}");
        };
        check("[[services]]\nkind = \"parrot\"", "unknown service; known: pilot");
        check("[[services]]\nkind = \"navigator\"", "add robot");
        check("[[services]]\nkind = \"pathfinder\"\nhost = \"moon\"", "unknown host");
        check("[[services]]\nkind = \"pathfinder\"\ncolour = \"red\"", "colour");
        check("[[services]]\nkind = \"navigator\"\nrobot = \"a/b\"", "a/b");
        let twice = "[[services]]\nkind = \"navigator\"\nrobot = \"r1\"\n";
        check(&twice.repeat(2), "stands twice");
        check("[[services]]\nkind = \"pathfinder\"\n[robots.r1]\ntrack = -1", "track");
    }
}
