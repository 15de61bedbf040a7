//! Names that are near to one which nobody says.

use axle_mesh::{Fault, Mesh};
use std::collections::BTreeSet;
use std::time::Duration;

/// How long processes have to say what they say.
const PATIENCE: Duration = Duration::from_millis(700);
/// So many names are shown.
const SHOWN: usize = 4;
/// The longest name that is compared, in letters: a stranger may have chosen it.
const LONGEST: usize = 256;

/// The keys of live services that are most like `wanted`, in words.
pub(super) async fn names(mesh: &Mesh, wanted: &str) -> Result<String, Fault> {
    let everybody = mesh.everybody(PATIENCE).await?;
    let known: BTreeSet<String> =
        everybody.into_iter().filter_map(|(_, status)| status).flat_map(|status| status.says).collect();
    Ok(words(wanted, known))
}

fn words(wanted: &str, known: BTreeSet<String>) -> String {
    if known.is_empty() {
        return "no service is alive; start them with `axle up`".into();
    }
    if known.contains(wanted) {
        return "the name is right, its service is silent or answers questions only; `axle ls` lists the streams".into();
    }
    let mut near: Vec<_> = known.into_iter().map(|name| (distance(wanted, &name), name)).collect();
    near.sort();
    let near: Vec<_> = near.into_iter().take(SHOWN).map(|(_, name)| name).collect();
    format!("the nearest names: {}; `axle ls` lists all", near.join(", "))
}

/// Letters to change, add or leave out, from the one name to the other.
fn distance(one: &str, other: &str) -> usize {
    let one: Vec<char> = one.chars().take(LONGEST).collect();
    let mut row: Vec<usize> = (0..=one.len()).collect();
    for (number, letter) in other.chars().take(LONGEST).enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], number + 1);
        for (index, own) in one.iter().enumerate() {
            let changed = diagonal + usize::from(*own != letter);
            diagonal = row[index + 1];
            row[index + 1] = changed.min(diagonal + 1).min(row[index] + 1);
        }
    }
    row[one.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_distance_counts_letters() {
        for (one, other, letters) in
            [("pose", "pose", 0), ("pose", "poes", 2), ("pse", "pose", 1), ("", "abc", 3)]
        {
            assert_eq!((distance(one, other), distance(other, one)), (letters, letters), "{one} {other}");
        }
    }

    #[test]
    fn a_misspelt_key_finds_its_neighbour_first() {
        let known = ["a/r1/navigator/pose", "a/r1/source/recent", "a/r1/gate/state"].map(String::from).into();
        assert!(words("a/r1/navigtor/pose", known).contains("nearest names: a/r1/navigator/pose,"));
        assert!(words("x", BTreeSet::new()).contains("no service is alive"));
    }
}
