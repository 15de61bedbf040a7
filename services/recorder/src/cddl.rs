//! The part of the shipped CDDL that describes one message: small enough to stand in every recording.

use std::collections::BTreeSet;

/// One rule of a CDDL text, with the comment above it.
struct Rule<'a> {
    name: &'a str,
    text: &'a str,
    /// Where the rule itself begins, after its comment.
    body: &'a str,
}

/// The rule `name` of `text` and every rule it needs, itself first, as RFC 8610 wants the root; `None` when there is
/// no such rule.
///
/// Rules are separated by empty lines and begin at the start of a line, as those of `axle.cddl` do.
#[must_use]
pub fn excerpt(text: &str, name: &str) -> Option<String> {
    let rules: Vec<Rule<'_>> = text.split("\n\n").filter_map(rule).collect();
    let mut wanted = vec![rules.iter().position(|rule| rule.name == name)?];
    let mut seen = BTreeSet::from([name]);
    let mut next = 0;
    while let Some(&index) = wanted.get(next) {
        next += 1;
        for word in words(rules.get(index)?.body) {
            if let Some(found) = rules.iter().position(|rule| rule.name == word)
                && seen.insert(word)
            {
                wanted.push(found);
            }
        }
    }
    let texts: Vec<&str> =
        wanted.into_iter().filter_map(|index| rules.get(index)).map(|rule| rule.text).collect();
    Some(texts.join("\n\n") + "\n")
}

fn rule(block: &str) -> Option<Rule<'_>> {
    let text = block.trim_matches('\n');
    let begin = text
        .split_inclusive('\n')
        .scan(0, |at, line| {
            let begin = *at;
            *at += line.len();
            Some((begin, line))
        })
        .find(|(_, line)| !line.starts_with(';'))
        .map(|(begin, _)| begin)?;
    let body = text.get(begin..)?;
    let (name, _) = body.split_once(" = ")?;
    Some(Rule { name, text, body })
}

/// Every word of a rule outside its comments; keys are among them, which does no harm: at most a rule too many.
fn words(body: &str) -> impl Iterator<Item = &str> {
    body.lines()
        .map(|line| line.split(';').next().unwrap_or_default())
        .flat_map(|line| line.split(|c: char| !(c.is_ascii_alphanumeric() || c == '-' || c == '_')))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_excerpt_has_the_rule_first_and_what_it_needs() {
        let text = "; head\n\n; a b\nunit = number\n\nOther = { x: tstr }\n\nBig = {\n  a: small, ; Other\n}\n\nsmall = [unit]\n";
        let part = excerpt(text, "Big").expect("the rule is there");
        assert_eq!(part, "Big = {\n  a: small, ; Other\n}\n\nsmall = [unit]\n\n; a b\nunit = number\n");
        assert_eq!(excerpt(text, "Missing"), None);
    }

    #[test]
    fn the_excerpt_of_every_message_is_small() {
        for name in ["Dwm", "Command", "Drive", "PilotProgress", "Meta"] {
            let part = excerpt(axle_schema::CDDL, name).expect("the rule is there");
            assert!(
                part.lines().find(|line| !line.starts_with(';')).is_some_and(|line| line.starts_with(name))
            );
            assert!(part.len() < axle_schema::CDDL.len() / 2, "{name} needs {} bytes", part.len());
        }
        assert!(excerpt(axle_schema::CDDL, "Dwm").is_some_and(|part| part.len() < 1000));
    }
}
