//! What a drive asks of the wheels at every time: the due state of the paper's D-correction (paper, III.A).

use axle_schema::contract::Bounds as _;
use axle_schema::dwm::MAX_DURATION;
use axle_schema::refusal::within;
use axle_schema::{Drive, Drivetrain, Dwm, Metres, MetresPerSecond, Pose, Refusal, Seconds, Sides, Track};

/// A drive on a time line that begins with 0.
#[derive(Clone, Debug)]
pub(crate) struct Due {
    dwms: Vec<Dwm>,
    /// When each movement begins, s.
    starts: Vec<f64>,
    /// What the wheels have covered when it begins.
    covered: Vec<Sides<Metres>>,
    /// When the last one ends, s.
    total: f64,
    /// What the wheels have covered then.
    goal: Sides<Metres>,
    /// Where the robot is when each movement begins, and at the end; none before [`Due::place`].
    poses: Vec<Pose>,
}

impl Due {
    /// The time line of a drive that `robot` can follow.
    ///
    /// # Errors
    /// Names the movement that is too fast or too long, and refuses a drive that does not end at rest.
    pub(crate) fn new(drive: Drive, robot: &Drivetrain) -> Result<Self, Refusal> {
        robot.check()?;
        let mut due = Self {
            dwms: Vec::new(),
            starts: Vec::with_capacity(drive.dwms.len()),
            covered: Vec::with_capacity(drive.dwms.len()),
            total: 0.0,
            goal: Sides::default(),
            poses: Vec::new(),
        };
        for (index, dwm) in drive.dwms.iter().enumerate() {
            check(index + 1, dwm, robot)?;
            due.starts.push(due.total);
            due.covered.push(due.goal);
            due.total += dwm.duration().0;
            due.goal = due.goal.zip(dwm.encoders_span().sides(), |sum, distance| sum + distance);
        }
        let end = drive.dwms.last().map(Dwm::end).unwrap_or_default();
        for (side, speed) in [("left", end.left), ("right", end.right)] {
            within(&format!("{side} wheel speed in m/s at the end of the drive"), speed.0, -1e-9, 1e-9)?;
        }
        due.dwms = drive.dwms;
        Ok(due)
    }

    /// How long the drive lasts, s.
    pub(crate) const fn total(&self) -> f64 {
        self.total
    }

    /// The distances that are due at `t`: 0 before the beginning, those of the whole drive after its end.
    pub(crate) fn distances(&self, t: f64) -> Sides<Metres> {
        if t >= self.total {
            return self.goal;
        }
        let Some(index) = self.index(t) else { return Sides::default() };
        let more = self.dwms[index].distances_at(Seconds(t - self.starts[index]));
        self.covered[index].zip(more, |sum, distance| sum + distance)
    }

    /// When within the last seconds before `t` the distances `real` were due, as nearly as they were: the latest such
    /// time, in steps of 10 ms.
    pub(crate) fn was_at(&self, real: Sides<Metres>, t: f64) -> f64 {
        let miss = |t: f64| {
            let miss = self.distances(t).zip(real, |due, real| (due - real).abs().0);
            miss.left + miss.right
        };
        let steps = (0..=300).map(|step| t - f64::from(step) * 0.01);
        let least =
            steps.map(|t| (t, miss(t))).reduce(|best, next| if next.1 < best.1 { next } else { best });
        least.map_or(t, |(t, _)| t)
    }

    /// The speeds that are due at `t`: those of the beginning before it, rest after the end.
    pub(crate) fn speeds(&self, t: f64) -> Sides<MetresPerSecond> {
        if t >= self.total {
            return Sides::default();
        }
        match self.index(t) {
            Some(index) => self.dwms[index].speeds_at(Seconds(t - self.starts[index])),
            None => self.dwms.first().map(Dwm::start).unwrap_or_default(),
        }
    }

    /// Says where the drive begins, so that [`Due::pose`] is known.
    pub(crate) fn place(&mut self, start: Pose, track: Track) {
        let mut at = start;
        self.poses = vec![start];
        self.poses.extend(self.dwms.iter().map(|dwm| {
            at = dwm.pose_at(at, track, dwm.duration());
            at
        }));
    }

    /// The pose that is due at `t`: that of the beginning before it, that of the end after it.
    pub(crate) fn pose(&self, t: f64, track: Track) -> Pose {
        if t >= self.total {
            return self.poses.last().copied().unwrap_or_default();
        }
        let index = self.index(t).unwrap_or(0);
        match (self.poses.get(index), self.dwms.get(index)) {
            (Some(&from), Some(dwm)) => dwm.pose_at(from, track, Seconds(t - self.starts[index])),
            _ => Pose::default(),
        }
    }

    /// The movement that goes on at `t`, from which on there is one.
    fn index(&self, t: f64) -> Option<usize> {
        self.starts.partition_point(|&start| start <= t).checked_sub(1)
    }
}

fn check(number: usize, dwm: &Dwm, robot: &Drivetrain) -> Result<(), Refusal> {
    within(&format!("duration in s of movement {number}"), dwm.duration().0, 0.0, MAX_DURATION)?;
    let (limit, peak) = (robot.wheel_speed.0, dwm.peak_speed().0);
    // A hair more than the limit is rounding.
    if !(0.0..=limit * (1.0 + 1e-9)).contains(&peak) {
        let limit = format!("at most {limit} m/s, robot.wheel_speed");
        return Err(Refusal::out_of_range(
            format!("wheel speed of movement {number}"),
            dwm.peak_speed(),
            limit,
        ));
    }
    let change = dwm.start().zip(dwm.end(), |from, to| (to - from).abs().0);
    let change = change.left.max(change.right);
    if !(0.0..=robot.wheel_acceleration.0 * dwm.duration().0 + 1e-9).contains(&change) {
        let got = format!("{change} m/s in {}", dwm.duration());
        let limit = format!("at most {}, robot.wheel_acceleration", robot.wheel_acceleration);
        return Err(Refusal::out_of_range(format!("acceleration of movement {number}"), got, limit));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dwm(v0: f64, v1: f64, duration: f64) -> Dwm {
        let both = |speed| Sides::new(MetresPerSecond(speed), MetresPerSecond(-speed));
        Dwm::new(both(v0), both(v1), Seconds(duration)).expect("finite")
    }
    fn due(dwms: Vec<Dwm>) -> Result<Due, Refusal> {
        Due::new(Drive { dwms, ..Drive::default() }, &Drivetrain::default())
    }

    #[test]
    fn the_due_state_is_that_of_the_movements() {
        // 0.5 s from rest to 0.4 m/s (0.1 m), 1 s steady (0.4 m), 0.5 s to rest (0.1 m).
        let due = due(vec![dwm(0.0, 0.4, 0.5), dwm(0.4, 0.4, 1.0), dwm(0.4, 0.0, 0.5)]).expect("slow enough");
        assert!((due.total() - 2.0).abs() < 1e-15);
        let table = [
            (-1.0, 0.0, 0.0),
            (0.0, 0.0, 0.0),
            (0.25, 0.025, 0.2),
            (0.5, 0.1, 0.4),
            (1.0, 0.3, 0.4),
            (1.75, 0.575, 0.2),
            (2.0, 0.6, 0.0),
            (9.0, 0.6, 0.0),
        ];
        for (t, distance, speed) in table {
            let (d, v) = (due.distances(t), due.speeds(t));
            assert!(
                (d.left.0 - distance).abs() < 1e-12 && (d.right.0 + distance).abs() < 1e-12,
                "at {t} s: {d:?}"
            );
            assert!((v.left.0 - speed).abs() < 1e-12 && (v.right.0 + speed).abs() < 1e-12, "at {t} s: {v:?}");
        }
        assert_eq!(due.distances(f64::NAN), Sides::default(), "no time, no motion");
    }

    #[test]
    fn a_drive_that_the_robot_cannot_follow_is_refused_by_the_number_of_the_movement() {
        let check = |dwms, words: &str| {
            let refusal = due(dwms).expect_err(words).to_string();
            assert!(refusal.contains(words), "{refusal:?} does not say {words:?}");
        };
        check(
            vec![dwm(0.0, 0.5, 1.0), dwm(0.5, 1.2, 1.0)],
            "wheel speed of movement 2 is out of range: 1.2 m/s",
        );
        check(vec![dwm(0.0, 0.5, 0.1)], "acceleration of movement 1");
        check(vec![dwm(0.0, 0.5, 1.0)], "left wheel speed in m/s at the end of the drive");
        check(vec![dwm(0.0, 0.0, 4000.0)], "duration in s of movement 1");
    }
}
