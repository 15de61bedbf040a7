//! The numbers of other projects' tests about kinematics, odometers, twists, poses and movements.
//!
//! `data/peer_motion.jsonl` names the source and the licence of each.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a broken file of reference vectors ends the test")]

use axle_schema::motion::{Wheels, arc, chord};
use axle_schema::{
    Curve, Metres, MetresPerSecond, PerMetre, Pose, Radians, RadiansPerSecond, Sides, Track, Twist,
};
use serde_json::Value;
use std::f64::consts::PI;

/// A case of `data/peer_motion.jsonl`.
struct Case(Value);

impl Case {
    fn input(&self, key: &str) -> f64 {
        self.0["input"][key].as_f64().unwrap_or_else(|| panic!("no number {key} in {}", self.0))
    }
    fn list(&self, key: &str) -> Vec<f64> {
        let list = self.0["input"][key].as_array().unwrap_or_else(|| panic!("no list {key} in {}", self.0));
        list.iter().map(|number| number.as_f64().unwrap()).collect()
    }
    /// Compares with the expected numbers, given by their names.
    fn check(&self, found: &[(&str, f64)]) {
        let tolerance = &self.0["tolerance"];
        for &(key, found) in found {
            let (name, index) = key.split_once('.').unwrap_or((key, ""));
            let expected = &self.0["expected"][name];
            let expected = index.parse().map_or(expected, |index: usize| &expected[index]);
            let expected = expected.as_f64().unwrap_or_else(|| panic!("no number {key} in {}", self.0));
            let ulps = tolerance["ulp"].as_f64().unwrap_or(0.0) * f64::EPSILON * expected.abs();
            let allowed = ulps.max(tolerance["abs"].as_f64().unwrap_or(0.0));
            assert!((found - expected).abs() <= allowed, "{key} is {found}: {}", self.0);
        }
    }
    fn pose(&self, pose: Pose) {
        self.check(&[("pose.0", pose.x.0), ("pose.1", pose.y.0), ("pose.2", pose.heading.0)]);
    }
}

/// Where a robot is after `dt` at constant speeds.
fn steady(from: &[f64], v: f64, w: f64, dt: f64) -> Pose {
    let (x, y) = chord(v * dt, w * dt);
    Pose::new(from[0], from[1], from[2]).moved(Metres(x), Metres(y), Radians(w * dt))
}

fn kinematics(case: &Case) {
    let track = Track::new(Metres(case.input("track_m"))).unwrap();
    if case.0["area"] == "kinematics_inverse" {
        let twist = Twist { v: MetresPerSecond(case.input("v")), omega: RadiansPerSecond(case.input("w")) };
        let speeds = twist.wheel_speeds(track);
        case.check(&[("vl", speeds.left.0), ("vr", speeds.right.0)]);
    } else {
        let speeds = Sides::new(MetresPerSecond(case.input("vl")), MetresPerSecond(case.input("vr")));
        let twist = Twist::of_wheels(speeds, track);
        case.check(&[("v", twist.v.0), ("w", twist.omega.0)]);
    }
}

fn odometry(case: &Case, id: &str) {
    match id {
        "odometry-001" => {
            // The turn comes from a gyroscope, the distance from the wheels.
            let update = &case.0["input"]["update"];
            let of = |key: &str| update[key].as_f64().unwrap();
            let turn = (of("gyro_deg") - case.input("gyro0_deg")).to_radians();
            let (x, y) = chord(f64::midpoint(of("left_m"), of("right_m")), turn);
            case.check(&[("x", x), ("y", y), ("heading_deg", turn.to_degrees())]);
        }
        "odometry-003" => {
            let (speeds, dt, track) = (case.list("wheel_rad_s"), case.input("dt"), case.input("track_m"));
            let [left, right] = [speeds[0], speeds[1]].map(|speed| speed * case.input("wheel_radius_m"));
            let (x, y, theta) = arc(left * dt, right * dt, track);
            let wheels = Wheels { v0l: left, v0r: right, v1l: left, v1r: right, duration: dt, track };
            let end = wheels.end();
            case.check(&[("x", x), ("y", y), ("heading", theta), ("v", end.v), ("w", end.omega)]);
        }
        // That project refuses intervals below a microsecond; the formulas here need no such limit.
        "odometry-005" => {
            let (x, _, _) = arc(1e-7, 1e-7, case.input("track_m"));
            assert!((x - 1e-7).abs() < 1e-22);
        }
        "odometry-006" => {
            let end = steady(&[0.0; 3], case.input("v"), case.input("w"), case.input("dt"));
            case.check(&[("x", end.x.0), ("y", end.y.0), ("heading", end.heading.0)]);
        }
        "odometry-008" => {
            // The odometer takes the commands that limits have clamped.
            let v = case.input("v_cmd").min(case.input("v_max"));
            let w = case.input("w_cmd").min(case.input("w_max"));
            let (ahead, turned) =
                (steady(&[0.0; 3], v, 0.0, case.input("dt")), steady(&[0.0; 3], 0.0, w, case.input("dt")));
            case.check(&[("v", v), ("x", ahead.x.0), ("then_w", w), ("heading", turned.heading.0)]);
        }
        "odometry-010" => {
            let set = case.list("set");
            let pose = Pose::new(set[0], set[1], set[2]);
            case.check(&[("x", pose.x.0), ("y", pose.y.0), ("heading", pose.heading.0)]);
        }
        _ => {
            case.pose(steady(&case.list("start"), case.input("v"), case.input("w"), case.input("dt")));
        }
    }
}

fn poses(case: &Case, id: &str) {
    let degrees = |list: &[f64]| Pose::new(list[0], list[1], list[2].to_radians());
    match id {
        "twist_exp-001" | "twist_exp-003" => {
            let (x, y) = chord(case.input("dx"), case.input("dtheta"));
            let pose = Pose::default().moved(Metres(x), Metres(y + case.input("dy")), Radians(0.0));
            case.check(&[("x", pose.x.0), ("y", pose.y.0), ("theta", pose.heading.0)]);
        }
        "twist_log-001" => {
            // The length of the arc between two poses, from its chord.
            let (from, to) = (case.list("from"), case.list("to"));
            let seen = Pose::new(to[0], to[1], to[2]).seen_from(Pose::new(from[0], from[1], from[2]));
            let half = seen.heading.0 / 2.0;
            let length = seen.x.0.hypot(seen.y.0) * half / half.sin();
            case.check(&[("dx", length), ("dy", 0.0), ("dtheta", seen.heading.0)]);
            let (x, y) = chord(length, seen.heading.0);
            assert!((x - to[0]).hypot(y - to[1]) < 1e-14);
        }
        "pose_compose-001" => {
            let (pose, step) = (degrees(&case.list("pose_deg")), degrees(&case.list("transform_deg")));
            let end = pose.moved(step.x, step.y, step.heading);
            case.check(&[("x", end.x.0), ("y", end.y.0), ("theta_deg", end.heading.0.to_degrees())]);
        }
        "pose_compose-003" => {
            let pose = degrees(&case.list("pose_deg"));
            let frame = Pose::new(0.0, 0.0, case.input("rotate_deg").to_radians());
            let end = frame.moved(pose.x, pose.y, pose.heading);
            case.check(&[("x", end.x.0), ("y", end.y.0), ("theta_deg", end.heading.0.to_degrees())]);
        }
        "angle_wrap-001" => {
            let [a, b] = ["a_deg", "b_deg"].map(|key| Radians(case.input(key).to_radians()).wrapped());
            assert_eq!(a, b);
        }
        "angle_wrap-003" => {
            let sum = case.input("deg") * case.input("times");
            let found = Radians(sum.to_radians()).wrapped().0.to_degrees();
            assert!((found - 50.0).abs() < 1e-12, "{found}");
        }
        _ => panic!("nothing is known of {id}"),
    }
}

fn movement(case: &Case) {
    let list = case.0["input"]["vl0,vr0,vl1,vr1,T,track"].as_array().unwrap();
    let [v0l, v0r, v1l, v1r, duration, track] = [0, 1, 2, 3, 4, 5].map(|k| list[k].as_f64().unwrap());
    let end = Wheels { v0l, v0r, v1l, v1r, duration, track }.end();
    case.check(&[("dx", end.x), ("dy", end.y), ("dtheta", end.theta)]);
}

fn clothoid(case: &Case) {
    let length = case.input("L");
    let start = PerMetre(case.input("kappa0"));
    let curve = Curve::Clothoid {
        start_curvature: start,
        end_curvature: start + PerMetre(case.input("dkappa") * length),
        length: Metres(length),
    };
    let span = curve.navigator_span();
    let end = Pose::new(0.0, 0.0, case.input("theta0")).moved(span.x, span.y, span.heading);
    case.check(&[("end.0", end.x.0), ("end.1", end.y.0), ("end.2", end.heading.0)]);
}

#[test]
fn axle_agrees_with_its_peers() {
    let cases: Vec<Value> = include_str!("data/peer_motion.jsonl")
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(cases.len(), 33);
    for case in cases.into_iter().map(Case) {
        let (id, area) = (case.0["id"].as_str().unwrap(), case.0["area"].as_str().unwrap());
        match area {
            "kinematics_inverse" | "kinematics_forward" => kinematics(&case),
            "odometry" => odometry(&case, id),
            "dwm_displacement" => movement(&case),
            "clothoid" => clothoid(&case),
            _ => poses(&case, id),
        }
    }
    assert!((Radians(-PI).wrapped().0 - PI).abs() < 1e-15);
}
