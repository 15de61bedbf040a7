//! `axle plan "x,y x,y …"`: asks Pathfinder, and with `--drive` Pathdriver.

use crate::chart;
use crate::cli::Plan as Args;
use crate::out::{data, note, table};
use crate::path;
use crate::settings::Settings;
use anyhow::Context as _;
use axle_mesh::Retry;
use axle_schema::{Drive, DriveAsk, Geometry, Plan, PlanAsk, Pose, key};
use std::time::Duration;

/// Planners have this long to answer.
const PATIENCE: Duration = Duration::from_secs(3);

pub(super) async fn plan(settings: &Settings, args: Args) -> anyhow::Result<()> {
    let mesh = settings.join("plan").await?;
    let robot = settings.robot.as_ref();
    let ask = PlanAsk { way: args.way.clone(), start: args.from };
    let plan = mesh.ask(&key::PLAN, robot, &ask, PATIENCE, Retry::Idempotent).await?;
    let drive = if args.drive {
        let ask = DriveAsk { legs: plan.legs.clone(), speeds: None, robot: None };
        Some(mesh.ask(&key::DRIVE, robot, &ask, PATIENCE, Retry::Idempotent).await?)
    } else {
        None
    };
    mesh.leave().await;
    if let Some(file) = &args.svg {
        let points: Vec<_> = args.way.points.iter().map(|point| (point.x.0, point.y.0)).collect();
        let svg = chart::path_chart(&[chart::PathSeries::planned(path::of_plan(&plan))], &points)?;
        std::fs::write(file, svg).with_context(|| format!("write {}", file.display()))?;
        note(&format!("drawn: {}", file.display()));
    }
    for remark in &plan.notes {
        note(remark);
    }
    if args.json {
        let mut line = serde_json::to_value(&plan)?;
        if let Some(drive) = &drive {
            line["drive"] = serde_json::to_value(drive)?;
        }
        return Ok(data(&line.to_string())?);
    }
    print_plan(&plan)?;
    drive.map_or(Ok(()), |drive| print_drive(&drive))
}

fn print_plan(plan: &Plan) -> anyhow::Result<()> {
    if plan.legs.is_empty() {
        note("nothing to drive: the robot is there already");
        return Ok(());
    }
    let mut pose = plan.start;
    let rows = plan.legs.iter().enumerate().map(|(index, leg)| {
        pose = leg.geometry.end_from(pose);
        let (what, how) = describe(&leg.geometry);
        vec![(index + 1).to_string(), what.into(), how, (leg.point + 1).to_string(), at(pose)]
    });
    table(&["leg", "geometry", "size", "to point", "ends at x, y, heading"], rows)?;
    data(&format!("length {:.3}", plan.length))?;
    Ok(())
}

fn describe(geometry: &Geometry) -> (&'static str, String) {
    match geometry {
        Geometry::Line { length } => ("line", format!("{length:.3}")),
        Geometry::Turn { angle } => ("turn", format!("{:.1}°", angle.0.to_degrees())),
        Geometry::Arc { radius, angle } => {
            ("arc", format!("{:.1}° at radius {radius:.3}", angle.0.to_degrees()))
        }
    }
}

fn at(pose: Pose) -> String {
    // Adding 0 makes a negative zero a plain one.
    let clean = |value: f64| (value * 1e3).round() / 1e3 + 0.0;
    format!(
        "{:.3}, {:.3} m, {:.1}°",
        clean(pose.x.0),
        clean(pose.y.0),
        clean(pose.heading.wrapped().0.to_degrees())
    )
}

fn print_drive(drive: &Drive) -> anyhow::Result<()> {
    let legs = drive
        .counts
        .iter()
        .enumerate()
        .flat_map(|(leg, &count)| std::iter::repeat_n(leg + 1, count as usize));
    let rows = drive.dwms.iter().zip(legs).enumerate().map(|(index, (dwm, leg))| {
        let (start, end) = (dwm.start(), dwm.end());
        vec![
            (index + 1).to_string(),
            leg.to_string(),
            format!("{:.3}, {:.3}", start.left.0, start.right.0),
            format!("{:.3}, {:.3}", end.left.0, end.right.0),
            format!("{:.3}", dwm.duration()),
        ]
    });
    table(&["movement", "leg", "from left, right m/s", "to left, right m/s", "duration"], rows)?;
    data(&format!("duration {:.3}", drive.duration))?;
    Ok(())
}
