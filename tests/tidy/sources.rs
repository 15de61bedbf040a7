//! Rules about Rust sources, and about every file.

use super::{File, Findings, Repository, keep, prove};

/// Lines that one file may have.
const MOST_LINES: usize = 600;

/// Crates that join algorithms to the world; every other one is an algorithm.
const JOINS_THE_WORLD: &[&str] = &["services/mesh/", "services/axle/", "router/"];

/// What an algorithm does not name, and what it would be for.
const WORLDLY: &[(&str, &str)] = &[
    ("Instant", "a clock"),
    ("SystemTime", "a clock"),
    ("std::thread", "a thread"),
    ("thread::", "a thread"),
    ("sleep(", "waiting"),
    ("tokio", "a runtime"),
    ("std::net", "the network"),
    ("zenoh", "the network"),
    ("std::fs", "files"),
    ("std::env", "the environment"),
    ("std::process", "processes"),
    ("rand::", "randomness"),
    ("RandomState", "randomness"),
    ("println!", "printing"),
    ("eprintln!", "printing"),
];

/// What some algorithms name all the same: the recorder writes files, that is its work; a bench that judges the slowest
/// of many searches measures and prints by itself.
const ALLOWED: &[(&str, &str)] = &[
    ("services/recorder/", "std::fs"),
    ("services/pathfinder/benches/", "Instant"),
    ("services/pathfinder/benches/", "println!"),
];

/// The lines, counted from 1, on which `what` stands as a word of its own.
fn lines_with(code: &str, what: &str) -> Vec<usize> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let stands_alone = |line: &str, at: usize| {
        let (before, behind) = (line[..at].chars().next_back(), line[at + what.len()..].chars().next());
        let begins = !(what.starts_with(is_word) && before.is_some_and(is_word));
        begins && !(what.ends_with(is_word) && behind.is_some_and(is_word))
    };
    let lines = code.lines().enumerate();
    lines
        .filter(|(_, line)| line.match_indices(what).any(|(at, _)| stands_alone(line, at)))
        .map(|(index, _)| index + 1)
        .collect()
}

fn is_algorithm(path: &str) -> bool {
    let in_crate = path.starts_with("services/") || path.starts_with("schema/");
    in_crate && !JOINS_THE_WORLD.iter().any(|joins| path.starts_with(joins))
}

fn names_zenoh(file: &File) -> Findings {
    let may = ["services/mesh/", "router/"].iter().any(|may| file.path.starts_with(may));
    if may || !file.is_rust() {
        return Findings::new();
    }
    let code = file.lexed().code;
    let lines = ["zenoh::", "use zenoh", "crate zenoh"].iter().flat_map(|what| lines_with(&code, what));
    lines.map(|line| file.at(line, "zenoh is named outside of mesh and router")).collect()
}

#[test]
fn zenoh_is_named_in_the_wires_only() {
    prove(
        names_zenoh,
        &[
            ("services/axle/src/out.rs", "//! x\nlet s = zenoh::open(c);", "out.rs:2"),
            ("services/pilot/src/lib.rs", "use zenoh as z;", "lib.rs:1"),
        ],
        &[
            ("services/mesh/src/lib.rs", "use zenoh::Session;"),
            ("services/axle/src/out.rs", "// zenoh::open\nlet s = \"zenoh::\"; axle_zenoh::x();"),
            ("tests/stranger.rs", "use zenoh::Session;"),
        ],
    );
}

fn spells_a_key(file: &File) -> Findings {
    if file.path == "schema/src/key.rs" || !file.is_rust() {
        return Findings::new();
    }
    let spoken = file.lexed().spoken;
    lines_with(&spoken, "\"axle/")
        .iter()
        .map(|&line| file.at(line, "a key is spelt outside of key.rs"))
        .collect()
}

#[test]
fn keys_are_spelt_in_one_file() {
    prove(
        spells_a_key,
        &[
            ("services/axle/src/run.rs", "let key = format!(\"axle/{robot}/x\");", "run.rs:1"),
            ("services/mesh/src/a.rs", "//! a\n\nconst KEY: &str = \"axle/**\";", "a.rs:3"),
        ],
        &[
            ("schema/src/key.rs", "const KEY: &str = \"axle/**\";"),
            ("services/axle/src/cli.rs", "/// Such as \"axle/r1/x\".\nfn a() { b(\"axle\") }"),
            ("services/axle/src/a.rs", "#[cfg(test)]\nmod tests { const KEY: &str = \"axle/**\"; }"),
        ],
    );
}

fn reaches_the_world(file: &File) -> Findings {
    if !is_algorithm(&file.path) || !file.is_rust() {
        return Findings::new();
    }
    let code = file.lexed().code;
    let may =
        |what: &str| ALLOWED.iter().any(|(path, allowed)| file.path.starts_with(path) && what == *allowed);
    let forbidden = WORLDLY.iter().filter(|(what, _)| !may(what));
    forbidden
        .flat_map(|(what, why)| {
            let lines = lines_with(&code, what);
            lines.into_iter().map(move |line| file.at(line, &format!("{what} is {why}, in an algorithm")))
        })
        .collect()
}

#[test]
fn algorithms_read_no_clock_start_no_thread_and_reach_no_network() {
    prove(
        reaches_the_world,
        &[
            ("services/pilot/src/lib.rs", "//! a\nuse std::time::Instant;", "lib.rs:2: Instant"),
            ("services/gate/src/gate.rs", "fn a() { thread::sleep(b) }", "thread::"),
            ("services/gate/src/gate.rs", "fn a() { sleep(b) }", "sleep("),
            ("schema/src/a.rs", "use std::net::TcpStream;", "std::net"),
            ("services/source/src/a.rs", "use std::fs;", "std::fs is files"),
            ("services/recorder/src/a.rs", "use std::env;", "std::env"),
            ("services/brand-new/src/lib.rs", "println!(\"\")", "println!"),
        ],
        &[
            ("services/recorder/src/write.rs", "use std::fs::File;"),
            ("services/axle/src/run.rs", "use std::time::Instant;"),
            ("services/pilot/src/lib.rs", "// Instant\nfn oversleep(instant: f64) { \"tokio\" }"),
            ("services/pilot/src/lib.rs", "#[cfg(test)]\nmod tests { use std::fs; }"),
        ],
    );
}

fn is_unfinished(file: &File) -> Findings {
    if !file.is_rust() {
        return Findings::new();
    }
    let everywhere = super::lexer::Lexed::of(&file.text).code;
    let in_tests_too = ["todo!", "unimplemented!", "#[ignore"].map(|what| (&everywhere, what));
    let own = file.lexed().code;
    let findings = in_tests_too.into_iter().chain([(&own, ".unwrap()")]);
    findings
        .flat_map(|(code, what)| lines_with(code, what).into_iter().map(move |line| file.at(line, what)))
        .collect()
}

#[test]
fn nothing_is_left_unfinished_ignored_or_unwrapped() {
    prove(
        is_unfinished,
        &[
            ("services/gate/src/a.rs", "fn a() { todo!() }", "a.rs:1: todo!"),
            ("tests/a.rs", "fn a() { unimplemented!() }", "unimplemented!"),
            ("tests/a.rs", "#[test]\n#[ignore = \"slow\"]\nfn a() {}", "a.rs:2: #[ignore"),
            ("services/gate/src/a.rs", "fn a() { b().unwrap(); }", ".unwrap()"),
        ],
        &[
            ("tests/a.rs", "fn a() { b().unwrap(); }"),
            ("services/gate/src/a.rs", "// todo!\nfn a() { b().unwrap_or(1) }"),
        ],
    );
}

fn says_no_purpose(file: &File) -> Findings {
    let begin = match file.path.rsplit_once('.').map(|(_, kind)| kind) {
        Some("rs") => "//! ",
        Some("py") => "\"\"\"",
        _ => return Findings::new(),
    };
    if file.text.starts_with(begin) {
        Findings::new()
    } else {
        vec![file.at(1, "does not begin with its purpose")]
    }
}

#[test]
fn every_source_begins_with_its_purpose() {
    prove(
        says_no_purpose,
        &[("tests/a.rs", "use b;\n//! late", "a.rs:1"), (".ci/a.py", "import b", "a.py:1")],
        &[("schema/src/a.rs", "//! What it is.\n"), ("Cargo.toml", "[package]")],
    );
}

fn is_too_long(file: &File) -> Findings {
    let is_written =
        [".rs", ".py", ".md", ".toml", ".cddl", ".ci/run"].iter().any(|end| file.path.ends_with(end));
    let lines = file.text.lines().count();
    // Nobody reads a reference from its beginning to its end.
    let is_generated =
        file.path.ends_with(".md") && file.text.contains("<!-- Generated from the code by `axle docs`");
    let too_long = is_written && !is_generated && lines > MOST_LINES;
    if too_long { vec![file.at(lines, "lines are too many: at most 600")] } else { Findings::new() }
}

#[test]
fn no_file_is_longer_than_six_hundred_lines() {
    let (long, most) = ("x\n".repeat(MOST_LINES + 1), "x\n".repeat(MOST_LINES));
    let generated = format!("<!-- Generated from the code by `axle docs`; CI compares it. -->\n{long}");
    prove(
        is_too_long,
        &[("schema/src/a.rs", &long, "a.rs:601"), ("docs/a.md", &long, "601")],
        &[("schema/src/a.rs", &most), ("tests/data/a.jsonl", &long), ("docs/a.md", &generated)],
    );
}

fn is_a_drawer(file: &File) -> Findings {
    const DRAWERS: &[&str] =
        &["manager", "helper", "helpers", "util", "utils", "common", "misc", "handler", "handlers", "shared"];
    let words = file.path.split(['/', '.', '_', '-']);
    let drawers = words.filter(|word| DRAWERS.contains(&word.to_lowercase().as_str()));
    drawers
        .map(|word| file.at(1, &format!("{word:?} is a drawer for anything; name what is in it")))
        .collect()
}

#[test]
fn no_file_is_a_drawer_for_anything() {
    prove(
        is_a_drawer,
        &[("services/axle/src/path_util.rs", "", "util"), ("tests/common/a.rs", "", "common")],
        &[("schema/src/utility_company.rs", "")],
    );
}

fn names_a_machine(file: &File) -> Findings {
    if file.path == "Cargo.lock" {
        return Findings::new();
    }
    let folders = ["work", "root", "tmp", "home"].map(|folder| format!("/{folder}/"));
    let is_absolute = |line: &str, at: usize| {
        !line[..at].chars().next_back().is_some_and(|c| c.is_alphanumeric() || "._-/*}".contains(c))
    };
    let lines = file.text.lines().enumerate();
    lines
        .filter(|(_, line)| {
            folders.iter().any(|folder| line.match_indices(folder).any(|(at, _)| is_absolute(line, at)))
        })
        .map(|(index, _)| file.at(index + 1, "a path of one machine"))
        .collect()
}

#[test]
fn no_path_of_one_machine_is_written_down() {
    let [work, tmp] = ["work", "tmp"].map(|folder| format!("see /{folder}/x\n"));
    prove(
        names_a_machine,
        &[("docs/a.md", &work, "a.md:1"), ("tests/a.rs", &tmp, "a.rs:1")],
        &[("docs/a.md", "at net/tmp/x, and in the folder tmp/")],
    );
}

#[test]
fn test_modules_in_files_of_their_own_are_known_as_tests() {
    let repository = Repository::read();
    for path in ["services/gate/src/laws.rs", "services/correctors/src/d/tests.rs", "tests/tidy/lexer.rs"] {
        assert!(repository.file(path).is_test, "{path} is a test");
    }
    for path in ["services/gate/src/gate.rs", "schema/src/key.rs", "services/axle/src/main.rs"] {
        assert!(!repository.file(path).is_test, "{path} is no test");
    }
    let sources = repository.sources().filter(|file| !file.is_test && file.lexed().code.trim().is_empty());
    keep(sources.map(|file| file.at(1, "has no code that the rules could look at")).collect());
}
