//! Dots over something: what is left of measurements when a model is taken off.

use super::page::{self, GREY, Page, Sheet, failed, line, px};
use super::paths::ink;
use super::thin::bounds;
use anyhow::Context as _;
use plotters::prelude::*;

/// Height of a plot, in pixels, and the room above it.
const HEIGHT: u32 = 300;
const TOP: u32 = 14;
const PLOT_HEIGHT: u32 = HEIGHT - TOP - page::BOTTOM;
/// The most dots of one series.
const MOST: usize = 2000;

/// One plot of dots.
pub(crate) struct Scatter<'a> {
    /// The name of its horizontal axis.
    pub(crate) along: &'a str,
    /// The name of its vertical axis.
    pub(crate) axis: &'a str,
    /// Names and dots.
    pub(crate) series: &'a [(&'static str, Vec<(f64, f64)>)],
}

/// Plots of dots, one below the other.
pub(crate) fn scatter_chart(title: &str, plots: &[Scatter<'_>]) -> anyhow::Result<String> {
    let mut page = Page::new(title, plots.iter().map(|_| HEIGHT).sum());
    let drawn = page.draw(|sheet| {
        let (mut here, mut rest) = sheet.split_at(0);
        for plot in plots {
            (here, rest) = rest.split_at(HEIGHT);
            plot.draw(&here)?;
        }
        drop(here);
        Ok(())
    });
    drawn.context("draw the chart")?;
    Ok(page.into_svg())
}

impl Scatter<'_> {
    fn draw(&self, sheet: &Sheet<'_>) -> anyhow::Result<()> {
        let found = bounds(self.series.iter().flat_map(|(_, points)| points.iter().copied()));
        let [(left, right), (low, high)] = found.unwrap_or([(0.0, 1.0), (-1.0, 1.0)]);
        let widened = |low: f64, high: f64| {
            let room = ((high - low) * 0.06).max(1e-3);
            low - room..high + room
        };
        // Nothing is in every picture: that is where a perfect model would put all dots.
        let (low, high) = (low.min(0.0), high.max(0.0));
        let (_, sheet) = sheet.split_at(TOP);
        let (area, mut legend) = sheet.columns();
        let across = widened(left, right);
        let mut chart =
            page::plot(&area, PLOT_HEIGHT, (across.clone(), self.along), (widened(low, high), self.axis))?;
        let nothing = [(across.start, 0.0), (across.end, 0.0)];
        chart.draw_series(LineSeries::new(nothing, line(GREY.into(), 12))).map_err(failed)?;
        for (index, (name, points)) in self.series.iter().enumerate() {
            let ink = ink(index + 1);
            let seen = points.iter().filter(|(x, y)| x.is_finite() && y.is_finite()).take(MOST);
            let dots = seen.map(|point| Circle::new(*point, px(3), ink.filled()));
            chart.draw_series(dots).map_err(failed)?;
            legend.mark(name, |area, place| {
                area.draw(&Circle::new(place, px(3), ink.filled())).map_err(failed)
            })?;
        }
        if found.is_none() {
            page::remark(&chart.plotting_area().strip_coord_spec(), PLOT_HEIGHT, "no measurements")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_dot_that_is_a_number_is_drawn_and_an_empty_plot_says_so() {
        let series = [("left", vec![(0.1, 0.2), (0.3, -0.4), (f64::NAN, 1.0)]), ("right", vec![(1.0, 1.0)])];
        let plot = || Scatter { along: "speed (m/s)", axis: "signal", series: &series };
        let svg = scatter_chart("Residuals", &[plot(), plot()]).expect("a chart");
        // Three dots and two marks of the legend, twice.
        assert_eq!(svg.matches("<circle").count(), 10, "{svg}");
        assert!(!svg.contains("NaN"));
        let empty = scatter_chart("x", &[Scatter { along: "", axis: "", series: &[] }]).expect("a chart");
        assert!(empty.contains("no measurements"));
    }
}
