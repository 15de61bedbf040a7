//! What a chart promises: valid XML of bounded size, the same scale in both directions, nothing left out in silence.

use super::*;

const SQUARE: [(f64, f64); 5] = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0)];

fn three(points: &[(f64, f64)]) -> [PathSeries; 3] {
    let points = || points.to_vec();
    [PathSeries::planned(points()), PathSeries::driven(points()), PathSeries::estimated(points())]
}

fn wheels(count: u32) -> Wheels {
    let point = |index: u32, slip: f64| {
        let time = f64::from(index) * 0.02;
        WheelPoint { time, left: time * 0.3 * slip, right: time * 0.3 + (time * 2.0).sin() * 0.1 * slip }
    };
    Wheels {
        due: (0..count).map(|index| point(index, 1.0)).collect(),
        real: (0..count).map(|index| point(index, 0.97)).collect(),
    }
}

/// Refuses a text that is not well-formed: tags that do not close, bare `<` and `&`, letters that XML does not know.
fn check_xml(svg: &str) {
    assert!(svg.starts_with("<svg xmlns="), "it begins as SVG");
    let mut open = Vec::new();
    for piece in svg.split('<').skip(1) {
        let (tag, text) = piece.split_once('>').expect("every tag ends");
        assert_eq!(tag.matches('"').count() % 2, 0, "quotes of <{tag}>");
        for part in tag.split('&').skip(1).chain(text.split('&').skip(1)) {
            let (entity, _) = part.split_once(';').expect("every entity ends");
            assert!(["lt", "gt", "amp", "quot", "apos"].contains(&entity), "&{entity};");
        }
        let name = tag.split([' ', '/']).find(|word| !word.is_empty()).expect("every tag has a name");
        if tag.starts_with('/') {
            assert_eq!(open.pop(), Some(name), "</{name}> closes what is open");
        } else if !tag.ends_with('/') {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "{open:?} stay open");
    assert!(!svg.contains(|c: char| c.is_control() && c != '\n'), "control characters");
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "only numbers");
}

/// Where the way points are drawn, in units: the only black discs of that size that are not in the legend.
fn dots(svg: &str) -> Vec<(f64, f64)> {
    let value = |line: &str, name: &str| {
        let (_, rest) = line.split_once(&format!(" {name}=\"")).expect("the attribute is there");
        rest.split('"').next().expect("a value").parse::<f64>().expect("a number")
    };
    svg.lines()
        .filter(|line| line.starts_with("<circle") && line.contains("r=\"16\""))
        .map(|line| (value(line, "cx"), value(line, "cy")))
        .collect()
}

#[test]
fn a_demo_chart_says_what_it_shows() {
    let svg = demo_chart("a square of 1 m", &three(&SQUARE), &SQUARE[1..], &wheels(500)).expect("a chart");
    check_xml(&svg);
    let words = [
        "<title>a square of 1 m</title>",
        "\na square of 1 m\n",
        "planned",
        "true",
        "estimated",
        "start",
        "end of a path",
        "way point",
        "x, forward (m)",
        "y, left (m)",
        "time (s)",
        "wheel distance (m)",
        "left wheel, due",
        "right wheel, real",
    ];
    for word in words {
        assert!(svg.contains(word), "the chart does not say {word:?}");
    }
}

#[test]
fn a_metre_is_as_long_in_both_directions() {
    for (wide, tall) in [(1.0, 1.0), (20.0, 0.5), (0.2, 9.0), (1e-3, 1e-3), (4000.0, 3000.0)] {
        let corners = [(0.0, 0.0), (wide, 0.0), (wide, tall)];
        let svg = path_chart(&three(&corners), &corners).expect("a chart");
        check_xml(&svg);
        let dots = dots(&svg);
        let [a, b, c] = dots[..3] else { panic!("three dots") };
        let (across, up) = ((b.0 - a.0) / wide, (b.1 - c.1) / tall);
        // A short side is only as exact as a quarter of a pixel.
        let exact = 0.02 * up + 2.0 / tall.min(wide);
        assert!((across - up).abs() < exact, "{wide} x {tall}: {across} and {up} units per metre");
        assert!(across > 0.0 && up > 0.0, "x grows to the right and y upward");
    }
    let svg = path_chart(&three(&SQUARE), &SQUARE).expect("a chart");
    let dots = dots(&svg);
    let (across, up) = (dots[1].0 - dots[0].0, dots[0].1 - dots[2].1);
    assert!((across / up - 1.0).abs() < 0.005, "a square of {across} x {up} units");
}

#[test]
fn way_points_lie_on_the_path_that_visits_them() {
    let svg = path_chart(&[PathSeries::planned(SQUARE.to_vec())], &SQUARE[1..]).expect("a chart");
    let drawn: Vec<(f64, f64)> = svg
        .lines()
        .filter(|line| line.starts_with("<polyline") && line.contains("stroke-width=\"28\""))
        .flat_map(|line| {
            line.split("points=\"").nth(1).expect("points").split('"').next().expect("points").split(' ')
        })
        .filter_map(|pair| pair.split_once(','))
        .map(|(x, y)| (x.parse().expect("a number"), y.parse().expect("a number")))
        .collect();
    assert!(drawn.len() >= 5);
    for dot in &dots(&svg)[..4] {
        let near = drawn.iter().any(|point| (point.0 - dot.0).hypot(point.1 - dot.1) < 6.0);
        assert!(near, "{dot:?} is not on {drawn:?}");
    }
}

#[test]
fn odd_paths_are_drawn_too() {
    for (points, words) in [
        (vec![], "nothing to drive"),
        (vec![(f64::NAN, 0.0), (0.0, f64::INFINITY), (1e300, 0.0)], "nothing to drive"),
        (vec![(2.0, 3.0)], "start"),
        (vec![(2.0, 3.0); 100], "start"),
        (vec![(0.0, 0.0), (20.0, 0.0)], "start"),
        (vec![(0.0, 0.0), (0.0, 20.0)], "start"),
        (vec![(-9e6, -9e6), (9e6, 9e6)], "start"),
        (vec![(0.0, 0.0), (1e-300, 0.0)], "start"),
        (vec![(5e6, 5e6), (5e6 + 1e-9, 5e6)], "start"),
        (vec![(0.0, 0.0), (f64::NAN, f64::NAN), (1.0, 1.0)], "start"),
    ] {
        let svg = demo_chart("odd", &three(&points), &points, &Wheels::default()).expect("a chart");
        check_xml(&svg);
        assert!(svg.contains(words), "{points:?} does not say {words:?}");
        assert!(svg.contains("no measurements"));
    }
    let svg = path_chart(&[], &[]).expect("a chart");
    check_xml(&svg);
    let still = Wheels {
        due: vec![WheelPoint::default(); 3],
        real: vec![WheelPoint { time: f64::NAN, ..WheelPoint::default() }],
    };
    check_xml(&demo_chart("", &three(&SQUARE), &[], &still).expect("a chart"));
}

#[test]
fn a_chart_has_a_bounded_size() {
    let spiral = |index: u32| {
        let angle = f64::from(index) * 0.37;
        (angle.cos() * f64::from(index), angle.sin() * f64::from(index) * 0.6)
    };
    let points: Vec<_> = (0..100_000).map(spiral).collect();
    let series: Vec<_> = (0..50)
        .map(|index| PathSeries { name: format!("path {index}"), points: points.clone(), ink: index })
        .collect();
    let svg = demo_chart(&"title ".repeat(1000), &series, &points, &wheels(100_000)).expect("a chart");
    check_xml(&svg);
    assert!(svg.len() < 700_000, "{} bytes", svg.len());
    let three = demo_chart("three", &three(&points), &points[..4000], &wheels(100_000)).expect("a chart");
    assert!(three.len() < 400_000, "{} bytes", three.len());
}

#[test]
fn thinned_lines_keep_their_ends() {
    let points: Vec<_> = (0..100_000).map(|index| (f64::from(index), f64::from(index % 2) * 1e4)).collect();
    let thin = thin::thin(&points, (1.0, 1.0));
    assert!(thin.len() <= 3001, "{} points", thin.len());
    assert_eq!((thin.first(), thin.last()), (points.first(), points.last()));
    let few = [(0.0, 0.0), (0.1, 0.0), (5.0, 0.0)];
    assert_eq!(thin::thin(&few, (1.0, 1.0)), [(0.0, 0.0), (5.0, 0.0)]);
}

#[test]
fn names_are_escaped_and_cut() {
    let name = "<script>&\"'\u{1b}[31m\u{0} \u{ffff} of a very long name".to_owned();
    let svg = demo_chart(
        &name,
        &[PathSeries { name: name.clone(), points: SQUARE.to_vec(), ink: 1 }],
        &[],
        &Wheels::default(),
    );
    let svg = svg.expect("a chart");
    check_xml(&svg);
    assert!(!svg.contains("<script") && svg.contains("&lt;script&gt;&amp;"));
    assert!(svg.contains('…'), "a long name is cut");
}

#[test]
fn a_contest_on_the_spot_is_drawn_in_a_decimetre_and_tenths_of_a_millimetre() {
    let points = vec![(0.0, 0.0), (0.001, -0.0005), (0.0, 0.0)];
    let path = PathSeries { name: "d-corrector".into(), points: points.clone(), ink: 1 };
    let spread = Spread { name: "d-corrector".into(), values: vec![1e-6, 2e-6, 3e-6] };
    let svg = contest_chart("turn", &[PathSeries::planned(points), path], ("final error (cm)", &[spread]))
        .expect("a chart");
    check_xml(&svg);
    let says = |label: &str| svg.lines().any(|line| line.trim() == label);
    assert!(says("0.04") && !says("0.001") && !says("0.0005"), "the plane: {svg}");
    assert!(says("0.01") && says("0.1") && says("1"), "the axis of the boxes: {svg}");
}
