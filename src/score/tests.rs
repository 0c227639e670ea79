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
            let length = libm::hypot(step.to_m[0] - step.from_m[0], step.to_m[1] - step.from_m[1]);
            if step.lit && left_m > 0.0 {
                let keep = (1.0 - left_m / length).max(0.0);
                left_m -= length;
                step.lit = keep > 0.0;
                step.to_m = [0, 1].map(|a| step.from_m[a] + keep * (step.to_m[a] - step.from_m[a]));
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
    show(
        "all three",
        &shot.clone().trailing(0.06).ending_early(0.1).shifted(-0.07, 0.0).verdict(&noor),
    );
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

#[test]
fn contact_sheet() {
    let bank = Bank::draw(0.6, "ae483", References::Both).unwrap();
    let l = &bank.layout;
    let per_row = 28;
    let n = bank.templates.len();
    let rows = n.div_ceil(per_row);
    let mut img = image::GrayImage::new((per_row * l.width) as u32, (rows * l.height) as u32);
    for (i, t) in bank.templates.iter().enumerate() {
        for y in 0..l.height {
            for x in 0..l.width {
                let v = (t.pages[0].values[y * l.width + x] * 255.0).min(255.0) as u8;
                img.put_pixel(
                    ((i % per_row) * l.width + x) as u32,
                    ((i / per_row) * l.height + y) as u32,
                    image::Luma([v]),
                );
            }
        }
    }
    img.save("/tmp/score_sheet.png").unwrap();
    let noor = word("NOOR");
    let p = Shot::of(&noor).trailing(0.06).ending_early(0.1).shifted(-0.07, 0.0).photo();
    image::RgbImage::from_raw(p.width_px, p.height_px, p.rgb8)
        .unwrap()
        .save("/tmp/score_noor.png")
        .unwrap();
    println!("{n}");
}

fn box_of(strokes: &Strokes, full: bool) -> Vec<Move> {
    let [l, b, r, t] = strokes.bounds_m();
    let mut moves = vec![];
    if full {
        let mut y = b;
        while y <= t {
            moves.push(Move { from_m: [l, y], to_m: [r, y], lit: true });
            y += 0.01;
        }
    }
    moves
}

fn scribble(strokes: &Strokes, seed: u64, n: usize) -> Vec<Move> {
    let [l, b, r, t] = strokes.bounds_m();
    let mut state = seed;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1442695040888963407);
        (state >> 40) as f64 / (1 << 24) as f64
    };
    let mut at = [l, b];
    (0..n)
        .map(|_| {
            let to_m = [l + (r - l) * uniform(), b + (t - b) * uniform()];
            let m = Move { from_m: at, to_m, lit: true };
            at = to_m;
            m
        })
        .collect()
}

fn brief(name: &str, v: &Verdict) {
    let sims: Vec<String> = v.letters.iter().map(|l| format!("{:.2}", l.similarity)).collect();
    println!(
        "{name}: {} read {} P {:.3} legible {} {:?} sims {}",
        v.word,
        v.read,
        v.probability,
        v.legible,
        v.reason,
        sims.join(" ")
    );
}

#[test]
fn adversaries() {
    for text in ["NOOR", "O", "I", "A", "B", "M", "HI"] {
        let w = word(text);
        let shot = Shot::of(&w);
        brief("box", &Shot { moves: box_of(&w, true), ..shot.clone() }.verdict(&w));
        for n in [4, 8, 20, 60, 200] {
            for seed in 1..6 {
                brief(
                    &format!("scribble {n}"),
                    &Shot { moves: scribble(&w, seed, n), ..shot.clone() }.verdict(&w),
                );
            }
        }
    }
}

#[test]
fn pairs() {
    for pair in [
        "EF", "OQ", "PR", "BD", "CG", "OC", "UV", "MN", "HN", "IT", "IL", "XY", "VY", "KX", "SZ",
        "OD", "OU", "BE", "FP", "HM", "JT", "WM", "GS", "AH", "LC", "QR",
    ] {
        let c: Vec<char> = pair.chars().collect();
        for (shown, meant) in [(c[0], c[1]), (c[1], c[0])] {
            let m = word(&format!("N{meant}E"));
            let s = word(&format!("N{shown}E"));
            brief(&format!("shown {shown} meant {meant}"), &Shot::of(&s).verdict(&m));
        }
    }
}

#[test]
fn typeface_only() {
    for c in 'A'..='Z' {
        let w = word(&c.to_string());
        let shot = Shot::of(&w);
        let v = score(
            &shot.photo(),
            &w,
            &shot.camera,
            &ScoreOptions { references: References::Typeface, ..Default::default() },
        )
        .unwrap();
        show("typeface", &v);
    }
}

#[test]
fn scribble_a() {
    let w = word("A");
    let shot = Shot { moves: scribble(&w, 4, 20), ..Shot::of(&w) };
    let p = shot.photo();
    image::RgbImage::from_raw(p.width_px, p.height_px, p.rgb8)
        .unwrap()
        .save("/tmp/score_a.png")
        .unwrap();
    show("a", &shot.verdict(&w));
}

#[test]
fn real_photo() {
    let img = image::open("/work/shared/data/ae483/noor_photo.png").unwrap().to_rgb8();
    let photo = Photo {
        width_px: img.width(),
        height_px: img.height(),
        rgb8: img.into_raw(),
        scene_toml: None,
    };
    let noor = word("NOOR");
    let mut camera = camera(&noor, photo.width_px, photo.height_px);
    // The letters' left edges stand near x = 285 (N) and 690 (R) px: 1.2 m are 405 px; the lower edge near 215 px.
    let px_per_m = 405.0 / 1.2;
    let distance = 3.0;
    camera.sensor_width_m = 0.036;
    camera.focal_length_m = px_per_m * distance * camera.sensor_width_m / f64::from(photo.width_px);
    let x0 = -0.6 + (f64::from(photo.width_px) / 2.0 - 300.0) / px_per_m;
    let z0 = 0.5 + (215.0 - f64::from(photo.height_px) / 2.0) / px_per_m;
    camera.position_m = Vector3::new(x0, -distance, z0);
    show("real", &score(&photo, &noor, &camera, &ScoreOptions::default()).unwrap());
    for other in ["TREE", "MOON", "NOON", "NEAR", "LOOP"] {
        let w = word(other);
        show("real", &score(&photo, &w, &camera, &ScoreOptions::default()).unwrap());
    }
}

fn wandering(shot: &Shot, sigma: f64, seed: u64) -> Shot {
    let mut state = seed;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1442695040888963407);
        (state >> 40) as f64 / (1 << 24) as f64
    };
    let mut shot = shot.clone().trailing(0.02);
    let mut off = [0.0, 0.0];
    // correlation 0.14 m of path, pieces of 5 mm
    let keep = libm::exp(-0.005 / 0.144_f64);
    for m in &mut shot.moves {
        let before = off;
        for o in &mut off {
            let g = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
            *o = keep * *o + sigma * libm::sqrt(1.0 - keep * keep) * g;
        }
        m.from_m = [m.from_m[0] + before[0], m.from_m[1] + before[1]];
        m.to_m = [m.to_m[0] + off[0], m.to_m[1] + off[1]];
    }
    shot
}

#[test]
fn wander() {
    for sigma in [0.01, 0.02, 0.03, 0.05, 0.075, 0.1] {
        for text in ["NOOR", "TREE", "LIGHT", "MOON", "QUIZ", "DRONE"] {
            let w = word(text);
            brief(&format!("wander {sigma}"), &wandering(&Shot::of(&w), sigma, 7).verdict(&w));
        }
    }
    let w = word("NOOR");
    let shot = wandering(&Shot::of(&w), 0.05, 7);
    let p = shot.photo();
    image::RgbImage::from_raw(p.width_px, p.height_px, p.rgb8)
        .unwrap()
        .save("/tmp/score_w.png")
        .unwrap();
}
