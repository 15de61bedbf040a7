//! Which service of a topology hears what of whom, and what is wrong with that.

use super::{Service, Topology};
use crate::catalog::{self, Entry, Wires, is_shared};
use axle_schema::RobotId;
use axle_schema::key::Port;
use std::collections::BTreeMap;

/// A service of a topology with what it is in the catalogue.
#[derive(Clone, Copy)]
pub(crate) struct Node<'a> {
    pub(crate) service: &'a Service,
    pub(crate) entry: &'static Entry,
    /// Where it stands in the file.
    pub(crate) index: usize,
}

impl Node<'_> {
    /// How messages name it: `navigator of r1`.
    pub(crate) fn name(&self) -> String {
        let kind = self.entry.name;
        self.service.robot.as_ref().map_or_else(|| kind.to_owned(), |robot| format!("{kind} of {robot}"))
    }
    /// Its wires, with the inputs that differ in this topology.
    pub(crate) fn wires(&self) -> Wires {
        let mut wires = (self.entry.wires)(self.entry.name);
        for port in wires.needs.iter_mut().chain(&mut wires.hears) {
            if let Some(other) = self.service.inputs.get(&port.to_string()) {
                // What is not known was refused when the file was read.
                *port = Port::parse(other).unwrap_or(*port);
            }
        }
        wires
    }
    /// Whether both work for the same robot; planners work for every robot.
    fn meets(&self, robot: Option<&RobotId>) -> bool {
        self.service.robot.as_ref().is_none_or(|own| robot.is_none_or(|robot| own == robot))
    }
}

/// One wire.
#[derive(Clone, Copy)]
pub(crate) struct Wire<'a> {
    pub(crate) from: Node<'a>,
    pub(crate) to: Node<'a>,
    pub(crate) port: Port,
    /// Whether it is asked and not said.
    pub(crate) is_call: bool,
}

impl Topology {
    /// The services with their entries of the catalogue.
    pub(crate) fn nodes(&self) -> Vec<Node<'_>> {
        let nodes = self.services.iter().enumerate();
        nodes
            .filter_map(|(index, service)| {
                Some(Node { service, entry: catalog::find(&service.kind)?, index })
            })
            .collect()
    }

    /// Every wire, from who says or asks to who hears or answers.
    pub(crate) fn wires(&self) -> Vec<Wire<'_>> {
        let nodes = self.nodes();
        let mut all = Vec::new();
        for from in &nodes {
            let (says, robot) = (from.wires(), from.service.robot.as_ref());
            for to in nodes.iter().filter(|to| to.meets(robot)) {
                let hears = to.wires();
                let heard = hears.needs.iter().chain(&hears.hears);
                let streams = heard.filter(|port| says.says.contains(port)).map(|port| (*port, false));
                let calls =
                    hears.answers.iter().filter(|port| says.asks.contains(port)).map(|port| (*port, true));
                all.extend(streams.chain(calls).map(|(port, is_call)| Wire {
                    from: *from,
                    to: *to,
                    port,
                    is_call,
                }));
            }
        }
        all
    }

    /// What is wrong with the wiring, in sentences that say what to do.
    pub(crate) fn faults(&self) -> Vec<String> {
        let nodes = self.nodes();
        let mut faults = Vec::new();
        let mut holders: BTreeMap<(String, Port), String> = BTreeMap::new();
        for node in &nodes {
            let (wires, robot) = (node.wires(), node.service.robot.as_ref());
            let others = || nodes.iter().filter(|other| other.meets(robot)).map(Node::wires);
            for port in &wires.needs {
                if !others().any(|other| other.says.contains(port)) {
                    let hint = who(|entry| entry.says.contains(port));
                    faults.push(format!("{} needs {port}, which nobody says; {hint}", node.name()));
                }
            }
            for port in &wires.asks {
                if !others().any(|other| other.answers.contains(port)) {
                    let hint = who(|entry| entry.answers.contains(port));
                    faults.push(format!("{} asks {port}, which nobody answers; {hint}", node.name()));
                }
            }
            for port in wires.says.iter().filter(|port| !is_shared(**port)) {
                let key = (robot.map(ToString::to_string).unwrap_or_default(), *port);
                if let Some(first) = holders.insert(key, node.name()) {
                    faults.push(format!(
                        "{first} and {} both say {port}: only one of them may be in a topology",
                        node.name()
                    ));
                }
            }
        }
        faults.extend(self.cycle());
        faults
    }

    /// Services that ask each other in a circle: the first question would wait for itself.
    fn cycle(&self) -> Option<String> {
        let wires = self.wires();
        let asked = |of: usize| wires.iter().filter(move |wire| wire.is_call && wire.from.index == of);
        for start in self.nodes() {
            let (mut path, mut open) = (vec![start.index], vec![(start.index, 0)]);
            while let Some((at, next)) = open.pop() {
                path.truncate(open.len() + 1);
                if let Some(wire) = asked(at).nth(next) {
                    open.push((at, next + 1));
                    let to = wire.to.index;
                    if to == start.index {
                        return Some(format!("{} asks itself in a circle, by {}", start.name(), wire.port));
                    }
                    if !path.contains(&to) {
                        path.push(to);
                        open.push((to, 0));
                    }
                }
            }
        }
        None
    }
}

/// Which services of the catalogue would help.
fn who(helps: impl Fn(&Wires) -> bool) -> String {
    let names: Vec<_> = catalog::CATALOG
        .iter()
        .filter(|entry| helps(&(entry.wires)(entry.name)))
        .map(|entry| entry.name)
        .collect();
    match names.as_slice() {
        [] => "no service of the catalogue does".to_owned(),
        names => format!("add {}", names.join(" or ")),
    }
}

/// Checks the inputs of one service: both ends are known, of one type, and it hears the first.
///
/// # Errors
/// Names what is wrong.
pub(crate) fn check_inputs(inputs: &BTreeMap<String, String>, entry: &'static Entry) -> anyhow::Result<()> {
    let wires = (entry.wires)(entry.name);
    for (input, from) in inputs {
        let own = wires.needs.iter().chain(&wires.hears).find(|port| port.to_string() == *input);
        let Some(own) = own else {
            let heard: Vec<_> = wires.needs.iter().chain(&wires.hears).map(ToString::to_string).collect();
            anyhow::bail!("inputs: {} does not hear {input}; it hears {}", entry.name, heard.join(", "));
        };
        anyhow::ensure!(!is_shared(*own), "inputs: {input} cannot come from elsewhere: it stops the wheels");
        let other = Port::parse(from)?;
        let carries = |port: Port| port.entry().map(axle_schema::key::Entry::carries);
        let (wanted, got) = (carries(*own), carries(other));
        let is_stream = other.entry().is_some_and(|entry| entry.kind == axle_schema::key::Kind::Stream);
        anyhow::ensure!(
            is_stream && wanted == got,
            "inputs: {input} carries {}, but {from} {} {}",
            wanted.unwrap_or_default(),
            if is_stream { "carries" } else { "is a call and asks" },
            got.unwrap_or_default()
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::DEFAULT;
    use super::*;

    fn faults(text: &str) -> Vec<String> {
        let text = format!("[hosts.local]\nrouter = \"tcp/127.0.0.1:7447\"\n{text}");
        Topology::parse(&text).expect("a topology").faults()
    }
    fn services(kinds: &[&str]) -> String {
        kinds.iter().map(|kind| format!("[[services]]\nkind = \"{kind}\"\nrobot = \"r1\"\n")).collect()
    }

    #[test]
    fn the_shipped_topologies_are_wired_right() {
        for text in [
            DEFAULT,
            include_str!("../../../../deploy/topologies/composed.toml"),
            include_str!("../../../../deploy/topologies/two-computers.toml"),
        ] {
            let topology = Topology::parse(text).expect("a topology");
            assert_eq!(topology.faults(), Vec::<String>::new());
            assert!(topology.wires().len() > 10);
        }
    }

    #[test]
    fn what_nobody_says_or_answers_is_named_with_who_would() {
        let found = faults(&services(&["navigator"]));
        assert_eq!(found, ["navigator of r1 needs source/recent, which nobody says; add source"]);
        let found = faults(&services(&["emulator", "source", "navigator", "pilot"]));
        assert!(
            found
                .iter()
                .any(|fault| fault.contains("asks pathfinder/plan") && fault.contains("add pathfinder")),
            "{found:?}"
        );
    }

    #[test]
    fn two_who_own_the_wheels_of_one_robot_are_refused() {
        let found = faults(&services(&["emulator", "composed", "motor-left", "motor-right"]));
        let both = |port| format!("emulator of r1 and composed of r1 both say {port}");
        assert!(found.iter().any(|fault| fault.starts_with(&both("gate/state"))), "{found:?}");
        assert!(found.iter().any(|fault| fault.starts_with(&both("robot/encoders"))), "{found:?}");
    }

    #[test]
    fn an_input_may_come_from_elsewhere_if_it_is_of_the_same_type() {
        let with = |inputs: &str| {
            let text = services(&["emulator", "source", "navigator"]);
            let text =
                format!("[hosts.local]\nrouter = \"tcp/127.0.0.1:7447\"\n{text}inputs = {{ {inputs} }}\n");
            Topology::parse(&text)
        };
        let fault = |inputs: &str| format!("{:#}", with(inputs).expect_err(inputs));
        assert!(
            fault("\"navigator/pose\" = \"emulator/truth\"")
                .contains("does not hear navigator/pose; it hears source/recent")
        );
        assert!(fault("\"source/recent\" = \"parrot/words\"").contains("unknown stream"));
        assert!(fault("\"source/recent\" = \"robot/encoders\"").contains("axle.EncodersData.v1"));
        assert!(fault("\"source/recent\" = \"source/window\"").contains("is a call"));
        let pilot = format!(
            "[hosts.local]\nrouter = \"tcp/127.0.0.1:7447\"\n{}inputs = {{ \"navigator/pose\" = \"emulator/truth\" }}\n{}",
            services(&["emulator", "d-corrector"]),
            services(&["pilot", "source"])
        );
        let topology = Topology::parse(&pilot).expect("a pose from elsewhere");
        let wired = |from: &str, to: &str| {
            topology.wires().iter().any(|wire| wire.from.entry.name == from && wire.to.entry.name == to)
        };
        assert!(wired("emulator", "d-corrector") && !wired("navigator", "d-corrector"));
    }
}
