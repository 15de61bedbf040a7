//! What was found, as a table, as JSON, and as files.

use crate::chart::{Scatter, scatter_chart};
use crate::out::{data, note, table};
use anyhow::Context as _;
use axle_calibrator::{Quantity, Report};
use axle_schema::{Calibration, RobotId};
use std::path::Path;

/// Writes the calibration, the one before beside it, the report as JSON, and a picture of what is left of the
/// measurements.
pub(super) fn write(
    directory: &Path,
    robot: &RobotId,
    calibration: &Calibration,
    report: &Report,
) -> anyhow::Result<()> {
    std::fs::create_dir_all(directory).with_context(|| format!("make {}", directory.display()))?;
    let file = |name: String| directory.join(name);
    let save = |path: &Path, text: &str| {
        std::fs::write(path, text).with_context(|| format!("write {}", path.display()))
    };
    let newest = file(format!("{robot}.calibration.toml"));
    if let Ok(Some(before)) = crate::run::tuning::read(&newest) {
        let older = file(format!("{robot}.calibration.{}.toml", before.version));
        std::fs::rename(&newest, &older).with_context(|| format!("keep {}", older.display()))?;
    }
    let text = toml::to_string(calibration).context("write the calibration as TOML")?;
    save(&newest, &text)?;
    save(&file(format!("{robot}.report.json")), &json(calibration, report, None).to_string())?;
    let plots: Vec<Scatter<'_>> = report
        .plots
        .iter()
        .map(|plot| Scatter { along: plot.along, axis: plot.axis, series: &plot.series })
        .collect();
    let titles: Vec<&str> = report.plots.iter().map(|plot| plot.title).collect();
    save(&file(format!("{robot}.residuals.svg")), &scatter_chart(&titles.join("; "), &plots)?)
}

fn json(calibration: &Calibration, report: &Report, applied: Option<bool>) -> serde_json::Value {
    let quantities: Vec<serde_json::Value> = report
        .quantities
        .iter()
        .map(|Quantity { name, unit, estimate, passes }| {
            serde_json::json!({
                "name": name, "unit": unit, "value": estimate.value, "low": estimate.low,
                "high": estimate.high, "repeatability": estimate.repeatability, "passes": passes,
            })
        })
        .collect();
    let squares: Vec<serde_json::Value> = report
        .squares
        .iter()
        .map(|square| serde_json::json!({ "left": square.left, "before": square.before, "after": square.after }))
        .collect();
    let worst = report.worst_square();
    serde_json::json!({
        "calibration": calibration, "quantities": quantities, "squares": squares, "findings": report.findings,
        "square_before_m": worst.map(|worst| worst.0), "square_after_m": worst.map(|worst| worst.1),
        "duration_s": report.duration, "applied": applied,
    })
}

/// Prints it.
pub(super) fn print(
    calibration: &Calibration,
    report: &Report,
    as_json: bool,
    applied: bool,
) -> anyhow::Result<()> {
    for finding in &report.findings {
        note(&format!("found: {finding}"));
    }
    if as_json {
        return Ok(data(&json(calibration, report, Some(applied)).to_string())?);
    }
    let rows = report.quantities.iter().map(|Quantity { name, unit, estimate, .. }| {
        let half = (estimate.high - estimate.low) / 2.0;
        vec![
            name.clone(),
            format!("{:.5}", estimate.value),
            format!("± {half:.5}"),
            (*unit).to_owned(),
            format!("{:.5}", estimate.repeatability),
        ]
    });
    table(&["measured", "value", "95 %", "unit", "from pass to pass"], rows)?;
    if let Some((before, after)) = report.worst_square() {
        data(&format!(
            "odometry misses the end of a square by {:.1} mm, calibrated by {:.1} mm",
            before * 1000.0,
            after * 1000.0
        ))?;
    }
    let how = if applied { "applied and kept by the robot" } else { "not applied" };
    Ok(data(&format!("calibration {} is {how}; it took {:.0} s", calibration.version, report.duration))?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_calibrator::Plot;

    #[test]
    fn the_calibration_before_stays_beside_the_new_one() {
        let directory = std::env::temp_dir().join(format!("axle-calibration-{}", std::process::id()));
        let robot = RobotId::new("r1").expect("a robot");
        let series = vec![("left", vec![(0.1, 0.2)])];
        let plots = vec![Plot { title: "Signals", along: "speed", axis: "signal", series }];
        let report = Report { plots, ..Report::default() };
        for version in 1..=3 {
            let calibration = Calibration { version, ..Calibration::default() };
            write(&directory, &robot, &calibration, &report).expect("written");
        }
        let read = |name: &str| crate::run::tuning::read(&directory.join(name)).expect("read");
        let version = |name| read(name).map(|calibration| calibration.version);
        assert_eq!(version("r1.calibration.toml"), Some(3));
        assert_eq!(version("r1.calibration.2.toml"), Some(2));
        assert_eq!(version("r1.calibration.1.toml"), Some(1));
        assert_eq!(version("r1.calibration.3.toml"), None);
        let svg = std::fs::read_to_string(directory.join("r1.residuals.svg")).expect("a picture");
        assert!(svg.contains("<circle"));
        std::fs::remove_dir_all(&directory).expect("the directory");
    }
}
