//! What everything that was measured amounts to.

use super::Procedure;
use crate::band::common;
use crate::by_hand;
use crate::geometry::{Body, Leg, Part, body, miss, track};
use crate::log::Log;
use crate::motor::{Pass, branch, left, resolution};
use crate::report::{Plot, Quantity, Report, Square};
use crate::statistics::{Estimate, of_passes};
use axle_schema::calibration::{Branch, WheelMap};
use axle_schema::unit::{Numbers, Ratio};
use axle_schema::{Calibration, Metres, Refusal, Sides, Track};

impl Procedure {
    /// The calibration and its report.
    pub(super) fn outcome(&mut self) -> Result<(Calibration, Report), Refusal> {
        let mut report = Report { findings: self.found.findings.clone(), ..Report::default() };
        if self.subject.keeps_speeds {
            report.findings.push(
                "the board keeps speeds by itself: dead band, ks, kv and ka are those of its controller, and of its motors \
                 nothing is known; let it be told powers to measure them"
                    .into(),
            );
        }
        report.duration = self.begun.map_or(0.0, |(begun, _)| self.now - begun);
        let wheels = self.motors(&mut report)?;
        let mut calibration = Calibration {
            version: self.subject.version.saturating_add(1),
            motors: self.found.motors,
            encoders: self.found.encoders,
            ..Calibration::default()
        };
        let scale = match self.bodies(&mut report)? {
            Some(body) => {
                calibration.track = Some(Track::new(Metres(body.track))?);
                body.scale()
            }
            None => Sides::new(1.0, 1.0),
        };
        calibration.scale = scale.map(Ratio);
        calibration.wheels = Sides::new(covered(wheels.left, scale.left), covered(wheels.right, scale.right));
        self.residuals(&mut report);
        calibration.validate()?;
        self.log = Log::default();
        Ok((calibration, report))
    }

    /// Each wheel and direction, by what its encoder counts.
    fn motors(&self, report: &mut Report) -> Result<Sides<WheelMap>, Refusal> {
        let mut wheels = Sides::new(WheelMap::default(), WheelMap::default());
        for direction in [0, 1] {
            let Sides { left, right } = &self.found.runs[direction];
            let Sides { left: left_band, right: right_band } = &self.found.brackets[direction];
            for (side, passes, brackets) in [("left", left, left_band), ("right", right, right_band)] {
                let way = if direction == 0 { "forward" } else { "backward" };
                let mut branch =
                    branch(passes).ok_or_else(|| super::stage::no_motor(&format!("the {side}")))?;
                if !branch.points.is_empty() {
                    report
                        .findings
                        .push(format!("the {side} motor {way} is no straight line: given by points"));
                }
                let band = common(brackets);
                branch.dead_band = band.map_or(branch.ks, |band| band.value).clamp(0.0, 1.0);
                if let Some(estimate) = band {
                    let passes = brackets.iter().map(|bracket| f64::midpoint(bracket.low, bracket.high));
                    let name = format!("{side} {way} dead band");
                    report.quantities.push(Quantity { name, unit: "", estimate, passes: passes.collect() });
                }
                self.numbers(report, &format!("{side} {way}"), passes)?;
                let wheel = if side == "left" { &mut wheels.left } else { &mut wheels.right };
                *(if direction == 0 { &mut wheel.forward } else { &mut wheel.backward }) = branch;
            }
        }
        Ok(wheels)
    }

    fn numbers(&self, report: &mut Report, name: &str, passes: &[Pass]) -> Result<(), Refusal> {
        for (number, (what, unit)) in [("ks", ""), ("kv", "s/m"), ("ka", "s²/m")].into_iter().enumerate() {
            let values: Vec<f64> = passes.iter().map(|pass| pass.numbers[number]).collect();
            let shared = passes
                .first()
                .map_or(0.0, |pass| resolution(pass, self.found.tick, super::stage::WINDOW)[number]);
            let estimate = of_passes(&values, shared).ok_or_else(|| super::stage::no_motor("a"))?;
            report.quantities.push(Quantity {
                name: format!("{name} {what}"),
                unit,
                estimate,
                passes: values,
            });
        }
        Ok(())
    }

    /// Takes the bias of each pass off its turns.
    fn legs(&self) -> Vec<Vec<Leg>> {
        let passes = self.found.legs.iter().zip(&self.found.rests);
        passes
            .map(|(legs, (turned, span))| {
                let bias = if *span > 0.0 { turned / span } else { 0.0 };
                legs.iter().map(|leg| Leg { turned: leg.turned - bias * leg.span, ..*leg }).collect()
            })
            .collect()
    }

    /// The body of the robot, where there was a gyroscope.
    fn bodies(&self, report: &mut Report) -> Result<Option<Body>, Refusal> {
        if self.subject.by_hand {
            return self.by_hand(report).map(Some);
        }
        if !self.found.has_gyro {
            return Ok(None);
        }
        let passes = self.legs();
        let each = |which: fn(Part) -> bool| -> Option<Vec<Body>> {
            passes.iter().map(|legs| body(legs, which).map(|(body, _)| body)).collect()
        };
        let lost = || Refusal::Failed { why: "the squares tell nothing: did the robot turn at all?".into() };
        let all = each(|_| true).ok_or_else(lost)?;
        let squares = each(|part| part != Part::Turn).ok_or_else(lost)?;
        let spun: Option<Vec<f64>> =
            passes.iter().zip(&all).map(|(legs, body)| track(legs, body.ratio)).collect();
        // What whole ticks do to a leg, as a share of the ways of all legs of a pass: the passes may have it in common.
        let ticks = |way: fn(&Leg) -> f64, which: fn(Part) -> bool| {
            let ways =
                passes.iter().flatten().filter(|leg| which(leg.part)).map(way).filter(|way| *way > 0.05);
            let (count, sum) = ways.fold((0.0_f64, 0.0), |(count, sum), way| (count + 1.0, sum + way));
            let each = count / crate::motor::float(passes.len().max(1));
            if sum > 0.0 {
                self.found.tick / 3.0_f64.sqrt() * each.sqrt() / (sum / count * each)
            } else {
                0.0
            }
        };
        let apart = |leg: &Leg| (leg.counted.right - leg.counted.left).abs();
        let along = |leg: &Leg| (leg.counted.right + leg.counted.left).abs() / 2.0;
        let turns = ticks(apart, |_| true) * self.subject.track.get();
        let sides = ticks(along, |_| true);
        let mut say = |name: &str, unit, passes: Vec<f64>, shared| -> Result<Estimate, Refusal> {
            let estimate = of_passes(&passes, shared).ok_or_else(lost)?;
            report.quantities.push(Quantity { name: name.to_owned(), unit, estimate, passes });
            Ok(estimate)
        };
        let ratio = say("wheel ratio", "", all.iter().map(|body| body.ratio).collect(), sides)?;
        let effective = say("track", "m", all.iter().map(|body| body.track).collect(), turns)?;
        say("track by squares", "m", squares.iter().map(|body| body.track).collect(), turns)?;
        if let Some(spun) = spun {
            say("track by turns", "m", spun, turns)?;
        }
        let found = Body { ratio: ratio.value, track: effective.value };
        let described = Body { ratio: 1.0, track: self.subject.track.get() };
        for legs in &passes {
            for (part, is_left) in [(Part::Left, true), (Part::Right, false)] {
                let (before, after) = (miss(legs, part, described), miss(legs, part, found));
                report.squares.push(Square { left: is_left, before, after });
            }
        }
        Ok(Some(found))
    }

    /// The body by the ends that a person has measured.
    fn by_hand(&self, report: &mut Report) -> Result<Body, Refusal> {
        let why =
            "no robot ends its squares where these were said to end: are ahead and left those of its start?";
        let lost = || Refusal::Failed { why: why.into() };
        let described = Body { ratio: 1.0, track: self.subject.track.get() };
        let driven = &self.found.driven;
        let passes: Option<Vec<Body>> = driven.chunks(2).map(|two| by_hand::fit(two, described)).collect();
        let passes = passes.ok_or_else(lost)?;
        let mut say = |name: &str, unit, passes: Vec<f64>| -> Result<f64, Refusal> {
            let estimate = of_passes(&passes, 0.0).ok_or_else(lost)?;
            report.quantities.push(Quantity { name: name.to_owned(), unit, estimate, passes });
            Ok(estimate.value)
        };
        let ratio = say("wheel ratio", "", passes.iter().map(|body| body.ratio).collect())?;
        let track = say("track", "m", passes.iter().map(|body| body.track).collect())?;
        let found = Body { ratio, track };
        let mut series = vec![
            ("left", vec![]),
            ("right", vec![]),
            ("left, calibrated", vec![]),
            ("right, calibrated", vec![]),
        ];
        for square in driven {
            let (before, after) = (square.miss(described), square.miss(found));
            report.squares.push(Square { left: square.left, before, after });
            for (place, (x, y)) in [(0, before), (2, after)] {
                series[place + usize::from(!square.left)].1.push((x * 1000.0, y * 1000.0));
            }
        }
        let title = "Ends of the squares by odometry, beside those that were measured";
        report.plots.push(Plot { title, along: "ahead (mm)", axis: "to the left (mm)", series });
        Ok(found)
    }

    fn residuals(&self, report: &mut Report) {
        let mut series = Vec::new();
        for (direction, names) in
            [["left forward", "right forward"], ["left backward", "right backward"]].into_iter().enumerate()
        {
            let sign = if direction == 0 { 1.0 } else { -1.0 };
            let passes = &self.found.runs[direction];
            for (name, passes) in names.into_iter().zip([&passes.left, &passes.right]) {
                let points = passes.iter().flat_map(left).map(|[speed, off]| (speed * sign, off * 1000.0));
                series.push((name, points.collect()));
            }
        }
        report.plots.push(Plot {
            title: "Signals less the line of each motor",
            along: "speed of the wheel (m/s)",
            axis: "signal (thousandths)",
            series,
        });
        let mut parts = vec![("squares", Vec::new()), ("turns", Vec::new())];
        for legs in self.legs() {
            let Some((_, off)) = body(&legs, |_| true) else { continue };
            for (leg, [turn, off]) in legs.iter().zip(off) {
                parts[usize::from(leg.part == Part::Turn)].1.push((turn, off * 1000.0));
            }
        }
        if parts.iter().any(|(_, points)| !points.is_empty()) {
            report.plots.push(Plot {
                title: "Turns less those of the calibrated wheels",
                along: "turn by the gyroscope (rad)",
                axis: "difference (mrad)",
                series: parts,
            });
        }
    }
}

/// The same motor for what the wheel covers, where it was measured by what its encoder counts.
fn covered(wheel: WheelMap, scale: f64) -> WheelMap {
    let branch = |branch: Branch| Branch {
        kv: branch.kv / scale,
        ka: branch.ka / scale,
        points: branch.points.iter().map(|Numbers([v, s])| Numbers([v * scale, *s])).collect(),
        ..branch
    };
    WheelMap { forward: branch(wheel.forward), backward: branch(wheel.backward) }
}
