//! Topologies: which services run on which computer, for which robot, with which parameters.

mod wiring;

pub(crate) use wiring::{Node, Wire, check_inputs};

use crate::catalog::{self, Scope};
use crate::keys::Owner;
use crate::out::usage;
use axle_mesh::identity::{CERTIFICATE_FILE, KEY_FILE};
use axle_robot::BoardKind;
use axle_schema::contract::Bounds as _;
use axle_schema::{Drivetrain, RobotId};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::net::SocketAddr;
use std::path::Path;

/// The topology that `axle up` and `axle demo` start from: one emulated robot and its planners on one computer.
pub(crate) const DEFAULT: &str = include_str!("../../../deploy/topologies/demo.toml");

/// The most services of one topology.
const MAX_SERVICES: usize = 1000;

/// A topology file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Topology {
    /// After how many milliseconds of silence a process is taken for dead; 1000 unless said.
    pub(crate) lease_ms: Option<u32>,
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
    /// Where its processes run; no file says that.
    #[serde(skip)]
    pub(crate) place: Place,
}

/// Where the processes of a computer run, if they do not simply run here: for trials.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Place {
    /// The program that runs them, and its arguments before theirs: `ip netns exec NAME`.
    pub(crate) within: Vec<String>,
    /// Variables of their environment.
    pub(crate) variables: Vec<(String, String)>,
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
    /// The board that a robot has or an emulator plays.
    pub(crate) board: Option<String>,
    /// The port of the board.
    pub(crate) port: Option<String>,
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
        let leases = axle_mesh::config::LEASES;
        if let Some(ms) = self.lease_ms.filter(|ms| !leases.contains(ms)) {
            anyhow::bail!(
                "lease_ms: {ms} is out of range, allowed is {} to {}",
                leases.start(),
                leases.end()
            );
        }
        for (name, host) in &self.hosts {
            let endpoints = host.links.iter().chain([&host.router]);
            for endpoint in endpoints {
                axle_mesh::config::check_endpoint(endpoint)
                    .map_err(|fault| anyhow::anyhow!("hosts.{name}: {fault}"))?;
            }
        }
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
            if (service.board.is_some() || service.port.is_some()) && !catalog::takes_board(entry.name) {
                anyhow::bail!("{at}: has no board; board and port are for robot and emulator");
            }
            service
                .board
                .as_deref()
                .map(BoardKind::parse)
                .transpose()
                .map_err(|refusal| anyhow::anyhow!("{at}: {refusal}"))?;
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

    /// Adds the page of a browser to a computer, unless a gateway is there already. Beyond this computer it has the
    /// certificate and the logins of the directory of keys.
    ///
    /// # Errors
    /// As [`Topology::host`].
    pub(crate) fn add_page(
        &mut self,
        listen: SocketAddr,
        host: Option<&str>,
        keys: Option<&Path>,
    ) -> anyhow::Result<()> {
        let (host, _) = self.host(host)?;
        let host = host.to_owned();
        if self.services_of(&host).all(|service| service.kind != "gateway") {
            let mut params: toml::Table =
                [("listen".to_owned(), listen.to_string().into())].into_iter().collect();
            if let Some(keys) = keys.filter(|_| !listen.ip().is_loopback()) {
                let page = keys.join(Owner::Page { host: host.clone() }.to_string());
                for (name, path) in [
                    ("certificate", page.join(CERTIFICATE_FILE)),
                    ("key", page.join(KEY_FILE)),
                    ("logins", keys.join(crate::logins::FILE)),
                ] {
                    let path = std::path::absolute(path)?;
                    params.insert(name.to_owned(), path.display().to_string().into());
                }
            }
            let (kind, robot) = ("gateway".to_owned(), None);
            let (inputs, board, port) = (BTreeMap::new(), None, None);
            self.services.push(Service { kind, host: Some(host), robot, inputs, params, board, port });
        }
        Ok(())
    }

    /// The computer that a service runs on.
    pub(crate) fn host_of<'a>(&'a self, node: &'a Node<'_>) -> &'a str {
        let only = self.hosts.keys().next().map_or("", String::as_str);
        node.service.host.as_deref().unwrap_or(only)
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
    fn a_page_is_added_unless_there_is_one() {
        let mut topology = Topology::parse(DEFAULT).expect("the shipped file");
        let before = topology.services.len();
        for _ in 0..2 {
            let address = SocketAddr::from(([127, 0, 0, 1], 8080));
            topology.add_page(address, None, None).expect("one host");
            assert_eq!(topology.services.len(), before + 1);
        }
        let page = topology.services.last().expect("the gateway");
        let params = topology.params_of(page).expect("parameters");
        assert_eq!((&*page.kind, params["listen"].as_str()), ("gateway", Some("127.0.0.1:8080")));
        assert!(topology.check().is_ok());
        assert!(topology.add_page(SocketAddr::from(([127, 0, 0, 1], 1)), Some("moon"), None).is_err());
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
        check(
            "[hosts.moon]\nrouter = \"udp/127.0.0.1:7447\"\n[[services]]\nkind = \"pathfinder\"\nhost = \"moon\"",
            "hosts.moon",
        );
        check("[[services]]\nkind = \"pathfinder\"\n[robots.r1]\ntrack = -1", "track");
    }
}
