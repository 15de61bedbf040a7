//! From the SVG of a chart to a PNG, for whatever shows no SVG: mails, papers, chats.
//!
//! It reads what this program writes and no other SVG: rectangles, lines, circles, polygons and texts in one system of
//! coordinates. What it does not know it leaves out. A shape is filled by how much of each pixel it covers, so that edges
//! are smooth; the outlines of letters stand in `letters.txt`, so that a picture is the same on every computer.

mod letters;
mod mask;

use anyhow::Context as _;
use mask::{Mask, Point};

/// Pixels for a pixel of the page: sharp on the screens of today.
const SCALE: f64 = 2.0;
/// The most pixels of a picture.
const MOST: f64 = 64e6;
/// The height of a small letter, in ems.
const EX: f64 = 0.547;

/// The chart as PNG.
pub(crate) fn png(svg: &str) -> anyhow::Result<Vec<u8>> {
    let mut tags = Tags(svg);
    let (head, _) = tags.find(|(tag, _)| tag.name == "svg").context("no SVG to draw")?;
    let view: Vec<f64> =
        head.text("viewBox").split_whitespace().filter_map(|part| part.parse().ok()).collect();
    let [_, _, wide, _] = view[..] else { anyhow::bail!("an SVG without a viewBox") };
    let (width, height) = (head.number("width") * SCALE, head.number("height") * SCALE);
    anyhow::ensure!(
        width >= 1.0 && height >= 1.0 && width * height <= MOST && wide > 0.0,
        "a picture of {width} x {height} pixels"
    );
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 64 million")]
    let mut canvas = Canvas::new(width.round() as usize, height.round() as usize, width / wide);
    for (tag, text) in tags {
        canvas.draw(&tag, text);
    }
    canvas.encode()
}

/// A tag with its attributes.
struct Tag<'a> {
    name: &'a str,
    attributes: &'a str,
}

impl<'a> Tag<'a> {
    fn text(&self, name: &str) -> &'a str {
        let mut rest = self.attributes;
        while let Some((before, after)) = rest.split_once("=\"") {
            let Some((value, next)) = after.split_once('"') else { return "" };
            if before.trim() == name {
                return value;
            }
            rest = next;
        }
        ""
    }
    fn number(&self, name: &str) -> f64 {
        self.text(name).parse().unwrap_or(0.0)
    }
    fn points(&self) -> Vec<Point> {
        let pairs = self.text("points").split_whitespace().filter_map(|pair| {
            let (x, y) = pair.split_once(',')?;
            Some((x.parse().ok()?, y.parse().ok()?))
        });
        pairs.collect()
    }
    /// The ink of an attribute, and how much of it there is.
    fn ink(&self, name: &str) -> Option<([u8; 3], f64)> {
        let hex = self.text(name).strip_prefix('#').filter(|hex| hex.len() == 6 && hex.is_ascii())?;
        let part = |at: usize| u8::from_str_radix(&hex[at..at + 2], 16).ok();
        let opacity = self.text("opacity").parse().unwrap_or(1.0);
        Some(([part(0)?, part(2)?, part(4)?], opacity))
    }
}

/// The tags of a text, each with what stands behind it.
struct Tags<'a>(&'a str);

impl<'a> Iterator for Tags<'a> {
    type Item = (Tag<'a>, &'a str);
    fn next(&mut self) -> Option<Self::Item> {
        let (_, rest) = self.0.split_once('<')?;
        let (inside, after) = rest.split_once('>')?;
        self.0 = after;
        let inside = inside.trim_end_matches('/');
        let (name, attributes) = inside.split_once(char::is_whitespace).unwrap_or((inside, ""));
        let text = after.split_once('<').map_or(after, |(text, _)| text);
        Some((Tag { name, attributes }, text.trim_matches('\n')))
    }
}

/// A picture.
struct Canvas {
    width: usize,
    height: usize,
    /// Pixels for a unit of the drawing.
    scale: f64,
    pixels: Vec<u8>,
}

impl Canvas {
    fn new(width: usize, height: usize, scale: f64) -> Self {
        Self { width, height, scale, pixels: vec![255; width * height * 3] }
    }

    fn draw(&mut self, tag: &Tag<'_>, text: &str) {
        match tag.name {
            "rect" => {
                let [x, y, w, h] = ["x", "y", "width", "height"].map(|name| tag.number(name));
                self.shape(tag, &[(x, y), (x + w, y), (x + w, y + h), (x, y + h)], true);
            }
            "circle" => {
                let [x, y, r] = ["cx", "cy", "r"].map(|name| tag.number(name));
                self.shape(tag, &mask::circle((x, y), r, r * self.scale), true);
            }
            "line" => {
                let [x1, y1, x2, y2] = ["x1", "y1", "x2", "y2"].map(|name| tag.number(name));
                self.shape(tag, &[(x1, y1), (x2, y2)], false);
            }
            "polyline" => self.shape(tag, &tag.points(), false),
            "polygon" => self.shape(tag, &tag.points(), true),
            "text" => self.text(tag, text),
            _ => {}
        }
    }

    /// Fills a shape, and draws its outline.
    fn shape(&mut self, tag: &Tag<'_>, points: &[Point], is_closed: bool) {
        let points: Vec<Point> = points.iter().map(|(x, y)| (x * self.scale, y * self.scale)).collect();
        if let Some(ink) = tag.ink("fill") {
            self.paint(Mask::of(std::slice::from_ref(&points), self.width, self.height), ink);
        }
        if let Some(ink) = tag.ink("stroke") {
            // Where SVG says nothing a line is one unit wide.
            let width = tag.text("stroke-width").parse().unwrap_or(1.0) * self.scale;
            self.paint(Mask::of(&mask::stroke(&points, width, is_closed), self.width, self.height), ink);
        }
    }

    fn text(&mut self, tag: &Tag<'_>, text: &str) {
        let Some(ink) = tag.ink("fill") else { return };
        let size = tag.number("font-size") * self.scale;
        let down = |length: &str| {
            let number = |text: Option<&str>| text.and_then(|text| text.parse::<f64>().ok());
            number(length.strip_suffix("ex")).map(|ex| ex * EX).or_else(|| number(length.strip_suffix("em")))
        };
        let (width, outlines) = letters::outlines(&unescaped(text), size);
        let shift = match tag.text("text-anchor") {
            "middle" => -width / 2.0,
            "end" => -width,
            _ => 0.0,
        };
        let below = down(tag.text("dy")).unwrap_or(0.0) * size;
        let (x, y) = (tag.number("x") * self.scale, tag.number("y") * self.scale);
        // A text is turned around its own place, if at all.
        let angle =
            tag.text("transform").strip_prefix("rotate(").and_then(|text| text.split([',', ' ']).next());
        let (sin, cos) = angle
            .and_then(|angle| angle.parse().ok())
            .map_or((0.0, 1.0), |degrees: f64| degrees.to_radians().sin_cos());
        let place = |(px, py): &Point| {
            let (dx, dy) = (px + shift, py + below);
            (x + dx * cos - dy * sin, y + dx * sin + dy * cos)
        };
        let placed: Vec<Vec<Point>> =
            outlines.iter().map(|outline| outline.iter().map(place).collect()).collect();
        self.paint(Mask::of(&placed, self.width, self.height), ink);
    }

    fn paint(&mut self, mask: Mask, (ink, opacity): ([u8; 3], f64)) {
        mask.each(|x, y, covered| {
            let share = covered * opacity.clamp(0.0, 1.0);
            let at = (y * self.width + x) * 3;
            for (pixel, ink) in self.pixels[at..at + 3].iter_mut().zip(ink) {
                let mixed = f64::from(*pixel) + (f64::from(ink) - f64::from(*pixel)) * share;
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
                let rounded = mixed.round() as u8;
                *pixel = rounded;
            }
        });
    }

    fn encode(self) -> anyhow::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let mut encoder =
            png::Encoder::new(&mut bytes, u32::try_from(self.width)?, u32::try_from(self.height)?);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header().context("begin the PNG")?;
        writer.write_image_data(&self.pixels).context("write the PNG")?;
        writer.finish().context("end the PNG")?;
        Ok(bytes)
    }
}

fn unescaped(text: &str) -> String {
    [("&lt;", "<"), ("&gt;", ">"), ("&quot;", "\""), ("&apos;", "'"), ("&#39;", "'"), ("&amp;", "&")]
        .iter()
        .fold(text.to_owned(), |text, (name, letter)| text.replace(name, letter))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The picture of what stands in an SVG of 10 x 10 pixels, each of which is a pixel of the PNG.
    fn drawn(content: &str) -> (Vec<u8>, usize) {
        let svg = format!("<svg width=\"10\" height=\"10\" viewBox=\"0 0 20 20\">\n{content}</svg>\n");
        let bytes = png(&svg).expect("a picture");
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().expect("a PNG");
        let mut pixels = vec![0; reader.output_buffer_size().expect("a size")];
        let info = reader.next_frame(&mut pixels).expect("a frame");
        assert_eq!((info.width, info.height), (20, 20));
        (pixels, 20)
    }
    fn grey((pixels, width): &(Vec<u8>, usize), x: usize, y: usize) -> u8 {
        let at = (y * width + x) * 3;
        assert!(pixels[at] == pixels[at + 1] && pixels[at] == pixels[at + 2]);
        pixels[at]
    }

    #[test]
    fn shapes_cover_their_pixels_and_parts_of_those_at_their_edges() {
        let picture = drawn(
            "<rect x=\"2\" y=\"2\" width=\"4.5\" height=\"4\" opacity=\"1\" fill=\"#000000\" stroke=\"none\"/>\n\
             <line opacity=\"0.5\" stroke=\"#000000\" stroke-width=\"2\" x1=\"0\" y1=\"11\" x2=\"20\" y2=\"11\"/>\n\
             <polygon opacity=\"1\" fill=\"#000000\" points=\"10,0 20,0 20,6 \"/>",
        );
        for ((x, y), expected) in [
            ((0, 0), 255),
            ((2, 2), 0),
            ((5, 5), 0),
            ((6, 3), 128),
            ((7, 3), 255),
            ((3, 9), 255),
            ((3, 10), 128),
            ((3, 11), 128),
            ((3, 12), 255),
            ((19, 0), 0),
            ((10, 5), 255),
        ] {
            assert!(grey(&picture, x, y).abs_diff(expected) <= 1, "{x} {y}: {}", grey(&picture, x, y));
        }
    }

    #[test]
    fn a_line_that_crosses_itself_is_not_darker_there_and_a_corner_has_no_gap() {
        let picture = drawn(
            "<polyline fill=\"none\" opacity=\"0.5\" stroke=\"#000000\" stroke-width=\"4\" points=\"2,2 18,2 18,18 2,2\"/>",
        );
        let dark = grey(&picture, 10, 2);
        assert_eq!(dark, 128);
        for (x, y) in [(17, 2), (18, 1), (3, 3), (10, 10)] {
            assert!(grey(&picture, x, y).abs_diff(dark) <= 2, "{x} {y}: {}", grey(&picture, x, y));
        }
        // A ring is hollow.
        let ring = drawn(
            "<circle cx=\"10\" cy=\"10\" r=\"7\" fill=\"none\" stroke=\"#000000\" stroke-width=\"2\"/>",
        );
        assert_eq!((grey(&ring, 10, 10), grey(&ring, 10, 3)), (255, 0));
    }

    #[test]
    fn texts_are_drawn_where_they_belong() {
        let text = |anchor: &str, transform: &str| {
            let attributes = format!(
                "dy=\"0.5ex\" text-anchor=\"{anchor}\" font-size=\"12\" opacity=\"1\" fill=\"#000000\""
            );
            let picture =
                drawn(&format!("<text x=\"10\" y=\"10\" {attributes} {transform}>\n&lt;&amp;\n</text>"));
            let dark = |from: [usize; 2], to: [usize; 2]| -> u32 {
                let cells = (from[1]..to[1]).flat_map(|y| (from[0]..to[0]).map(move |x| (x, y)));
                cells.map(|(x, y)| u32::from(255 - grey(&picture, x, y))).sum()
            };
            [dark([0, 0], [10, 20]), dark([10, 0], [20, 20]), dark([0, 0], [20, 10]), dark([0, 10], [20, 20])]
        };
        let [left, right, ..] = text("start", "");
        assert!(right > 2000 && left == 0, "{left} {right}");
        let [left, right, ..] = text("end", "");
        assert!(left > 2000 && right < 200, "{left} {right}");
        let [.., above, below] = text("start", "transform=\"rotate(270, 10, 10)\"");
        assert!(above > 2000 && below == 0, "{above} {below}");
    }

    #[test]
    fn what_is_no_chart_is_refused_and_strange_tags_are_left_out() {
        assert!(png("").is_err() && png("<svg width=\"1\">").is_err());
        assert!(png("<svg width=\"1e6\" height=\"1e6\" viewBox=\"0 0 1 1\">").is_err());
        let picture = drawn(
            "<path d=\"M0 0\"/><polygon fill=\"#12\" points=\"1,a 2\"/><circle r=\"nan\" fill=\"#000000\"/>\
             <line stroke=\"#000000\" stroke-width=\"2\" x1=\"nan\" y1=\"inf\" x2=\"1e300\" y2=\"-1e300\"/>",
        );
        assert!(picture.0.iter().all(|pixel| *pixel == 255));
    }
}
