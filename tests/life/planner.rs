//! Planning on maps with real processes: a map from a file, several clients, a second instance.

use crate::harness::{PATIENCE, Process, World, all_alive, r1, within};
use axle_maps::Grid;
use axle_mesh::{Mesh, Retry};
use axle_schema::task::Cancel;
use axle_schema::{
    Geometry, MapAsk, MapData, Metres, Plan, PlanAsk, PlanStrategy, Pose, Refusal, Seconds, TaskId, WayTask,
    key,
};
use nix::sys::signal::Signal;

/// Two rooms of 2 m with a wall between them that has a gap of half a metre, as PGM and map.yaml.
fn rooms(world: &World) -> String {
    let mut pgm = "P2\n41 21\n255\n".to_owned();
    for row in 0..21 {
        for column in 0..41 {
            let is_wall = column == 20 && !(8..13).contains(&row);
            pgm.push_str(if is_wall { "0 " } else { "254 " });
        }
    }
    world.file("rooms.pgm", &pgm);
    world.file("rooms.yaml", "image: rooms.pgm\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\n")
}

/// The map service with the rooms.
fn map_service(world: &World) -> Process {
    let params = world.file("map.toml", &format!("file = {:?}\n", rooms(world)));
    world.tool(&["run", "map", "--host", "lab", "--params", &params])
}

fn question(strategy: PlanStrategy) -> PlanAsk {
    PlanAsk {
        way: WayTask::parse("3.5,0.5").expect("a way"),
        start: Some(Pose::new(0.5, 0.5, 0.0)),
        strategy: Some(strategy),
        body: Some(Metres(0.2)),
        ..PlanAsk::default()
    }
}

async fn asked(mesh: &Mesh, ask: &PlanAsk) -> Result<Plan, Refusal> {
    mesh.ask(&key::PLAN, Some(&r1()), ask, PATIENCE, Retry::Idempotent).await
}

#[tokio::test(flavor = "multi_thread")]
async fn a_way_on_the_map_of_the_service_is_planned_for_whoever_asks() {
    let world = World::new().await;
    let (_router, _pathfinder) = (world.router(), world.run("pathfinder"));
    let mesh = world.join().await;
    all_alive(&mesh, &["pathfinder"]).await;
    // Without a map service, and with one.
    let alone = PlanAsk { deadline: Some(Seconds(0.5)), ..question(PlanStrategy::Map) };
    let refusal = asked(&mesh, &alone).await.expect_err("there is no map").to_string();
    assert!(refusal.contains("map is unavailable") && refusal.contains("axle run map"), "{refusal}");
    let _map = map_service(&world);
    all_alive(&mesh, &["map"]).await;
    let plan = asked(&mesh, &question(PlanStrategy::Map)).await.expect("a plan");
    assert!(
        plan.clearance.is_some() && plan.legs.iter().any(|leg| matches!(leg.geometry, Geometry::Arc { .. }))
    );
    // Many ask at once, for the same and for other ways: each has its own answer.
    let asking = (1..20).map(|number| {
        let mesh = mesh.clone();
        let mut ask = question(PlanStrategy::Map);
        ask.way = WayTask::parse(&format!("{:.1},0.5", 0.7 + 0.1 * f64::from(number % 5))).expect("a way");
        tokio::spawn(async move { (ask.way.points[0].x, asked(&mesh, &ask).await) })
    });
    for asking in asking.collect::<Vec<_>>() {
        let (x, plan) = within(PATIENCE, "an answer", asking).await.expect("no panic");
        let plan = plan.expect("a plan");
        let end = plan.legs.iter().fold(plan.start, |pose, leg| leg.geometry.end_from(pose));
        assert!((end.x.0 - x.0).abs() < 1e-9, "{plan:?} ends at {x}");
    }
    // Whoever has the map already is not sent it again.
    let get = async |have| {
        let ask = MapAsk { have };
        mesh.ask(&key::MAP, Some(&r1()), &ask, PATIENCE, Retry::Idempotent).await.expect("the map")
    };
    let whole = get(None).await;
    assert!(!whole.runs.is_empty() && get(Some(whole.content)).await.runs.is_empty());
    // People see the same.
    let way = ["plan", "3.5,0.5", "--from", "0.5,0.5", "--body", "0.2"];
    let told = world.done(&[&way[..], &["--strategy", "map", "--json"]].concat()).await;
    assert_eq!(told.is(0, &[]).json()["legs"].as_array().map(Vec::len), Some(plan.legs.len()));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_second_pathfinder_takes_over() {
    let world = World::new().await;
    let (_router, mut first, _second) = (world.router(), world.run("pathfinder"), world.run("pathfinder"));
    let mesh = world.join().await;
    let both = async {
        loop {
            let alive = mesh.everybody(PATIENCE).await.expect("an answer");
            if alive.iter().filter(|(presence, _)| presence.service == "pathfinder").count() == 2 {
                return;
            }
        }
    };
    within(PATIENCE, "both are alive", both).await;
    asked(&mesh, &question(PlanStrategy::Rounded)).await.expect("a plan");
    first.tell(Signal::SIGKILL);
    first.ended().await;
    asked(&mesh, &question(PlanStrategy::Arcs)).await.expect("the other one answers");
}

/// A hall whose walls make the way through it as long as the map has cells: a search of some seconds at least.
fn serpentine() -> MapData {
    let side = 1000_usize;
    let is_wall =
        |column: usize, row: usize| row % 2 == 1 && column != if row % 4 == 1 { 0 } else { side - 1 };
    let cells =
        (0..side).flat_map(|row| (0..side).map(move |column| if is_wall(column, row) { 100 } else { 0 }));
    let grid = Grid::new("serpentine", Metres(1.0), Pose::default(), side, cells.collect()).expect("a map");
    grid.to_data().expect("a message")
}

#[tokio::test(flavor = "multi_thread")]
async fn a_long_search_says_how_far_it_is_keeps_its_deadline_and_is_cancelled() {
    let world = World::new().await;
    let (_router, _pathfinder) = (world.router(), world.run("pathfinder"));
    let mesh = world.join().await;
    all_alive(&mesh, &["pathfinder"]).await;
    let words = mesh.inbox(&key::PLAN_PROGRESS.of_every_robot(), 64).expect("progress");
    let long = |id: u64, deadline: f64| PlanAsk {
        // To its end and back, so often that no machine is through before it is told to stop.
        way: WayTask::parse(&"0.5,998.5 0.5,0.5 ".repeat(50)).expect("a way"),
        start: Some(Pose::new(0.5, 0.5, 0.0)),
        strategy: Some(PlanStrategy::Map),
        map: Some(serpentine()),
        body: Some(Metres(0.1)),
        deadline: Some(Seconds(deadline)),
        id: Some(TaskId(id)),
        ..PlanAsk::default()
    };
    let ask =
        async |ask: PlanAsk| mesh.ask(&key::PLAN, Some(&r1()), &ask, 12 * PATIENCE, Retry::Idempotent).await;
    let cancelling = async {
        let progress = async {
            loop {
                let heard = words.next().await.message;
                if heard.id == TaskId(1) {
                    return heard;
                }
            }
        };
        let heard = within(12 * PATIENCE, "it says how far it is", progress).await;
        assert!((0.0..=1.0).contains(&heard.fraction) && heard.elapsed > Seconds::ZERO, "{heard:?}");
        mesh.put_once(&key::PLAN_CANCEL.of(&r1()), &Cancel { id: TaskId(1) }).expect("a cancellation");
    };
    let (answer, ()) = tokio::join!(ask(long(1, 60.0)), cancelling);
    let refusal = answer.expect_err("it is cancelled").to_string();
    assert!(refusal.contains("the search was cancelled"), "{refusal}");
    // The deadline falls into the search, or into the preparation of the map, if that was what was cancelled.
    let refusal = ask(long(2, 0.3)).await.expect_err("it takes longer").to_string();
    assert!(refusal.contains("pathfinder") && refusal.contains("0.3 s"), "{refusal}");
    // And nobody else has waited for it.
    asked(&mesh, &question(PlanStrategy::Rounded)).await.expect("a plan");
}

#[tokio::test(flavor = "multi_thread")]
async fn maps_are_shown_checked_and_inflated_from_files() {
    let world = World::new().await;
    let yaml = rooms(&world);
    let shown = world.axle(&["map", "show", &yaml]).ended().await;
    let text = &shown.is(0, &[]).out;
    assert!(text.contains("....#....") && text.contains("41 x 21 cells"), "{text}");
    let checked = world.axle(&["map", "check", &yaml, "--body", "0.28"]).ended().await;
    assert!(checked.is(0, &[]).out.contains("in 2 parts that are not joined"), "{}", checked.out);
    let joined = world.axle(&["map", "check", &yaml, "--body", "0.2"]).ended().await;
    assert!(joined.is(0, &[]).out.contains("in 1 parts"), "{}", joined.out);
    let out = world.path().join("fat.yaml").display().to_string();
    world.axle(&["map", "inflate", &yaml, "--body", "0.2", "--out", &out]).ended().await.is(0, &["fat.png"]);
    let fat = world.axle(&["map", "show", &out, "--json"]).ended().await.is(0, &[]).json();
    let thin = world.axle(&["map", "show", &yaml, "--json"]).ended().await.is(0, &[]).json();
    assert!(fat["occupied"].as_u64() > thin["occupied"].as_u64(), "{fat} and {thin}");
    // Here, without a mesh; and refused with the reason.
    let here = ["plan", "3.5,0.5", "--from", "0.5,0.5", "--strategy", "map", "--map", &yaml, "--here"];
    let planned = world.axle(&[&here[..], &["--svg", "way.svg", "--body", "0.2"]].concat()).ended().await;
    assert!(planned.is(0, &["drawn"]).out.contains("clearance 0.0"), "{}", planned.out);
    let narrow = world.axle(&[&here[..], &["--body", "0.28"]].concat()).ended().await;
    narrow.is(1, &["too narrow by 3.0 cm at (2.05, 1.05) m"]);
    for (name, text, words) in [
        ("no.yaml", "image: no.png\nresolution: 0.1\norigin: [0, 0, 0]\n", "cannot read"),
        ("bad.yaml", "image: bad.yaml\nresolution: 0.1\norigin: [0, 0, 0]\n", "neither PNG nor PGM"),
        (
            "huge.yaml",
            "image: huge.pgm\nresolution: 0.1\norigin: [0, 0, 0]\n",
            "map of 20000 x 20000 cells is too large",
        ),
    ] {
        world.file("huge.pgm", "P5 20000 20000 255\n");
        let file = world.file(name, text);
        world.axle(&["map", "check", &file]).ended().await.is(2, &[words]);
    }
}
