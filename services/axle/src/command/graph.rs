//! `axle graph [TOPOLOGY]`: services, streams and computers, as a table, as a picture, and what of it is alive.

use super::check;
use crate::cli::Graph;
use crate::out::{data, note, table};
use crate::settings::Settings;
use crate::topology::{Node, Topology, Wire};
use anyhow::Context as _;
use axle_schema::RobotId;
use axle_schema::key;
use layout::backends::svg::SVGWriter;
use layout::gv::{DotParser, GraphBuilder};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::time::Duration;
use tokio::time::{Instant, timeout_at};

/// How long the mesh is listened to: every stream that is alive is said once a second at least.
const LISTENING: Duration = Duration::from_secs(2);

pub(super) async fn graph(settings: &Settings, args: &Graph) -> anyhow::Result<()> {
    let topology = check::read(args.topology.as_deref())?;
    let live = if args.live { Some(Live::hear(settings).await?) } else { None };
    let dot = to_dot(&topology, live.as_ref());
    if let Some(file) = &args.svg {
        std::fs::write(file, to_svg(&dot)?)
            .map_err(|fault| anyhow::anyhow!("cannot write {}: {fault}", file.display()))?;
        note(&format!("drawn in {}", file.display()));
    }
    if args.dot {
        data(dot.trim_end())?;
    } else if args.json {
        for wire in topology.wires() {
            data(&to_json(&wire, live.as_ref()).to_string())?;
        }
    } else if args.svg.is_none() {
        print(&topology, live.as_ref())?;
    }
    for fault in topology.faults() {
        note(&format!("unwired: {fault}"));
    }
    Ok(())
}

/// What was heard on the mesh.
struct Live {
    /// Services with a process, by name and robot.
    alive: BTreeSet<(String, String)>,
    /// Samples of each key.
    heard: BTreeMap<String, u32>,
}

/// Whether something is as it should be.
#[derive(Clone, Copy, PartialEq)]
enum Pulse {
    Alive,
    Silent,
    Missing,
}

impl Pulse {
    const fn word(self) -> &'static str {
        match self {
            Self::Alive => "alive",
            Self::Silent => "silent",
            Self::Missing => "missing",
        }
    }
    const fn colour(self) -> &'static str {
        match self {
            Self::Alive => "#2e7d32",
            Self::Silent => "#b26a00",
            Self::Missing => "#c62828",
        }
    }
}

impl Live {
    async fn hear(settings: &Settings) -> anyhow::Result<Self> {
        let mesh = settings.join("graph").await?;
        let tap = mesh.tap(&key::everything(None), 65536)?;
        note(&format!("listening for {} s …", LISTENING.as_secs()));
        let end = Instant::now() + LISTENING;
        let mut heard: BTreeMap<String, u32> = BTreeMap::new();
        while let Ok(raw) = timeout_at(end, tap.next()).await {
            *heard.entry(raw.key).or_default() += 1;
        }
        let everybody = mesh.everybody(Duration::from_secs(1)).await?;
        let alive = everybody.into_iter().map(|(presence, _)| (presence.service, presence.robot)).collect();
        mesh.leave().await;
        Ok(Self { alive, heard })
    }

    fn node(&self, node: &Node<'_>) -> Pulse {
        let robot = node.service.robot.as_ref().map_or(axle_schema::id::ALL, RobotId::as_str);
        if self.alive.contains(&(node.entry.name.to_owned(), robot.to_owned())) {
            Pulse::Alive
        } else {
            Pulse::Missing
        }
    }

    /// A stream is silent when nothing was heard of it; a question is alive when both ends are.
    fn wire(&self, wire: &Wire<'_>) -> Pulse {
        let ends = [self.node(&wire.from), self.node(&wire.to)];
        if ends.contains(&Pulse::Missing) {
            return Pulse::Missing;
        }
        let robot = wire.from.service.robot.as_ref().or(wire.to.service.robot.as_ref());
        let is_said = |robot: &RobotId| {
            let end = format!("/{robot}/{}", wire.port);
            self.heard.keys().any(|key| key.ends_with(&end))
        };
        if wire.is_call || robot.is_none_or(is_said) { Pulse::Alive } else { Pulse::Silent }
    }
}

fn host_of<'a>(topology: &'a Topology, node: &'a Node<'_>) -> &'a str {
    let only = topology.hosts.keys().next().map_or("", String::as_str);
    node.service.host.as_deref().unwrap_or(only)
}

fn to_json(wire: &Wire<'_>, live: Option<&Live>) -> serde_json::Value {
    let robot = wire.from.service.robot.as_ref().or(wire.to.service.robot.as_ref());
    let mut json = serde_json::json!({
        "from": wire.from.entry.name, "to": wire.to.entry.name, "robot": robot, "key": wire.port.to_string(),
        "kind": if wire.is_call { "call" } else { "stream" },
        "carries": wire.port.entry().map(key::Entry::carries),
    });
    if let Some(live) = live {
        json["pulse"] = live.wire(wire).word().into();
    }
    json
}

fn print(topology: &Topology, live: Option<&Live>) -> anyhow::Result<()> {
    let mut header = vec!["from", "", "to", "carries"];
    let mut of_services = vec!["service", "computer"];
    if live.is_some() {
        header.push("now");
        of_services.push("now");
    }
    let nodes = topology.nodes();
    let services = nodes.iter().map(|node| {
        let mut row = vec![node.name(), host_of(topology, node).to_owned()];
        row.extend(live.map(|live| live.node(node).word().to_owned()));
        row
    });
    table(&of_services, services)?;
    let wires = topology.wires();
    let rows = wires.iter().map(|wire| {
        let arrow = if wire.is_call { format!("asks {}", wire.port) } else { format!("says {}", wire.port) };
        let carries = wire.port.entry().map(key::Entry::carries).unwrap_or_default();
        let mut row = vec![wire.from.name(), arrow, wire.to.name(), carries];
        row.extend(live.map(|live| live.wire(wire).word().to_owned()));
        row
    });
    Ok(table(&header, rows)?)
}

/// The graph in the language of Graphviz: one box a service, one arrow for all streams between two services.
fn to_dot(topology: &Topology, live: Option<&Live>) -> String {
    let mut dot = String::from("digraph axle {\n  rankdir=LR\n  node [shape=box]\n");
    for node in topology.nodes() {
        let (index, name, host) = (node.index, node.name(), host_of(topology, &node));
        let colour = live.map_or("#333333", |live| live.node(&node).colour());
        let _ = writeln!(dot, "  s{index} [label=\"{name}\\non {host}\", color=\"{colour}\"]");
    }
    let mut arrows: BTreeMap<(usize, usize, bool), (Vec<String>, Pulse)> = BTreeMap::new();
    for wire in topology.wires() {
        let pulse = live.map_or(Pulse::Alive, |live| live.wire(&wire));
        let arrow = arrows
            .entry((wire.from.index, wire.to.index, wire.is_call))
            .or_insert_with(|| (Vec::new(), pulse));
        arrow.0.push(wire.port.name.to_owned());
        // One stream that flows shows that the way is open.
        if pulse == Pulse::Alive {
            arrow.1 = pulse;
        }
    }
    for ((from, to, is_call), (ports, pulse)) in arrows {
        let (label, style) = (ports.join("\\n"), if is_call { "dashed" } else { "solid" });
        let colour = if live.is_some() { pulse.colour() } else { "#555555" };
        let _ =
            writeln!(dot, "  s{from} -> s{to} [label=\"{label}\", style=\"{style}\", color=\"{colour}\"]");
    }
    dot.push_str("}\n");
    dot
}

fn to_svg(dot: &str) -> anyhow::Result<String> {
    let parsed = DotParser::new(dot).process();
    let graph = parsed.map_err(|fault| anyhow::anyhow!("{fault}")).context("draw the graph")?;
    let mut builder = GraphBuilder::new();
    builder.visit_graph(&graph);
    let mut picture = SVGWriter::new();
    builder.get().do_it(false, false, false, &mut picture);
    Ok(picture.finalize())
}
