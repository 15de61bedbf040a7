//! Which service of a topology hears what of whom, and what is wrong with that.

use super::{Service, Topology};
use crate::catalog::{self, Entry, Wires, is_shared};
use crate::run::composed::ComposedParams;
use axle_schema::RobotId;
use axle_schema::key::Port;
use std::collections::{BTreeMap, BTreeSet};

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
        if self.entry.name == "emulator" && self.service.board.is_some() {
            wires = catalog::emulated_board();
        }
        // What is wrong with its parameters is refused when it starts.
        if self.entry.name == "composed"
            && let Ok(params) = self.service.params.clone().try_into::<ComposedParams>()
        {
            wires = catalog::composed_of(&params);
        }
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
                let asked = |port: &&Port| says.asks.contains(port) || says.may_ask.contains(port);
                let calls = hears.answers.iter().filter(asked).map(|port| (*port, true));
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
        let calls: Vec<_> = self.wires().into_iter().filter(|wire| wire.is_call).collect();
        let edges: Vec<_> = calls.iter().map(|wire| (wire.from.index, wire.to.index)).collect();
        let names = circle(&edges)?.into_iter().map(|edge| {
            let wire = &calls[edge];
            format!("{} asks {} of {}", wire.from.name(), wire.port, wire.to.name())
        });
        Some(format!("a question would wait for itself: {}", names.collect::<Vec<_>>().join(", ")))
    }
}

/// A circle of these edges, as their numbers in the order of the walk; none if there is none.
fn circle(edges: &[(usize, usize)]) -> Option<Vec<usize>> {
    // A node that was left without a circle is in none.
    let mut left = BTreeSet::new();
    for &(start, _) in edges {
        // The edges of the walk so far, each with the place in the list where the next one is looked for.
        let mut walk: Vec<usize> = Vec::new();
        let mut place = 0;
        let mut at = start;
        loop {
            let on = (place..edges.len()).find(|&edge| edges[edge].0 == at && !left.contains(&edges[edge].1));
            if let Some(edge) = on {
                let to = edges[edge].1;
                walk.push(edge);
                if let Some(begin) = walk.iter().position(|&edge| edges[edge].0 == to) {
                    return Some(walk.split_off(begin));
                }
                (at, place) = (to, 0);
            } else {
                left.insert(at);
                let Some(back) = walk.pop() else { break };
                (at, place) = (edges[back].0, back + 1);
            }
        }
    }
    None
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
            include_str!("../../../../deploy/topologies/compose.toml"),
            include_str!("../../../../deploy/topologies/compose-real.toml"),
            include_str!("../../../../deploy/topologies/fleet.toml"),
            include_str!("../../../../deploy/topologies/ten-robots.toml"),
            include_str!("../../../../deploy/topologies/roomba.toml"),
            include_str!("../../../../deploy/topologies/fleet.toml"),
            include_str!("../../../../deploy/topologies/warehouse.toml"),
        ] {
            let topology = Topology::parse(text).expect("a topology");
            assert_eq!(topology.faults(), Vec::<String>::new());
            assert!(topology.wires().len() > 10);
        }
    }

    #[test]
    fn questions_that_would_wait_for_themselves_are_found() {
        // The pilot asks both planners, and one of those the map.
        assert_eq!(circle(&[(0, 1), (0, 2), (1, 3), (2, 3)]), None);
        assert_eq!(circle(&[]), None);
        assert_eq!(circle(&[(4, 4)]), Some(vec![0]));
        assert_eq!(circle(&[(0, 1), (1, 2), (0, 2), (2, 3), (3, 1)]), Some(vec![1, 3, 4]));
        let line: Vec<_> = (0..1000).map(|node| (node, node + 1)).collect();
        assert_eq!(circle(&line), None);
        let ring: Vec<_> = line.into_iter().chain([(1000, 0)]).collect();
        assert_eq!(circle(&ring).map(|ring| ring.len()), Some(1001));
    }

    #[test]
    fn what_nobody_says_or_answers_is_named_with_who_would() {
        let found = faults(&services(&["navigator"]));
        assert_eq!(
            found,
            [
                "navigator of r1 needs source/recent, which nobody says; add source",
                "navigator of r1 asks source/window, which nobody answers; add source"
            ]
        );
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
    fn the_partners_of_a_composed_robot_are_those_of_its_parameters() {
        let four = ["composed", "motor-left", "motor-right", "encoder-left", "encoder-right"];
        let with = |kinds: &[&str], params: &str| {
            let (first, rest) = kinds.split_first().expect("a service");
            faults(&format!("{}params = {{ {params} }}\n{}", services(&[first]), services(rest)))
        };
        let encoders = "encoders = { left = \"encoder-left\", right = \"encoder-right\" }";
        assert_eq!(with(&four, encoders), Vec::<String>::new());
        let found = with(&four[..3], encoders);
        assert!(found.iter().any(|fault| fault.contains("needs encoder-left/reading")), "{found:?}");
        assert_eq!(with(&four[..3], ""), Vec::<String>::new());
        // A motor that Axle does not know may be a program in any language.
        let foreign = "motors = { left = \"motor-mine\", right = \"motor-right\" }, encoders = { left = \"motor-mine\", right = \"motor-right\" }";
        assert_eq!(with(&["composed", "motor-right"], foreign), Vec::<String>::new());
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
