//! The page: its measures, its fonts and inks, and the text that becomes the file.

use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontTransform, RGBAColor, TextStyle};
use std::ops::Range;

pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Plotters rounds to whole units: a unit is a quarter of a pixel, so that slopes have no stairs.
const UNITS: u32 = 4;
const TITLE: u32 = 46;
const WIDTH: u32 = 900;
/// Room for the numbers and the name of the vertical axis.
pub(super) const LEFT: u32 = 74;
/// Room for the numbers and the name of the horizontal axis.
pub(super) const BOTTOM: u32 = 46;
/// Room for the legend, beside the plot: it never covers data.
const LEGEND: u32 = 182;
/// Width of the plot itself.
pub(super) const PLOT: u32 = WIDTH - LEFT - LEGEND;

/// Inks of Okabe and Ito, which colour-blind people tell apart; the pale ones lie below the others.
pub(super) const GREY: RGBColor = RGBColor(176, 176, 176);
pub(super) const BLUE: RGBColor = RGBColor(0, 114, 178);
pub(super) const VERMILION: RGBColor = RGBColor(213, 94, 0);
pub(super) const GREEN: RGBColor = RGBColor(0, 158, 115);
pub(super) const PURPLE: RGBColor = RGBColor(204, 121, 167);
pub(super) const ORANGE: RGBColor = RGBColor(230, 159, 0);
pub(super) const SKY: RGBColor = RGBColor(86, 180, 233);
pub(super) const INK: RGBColor = RGBColor(40, 40, 40);
pub(super) const GRID: RGBColor = RGBColor(226, 226, 226);
pub(super) const WALL: RGBColor = RGBColor(96, 96, 96);
const FAINT: RGBColor = RGBColor(120, 120, 120);

/// Pixels in the units of the drawing.
pub(super) const fn px(pixels: u32) -> u32 {
    pixels * UNITS
}

/// Pixels as coordinates, which may be negative; all of them are small.
pub(super) fn at(pixels: f64) -> i32 {
    #[allow(clippy::cast_possible_truncation, reason = "the conversion saturates")]
    let units = (pixels * f64::from(UNITS)).round() as i32;
    units
}

/// A text style; plotters draws a font of size s with s / 1.24.
pub(super) fn font(pixels: f64) -> TextStyle<'static> {
    ("sans-serif", pixels * 1.24 * f64::from(UNITS)).into_font().color(&INK)
}

/// A line of a width in tenths of a pixel.
pub(super) fn line(ink: RGBAColor, tenths: u32) -> ShapeStyle {
    ShapeStyle { color: ink, filled: false, stroke_width: (tenths * UNITS).div_ceil(10) }
}

/// A name as it may stand in XML, at most `most` letters long.
pub(super) fn clean(name: &str, most: usize) -> String {
    let legal = |c: &char| !c.is_control() && !matches!(c, '\u{fffe}' | '\u{ffff}');
    let mut text: String = name.chars().filter(legal).take(most + 1).collect();
    if text.chars().count() > most {
        text = text.chars().take(most - 1).chain(['…']).collect();
    }
    text
}

/// Numbers of an axis, without useless zeros.
pub(super) fn number(value: &f64) -> String {
    let text = format!("{value:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// How many numbers an axis of so many pixels takes.
const fn ticks(pixels: u32) -> usize {
    let ticks = pixels / 60;
    if ticks < 3 { 3 } else { ticks as usize }
}

/// A plot of numbers over numbers.
pub(super) type Plot<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// A plot with axes in a column of the page that is `height` pixels high, without the room for the numbers below.
pub(super) fn plot<'a, 'b>(
    area: &'a Area<'b>,
    height: u32,
    (x, x_name): (Range<f64>, &str),
    (y, y_name): (Range<f64>, &str),
) -> anyhow::Result<Plot<'a, 'b>> {
    let mut chart = ChartBuilder::on(area)
        .x_label_area_size(px(BOTTOM))
        .y_label_area_size(px(LEFT))
        .build_cartesian_2d(x, y)
        .map_err(failed)?;
    chart
        .configure_mesh()
        .x_desc(x_name)
        .x_labels(ticks(PLOT))
        .y_labels(ticks(height))
        .x_label_formatter(&number)
        .y_label_formatter(&number)
        .label_style(font(12.0))
        .axis_desc_style(font(13.0))
        .axis_style(line(INK.into(), 10))
        .bold_line_style(line(GRID.into(), 10))
        .light_line_style(TRANSPARENT)
        .set_all_tick_mark_size(px(4))
        .draw()
        .map_err(failed)?;
    // Plotters would cut this name off at the edge of the page, since it does not know how wide letters are.
    let style = font(13.0).transform(FontTransform::Rotate270).pos(CENTRED);
    let place = (at(18.0), at(f64::from(height) / 2.0));
    area.draw(&Text::new(y_name.to_owned(), place, style)).map_err(failed)?;
    Ok(chart)
}

/// A text around its place.
pub(super) const CENTRED: Pos = Pos { h_pos: HPos::Center, v_pos: VPos::Center };
/// A text to the right of its place.
const RIGHT_OF: Pos = Pos { h_pos: HPos::Left, v_pos: VPos::Center };

/// Says in an empty plot why it is empty.
pub(super) fn remark(plot: &Area<'_>, height: u32, words: &'static str) -> anyhow::Result<()> {
    let place = (at(f64::from(PLOT) / 2.0), at(f64::from(height) / 2.0));
    plot.draw(&Text::new(words, place, font(14.0).color(&FAINT).pos(CENTRED))).map_err(failed)
}

/// Plotters' errors know nothing that an SVG in memory could do wrong; they become plain text.
#[allow(clippy::needless_pass_by_value, reason = "as map_err gives it")]
pub(super) fn failed(fault: impl std::fmt::Display) -> anyhow::Error {
    anyhow::anyhow!("{fault}")
}

/// A part of the page.
pub(super) struct Sheet<'a>(pub(super) Area<'a>);

impl<'a> Sheet<'a> {
    /// The upper part of so many pixels, and the rest.
    pub(super) fn split_at(&self, pixels: u32) -> (Self, Self) {
        let (upper, lower) = self.0.split_vertically(px(pixels));
        (Self(upper), Self(lower))
    }
    /// The plot with its axes, and the column of the legend.
    pub(super) fn columns(&self) -> (Area<'a>, Legend<'a>) {
        let (plot, legend) = self.0.split_horizontally(px(LEFT + PLOT));
        (plot, Legend { area: legend, next: f64::from(ABOVE) })
    }
}

/// Pixels from one entry of a legend to the next, and above the first.
const ENTRY: u32 = 22;
const ABOVE: u32 = 12;

/// The height of a legend of so many entries, in pixels.
pub(super) fn legend_height(entries: usize) -> u32 {
    ABOVE + ENTRY * u32::try_from(entries).unwrap_or(u32::MAX / 2 / ENTRY)
}

/// The legend: one line for each entry, from top to bottom.
pub(super) struct Legend<'a> {
    area: Area<'a>,
    next: f64,
}

impl Legend<'_> {
    /// How a line looks.
    pub(super) fn line(&mut self, style: ShapeStyle, name: &str) -> anyhow::Result<()> {
        let y = self.entry(name)?;
        self.area.draw(&PathElement::new([(at(16.0), y), (at(44.0), y)], style)).map_err(failed)
    }
    /// How a mark looks: drawn by `mark` around a place.
    pub(super) fn mark(
        &mut self,
        name: &str,
        mark: impl FnOnce(&Area<'_>, (i32, i32)) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let y = self.entry(name)?;
        mark(&self.area, (at(30.0), y))
    }
    fn entry(&mut self, name: &str) -> anyhow::Result<i32> {
        let y = at(self.next);
        self.next += f64::from(ENTRY);
        let style = font(12.0).pos(RIGHT_OF);
        self.area.draw(&Text::new(clean(name, 19), (at(52.0), y), style)).map_err(failed)?;
        Ok(y)
    }
}

/// The whole picture.
pub(super) struct Page {
    title: String,
    height: u32,
    svg: String,
}

impl Page {
    pub(super) fn new(title: &str, height: u32) -> Self {
        Self { title: clean(title, 90), height: height + TITLE, svg: String::new() }
    }

    /// Draws the title, and below it what `content` draws.
    pub(super) fn draw(
        &mut self,
        content: impl FnOnce(&Sheet<'_>) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let root = SVGBackend::with_string(&mut self.svg, (px(WIDTH), px(self.height))).into_drawing_area();
        root.fill(&WHITE).map_err(failed)?;
        let style = font(17.0).pos(RIGHT_OF);
        root.draw(&Text::new(self.title.clone(), (at(16.0), at(22.0)), style)).map_err(failed)?;
        let (_, rest) = root.split_vertically(px(TITLE));
        content(&Sheet(rest))?;
        root.present().map_err(failed)
    }

    /// The file. Its head is written anew: units become pixels, corners round, and the title can be read aloud.
    pub(super) fn into_svg(self) -> String {
        let Self { title, height, svg } = self;
        let (wide, high) = (px(WIDTH), px(height));
        let title = title.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
        let body = svg.split_once('>').map_or("", |(_, body)| body);
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{height}\" \
             viewBox=\"0 0 {wide} {high}\" stroke-linejoin=\"round\" role=\"img\">\n<title>{title}</title>{body}"
        )
    }
}
