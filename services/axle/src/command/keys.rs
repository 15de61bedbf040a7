//! `axle keys`: a private authority, certificates for services, routers and people, and the access rules that follow.

use super::check;
use crate::access;
use crate::cli::{Issue as Args, Keys as Command};
use crate::keys::{Issue, Keys, Ledger, Owner, Role};
use crate::out::{data, note, table, usage};
use crate::settings::SOON;
use crate::topology::Topology;
use axle_mesh::identity::{SECURE, is_address, span};
use std::collections::BTreeSet;
use std::path::Path;

pub(super) fn keys(command: &Command) -> anyhow::Result<()> {
    match command {
        Command::Init { directory, name, days } => {
            Keys::init(&directory.keys, name, *days)?;
            let place = directory.keys.display();
            note(&format!(
                "an authority is made in {place}: keep {place}/ca.key.pem on this computer, and issue certificates with \
                 `axle keys issue --topology FILE`"
            ));
            Ok(())
        }
        Command::Issue(args) => issue(args),
        Command::Revoke { name, topology, directory } => revoke(name, topology.as_deref(), &directory.keys),
        Command::Show { directory, json } => show(&Keys::open(&directory.keys)?.ledger, *json),
    }
}

fn issue(args: &Args) -> anyhow::Result<()> {
    let topology = check::read(args.topology.as_deref())?;
    let mut keys = Keys::open(&args.directory.keys)?;
    let owners = if args.names.is_empty() {
        // Whose certificate ends soon gets a new one in time.
        #[allow(clippy::cast_precision_loss, reason = "seconds since 1970")]
        let lasts = |expires: i64| {
            expires as f64 > axle_mesh::clock::wall() + SOON.min(f64::from(args.days) * 43_200.0)
        };
        let lacks = |owner: &Owner| !keys.ledger.accepted_of(owner).any(|entry| lasts(entry.expires));
        everybody(&topology).into_iter().filter(lacks).collect()
    } else {
        args.names.iter().map(|name| Owner::parse(name).map_err(usage)).collect::<anyhow::Result<Vec<_>>>()?
    };
    let orders =
        owners.into_iter().map(|owner| order(args, &topology, owner)).collect::<anyhow::Result<Vec<_>>>()?;
    for order in &orders {
        let entry = keys.issue(order)?;
        note(&format!("issued {} ({}) for {} days", entry.common_name, entry.role.word(), order.days));
    }
    if orders.is_empty() {
        note("everybody of the topology has a certificate already");
    }
    say_rules(&keys, &topology)
}

/// What is issued to an owner.
fn order(args: &Args, topology: &Topology, owner: Owner) -> anyhow::Result<Issue> {
    let mut order = Issue {
        role: Role::Service,
        robots: Vec::new(),
        addresses: Vec::new(),
        days: args.days,
        owner: owner.clone(),
    };
    match owner {
        Owner::Service { .. } => {}
        Owner::Router { ref host } | Owner::Page { ref host } => {
            order.role = if matches!(owner, Owner::Page { .. }) { Role::Page } else { Role::Router };
            if let Some(wrong) = args.address.iter().find(|address| !is_address(address)) {
                return Err(usage(format!(
                    "--address {wrong:?}: write a host name or an address, without a port"
                )));
            }
            order.addresses = addresses(topology, host).chain(args.address.clone()).collect();
            let mut seen = BTreeSet::new();
            order.addresses.retain(|address| seen.insert(address.clone()));
        }
        Owner::Person { name } => {
            order.role = args.role.ok_or_else(|| {
                usage(format!(
                    "{name} is a person: say what they may do with --role viewer, operator or commander"
                ))
            })?;
            order.robots.clone_from(&args.robots);
        }
    }
    Ok(order)
}

/// Whoever a topology names.
fn everybody(topology: &Topology) -> Vec<Owner> {
    let routers = topology.hosts.keys().map(|host| Owner::Router { host: host.clone() });
    let services = topology.nodes().iter().map(access::owner).collect::<BTreeSet<_>>();
    routers.chain(services).collect()
}

/// Where the router of a computer is reached: by its endpoint, by its name, and on itself.
fn addresses(topology: &Topology, host: &str) -> impl Iterator<Item = String> {
    let endpoint = topology.hosts.get(host).map_or("", |host| &*host.router);
    let address = endpoint.trim_start_matches("tcp/").trim_start_matches(SECURE);
    let own = address.rsplit_once(':').map_or("", |(host, _)| host);
    let own = own.trim_start_matches('[').trim_end_matches(']').to_owned();
    // Names of hosts in a topology are free; one that no certificate can hold is left out.
    [own, "localhost".into(), "127.0.0.1".into(), host.to_owned()].into_iter().filter(|name| is_address(name))
}

fn revoke(name: &str, topology: Option<&Path>, directory: &Path) -> anyhow::Result<()> {
    let topology = check::read(topology)?;
    let mut keys = Keys::open(directory)?;
    let owner = Owner::parse(name).map_err(usage)?;
    let count = keys.revoke(&owner)?;
    anyhow::ensure!(count > 0, "{name} has no certificate that could be revoked; see `axle keys show`");
    note(&format!(
        "revoked {count} of {name}: routers let it do nothing as soon as they have the new access rules and are started \
         anew; `axle keys issue {name}` issues a new one"
    ));
    if let Owner::Router { .. } = owner {
        note(
            "services look only at the authority and the name of a router: if its key was stolen, make a new authority, and \
             issue everything anew",
        );
    }
    say_rules(&keys, &topology)
}

fn say_rules(keys: &Keys, topology: &Topology) -> anyhow::Result<()> {
    let written = keys.write_rules(topology)?;
    if !written.is_empty() {
        note(&format!(
            "wrote the access rules of {}; a running router reads them when it starts",
            written.join(", ")
        ));
    }
    Ok(())
}

fn show(ledger: &Ledger, json: bool) -> anyhow::Result<()> {
    let now = axle_mesh::clock::wall();
    #[allow(clippy::cast_precision_loss, reason = "seconds since 1970")]
    let left = |expires: i64| expires as f64 - now;
    let state = |entry: &crate::keys::Entry| match left(entry.expires) {
        _ if entry.revoked => "revoked",
        left if left <= 0.0 => "expired",
        left if left < SOON => "expires soon",
        _ => "valid",
    };
    if json {
        let rows = ledger.certificates.iter().map(|entry| {
            serde_json::json!({
                "name": entry.name, "common_name": entry.common_name, "role": entry.role, "robots": entry.robots,
                "serial": entry.serial, "issued": entry.issued, "expires": entry.expires, "state": state(entry),
            })
        });
        return Ok(data(&serde_json::Value::from(rows.collect::<Vec<_>>()).to_string())?);
    }
    let rows = ledger.certificates.iter().map(|entry| {
        let robots = entry.robots.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
        vec![
            entry.common_name.clone(),
            entry.role.word().to_owned(),
            robots,
            entry.serial.chars().take(8).collect(),
            state(entry).to_owned(),
            span(left(entry.expires).max(0.0)),
        ]
    });
    Ok(table(&["certificate", "role", "only", "serial", "state", "left"], rows)?)
}
