use super::*;
use roxmltree::{Document, Node};

fn series(name: &str, points: &[(f64, f64)]) -> Series {
    Series { name: name.to_owned(), points: points.to_vec() }
}

fn panel(series: Vec<Series>) -> Panel {
    Panel {
        title: "map".into(),
        x_label: "lights".into(),
        y_label: "RMS / mean".into(),
        series,
        ..Panel::default()
    }
}

fn plot(panels: Vec<Panel>) -> String {
    Plot { title: "error".into(), panels }.to_svg()
}

fn elements<'a>(document: &'a Document, name: &str) -> Vec<Node<'a, 'a>> {
    document.descendants().filter(|node| node.has_tag_name(name)).collect()
}

fn number(node: Node, attribute: &str) -> f64 {
    node.attribute(attribute).unwrap().parse().unwrap()
}

fn texts(document: &Document) -> Vec<String> {
    elements(document, "text").iter().map(|node| node.text().unwrap_or("").to_owned()).collect()
}

fn points(polyline: Node) -> Vec<(f64, f64)> {
    let pair = |pair: &str| {
        let (x, y) = pair.split_once(',').unwrap();
        (x.parse().unwrap(), y.parse().unwrap())
    };
    polyline.attribute("points").unwrap().split(' ').map(pair).collect()
}

#[test]
fn points_land_where_the_logarithms_say() {
    let svg = plot(vec![panel(vec![series("a", &[(4.0, 0.1), (32.0, 0.01), (512.0, 0.001)])])]);
    let document = Document::parse(&svg).unwrap();
    let lines = elements(&document, "polyline");
    assert_eq!(lines.len(), 1);
    // The margin is 4 % of the range at either end, so 1.08 ranges fill the area.
    let (left, top) = (LEFT, TITLE_HEIGHT + ABOVE);
    for ((x, y), (part_x, part_y)) in
        points(lines[0]).into_iter().zip([(0.0, 0.0), (3.0 / 7.0, 0.5), (1.0, 1.0)])
    {
        assert!((x - (left + AREA_WIDTH * (part_x + 0.04) / 1.08)).abs() < 0.006, "{x}");
        assert!((y - (top + AREA_HEIGHT * (part_y + 0.04) / 1.08)).abs() < 0.006, "{y}");
    }
    let frame = elements(&document, "rect")[1];
    assert_eq!((number(frame, "x"), number(frame, "y")), (left, top));
    let texts = texts(&document);
    for expected in ["error", "map", "lights", "RMS / mean", "a", "10", "100", "0.1", "0.01", "0.001"] {
        assert!(texts.iter().any(|text| text == expected), "{expected} is missing in {texts:?}");
    }
}

#[test]
fn labels_stand_at_their_lines() {
    let svg = plot(vec![panel(vec![series("a", &[(4.0, 3e-5), (512.0, 2e-2)])])]);
    let document = Document::parse(&svg).unwrap();
    let axis = Axis::new([3e-5, 2e-2].into_iter(), TITLE_HEIGHT + ABOVE + AREA_HEIGHT, TITLE_HEIGHT + ABOVE);
    for (label, value) in [("1e-4", 1e-4), ("0.001", 1e-3), ("0.01", 1e-2)] {
        let text = elements(&document, "text").into_iter().find(|node| node.text() == Some(label)).unwrap();
        assert!((number(text, "y") - 4.0 - axis.position(value)).abs() < 0.006);
        let is_here = |line: &Node| (number(*line, "y1") - axis.position(value)).abs() < 0.006;
        assert!(elements(&document, "line").iter().any(is_here), "{label}");
    }
}

#[test]
fn a_point_without_a_place_interrupts_the_line() {
    let odd = [(0.0, 1.0), (4.0, -1.0), (4.0, f64::NAN), (f64::INFINITY, 1.0), (8.0, 0.0)];
    let mut line = vec![(1.0, 1.0), (2.0, 2.0)];
    line.extend(odd);
    line.push((16.0, 4.0));
    let with = plot(vec![panel(vec![series("a", &line)])]);
    let document = Document::parse(&with).unwrap();
    let runs: Vec<usize> =
        elements(&document, "polyline").into_iter().map(|line| points(line).len()).collect();
    assert_eq!(runs, [2, 1]);
    assert!(!with.contains("NaN") && !with.contains("inf"));
    // The axes follow from the points that can be shown.
    let without = plot(vec![panel(vec![series("a", &[(1.0, 1.0), (2.0, 2.0), (16.0, 4.0)])])]);
    let document = Document::parse(&without).unwrap();
    let all = points(elements(&document, "polyline")[0]);
    let document = Document::parse(&with).unwrap();
    let pieces: Vec<(f64, f64)> = elements(&document, "polyline").into_iter().flat_map(points).collect();
    assert_eq!(pieces, all);
}

#[test]
fn nothing_to_draw_is_still_a_document() {
    for panels in
        [vec![], vec![panel(vec![])], vec![panel(vec![series("none", &[]), series("odd", &[(0.0, 0.0)])])]]
    {
        let names = panels.iter().map(|panel| panel.series.len()).sum::<usize>();
        let svg = plot(panels);
        let document = Document::parse(&svg).unwrap();
        assert!(elements(&document, "polyline").is_empty());
        // A series without points is in the legend as well.
        assert_eq!(elements(&document, "circle").len(), names);
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }
}

#[test]
fn extreme_values_have_a_place_and_few_labels() {
    let svg = plot(vec![
        panel(vec![series("a", &[(f64::MIN_POSITIVE, f64::MAX), (f64::MAX, 5e-324)])]),
        Panel { x_label: "n".into(), y_label: "FLIP".into(), ..panel(vec![series("a", &[(7.0, 0.3)])]) },
    ]);
    let document = Document::parse(&svg).unwrap();
    for (line, lefts) in elements(&document, "polyline").into_iter().zip([0.0, LEFT + AREA_WIDTH + RIGHT]) {
        for (x, y) in points(line) {
            assert!((LEFT..LEFT + AREA_WIDTH).contains(&(x - lefts)));
            assert!((TITLE_HEIGHT..TITLE_HEIGHT + ABOVE + AREA_HEIGHT).contains(&y));
        }
    }
    // A single point is in the middle.
    let (x, y) = points(elements(&document, "polyline")[1])[0];
    assert!((x - (2.0 * LEFT + 1.5 * AREA_WIDTH + RIGHT)).abs() < 0.006);
    assert!((y - (TITLE_HEIGHT + ABOVE + AREA_HEIGHT / 2.0)).abs() < 0.006);
    assert!(elements(&document, "text").len() < 40);
    for (low, high) in [
        (1.0, 1.0),
        (1.0, 1.3),
        (4.0, 512.0),
        (0.9, 1.1),
        (1e-9, 1e9),
        (3.0, 40.0),
        (95.0, 96.0),
        (0.27, 1.6),
    ] {
        let axis = Axis::new([low, high].into_iter(), 0.0, AREA_WIDTH);
        let ticks = axis.ticks();
        let labelled: Vec<f64> =
            ticks.iter().filter(|tick| tick.is_labelled).map(|tick| tick.value).collect();
        assert!((1..=9).contains(&labelled.len()), "{low} to {high}: {labelled:?}");
        let places: Vec<f64> = labelled.iter().map(|&value| axis.position(value)).collect();
        assert!(places.windows(2).all(|pair| pair[1] - pair[0] >= 31.0), "{low} to {high}: {labelled:?}");
    }
}

#[test]
fn axes_of_one_label_have_one_range() {
    let one = panel(vec![series("a", &[(1.0, 1.0), (2.0, 2.0)])]);
    let other = panel(vec![series("a", &[(2.0, 2.0), (8.0, 64.0)])]);
    let svg = plot(vec![one.clone(), other.clone()]);
    let document = Document::parse(&svg).unwrap();
    let lines: Vec<_> = elements(&document, "polyline").into_iter().map(points).collect();
    let ((x, y), (x_beside, y_beside)) = (lines[0][1], lines[1][0]);
    assert!((x_beside - x - (LEFT + AREA_WIDTH + RIGHT)).abs() < 0.011 && y == y_beside);
    let svg = plot(vec![one, Panel { y_label: "FLIP".into(), ..other }]);
    let document = Document::parse(&svg).unwrap();
    let lines: Vec<_> = elements(&document, "polyline").into_iter().map(points).collect();
    let ((x, y), (x_beside, y_beside)) = (lines[0][1], lines[1][0]);
    assert!((x_beside - x - (LEFT + AREA_WIDTH + RIGHT)).abs() < 0.011 && y < y_beside - 100.0);
}

#[test]
fn rings_stand_about_their_points() {
    let points = [(1.0, 1.0), (2.0, 2.0), (4.0, 8.0)];
    let rings = vec![(2.0, 2.0), (0.0, 1.0), (1.0, f64::NAN)];
    let svg = plot(vec![Panel { rings, ..panel(vec![series("a", &points)]) }]);
    let document = Document::parse(&svg).unwrap();
    let circles = elements(&document, "circle");
    let (rings, dots): (Vec<Node>, Vec<Node>) =
        circles.into_iter().partition(|circle| circle.attribute("fill") == Some("none"));
    assert_eq!((rings.len(), dots.len()), (1, 4));
    let place = |circle: Node| (number(circle, "cx"), number(circle, "cy"));
    assert_eq!(place(rings[0]), place(dots[1]));
}

#[test]
fn the_emphasised_series_has_the_thickest_line_in_the_legend_too_and_black_alone() {
    let names = ["a", "b", "c", "d", "e", "f", "g", "h"];
    let lines = names.iter().map(|name| series(name, &[(1.0, 1.0), (2.0, 2.0)])).collect();
    let svg = plot(vec![Panel { emphasis: Some("b".into()), ..panel(lines) }]);
    let document = Document::parse(&svg).unwrap();
    let strokes: Vec<Node> =
        document.descendants().filter(|node| node.has_attribute("stroke-width")).collect();
    let widths: Vec<f64> = strokes.iter().map(|node| number(*node, "stroke-width")).collect();
    let expected = [1.5, 3.0, 1.5, 1.5, 1.5, 1.5, 1.5, 1.5];
    assert_eq!(widths, [expected, expected].concat());
    let black = strokes.iter().filter(|node| node.attribute("stroke") == Some("#000000"));
    assert!(black.map(|node| number(*node, "stroke-width")).eq([3.0, 3.0]));
    let looks: std::collections::BTreeSet<_> =
        strokes.iter().map(|node| (node.attribute("stroke"), node.attribute("stroke-dasharray"))).collect();
    assert_eq!(looks.len(), names.len());
}

#[test]
fn parts_are_the_panels_as_they_stand_in_the_whole() {
    let one = panel(vec![series("a", &[(1.0, 1.0), (2.0, 2.0)])]);
    let other = panel(vec![series("<b>", &[(2.0, 2.0), (8.0, 64.0)])]);
    let plot = Plot { title: "error".into(), panels: vec![one, other] };
    let parts = plot.to_parts();
    assert_eq!(parts.panels.len(), 2);
    let whole = plot.to_svg();
    let whole = Document::parse(&whole).unwrap();
    let lines = elements(&whole, "polyline");
    for (at, svg) in parts.panels.iter().enumerate() {
        let document = Document::parse(svg).unwrap();
        let alone = elements(&document, "polyline");
        assert_eq!(alone[0].attribute("stroke"), lines[at].attribute("stroke"));
        for ((x, y), (x_whole, y_whole)) in points(alone[0]).into_iter().zip(points(lines[at])) {
            assert!((x + at as f64 * PANEL_WIDTH - x_whole).abs() < 0.011);
            assert!((y + TITLE_HEIGHT - y_whole).abs() < 0.011);
        }
    }
    let names: Vec<&str> = parts.legend.iter().map(|(_, name)| name.as_str()).collect();
    assert_eq!(names, ["a", "<b>"]);
    assert!(parts.legend.iter().all(|(sample, _)| Document::parse(sample).is_ok()));
}

#[test]
fn text_is_escaped() {
    let name = "a < b & \"c\" > 'd' \u{1}]]>";
    let mut panel = panel(vec![series(name, &[(1.0, 1.0)])]);
    panel.y_label = name.to_owned();
    let svg = plot(vec![panel]);
    let document = Document::parse(&svg).unwrap();
    let wanted = name.replace('\u{1}', "\u{fffd}");
    assert_eq!(texts(&document).iter().filter(|text| **text == wanted).count(), 2);
}

#[test]
fn a_name_has_one_look_in_all_panels_and_one_legend_entry() {
    let names: Vec<String> = (0..21).map(|i| format!("series {i}")).collect();
    let all = |points: &[(f64, f64)]| panel(names.iter().map(|name| series(name, points)).collect());
    let mut reversed = all(&[(2.0, 2.0), (3.0, 1.0)]);
    reversed.series.reverse();
    let svg = plot(vec![all(&[(1.0, 1.0), (2.0, 2.0)]), reversed]);
    let document = Document::parse(&svg).unwrap();
    let look = |node: &Node| {
        (node.attribute("stroke").unwrap().to_owned(), node.attribute("stroke-dasharray").map(str::to_owned))
    };
    let lines: Vec<_> = elements(&document, "polyline").iter().map(look).collect();
    let (first, second) = lines.split_at(21);
    assert!(first.iter().eq(second.iter().rev()));
    assert!((0..21).all(|i| !first[..i].contains(&first[i])), "all look different");
    assert!(names.iter().all(|name| texts(&document).iter().filter(|text| *text == name).count() == 1));
    // The legend stays within the picture.
    let svg = document.root_element();
    for text in elements(&document, "text") {
        assert!(number(text, "y") < number(svg, "height") && number(text, "x") < number(svg, "width"));
    }
}
