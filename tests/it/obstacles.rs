//! What keeps a word from being read whatever its letters are is said before anything of letters.

use noctograph::scene::Scene;
use noctograph::shoot::{Shoot, Shot};

fn shot(settings: &[(&str, &str)]) -> Shot {
    let small = [("word", "I"), ("camera.width_px", "480"), ("camera.height_px", "270")];
    let settings: Vec<_> = small.iter().chain(settings).copied().collect();
    let scene = Scene::parse_with("", "scene", &settings).unwrap();
    Shoot::new(scene).unwrap().take(&|_, _| {}).unwrap()
}

fn first(settings: &[(&str, &str)]) -> String {
    let shot = shot(settings);
    let verdict = shot.verdict.unwrap();
    assert!(!verdict.legible && verdict.advice.is_empty(), "{settings:?}: {verdict:?}");
    shot.obstacles.into_iter().next().unwrap_or_default()
}

#[test]
fn each_obstacle_is_named_before_the_letters() {
    assert!(first(&[("camera.shutter_close_s", "2")]).contains("before the word is done"));
    assert!(first(&[("camera.iso", "10000000")]).contains("everything is exposed"));
    let dark = [("camera.f_number", "256"), ("camera.iso", "1")];
    assert!(first(&dark).contains("nothing is exposed"));
    // Behind the drone the headlights shine the other way: the nose points along x.
    let behind = [
        ("camera.framing.kind", "fixed"),
        ("camera.framing.position_m", "[-4.0, -0.3, 0.75]"),
        ("camera.framing.target_m", "[0.0, 0.0, 0.75]"),
    ];
    assert!(first(&behind).contains("face away from the camera"), "{}", first(&behind));
    assert!(
        first(&[("plan.lights", "[\"color-led\"]"), ("light.deck", "none")])
            .contains("no lamp that writes")
    );
}

#[test]
fn a_photo_that_shows_its_word_has_no_obstacle() {
    assert_eq!(shot(&[]).obstacles, [""; 0]);
}
