//! Asking and answering: whatever happens, the asker gets an answer, or a refusal that names who failed.

use super::question;
use crate::harness::{Meeting, PATIENCE, Process, Stranger, World, all_alive, eventually, r1, within};
use axle_mesh::{Mesh, Retry, Server};
use axle_schema::codec::encoding_of;
use axle_schema::{Drive, Message, Plan, PlanAsk, Refusal, key};
use nix::sys::signal::Signal;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};
use tokio::task::JoinHandle;

/// A session of a Pathfinder that the asker can reach.
async fn pathfinder<A: Message>(meeting: &Meeting, asker: &Mesh) -> (Mesh, Server<PlanAsk, A>) {
    let mesh = meeting.join("pathfinder").await;
    let server = mesh.server(&key::PLAN.of_every_robot()).expect("a server");
    // A token comes after what was declared before it: whoever sees it can ask.
    let visible = mesh.become_visible().expect("visible");
    all_alive(asker, &["pathfinder"]).await;
    drop(visible);
    (mesh, server)
}

/// Asks Pathfinder in a task of its own, once; the question is on its way when this returns.
async fn ask_once(mesh: &Mesh, deadline: Duration) -> JoinHandle<Result<Plan, Refusal>> {
    let before = mesh.counters().sent.load(Relaxed);
    let asker = mesh.clone();
    let asking =
        tokio::spawn(
            async move { asker.ask(&key::PLAN, Some(&r1()), &question(), deadline, Retry::Never).await },
        );
    eventually("the question is sent", || (mesh.counters().sent.load(Relaxed) > before).then_some(())).await;
    asking
}

fn is_unavailable(answer: &Result<Plan, Refusal>) {
    let Err(Refusal::Unavailable { what, hint }) = answer else { panic!("{answer:?}") };
    assert_eq!(what, "pathfinder");
    assert!(hint.contains("axle/r1/pathfinder/plan") && hint.contains("axle run pathfinder"), "{hint}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_question_that_nobody_answers_is_unavailable_by_name() {
    let meeting = Meeting::new().await;
    let mesh = meeting.join("test").await;
    let begun = Instant::now();
    is_unavailable(&ask_once(&mesh, PATIENCE).await.await.expect("an answer"));
    assert!(begun.elapsed() < PATIENCE / 2, "an empty answer is known at once");
    // With retries the deadline of the caller holds.
    let deadline = Duration::from_millis(300);
    let answer = mesh.ask(&key::PLAN, Some(&r1()), &question(), deadline, Retry::Idempotent).await;
    is_unavailable(&answer);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_comes_while_it_is_asked_for_answers() {
    let meeting = Meeting::new().await;
    let (mesh, late) = (meeting.join("test").await, meeting.join("pathfinder").await);
    let before = mesh.counters().sent.load(Relaxed);
    let asker = mesh.clone();
    let asking = tokio::spawn(async move {
        asker.ask(&key::PLAN, Some(&r1()), &question(), PATIENCE, Retry::Idempotent).await
    });
    // Two tries have ended empty; the next one finds a server.
    eventually("it is asked again", || (mesh.counters().sent.load(Relaxed) > before + 2).then_some(())).await;
    let server = late.server::<PlanAsk, Plan>(&key::PLAN.of_every_robot()).expect("a server");
    within(PATIENCE, "the question comes", server.next()).await.reply(Ok(Plan::default()));
    assert_eq!(asking.await.expect("an answer"), Ok(Plan::default()));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_leaves_or_forgets_in_mid_query_is_unavailable_and_no_hang() {
    let meeting = Meeting::new().await;
    let mesh = meeting.join("test").await;
    let (other, server) = pathfinder::<Plan>(&meeting, &mesh).await;
    let asking = ask_once(&mesh, PATIENCE).await;
    drop(within(PATIENCE, "the question comes", server.next()).await);
    is_unavailable(&within(PATIENCE / 2, "a forgotten question ends", asking).await.expect("an answer"));

    let asking = ask_once(&mesh, PATIENCE).await;
    let asked = within(PATIENCE, "the question comes", server.next()).await;
    other.leave().await;
    is_unavailable(
        &within(PATIENCE / 2, "a question of one who left ends", asking).await.expect("an answer"),
    );
    drop(asked);
}

/// A frozen Pathfinder that has been asked; the question waits for an answer that cannot come.
async fn frozen(world: &World) -> (Process, Process, Mesh) {
    let router = world.router();
    let pathfinder = world.run("pathfinder");
    let mesh = world.join().await;
    all_alive(&mesh, &["pathfinder"]).await;
    pathfinder.freeze().await;
    (router, pathfinder, mesh)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_is_killed_in_mid_query_is_unavailable_and_no_hang() {
    let world = World::new().await;
    let (_router, pathfinder, mesh) = frozen(&world).await;
    let asking = ask_once(&mesh, PATIENCE).await;
    pathfinder.tell(Signal::SIGKILL);
    // The fault model allows the lease of 1 s; the rest is for a loaded machine.
    let answer = within(Duration::from_secs(3), "the question ends with its server", asking).await;
    is_unavailable(&answer.expect("an answer"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_freezes_in_mid_query_is_given_up_with_its_lease() {
    let world = World::new().await;
    let (_router, _pathfinder, mesh) = frozen(&world).await;
    let asking = ask_once(&mesh, PATIENCE).await;
    let answer = within(Duration::from_secs(5), "the question ends with the lease", asking).await;
    is_unavailable(&answer.expect("an answer"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_thinks_too_long_has_timed_out_by_name() {
    let meeting = Meeting::new().await;
    let mesh = meeting.join("test").await;
    let (_other, server) = pathfinder::<Plan>(&meeting, &mesh).await;
    let asking = ask_once(&mesh, Duration::from_millis(400)).await;
    let asked = within(PATIENCE, "the question comes", server.next()).await;
    let answer = within(PATIENCE, "the deadline of the asker holds", asking).await.expect("an answer");
    assert_eq!(answer, Err(Refusal::TimedOut { what: "pathfinder".into(), seconds: 0.4 }));
    drop(asked);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_refusal_arrives_as_it_was_given() {
    let meeting = Meeting::new().await;
    let mesh = meeting.join("test").await;
    let (other, server) = pathfinder::<Plan>(&meeting, &mesh).await;
    for refusal in [
        Refusal::Unreachable { why: "a wall".into() },
        Refusal::OutOfRange { what: "x".into(), got: "2".into(), limit: "0 to 1".into() },
        Refusal::Busy { holder: "somebody@lab/7".into() },
    ] {
        let asking = ask_once(&mesh, PATIENCE).await;
        let asked = within(PATIENCE, "the question comes", server.next()).await;
        assert_eq!(asked.question(), Ok(question()));
        asked.reply(Err(refusal.clone()));
        assert_eq!(asking.await.expect("an answer"), Err(refusal));
    }
    assert_eq!(other.counters().refused.load(Relaxed), 3);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_answer_of_another_type_is_refused() {
    let meeting = Meeting::new().await;
    let mesh = meeting.join("test").await;
    let (_other, server) = pathfinder::<Drive>(&meeting, &mesh).await;
    let asking = ask_once(&mesh, PATIENCE).await;
    within(PATIENCE, "the question comes", server.next()).await.reply(Ok(Drive::default()));
    let expected = Refusal::WrongType { expected: "axle.Plan.v1".into(), got: "axle.Drive.v1".into() };
    assert_eq!(asking.await.expect("an answer"), Err(expected));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_question_without_words_is_told_what_is_missing() {
    let meeting = Meeting::new().await;
    let mesh = meeting.join("test").await;
    let other = meeting.join("pathfinder").await;
    let serving = {
        let other = other.clone();
        tokio::spawn(async move {
            let answer = |_: PlanAsk, _| Ok(Plan::default());
            other.serve(&key::PLAN.of_every_robot(), answer).await
        })
    };
    // The first answer shows that the server is reached.
    let answer = mesh.ask(&key::PLAN, Some(&r1()), &question(), PATIENCE, Retry::Idempotent).await;
    assert_eq!(answer, Ok(Plan::default()));
    let stranger = Stranger::join(&meeting.endpoint).await;
    let key = "axle/r1/pathfinder/plan";
    stranger.is_refused(key, "", None, &["is missing", "PlanAsk as CBOR"]).await;
    let wrong = encoding_of::<Drive>();
    stranger
        .is_refused(key, &wrong, Some(vec![0xa0]), &["wrong type", "axle.PlanAsk.v1", "axle.Drive.v1"])
        .await;
    assert_eq!(other.counters().refused.load(Relaxed), 2);
    serving.abort();
}
