//! Two drones that share a word and three anchors.

use noctograph::flight::{ESTIMATE_NEES, Flight};
use noctograph::scene::Scene;
use noctograph::shoot::Shoot;

/// Root mean square of the position's error over lit samples after 2 s, and the mean NEES.
fn errors(flights: &[Flight]) -> (f64, f64) {
    let (mut square, mut nees, mut n) = (0.0, 0.0, 0.0);
    for flight in flights {
        let light = flight.lights.values().next().unwrap();
        for (i, sample) in flight.samples.iter().enumerate() {
            if sample.time_s > 2.0 && light[i] > 0.0 {
                square += (sample.estimate_m - sample.position_m).norm_squared();
                nees += flight.extra[ESTIMATE_NEES][i];
                n += 1.0;
            }
        }
    }
    ((square / n).sqrt(), nees / n)
}

/// Error and NEES of the seeds of a scene.
fn flown(scene: &str, settings: &[(&str, &str)], seeds: std::ops::Range<u64>) -> (f64, f64) {
    let mut scene = Scene::find(scene, settings).unwrap().scene;
    let (mut square, mut nees, mut all) = (0.0, 0.0, Vec::new());
    let n = seeds.clone().count() as f64;
    let shoot = Shoot::new(scene.clone()).unwrap();
    for seed in seeds {
        scene.seed = seed;
        let shoot = Shoot { scene: scene.clone(), ..shoot.clone() };
        let (error_m, one) = errors(&shoot.fly(&|_, _| {}).unwrap());
        square += error_m * error_m / n;
        nees += one / n;
        all.push(error_m);
    }
    all.sort_by(f64::total_cmp);
    println!("{settings:?}: {:.4} m, NEES {nees:.3}, {all:.4?}", square.sqrt());
    (square.sqrt(), nees)
}

const FIVE_LINKS: &str = "two-drones-three-anchors";
const FLOOR: &str = "two-drones-three-anchors-and-floor";

#[test]
fn print_table() {
    let n = 0..4;
    flown(FIVE_LINKS, &[], n.clone());
    flown(FLOOR, &[], n.clone());
    let barometer =
        [("sensors.heights", "[\"barometer\"]"), ("sensors.barometer.drift_m_sqrt_s", "0.0")];
    flown(FLOOR, &barometer, n.clone());
    flown(FIVE_LINKS, &[("sensors.uwb.heard", "[]")], n.clone());
    flown(FLOOR, &[("sensors.peers.loss_frac", "0.5")], n.clone());
    flown(FLOOR, &[("sensors.peers.loss_frac", "1.0")], n.clone());
    flown(FLOOR, &[("observer.cooperative.share", "estimates")], n.clone());
    flown(FLOOR, &[("observer.cooperative.share", "nothing")], n);
}
