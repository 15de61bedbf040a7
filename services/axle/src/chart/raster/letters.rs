//! The outlines of letters.

use super::mask::Point;
use std::collections::BTreeMap;
use std::sync::LazyLock;

const FILE: &str = include_str!("letters.txt");
/// Units of the outlines in an em.
const EM: f64 = 2048.0;
/// A curve becomes so many lines; letters of charts are small.
const PARTS: u32 = 6;

/// How wide a letter is, and its outlines.
type Letter = (f64, Vec<Vec<Point>>);

static LETTERS: LazyLock<BTreeMap<char, Letter>> = LazyLock::new(|| {
    let lines = FILE.lines().filter(|line| !line.starts_with("# ") || line.starts_with("# 17"));
    lines.filter_map(letter).collect()
});

fn letter(line: &str) -> Option<(char, Letter)> {
    let (name, rest) = line.split_once(' ')?;
    let name = if name == "space" { ' ' } else { name.chars().next()? };
    let mut words = rest.split_whitespace();
    let width = words.next()?.parse().ok()?;
    let mut outlines: Vec<Vec<Point>> = Vec::new();
    let mut number = {
        let mut words = words.clone().filter_map(|word| word.parse::<f64>().ok());
        move || words.next()
    };
    for what in words.filter(|word| matches!(*word, "M" | "L" | "Q")) {
        let point = (number()?, number()?);
        match what {
            "M" => outlines.push(vec![point]),
            "L" => outlines.last_mut()?.push(point),
            _ => {
                let (outline, end) = (outlines.last_mut()?, (number()?, number()?));
                let start = *outline.last()?;
                for part in 1..=PARTS {
                    let t = f64::from(part) / f64::from(PARTS);
                    let [a, b, c] = [(1.0 - t) * (1.0 - t), 2.0 * t * (1.0 - t), t * t];
                    outline
                        .push((a * start.0 + b * point.0 + c * end.0, a * start.1 + b * point.1 + c * end.1));
                }
            }
        }
    }
    Some((name, (width, outlines)))
}

/// How wide a text is at this size, and its outlines from the beginning of its line, y downwards.
pub(super) fn outlines(text: &str, size: f64) -> (f64, Vec<Vec<Point>>) {
    let scale = size / EM;
    let (mut at, mut all) = (0.0, Vec::new());
    for name in text.chars() {
        // A letter that is not there is shown as such.
        let Some((width, outlines)) = LETTERS.get(&name).or_else(|| LETTERS.get(&'?')) else { continue };
        for outline in outlines {
            all.push(outline.iter().map(|(x, y)| ((at + x) * scale, -y * scale)).collect());
        }
        at += width;
    }
    (at * scale, all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_letters_of_charts_are_there() {
        for name in (' '..='~').chain("–…°²µσθ±×äéß".chars()) {
            let (width, outlines) = LETTERS.get(&name).unwrap_or_else(|| panic!("{name:?} is missing"));
            assert!((400.0..2500.0).contains(width), "{name:?} is {width} wide");
            assert_eq!(outlines.is_empty(), name == ' ', "{name:?}");
        }
        let (one, _) = outlines("m", 10.0);
        let (three, shapes) = outlines("mmm", 10.0);
        assert!((three - 3.0 * one).abs() < 1e-9 && shapes.len() == 3);
        assert_eq!(outlines("\u{4e2d}", 10.0), outlines("?", 10.0));
    }
}
