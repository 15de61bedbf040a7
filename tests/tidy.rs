//! Tidiness: what a reader of the repository may rely on, proved from its files.
//!
//! Each rule is a function from files to findings. A test first shows the rule something that breaks it, since a rule
//! that cannot fail proves nothing, and then everything in the repository. `.ci/run invariants` runs these tests, and
//! proves the direction of dependencies beside them.

mod docs;
mod lexer;
mod manifests;
mod repository;
mod sources;

use repository::{File, Repository};

/// What a rule finds, one sentence for each fault.
type Findings = Vec<String>;

/// A rule about one file.
type Rule = fn(&File) -> Findings;

/// Shows a rule what breaks it (path, text, words of the finding) and what does not, then the whole repository.
fn prove(rule: Rule, broken: &[(&str, &str, &str)], right: &[(&str, &str)]) {
    for &(path, text, words) in broken {
        let findings = rule(&File::new(path, text));
        assert!(
            findings.iter().any(|finding| finding.contains(words)),
            "{path} breaks the rule: {findings:?}"
        );
    }
    for &(path, text) in right {
        assert_eq!(rule(&File::new(path, text)), Findings::new(), "{path} keeps the rule");
    }
    keep(Repository::read().files.iter().flat_map(rule).collect());
}

/// Fails with the findings, if there are any.
fn keep(findings: Findings) {
    assert!(findings.is_empty(), "\n{}\n", findings.join("\n"));
}
