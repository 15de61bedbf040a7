//! `axle doctor --self`: what the healthcheck of a container finds.

use crate::harness::{PATIENCE, World, all_alive, within};

#[tokio::test(flavor = "multi_thread")]
async fn a_doctor_finds_healthy_what_answers_and_says_why_something_is_not() {
    let world = World::new().await;
    let doctor = async |service: &str| world.done(&["doctor", "--self", service, "--host", "lab"]).await;
    doctor("pathfinder").await.is(1, &["no router answers"]);
    let _router = world.router();
    let mesh = world.join().await;
    let (_pathfinder, pilot) = (world.run("pathfinder"), world.run("pilot"));
    all_alive(&mesh, &["pathfinder", "pilot"]).await;
    // A process that has just begun has not had a beat yet.
    let beats = async {
        loop {
            let everybody = mesh.everybody(PATIENCE).await.expect("an answer");
            let mut known = everybody.into_iter().filter_map(|(_, status)| status);
            if known.any(|status| status.service == "pilot" && status.beats > 0) {
                return;
            }
        }
    };
    within(PATIENCE, "the pilot has a beat", beats).await;
    for (service, words) in
        [("router", "between two sessions"), ("pathfinder", "of its trade"), ("pilot", "its beat goes on")]
    {
        let ended = doctor(service).await;
        let said = &ended.is(0, &[]).out;
        assert!(said.contains(&format!("{service} is healthy")) && said.contains(words), "{said}");
    }
    doctor("navigator").await.is(1, &["no navigator for r1 on lab is on the mesh"]);
    doctor("parrot").await.is(2, &["unknown service", "pathfinder"]);
    // Its token goes a second later, and with it the knowledge that it is there at all.
    pilot.freeze().await;
    doctor("pilot").await.is(1, &["pilot for r1 on lab", "hangs"]);
}
