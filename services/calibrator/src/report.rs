//! What a calibration found, for people and programs.

use crate::statistics::Estimate;

/// One number with its interval.
#[derive(Clone, Debug, PartialEq)]
pub struct Quantity {
    /// What it is: `left forward kv`.
    pub name: String,
    /// Its unit.
    pub unit: &'static str,
    /// The number.
    pub estimate: Estimate,
    /// What each pass says, for repeatability; of a dead band there may be fewer than of other numbers.
    pub passes: Vec<f64>,
}

/// How far odometry misses the end of the squares, by the turns that the gyroscope felt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Square {
    /// Whether it was driven to the left.
    pub left: bool,
    /// With the robot as described: forward and to the left, m.
    pub before: (f64, f64),
    /// With the calibration.
    pub after: (f64, f64),
}

/// What is left of one kind of measurement when the model is taken off.
#[derive(Clone, Debug, PartialEq)]
pub struct Plot {
    /// What it shows.
    pub title: &'static str,
    /// Its horizontal axis.
    pub along: &'static str,
    /// Its vertical axis.
    pub axis: &'static str,
    /// A name, and points.
    pub series: Vec<(&'static str, Vec<(f64, f64)>)>,
}

/// Everything that was found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// The numbers, in the order in which they were measured.
    pub quantities: Vec<Quantity>,
    /// The squares, one of each direction in a pass.
    pub squares: Vec<Square>,
    /// Residuals.
    pub plots: Vec<Plot>,
    /// Words: what was wired wrongly, what had to be assumed, what could not be measured.
    pub findings: Vec<String>,
    /// How long it took by the robot's clock, s.
    pub duration: f64,
}

impl Report {
    /// The number of that name.
    #[must_use]
    pub fn find(&self, name: &str) -> Option<&Quantity> {
        self.quantities.iter().find(|quantity| quantity.name == name)
    }

    /// The largest distance from the start at which the squares of one direction end on average (the benchmark's
    /// `E_max,syst`), before and after, m.
    #[must_use]
    pub fn worst_square(&self) -> Option<(f64, f64)> {
        let centre = |left: bool, of: fn(&Square) -> (f64, f64)| {
            let ends: Vec<(f64, f64)> =
                self.squares.iter().filter(|square| square.left == left).map(of).collect();
            let count = crate::motor::float(ends.len());
            let sum = ends.iter().fold((0.0, 0.0), |sum, end| (sum.0 + end.0, sum.1 + end.1));
            (!ends.is_empty()).then(|| (sum.0 / count).hypot(sum.1 / count))
        };
        let worst = |of| Some(centre(true, of)?.max(centre(false, of)?));
        Some((worst(|square| square.before)?, worst(|square| square.after)?))
    }
}
