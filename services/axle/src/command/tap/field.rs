//! One field of a message, its course, and conditions on fields.

use super::line::{brief, read};
use axle_mesh::Raw;
use serde_json::Value;
use std::collections::{BTreeMap, VecDeque};

/// Points of a course that are shown.
const SHOWN: usize = 40;
/// Courses that are kept: so many streams may be told apart.
const COURSES: usize = 256;

/// A step to a field.
#[derive(Clone, Debug, PartialEq)]
enum Step {
    Name(String),
    /// From the end if negative.
    Index(i64),
}

/// The way to a field: `.pose.x`, `.encoders[-1].left`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Path {
    text: String,
    steps: Vec<Step>,
}

impl Path {
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let wrong = || format!("{text:?} is no field: write .pose.x or .encoders[0].left");
        let mut steps = Vec::new();
        for name in text.strip_prefix('.').ok_or_else(wrong)?.split('.') {
            let (name, indices) =
                name.split_once('[').map_or((name, None), |(name, rest)| (name, Some(rest)));
            if name.is_empty() || !name.chars().all(|c| c.is_alphanumeric() || c == '_' || c == '-') {
                return Err(wrong());
            }
            steps.push(Step::Name(name.to_owned()));
            for index in indices.into_iter().flat_map(|rest| rest.split('[')) {
                let index = index.strip_suffix(']').and_then(|index| index.parse().ok()).ok_or_else(wrong)?;
                steps.push(Step::Index(index));
            }
        }
        Ok(Self { text: text.to_owned(), steps })
    }
    fn of<'a>(&self, value: &'a Value) -> Option<&'a Value> {
        self.steps.iter().try_fold(value, |value, step| match step {
            Step::Name(name) => value.get(name),
            Step::Index(index) => {
                let items = value.as_array()?;
                let index = if *index < 0 { i64::try_from(items.len()).ok()? + index } else { *index };
                items.get(usize::try_from(index).ok()?)
            }
        })
    }
}

/// A comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sign {
    Equal,
    Different,
    Less,
    AtMost,
    More,
    AtLeast,
}

/// Longer signs first: `<=` begins with `<`.
const SIGNS: [(&str, Sign); 6] = [
    ("==", Sign::Equal),
    ("!=", Sign::Different),
    ("<=", Sign::AtMost),
    (">=", Sign::AtLeast),
    ("<", Sign::Less),
    (">", Sign::More),
];

/// `.pose.x > 1 and .pose.y < 2`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Condition(Vec<(Path, Sign, Value)>);

impl Condition {
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        text.split(" and ").map(Self::one).collect::<Result<_, _>>().map(Self)
    }
    fn one(text: &str) -> Result<(Path, Sign, Value), String> {
        let (at, mark, sign) = SIGNS
            .iter()
            .filter_map(|(mark, sign)| Some((text.find(mark)?, *mark, *sign)))
            .min_by_key(|(at, mark, _)| (*at, std::cmp::Reverse(mark.len())))
            .ok_or_else(|| {
                format!("{text:?} is no condition: write .pose.x > 1, with ==, !=, <, <=, > or >=")
            })?;
        let (path, value) = (text[..at].trim(), text[at + mark.len()..].trim());
        // A word without quotes is a text: .phase == running.
        let value = serde_json::from_str(value).unwrap_or_else(|_| Value::String(value.to_owned()));
        Ok((Path::parse(path)?, sign, value))
    }
    pub(super) fn holds(&self, value: &Value) -> bool {
        self.0
            .iter()
            .all(|(path, sign, wanted)| path.of(value).is_some_and(|value| compare(value, *sign, wanted)))
    }
}

fn compare(value: &Value, sign: Sign, wanted: &Value) -> bool {
    if let (Some(value), Some(wanted)) = (value.as_f64(), wanted.as_f64()) {
        return match sign {
            Sign::Equal => value.total_cmp(&wanted).is_eq() || value - wanted == 0.0,
            Sign::Different => value - wanted != 0.0,
            Sign::Less => value < wanted,
            Sign::AtMost => value <= wanted,
            Sign::More => value > wanted,
            Sign::AtLeast => value >= wanted,
        };
    }
    match sign {
        Sign::Equal => value == wanted,
        Sign::Different => value != wanted,
        _ => false,
    }
}

/// The last values of one field, stream by stream.
pub(super) struct Course {
    path: Path,
    streams: BTreeMap<String, VecDeque<f64>>,
}

impl Course {
    pub(super) const fn of(path: Path) -> Self {
        Self { path, streams: BTreeMap::new() }
    }
    pub(super) fn line(&mut self, raw: &Raw, json: bool) -> String {
        let value = read(raw).ok();
        let found = value.as_ref().and_then(|value| self.path.of(value));
        if json {
            return serde_json::json!({ "key": raw.key, "field": self.path.text, "value": found })
                .to_string();
        }
        let Some(found) = found else {
            return format!("{} has no {}", raw.key, self.path.text);
        };
        let mut spark = String::new();
        if let Some(number) = found.as_f64()
            && (self.streams.len() < COURSES || self.streams.contains_key(&raw.key))
        {
            let course = self.streams.entry(raw.key.clone()).or_default();
            course.push_back(number);
            if course.len() > SHOWN {
                course.pop_front();
            }
            spark = sparkline(course);
        }
        let line = format!("{} {} {:>10} {spark}", raw.key, self.path.text, brief(found));
        line.trim_end().to_owned()
    }
}

/// Numbers as heights, from the least to the largest.
fn sparkline(numbers: &VecDeque<f64>) -> String {
    const HEIGHTS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let finite = || numbers.iter().copied().filter(|number| number.is_finite());
    let (least, largest) =
        (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max));
    let height = |number: f64| {
        if !number.is_finite() {
            return ' ';
        }
        let share = if largest > least { (number - least) / (largest - least) } else { 0.5 };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 7")]
        let index = (share * 7.0).round().clamp(0.0, 7.0) as usize;
        HEIGHTS.get(index).copied().unwrap_or(' ')
    };
    numbers.iter().map(|number| height(*number)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn holds(text: &str, value: &Value) -> bool {
        Condition::parse(text).unwrap_or_else(|why| panic!("{text}: {why}")).holds(value)
    }

    #[test]
    fn a_field_is_found_by_its_way() {
        let value = json!({ "pose": { "x": 1.5 }, "list": [{ "a": 1 }, { "a": 2 }], "m": [[1, 2], [3, 4]] });
        for (path, found) in [
            (".pose.x", Some(json!(1.5))),
            (".list[0].a", Some(json!(1))),
            (".list[-1].a", Some(json!(2))),
            (".m[1][0]", Some(json!(3))),
            (".list[7].a", None),
            (".pose.x.y", None),
        ] {
            let path = Path::parse(path).expect("a path");
            assert_eq!(path.of(&value).cloned(), found, "{path:?}");
        }
        for wrong in ["pose", "", ".", ".a[", ".a[x]", ".a b", "..a"] {
            assert!(Path::parse(wrong).is_err_and(|why| why.contains(".pose.x")), "{wrong:?}");
        }
    }

    #[test]
    fn a_condition_holds_or_does_not() {
        let value = json!({ "x": 1.5, "n": 2, "ok": true, "phase": "running" });
        for text in [
            ".x > 1",
            ".x <= 1.5",
            ".n == 2.0",
            ".ok == true",
            ".phase == running",
            ".phase != \"done\"",
            ".x > 1 and .n < 3",
        ] {
            assert!(holds(text, &value), "{text}");
        }
        for text in [".x < 1", ".y == 1", ".ok != true", ".phase > 3", ".x > 1 and .n > 3"] {
            assert!(!holds(text, &value), "{text}");
        }
        for wrong in [".x", "x > 1", "", ".x = 1"] {
            assert!(Condition::parse(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn a_course_rises_and_falls() {
        assert_eq!(sparkline(&VecDeque::from([0.0, 7.0, 3.5])), "▁█▅");
        assert_eq!(sparkline(&VecDeque::from([2.0, 2.0])), "▅▅");
        assert_eq!(sparkline(&VecDeque::from([f64::NAN, 1.0])), " ▅");
    }
}
