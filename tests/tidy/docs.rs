//! Rules about what is written for people: links, the architecture and its invariants, the README.

use super::manifests::services;
use super::{File, Findings, Repository, keep};
use std::collections::BTreeSet;

/// A page without its blocks of code and without `code` in lines, which hold no links.
fn prose(text: &str) -> String {
    let mut in_block = false;
    let mut prose = String::new();
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            in_block = !in_block;
        } else if !in_block {
            prose.extend(line.split('`').step_by(2));
        }
        prose.push('\n');
    }
    prose
}

/// The name by which a heading is linked to.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.collect::<String>().to_lowercase().replace(' ', "-")
}

fn anchors(text: &str) -> BTreeSet<String> {
    let mut in_block = false;
    let mut found = BTreeSet::new();
    for line in text.lines() {
        in_block ^= line.trim_start().starts_with("```");
        if !in_block && line.starts_with('#') {
            found.insert(anchor(line.trim_start_matches('#')));
        }
    }
    found
}

/// `docs/../README.md` without the detour; `None` when it leads out of the repository.
fn join(page: &str, link: &str) -> Option<String> {
    let mut parts: Vec<&str> = page.split('/').collect();
    parts.pop();
    for part in link.split('/') {
        match part {
            "." | "" => {}
            ".." => drop(parts.pop()?),
            name => parts.push(name),
        }
    }
    Some(parts.join("/"))
}

/// Links of one page that lead nowhere.
fn dead_links(page: &File, files: &[File]) -> Findings {
    let mut findings = Findings::new();
    for (index, line) in prose(&page.text).lines().enumerate() {
        for link in line.split("](").skip(1).filter_map(|rest| rest.split_once(')')).map(|(link, _)| link) {
            if link.contains("://") || link.starts_with("mailto:") {
                continue;
            }
            let (path, heading) = link.split_once('#').unwrap_or((link, ""));
            let path = if path.is_empty() { Some(page.path.clone()) } else { join(&page.path, path) };
            let target = path.and_then(|path| {
                let folder = format!("{path}/");
                files.iter().find(|file| file.path == path || file.path.starts_with(&folder))
            });
            let leads =
                target.is_some_and(|target| heading.is_empty() || anchors(&target.text).contains(heading));
            if !leads {
                findings.push(page.at(index + 1, &format!("the link {link} leads nowhere")));
            }
        }
    }
    findings
}

#[test]
fn links_between_files_lead_somewhere() {
    let files = [File::new("README.md", "# The Axle: 1st"), File::new("docs/a.md", "")];
    let check = |text: &str, dead: usize| {
        assert_eq!(dead_links(&File::new("docs/b.md", text), &files).len(), dead, "{text}");
    };
    check("[a](a.md) [b](../README.md#the-axle-1st) [c](../docs) [d](https://x.y/z)", 0);
    check("`[a](none.md)`\n```\n[b](none.md)\n```", 0);
    check("[a](none.md) and [b](../../outside.md)", 2);
    check("[a](../README.md#no-heading)", 1);

    let Repository { files } = Repository::read();
    keep(
        files
            .iter()
            .filter(|file| file.path.ends_with(".md"))
            .flat_map(|page| dead_links(page, &files))
            .collect(),
    );
}

/// Folders of the top level and crates that a page does not name.
fn unnamed<'a>(page: &str, paths: impl Iterator<Item = &'a str> + Clone) -> Findings {
    let folders = paths.clone().filter_map(|path| path.split_once('/')).map(|(folder, _)| folder.to_owned());
    let crates = paths.filter_map(|path| path.strip_suffix("/Cargo.toml")).map(str::to_owned);
    let all: BTreeSet<String> = folders.chain(crates).collect();
    let named =
        |folder: &String| page.contains(&format!("`{folder}/")) || page.contains(&format!("`{folder}`"));
    let is_step = |folder: &String| folder == ".ci" && page.contains("`.ci/run");
    all.iter()
        .filter(|folder| !named(folder) && !is_step(folder))
        .map(|folder| format!("ARCHITECTURE.md does not name `{folder}/`"))
        .collect()
}

#[test]
fn the_architecture_names_every_folder_and_crate() {
    let paths = ["Cargo.toml", "router/Cargo.toml", "services/a/Cargo.toml", "docs/x.md"];
    assert_eq!(unnamed("`router/`, `services/a/`, `services/`, `docs`", paths.into_iter()), Findings::new());
    let findings = unnamed("`router/`, `services/`", paths.into_iter());
    assert_eq!(findings.len(), 2, "{findings:?}");

    let repository = Repository::read();
    let page = &repository.file("ARCHITECTURE.md").text;
    keep(unnamed(page, repository.files.iter().map(|file| file.path.as_str())));
}

/// Everything that an invariant may name as its enforcer.
#[derive(Default)]
struct Enforcers {
    steps: BTreeSet<String>,
    tests: BTreeSet<String>,
    lints: BTreeSet<String>,
}

impl Enforcers {
    fn of(repository: &Repository) -> Self {
        let steps = repository.file(".ci/run").text.lines().filter_map(step).map(str::to_owned).collect();
        let tests = repository
            .sources()
            .flat_map(|file| test_names(&super::lexer::Lexed::of(&file.text).code))
            .collect();
        let manifest: toml::Table =
            repository.file("Cargo.toml").text.parse().expect("the manifest of the workspace");
        let lints = manifest["workspace"]["lints"].as_table().expect("lints").values();
        let lints = lints.filter_map(toml::Value::as_table).flat_map(toml::Table::keys).cloned().collect();
        Self { steps, tests, lints }
    }
    /// Whether `name` enforces something; an unknown step is wrong, any other word is just a word.
    fn knows(&self, name: &str) -> Result<bool, String> {
        if let Some(step) = name.strip_prefix(".ci/run ") {
            return if self.steps.contains(step) {
                Ok(true)
            } else {
                Err(format!(".ci/run has no step {step}"))
            };
        }
        let last = name.rsplit("::").next().unwrap_or(name);
        Ok(self.tests.contains(last) || self.lints.contains(last))
    }
}

/// The name of the step that a line of `.ci/run` defines.
fn step(line: &str) -> Option<&str> {
    line.strip_prefix("step_").and_then(|rest| rest.split_once("() {")).map(|(name, _)| name)
}

/// The names of functions behind `#[test]` and `#[tokio::test(…)]`.
fn test_names(code: &str) -> Vec<String> {
    let behind = ["#[test]", "#[tokio::test"].into_iter().flat_map(|mark| code.split(mark).skip(1));
    let names = behind.filter_map(|rest| rest.split_once("fn ")).map(|(_, rest)| rest);
    names.map(|rest| rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()).collect()
}

/// Invariants of a page that name no check, or one that does not exist. An invariant is `**I7** …` up to the next one
/// or to an empty line; the numbers go from 1 without a gap.
fn unenforced(page: &str, enforcers: &Enforcers) -> Findings {
    let mut findings = Findings::new();
    let mut next = 1;
    for part in page.split("**I").skip(1) {
        let Some((number, rest)) = part.split_once("**") else { continue };
        let Ok(number) = number.parse::<u32>() else { continue };
        if number != next {
            findings.push(format!("**I{number}** stands where **I{next}** is due"));
        }
        next = number + 1;
        let text = rest.split("\n\n").next().unwrap_or_default();
        let mut is_enforced = false;
        for name in text.split('`').skip(1).step_by(2) {
            match enforcers.knows(&name.replace('\n', " ")) {
                Ok(known) => is_enforced |= known,
                Err(why) => findings.push(format!("**I{number}**: {why}")),
            }
        }
        if !is_enforced {
            findings.push(format!("**I{number}** names no step of .ci/run, no test and no lint"));
        }
    }
    if next == 1 {
        findings.push("no line **I1** was found".to_owned());
    }
    findings
}

#[test]
fn every_invariant_names_a_check_that_exists() {
    let set = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
    let enforcers =
        Enforcers { steps: set(&["doc"]), tests: set(&["it_holds"]), lints: set(&["unsafe_code"]) };
    let check = |page: &str, words: &str| {
        let findings = unenforced(page, &enforcers).join("\n");
        assert!(
            if words.is_empty() { findings.is_empty() } else { findings.contains(words) },
            "{page:?}: {findings:?}"
        );
    };
    check("**I1** a — `.ci/run doc`.\n**I2** b `x`, `gate::laws::it_holds`\n\n* **I3** c: `unsafe_code`", "");
    check("**I1** a — `.ci/run\ndoc`.", "");
    check("**I1** a — `.ci/run dock`", "no step dock");
    check("**I1** a — `it_held`", "**I1** names no");
    check("**I1** a\n\n`it_holds`", "**I1** names no");
    check("**I1** `it_holds`\n**I3** `it_holds`", "**I3** stands where **I2**");
    check("# Invariants", "no line **I1**");
    let code = "#[test]\n#[a]\nfn b_c() {} fn d() {} #[tokio::test(e = \"\")]\nasync fn f() {}";
    assert_eq!(test_names(code), ["b_c", "f"]);

    let repository = Repository::read();
    keep(unenforced(&repository.file("ARCHITECTURE.md").text, &Enforcers::of(&repository)));
}

/// Rows of the catalogue that a page lacks or tells in other words.
fn missing_rows(page: &str, services: &[(String, String)]) -> Findings {
    let rows = services.iter().map(|(name, about)| format!("| `{name}` | {about} |"));
    rows.filter(|row| !page.contains(row)).map(|row| format!("README.md lacks the row {row}")).collect()
}

#[test]
fn the_readme_lists_the_services_of_the_catalogue() {
    let listed = [("a".to_owned(), "Does.".to_owned())];
    assert_eq!(missing_rows("| `a` | Does. |", &listed), Findings::new());
    assert_eq!(missing_rows("| `a` | Did. |", &listed).len(), 1);

    let repository = Repository::read();
    let listed = services(&repository.file("services/axle/src/catalog.rs").text);
    keep(missing_rows(&repository.file("README.md").text, &listed));
}

#[test]
fn people_and_ci_test_with_the_same_command() {
    let repository = Repository::read();
    let (_, rest) = repository.file(".ci/run").text.split_once("step_test() {").expect("the step test");
    let command = rest.lines().nth(1).expect("its command").trim();
    assert!(command.starts_with("cargo test "), "{command:?}");
    for page in ["README.md", "CONTRIBUTING.md"] {
        assert!(repository.file(page).text.contains(command), "{page} does not say `{command}`");
    }
}
