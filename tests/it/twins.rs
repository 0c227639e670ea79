//! Tests that both backends produce the same film bit by bit, with the digests in
//! `golden/expose/films.txt`. The lamps move according to formulas, so that only changes of the
//! exposure affect the film.

use std::fmt::Write;

use nalgebra::Vector3;
use noctograph::camera::{Camera, CameraOptions, CustomLens, FixedPose, Framing, LensModel};
use noctograph::expose::{BackendChoice, ExposeOptions, expose};
use noctograph::light::{Emitter, Lamp, LightSample, LightTrace, LightTraceData};

use crate::golden::assert_golden;
use crate::gpu_required;

/// Returns a lamp that moves along a figure eight, starting at a phase, sampled at `hz` for
/// `duration_s`.
fn figure(duration_s: u32, hz: u32, phase: f64, rgb: [f64; 3]) -> Lamp {
    let emitter = Emitter {
        name: "figure".into(),
        intensity_cd: 1.8,
        rgb,
        beam_exponent: 1.0,
        isotropic_fraction: 0.05,
        visible_cos: -1.0,
        diameter_m: 0.003,
        depth_m: None,
    };
    let samples = (0..=duration_s * hz).map(|i| {
        let t = f64::from(i) / f64::from(hz);
        let s = 0.4 * t + phase;
        let position = [1.2 * libm::sin(s), 0.1 * libm::sin(3.1 * s), 0.6 * libm::sin(2.0 * s)];
        let axis = -Vector3::y();
        LightSample { time_s: t, position_m: position.into(), axis, level: 1.0 }
    });
    Lamp { drone: None, emitter, samples: samples.collect() }
}

fn fixed(position_m: [f64; 3], target_m: [f64; 3]) -> Framing {
    Framing::Fixed(FixedPose { position_m, target_m: Some(target_m), ..FixedPose::default() })
}

fn camera(change: impl FnOnce(&mut CameraOptions)) -> Camera {
    let mut options = CameraOptions {
        framing: fixed([0.0, -4.0, 0.0], [0.0; 3]),
        width_px: 480,
        height_px: 270,
        ..CameraOptions::default()
    };
    change(&mut options);
    options.camera([0.0; 4], 120.0).unwrap()
}

const WHITE: [f64; 3] = [1.0; 3];

/// Sets the level of each sample as a function of its time.
fn leveled(mut lamp: Lamp, level: impl Fn(f64) -> f64) -> Lamp {
    lamp.samples.iter_mut().for_each(|sample| sample.level = level(sample.time_s));
    lamp
}

#[test]
fn golden_films_are_the_same_on_both_backends() {
    let usual = || camera(|_| {});
    let one = || vec![figure(8, 250, 0.0, WHITE)];
    let three = |duration_s, hz| {
        let colors = [[4.7, 0.0, 0.0], [0.0, 1.4, 0.0], [0.3, 0.9, 2.2]];
        let phases = [0.0, 0.7, 1.9];
        colors.iter().zip(phases).map(|(rgb, phase)| figure(duration_s, hz, phase, *rgb)).collect()
    };
    let pulses = |t: f64| if (t * 10.0).fract() < 0.5 { 1.0 } else { 0.1 };
    let at = |merge_tolerance_px| ExposeOptions { merge_tolerance_px, ..Default::default() };
    let room = ExposeOptions {
        floor_z_m: -1.0,
        floor_roughness: Some(0.3),
        room_m: Some([4.0, 4.0, 2.5]),
        ..at(0.005)
    };
    let scenes: Vec<(&str, Vec<Lamp>, Camera, ExposeOptions)> = vec![
        ("merged", one(), usual(), at(0.005)),
        ("unmerged", one(), usual(), at(0.0)),
        ("coarsely merged", one(), usual(), at(0.5)),
        ("three drones", three(8, 250), usual(), at(0.005)),
        ("120 s", three(120, 50), usual(), at(0.005)),
        ("ramps", vec![leveled(one().remove(0), |t| t / 8.0)], usual(), at(0.005)),
        ("decay", vec![leveled(one().remove(0), |t| libm::exp(-t))], usual(), at(0.0)),
        ("pulses", vec![leveled(three(8, 250).remove(2), pulses)], usual(), at(0.005)),
        ("4K", one(), camera(|c| (c.width_px, c.height_px) = (3840, 2160)), at(0.005)),
        (
            "clipped",
            one(),
            camera(|c| c.framing = fixed([0.0, -4.0, 0.0], [1.2, 0.0, 0.6])),
            at(0.005),
        ),
        ("near", one(), camera(|c| c.framing = fixed([0.9, -0.4, 0.2], [0.0; 3])), at(0.005)),
        ("out of focus", one(), camera(|c| (c.focus_m, c.f_number) = (Some(0.5), 2.0)), at(0.005)),
        (
            "distorted, dark corners",
            one(),
            camera(|c| {
                let distortion = [-0.2, 0.05, 0.002, -0.001];
                c.lens = LensModel::Custom(CustomLens { distortion, ..CustomLens::default() });
                c.vignetting = Some(0.7);
            }),
            at(0.005),
        ),
        (
            "a moment",
            one(),
            camera(|c| (c.shutter_open_s, c.shutter_close_s) = (1.0, Some(1.0101))),
            at(0.005),
        ),
        ("a room", one(), camera(|c| c.framing = fixed([0.3, -3.0, 0.2], [0.0; 3])), room),
    ];
    let mut digests = String::new();
    for (name, lamps, camera, options) in scenes {
        let trace = LightTrace::made(LightTraceData { lamps });
        let on = |backend| expose(&trace, &camera, &options, backend);
        let on_cpu = on(BackendChoice::Cpu).unwrap().film;
        assert!(on_cpu.light_lx_s_px2(2) > 0.0, "{name}: there is light");
        match on(BackendChoice::Wgpu) {
            Ok(on_gpu) => assert!(on_gpu.film == on_cpu, "{name} differs on {}", on_gpu.adapter),
            Err(e) => assert!(!gpu_required(), "{name}: {e}"),
        }
        let light = [0, 1, 2].map(|color| on_cpu.light_lx_s_px2(color));
        writeln!(digests, "{}  {name}: light {light:.3?} lx s px2", on_cpu.sha256()).unwrap();
    }
    assert_golden("expose/films.txt", &digests);
}
