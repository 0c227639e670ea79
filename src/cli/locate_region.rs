//! `noctograph locate --region` tests how well the shared-anchor observer converges while two
//! drones write a word.

use nalgebra::Vector3;

use super::outcome::Report;
use crate::error::{Error, Result};
use crate::locate::{Outputs, SharedAnchorObserver, fraction_left, observability, shared_anchor};
use crate::scene::Scene;
use crate::shoot::Shoot;
use serde_json::json;

/// Initial errors in the table of convergence, in m.
const ERRORS_M: [f64; 5] = [0.25, 0.5, 1.0, 2.0, 4.0];
/// Observer gains in the table of convergence.
const GAINS: [f64; 3] = [0.003, 0.03, 0.3];
/// Observation times in the table of observability, in s.
const SPANS_S: [f64; 4] = [0.0, 1.0, 3.0, 20.0];
/// Duration of each simulation, in s.
const MAP_S: f64 = 64.0;
/// Number of random starts for each initial error.
const STARTS: u32 = 40;
/// Shortest duration in s of a plan that is repeated. A plan of no duration could not be.
const LEAST_S: f64 = 1e-3;
/// Smallest standard deviation of a range in m, because exact ranges have no information matrix.
const LEAST_NOISE_M: f64 = 1e-4;

/// Returns the report on the region of convergence of the shared-anchor observer, and on the
/// observability, while two drones write the scene's word. Returns [`Error::Input`] for a scene
/// with other than two drones, or without an anchor that both hear.
pub(super) fn region(scene: Scene) -> Result<Report> {
    let uwb = scene.sensors.uwb.clone();
    let Some(anchors) = shared_anchor(&uwb.heard) else {
        let hint = "use the scene two-drones-three-anchors";
        let wanted = "two drones that receive two anchors each, one of which is common to both";
        let actual = format!("{:?}", uwb.heard);
        return Err(Error::input("sensors.uwb.heard", actual, wanted, hint));
    };
    let [first_m, second_m, shared_m] = anchors.map(|anchor| Vector3::from(uwb.anchors_m[anchor]));
    let plans = Shoot::new(scene)?.plans;
    let [first, second] = plans.as_slice() else {
        let hint = "set plan.drones = 2 and plan.style = \"even\"";
        return Err(Error::input("plan.drones", plans.len(), "two drones", hint));
    };
    // The drones repeat the word until the end of the simulated time.
    let positions_m = |time_s: f64| {
        [first, second]
            .map(|planned| planned.plan.design_m(time_s % planned.plan.duration_s().max(LEAST_S)))
    };
    let observer =
        |gain| SharedAnchorObserver { own_m: [first_m, second_m], shared_m, gains: [gain; 2] };
    let errors = ERRORS_M.map(|error_m| {
        let left =
            GAINS.map(|gain| fraction_left(&observer(gain), positions_m, MAP_S, error_m, STARTS));
        json!({ "error_m": error_m, "left": left })
    });
    let observed = SPANS_S.map(|span_s| {
        let [ranges, three] = [Outputs::Ranges, Outputs::Three].map(|outputs| {
            let noise_m = uwb.noise_m.max(LEAST_NOISE_M);
            // The gain does not matter here, because observability is a property of the outputs.
            observability(&observer(1.0), outputs, positions_m, span_s, uwb.rate_hz, noise_m)
        });
        json!({ "time_s": span_s, "ranges": ranges, "three_outputs": three })
    });
    // The JSON object has a row for each pair of an error and a gain, in place of the table.
    let pairs = errors.iter().flat_map(|error| (0..GAINS.len()).map(move |k| (k, error)));
    let rows = pairs.map(|(k, error)| json!({ "gain": GAINS[k], "share_left": error["left"][k] }));
    let product = json!({ "region": rows.collect::<Vec<_>>(), "observability": observed });
    let words = json!({ "errors": errors, "map_s": MAP_S, "starts": STARTS, "gains": GAINS });
    Ok(Report::with_words(product, &words, LAYOUT))
}

const LAYOUT: &str = "\
Fraction of the start error that remains after {map_s} s of writing with the shared-anchor observer, without noise: median of {starts} starts (best to worst; diverged)

|errors|error, m<8|gain 0.003>23|gain 0.03>23|gain 0.3>23
{error_m}|{left.0.median:.2} ({left.0.range.0:.2}-{left.0.range.1:.2}; {left.0.diverged_frac*100:.0} %)|{left.1.median:.2} ({left.1.range.0:.2}-{left.1.range.1:.2}; {left.1.diverged_frac*100:.0} %)|{left.2.median:.2} ({left.2.range.0:.2}-{left.2.range.1:.2}; {left.2.diverged_frac*100:.0} %)

Observability of the positions at the start, with known motion

|observability|time, s<10|five ranges: rank>18|worst, cm>12|observer's three: rank>25|worst, cm>12
{time_s}|{ranges.rank}|{ranges.sigmas_m.5*100:.1~open}|{three_outputs.rank}|{three_outputs.sigmas_m.5*100:.1~open}

";
