//! Adapts a scene's letters to given plans.
//!
//! Products in: a scene, its strokes, and plans. Products out: the scene and its strokes with the
//! size and baseline of the plans, for the camera and the checks.

use crate::scene::Scene;
use noctograph_core::error::Result;
use noctograph_core::geometry::bounds;
use noctograph_letters::{LetterOptions, Strokes};
use noctograph_plan::Plan;

/// Minimum relative change of size at which the scene's word is rescaled to the plans.
const OTHER_SIZE: f64 = 0.02;
/// Maximum error of the shorter side, as a fraction of the longer one, for words to count as equal.
const SAME_SHAPE: f64 = 0.05;

/// Returns the scene and its strokes with the size and baseline of plans for the same word, which
/// may have been fitted to a room. Plans for a different word change nothing.
pub(super) fn fit_to_plans(
    mut scene: Scene,
    strokes: Option<Strokes>,
    plans: &[Plan],
) -> Result<(Scene, Option<Strokes>)> {
    let Some(word_m) = strokes.as_ref().map(|strokes| strokes.bounds_m()) else {
        return Ok((scene, strokes));
    };
    // The box encloses the light of all plans.
    let mut lit_m = Vec::new();
    for plan in plans {
        let lit = plan.setpoints.windows(2).zip(plan.lit()).filter(|(_, level)| *level > 0.0);
        lit_m.extend(lit.flat_map(|(pair, _)| [pair[0].position_m, pair[1].position_m]));
    }
    let plan_m = bounds(lit_m.into_iter().map(|point_m| [point_m.x, point_m.z]));
    // The longer side determines the scale. If the other side disagrees, the word is different.
    let [[width_m, height_m], [plan_width_m, plan_height_m]] =
        [word_m, plan_m].map(|[left, bottom, right, top]| [right - left, top - bottom]);
    let (size_m, scale) = if width_m > height_m {
        (width_m, plan_width_m / width_m)
    } else {
        (height_m, plan_height_m / height_m)
    };
    let error_m =
        (plan_width_m - scale * width_m).abs().max((plan_height_m - scale * height_m).abs());
    let is_rescaled = (scale - 1.0).abs() > OTHER_SIZE && error_m < SAME_SHAPE * scale * size_m;
    if !is_rescaled {
        return Ok((scene, strokes));
    }
    // All lengths of the letters are scaled, and then the baseline is moved to that of the plans.
    let LetterOptions { cap_height_m, width_m, gap_m, spacing_m, line_gap_m, canvas_m, .. } =
        &mut scene.letters;
    let by_default = [width_m, gap_m, line_gap_m].into_iter().flatten();
    let sizes_m = [cap_height_m, spacing_m].into_iter().chain(by_default);
    sizes_m.chain(canvas_m.iter_mut().flatten()).for_each(|size_m| *size_m *= scale);
    let [_, bottom_m, ..] = scene.strokes()?.bounds_m();
    let raised_m = scene.letters.baseline_m + plan_m[1] - bottom_m;
    scene.letters.baseline_m = raised_m.max(0.0);
    let strokes = scene.strokes()?;
    Ok((scene, Some(strokes)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Preset;
    use crate::shoot::Shoot;

    #[test]
    fn plans_of_another_size_and_place_are_measured() {
        let mut scene = Scene { word: "NOOR".into(), ..Scene::preset(Preset::Cf21) };
        scene.letters.canvas_m = Some([1.7, 2.0]);
        scene.letters.baseline_m = 0.8;
        let small = Shoot::new(scene.clone()).unwrap();
        let plans: Vec<Plan> = small.plans.iter().map(|planned| planned.plan.clone()).collect();
        let want_m = small.strokes.unwrap().bounds_m();
        scene.letters.canvas_m = None;
        scene.letters.baseline_m = 0.5;
        let found_m = |word: &str| {
            let scene = Scene { word: word.into(), ..scene.clone() };
            let shoot = Shoot::with_plans(scene, plans.clone()).unwrap();
            shoot.strokes.unwrap().bounds_m()
        };
        let (found_m, other_m) = (found_m("NOOR"), found_m("HI"));
        for (found_m, want_m) in found_m.into_iter().zip(want_m) {
            assert!((found_m - want_m).abs() < 0.03, "{found_m} for {want_m} m");
        }
        let unscaled = Shoot::new(Scene { word: "HI".into(), ..scene.clone() }).unwrap();
        assert_eq!(other_m, unscaled.strokes.unwrap().bounds_m(), "a plan of another word");
    }
}
