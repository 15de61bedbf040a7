//! Which share of each pixel some outlines cover.
//!
//! Every edge of an outline adds to the pixels of its rows how much of them lies to its right, with the sign of its
//! direction; summed up along a row that is the share that is covered. Shapes of one direction that overlap cover a pixel
//! once.

/// In pixels, y downwards.
pub(super) type Point = (f64, f64);

/// The shares of a part of the picture.
pub(super) struct Mask {
    x: usize,
    y: usize,
    width: usize,
    height: usize,
    /// A row is two longer than the part, for what lies to the right of its last pixel.
    sums: Vec<f64>,
    /// The first and the last column of each row that an edge touches.
    spans: Vec<(usize, usize)>,
}

/// Beyond so many pixels nothing is drawn: numbers without end are nobody's chart.
const FAR: f64 = 1e6;

impl Mask {
    /// Of closed outlines, on a picture of this size.
    pub(super) fn of(outlines: &[Vec<Point>], width: usize, height: usize) -> Self {
        let none = Self { x: 0, y: 0, width: 0, height: 0, sums: Vec::new(), spans: Vec::new() };
        let all = || outlines.iter().flatten();
        if !all().all(|(x, y)| x.abs() < FAR && y.abs() < FAR) {
            return none;
        }
        let [left, top] =
            [all().map(|p| p.0).fold(f64::MAX, f64::min), all().map(|p| p.1).fold(f64::MAX, f64::min)];
        let [right, low] =
            [all().map(|p| p.0).fold(f64::MIN, f64::max), all().map(|p| p.1).fold(f64::MIN, f64::max)];
        let cell = |value: f64, most: usize| {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
            let cell = value.max(0.0) as usize;
            cell.min(most)
        };
        let (x, y) = (cell(left.floor(), width), cell(top.floor(), height));
        let (end, bottom) = (cell(right.ceil(), width), cell(low.ceil(), height));
        if x >= end || y >= bottom {
            return none;
        }
        let (width, height) = (end - x, bottom - y);
        let (sums, spans) = (vec![0.0; (width + 2) * height], vec![(usize::MAX, 0); height]);
        let mut mask = Self { x, y, width, height, sums, spans };
        for outline in outlines {
            let next = outline.iter().skip(1).chain(outline.first());
            for (from, to) in outline.iter().zip(next) {
                mask.edge(*from, *to);
            }
        }
        mask
    }

    #[allow(clippy::cast_precision_loss, reason = "pixels of a picture")]
    fn edge(&mut self, from: Point, to: Point) {
        let shift = |(x, y): Point| (x - self.x as f64, y - self.y as f64);
        let (from, to) = (shift(from), shift(to));
        let (sign, (x0, y0), (x1, y1)) = if from.1 < to.1 { (1.0, from, to) } else { (-1.0, to, from) };
        let (top, low) = (y0.max(0.0), y1.min(self.height as f64));
        if top >= low {
            return;
        }
        let slope = (x1 - x0) / (y1 - y0);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to the height")]
        let (first, last) = (top as usize, low.ceil() as usize);
        for row in first..last {
            let (a, b) = (top.max(row as f64), low.min((row + 1) as f64));
            let (at_a, at_b) = (x0 + (a - y0) * slope, x0 + (b - y0) * slope);
            self.part(row, sign * (b - a), at_a.min(at_b), at_a.max(at_b));
        }
    }

    /// A part of an edge in one row, from `low` to `high`; `tall` is its height with its sign.
    #[allow(clippy::cast_precision_loss, reason = "pixels of a picture")]
    fn part(&mut self, row: usize, tall: f64, low: f64, high: f64) {
        let most = self.width as f64;
        let (low, high) = (low.clamp(0.0, most), high.clamp(0.0, most));
        // How much of the part lies to the left of u, summed up over all places left of u.
        let sum = |u: f64| {
            if u <= low {
                0.0
            } else if u >= high {
                u - f64::midpoint(low, high)
            } else {
                (u - low) * (u - low) / (2.0 * (high - low))
            }
        };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to the width")]
        let (first, last) = (low as usize, (high.ceil() as usize).min(self.width));
        let (left, right) = self.spans[row];
        self.spans[row] = (left.min(first), right.max(last));
        let mut before = 0.0;
        for column in first..=last {
            let share = sum((column + 1) as f64) - sum(column as f64);
            self.sums[row * (self.width + 2) + column] += tall * (share - before);
            before = share;
        }
    }

    /// Hands over each pixel that is covered, with its share.
    pub(super) fn each(&self, mut take: impl FnMut(usize, usize, f64)) {
        for row in 0..self.height {
            let (mut sum, (first, last)) = (0.0, self.spans[row]);
            for column in first..(last + 1).min(self.width) {
                sum += self.sums[row * (self.width + 2) + column];
                let share = sum.abs().min(1.0);
                if share > 1.0 / 512.0 {
                    take(self.x + column, self.y + row, share);
                }
            }
        }
    }
}

/// A line of a width along some points, as shapes of one direction: one for each part, and one for each corner.
pub(super) fn stroke(points: &[Point], width: f64, is_closed: bool) -> Vec<Vec<Point>> {
    let half = width / 2.0;
    let next = points.iter().skip(1).chain(points.first().filter(|_| is_closed));
    let mut shapes: Vec<Vec<Point>> = points
        .iter()
        .zip(next)
        .filter_map(|(a, b)| {
            let (dx, dy) = (b.0 - a.0, b.1 - a.1);
            let length = dx.hypot(dy);
            let (nx, ny) = (-dy / length * half, dx / length * half);
            (length > 0.0).then(|| {
                vec![(a.0 + nx, a.1 + ny), (b.0 + nx, b.1 + ny), (b.0 - nx, b.1 - ny), (a.0 - nx, a.1 - ny)]
            })
        })
        .collect();
    // A thin line has no corners to be seen.
    if width > 1.5 {
        let inner =
            if is_closed { points } else { points.get(1..points.len().saturating_sub(1)).unwrap_or(&[]) };
        shapes.extend(inner.iter().map(|corner| circle(*corner, half, half)));
    }
    shapes
}

/// A circle, with so many corners that at a radius of `seen` pixels nobody sees them; it turns as strokes do.
pub(super) fn circle((x, y): Point, radius: f64, seen: f64) -> Vec<Point> {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "8 to 96")]
    let corners = (4.0 + 6.0 * seen.abs().sqrt()).clamp(8.0, 96.0) as u32;
    (0..corners)
        .map(|corner| {
            let (sin, cos) = (-core::f64::consts::TAU * f64::from(corner) / f64::from(corners)).sin_cos();
            (x + radius * cos, y + radius * sin)
        })
        .collect()
}
