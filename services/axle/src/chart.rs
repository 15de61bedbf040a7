//! Charts: paths in the plane, and what the wheels do over time, as one SVG text.
//!
//! Whatever numbers come, the picture is valid and of bounded size: points that are not finite or absurdly far are left
//! out, long series are thinned out to what can be seen, and names are escaped. The plane has the same scale in both
//! directions, so that a square looks square.

mod boxes;
mod page;
mod panel;
mod paths;
mod raster;
mod scatter;
mod thin;

pub(crate) use panel::Panel;
pub(crate) use paths::MAX_SERIES;
pub(crate) use raster::png;
pub(crate) use scatter::{Scatter, scatter_chart};

use anyhow::Context as _;
use page::Page;

/// What of a map is not free, by its corners in metres.
pub(crate) type Wall = (axle_maps::Ink, [(f64, f64); 4]);

/// The most of them in one chart.
pub(crate) const MAX_WALLS: usize = 20_000;

/// A path with a name: points in metres, in the order of driving.
#[derive(Clone, Debug, Default)]
pub(crate) struct PathSeries {
    /// What the legend calls it.
    pub(crate) name: String,
    /// x forward, y left.
    pub(crate) points: Vec<(f64, f64)>,
    /// 0 is drawn widest and palest, so that the others can be seen on it; the others differ in their hue. Paths are
    /// drawn in the order in which they are given.
    pub(crate) ink: usize,
}

/// Something of both wheels at a time.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct WheelPoint {
    /// Seconds since the beginning.
    pub(crate) time: f64,
    /// Metres, or m/s, of the left wheel.
    pub(crate) left: f64,
    /// Metres, or m/s, of the right wheel.
    pub(crate) right: f64,
}

/// How far the wheels should have come, and how far they came.
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
        Self { name: "planned".to_owned(), points, ink: 0 }
    }
    /// Where the robot really was, which only an emulator knows.
    pub(crate) fn driven(points: Vec<(f64, f64)>) -> Self {
        Self { name: "true".to_owned(), points, ink: 1 }
    }
    /// Where the robot believed to be.
    pub(crate) fn estimated(points: Vec<(f64, f64)>) -> Self {
        Self { name: "estimated".to_owned(), points, ink: 2 }
    }
}

/// The paths alone.
pub(crate) fn path_chart(paths: &[PathSeries], way_points: &[(f64, f64)]) -> anyhow::Result<String> {
    chart("The path in the plane", paths, way_points, &[])
}

/// The paths, and below them the distances of the wheels.
pub(crate) fn demo_chart(
    title: &str,
    paths: &[PathSeries],
    way_points: &[(f64, f64)],
    wheels: &Wheels,
) -> anyhow::Result<String> {
    chart(title, paths, way_points, &[Panel::due_and_real(wheels)])
}

/// The smallest square that the paths of a contest are drawn in, m.
const LEAST: f64 = 0.1;

/// How values of one name are spread.
#[derive(Clone, Debug, Default)]
pub(crate) struct Spread {
    /// What the legend calls them.
    pub(crate) name: String,
    /// The values, in any order.
    pub(crate) values: Vec<f64>,
}

/// The paths of several robots, where there are any, and below them how far from the goal they ended, as box plots. The
/// first path is that of the plan; the next ones have the inks of the boxes.
pub(crate) fn contest_chart(
    title: &str,
    paths: &[PathSeries],
    (axis, spreads): (&str, &[Spread]),
) -> anyhow::Result<String> {
    let plane = (!paths.is_empty()).then(|| paths::Plane::new(paths, &[], &[]).at_least(LEAST));
    let above = plane.as_ref().map_or(0, paths::Plane::height);
    let mut page = Page::new(title, above + boxes::height(spreads.len()));
    let drawn = page.draw(|sheet| {
        let (upper, lower) = sheet.split_at(above);
        plane.as_ref().map_or(Ok(()), |plane| plane.draw(&upper))?;
        boxes::draw(axis, spreads, &lower)
    });
    drawn.context("draw the chart")?;
    Ok(page.into_svg())
}

/// The paths, and below them some panels.
pub(crate) fn chart(
    title: &str,
    paths: &[PathSeries],
    way_points: &[(f64, f64)],
    panels: &[Panel],
) -> anyhow::Result<String> {
    floor_chart(title, paths, way_points, &[], panels)
}

/// The same, on the walls of a map.
pub(crate) fn floor_chart(
    title: &str,
    paths: &[PathSeries],
    way_points: &[(f64, f64)],
    walls: &[Wall],
    panels: &[Panel],
) -> anyhow::Result<String> {
    page(title, &paths::Plane::new(paths, way_points, walls), panels)
}

/// The paths on a map.
pub(crate) fn map_chart(
    title: &str,
    paths: &[PathSeries],
    way_points: &[(f64, f64)],
    walls: &[Wall],
) -> anyhow::Result<String> {
    floor_chart(title, paths, way_points, walls, &[])
}

/// A closed line, in metres.
pub(crate) type Outline = Vec<(f64, f64)>;

/// The same with panels, and with the ellipses in which the robot believed to be.
pub(crate) fn believed_chart(
    title: &str,
    paths: &[PathSeries],
    way_points: &[(f64, f64)],
    (walls, ellipses): (&[Wall], &[Outline]),
    panels: &[Panel],
) -> anyhow::Result<String> {
    let plane = paths::Plane::new(paths, way_points, walls).with_outlines("95 % of estimate", ellipses);
    page(title, &plane, panels)
}

fn page(title: &str, plane: &paths::Plane<'_>, panels: &[Panel]) -> anyhow::Result<String> {
    let below: u32 = panels.iter().map(|_| panel::HEIGHT).sum();
    let mut page = Page::new(title, plane.height() + below);
    let drawn = page.draw(|sheet| {
        let (upper, mut rest) = sheet.split_at(plane.height());
        plane.draw(&upper)?;
        for panel in panels {
            let (here, below) = rest.split_at(panel::HEIGHT);
            panel.draw(&here)?;
            rest = below;
        }
        Ok(())
    });
    drawn.context("draw the chart")?;
    Ok(page.into_svg())
}

#[cfg(test)]
mod tests;
