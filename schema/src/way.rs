//! The task a user gives: points to visit.

use crate::codec::Message;
use crate::refusal::within;
use crate::{Metres, MetresPerSecond, Pose, Radians, Refusal};
use serde::{Deserialize, Serialize};

/// The most way points one task may have.
pub const MAX_POINTS: usize = 4096;
/// Coordinates are within this distance of the origin, m.
pub const MAX_COORDINATE: f64 = 1e5;

/// Points to visit, in their order.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WayTask {
    /// The points; at least one, at most [`MAX_POINTS`].
    pub points: Vec<WayPoint>,
}

/// One point to visit, in the frame `odom`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WayPoint {
    /// Position along x.
    pub x: Metres,
    /// Position along y.
    pub y: Metres,
    /// The heading to have there, if it matters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heading: Option<Radians>,
    /// The largest speed on the way to this point, if it is less than the robot's own limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed: Option<MetresPerSecond>,
}

impl WayPoint {
    /// A point without heading or speed.
    #[must_use]
    pub const fn at(x: f64, y: f64) -> Self {
        Self { x: Metres(x), y: Metres(y), heading: None, speed: None }
    }
    /// Straight distance from a pose.
    #[must_use]
    pub fn distance(&self, from: Pose) -> Metres {
        from.distance(Pose { x: self.x, y: self.y, heading: Radians::ZERO })
    }
}

impl WayTask {
    /// The task that a person types: `"0,0 1,0 1,1"`; a third number of a point is its heading in radians.
    ///
    /// # Errors
    /// Names the point that cannot be read, and everything that [`Message::check`] refuses.
    pub fn parse(text: &str) -> Result<Self, Refusal> {
        let mut points = Vec::new();
        for word in text.split_whitespace() {
            if points.len() == MAX_POINTS {
                let got = text.split_whitespace().count() as u64;
                return Err(Refusal::TooLarge { what: "way points".into(), got, limit: MAX_POINTS as u64 });
            }
            points.push(parse_point(points.len() + 1, word)?);
        }
        let task = Self { points };
        task.check()?;
        Ok(task)
    }
}

fn parse_point(number: usize, word: &str) -> Result<WayPoint, Refusal> {
    let shown: String = word.chars().take(40).collect();
    let wrong = |why: String| Refusal::malformed(format!("way point {number} \"{shown}\""), why);
    let mut numbers = [None; 3];
    for (index, part) in word.split(',').enumerate() {
        let Some(number) = numbers.get_mut(index) else {
            return Err(wrong("a point is x,y or x,y,heading".into()));
        };
        let value: f64 = part.parse().map_err(|_| {
            let part: String = part.chars().take(40).collect();
            wrong(format!("{part:?} is not a number; write points as \"x,y x,y\", in metres"))
        })?;
        *number = Some(value);
    }
    match numbers {
        [Some(x), Some(y), heading] => {
            Ok(WayPoint { x: Metres(x), y: Metres(y), heading: heading.map(Radians), speed: None })
        }
        _ => Err(wrong("a point needs x and y, joined by a comma".into())),
    }
}

impl Message for WayTask {
    const NAME: &'static str = "WayTask";
    const LIMIT: usize = 256 * 1024;

    fn check(&self) -> Result<(), Refusal> {
        if self.points.is_empty() {
            return Err(Refusal::missing(
                "way task: a point to visit",
                "give at least one point, for example \"1,0\"",
            ));
        }
        if self.points.len() > MAX_POINTS {
            let got = self.points.len() as u64;
            return Err(Refusal::TooLarge { what: "way points".into(), got, limit: MAX_POINTS as u64 });
        }
        for (index, point) in self.points.iter().enumerate() {
            let name = |part: &str| format!("{part} of way point {}", index + 1);
            within(&name("x"), point.x.0, -MAX_COORDINATE, MAX_COORDINATE)?;
            within(&name("y"), point.y.0, -MAX_COORDINATE, MAX_COORDINATE)?;
            if let Some(heading) = point.heading {
                within(&name("heading"), heading.0, -1e4, 1e4)?;
            }
            if let Some(speed) = point.speed {
                within(&name("speed"), speed.0, 1e-3, crate::dwm::MAX_WHEEL_SPEED)?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_typed_way_is_read() {
        let way = WayTask::parse("0,0  1,0 1,1.5,-1.57").expect("three points");
        assert_eq!(way.points.len(), 3);
        assert_eq!(way.points[1], WayPoint::at(1.0, 0.0));
        assert_eq!(way.points[2].heading, Some(Radians(-1.57)));
    }

    #[test]
    fn a_wrong_way_is_refused_by_the_name_of_its_point() {
        let check = |text: &str, words: &str| {
            let refusal = WayTask::parse(text).expect_err(text).to_string();
            assert!(refusal.contains(words), "{text:?} says {refusal:?}, not {words:?}");
        };
        check("", "at least one point");
        check("0,0 1", "way point 2 \"1\"");
        check("0,0 a,1", "\"a\" is not a number");
        check("0,0 1,2,3,4", "x,y or x,y,heading");
        check("0,0 nan,1", "x of way point 2 is out of range: NaN");
        check("0,0 1,inf", "y of way point 2 is out of range: inf");
        check("1e9,0", "x of way point 1 is out of range: 1e9");
        check(&"0,0 ".repeat(5000), "way points is too large: 5000, at most 4096");
    }
}
