//! Pages of the documentation that are generated from the code; CI compares them with the files in `docs/`.

mod dead_reckoning;

use crate::catalog::{CATALOG, Scope};
use crate::cli::{Cli, Page};
use axle_schema::key::{ANY_CORRECTOR, Kind, TABLE};
use clap::CommandFactory as _;
use std::fmt::Write as _;

/// The text of a page, in Markdown.
pub(crate) fn page(page: Page) -> String {
    match page {
        Page::Keys => keys(),
        Page::Services => services(),
        Page::Cli => cli(),
        Page::DeadReckoning => dead_reckoning::page(),
    }
}

const GENERATED: &str = "<!-- Generated from the code by `axle docs`; CI compares it. -->\n";

fn keys() -> String {
    let mut text = format!(
        "# Keys\n\n{GENERATED}\nA key is `axle/<robot>/<service>/<stream>`. Robot ids match `[a-z0-9-]{{1,32}}`; `all` is \
         reserved for planners that serve every robot. Payloads are CBOR maps described in \
         [schema/axle.cddl](../schema/axle.cddl); the encoding of a sample is `application/cbor;` and the name of its \
         type. `{ANY_CORRECTOR}` stands for the name of any corrector.\n\n\
         | key after `axle/<robot>/` | kind | carries | answers | what it is |\n|---|---|---|---|---|\n"
    );
    for entry in TABLE {
        let kind = match entry.kind {
            Kind::Stream => "stream",
            Kind::Call => "call",
        };
        let answers = entry.answers().map_or_else(String::new, |answers| format!("`{answers}`"));
        let line = format!(
            "| `{}/{}` | {kind} | `{}` | {answers} | {} |\n",
            entry.service,
            entry.name,
            entry.carries(),
            entry.about
        );
        text.push_str(&line);
    }
    text.push_str(
        "\nEvery sample may carry an attachment, `axle.Meta.v1`: sequence number, source, wall time and the sample that \
         caused it. A refused question is answered with an error of the encoding `application/cbor;axle.Refusal.v1`.\n\n\
         Presence is hidden from a tap on `axle/**`: a liveliness token at \
         `axle/<robot>/@alive/<service>/<host>/<pid>/<boot>` for each process, and its status, `axle.Status.v1`, as the \
         answer of a query to `axle/<robot>/@status/<service>/<boot>`.\n",
    );
    text
}

fn services() -> String {
    let mut text = format!(
        "# Services and their parameters\n\n{GENERATED}\n| service | works for | what it does |\n|---|---|---|\n"
    );
    for entry in CATALOG {
        let scope = match entry.scope {
            Scope::AllRobots => "all robots",
            Scope::OneRobot => "one robot",
        };
        // Writing to a string cannot fail.
        let _ = writeln!(text, "| [`{0}`](#{0}) | {scope} | {1} |", entry.name, entry.about);
    }
    for entry in CATALOG {
        let _ = write!(
            text,
            "\n## {}\n\n{}\n\n```toml\n{}\n```\n",
            entry.name,
            entry.about,
            entry.params.trim_end()
        );
    }
    text
}

fn cli() -> String {
    let mut text = format!("# The command line\n\n{GENERATED}\n");
    let command = Cli::command().term_width(100);
    let _ = write!(text, "```text\n{}\n```\n", clean(&command.clone().render_long_help().to_string()));
    for sub in command.get_subcommands().filter(|sub| !sub.is_hide_set()) {
        let mut sub = sub.clone().term_width(100).bin_name(format!("axle {}", sub.get_name()));
        let help = clean(&sub.render_help().to_string());
        let _ = write!(text, "\n## axle {}\n\n```text\n{help}\n```\n", sub.get_name());
    }
    text
}

/// Help texts without blanks at the ends of lines.
fn clean(help: &str) -> String {
    help.trim_end().lines().map(str::trim_end).collect::<Vec<_>>().join("\n")
}
