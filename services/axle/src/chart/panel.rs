//! What the wheels do over time: one plot with a line for each wheel.

use super::page::{self, BLUE, INK, PLOT, SKY, Sheet, VERMILION, failed, line};
use super::paths::ink;
use super::thin::{bounds, thin};
use super::{WheelPoint, Wheels};
use plotters::prelude::*;

/// Height of a panel, in pixels.
pub(super) const HEIGHT: u32 = 330;
/// Room above the plot, so that two plots do not touch.
const TOP: u32 = 14;
const PLOT_HEIGHT: u32 = HEIGHT - TOP - page::BOTTOM;

/// A plot over time.
pub(crate) struct Panel {
    /// The name of its vertical axis.
    axis: &'static str,
    lines: Vec<Line>,
}

/// Name, ink and points of a line.
pub(crate) type NamedLine = (&'static str, usize, Vec<(f64, f64)>);

/// One of its lines.
struct Line {
    /// What the legend calls it; nothing for a line that looks like another one.
    name: &'static str,
    style: ShapeStyle,
    is_right: bool,
    points: Vec<(f64, f64)>,
}

impl Panel {
    /// Distances that were due, and the real ones. What is due lies wide and pale below what is real; left has another
    /// hue than right, and is wider, so that both can be seen where they cover the same distance.
    pub(crate) fn due_and_real(wheels: &Wheels) -> Self {
        let peach = RGBColor(250, 200, 150);
        let due = [line(SKY.mix(0.55), 90), line(peach.into(), 55)];
        let mut lines = sides(["left wheel, due", "right wheel, due"], due, &wheels.due);
        lines.extend(sides(
            ["left wheel, real", "right wheel, real"],
            LEFT_AND_RIGHT.map(look),
            &wheels.real,
        ));
        Self { axis: "wheel distance (m)", lines }
    }

    /// What the wheels of some runs did. One run has a hue for each wheel; of several each has the ink of its path, the
    /// left wheel is wide and pale, and each run is drawn thinner than those below it.
    pub(crate) fn of_runs(axis: &'static str, runs: &[&[WheelPoint]]) -> Self {
        const NAMES: [&str; 2] = ["left wheel", "right wheel"];
        if let [only] = runs {
            return Self { axis, lines: sides(NAMES, LEFT_AND_RIGHT.map(look), only) };
        }
        let looks = |ink: RGBColor, above: usize| {
            let [left, right] = [[90, 60, 40], [30, 20, 14]].map(|widths| widths[above.min(2)]);
            [line(pale(ink).into(), left), line(ink.into(), right)]
        };
        let mut lines = sides(NAMES, looks(INK, 1), &[]);
        for (index, run) in runs.iter().enumerate() {
            lines.extend(sides(["", ""], looks(ink(index + 1), index), run));
        }
        // All left wheels lie below all right ones, of which none could be seen otherwise.
        lines[2..].sort_by_key(|line| line.is_right);
        Self { axis, lines }
    }

    /// Anything over time: lines with their names and inks; one without a name looks like another one.
    pub(crate) fn of_lines(axis: &'static str, lines: Vec<NamedLine>) -> Self {
        let lines = lines.into_iter().map(|(name, index, points)| Line {
            name,
            style: line(ink(index).into(), 16),
            is_right: false,
            points,
        });
        Self { axis, lines: lines.collect() }
    }

    pub(super) fn draw(&self, sheet: &Sheet<'_>) -> anyhow::Result<()> {
        let all = self.lines.iter().flat_map(|line| line.points.iter().copied());
        let found = bounds(all);
        let [(begin, end), (low, high)] = found.unwrap_or([(0.0, 1.0), (0.0, 1.0)]);
        let end = end.max(begin + 1e-3);
        let room = ((high - low) * 0.06).max(0.01);
        let (low, high) = (low - room, high + room);
        let (_, sheet) = sheet.split_at(TOP);
        let (area, mut legend) = sheet.columns();
        let mut chart = page::plot(&area, PLOT_HEIGHT, (begin..end, "time (s)"), (low..high, self.axis))?;
        let pixel = ((end - begin) / f64::from(PLOT), (high - low) / f64::from(PLOT_HEIGHT));
        for line in &self.lines {
            chart.draw_series(LineSeries::new(thin(&line.points, pixel), line.style)).map_err(failed)?;
            if !line.name.is_empty() {
                legend.line(line.style, line.name)?;
            }
        }
        if found.is_none() {
            page::remark(&chart.plotting_area().strip_coord_spec(), PLOT_HEIGHT, "no measurements")?;
        }
        Ok(())
    }
}

/// Ink and width in tenths of a pixel.
const LEFT_AND_RIGHT: [(RGBColor, u32); 2] = [(BLUE, 28), (VERMILION, 16)];

/// A tint that hides what it covers, so that two of them do not mix.
fn pale(ink: RGBColor) -> RGBColor {
    let tint = |part: u8| 255 - (255 - part) / 5 * 2;
    RGBColor(tint(ink.0), tint(ink.1), tint(ink.2))
}

fn look((ink, width): (RGBColor, u32)) -> ShapeStyle {
    line(ink.into(), width)
}

fn sides(names: [&'static str; 2], styles: [ShapeStyle; 2], points: &[WheelPoint]) -> Vec<Line> {
    let picks: [fn(&WheelPoint) -> f64; 2] = [|point| point.left, |point| point.right];
    (0..2)
        .map(|side| Line {
            name: names[side],
            style: styles[side],
            is_right: side == 1,
            points: points.iter().map(|point| (point.time, picks[side](point))).collect(),
        })
        .collect()
}
