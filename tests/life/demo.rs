//! `axle demo`: the main job, as a person or a program meets it.

use crate::harness::{World, children, driven, eventually, is_alive};
use nix::sys::signal::Signal;
use std::path::Path;

/// A way that shows a line and a turn, and takes no longer than it must.
const WAY: &str = "0.4,0 0.4,0.3";

/// Every opened element is closed in its order, and there is one at the top.
fn is_xml(text: &str) -> Result<(), String> {
    let mut open: Vec<&str> = Vec::new();
    let mut tops = 0;
    let mut rest = text.trim();
    while let Some(at) = rest.find('<') {
        let end = rest[at..].find('>').ok_or("a tag does not end")? + at;
        let tag = &rest[at + 1..end];
        rest = &rest[end + 1..];
        if tag.starts_with(['?', '!']) {
            continue;
        }
        let name = tag.trim_start_matches('/').split([' ', '\n', '/']).next().unwrap_or_default();
        if tag.starts_with('/') {
            let last = open.pop().ok_or(format!("</{name}> closes nothing"))?;
            if last != name {
                return Err(format!("</{name}> closes <{last}>"));
            }
        } else {
            tops += usize::from(open.is_empty());
            if !tag.ends_with('/') {
                open.push(name);
            }
        }
    }
    if tops == 1 && open.is_empty() {
        Ok(())
    } else {
        Err(format!("{tops} at the top, open at the end: {open:?}"))
    }
}

fn finished(path: &Path) -> u64 {
    let mut recording = axle_recorder::Recording::open(path).expect("the recording opens");
    let samples = recording.by_ref().count();
    let account = recording.account();
    assert!(account.finished && account.damaged == 0, "{account:?}");
    u64::try_from(samples).expect("a number")
}

#[tokio::test(flavor = "multi_thread")]
async fn the_demo_says_all_that_is_promised_as_json() {
    let world = World::new().await;
    let demo =
        driven(|| world.axle(&["demo", "--json", "--way", WAY, "--out", "shown", "--seed", "7"])).await;
    let json = demo.is(0, &["10 processes on tcp/127.0.0.1:"]).json();
    let keys: Vec<&str> = json.as_object().expect("an object").keys().map(String::as_str).collect();
    let promised = [
        "chart",
        "cross_track_max_m",
        "cross_track_rms_m",
        "duration_s",
        "final_error_m",
        "late_beats",
        "late_p99_s",
        "messages",
        "phase",
        "points",
        "points_reached",
        "processes",
        "reached",
        "recording",
        "seed",
    ];
    assert_eq!(keys, promised);
    assert_eq!(json["reached"], true);
    assert_eq!((&json["points"], &json["points_reached"], &json["seed"]), (&2.into(), &2.into(), &7.into()));
    let number = |key: &str| json[key].as_f64().unwrap_or_else(|| panic!("{key}: {}", json[key]));
    assert!((0.0..0.03).contains(&number("final_error_m")), "{json}");
    assert!((0.0..0.05).contains(&number("cross_track_rms_m")), "{json}");
    assert!((2.0..15.0).contains(&number("duration_s")), "{json}");

    let processes = json["processes"].as_array().expect("a list");
    assert_eq!(processes.len(), 10);
    for process in processes {
        let pid = process["pid"].as_u64().expect("each has run as a process");
        assert!(!is_alive(u32::try_from(pid).expect("a pid")), "{process} is gone");
        let service = process["service"].as_str().expect("a name");
        // A gate refuses commands that come too late, as they do where beats are late: it is right then.
        let may_refuse = service == "router" || (service == "emulator" && json["late_beats"] != 0);
        assert!(may_refuse || json["messages"][service]["refused"] == 0, "{service}: {json}");
    }
    let (chart, recording) =
        (json["chart"].as_str().expect("a path"), json["recording"].as_str().expect("a path"));
    assert_eq!(Path::new(chart), world.path().join("shown/demo.svg"));
    let svg = std::fs::read_to_string(chart).expect("the chart");
    is_xml(&svg).unwrap_or_else(|why| panic!("{why}: {svg}"));
    assert!(svg.contains("<svg"));
    assert!(finished(Path::new(recording)) > 200, "half a minute of a robot is more than that");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_demo_shows_a_table_to_people_and_may_be_repeated() {
    let world = World::new().await;
    for _ in 0..2 {
        let demo = driven(|| world.axle(&["demo", "--way", "0.2,0", "--robot", "r7"])).await;
        demo.is(0, &["chart ", "recording "]);
        for words in ["reached", "yes", "final position error", "d-corrector", "refused"] {
            assert!(demo.out.contains(words), "{words:?} is missing in {}", demo.out);
        }
        finished(&world.path().join("demo-out/demo.mcap"));
    }
    let left = std::fs::read_dir(world.path().join("demo-out")).expect("the directory").count();
    assert_eq!(left, 3, "chart, recording and log of the last one");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_demo_that_is_interrupted_leaves_no_process() {
    let world = World::new().await;
    let mut demo = world.axle(&["demo", "--way", "4,0"]);
    demo.says("10 processes on").await;
    let pids = children(demo.pid());
    assert_eq!(pids.len(), 10);
    demo.tell(Signal::SIGINT);
    demo.ended().await.is(1, &["cancelled", "demo.log"]);
    eventually("all are gone", || (!pids.iter().any(|pid| is_alive(*pid))).then_some(())).await;
}
