//! Who may do what: the access rules of a router, from the table of keys, the wires of the catalogue, and a topology.
//!
//! A service may say what it says by the catalogue, hear what it hears, ask what it asks, answer what it answers, and
//! nothing else; a person may do what the role says. Whoever has no rule sees nothing. The rules bind to the common
//! name in the certificate of whoever is directly connected. So a router of another computer may do what all those
//! behind it may do together, and no more: a workstation that somebody has taken over cannot pass for the wheels.
//!
//! A rule must include the whole key that is asked for. A declared publisher learns of its listeners through its router,
//! and falls silent without a word when the rules keep that from it: hence the declarations below that go out.

use crate::keys::{Entry, Ledger, Owner, Role};
use crate::topology::{Node, Topology};
use axle_schema::RobotId;
use axle_schema::id::ALL;
use axle_schema::key::{self, Kind, Port, Presence};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// What one owner may do, as key expressions.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Rights {
    /// Keys that it may publish.
    pub(crate) says: BTreeSet<String>,
    /// Keys that it may subscribe to.
    pub(crate) hears: BTreeSet<String>,
    /// Keys that it may ask.
    pub(crate) asks: BTreeSet<String>,
    /// Keys that it may answer.
    pub(crate) answers: BTreeSet<String>,
    /// Tokens that it may show: that it is alive.
    shows: BTreeSet<String>,
    /// Tokens that it may look at.
    sees: BTreeSet<String>,
}

impl Rights {
    /// What a service may do by its wires.
    pub(crate) fn of_service(node: &Node<'_>) -> Self {
        let (wires, robot) = (node.wires(), node.service.robot.as_ref());
        let keys = |ports: &[Port]| ports.iter().map(|port| port.key(robot)).collect::<BTreeSet<_>>();
        let mut rights = Self {
            says: keys(&wires.says),
            hears: keys(&[wires.needs, wires.hears].concat()),
            asks: keys(&wires.asks),
            answers: keys(&wires.answers),
            ..Self::default()
        };
        if wires.hears_everything {
            rights.hears.insert(key::everything(robot));
        }
        // Its healthcheck shows the same certificate: it looks at itself, and asks a question of its own trade.
        rights.asks.extend(keys(&wires.answers));
        if wires.acts_for_people {
            rights.add(Self::of_operator(robot));
        }
        let of = robot.map_or(ALL, RobotId::as_str);
        rights.is_visible_as(of, node.entry.name);
        rights
    }

    /// What the tools of a router may do: look who is there, and send a question and an answer through it.
    fn of_router() -> Self {
        let mut rights = Self::looks_at_everybody();
        rights.is_visible_as("*", "doctor");
        rights
    }

    /// What a person may do.
    pub(crate) fn of_person(entry: &Entry) -> Self {
        let mut rights = Self::looks_at_everybody();
        rights.hears.insert(key::everything(None));
        let robots: Vec<Option<&RobotId>> =
            if entry.robots.is_empty() { vec![None] } else { entry.robots.iter().map(Some).collect() };
        let mut on_robots = |ports: &[Port], keys: fn(&mut Self) -> &mut BTreeSet<String>| {
            for robot in &robots {
                keys(&mut rights).extend(ports.iter().map(|port| port.key(*robot)));
            }
        };
        if matches!(entry.role, Role::Operator | Role::Commander) {
            on_robots(&calls(|port| !is_of_holders(port)), |rights| &mut rights.asks);
            on_robots(&[key::STOP.port()], |rights| &mut rights.says);
        }
        if entry.role == Role::Commander {
            on_robots(&calls(is_of_holders), |rights| &mut rights.asks);
            on_robots(&[key::COMMAND.port()], |rights| &mut rights.says);
        }
        if entry.role != Role::Viewer {
            // Planners only reckon; they may be asked for no robot at all.
            rights.asks.extend([key::PLAN.port(), key::DRIVE.port()].map(|port| port.key(None)));
        }
        rights
    }

    /// What a service may that shows robots to people, and asks what they want: the gateway. Who of them may what is its
    /// own affair.
    fn of_operator(robot: Option<&RobotId>) -> Self {
        let calls = calls(|port| !is_of_holders(port));
        let mut rights = Self::looks_at_everybody();
        rights.hears.extend([key::everything(robot), key::every_log(robot).as_str().to_owned()]);
        rights.says.insert(key::STOP.port().key(robot));
        rights.asks.extend(calls.iter().map(|port| port.key(robot)));
        rights.asks.extend([key::PLAN.port(), key::DRIVE.port()].map(|port| port.key(None)));
        rights
    }

    fn looks_at_everybody() -> Self {
        Self {
            asks: [Presence::every_status()].into(),
            sees: [Presence::every_token()].into(),
            ..Self::default()
        }
    }

    fn is_visible_as(&mut self, robot: &str, service: &str) {
        let (token, status) = (Presence::tokens_of(robot, service), Presence::statuses_of(robot, service));
        self.sees.insert(token.clone());
        self.shows.insert(token);
        self.asks.insert(status.clone());
        self.answers.insert(status);
    }

    fn add(&mut self, other: Self) {
        self.says.extend(other.says);
        self.hears.extend(other.hears);
        self.asks.extend(other.asks);
        self.answers.extend(other.answers);
        self.shows.extend(other.shows);
        self.sees.extend(other.sees);
    }

    /// The rules of Zenoh that follow for whoever is called `name`.
    fn rules(&self, name: &str) -> Vec<Value> {
        let all = |is_needed: bool| -> BTreeSet<String> {
            let everything = [key::everything(None), Presence::every_status()];
            if is_needed { everything.into() } else { BTreeSet::new() }
        };
        // A question for every status is a wider key than any answer to it.
        let mut asked = self.answers.clone();
        if !self.shows.is_empty() {
            asked.insert(Presence::every_status());
        }
        let table: [(&str, &str, &[&str], BTreeSet<String>); 13] = [
            ("ingress", "says", &["put"], self.says.clone()),
            ("ingress", "hears", &["declare_subscriber"], self.hears.clone()),
            ("ingress", "asks", &["query"], self.asks.clone()),
            ("ingress", "answers", &["declare_queryable", "reply"], self.answers.clone()),
            ("ingress", "shows", &["liveliness_token"], self.shows.clone()),
            ("ingress", "sees", &["liveliness_query", "declare_liveliness_subscriber"], self.sees.clone()),
            ("egress", "hears", &["put"], self.hears.clone()),
            ("egress", "asks", &["reply"], self.asks.clone()),
            ("egress", "answers", &["query"], asked),
            ("egress", "sees", &["liveliness_token", "reply"], self.sees.clone()),
            ("egress", "listeners", &["declare_subscriber"], all(!self.says.is_empty())),
            ("egress", "servers", &["declare_queryable"], all(!self.asks.is_empty())),
            ("egress", "watchers", &["liveliness_query", "declare_liveliness_subscriber"], {
                if self.shows.is_empty() { BTreeSet::new() } else { [Presence::every_token()].into() }
            }),
        ];
        table
            .into_iter()
            .filter(|(.., keys)| !keys.is_empty())
            .map(|(flow, what, messages, keys)| {
                json!({
                    "id": format!("{name} {flow} {what}"), "permission": "allow", "flows": [flow],
                    "messages": messages, "key_exprs": keys,
                })
            })
            .collect()
    }
}

/// Whether only whoever commands the wheels asks it.
fn is_of_holders(port: Port) -> bool {
    port == key::LEASE.port() || port == key::RELEASE.port()
}

/// The calls of the table of which this holds.
fn calls(is_so: impl Fn(Port) -> bool) -> Vec<Port> {
    let calls = key::TABLE.iter().filter(|entry| entry.kind == Kind::Call);
    calls.map(|entry| Port { service: entry.service, name: entry.name }).filter(|port| is_so(*port)).collect()
}

/// The owner of a service of a topology.
pub(crate) fn owner(node: &Node<'_>) -> Owner {
    Owner::Service { kind: node.entry.name, robot: node.service.robot.clone() }
}

/// The `access_control` of the router of `host`.
pub(crate) fn rules(topology: &Topology, host: &str, ledger: &Ledger) -> Value {
    // Who connects here, by common names; whoever has no certificate is nobody.
    let mut subjects: BTreeMap<String, (Vec<&str>, Rights)> = BTreeMap::new();
    let mut add = |owner: &Owner, rights: Rights| {
        let names: Vec<&str> = ledger.accepted_of(owner).map(|entry| &*entry.common_name).collect();
        if !names.is_empty() {
            subjects.entry(owner.to_string()).or_insert_with(|| (names, Rights::default())).1.add(rights);
        }
    };
    let persons = || {
        ledger.persons().filter_map(|entry| Some((Owner::parse(&entry.name).ok()?, Rights::of_person(entry))))
    };
    // The rights of all that is on one computer, and of nobody else.
    let on = |host: &str| {
        let nodes = topology.nodes();
        let here = nodes.into_iter().filter(|node| topology.host_of(node) == host);
        here.map(|node| (owner(&node), Rights::of_service(&node))).collect::<Vec<_>>()
    };
    for (owner, rights) in on(host).into_iter().chain(persons()) {
        add(&owner, rights);
    }
    for other in topology.hosts.keys() {
        let owner = Owner::Router { host: other.clone() };
        add(&owner, Rights::of_router());
        if other == host {
            continue;
        }
        // Whatever comes over a link comes from some other computer.
        for elsewhere in topology.hosts.keys().filter(|elsewhere| *elsewhere != host) {
            on(elsewhere).into_iter().for_each(|(_, rights)| add(&owner, rights));
        }
        persons().for_each(|(_, rights)| add(&owner, rights));
    }
    let lists = subjects.iter().map(|(name, (_, rights))| rights.rules(name)).collect::<Vec<_>>();
    let policies = subjects.keys().zip(&lists).map(|(name, rules)| {
        let ids: Vec<_> = rules.iter().map(|rule| rule["id"].clone()).collect();
        json!({ "rules": ids, "subjects": [name] })
    });
    json!({
        "enabled": true,
        "default_permission": "deny",
        "policies": policies.collect::<Vec<_>>(),
        "subjects": subjects.iter().map(|(name, (names, _))| json!({ "id": name, "cert_common_names": names })).collect::<Vec<_>>(),
        "rules": lists.concat(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(name: &str, role: Role) -> Entry {
        let text = format!(
            "name = \"{name}\"\ncommon_name = \"{name}\"\nrole = \"{}\"\nserial = \"1\"\nissued = 0\nexpires = 1\n",
            role.word()
        );
        toml::from_str(&text).expect("an entry")
    }
    fn ledger(topology: &Topology) -> Ledger {
        let services = topology
            .nodes()
            .iter()
            .map(|node| entry(&owner(node).to_string(), Role::Service))
            .collect::<Vec<_>>();
        let routers = topology.hosts.keys().map(|host| entry(&format!("router@{host}"), Role::Router));
        let people =
            [entry("ann", Role::Viewer), entry("bob", Role::Operator), entry("carl", Role::Commander)];
        Ledger { certificates: services.into_iter().chain(routers).chain(people).collect() }
    }
    fn two() -> Topology {
        Topology::parse(include_str!("../../../deploy/topologies/two-computers.toml")).expect("a topology")
    }
    /// Who may put this key at the router of a host.
    fn who_says(rules: &Value, key: &str) -> Vec<String> {
        let list = rules["rules"].as_array().expect("rules");
        let says = list.iter().filter(|rule| {
            rule["flows"] == json!(["ingress"])
                && rule["messages"] == json!(["put"])
                && rule["key_exprs"]
                    .as_array()
                    .expect("keys")
                    .iter()
                    .any(|own| own.as_str().expect("a key").replace("/*/", "/r1/") == key)
        });
        says.map(|rule| rule["id"].as_str().expect("an id").replace(" ingress says", "")).collect()
    }

    #[test]
    fn only_holders_of_the_gate_command_a_robot() {
        let topology = two();
        let r1 = RobotId::new("r1").expect("a robot");
        let rules = |host: &str| rules(&topology, host, &ledger(&topology));
        let command = key::COMMAND.port().key(Some(&r1));
        assert_eq!(
            who_says(&rules("onboard"), &command),
            ["carl", "d-corrector@r1", "drive@r1", "router@workstation"]
        );
        // No corrector runs on the workstation; what its router may pass on comes from people and from on board.
        assert_eq!(who_says(&rules("workstation"), &command), ["carl", "router@onboard"]);
        let encoders = key::ENCODERS.port().key(Some(&r1));
        assert_eq!(who_says(&rules("onboard"), &encoders), ["emulator@r1"]);
        assert_eq!(who_says(&rules("workstation"), &encoders), ["router@onboard"]);
        let stop = key::STOP.port().key(Some(&r1));
        assert_eq!(who_says(&rules("workstation"), &stop), ["bob", "carl", "router@onboard"]);
    }

    #[test]
    fn a_viewer_says_nothing_and_a_revoked_one_is_nobody() {
        let topology = two();
        let mut ledger = ledger(&topology);
        let own = |rules: &Value| -> Vec<String> {
            let list =
                rules["rules"].as_array().expect("rules").iter().filter_map(|rule| rule["id"].as_str());
            list.filter(|id| id.starts_with("ann ")).map(str::to_owned).collect()
        };
        let found = own(&rules(&topology, "onboard", &ledger));
        assert_eq!(found.len(), 7, "{found:?}");
        assert!(
            !found.iter().any(|id| id.contains("says") || id.contains("answers") || id.contains("shows")),
            "{found:?}"
        );
        for entry in &mut ledger.certificates {
            entry.revoked = entry.name == "ann";
        }
        assert_eq!(own(&rules(&topology, "onboard", &ledger)), Vec::<String>::new());
    }

    #[test]
    fn a_person_for_one_robot_acts_on_no_other() {
        let mut operator = entry("bob", Role::Operator);
        operator.robots = vec![RobotId::new("r1").expect("a robot")];
        let rights = Rights::of_person(&operator);
        let r2 = RobotId::new("r2").expect("a robot");
        assert!(rights.asks.contains(&key::GO.port().key(Some(&operator.robots[0]))));
        assert!(
            !rights.asks.contains(&key::GO.port().key(None))
                && !rights.says.contains(&key::STOP.port().key(Some(&r2)))
        );
        assert!(rights.hears.contains(&key::everything(None)), "it sees them all");
    }

    #[test]
    fn no_key_of_the_table_is_said_by_two_kinds_but_those_that_are_meant_to_be() {
        // The rules are as strict as the catalogue: a stream that two kinds may say is one that either may forge.
        let topology = Topology::parse(crate::topology::DEFAULT).expect("a topology");
        let mut says: BTreeMap<String, Vec<String>> = BTreeMap::new();
        for node in topology.nodes() {
            for key in Rights::of_service(&node).says {
                says.entry(key).or_default().push(node.name());
            }
        }
        says.retain(|_, who| who.len() > 1);
        let shared: Vec<_> = says.into_values().collect();
        assert_eq!(shared, [["d-corrector of r1", "drive of r1"]]);
    }
}
