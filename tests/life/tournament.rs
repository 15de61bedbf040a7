//! `axle tournament`, as a person or a program meets it.

use crate::harness::World;

/// A small tournament: two correctors, two short courses, two scenarios, two runs.
const SMALL: [&str; 11] = [
    "tournament",
    "--only",
    "d-corrector,ltv-corrector",
    "--courses",
    "turn,arc",
    "--scenarios",
    "clean,ticks",
    "--runs",
    "2",
    "--seed",
    "5",
];

#[tokio::test(flavor = "multi_thread")]
async fn the_same_seed_prints_the_same_bytes_on_any_number_of_threads() {
    let world = World::new().await;
    let mut printed = Vec::new();
    for more in [&["--json", "--threads", "1"], &["--json", "--threads", "3"]] {
        let args: Vec<&str> = SMALL.iter().chain(more).copied().collect();
        let ended = world.axle(&args).ended().await;
        ended.is(0, &["16 runs", "times real time"]);
        printed.push(ended.out.clone());
    }
    assert_eq!(printed[0], printed[1]);

    let rows: Vec<serde_json::Value> =
        printed[0].lines().map(|line| serde_json::from_str(line).expect("a JSON object a line")).collect();
    // Two correctors in four cells, in both scenarios over both courses, and over everything.
    assert_eq!(rows.len(), 2 * (4 + 2 + 1));
    for row in &rows {
        let runs = row["runs"].as_u64().expect("a count");
        assert!([2, 4, 8].contains(&runs), "{row}");
        for metric in
            ["final_error_m", "heading_error_rad", "cross_track_rms_m", "cross_track_max_m", "time_s"]
        {
            let [low, mean, high] =
                ["low", "mean", "high"].map(|name| row[metric][name].as_f64().expect("a number"));
            assert!(low <= mean + 1e-12 && mean <= high + 1e-12, "{metric} of {row}");
            assert!(
                row[metric]["behind_best"]["mean"].as_f64().expect("a number") >= 0.0,
                "{metric} of {row}"
            );
        }
        assert!(row["success"]["mean"].as_f64() <= Some(1.0), "{row}");
        assert!(row["reversals"]["mean"].is_number() && row["effort_m2_s3"]["mean"].is_number(), "{row}");
    }
    let last = &rows[rows.len() - 1];
    assert_eq!((last["course"].as_str(), last["scenario"].as_str()), (Some("all"), Some("all")));
    let total = &rows[rows.len() - 2..];
    assert!(
        total.iter().any(|row| row["final_error_m"]["behind_best"]["high"].as_f64() == Some(0.0)),
        "the best"
    );

    let other: Vec<&str> = SMALL[..9].iter().chain(&["--seed", "6", "--json"]).copied().collect();
    assert_ne!(world.axle(&other).ended().await.out, printed[0], "another seed, other accidents");
}

#[tokio::test(flavor = "multi_thread")]
async fn tables_and_pictures_show_what_was_driven() {
    let world = World::new().await;
    let args: Vec<&str> = SMALL.iter().chain(&["--csv", "--svg", "pictures"]).copied().collect();
    let ended = world.axle(&args).ended().await;
    ended.is(0, &["5 pictures in pictures"]);
    let columns: Vec<usize> = ended.out.lines().map(|line| line.split(',').count()).collect();
    assert_eq!((columns.len(), columns[0]), (15, 4 + 6 * 8), "a heading and 14 rows");
    assert!(columns.iter().all(|&count| count == columns[0]), "{columns:?}");
    for name in ["turn-clean", "turn-ticks", "arc-clean", "arc-ticks", "all"] {
        let svg = std::fs::read_to_string(world.path().join(format!("pictures/{name}.svg"))).expect(name);
        assert!(svg.contains("ltv-corrector") && svg.contains("final error (cm)"), "{name}");
    }
    let args: Vec<&str> = SMALL.iter().chain(&["--markdown"]).copied().collect();
    let ended = world.axle(&args).ended().await;
    ended.is(0, &[]);
    assert!(ended.out.contains("| ltv-corrector | 8 |") && ended.out.contains("| ticks |"), "{}", ended.out);
}

#[tokio::test(flavor = "multi_thread")]
async fn tuned_parameters_are_a_file_that_the_service_takes_or_say_what_is_wrong() {
    let world = World::new().await;
    let small = ["--courses", "turn", "--scenarios", "clean", "--runs", "1"];
    let args: Vec<&str> = ["tournament", "--tune", "d-corrector"].iter().chain(&small).copied().collect();
    let ended = world.axle(&args).ended().await;
    ended.is(0, &["try 1: pole"]);
    assert!(
        ended.out.starts_with("# d-corrector: pole ")
            && ended.out.contains("found by `axle tournament --tune d-corrector"),
        "{}",
        ended.out
    );
    let table: toml::Table = toml::from_str(&ended.out).expect("a parameter file");
    let params: axle_correctors::DParams = table.try_into().expect("the parameters of the D-corrector");
    assert!((0.3..=0.92).contains(&params.pole), "{params:?}");
    for (args, words) in [
        (["--tune", "x-corrector"], &["--tune", "x-corrector", "known: d-corrector"][..]),
        (["--only", "x-corrector"], &["--only", "known: d-corrector"]),
        (["--courses", "x"], &["--courses \"x\"", "straight, turn"]),
        (["--scenarios", "x"], &["--scenarios \"x\"", "clean, ticks"]),
        (["--runs", "0"], &["1..=1000"]),
    ] {
        world.axle(&["tournament", args[0], args[1]]).ended().await.is(2, words);
    }
}
