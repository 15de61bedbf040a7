//! Box plots: one row for each name, on a logarithmic axis, since failures lie far from all others.

use super::Spread;
use super::page::{self, INK, PLOT, Sheet, at, failed, font, line, px};
use super::paths::ink;
use plotters::prelude::*;
use plotters::style::FontTransform;

/// Height of a row, and room above and below all of them, in pixels.
const ROW: u32 = 34;
const TOP: u32 = 14;
/// Less than this cannot be told from nothing: 0.1 mm, where errors in centimetres are drawn.
const LEAST: f64 = 1e-2;
/// The axis has at least so many powers of ten.
const POWERS: f64 = 2.0;
/// The most rows of one chart.
const MOST: usize = 12;

/// Height of this part of the page, in pixels.
pub(super) fn height(rows: usize) -> u32 {
    TOP + plot_height(rows) + page::BOTTOM
}

fn plot_height(rows: usize) -> u32 {
    ROW * u32::try_from(rows.clamp(1, MOST)).unwrap_or(1)
}

/// Least, lower quarter, middle, upper quarter and largest of the values.
fn quartiles(values: &[f64]) -> Option<[f64; 5]> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    Some([0, 1, 2, 3, 4].map(|quarter| {
        let (place, part) = (last * quarter / 4, (last * quarter % 4) as f64 / 4.0);
        let next = sorted[(place + 1).min(last)];
        sorted[place] + (next - sorted[place]) * part
    }))
}

/// A value on the axis; what is not positive is at its left end.
fn logarithm(value: f64) -> f64 {
    value.max(LEAST).log10()
}

pub(super) fn draw(axis: &str, spreads: &[Spread], sheet: &Sheet<'_>) -> anyhow::Result<()> {
    let spreads = spreads.get(..MOST).unwrap_or(spreads);
    let (_, sheet) = sheet.split_at(TOP);
    let (area, mut legend) = sheet.columns();
    let rows: Vec<Option<[f64; 5]>> = spreads.iter().map(|spread| quartiles(&spread.values)).collect();
    let all = rows.iter().flatten().flat_map(|row| row.map(logarithm));
    let (low, high) =
        all.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    let (low, high) =
        if low <= high { (low.floor(), high.ceil().max(low.floor() + POWERS)) } else { (-1.0, 1.0) };
    let tall = plot_height(spreads.len());
    let mut chart = ChartBuilder::on(&area)
        .x_label_area_size(px(page::BOTTOM))
        .y_label_area_size(px(page::LEFT))
        .build_cartesian_2d(low..high, 0.0..f64::from(tall))
        .map_err(failed)?;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few powers of ten")]
    let powers = (high - low) as usize + 1;
    chart
        .configure_mesh()
        .disable_y_mesh()
        .y_labels(0)
        .x_desc(axis)
        .x_labels(powers)
        .x_label_formatter(&|power| page::number(&10_f64.powf(*power)))
        .label_style(font(12.0))
        .axis_desc_style(font(13.0))
        .axis_style(line(page::GRID.into(), 10))
        .bold_line_style(line(page::GRID.into(), 10))
        .light_line_style(TRANSPARENT)
        .draw()
        .map_err(failed)?;
    let style = font(13.0).transform(FontTransform::Rotate270).pos(page::CENTRED);
    area.draw(&Text::new("runs", (at(18.0), at(f64::from(tall) / 2.0)), style)).map_err(failed)?;
    let plot = chart.plotting_area().strip_coord_spec();
    let pixel = f64::from(PLOT) / (high - low);
    for (index, (spread, row)) in spreads.iter().zip(&rows).enumerate() {
        let ink = ink(index + 1);
        legend.line(line(ink.into(), 60), &spread.name)?;
        #[allow(clippy::cast_precision_loss, reason = "a few rows")]
        let y = (index as f64 + 0.5) * f64::from(ROW);
        let Some(row) = row else { continue };
        let [least, lower, middle, upper, most] = row.map(|value| (logarithm(value) - low) * pixel);
        let stroke = |from: (f64, f64), to: (f64, f64), ink: RGBColor, tenths: u32| {
            let ends = [(at(from.0), at(from.1)), (at(to.0), at(to.1))];
            plot.draw(&PathElement::new(ends, line(ink.into(), tenths))).map_err(failed)
        };
        stroke((least, y), (most, y), ink, 15)?;
        for end in [least, most] {
            stroke((end, y - 5.0), (end, y + 5.0), ink, 15)?;
        }
        let corners = [(at(lower), at(y - 9.0)), (at(upper), at(y + 9.0))];
        plot.draw(&Rectangle::new(corners, ink.mix(0.35).filled())).map_err(failed)?;
        plot.draw(&Rectangle::new(corners, line(ink.into(), 12))).map_err(failed)?;
        stroke((middle, y - 9.0), (middle, y + 9.0), INK, 25)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quartiles_are_those_of_the_sorted_values() {
        assert_eq!(quartiles(&[3.0, 1.0, 2.0, 5.0, 4.0]), Some([1.0, 2.0, 3.0, 4.0, 5.0]));
        assert_eq!(quartiles(&[1.0, 2.0]), Some([1.0, 1.25, 1.5, 1.75, 2.0]));
        assert_eq!(quartiles(&[f64::NAN, 7.0]), Some([7.0; 5]));
        assert_eq!(quartiles(&[]), None);
    }
}
