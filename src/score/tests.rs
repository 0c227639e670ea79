//! The reader against photos drawn here: clean, faulty, and of other things than the word.

use nalgebra::Vector3;
use tiny_skia::Transform;

use super::*;
use crate::geometry::camera_from_world;
use crate::letters::{LetterOptions, Move, write};

/// A photo in the making: what is lit, in the plane of the word.
#[derive(Clone)]
struct Shot {
    moves: Vec<Move>,
    camera: Camera,
    trail_m: f64,
    glow_m: f64,
    /// Linear light of the trail and of the sky, 1 is white.
    light: f32,
    sky: f32,
    /// Standard deviation of the noise, sRGB codes.
    noise: f64,
}

/// A camera before the middle of the word that shows it with some room.
fn camera(strokes: &Strokes, width_px: u32, height_px: u32) -> Camera {
    let [left, bottom, right, top] = strokes.bounds_m();
    let middle = Vector3::new(0.5 * (left + right), 0.0, 0.5 * (bottom + top));
    let extent = (right - left).max((top - bottom) * 16.0 / 9.0) + 1.0;
    Camera {
        position_m: middle - Vector3::new(0.0, 0.035 / 0.036 * extent, 0.0),
        camera_from_world: camera_from_world(Vector3::y()),
        focal_length_m: 0.035,
        sensor_width_m: 0.036,
        f_number: 8.0,
        transmission: 0.9,
        blur_m: 0.0,
        iso: 100.0,
        shutter_open_s: 0.0,
        shutter_close_s: 60.0,
        width_px,
        height_px,
    }
}

fn word(text: &str) -> Strokes {
    write(text, &LetterOptions::default()).unwrap()
}

impl Shot {
    fn of(strokes: &Strokes) -> Self {
        Self {
            moves: strokes.glyphs.iter().flat_map(|glyph| glyph.moves.clone()).collect(),
            camera: camera(strokes, 960, 540),
            trail_m: 0.02,
            glow_m: 0.006,
            light: 1.0,
            sky: 0.004,
            noise: 1.0,
        }
    }

    fn shifted(mut self, x_m: f64, y_m: f64) -> Self {
        for step in &mut self.moves {
            for point in [&mut step.from_m, &mut step.to_m] {
                *point = [point[0] + x_m, point[1] + y_m];
            }
        }
        self
    }

    /// As a drone draws that trails its setpoint by `lag_m` along the path: corners are rounded,
    /// ends are not reached.
    fn trailing(mut self, lag_m: f64) -> Self {
        let piece_m = 0.005;
        let mut at = self.moves[0].from_m;
        let mut flown = Vec::new();
        for step in &self.moves {
            let [dx, dy] = [step.to_m[0] - step.from_m[0], step.to_m[1] - step.from_m[1]];
            let n_pieces = (libm::hypot(dx, dy) / piece_m).ceil();
            let mut piece = 1.0;
            while piece <= n_pieces {
                let part = piece / n_pieces;
                let goal = [step.from_m[0] + part * dx, step.from_m[1] + part * dy];
                let share = piece_m / lag_m;
                let to_m = [0, 1].map(|axis| at[axis] + share * (goal[axis] - at[axis]));
                flown.push(Move { from_m: at, to_m, lit: step.lit });
                at = to_m;
                piece += 1.0;
            }
        }
        self.moves = flown;
        self
    }

    /// Every lit run ends `missing_m` early.
    fn ending_early(mut self, missing_m: f64) -> Self {
        let lit: Vec<bool> = self.moves.iter().map(|step| step.lit).chain([false]).collect();
        let mut left_m = 0.0;
        for (index, step) in self.moves.iter_mut().enumerate().rev() {
            if step.lit && !lit[index + 1] {
                left_m = missing_m;
            }
            let length =
                libm::hypot(step.to_m[0] - step.from_m[0], step.to_m[1] - step.from_m[1]);
            if step.lit && left_m > 0.0 {
                let keep = (1.0 - left_m / length).max(0.0);
                left_m -= length;
                step.lit = keep > 0.0;
                step.to_m =
                    [0, 1].map(|a| step.from_m[a] + keep * (step.to_m[a] - step.from_m[a]));
            }
        }
        self
    }

    /// Exposes it.
    fn photo(&self) -> Photo {
        let camera = &self.camera;
        let project = |[x, y]: [f64; 2]| {
            let point = camera.image_from_world(Vector3::new(x, 0.0, y)).unwrap();
            [point.x_px, point.y_px]
        };
        let seen: Vec<Move> = self
            .moves
            .iter()
            .map(|step| Move {
                from_m: project(step.from_m),
                to_m: project(step.to_m),
                lit: step.lit,
            })
            .collect();
        let [a, b] = [project([0.0, 0.0]), project([0.01, 0.0])];
        let px_per_m = 100.0 * libm::hypot(b[0] - a[0], b[1] - a[1]);
        let mut page = Page::blank(camera.width_px as usize, camera.height_px as usize);
        page.stroke(&seen, (self.trail_m * px_per_m) as f32, Transform::identity());
        let mut raster = page.dry().blur((self.glow_m * px_per_m).max(0.3) as f32);
        for value in &mut raster.values {
            *value = *value * self.light + self.sky;
        }
        develop(&raster, self.noise)
    }

    fn verdict(&self, strokes: &Strokes) -> Verdict {
        score(&self.photo(), strokes, &self.camera, &ScoreOptions::default()).unwrap()
    }
}

/// sRGB with noise from a fixed seed (a linear congruential generator; twelve uniforms a Gaussian).
fn develop(linear: &Raster, noise: f64) -> Photo {
    let mut state = 1_u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 40) as f64 / (1 << 24) as f64
    };
    let encode = |value: f32| {
        let value = f64::from(value).clamp(0.0, 1.0);
        if value <= 0.003_130_8 {
            12.92 * value
        } else {
            1.055 * libm::pow(value, 1.0 / 2.4) - 0.055
        }
    };
    let rgb8 = linear.values.iter().flat_map(|value| {
        let code = 255.0 * encode(*value);
        let gauss = (0..4).map(|_| uniform()).sum::<f64>() - 2.0;
        [(code + noise * 1.73 * gauss).round().clamp(0.0, 255.0) as u8; 3]
    });
    Photo {
        width_px: linear.width as u32,
        height_px: linear.height as u32,
        rgb8: rgb8.collect(),
        scene_toml: None,
    }
}

fn show(name: &str, v: &Verdict) {
    println!(
        "{name}: {} read {} P {:.3} legible {} {:?} {:?}",
        v.word, v.read, v.probability, v.legible, v.placement, v.reason
    );
    for l in &v.letters {
        println!(
            "   {} best {:?} second {:?} margin {:.3} sim {:.3} p {:.3}",
            l.expected, l.best, l.runner_up, l.margin, l.similarity, l.p
        );
    }
}

#[test]
fn explore() {
    let noor = word("NOOR");
    let shot = Shot::of(&noor);
    show("clean", &shot.verdict(&noor));
    show("shifted", &shot.clone().shifted(-0.07, 0.0).verdict(&noor));
    show("trailing 6cm", &shot.clone().trailing(0.06).verdict(&noor));
    show("trailing 10cm", &shot.clone().trailing(0.10).verdict(&noor));
    show("early", &shot.clone().ending_early(0.10).verdict(&noor));
    show("all three", &shot.clone().trailing(0.06).ending_early(0.1).shifted(-0.07, 0.0).verdict(&noor));
    let tree = Shot { camera: shot.camera.clone(), ..Shot::of(&word("TREE")) };
    show("TREE", &tree.verdict(&noor));
    let blank = Shot { moves: vec![], ..shot.clone() };
    show("blank", &blank.verdict(&noor));
    for c in 'A'..='Z' {
        let w = word(&c.to_string());
        show("letter", &Shot::of(&w).verdict(&w));
    }
}

#[test]
fn timing() {
    let noor = word("NOOR");
    let camera = camera(&noor, 1920, 1080);
    let photo = Shot { camera: camera.clone(), ..Shot::of(&noor) }.photo();
    for _ in 0..5 {
        let start = std::time::Instant::now();
        let v = score(&photo, &noor, &camera, &ScoreOptions::default()).unwrap();
        println!("{:?} {}", start.elapsed(), v.read);
    }
}
