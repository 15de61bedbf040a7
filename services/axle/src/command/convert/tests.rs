//! Every arrow on lines, good and bad.

use super::arrows::ARROWS;
use super::*;
use clap::Parser as _;
use serde_json::Value;

/// What `axle convert` with these words makes of the lines: stdout, the complaints, and the count of bad lines.
fn run(words: &str, input: &str) -> (Vec<String>, Vec<String>, u64) {
    let cli =
        crate::cli::Cli::try_parse_from(["axle", "convert"].into_iter().chain(words.split(' '))).unwrap();
    let crate::cli::Command::Convert(args) = cli.command else { panic!("{words} is no conversion") };
    let arrow =
        ARROWS.iter().find(|a| Some(a.from) == args.from.as_deref() && Some(a.to) == args.to.as_deref());
    let work = arrow.unwrap().work(&args).unwrap();
    let (mut out, mut complaints) = (Vec::new(), Vec::new());
    let (_, bad) =
        pump(Lines::new(input.as_bytes()), &mut out, work, &mut |words| complaints.push(words.into()))
            .unwrap();
    let lines = String::from_utf8(out).unwrap().lines().map(str::to_owned).collect();
    (lines, complaints, bad)
}

/// The lines that `axle convert` with these words makes of good lines.
pub(crate) fn converted(words: &str, input: &str) -> Vec<String> {
    let (lines, complaints, _) = run(words, input);
    assert_eq!(complaints, Vec::<String>::new(), "{words}");
    lines
}

fn check(words: &str, input: &str, output: &[&str]) {
    let (lines, complaints, bad) = run(words, input);
    assert_eq!(
        (lines, complaints, bad),
        (output.iter().map(|line| (*line).to_owned()).collect(), Vec::new(), 0),
        "{words}"
    );
}

#[test]
fn every_golden_movement_is_converted_as_the_reference_says() {
    let golden = include_str!("../../../../../schema/tests/data/golden_dwm.jsonl");
    let (lines, complaints, _) = run("dwm pose", golden);
    assert_eq!((lines.len(), complaints), (400, Vec::<String>::new()));
    for (line, case) in lines.iter().zip(golden.lines()) {
        let (found, case): (Value, Value) =
            (serde_json::from_str(line).unwrap(), serde_json::from_str(case).unwrap());
        let number = |value: &Value, key: &str| value[key].as_f64().unwrap();
        let miss = (number(&found, "x") - number(&case, "x")).hypot(number(&found, "y") - number(&case, "y"));
        assert!(miss <= 1e-14 * number(&case, "path"), "{line} {case}");
        assert_eq!(found["shape"], case["shape"], "{line}");
    }
}

#[test]
fn the_state_at_the_end_is_the_one_without_a_time() {
    let dwm = r#""v0l":0.5,"v0r":0.5,"v1l":0,"v1r":0,"T":2"#;
    let state = r#"{"x":0.5,"y":0.0,"theta":0.0,"v":0.0,"omega":0.0,"path":0.5,"shape":"line"}"#;
    check("dwm pose", &format!("{{{dwm},\"track\":0.3}}"), &[state]);
    check("dwm pose --track 0.3", &format!("{{{dwm},\"t\":2}}\n\n{{{dwm},\"t\":null}}"), &[state, state]);
}

#[test]
fn bad_lines_are_told_by_their_number_and_the_good_ones_converted() {
    let good = r#"{"duration":1,"left":0.25,"right":0.5}"#;
    let long = format!("{{\"duration\":1,{}", " ".repeat(200_000));
    let input = format!(
        "{good}\nnonsense\n{long}\n{{\"duration\":1}}\n{{\"duration\":0,\"left\":1,\"right\":1}}\n\u{7f}\n{good}"
    );
    let (lines, complaints, bad) = run("encoders-span dwm", &input);
    assert_eq!(lines, [r#"{"v0l":0.25,"v0r":0.5,"v1l":0.25,"v1r":0.5,"T":1.0}"#; 2]);
    assert_eq!(bad, 5);
    for (complaint, words) in complaints.iter().zip([
        ["line 2", "expected"],
        ["line 3", "longer than 65536 bytes"],
        ["line 4", "missing field `left`"],
        ["line 5", "duration of an encoder span"],
        ["line 6", "expected"],
    ]) {
        assert!(words.iter().all(|word| complaint.contains(word)), "{complaint}");
    }
}

#[test]
fn what_no_movement_may_be_is_refused() {
    for (line, word) in [
        (r#"{"v0l":0,"v0r":0,"v1l":0,"v1r":0,"T":-1,"track":0.3}"#, "duration T"),
        (r#"{"v0l":0,"v0r":0,"v1l":0,"v1r":0,"T":1,"track":0}"#, "track"),
        (r#"{"v0l":0,"v0r":0,"v1l":0,"v1r":0,"T":1,"track":-0.3}"#, "track"),
        (r#"{"v0l":0,"v0r":0,"v1l":0,"v1r":0,"T":1}"#, "track"),
        (r#"{"v0l":1e999,"v0r":0,"v1l":0,"v1r":0,"T":1,"track":0.3}"#, "out of range"),
        (r#"{"v0l":"1","v0r":0,"v1l":0,"v1r":0,"T":1,"track":0.3}"#, "finite number"),
        (r#"{"v0l":0,"v0r":0,"v1l":0,"v1r":0,"T":1,"track":0.3,"t":2}"#, "t in s"),
        (r#"{"v0l":0,"v0r":0,"v1l":0,"v1r":0,"T":1,"track":0.3,"t":-1}"#, "t in s"),
        (r"[1,2,3]", "invalid"),
    ] {
        let (lines, complaints, bad) = run("dwm pose", line);
        assert!(lines.is_empty() && bad == 1 && complaints[0].contains(word), "{line}: {complaints:?}");
    }
}

#[test]
fn the_conversions_of_movements_and_geometries_write_what_the_types_say() {
    let dwm = r#"{"v0l":0.25,"v0r":0.5,"v1l":0.5,"v1r":1.0,"T":2.0}"#;
    check("dwm encoders-span", dwm, &[r#"{"duration":2.0,"left":0.75,"right":1.5}"#]);
    let halves = r#"{"left":{"v0":0.25,"v1":0.5,"T":2.0},"right":{"v0":0.5,"v1":1.0,"T":2.0}}"#;
    check("dwm halves", dwm, &[halves]);
    check("halves dwm", halves, &[dwm]);
    check("dwm geometry --track 0.5", dwm, &[r#"{"arc":{"radius":0.75,"angle":1.5}}"#]);
    let spiral = r#"{"v0l":0.25,"v0r":0.5,"v1l":1.0,"v1r":1.25,"T":2.0,"track":0.25}"#;
    check("dwm geometry", spiral, &[r#"{"spiral":{"start_radius":0.375,"end_radius":1.125,"angle":2.0}}"#]);
    check(
        "geometry dwm --track 0.5",
        r#"{"turn":{"angle":-1}}"#,
        &[r#"{"v0l":1.0,"v0r":-1.0,"v1l":1.0,"v1r":-1.0,"T":0.25}"#],
    );
    check(
        "geometry navigator-span",
        r#"{"line":{"length":2}}"#,
        &[r#"{"duration":0.0,"x":2.0,"y":0.0,"heading":0.0}"#],
    );
    let (poses, ..) = run("geometry navigator-data --track 0.5 --step 0.5", r#"{"line":{"length":2}}"#);
    assert_eq!(poses.len(), 5);
    let (poses, ..) = run("dwm navigator-data --track 0.5 --step 0.5", dwm);
    assert_eq!(poses.len(), 5);
    let (_, complaints, _) = run("geometry dwm --track 0.5", r#"{"parabola":{}}"#);
    assert!(complaints[0].contains("parabola") && complaints[0].contains("spiral"), "{complaints:?}");
}

#[test]
fn measurements_are_spread_and_spans_accumulated() {
    let data = [
        r#"{"stamp":1.0,"left":0.5,"right":0.25}"#,
        r#"{"stamp":1.5,"left":0.75,"right":0.75}"#,
        r#"{"stamp":2.5,"left":1.0,"right":1.0}"#,
    ];
    let spans =
        [r#"{"duration":0.5,"left":0.25,"right":0.5}"#, r#"{"duration":1.0,"left":0.25,"right":0.25}"#];
    check("encoders-data encoders-span", &data.join("\n"), &spans);
    check(&format!("encoders-span encoders-data --start {}", data[0]), &spans.join("\n"), &data);
    check(
        "encoders-span dwm --speeds 0.5,1.0",
        spans[0],
        &[r#"{"v0l":0.5,"v0r":1.0,"v1l":0.5,"v1r":1.0,"T":0.5}"#],
    );
    let (chain, ..) = run("encoders-span dwm --chain", &spans.join("\n"));
    assert_eq!(chain.len(), 2);
    let halves = r#"{"left":{"duration":0.5,"distance":0.25},"right":{"duration":0.5,"distance":0.5}}"#;
    check("encoders-span halves", spans[0], &[halves]);
    check("halves encoders-span", halves, &[spans[0]]);
    let halves = r#"{"left":{"stamp":1.0,"distance":0.5},"right":{"stamp":1.0,"distance":0.25}}"#;
    check("encoders-data halves", data[0], &[halves]);
    check("halves encoders-data", halves, &[data[0]]);
    check(
        "encoders-span navigator-span --track 0.5",
        spans[1],
        &[r#"{"duration":1.0,"x":0.25,"y":0.0,"heading":0.0}"#],
    );
    let poses = r#"{"stamp":0.0,"pose":{"x":0.0,"y":0.0,"heading":0.0}}
{"stamp":1.0,"pose":{"x":1.0,"y":0.5,"heading":0.0}}"#;
    check("navigator-data navigator-span", poses, &[r#"{"duration":1.0,"x":1.0,"y":0.5,"heading":0.0}"#]);
    check(
        "navigator-span navigator-data",
        r#"{"duration":1,"x":1,"y":0.5,"heading":0}"#,
        &poses.lines().collect::<Vec<_>>(),
    );
    check(
        "dwm navigator-span --track 0.5",
        r#"{"v0l":1,"v0r":1,"v1l":1,"v1r":1,"T":1}"#,
        &[r#"{"duration":1.0,"x":1.0,"y":0.0,"heading":0.0}"#],
    );
}

#[test]
fn a_tenth_stays_a_tenth() {
    check(
        "encoders-data halves",
        r#"{"stamp":0.1,"left":0.30000000000000004,"right":1e-7}"#,
        &[r#"{"left":{"stamp":0.1,"distance":0.30000000000000004},"right":{"stamp":0.1,"distance":1e-7}}"#],
    );
}

#[test]
fn the_map_names_every_arrow_once() {
    let map = map();
    for arrow in ARROWS {
        assert_eq!(
            map.lines()
                .filter(|line| line.starts_with(&format!("{:<15} -> {:<16}", arrow.from, arrow.to)))
                .count(),
            1
        );
    }
}

#[test]
fn wrong_options_are_refused_before_any_line_is_read() {
    for words in [
        "dwm pose --track 0",
        "dwm geometry --position-tolerance -1",
        "dwm navigator-data --step 0",
        "encoders-span dwm --speeds 1",
        "encoders-span encoders-data --start {}",
    ] {
        let cli =
            crate::cli::Cli::try_parse_from(["axle", "convert"].into_iter().chain(words.split(' '))).unwrap();
        let crate::cli::Command::Convert(args) = cli.command else { panic!("{words} is no conversion") };
        let arrow =
            ARROWS.iter().find(|a| Some(a.from) == args.from.as_deref() && Some(a.to) == args.to.as_deref());
        assert!(arrow.unwrap().work(&args).is_err(), "{words}");
    }
}
