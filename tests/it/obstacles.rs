//! Tests that problems which make every word illegible are reported before any problem of letters.

use noctograph::diagnostic::Diagnostic;
use noctograph::scene::Scene;
use noctograph::shoot::{Shoot, Shot};

fn shot(settings: &[(&str, &str)]) -> Shot {
    let small = [("word", "I"), ("camera.width_px", "480"), ("camera.height_px", "270")];
    let settings: Vec<_> = small.iter().chain(settings).copied().collect();
    let scene = Scene::parse_with("", "scene", &settings).unwrap();
    Shoot::new(scene).unwrap().take(&|_, _| {}).unwrap()
}

fn first(settings: &[(&str, &str)]) -> Diagnostic {
    let shot = shot(settings);
    let verdict = shot.verdict.unwrap();
    assert!(!verdict.legible && verdict.advice.is_empty(), "{settings:?}: {verdict:?}");
    shot.problems.into_iter().next().filter(Diagnostic::is_stop).unwrap()
}

#[test]
fn each_obstacle_is_named_before_the_letters() {
    let early = first(&[("camera.shutter_close_s", "2")]);
    assert!(early.code == "shutter-closes", "{early:?}");
    let bright = first(&[("camera.iso", "10000000")]);
    assert!(bright.code == "overexposed", "{bright:?}");
    let dark = first(&[("camera.f_number", "256"), ("camera.iso", "1")]);
    assert!(dark.code == "underexposed", "{dark:?}");
    // The camera is behind the drone, whose headlights point away from it.
    let behind = [
        ("camera.framing.kind", "fixed"),
        ("camera.framing.position_m", "[-4.0, -0.3, 0.75]"),
        ("camera.framing.target_m", "[0.0, 0.0, 0.75]"),
    ];
    assert_eq!(first(&behind).number("away_frac"), Some(1.0));
    let unlit = [("plan.lights", "[\"color-led\"]"), ("light.deck", "none")];
    assert_eq!(first(&unlit).code, "unlit");
}

#[test]
fn a_photo_that_shows_its_word_has_no_obstacle() {
    assert_eq!(shot(&[]).problems, []);
}
