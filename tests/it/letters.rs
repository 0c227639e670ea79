//! Tests of fonts and drawings on the command line.

use predicates::prelude::*;

use crate::cli::{json, names_in, noctograph};

const DRAWING: &str = "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 100 50'>\
    <circle cx='25' cy='25' r='20' fill='none' stroke='red'/><path d='M60 5 L95 45'/></svg>";

#[test]
fn a_drawing_is_flown_and_photographed_and_not_read() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("logo.svg"), DRAWING).unwrap();
    let args =
        ["preview", "--drawing", "logo.svg", "--json", "--backend", "cpu", "--size", "320x180"];
    // A higher canvas extends beyond the space that two base stations cover.
    let higher = ["--set", "letters.canvas_m=[3.2, 1.6]"];
    noctograph(folder.path()).args(args).args(higher).assert().code(1);
    std::fs::remove_dir_all(folder.path().join("noctograph-out")).unwrap();
    let run = noctograph(folder.path()).args(args).assert().success();
    let found = json(&run.get_output().stdout);
    assert!(found["word"].is_null() && found["legible"].is_null(), "no verdict: {found}");
    let names = names_in(&folder.path().join("noctograph-out"));
    assert_eq!(names, ["flight.csv", "logo.svg", "photo.png", "plan.csv", "scene.toml"]);
    let args = ["plan", "--scene", "noctograph-out/scene.toml", "-o", "again.csv"];
    noctograph(folder.path()).args(args).assert().success();
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert_eq!(read("again.csv"), read("noctograph-out/plan.csv"), "the scene names its drawing");
    let run = noctograph(folder.path())
        .args(["score", "noctograph-out/photo.png", "--trust"])
        .assert()
        .code(2);
    run.stderr(predicate::str::contains("a drawing"));
    let both = [&["plan", "NOOR"][..], &["check", "--word", "NOOR"]];
    for command in both {
        noctograph(folder.path()).args(command).args(["--drawing", "logo.svg"]).assert().code(2);
    }
}

#[test]
fn a_word_in_a_typeface_and_in_two_lines_is_planned() {
    let folder = tempfile::tempdir().unwrap();
    let roboto = concat!(env!("CARGO_MANIFEST_DIR"), "/fonts/Roboto-Thin.ttf");
    let args = ["plan", r"Hi\nÄrger", "--font", roboto];
    noctograph(folder.path()).args(args).assert().success();
    std::fs::write(folder.path().join("broken.ttf"), b"\0\x01\0\0 no").unwrap();
    let run =
        noctograph(folder.path()).args(["plan", "Hi", "--font", "broken.ttf"]).assert().code(2);
    run.stderr(predicate::str::contains("broken.ttf"));
    let names = ["broken.ttf", "plan.Roboto-Thin.ttf", "plan.csv", "plan.scene.toml"];
    assert_eq!(names_in(folder.path()), names, "no plan of the broken one");
}

#[test]
fn what_of_a_drawing_is_not_followed_is_said_by_every_verb() {
    let folder = tempfile::tempdir().unwrap();
    let odd = DRAWING.replace("</svg>", "\n<g filter='url(#f)'/><g filter='url(#f)'/></svg>");
    std::fs::write(folder.path().join("odd.svg"), odd).unwrap();
    let said = "odd.svg:2: 2 elements use filter: not followed";
    let plan = ["plan", "--drawing", "odd.svg", "-o", "plan.csv", "--json"];
    let run = noctograph(folder.path()).args(plan).assert().success();
    let found = json(&run.get_output().stdout);
    let warning = found["drawing"]["warnings"][0].as_str().unwrap();
    assert_eq!(warning, said);
    run.stderr(predicate::str::contains("warning: odd.svg:2: 2 elements use filter"));
    let check = ["check", "--drawing", "odd.svg"];
    let run = noctograph(folder.path()).args(check).assert();
    let output = run.get_output();
    let text = [&output.stdout[..], &output.stderr[..]].concat();
    let text = String::from_utf8_lossy(&text).split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(text.contains("2 elements use filter"), "{text}");
}

#[test]
fn text_in_a_drawing_and_ink_of_another_kind_are_refused_with_the_way_out() {
    let folder = tempfile::tempdir().unwrap();
    let text = DRAWING.replace("</svg>", "\n<text y='20'>HI</text></svg>");
    std::fs::write(folder.path().join("text.svg"), text).unwrap();
    std::fs::write(folder.path().join("a.inkml"), "<ink/>").unwrap();
    let refused = |name: &str, found: &str| {
        let run = noctograph(folder.path()).args(["plan", "--drawing", name]).assert().code(2);
        run.stderr(predicate::str::contains(found));
    };
    refused("text.svg", "text.svg:2: found text");
    refused("text.svg", "Object to Path");
    refused("a.inkml", "*.json (strokes)");
}

#[test]
fn points_of_light_are_shown_in_the_drawing_of_a_plan() {
    let folder = tempfile::tempdir().unwrap();
    let of = |dots: &str| {
        let svg = format!(
            "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 100 50' stroke='red' fill='none' \
             stroke-linecap='round'><path d='M10 40H90'/>{dots}</svg>"
        );
        std::fs::write(folder.path().join("dots.svg"), svg).unwrap();
        let args = ["plan", "--drawing", "dots.svg", "-o", "plan.svg"];
        let run = noctograph(folder.path()).args(args).assert().success();
        let said = String::from_utf8(run.get_output().stdout.clone()).unwrap();
        let drawn = std::fs::read_to_string(folder.path().join("plan.svg")).unwrap();
        (said.contains(" 3 strokes"), drawn.contains("below 0.05 m/s"))
    };
    assert_eq!(
        of("<path d='M30 10h0'/><path d='M70 10h0'/>"),
        (true, true),
        "in the slowest color"
    );
}
