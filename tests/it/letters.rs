//! Fonts and drawings as a person meets them.

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
    // Higher, it leaves what two base stations see.
    let higher = ["--set", "letters.canvas_m=[3.2, 1.6]"];
    noctograph(folder.path()).args(args).args(higher).assert().code(1);
    std::fs::remove_dir_all(folder.path().join("noctograph-out")).unwrap();
    let run = noctograph(folder.path()).args(args).assert().success();
    let found = json(&run.get_output().stdout);
    assert!(found["word"].is_null() && found["legible"].is_null(), "no verdict: {found}");
    let names = names_in(&folder.path().join("noctograph-out"));
    assert_eq!(names, ["flight.csv", "photo.png", "plan.csv", "scene.toml"]);
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
    assert_eq!(names_in(folder.path()), ["broken.ttf", "plan.csv"], "no plan of the broken one");
}
