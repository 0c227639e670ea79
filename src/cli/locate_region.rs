//! `noctograph locate --region`: what the observer of two drones with a shared anchor sees of a
//! word.

use nalgebra::Vector3;

use super::{Error, Report, Result, Value, json, table};
use crate::locate::{Outputs, SharedAnchorObserver, observability, share_left, shared_anchor};
use crate::scene::Scene;
use crate::sensors::UwbOptions;
use crate::shoot::Shoot;

/// Start errors, gains and times of the map.
const ERRORS_M: [f64; 5] = [0.25, 0.5, 1.0, 2.0, 4.0];
const GAINS: [f64; 3] = [0.003, 0.03, 0.3];
const SPANS_S: [f64; 4] = [0.0, 1.0, 3.0, 20.0];
/// Time of the map, and its starts for each error.
const MAP_S: f64 = 64.0;
const STARTS: u32 = 40;

/// The local region of the observer along the scene's word.
pub(super) fn region(scene: Scene) -> Result<Report> {
    let uwb = scene.sensors.uwb.clone();
    let Some(anchors) = shared_anchor(&uwb.heard) else {
        let hint = "take the scene two-drones-three-anchors";
        let wanted = "two drones that hear two anchors each, one of them the same";
        let found = format!("{:?}", uwb.heard);
        return Err(Error::input("sensors.uwb.heard", found, wanted, hint));
    };
    let [one, two, shared_m] = anchors.map(|anchor| Vector3::from(uwb.anchors_m[anchor]));
    let plans = Shoot::new(scene)?.plans;
    let [first, second] = plans.as_slice() else {
        let hint = "set plan.drones = 2 and plan.style = \"even\"";
        return Err(Error::input("plan.drones", plans.len(), "two drones", hint));
    };
    let path = |time_s: f64| {
        [first, second]
            .map(|planned| planned.plan.design_m(time_s % planned.plan.duration_s().max(1e-3)))
    };
    let observer = |gain| SharedAnchorObserver { own_m: [one, two], shared_m, gains: [gain; 2] };
    let (map, left) = map(observer, path);
    let (table, seen) = observability_table(&uwb, observer(1.0), path);
    Ok(Report::new(map + &table, json!({ "region": left, "observability": seen })))
}

/// Shares of the start error that are left, by error and gain.
fn map(
    observer: impl Fn(f64) -> SharedAnchorObserver,
    path: impl Fn(f64) -> [Vector3<f64>; 2] + Copy,
) -> (String, Vec<Value>) {
    let mut left = Vec::new();
    let rows = ERRORS_M.map(|error_m| {
        let mut row = error_m.to_string();
        for gain in GAINS {
            let left_share = share_left(&observer(gain), path, MAP_S, error_m, STARTS);
            let [best, worst] = left_share.range;
            let diverged = 100.0 * left_share.diverged_frac;
            row += &format!("\t{:.2} ({best:.2}-{worst:.2}; {diverged:.0} %)", left_share.median);
            left.push(json!({ "gain": gain, "share_left": left_share }));
        }
        row
    });
    let gains = GAINS.map(|gain| format!("|gain {gain}>23")).concat();
    let text = format!(
        "Share of the start error that the shared-anchor observer leaves after {MAP_S} s of\n\
         writing, without noise: median of {STARTS} starts (best to worst; diverged)\n\n{}",
        table(&format!("error, m<8{gains}"), rows)
    );
    (text, left)
}

/// Rank and worst direction of the start, from all ranges and from the observer's three outputs.
fn observability_table(
    uwb: &UwbOptions,
    observer: SharedAnchorObserver,
    path: impl Fn(f64) -> [Vector3<f64>; 2] + Copy,
) -> (String, Vec<Value>) {
    let mut seen = Vec::new();
    let rows = SPANS_S.map(|span_s| {
        let both = [Outputs::Ranges, Outputs::Three].map(|outputs| {
            observability(&observer, outputs, path, span_s, uwb.rate_hz, uwb.noise_m.max(1e-4))
        });
        let worst = |sigma_m: f64| match sigma_m.is_finite() {
            true => format!("{:.1} cm", 100.0 * sigma_m),
            false => "open".to_owned(),
        };
        seen.push(json!({ "time_s": span_s, "ranges": both[0], "three_outputs": both[1] }));
        let [ranges, three] = both.map(|found| (found.rank, worst(found.sigmas_m[5])));
        format!("{span_s}\t{:>14}{:>14}\t{:>18}{:>14}", ranges.0, ranges.1, three.0, three.1)
    });
    let head = "time, s<13|five ranges: rank, worst<28|observer's three: rank, worst<0";
    let title = "\nObservability of the positions at the start, with known motion\n\n";
    (title.to_owned() + &table(head, rows) + "\n", seen)
}
