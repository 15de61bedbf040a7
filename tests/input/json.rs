//! Lines of JSON: `axle convert` and `axle chart`, as processes between pipes.

use crate::harness::World;

/// Two lines of each type that the map leads away from; halves are of three types, by where they go.
fn sample(from: &str, to: &str) -> &'static str {
    match (from, to) {
        ("dwm", _) => {
            "{\"v0l\":0.25,\"v0r\":0.5,\"v1l\":0.5,\"v1r\":1.0,\"T\":2.0}\n\
             {\"v0l\":1.0,\"v0r\":1.0,\"v1l\":0.0,\"v1r\":0.0,\"T\":1.0}\n"
        }
        ("geometry", _) => {
            "{\"arc\":{\"radius\":0.5,\"angle\":-1.5}}\n\
             {\"clothoid\":{\"start_curvature\":0,\"end_curvature\":2,\"length\":1}}\n"
        }
        ("encoders-data", _) => {
            "{\"stamp\":1.0,\"left\":0.5,\"right\":0.25}\n{\"stamp\":2.0,\"left\":1.0,\"right\":1.25}\n"
        }
        ("encoders-span", _) => {
            "{\"duration\":1.0,\"left\":0.5,\"right\":0.25}\n{\"duration\":0.5,\"left\":1.0,\"right\":1.0}\n"
        }
        ("navigator-data", _) => {
            "{\"stamp\":0.0,\"pose\":{\"x\":0.0,\"y\":0.0,\"heading\":0.0}}\n\
             {\"stamp\":1.0,\"pose\":{\"x\":1.0,\"y\":0.5,\"heading\":0.25}}\n"
        }
        ("navigator-span", _) => {
            "{\"duration\":1.0,\"x\":1.0,\"y\":0.5,\"heading\":0.25}\n\
             {\"duration\":1.0,\"x\":1.0,\"y\":0.0,\"heading\":0.0}\n"
        }
        ("halves", "dwm") => {
            "{\"left\":{\"v0\":0.25,\"v1\":0.5,\"T\":2.0},\"right\":{\"v0\":0.5,\"v1\":1.0,\"T\":2.0}}\n"
        }
        ("halves", "encoders-data") => {
            "{\"left\":{\"stamp\":1.0,\"distance\":0.5},\"right\":{\"stamp\":1.0,\"distance\":0.25}}\n"
        }
        ("halves", "encoders-span") => {
            "{\"left\":{\"duration\":0.5,\"distance\":0.25},\"right\":{\"duration\":0.5,\"distance\":0.5}}\n"
        }
        other => panic!("the map has a new arrow: {other:?}"),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn every_arrow_of_the_map_leads_somewhere_and_both_its_ends_can_be_drawn() {
    let world = World::new().await;
    let map = world.fed(&["convert", "--map"], "").await;
    map.is(0, &[]);
    let arrows: Vec<_> = map.out.lines().filter_map(|line| line.split_once(" -> ")).collect();
    assert_eq!(arrows.len(), 20, "{}", map.out);
    for (from, to) in arrows {
        let (from, to) = (from.trim(), to.split(' ').next().expect("a name"));
        let lines = sample(from, to);
        let converted = world.fed(&["convert", from, to, "--track", "0.5"], lines).await;
        converted.is(0, &[]);
        assert!(converted.err.is_empty() && !converted.out.is_empty(), "{from} to {to}: {}", converted.err);
        for lines in [lines, &converted.out] {
            let drawn = world.fed(&["chart", "-", "--track", "0.5"], lines).await;
            drawn.is(0, &[]);
            assert!(drawn.out.starts_with("<svg ") && drawn.out.contains("end of a path"), "{from} to {to}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn numbers_come_back_as_they_went() {
    let world = World::new().await;
    let readings = "{\"stamp\":0.1,\"left\":0.30000000000000004,\"right\":1e-7}\n\
                    {\"stamp\":5e-324,\"left\":-0.0,\"right\":1.7976931348623157e+308}\n\
                    {\"stamp\":123456789.12345679,\"left\":2.2250738585072014e-308,\"right\":9007199254740993.0}\n";
    let halves = world.fed(&["convert", "encoders-data", "halves"], readings).await;
    halves.is(0, &[]);
    let back = world.fed(&["convert", "halves", "encoders-data"], &halves.out).await;
    back.is(0, &[]);
    // The last number is no f64; the nearest one is.
    assert_eq!(back.out, readings.replace("9007199254740993.0", "9007199254740992.0"));
}

#[tokio::test(flavor = "multi_thread")]
async fn the_state_of_a_movement_has_the_names_and_the_digits_of_the_reference() {
    let world = World::new().await;
    let line = r#"{"v0l":0.2,"v0r":0.5,"v1l":0.4,"v1r":1.0,"T":2.0,"track":0.3,"t":2.0}"#;
    let state = world.fed(&["convert", "dwm", "pose"], line).await;
    state.is(0, &[]);
    let state = state.json();
    let number = |name: &str| state[name].as_f64().unwrap_or_else(|| panic!("no {name} in {state}"));
    // Three radians of a circle of radius 0.35 m.
    for (name, expected) in [
        ("x", 0.35 * 3_f64.sin()),
        ("y", 0.35 * (1.0 - 3_f64.cos())),
        ("theta", 3.0),
        ("v", 0.7),
        ("omega", 2.0),
        ("path", 1.05),
    ] {
        assert!((number(name) - expected).abs() < 1e-15 * 4.0, "{name} is {}, not {expected}", number(name));
    }
    assert_eq!(state["shape"], "circle");
    assert_eq!(state.as_object().map(serde_json::Map::len), Some(7), "{state}");
}

#[tokio::test(flavor = "multi_thread")]
async fn bad_lines_are_told_by_their_number_and_good_ones_used() {
    let world = World::new().await;
    let good = sample("dwm", "").lines().next().expect("a line");
    let lines = format!("{good}\nnonsense\n{{\"v0l\":1}}\n{}\n{good}\n", good.replace("2.0}", "-2.0}"));
    let told = ["line 2: expected", "line 3: missing field `v0r`", "line 4: duration T of a DWM"];
    let converted = world.fed(&["convert", "dwm", "encoders-span"], &lines).await;
    converted.is(1, &told).is(1, &["3 of 5 lines could not be converted"]);
    assert_eq!(converted.out, "{\"duration\":2.0,\"left\":0.75,\"right\":1.5}\n".repeat(2));
    let drawn = world.fed(&["chart", "--track", "0.5", "-"], &lines).await;
    drawn.is(1, &told).is(1, &["3 of 5 lines could not be drawn"]);
    let alone = world.fed(&["chart", "--track", "0.5", "-"], &format!("{good}\n{good}\n")).await;
    alone.is(0, &[]);
    assert_eq!(drawn.out, alone.out, "the good lines make the same picture");
    // A robot has no negative track, and none of 0.
    let tracks = "{\"v0l\":0,\"v0r\":0,\"v1l\":0,\"v1r\":0,\"T\":1,\"track\":0}\n\
                  {\"v0l\":0,\"v0r\":0,\"v1l\":0,\"v1r\":0,\"T\":1,\"track\":-0.3}\n";
    let told = ["line 1: track: track in metres is out of range: 0", "line 2: track: track in metres"];
    world.fed(&["convert", "dwm", "pose"], tracks).await.is(1, &told);
    world.fed(&["chart", "-"], tracks).await.is(1, &told[..1]).is(1, &["nothing to draw"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_chart_goes_into_a_file_and_compares_several() {
    let world = World::new().await;
    let first = world.file("first.jsonl", sample("dwm", ""));
    let second = world.file("second.jsonl", sample("geometry", ""));
    let out = world.path().join("both.svg").display().to_string();
    let ended = world.fed(&["chart", &first, &second, "--track", "0.5", "--out", &out], "").await;
    ended.is(0, &["drawn: ", "both.svg"]);
    assert!(ended.out.is_empty());
    let svg = std::fs::read_to_string(&out).expect("the chart");
    for word in
        ["first.jsonl, second.jsonl", "start", "end of a path", "wheel distance (m)", "wheel speed (m/s)"]
    {
        assert!(svg.contains(word), "no {word:?} in the chart");
    }
    world.fed(&["chart", &first], "").await.is(1, &["line 1: missing field `track`", "--track"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wrong_command_line_is_refused_before_any_line_is_read() {
    let world = World::new().await;
    let many = ["-"; 11];
    for (args, words) in [
        (&["convert", "dwm", "sausage"][..], &["\"dwm\" to \"sausage\"", "axle convert --map"][..]),
        (&["convert", "dwm"], &["axle convert"]),
        (&["convert", "dwm", "pose", "--track", "-1"], &["track in metres"]),
        (&["chart"], &["FILE"]),
        (&["chart", "no-such-file"], &["cannot read no-such-file"]),
        (&["chart", "-", "--track", "0"], &["--track", "track in metres"]),
        (&[&["chart"][..], &many].concat(), &["11 files: at most 10"]),
    ] {
        let ended = world.fed(args, sample("dwm", "")).await;
        ended.is(2, words);
        assert!(ended.out.is_empty(), "{args:?} prints {}", ended.out);
    }
}
