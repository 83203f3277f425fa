use super::*;
use crate::report::document::tests::document;
use roxmltree::{Document as Xml, ParsingOptions};

fn parsed(html: &str) -> Xml<'_> {
    Xml::parse_with_options(html, ParsingOptions { allow_dtd: true, ..Default::default() }).unwrap()
}

fn all_text(html: &str) -> String {
    parsed(html).descendants().filter_map(|node| node.text()).collect::<Vec<_>>().join("\n")
}

fn full() -> Document {
    let mut document = document();
    document.sequences = document.maps.clone();
    document.pictures = document.maps.clone();
    document.picture_means.clone_from(&document.means);
    let lines = vec!["a  <b> c".to_owned()];
    document.texts.push(Text { title: "Text & more".to_owned(), command: "make tables".to_owned(), lines });
    document
}

#[test]
fn the_page_is_well_formed_and_needs_nothing_else() {
    for document in [full(), document(), Document::new(String::new(), Vec::new())] {
        let html = page(&document);
        let xml = parsed(&html);
        let tag = |name: &str| xml.descendants().filter(|node| node.tag_name().name() == name).count();
        assert_eq!((tag("script"), tag("img"), tag("link"), tag("h1")), (0, 0, 0, 1));
        for link in xml.descendants().filter_map(|node| node.attribute("href")) {
            assert_eq!(link, "report.json");
        }
        assert!(!html.contains("@import") && !html.contains("url("));
    }
}

#[test]
fn names_are_escaped_wherever_they_stand() {
    let html = page(&full());
    assert!(!html.contains("<b>&.hdr"));
    let text = all_text(&html);
    for expected in ["<b>&.hdr", "lightcast report '<b>&.hdr'", "Text & more", "a  <b> c\n"] {
        assert!(text.contains(expected), "{expected}");
    }
    for (name, svg) in plots(&full()) {
        assert!(Xml::parse(&svg).is_ok() && !name.contains(['/', '<', ' ']), "{name}");
    }
}

#[test]
fn every_table_has_a_command_and_marks_of_the_front() {
    let html = page(&full());
    let xml = parsed(&html);
    let count = |name: &str, class: &str| {
        xml.descendants()
            .filter(|node| node.has_tag_name(name) && node.attribute("class") == Some(class))
            .count()
    };
    // Means and two maps, two sequences, means and two maps of pictures; a text and the report itself.
    let tables = xml.descendants().filter(|node| node.has_tag_name("table")).count();
    assert_eq!((tables, count("p", "command")), (8, 8 + 2));
    let document = full();
    let all = [&document.maps, &document.sequences, &document.pictures].into_iter().flatten();
    let on_front: usize = all
        .chain(&document.means)
        .chain(&document.picture_means)
        .flat_map(|table| &table.rows)
        .map(|row| row.front.iter().filter(|is_on| **is_on).count())
        .sum();
    assert_eq!(count("td", "front"), on_front);
}

#[test]
fn what_is_missing_is_told() {
    let mut document = document();
    document.pictures_skipped = Some("no adapter <here>".to_owned());
    let told = all_text(&page(&document));
    assert!(told.contains("not complete") && told.contains("Skipped: no adapter <here>"), "{told}");
    document.is_complete = true;
    assert!(!all_text(&page(&document)).contains("not complete"));
}

#[test]
fn hard_cases_are_rows() {
    use crate::compare::stability::{Bound, Figures, Row};
    let figures =
        |ours| Figures { plain_f32: Some(f64::NAN), ours, reference: 1.0, bound: Bound::Absolute(0.1) };
    let row =
        |figures| Row { case: "a < b", input: "in", quantity: "out", figures, tested_in: Some("tests/a.rs") };
    let mut document = document();
    document.stability = vec![row(Some(figures(1.05))), row(Some(figures(2.0))), row(None)];
    let html = page(&document);
    let text = all_text(&html);
    for expected in
        ["a < b", "lightcast report --stability", "NaN", "1.0500000", "1e-1 absolute", "within", "beyond"]
    {
        assert!(text.contains(expected), "{expected}");
    }
    assert!(text.contains("tested in tests/a.rs"));
    let xml = parsed(&html);
    let table = xml.descendants().find(|node| node.attribute("class") == Some("cases")).unwrap();
    assert_eq!(table.descendants().filter(|node| node.has_tag_name("tr")).count(), 4);
}

#[test]
fn plots_lie_beside_the_page_under_names_of_their_own() {
    let names: Vec<String> = plots(&full()).into_iter().map(|(name, _)| name).collect();
    assert_eq!(
        names,
        [
            "maps_time.svg",
            "maps_lights.svg",
            "map_1.svg",
            "map_2.svg",
            "sequence_1.svg",
            "sequence_2.svg",
            "pictures_time.svg",
            "pictures_lights.svg",
        ]
    );
    assert!(plots(&Document::new(String::new(), Vec::new())).is_empty());
}
