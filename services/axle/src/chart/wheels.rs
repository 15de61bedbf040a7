//! Distances of the wheels over time: due against real.

use super::page::{self, BLUE, PLOT, SKY, Sheet, VERMILION, failed, line};
use super::thin::{bounds, thin};
use super::{WheelPoint, Wheels};
use plotters::prelude::*;

/// Height of this part of the page, in pixels.
pub(super) const HEIGHT: u32 = 330;
/// Room above the plot, so that two plots do not touch.
const TOP: u32 = 14;
const PLOT_HEIGHT: u32 = HEIGHT - TOP - page::BOTTOM;

/// One of the four lines.
struct Curve {
    name: &'static str,
    style: ShapeStyle,
    points: Vec<(f64, f64)>,
}

/// What is due lies wide and pale below what is real; left has another hue than right, and is wider, so that both can
/// be seen where they cover the same distance.
fn curves(wheels: &Wheels) -> [Curve; 4] {
    let pick = |points: &[WheelPoint], side: fn(&WheelPoint) -> f64| {
        points.iter().map(|point| (point.time, side(point))).collect()
    };
    let peach = RGBColor(250, 200, 150);
    [
        Curve {
            name: "left wheel, due",
            style: line(SKY.mix(0.55), 90),
            points: pick(&wheels.due, |p| p.left),
        },
        Curve {
            name: "right wheel, due",
            style: line(peach.into(), 55),
            points: pick(&wheels.due, |p| p.right),
        },
        Curve {
            name: "left wheel, real",
            style: line(BLUE.into(), 28),
            points: pick(&wheels.real, |p| p.left),
        },
        Curve {
            name: "right wheel, real",
            style: line(VERMILION.into(), 16),
            points: pick(&wheels.real, |p| p.right),
        },
    ]
}

pub(super) fn draw(wheels: &Wheels, sheet: &Sheet<'_>) -> anyhow::Result<()> {
    let curves = curves(wheels);
    let all = curves.iter().flat_map(|curve| curve.points.iter().copied());
    let found = bounds(all);
    let [(begin, end), (low, high)] = found.unwrap_or([(0.0, 1.0), (0.0, 1.0)]);
    let end = end.max(begin + 1e-3);
    let room = ((high - low) * 0.06).max(0.01);
    let (low, high) = (low - room, high + room);
    let (_, sheet) = sheet.split_at(TOP);
    let (area, mut legend) = sheet.columns();
    let mut chart =
        page::plot(&area, PLOT_HEIGHT, (begin..end, "time (s)"), (low..high, "wheel distance (m)"))?;
    let pixel = ((end - begin) / f64::from(PLOT), (high - low) / f64::from(PLOT_HEIGHT));
    for curve in &curves {
        chart.draw_series(LineSeries::new(thin(&curve.points, pixel), curve.style)).map_err(failed)?;
        legend.line(curve.style, curve.name)?;
    }
    if found.is_none() {
        page::remark(&chart.plotting_area().strip_coord_spec(), PLOT_HEIGHT, "no measurements")?;
    }
    Ok(())
}
