//! What a browser may ask, and how it is answered: JSON texts on one WebSocket.
//!
//! A question is `{"id": 7, "ask": {"go": {"robot": "r1", "points": [{"x": 1, "y": 0}]}}}`; its answer has the same number:
//! `{"reply": 7, "ok": …}` or `{"reply": 7, "refusal": "…"}`. Every question that moves or stops a robot names the robot,
//! so that a page which is just turning to another one commands the one it shows. Reading is total: size, form, names,
//! ranges, in this order, and every fault is a [`Refusal`].

use crate::board::News;
use axle_schema::codec::Message as _;
use axle_schema::differential_drive::{DriveDistance, RotateDegrees, SetDrivePower, SetDriveSpeed};
use axle_schema::{Refusal, RobotId, StopId, TaskId, WayPoint, WayTask};
use serde::Deserialize;

/// The longest question, in bytes; the rest of it is not even read.
pub const MAX_QUESTION: usize = 64 * 1024;
/// The most way points that a page may send.
pub const MAX_POINTS: usize = 500;

/// One question.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Question {
    /// Repeated in the answer; left out, there is none.
    #[serde(default)]
    pub id: Option<u32>,
    /// What is asked.
    pub ask: Ask,
}

/// What can be asked.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Ask {
    /// The first word: the session that the page had before it was loaded again.
    Hello {
        /// Its number, if it had one.
        #[serde(default)]
        session: Option<u64>,
    },
    /// Shows another robot.
    Watch {
        /// Which one.
        robot: RobotId,
    },
    /// A sign of life: the stamp of the newest word.
    Echo {
        /// In milliseconds, as in the word.
        tick: u64,
    },
    /// The page is hidden.
    Hide {},
    /// Drive a way.
    Go {
        /// Who drives.
        robot: RobotId,
        /// Where to.
        points: Vec<WayPoint>,
        /// Which corrector; left out, the pilot's choice.
        #[serde(default)]
        corrector: Option<String>,
        /// The numbers, from 1, of the points at which it waits for a person.
        #[serde(default)]
        confirm: Vec<u32>,
    },
    /// End a task.
    Cancel {
        /// Whose.
        robot: RobotId,
        /// Which.
        task: TaskId,
    },
    /// A robot at a loading point may drive on.
    Confirm {
        /// Which one.
        robot: RobotId,
    },
    /// What Pathfinder would make of a way from where the robot is.
    Plan {
        /// Which robot.
        robot: RobotId,
        /// Where to.
        points: Vec<WayPoint>,
    },
    /// Stop at once.
    Stop {
        /// Who stops.
        robot: RobotId,
    },
    /// Allow the wheels to move again.
    Enable {
        /// Whose.
        robot: RobotId,
        /// The stop that the page shows as the one in force.
        #[serde(default)]
        stop: Option<StopId>,
    },
    /// The stick: powers of the wheels, which hold for a moment.
    Power {
        /// Which robot.
        robot: RobotId,
        /// The powers.
        set: SetDrivePower,
        /// The stamp of the newest word that the page had.
        echo: u64,
    },
    /// The same with speeds in m/s.
    Speed {
        /// Which robot.
        robot: RobotId,
        /// The speeds.
        set: SetDriveSpeed,
        /// As above.
        echo: u64,
    },
    /// The stick is let go.
    Release {},
    /// Generic Differential Drive: a distance straight on.
    Distance {
        /// Which robot.
        robot: RobotId,
        /// How far, with which power.
        set: DriveDistance,
    },
    /// Generic Differential Drive: an angle on the spot.
    Rotate {
        /// Which robot.
        robot: RobotId,
        /// How far, with which power.
        set: RotateDegrees,
    },
    /// Generic Differential Drive: the encoders of the drive to zero.
    Reset {
        /// Which robot.
        robot: RobotId,
    },
    /// Generic Differential Drive: enable or disable the drive.
    EnableDrive {
        /// Which robot.
        robot: RobotId,
        /// Whether it may move.
        enable: bool,
        /// The stop that the page shows as the one in force.
        #[serde(default)]
        stop: Option<StopId>,
    },
    /// Generic Differential Drive: stop and disable.
    StopDrive {
        /// Which robot.
        robot: RobotId,
    },
    /// Generic Differential Drive: its state.
    GetDrive {
        /// Which robot.
        robot: RobotId,
    },
    /// The calibration that the owner of the wheels applies.
    Calibration {
        /// Of which robot.
        robot: RobotId,
    },
    /// The teaching view.
    Lesson(crate::lesson::Movement),
}

impl Question {
    /// Reads a question.
    ///
    /// # Errors
    /// A [`Refusal`] that names the field.
    pub fn read(text: &str) -> Result<Self, Refusal> {
        if text.len() > MAX_QUESTION {
            let what = "the question in bytes".to_owned();
            return Err(Refusal::TooLarge { what, got: text.len() as u64, limit: MAX_QUESTION as u64 });
        }
        let question: Self =
            serde_json::from_str(text).map_err(|fault| Refusal::malformed("question of the page", fault))?;
        question.ask.check()?;
        Ok(question)
    }
    /// The number of a question that cannot be read otherwise, so that whoever asked learns why.
    #[must_use]
    pub fn number(text: &str) -> Option<u32> {
        let text = (text.len() <= MAX_QUESTION).then_some(text)?;
        let value: serde_json::Value = serde_json::from_str(text).ok()?;
        value.get("id")?.as_u64()?.try_into().ok()
    }
}

impl Ask {
    /// The robot that it moves, ends the task of, or allows to move: what needs the right to. Everybody may look and stop.
    #[must_use]
    pub const fn moves(&self) -> Option<&RobotId> {
        match self {
            Self::Go { robot, .. }
            | Self::Confirm { robot }
            | Self::Cancel { robot, .. }
            | Self::Enable { robot, .. }
            | Self::Power { robot, .. }
            | Self::Speed { robot, .. }
            | Self::Distance { robot, .. }
            | Self::Rotate { robot, .. }
            | Self::Reset { robot }
            | Self::EnableDrive { robot, .. } => Some(robot),
            Self::Hello { .. }
            | Self::Watch { .. }
            | Self::Echo { .. }
            | Self::Hide {}
            | Self::Plan { .. }
            | Self::Stop { .. }
            | Self::Release {}
            | Self::StopDrive { .. }
            | Self::GetDrive { .. }
            | Self::Calibration { .. }
            | Self::Lesson(_) => None,
        }
    }

    /// Refuses what whoever does it would refuse.
    fn check(&self) -> Result<(), Refusal> {
        match self {
            Self::Go { points, corrector, confirm, .. } => {
                if confirm.len() > MAX_POINTS {
                    let (got, limit) = (confirm.len() as u64, MAX_POINTS as u64);
                    return Err(Refusal::TooLarge { what: "points to confirm".into(), got, limit });
                }
                if corrector.as_ref().is_some_and(|name| name.len() > 64) {
                    return Err(Refusal::out_of_range("letters of a corrector's name", "more", "64"));
                }
                way(points).map(drop)
            }
            Self::Plan { points, .. } => way(points).map(drop),
            Self::Power { set, .. } => set.check(),
            Self::Speed { set, .. } => set.check(),
            Self::Distance { set, .. } => set.check(),
            Self::Rotate { set, .. } => set.check(),
            Self::Lesson(movement) => movement.check(),
            _ => Ok(()),
        }
    }
}

/// The task of a page's points.
///
/// # Errors
/// As [`WayTask::check`], and for more than [`MAX_POINTS`].
pub fn way(points: &[WayPoint]) -> Result<WayTask, Refusal> {
    if points.len() > MAX_POINTS {
        let what = "way points of a page".to_owned();
        return Err(Refusal::TooLarge { what, got: points.len() as u64, limit: MAX_POINTS as u64 });
    }
    let way = WayTask { points: points.to_vec() };
    way.check()?;
    Ok(way)
}

/// The answer to a question, as a text. A question without a number is answered only when it is refused.
#[must_use]
pub fn answer(id: Option<u32>, outcome: &Result<serde_json::Value, Refusal>) -> Option<String> {
    let answer = match outcome {
        Ok(value) => serde_json::json!({ "reply": id?, "ok": value }),
        Err(refusal) => serde_json::json!({ "reply": id, "refusal": refusal.to_string() }),
    };
    Some(answer.to_string())
}

/// News as a text: the stamp that the browser echoes, the robot, who holds its stick (`you`, `other` or nobody), by
/// stream the age in seconds and the newest word, and the events.
#[must_use]
pub fn tell(tick: u64, robot: &str, hand: Option<&'static str>, news: &News) -> String {
    // Words of the board are JSON already; names are made into it here.
    let quoted = |name: &str| serde_json::Value::from(name).to_string();
    let hand = hand.map_or_else(|| "null".to_owned(), quoted);
    let mut text = format!("{{\"tick\":{tick},\"robot\":{},\"hand\":{hand}", quoted(robot));
    let newest = news.newest.iter().map(|(stream, age, word)| {
        let age = if age.0.is_finite() { age.0 } else { 0.0 };
        format!("{}:[{age},{word}]", quoted(stream))
    });
    list(&mut text, "new", ('{', '}'), newest);
    let events = news.events.iter().map(|(stream, word)| format!("[{},{word}]", quoted(stream)));
    list(&mut text, "events", ('[', ']'), events);
    if news.lost > 0 {
        text.push_str(&format!(",\"lost\":{}", news.lost));
    }
    text.push('}');
    text
}

/// Adds a list to an object, unless it is empty.
fn list(text: &mut String, name: &str, (open, close): (char, char), parts: impl Iterator<Item = String>) {
    let parts: Vec<_> = parts.collect();
    if !parts.is_empty() {
        text.push_str(&format!(",\"{name}\":{open}{}{close}", parts.join(",")));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::board::{Board, Place};
    use axle_schema::{Metres, Seconds};
    use proptest::prelude::*;
    use std::sync::Arc;

    #[test]
    fn a_question_is_read() {
        let go = r#"{"id":7,"ask":{"go":{"robot":"r1","points":[{"x":1,"y":0.5,"heading":1.5}]}}}"#;
        let Question { id: Some(7), ask: Ask::Go { robot, points, corrector: None, .. } } =
            Question::read(go).expect("a question")
        else {
            panic!("another question")
        };
        assert_eq!((robot.as_str(), points[0].x), ("r1", Metres(1.0)));
        let power = r#"{"ask":{"power":{"robot":"r1","set":{"left":0.5,"right":-0.5,"hold":0.3},"echo":9}}}"#;
        assert!(matches!(Question::read(power), Ok(Question { id: None, ask: Ask::Power { echo: 9, .. } })));
        for text in [
            r#"{"ask":{"confirm":{"robot":"r1"}}}"#,
            r#"{"ask":{"hello":{}}}"#,
            r#"{"ask":{"stop":{"robot":"r1"}}}"#,
        ] {
            assert!(Question::read(text).is_ok(), "{text}");
        }
    }

    #[test]
    fn a_wrong_question_is_refused_by_name() {
        let many = format!(
            r#"{{"ask":{{"go":{{"robot":"r1","points":[{}]}}}}}}"#,
            vec![r#"{"x":1,"y":0}"#; MAX_POINTS + 1].join(",")
        );
        for (text, words) in [
            ("", "question of the page"),
            ("{}", "ask"),
            (r#"{"ask":{"dance":{}}}"#, "dance"),
            (r#"{"ask":{"stop":{"robot":"r1","soon":true}}}"#, "soon"),
            (r#"{"ask":{"stop":{"robot":"<script>"}}}"#, "robot id"),
            (r#"{"ask":{"stop":{}}}"#, "robot"),
            (r#"{"ask":{"go":{"robot":"r1","points":[]}}}"#, "a point to visit"),
            (r#"{"ask":{"go":{"robot":"r1","points":[{"x":1e9,"y":0}]}}}"#, "x of way point 1"),
            (r#"{"ask":{"power":{"robot":"r1","set":{"left":2,"right":0},"echo":0}}}"#, "-1"),
            (r#"{"ask":{"power":{"robot":"r1","set":{"left":0,"right":0,"hold":9},"echo":0}}}"#, "hold"),
            (r#"{"ask":{"speed":{"robot":"r1","set":{"left":99,"right":0},"echo":0}}}"#, "left speed"),
            (r#"{"ask":{"distance":{"robot":"r1","set":{"distance":-1,"power":0.5}}}}"#, "distance"),
            (r#"{"ask":{"rotate":{"robot":"r1","set":{"degrees":1e9,"power":0.5}}}}"#, "degrees"),
            (&many, "way points of a page"),
            (&format!("\"{}\"", "x".repeat(MAX_QUESTION)), "bytes"),
            (&"[".repeat(10_000), "question"),
        ] {
            let refusal = Question::read(text).expect_err(words).to_string();
            assert!(refusal.contains(words), "{refusal:?} says {words:?}");
            assert_eq!(Question::number(text), None);
            assert!(refusal.len() < 600, "a short answer to whatever comes: {}", refusal.len());
        }
    }

    #[test]
    fn a_wrong_question_with_a_number_is_answered_under_it() {
        assert_eq!(Question::number(r#"{"id":7,"ask":{"dance":{}}}"#), Some(7));
        for text in ["", "[7]", r#"{"id":-1}"#, r#"{"id":"7"}"#, r#"{"id":4294967296}"#] {
            assert_eq!(Question::number(text), None, "{text}");
        }
    }

    #[test]
    fn an_answer_and_news_are_texts_that_a_page_reads() {
        assert_eq!(answer(None, &Ok(serde_json::Value::Null)), None);
        let refused = answer(Some(3), &Err(Refusal::missing("x", "y"))).expect("an answer");
        assert_eq!(refused, r#"{"refusal":"x is missing: y","reply":3}"#);
        let mut board = Board::default();
        let mut reader = board.reader();
        let word: crate::board::Word = r#"{"x":0.1}"#.into();
        let place = |stream: &str| Place { robot: "r1".into(), stream: stream.into() };
        board.put(Seconds(1.0), place("navigator/pose"), Arc::clone(&word));
        board.add(place("log"), word);
        let news = board.news(Seconds(1.5), &mut reader, "r1");
        let told = tell(1500, "r1", Some("you"), &news);
        let expected = r#"{"tick":1500,"robot":"r1","hand":"you","new":{"navigator/pose":[0.5,{"x":0.1}]},"events":[["log",{"x":0.1}]]}"#;
        assert_eq!(told, expected);
        let strange = tell(1, "a\"b", None, &board.news(Seconds(2.0), &mut reader, "r1"));
        assert_eq!(strange, r#"{"tick":1,"robot":"a\"b","hand":null}"#);
    }

    proptest! {
        #[test]
        fn no_text_breaks_the_reader(text in "\\PC{0,200}") {
            drop(Question::read(&text));
            drop(Question::read(&format!(r#"{{"ask":{{"go":{text}}}}}"#)));
        }
    }
}
