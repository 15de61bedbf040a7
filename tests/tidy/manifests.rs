//! Rules about manifests, the catalogue of services and their parameters.

use super::{File, Findings, Repository, keep, prove};
use std::collections::BTreeSet;

fn has_own_lints(file: &File) -> Findings {
    if !file.path.ends_with("/Cargo.toml") {
        return Findings::new();
    }
    let manifest: toml::Table = file.text.parse().expect("a manifest");
    let takes = manifest.get("lints").and_then(|lints| lints.get("workspace")).and_then(toml::Value::as_bool);
    if takes == Some(true) {
        Findings::new()
    } else {
        vec![file.at(1, "[lints] workspace = true is missing")]
    }
}

#[test]
fn every_crate_takes_the_lints_of_the_workspace() {
    prove(
        has_own_lints,
        &[
            ("services/a/Cargo.toml", "[package]\nname = \"a\"", "workspace = true is missing"),
            ("services/a/Cargo.toml", "[lints.clippy]\npanic = \"allow\"", "workspace = true is missing"),
        ],
        &[("services/a/Cargo.toml", "[lints]\nworkspace = true"), ("Cargo.toml", "[workspace]")],
    );
}

/// Name and sentence of every service, from the text of catalog.rs: an entry has these two strings and no others.
pub(super) fn services(catalog: &str) -> Vec<(String, String)> {
    let (_, list) = catalog.split_once("CATALOG: &[Entry] = &[").expect("the catalogue");
    let (list, _) = list.split_once("\n];").expect("the end of the catalogue");
    let strings: Vec<_> = list.split('"').skip(1).step_by(2).map(str::to_owned).collect();
    let services: Vec<_> =
        strings.chunks(2).map(|pair| (pair[0].clone(), pair.get(1).cloned().unwrap_or_default())).collect();
    for (name, about) in &services {
        let is_name = !name.is_empty() && name.chars().all(|c| c.is_ascii_lowercase() || c == '-');
        assert!(is_name && about.ends_with('.'), "{name:?}, {about:?}: an entry has a name and a sentence");
    }
    services
}

/// Services without parameters, and parameters without a service.
fn unmatched(services: &[(String, String)], files: &[&str]) -> Findings {
    let wanted: BTreeSet<_> = services.iter().map(|(name, _)| format!("deploy/params/{name}.toml")).collect();
    let found: BTreeSet<_> =
        files.iter().filter(|path| path.starts_with("deploy/params/")).map(|&path| path.into()).collect();
    let missing = wanted
        .difference(&found)
        .map(|path| format!("{path} is missing: every service ships its parameters"));
    let strange = found
        .difference(&wanted)
        .map(|path: &String| format!("{path} belongs to no service of the catalogue"));
    missing.chain(strange).collect()
}

#[test]
fn every_service_ships_its_parameters() {
    let entries = "const CATALOG: &[Entry] = &[\n  Entry { name: \"a-b\", about: \"Does.\" },\n  Entry::f::<C>(\"c\", \"Is.\"),\n];";
    let listed = services(entries);
    assert_eq!(listed, [("a-b".to_owned(), "Does.".to_owned()), ("c".to_owned(), "Is.".to_owned())]);
    assert_eq!(
        unmatched(&listed, &["deploy/params/a-b.toml", "deploy/params/c.toml", "README.md"]),
        Findings::new()
    );
    let broken = unmatched(&listed, &["deploy/params/a-b.toml", "deploy/params/d.toml"]);
    assert!(
        broken[0].contains("c.toml is missing") && broken[1].contains("d.toml belongs to no"),
        "{broken:?}"
    );

    let repository = Repository::read();
    let listed = services(&repository.file("services/axle/src/catalog.rs").text);
    assert!(listed.len() >= 8, "{listed:?}");
    keep(unmatched(&listed, &repository.files.iter().map(|file| file.path.as_str()).collect::<Vec<_>>()));
}
