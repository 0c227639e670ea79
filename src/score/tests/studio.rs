//! Photos for the tests. A camera renders the lit lines in the word's plane, glow and noise are
//! added, and the photo is encoded. Faults of flights are drawn as they look, not simulated.

use nalgebra::Vector3;
use tiny_skia::Transform;

use super::super::raster::{Page, Raster};
use super::super::{Known, Reader, ScoreOptions, Verdict};
use noctograph_core::camera::Camera;
use noctograph_core::error::Result;
use noctograph_core::geometry::camera_from_world;
use noctograph_core::photo::{Photo, PhotoData};
use noctograph_core::srgb::encoded_from_linear;
use noctograph_core::strokes::{Move, Strokes};
use noctograph_letters::{LetterOptions, write};

/// The parameters of a photo.
#[derive(Clone)]
pub(super) struct Shot {
    /// The lit lines, in the plane of the word.
    pub(super) moves: Vec<Move>,
    pub(super) camera: Camera,
    /// Linear light of the trail and of the sky, where 1 is white.
    pub(super) light: f32,
    pub(super) sky: f32,
    /// Linear light of a glow at the lower edge, which fades over a third of the photo's height.
    pub(super) floor_glow: f32,
    /// Linear light at the center of a soft spot on a lit wall to the right of the word.
    pub(super) wall: f32,
    /// Relative light of red, green and blue.
    pub(super) tint: [f32; 3],
    /// Standard deviation of the noise in sRGB codes.
    pub(super) noise: f64,
}

/// Generator of reproducible random numbers from 0 to 1.
pub(super) struct Dice(pub(super) u64);

impl Dice {
    pub(super) fn roll(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963);
        (self.0 >> 40) as f64 / f64::from(1 << 24)
    }

    /// Returns an approximately normal number with mean 0 and standard deviation 1.
    fn gauss(&mut self) -> f64 {
        ((0..3).map(|_| self.roll()).sum::<f64>() - 1.5) * 2.0
    }
}

/// Returns a word in the team's font.
pub(super) fn word(text: &str) -> Strokes {
    write(text, &LetterOptions::default()).unwrap()
}

/// Returns a camera that faces the word's center from an angle, and sees half a meter more than the
/// word.
pub(super) fn camera(strokes: &Strokes, width_px: u32, angle_rad: f64) -> Camera {
    let [left, bottom, right, top] = strokes.bounds_m();
    let middle = Vector3::new(0.5 * (left + right), 0.0, 0.5 * (bottom + top));
    let extent_m = (right - left).max((top - bottom) * 16.0 / 9.0) + 1.0;
    let (sin, cos) = libm::sincos(angle_rad);
    let forward = Vector3::new(sin, cos, 0.0);
    Camera {
        position_m: middle - forward * (0.035 / 0.036 * extent_m),
        camera_from_world: camera_from_world(forward),
        focal_length_m: 0.035,
        sensor_width_m: 0.036,
        f_number: 8.0,
        transmission: 0.9,
        blur_m: 0.0,
        focus_m: None,
        distortion: [0.0; 4],
        vignetting: 0.0,
        white_balance: [1.0; 3],
        iso: 100.0,
        base_iso: 100.0,
        shutter_open_s: 0.0,
        shutter_close_s: 60.0,
        width_px,
        height_px: width_px * 9 / 16,
    }
}

/// Returns the verdict on a photo.
pub(super) fn score(
    photo: &Photo,
    strokes: &Strokes,
    camera: &Camera,
    options: &ScoreOptions,
) -> Result<Verdict> {
    Reader::new(strokes, options)?.score(photo, &camera.into())
}

fn sq(value: f32) -> f32 {
    value * value
}

impl Shot {
    /// Creates a shot of a faultless word.
    pub(super) fn new(strokes: &Strokes) -> Self {
        Self {
            moves: strokes.glyphs.iter().flat_map(|glyph| glyph.moves.clone()).collect(),
            camera: camera(strokes, 480, 0.0),
            light: 1.0,
            sky: 0.004,
            floor_glow: 0.0,
            wall: 0.0,
            tint: [1.0; 3],
            noise: 1.0,
        }
    }

    /// Returns the shot with the same camera and other lit lines.
    pub(super) fn showing(&self, moves: Vec<Move>) -> Self {
        Self { moves, ..self.clone() }
    }

    pub(super) fn mapped(mut self, map: impl Fn([f64; 2]) -> [f64; 2]) -> Self {
        for step in &mut self.moves {
            (step.from_m, step.to_m) = (map(step.from_m), map(step.to_m));
        }
        self
    }

    pub(super) fn shifted(self, right_m: f64, up_m: f64) -> Self {
        self.mapped(|[x, y]| [x + right_m, y + up_m])
    }

    /// Draws the word like a drone that trails its setpoint along the path: corners are rounded,
    /// the ends of strokes are missing, and jumps are lit.
    pub(super) fn trailing(mut self, lag_m: f64) -> Self {
        let piece_m = 0.005;
        let mut pen_m = self.moves[0].from_m;
        let mut flown = Vec::new();
        for step in &self.moves {
            let [dx, dy] = [0, 1].map(|axis| step.to_m[axis] - step.from_m[axis]);
            let n_pieces = (libm::hypot(dx, dy) / piece_m).ceil() as u32;
            for piece in 1..=n_pieces {
                let part = f64::from(piece) / f64::from(n_pieces);
                let goal = [step.from_m[0] + part * dx, step.from_m[1] + part * dy];
                let to_m =
                    [0, 1].map(|axis| pen_m[axis] + piece_m / lag_m * (goal[axis] - pen_m[axis]));
                flown.push(Move { from_m: pen_m, to_m, lit: step.lit, pace: 1.0 });
                pen_m = to_m;
            }
        }
        self.moves = flown;
        self
    }

    /// Removes the end of every lit run.
    pub(super) fn ending_early(mut self, missing_m: f64) -> Self {
        let mut left_m = missing_m;
        for step in self.moves.iter_mut().rev() {
            if !step.lit {
                left_m = missing_m;
            } else if left_m > 0.0 {
                let [dx, dy] = [0, 1].map(|axis| step.to_m[axis] - step.from_m[axis]);
                let length_m = libm::hypot(dx, dy);
                let keep = (1.0 - left_m / length_m).max(0.0);
                left_m -= length_m;
                step.lit = keep > 0.0;
                step.to_m = [step.from_m[0] + keep * dx, step.from_m[1] + keep * dy];
            }
        }
        self
    }

    /// Adds a wandering error of standard deviation `sigma_m`, correlated over 0.14 m of path.
    pub(super) fn wandering(self, sigma_m: f64) -> Self {
        let mut flown = self.trailing(0.01);
        let keep = libm::exp(-0.005 / 0.14_f64);
        let (mut dice, mut offset_m) = (Dice(7), [0.0; 2]);
        for step in &mut flown.moves {
            step.from_m = [0, 1].map(|axis| step.from_m[axis] + offset_m[axis]);
            offset_m =
                offset_m.map(|o| keep * o + sigma_m * libm::sqrt(1.0 - keep * keep) * dice.gauss());
            step.to_m = [0, 1].map(|axis| step.to_m[axis] + offset_m[axis]);
        }
        flown
    }

    pub(super) fn verdict(&self, strokes: &Strokes) -> Verdict {
        score(&self.photo(), strokes, &self.camera, &ScoreOptions::default()).unwrap()
    }

    pub(super) fn explained(&self, strokes: &Strokes, known: &Known) -> Verdict {
        let reader = Reader::new(strokes, &ScoreOptions::default()).unwrap();
        reader.explain(&self.photo(), &(&self.camera).into(), known).unwrap().0
    }

    /// Exposes and encodes the photo. The trails are 2 cm wide, with 6 mm of glow around them.
    pub(super) fn photo(&self) -> Photo {
        let camera = &self.camera;
        let seen = |[x, y]: [f64; 2]| {
            let point = camera.image_from_world(Vector3::new(x, 0.0, y)).unwrap();
            [point.x_px, point.y_px]
        };
        let on_photo =
            |step: &Move| Move { from_m: seen(step.from_m), to_m: seen(step.to_m), ..*step };
        let moves: Vec<Move> = self.moves.iter().map(on_photo).collect();
        let [_, y] = seen([0.0, 0.0]);
        let px_per_m = (y - seen([0.0, 1.0])[1]) as f32;
        let mut page = Page::blank(camera.width_px as usize, camera.height_px as usize);
        page.stroke(&moves, 0.02 * px_per_m, Transform::identity());
        let mut linear = page.into_raster().blur((0.006 * px_per_m).max(0.3));
        let (width, height) = (linear.width, linear.height);
        for (index, value) in linear.values.iter_mut().enumerate() {
            let above = (height - index / width) as f32 / height as f32;
            let aside = (index % width) as f32 / width as f32 - 0.93;
            let spot = libm::expf(-0.5 * (sq(aside / 0.03) + sq((above - 0.5) / 0.2)));
            let glow = self.floor_glow * libm::expf(-3.0 * above) + self.wall * spot;
            *value = self.light * *value + self.sky + glow;
        }
        self.develop(&linear)
    }

    fn develop(&self, linear: &Raster) -> Photo {
        let mut dice = Dice(1);
        let mut encode = |value: f32| {
            let encoded = encoded_from_linear(f64::from(value).clamp(0.0, 1.0));
            (255.0 * encoded + self.noise * dice.gauss()).round().clamp(0.0, 255.0) as u8
        };
        let rgb8 =
            linear.values.iter().flat_map(|value| self.tint.map(|tint| encode(tint * value)));
        Photo::made(PhotoData {
            rgb8: rgb8.collect(),
            width_px: self.camera.width_px,
            height_px: self.camera.height_px,
            scene_toml: None,
        })
    }
}
