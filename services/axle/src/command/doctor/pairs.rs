//! `axle doctor`: every pair of a topology, judged by the data that passes between the two.
//!
//! Each process counts what it has published and what has arrived, by key. The doctor asks both ends twice, each from
//! the router of the other, so that the questions take the way of the data; what was said in between must have arrived.
//! So nothing is healthy because a process is alive or a setting is right.

use super::clocks::{self, Offset};
use crate::access;
use crate::out::{data, note, table};
use crate::settings::{SOON, Settings, join};
use crate::topology::{Node, Topology, Wire};
use axle_mesh::identity::span;
use axle_mesh::{Mesh, Patience, Reach, probe};
use axle_schema::RobotId;
use axle_schema::id::ALL;
use axle_schema::key::{self, Port, Presence, chunk};
use axle_schema::presence::{Flow, Status};
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

/// A process that does not answer within this time hangs.
const PATIENCE: Duration = Duration::from_millis(800);
/// A router has this long to take the doctor in.
const JOINING: Duration = Duration::from_millis(1500);
/// What is said is looked at for this long; the slowest steady stream comes five times a second.
const LOOKING: Duration = Duration::from_millis(1200);
/// Clocks may differ so much before it is said; no motion depends on them, but logs and recordings do.
const CLOCKS: f64 = 0.1;

/// Streams that never rest while their service works.
fn is_steady(port: Port) -> bool {
    [key::ENCODERS.port(), key::RECENT.port(), key::POSE.port(), key::GATE_STATE.port()].contains(&port)
        || port == key::TRUTH.port()
        || port.name == key::motor_reading(key::ANY_MOTOR).port().name
}

/// What was found of one thing.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Finding {
    /// Who.
    about: String,
    /// What was found, in a word or two.
    verdict: &'static str,
    /// Whether all is well with it.
    is_well: bool,
    /// What exactly was found.
    detail: String,
    /// What to do.
    fix: String,
}

impl Finding {
    fn well(about: impl Into<String>, verdict: &'static str, detail: impl Into<String>) -> Self {
        Self { about: about.into(), verdict, is_well: true, detail: detail.into(), fix: String::new() }
    }
    fn wrong(
        about: impl Into<String>,
        verdict: &'static str,
        detail: impl Into<String>,
        fix: impl Into<String>,
    ) -> Self {
        Self { about: about.into(), verdict, is_well: false, detail: detail.into(), fix: fix.into() }
    }
}

/// Looks at every pair of a topology.
///
/// # Errors
/// How many of them are not well.
pub(super) async fn examine(settings: &Settings, topology: &Topology, json: bool) -> anyhow::Result<()> {
    let (views, mut findings) = look(settings, topology).await?;
    findings.extend(of_processes(topology, &views));
    findings.extend(topology.wires().iter().map(|wire| of_wire(topology, &views, settings, wire)));
    for view in views.into_values() {
        view.mesh.leave().await;
    }
    for finding in &findings {
        if json {
            let Finding { about, verdict, is_well, detail, fix } = finding;
            data(&serde_json::json!({ "about": about, "verdict": verdict, "well": is_well, "detail": detail, "fix": fix }).to_string())?;
        }
    }
    if !json {
        let rows = findings
            .iter()
            .map(|found| vec![found.about.clone(), found.verdict.to_owned(), found.detail.clone()]);
        table(&["between", "found", "detail"], rows)?;
    }
    let mut told = BTreeSet::new();
    for finding in findings.iter().filter(|finding| !finding.fix.is_empty()) {
        // Ten wires that lack one service are one thing to do.
        if told.insert(&finding.fix) {
            note(&format!("{}: {}", finding.verdict, finding.fix));
        }
    }
    let ill = findings.iter().filter(|finding| !finding.is_well).count();
    anyhow::ensure!(ill == 0, "{ill} of {} are not well", findings.len());
    note(&format!("all {} are well", findings.len()));
    Ok(())
}

/// What is seen from the router of one computer, twice.
struct View {
    mesh: Mesh,
    first: Vec<(Presence, Option<Status>)>,
    second: Vec<(Presence, Option<Status>)>,
    offsets: BTreeMap<String, Offset>,
}

impl View {
    /// The process that does the work of a node, with its statuses.
    fn of(&self, node: &Node<'_>) -> Option<Seen<'_>> {
        let robot = node.service.robot.as_ref().map_or(ALL, RobotId::as_str);
        let here = |list: &'_ [(Presence, Option<Status>)]| -> Vec<usize> {
            let is_it = |presence: &Presence| presence.service == node.entry.name && presence.robot == robot;
            (0..list.len()).filter(|index| is_it(&list[*index].0)).collect()
        };
        let candidates = here(&self.second);
        // Of several (an old run whose token is still there) the one that answers counts.
        let index = candidates.iter().find(|index| self.second[**index].1.is_some()).or(candidates.first())?;
        let (presence, later) = &self.second[*index];
        let earlier = self
            .first
            .iter()
            .find(|(other, _)| other.boot == presence.boot)
            .and_then(|(_, status)| status.as_ref());
        Some(Seen { presence, earlier, later: later.as_ref() })
    }
}

/// One process as seen from one router.
#[derive(Clone, Copy)]
struct Seen<'a> {
    presence: &'a Presence,
    earlier: Option<&'a Status>,
    later: Option<&'a Status>,
}

/// Joins every router of the topology, and asks everybody there twice.
async fn look(
    settings: &Settings,
    topology: &Topology,
) -> anyhow::Result<(BTreeMap<String, View>, Vec<Finding>)> {
    let (mut meshes, mut findings) = (Vec::new(), Vec::new());
    let identity = settings.identity()?;
    for (host, described) in &topology.hosts {
        // The only router of a topology may as well listen elsewhere, as `axle up --listen` lets it.
        let endpoint =
            if topology.hosts.len() == 1 { settings.connect[0].clone() } else { described.router.clone() };
        let endpoint = settings.endpoint(&endpoint);
        let about = format!("router of {host}");
        let (at, own) = (endpoint.clone(), identity.clone());
        let reach = tokio::task::spawn_blocking(move || probe(&at, own.as_ref())).await?;
        let Reach::Open { certificate, .. } = &reach else {
            let verdict = match &reach {
                Reach::OtherName { .. } => "certificate name mismatch",
                Reach::Nobody { .. } => "unreachable",
                _ => "refused",
            };
            findings.push(Finding::wrong(about, verdict, endpoint, reach.to_string()));
            continue;
        };
        findings.extend(certificate.as_ref().map(|own| of_certificate(&about, own.name(), own.expires)));
        let own = axle_mesh::Settings { connect: vec![endpoint.clone()], ..settings.mesh("doctor", None)? };
        match join(own, Patience::AtMost(JOINING)).await {
            Ok(mesh) => {
                findings.push(Finding::well(about, "reachable", endpoint));
                meshes.push((host.clone(), mesh));
            }
            Err(fault) => findings.push(Finding::wrong(about, "unreachable", endpoint, format!("{fault:#}"))),
        }
    }
    findings.extend(
        identity.iter().map(|own| of_certificate("this doctor", own.name(), own.certificate.expires)),
    );
    let mut views = BTreeMap::new();
    for (host, mesh) in meshes {
        let first = mesh.everybody(PATIENCE).await?;
        views.insert(host, View { mesh, first, second: Vec::new(), offsets: BTreeMap::new() });
    }
    tokio::time::sleep(LOOKING).await;
    for view in views.values_mut() {
        view.second = look_again(&view.mesh, &view.first).await?;
        // By those of the second look: the first answer of a router that one has just joined may lack everybody.
        view.offsets = clocks::measure(&view.mesh, &view.second, PATIENCE).await;
    }
    findings.extend(of_clocks(&views));
    Ok((views, findings))
}

/// Who is there now. Whoever was there a moment ago and is missed in one answer of the router is asked for again before
/// anybody is told that it has gone.
async fn look_again(
    mesh: &Mesh,
    before: &[(Presence, Option<Status>)],
) -> anyhow::Result<Vec<(Presence, Option<Status>)>> {
    let mut seen: BTreeMap<String, (Presence, Option<Status>)> = BTreeMap::new();
    for _ in 0..3 {
        for (presence, status) in mesh.everybody(PATIENCE).await? {
            let place = seen.entry(presence.alive()).or_insert((presence, None));
            place.1 = status.or(place.1.take());
        }
        let is_missed = |(presence, status): &(Presence, Option<Status>)| {
            seen.get(&presence.alive()).is_none_or(|(_, later)| status.is_some() && later.is_none())
        };
        if !before.iter().any(is_missed) {
            break;
        }
    }
    Ok(seen.into_values().collect())
}

fn of_certificate(about: &str, name: &str, expires: f64) -> Finding {
    let left = expires - axle_mesh::clock::wall();
    let detail = format!("the certificate of {name} is valid for {}", span(left.max(0.0)));
    if left < SOON {
        let fix = format!("issue it anew with `axle keys issue {name}`, and start {about} with it");
        Finding::wrong(about, "certificate ends soon", detail, fix)
    } else {
        Finding::well(about, "certificate", detail)
    }
}

/// The clocks of all computers against the one of this computer; each computer once.
fn of_clocks(views: &BTreeMap<String, View>) -> Vec<Finding> {
    let mut best: BTreeMap<&String, Offset> = BTreeMap::new();
    for (host, offset) in views.values().flat_map(|view| &view.offsets) {
        let known = best.entry(host).or_insert(*offset);
        if offset.uncertainty < known.uncertainty {
            *known = *offset;
        }
    }
    let finding = |(host, Offset { seconds, uncertainty }): (&String, Offset)| {
        let about = format!("clock of {host}");
        let detail = format!("{:+.1} ms ± {:.1} ms against this computer", seconds * 1e3, uncertainty * 1e3);
        if seconds.abs() - uncertainty > CLOCKS {
            let fix = format!(
                "set the clock of {host} (chrony or systemd-timesyncd): no motion depends on it, but logs, recordings and \
                 certificates do"
            );
            Finding::wrong(about, "clock offset", detail, fix)
        } else {
            Finding::well(about, "clock", detail)
        }
    };
    best.into_iter().map(finding).collect()
}

/// Certificates and versions of the processes themselves.
fn of_processes(topology: &Topology, views: &BTreeMap<String, View>) -> Vec<Finding> {
    let mut findings = Vec::new();
    for node in topology.nodes() {
        let seen = views.get(topology.host_of(&node)).and_then(|view| view.of(&node));
        let Some(status) = seen.and_then(|seen| seen.later) else { continue };
        let (name, own) = (node.name(), access::owner(&node).to_string());
        if let Some(shown) = &status.certificate {
            findings.push(of_certificate(&name, &shown.name, shown.expires.0));
            if shown.name != own {
                findings.push(Finding::wrong(
                    &name,
                    "denied by access rules",
                    format!("it shows the certificate of {}", shown.name),
                    format!("start {name} with the identity of {own}"),
                ));
            }
        }
        if status.version != env!("CARGO_PKG_VERSION") {
            findings.push(Finding::wrong(
                &name,
                "version differs",
                format!("it is {}, this doctor is {}", status.version, env!("CARGO_PKG_VERSION")),
                "install the same version of Axle on every computer".to_owned(),
            ));
        }
    }
    findings
}

/// How a node is started.
fn start(topology: &Topology, node: &Node<'_>) -> String {
    let robot = node.service.robot.as_ref().map(|robot| format!(" --robot {robot}")).unwrap_or_default();
    let (kind, host) = (node.entry.name, topology.host_of(node));
    format!("start it on {host} with `axle run {kind}{robot} --host {host}`, or look at its log")
}

/// What is wrong with one end, if anything: it is not there, or it hangs.
fn of_end(
    topology: &Topology,
    about: &str,
    view: &View,
    node: &Node<'_>,
    is_from: bool,
) -> Result<(), Finding> {
    let (name, host) = (node.name(), topology.host_of(node));
    let verdict = if is_from { "nobody says it" } else { "nobody listens" };
    match view.of(node) {
        None => Err(Finding::wrong(
            about,
            verdict,
            format!("{name} is not on the mesh of {host}"),
            format!("{name}: {}", start(topology, node)),
        )),
        Some(Seen { later: None, presence, .. }) => Err(Finding::wrong(
            about,
            "silent",
            format!("{name} is there (process {} on {}) but does not answer", presence.pid, presence.host),
            format!(
                "{name} hangs: end process {} on {}, and {}",
                presence.pid,
                presence.host,
                start(topology, node)
            ),
        )),
        Some(_) => Ok(()),
    }
}

fn of_wire(
    topology: &Topology,
    views: &BTreeMap<String, View>,
    settings: &Settings,
    wire: &Wire<'_>,
) -> Finding {
    let (from, to) = (&wire.from, &wire.to);
    let arrow = if wire.is_call { "asks" } else { "says" };
    let about = format!("{} {arrow} {} to {}", from.name(), wire.port, to.name());
    let (near, far) = (topology.host_of(from), topology.host_of(to));
    let (Some(at_near), Some(at_far)) = (views.get(near), views.get(far)) else {
        return Finding::wrong(about, "unreachable", "a router on the way cannot be reached from here", "");
    };
    match pair(topology, &about, wire, (near, at_near), (far, at_far), settings) {
        Ok(finding) | Err(finding) => finding,
    }
}

#[allow(
    clippy::too_many_lines,
    reason = "the questions in the order in which they are asked, each with its verdict"
)]
fn pair(
    topology: &Topology,
    about: &str,
    wire: &Wire<'_>,
    (near, at_near): (&str, &View),
    (far, at_far): (&str, &View),
    settings: &Settings,
) -> Result<Finding, Finding> {
    let (from, to) = (&wire.from, &wire.to);
    of_end(topology, about, at_near, from, true)?;
    of_end(topology, about, at_far, to, false)?;
    // Each end is asked from the router of the other: the question and its answer cross the link.
    for (node, view, seen_from) in [(from, at_far, far), (to, at_near, near)] {
        if view.of(node).and_then(|seen| seen.later).is_none() {
            let home = topology.host_of(node);
            return Err(Finding::wrong(
                about,
                "connected but not relayed",
                format!(
                    "{} answers at the router of {home}, and not through the router of {seen_from}",
                    node.name()
                ),
                format!(
                    "the routers of {home} and {seen_from} do not link: name the one in `links` of the other, and see that \
                     its port can be reached"
                ),
            ));
        }
    }
    let (Some(sender), Some(receiver)) = (at_near.of(from), at_far.of(to)) else {
        return Err(Finding::wrong(about, "silent", "it has just gone", ""));
    };
    if wire.is_call {
        return Ok(Finding::well(about, "answers", "both ends answer through the router of the other"));
    }
    let robot = from.service.robot.as_ref().or(to.service.robot.as_ref());
    let key = wire.port.key(robot);
    let said = [sender.earlier, sender.later].map(|status| flow(&status?.said, &key));
    let heard = [receiver.earlier, receiver.later].map(|status| flow(&status?.heard, &key));
    let Some(arrived) = heard[1] else {
        return Err(Finding::wrong(
            about,
            "nobody listens",
            format!("{} does not listen to {key}", to.name()),
            format!("{} was started with other inputs than this topology: start it anew from it", to.name()),
        ));
    };
    let more = |flows: [Option<&Flow>; 2]| {
        flows[1].map_or(0, |flow| flow.count.saturating_sub(flows[0].map_or(0, |before| before.count)))
    };
    if arrived.refused > heard[0].map_or(0, |before| before.refused)
        || (arrived.refused > 0 && arrived.refused == arrived.count)
    {
        let versions = [sender, receiver]
            .map(|seen| seen.later.map(|status| status.version.clone()).unwrap_or_default());
        return Err(Finding::wrong(
            about,
            "schema differs",
            arrived.why.clone().unwrap_or_default(),
            format!(
                "{} ({}) cannot read what comes on {key} from {} ({}): install the same version, and see that nobody else \
                 publishes there",
                to.name(),
                versions[1],
                from.name(),
                versions[0]
            ),
        ));
    }
    match (more(said), more(heard)) {
        (0, _) if is_steady(wire.port) => Err(Finding::wrong(
            about,
            "silent",
            format!("{} has said nothing on {key} for {LOOKING:?}", from.name()),
            format!(
                "{} is alive but says nothing: look at its log, and at what it needs itself",
                from.name()
            ),
        )),
        (0, _) => {
            Ok(Finding::well(about, "at rest", "nothing was said in the meantime, and both ends answer"))
        }
        (sent, 0) if settings.identity.is_some() => Err(Finding::wrong(
            about,
            "denied by access rules",
            format!("{sent} were sent, none arrived"),
            format!(
                "the routers run with other rules than this topology has: `axle keys issue --topology FILE` writes them, \
                 bring them to {near} and {far}, and start the routers anew"
            ),
        )),
        (sent, 0) => Err(Finding::wrong(
            about,
            "connected but not relayed",
            format!("{sent} were sent, none arrived"),
            format!("the routers of {near} and {far} pass questions on but not this stream: start them anew"),
        )),
        (sent, arrived) => Ok(Finding::well(about, "flows", format!("{sent} sent, {arrived} arrived"))),
    }
}

fn flow<'a>(flows: &'a [Flow], key: &str) -> Option<&'a Flow> {
    flows.iter().find(|flow| flow.key == key)
}

/// The name of a computer as presences show it.
pub(super) fn host_of(presence: &Presence) -> String {
    chunk(&presence.host)
}
