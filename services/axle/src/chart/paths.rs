//! Paths in the plane, with the same scale in both directions.

use super::page::{
    self, Area, BLUE, GREEN, GREY, GRID, INK, ORANGE, PLOT, PURPLE, SKY, Sheet, VERMILION, WALL, at, failed,
    font, line, px,
};
use super::thin::{bounds, is_fine, thin};
use super::{PathSeries, Wall};
use axle_maps::Ink;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// The most series of one chart.
pub(crate) const MAX_SERIES: usize = 10;
/// The most way points that are marked, and the most that all have a number.
const MAX_MARKS: usize = 500;
const FEW: usize = 60;
/// The plot is at least and at most so high, in pixels.
const HEIGHTS: [f64; 2] = [150.0, 600.0];
/// The share of the plot that the data take.
const SHARE: f64 = 0.86;

/// Everything that lies in the plane, and where.
pub(super) struct Plane<'a> {
    paths: &'a [PathSeries],
    way_points: Vec<(f64, f64)>,
    walls: &'a [Wall],
    /// Outlines of where something may be, and what the legend calls them.
    outlines: &'a [Vec<(f64, f64)>],
    outlines_name: &'static str,
    centre: (f64, f64),
    /// Metres in a pixel, in both directions.
    pixel: f64,
    height: u32,
    empty: bool,
}

impl<'a> Plane<'a> {
    pub(super) fn new(paths: &'a [PathSeries], way_points: &[(f64, f64)], walls: &'a [Wall]) -> Self {
        let paths = paths.get(..MAX_SERIES).unwrap_or(paths);
        let way_points: Vec<_> = way_points.iter().copied().filter(is_fine).collect();
        let corners = walls.iter().flat_map(|wall| &wall.1);
        let all = paths.iter().flat_map(|path| &path.points).chain(&way_points).chain(corners).copied();
        let found = bounds(all);
        let [(left, right), (low, high)] = found.unwrap_or_default();
        let (wide, tall) = (right - left, high - low);
        // A long thin path gets a low plot; never one that is too low for its axis.
        let ratio = if wide > 0.0 { tall / wide } else { tall.clamp(0.4, 1.0) };
        let height = (f64::from(PLOT) * ratio).clamp(HEIGHTS[0], HEIGHTS[1]);
        // Below the paths the legend has start, end and way point.
        let height = height.max(f64::from(page::legend_height(paths.len() + 4) - page::BOTTOM));
        let pixel = (wide / f64::from(PLOT)).max(tall / height) / SHARE;
        // A single point has no extent: a metre around it shows where it is.
        let pixel = if pixel > 0.0 { pixel.max(1e-5) } else { 1.2 / height };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "150 to 600")]
        let height = height as u32;
        let centre = (f64::midpoint(left, right), f64::midpoint(low, high));
        let (outlines, outlines_name) = (&[][..], "");
        let empty = found.is_none();
        Self { paths, way_points, walls, outlines, outlines_name, centre, pixel, height, empty }
    }
    /// The same, of a square of this many metres at least: who turns on the spot moves by millimetres, which say nothing.
    pub(super) fn at_least(mut self, metres: f64) -> Self {
        self.pixel = self.pixel.max(metres / f64::from(self.height));
        self
    }
    /// The same with outlines below the paths.
    pub(super) const fn with_outlines(mut self, name: &'static str, outlines: &'a [Vec<(f64, f64)>]) -> Self {
        (self.outlines, self.outlines_name) = (outlines, name);
        self
    }

    /// Height of this part of the page, in pixels.
    pub(super) const fn height(&self) -> u32 {
        self.height + page::BOTTOM
    }

    pub(super) fn draw(&self, sheet: &Sheet<'_>) -> anyhow::Result<()> {
        let half = (self.pixel * f64::from(PLOT) / 2.0, self.pixel * f64::from(self.height) / 2.0);
        let (area, mut legend) = sheet.columns();
        let x = self.centre.0 - half.0..self.centre.0 + half.0;
        let y = self.centre.1 - half.1..self.centre.1 + half.1;
        let mut chart = page::plot(&area, self.height, (x, "x, forward (m)"), (y, "y, left (m)"))?;
        self.draw_walls(&chart.plotting_area().strip_coord_spec())?;
        let mut ends = Vec::new();
        for outline in self.outlines {
            let points: Vec<_> = outline.iter().copied().filter(is_fine).collect();
            chart.draw_series(LineSeries::new(points, line(PURPLE.into(), 12))).map_err(failed)?;
        }
        if !self.outlines.is_empty() {
            legend.line(line(PURPLE.into(), 12), self.outlines_name)?;
        }
        for path in self.paths {
            let points = thin(&path.points, (self.pixel, self.pixel));
            if let (Some(&first), Some(&last)) = (points.first(), points.last()) {
                ends.push((first, last, path.ink));
            }
            chart.draw_series(LineSeries::new(points, style(path.ink))).map_err(failed)?;
            legend.line(style(path.ink), &path.name)?;
        }
        let plot = chart.plotting_area().strip_coord_spec();
        let place = |point: (f64, f64)| self.place(point);
        // Paths that begin together have one mark.
        let mut begun: Vec<(f64, f64)> = Vec::new();
        for &(first, last, ink) in &ends {
            let near = |other: &(f64, f64)| (first.0 - other.0).hypot(first.1 - other.1) < 6.0 * self.pixel;
            if !begun.iter().any(near) {
                start(&plot, place(first))?;
                begun.push(first);
            }
            end(&plot, place(last), self::ink(ink))?;
        }
        if !ends.is_empty() {
            legend.mark("start", start)?;
            legend.mark("end of a path", |area, place| end(area, place, INK))?;
        }
        if !self.way_points.is_empty() {
            self.mark_way_points(&plot)?;
            legend.mark("way point", dot)?;
        }
        if self.empty {
            page::remark(&plot, self.height, "nothing to drive")?;
        }
        Ok(())
    }

    /// The map lies below everything else.
    fn draw_walls(&self, plot: &Area<'_>) -> anyhow::Result<()> {
        for (ink, corners) in self.walls {
            let colour = match ink {
                Ink::Unknown => GRID,
                Ink::Occupied => WALL,
            };
            let corners = corners.map(|corner| self.place(corner));
            plot.draw(&Polygon::new(corners, colour.filled())).map_err(failed)?;
        }
        Ok(())
    }

    /// Where a point of the plane is in the plot.
    fn place(&self, (x, y): (f64, f64)) -> (i32, i32) {
        let right = (x - self.centre.0) / self.pixel + f64::from(PLOT) / 2.0;
        let down = f64::from(self.height) / 2.0 - (y - self.centre.1) / self.pixel;
        (at(right), at(down))
    }

    /// Dots and numbers. Way points at one place share a label, which stands on the outer side of the path.
    fn mark_way_points(&self, plot: &Area<'_>) -> anyhow::Result<()> {
        let step = self.way_points.len().div_ceil(MAX_MARKS);
        // Among many way points only some have room for a number.
        let (crowded, room) = if self.way_points.len() > FEW { (true, 44.0) } else { (false, 14.0) };
        let mut labels: Vec<((f64, f64), Vec<usize>)> = Vec::new();
        for (index, &point) in self.way_points.iter().enumerate().step_by(step) {
            dot(plot, self.place(point))?;
            let near =
                |((x, y), _): &&mut ((f64, f64), _)| (point.0 - x).hypot(point.1 - y) < room * self.pixel;
            match labels.iter_mut().find(near) {
                Some((_, numbers)) if !crowded => numbers.push(index + 1),
                Some(_) => {}
                None => labels.push((point, vec![index + 1])),
            }
        }
        labels.into_iter().try_for_each(|(point, numbers)| self.label(plot, point, &numbers))
    }

    fn label(&self, plot: &Area<'_>, point: (f64, f64), numbers: &[usize]) -> anyhow::Result<()> {
        let outward = |value: f64, centre: f64| if value < centre { -1.0 } else { 1.0 };
        let (right, up) = (outward(point.0, self.centre.0), outward(point.1, self.centre.1));
        let anchor = Pos::new(if right > 0.0 { HPos::Left } else { HPos::Right }, VPos::Center);
        let (x, y) = self.place(point);
        let mut text: Vec<String> = numbers.iter().take(3).map(usize::to_string).collect();
        if numbers.len() > 3 {
            text.push("…".to_owned());
        }
        let place = (x + at(11.0 * right), y - at(13.0 * up));
        plot.draw(&Text::new(text.join(", "), place, font(13.0).pos(anchor))).map_err(failed)
    }
}

pub(super) fn ink(index: usize) -> RGBColor {
    const INKS: [RGBColor; 6] = [BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY];
    index.checked_sub(1).map_or(GREY, |index| INKS[index % INKS.len()])
}

/// Each line is thinner than those below it.
fn style(index: usize) -> ShapeStyle {
    const WIDTHS: [u32; 3] = [70, 32, 18];
    line(ink(index).into(), WIDTHS[index.min(2)])
}

fn start(area: &Area<'_>, place: (i32, i32)) -> anyhow::Result<()> {
    area.draw(&Circle::new(place, px(9), line(GREEN.into(), 25))).map_err(failed)
}

fn end(area: &Area<'_>, (x, y): (i32, i32), ink: RGBColor) -> anyhow::Result<()> {
    let r = at(6.0);
    let square = [(x - r, y - r), (x + r, y - r), (x + r, y + r), (x - r, y + r), (x - r, y - r)];
    // A white rim, so that it is seen on a path of its own ink too.
    area.draw(&PathElement::new(square, line(WHITE.into(), 50))).map_err(failed)?;
    area.draw(&PathElement::new(square, line(ink.into(), 20))).map_err(failed)
}

fn dot(area: &Area<'_>, place: (i32, i32)) -> anyhow::Result<()> {
    area.draw(&Circle::new(place, px(4), INK.filled())).map_err(failed)
}
