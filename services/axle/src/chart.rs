//! Charts: paths in the plane and wheel distances over time, as one SVG text.
//!
//! Whatever numbers come, the picture is valid and of bounded size: points that are not finite or absurdly far are left
//! out, long series are thinned out to what can be seen, and names are escaped. The plane has the same scale in both
//! directions, so that a square looks square.

mod page;
mod paths;
mod thin;
mod wheels;

use anyhow::Context as _;
use page::Page;

/// A path with a name: points in metres, in the order of driving. The first path of a chart is drawn widest and
/// palest, so that the next ones can be seen on it: give planned, true, estimated.
#[derive(Clone, Debug, Default)]
pub(crate) struct PathSeries {
    /// What the legend calls it.
    pub(crate) name: String,
    /// x forward, y left.
    pub(crate) points: Vec<(f64, f64)>,
}

/// Distances of both wheels at a time.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct WheelPoint {
    /// Seconds since the task began.
    pub(crate) time: f64,
    /// Metres of the left wheel.
    pub(crate) left: f64,
    /// Metres of the right wheel.
    pub(crate) right: f64,
}

/// What the wheels should have done, and what they did.
#[derive(Clone, Debug, Default)]
pub(crate) struct Wheels {
    /// As the plan wants it.
    pub(crate) due: Vec<WheelPoint>,
    /// As the encoders measured it.
    pub(crate) real: Vec<WheelPoint>,
}

impl PathSeries {
    /// What a planner wants the robot to drive.
    pub(crate) fn planned(points: Vec<(f64, f64)>) -> Self {
        Self { name: "planned".to_owned(), points }
    }
    /// Where the robot really was, which only an emulator knows.
    pub(crate) fn driven(points: Vec<(f64, f64)>) -> Self {
        Self { name: "true".to_owned(), points }
    }
    /// Where the robot believed to be.
    pub(crate) fn estimated(points: Vec<(f64, f64)>) -> Self {
        Self { name: "estimated".to_owned(), points }
    }
}

/// The paths alone.
pub(crate) fn path_chart(paths: &[PathSeries], way_points: &[(f64, f64)]) -> anyhow::Result<String> {
    draw("The path in the plane", paths, way_points, None).context("draw the chart")
}

/// The paths, and below them the distances of the wheels.
pub(crate) fn demo_chart(
    title: &str,
    paths: &[PathSeries],
    way_points: &[(f64, f64)],
    wheels: &Wheels,
) -> anyhow::Result<String> {
    draw(title, paths, way_points, Some(wheels)).context("draw the chart")
}

fn draw(
    title: &str,
    paths: &[PathSeries],
    way_points: &[(f64, f64)],
    wheels: Option<&Wheels>,
) -> anyhow::Result<String> {
    let plane = paths::Plane::new(paths, way_points);
    let below = if wheels.is_some() { wheels::HEIGHT } else { 0 };
    let mut page = Page::new(title, plane.height() + below);
    page.draw(|sheet| {
        let (upper, lower) = sheet.split_at(plane.height());
        plane.draw(&upper)?;
        wheels.map_or(Ok(()), |wheels| wheels::draw(wheels, &lower))
    })?;
    Ok(page.into_svg())
}

#[cfg(test)]
mod tests;
