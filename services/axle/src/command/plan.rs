//! `axle plan "x,y x,y …"`: asks Pathfinder, and with `--drive` Pathdriver.

use super::go::Bar;
use crate::chart::{self, WheelPoint};
use crate::cli::Plan as Args;
use crate::out::{data, note, table, usage};
use crate::params::load;
use crate::path;
use crate::run::map::read as read_map;
use crate::settings::Settings;
use anyhow::Context as _;
use axle_maps::Grid;
use axle_mesh::{Clock, Mesh, Retry, random_bits};
use axle_pathdriver::{Pathdriver, PathdriverParams};
use axle_pathfinder::{PathfinderParams, Terrain};
use axle_schema::contract::Functional as _;
use axle_schema::task::Cancel;
use axle_schema::{
    Drive, DriveAsk, Geometry, Manner, Message as _, Metres, MetresPerSecond, Plan, PlanAsk, PlanProgress,
    Pose, Refusal, RobotId, Seconds, TaskId, key,
};
use std::path::Path;
use std::time::Duration;

/// Planners have this long to answer.
const PATIENCE: Duration = Duration::from_secs(3);

pub(super) async fn plan(settings: &Settings, args: Args) -> anyhow::Result<()> {
    let grid = args.map.as_deref().map(read_map).transpose()?;
    let ask = PlanAsk {
        way: args.way.clone(),
        start: args.from,
        strategy: args.strategy,
        reorder: args.order,
        map: grid.as_ref().map(Grid::to_data).transpose()?,
        body: args.body.map(Metres),
        deadline: args.deadline.map(Seconds),
        ..PlanAsk::default()
    };
    ask.check().map_err(usage)?;
    let jump = args.jump.map(MetresPerSecond);
    let manner = Manner { strategy: args.speeds, joints: args.joints, jump, offset: None };
    let manner = args.drive.then_some(manner);
    let (plan, drive) = if args.here {
        here(args.params.as_deref(), &ask, manner)?
    } else {
        asked(settings, &ask, manner).await?
    };
    if let Some(file) = &args.svg {
        let points: Vec<_> = args.way.points.iter().map(|point| (point.x.0, point.y.0)).collect();
        let walls = grid.as_ref().map_or_else(Vec::new, |grid| axle_maps::areas(grid, chart::MAX_WALLS));
        let path = chart::PathSeries::planned(path::of_plan(&plan));
        let svg = if !walls.is_empty() {
            // On a map the path must be seen before what stands around it.
            let title = format!("{}: {:.2}", ask.strategy.unwrap_or_default(), plan.length);
            chart::map_chart(&title, &[chart::PathSeries { ink: 1, ..path }], &points, &walls)?
        } else if let Some(drive) = &drive {
            let speeds = chart::Panel::of_runs("wheel speed (m/s)", &[&profile(drive)]);
            chart::chart("The path, and the speeds of the wheels", &[path], &points, &[speeds])?
        } else {
            chart::path_chart(&[path], &points)?
        };
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

/// Asks the planners of the mesh.
async fn asked(
    settings: &Settings,
    ask: &PlanAsk,
    manner: Option<Manner>,
) -> anyhow::Result<(Plan, Option<Drive>)> {
    let mesh = settings.join("plan").await?;
    let robot = settings.robot.as_ref();
    // Pathfinder keeps its deadline; its answer still has to come.
    let patience = PATIENCE + Duration::from_secs_f64(ask.deadline.map_or(0.0, |deadline| deadline.0));
    let plan = search(&mesh, robot, ask, patience).await?;
    let drive = if manner.is_some() {
        let ask = DriveAsk { legs: plan.legs.clone(), manner, ..DriveAsk::default() };
        Some(mesh.ask(&key::DRIVE, robot, &ask, PATIENCE, Retry::Idempotent).await?)
    } else {
        None
    };
    mesh.leave().await;
    Ok((plan, drive))
}

/// Asks Pathfinder, shows how far a long search is, and has it ended when the user wants no more of it.
async fn search(
    mesh: &Mesh,
    robot: Option<&RobotId>,
    ask: &PlanAsk,
    patience: Duration,
) -> anyhow::Result<Plan> {
    let id = TaskId::from_random(random_bits());
    let ask = PlanAsk { id: Some(id), ..ask.clone() };
    let mut stop = crate::signal::stop()?;
    let words = mesh.inbox(&key::PLAN_PROGRESS.of_every_robot(), 16)?;
    let cancel = robot.map_or_else(|| key::PLAN_CANCEL.of_all_robots(), |robot| key::PLAN_CANCEL.of(robot));
    let bar = Bar::new();
    let mut question = std::pin::pin!(mesh.ask(&key::PLAN, robot, &ask, patience, Retry::Idempotent));
    let mut is_cancelled = false;
    let answer = loop {
        tokio::select! {
            answer = &mut question => break answer,
            heard = words.next() => {
                let PlanProgress { id: whose, fraction, elapsed } = heard.message;
                if whose == id {
                    bar.set(fraction, format!("searching, {elapsed:.1}"));
                }
            }
            () = stop.wait(), if !is_cancelled => {
                is_cancelled = true;
                note("cancelling …");
                mesh.put_once(&cancel, &Cancel { id })?;
            }
        }
    };
    bar.clear();
    Ok(answer?)
}

/// Plans in this process.
fn here(
    params: Option<&Path>,
    ask: &PlanAsk,
    manner: Option<Manner>,
) -> anyhow::Result<(Plan, Option<Drive>)> {
    let params: PathfinderParams = load(params)?;
    let clock = Clock::start();
    let deadline = ask.deadline.unwrap_or(params.deadline);
    let mut watch = |_: f64| {
        if clock.now() <= deadline {
            return Ok(());
        }
        Err(Refusal::TimedOut { what: "pathfinder".into(), seconds: deadline.0 })
    };
    let unknown = params.unknown();
    let terrain = ask.map.as_ref().map(|map| Terrain::watched(map, unknown, &mut watch)).transpose()?;
    let plan = axle_pathfinder::plan(&params, ask, terrain.as_ref(), &mut watch)?;
    let ask = DriveAsk { legs: plan.legs.clone(), robot: ask.robot, manner, ..DriveAsk::default() };
    let drive = manner.map(|_| Pathdriver::answer(&PathdriverParams::default(), &ask)).transpose()?;
    Ok((plan, drive))
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
    let mut facts = vec![format!("length {:.3}", plan.length)];
    facts.extend(plan.time.map(|time| format!("time about {time:.1}")));
    facts.extend(plan.clearance.map(|clearance| format!("clearance {clearance:.3}")));
    if !plan.order.is_empty() {
        let order: Vec<String> = plan.order.iter().map(|point| (point + 1).to_string()).collect();
        facts.push(format!("order {}", order.join(" ")));
    }
    data(&facts.join(", "))?;
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

/// The speeds of the wheels over time: both ends of every movement.
fn profile(drive: &Drive) -> Vec<WheelPoint> {
    let mut time = 0.0;
    let mut points = Vec::with_capacity(2 * drive.dwms.len());
    for dwm in &drive.dwms {
        for (speeds, after) in [(dwm.start(), 0.0), (dwm.end(), dwm.duration().0)] {
            time += after;
            points.push(WheelPoint { time, left: speeds.left.0, right: speeds.right.0 });
        }
    }
    points
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
    if drive.jump > MetresPerSecond::ZERO {
        data(&format!("jump {:.3}", drive.jump))?;
    }
    if let Some(offset) = drive.offset {
        data(&format!("offset {:.4}", offset))?;
    }
    Ok(())
}
