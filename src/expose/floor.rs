//! The floor's glow: light that falls from the lamps on the floor, as the camera sees it there.
//!
//! A matt floor of albedo ρ under an exposure of E lx s looks like a surface of `ρ E / π` cd s/m²
//! from everywhere, and leaves `ρ τ E cos⁴ / (4 N²)` lx s on the sensor. E is the sum of
//! `I(θ) cos / d²` over all lamps and moments (Lambert; inverse squares).
//!
//! 1. Moments of lamps that shine alike become a tree (Barnes and Hut 1986): a branch that is small
//!    beside its distance stands for all its moments.
//! 2. The picture is cut into squares; a square is quartered until its corners tell its middle and
//!    no lamp hangs over it lower than it is wide.
//! 3. Corner to corner, light runs bilinearly, and is counted with the film's dither.
//!
//! Not modelled: shine of a polished floor, walls, the drone's own shadow.

use std::ops::Range;

use nalgebra::Vector3;

use super::project::NEAREST_M;
use super::record::DITHER;
use super::{ExposeOptions, Film};
use crate::camera::Camera;
use crate::light::{Emitter, LightSample, LightTrace};

/// Lamps are at least this far above the floor: half the thickness of an LED's package. Deep in
/// the floor there is no lamp, but a flight's own zero may be off by centimetres.
const LOWEST_M: f64 = 0.002;

/// A branch stands for its moments where its radius is less than this share of its distance. At 0.3
/// an evenly filled branch errs by 4 % straight below it, and by less elsewhere.
const OPENING: f64 = 0.3;

/// Edge of the squares at first, and at last.
const SQUARE_PX: [u32; 2] = [32, 1];

/// Squares that are worth a thread of their own: a few milliseconds.
const THREAD_SQUARES: usize = 512;

/// How far a square's middle may lie from the mean of its corners: as a share of itself (a level of
/// 8 bits), and in shares of saturation (a fifth of what a camera's tone shows as black).
const EVEN: [f64; 2] = [0.02, 1e-4];

/// Glow on the picture.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Glow {
    squares: Vec<Square>,
    /// Brightest corner, in lx s.
    pub(super) peak_lx_s: f64,
}

/// A square of the picture and its light in lx s at its corners: top left, top right, bottom left,
/// bottom right; red, green, blue.
#[derive(Clone, Debug, PartialEq)]
struct Square {
    corner_px: [u32; 2],
    side_px: u32,
    light_lx_s: [[f64; 3]; 4],
}

/// Where a branch's light falls straight down.
#[derive(Clone, Copy, Debug)]
struct Foot {
    at_px: [f64; 2],
    height_px: f64,
}

/// Light of a moment, or of many.
#[derive(Clone, Copy, Debug, Default)]
struct Source {
    position_m: Vector3<f64>,
    axis: Vector3<f64>,
    /// On the axis, red, green, blue.
    light_cd_s: [f64; 3],
}

/// A branch of the tree; its own branches follow it.
#[derive(Clone, Copy, Debug)]
struct Branch {
    source: Source,
    /// No moment of it is farther from its source than twice this.
    radius_m: f64,
    /// The first branch that is not its own.
    next: usize,
}

/// All light of lamps of one pattern that point the same way.
#[derive(Debug)]
struct Tree<'a> {
    pattern: &'a Emitter,
    branches: Vec<Branch>,
}

impl Glow {
    /// The glow of a trace; `None` where the floor is dark, or the camera does not stand above it.
    pub(super) fn new(
        trace: &LightTrace,
        camera: &Camera,
        options: &ExposeOptions,
    ) -> Option<Self> {
        let ExposeOptions { floor_albedo, floor_z_m, .. } = *options;
        if floor_albedo == 0.0 || camera.position_m.z < floor_z_m + NEAREST_M {
            return None;
        }
        let trees = trees(trace, camera, floor_z_m);
        let n = camera.f_number;
        let of_exposure = floor_albedo * camera.transmission / (4.0 * n * n);
        let seen = |x: u32, y: u32| {
            let (x_px, y_px) = (f64::from(x), f64::from(y));
            let dark = [0.0; 3];
            let Some(ray) = camera.world_from_image(x_px, y_px) else { return dark };
            let down_m = camera.position_m.z - floor_z_m;
            if ray.z > -1e-9 {
                return dark;
            }
            let point_m = camera.position_m + ray * (down_m / -ray.z);
            let cos = (camera.camera_from_world * ray).z;
            let share = of_exposure * cos * cos * cos * cos * camera.unvignetted(x_px, y_px);
            exposure_lx_s(&trees, point_m).map(|channel| channel * share)
        };
        let even = EVEN[1] * camera.saturation_lx_s();
        let branches = trees.iter().flat_map(|tree| &tree.branches);
        let feet: Vec<Foot> =
            branches.filter_map(|branch| foot(&branch.source, camera, floor_z_m)).collect();
        let side = SQUARE_PX[0];
        let columns: Vec<u32> = (0..=camera.width_px.div_ceil(side)).map(|i| i * side).collect();
        let on_rows = |rows: Range<u32>| {
            let mut glow = Self { squares: Vec::new(), peak_lx_s: 0.0 };
            let mut above: Vec<[f64; 3]> =
                columns.iter().map(|&x| seen(x, rows.start * side)).collect();
            for y in rows.map(|row| row * side) {
                let below: Vec<[f64; 3]> = columns.iter().map(|&x| seen(x, y + side)).collect();
                for (i, &x) in columns[..columns.len() - 1].iter().enumerate() {
                    let light_lx_s = [above[i], above[i + 1], below[i], below[i + 1]];
                    let square = Square { corner_px: [x, y], side_px: side, light_lx_s };
                    glow.cut(square, &feet, &seen, even);
                }
                above = below;
            }
            glow
        };
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let rows = camera.height_px.div_ceil(side);
        let worth = columns.len() * rows as usize / THREAD_SQUARES;
        let band = rows.div_ceil(u32::try_from(worth.clamp(1, cores)).unwrap_or(1));
        if band >= rows {
            return on_rows(0..rows).lit();
        }
        let bands = (0..rows).step_by(band as usize).map(|row| row..rows.min(row + band));
        let mut glow = Self { squares: Vec::new(), peak_lx_s: 0.0 };
        std::thread::scope(|scope| {
            let on_rows = &on_rows;
            let works: Vec<_> = bands.map(|band| scope.spawn(move || on_rows(band))).collect();
            for work in works {
                let part = work.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
                glow.peak_lx_s = glow.peak_lx_s.max(part.peak_lx_s);
                glow.squares.extend(part.squares);
            }
        });
        glow.lit()
    }

    /// Itself, unless it is dark.
    fn lit(self) -> Option<Self> {
        (!self.squares.is_empty()).then_some(self)
    }

    /// Keeps a square, or its quarters.
    fn cut(
        &mut self,
        square: Square,
        feet: &[Foot],
        seen: &impl Fn(u32, u32) -> [f64; 3],
        even: f64,
    ) {
        let Square { corner_px: [x, y], side_px, light_lx_s: [nw, ne, sw, se] } = square;
        let half = side_px / 2;
        let middle = seen(x + half, y + half);
        let under_lamp = feet.iter().any(|foot| foot.is_under(&square));
        let uneven = (0..3).any(|c| {
            let mean = 0.25 * (nw[c] + ne[c] + sw[c] + se[c]);
            (middle[c] - mean).abs() > EVEN[0] * middle[c].max(mean) + even
        });
        if half < SQUARE_PX[1] || !(uneven || under_lamp) {
            let brightest = square.light_lx_s.iter().flatten().copied().fold(0.0, f64::max);
            if brightest > 0.0 {
                self.peak_lx_s = self.peak_lx_s.max(brightest);
                self.squares.push(square);
            }
            return;
        }
        let (north, south) = (seen(x + half, y), seen(x + half, y + side_px));
        let (west, east) = (seen(x, y + half), seen(x + side_px, y + half));
        let quarters = [
            ([x, y], [nw, north, west, middle]),
            ([x + half, y], [north, ne, middle, east]),
            ([x, y + half], [west, middle, sw, south]),
            ([x + half, y + half], [middle, east, south, se]),
        ];
        for (corner_px, light_lx_s) in quarters {
            self.cut(Square { corner_px, side_px: half, light_lx_s }, feet, seen, even);
        }
    }

    /// Adds the glow to a film.
    pub(super) fn add_to(&self, film: &mut Film) {
        let per_lx_s = libm::ldexp(1.0, -film.scale_log2);
        let (width, height) = (film.width_px, film.height_px);
        let pixels = width as usize * height as usize;
        std::thread::scope(|scope| {
            for (channel, plane) in film.counts.chunks_exact_mut(pixels).enumerate() {
                let size_px = [width, height];
                let squares = &self.squares;
                let paint = Paint { squares, channel, per_lx_s, plane, size_px };
                scope.spawn(move || pulp::Arch::new().dispatch(paint));
            }
        });
    }
}

/// A plane of the film while the glow is added to it, in the widest registers of this processor; no
/// product is fused with a sum, so all leave the same bits.
struct Paint<'a> {
    squares: &'a [Square],
    channel: usize,
    per_lx_s: f64,
    plane: &'a mut [u32],
    size_px: [u32; 2],
}

impl pulp::NullaryFnOnce for Paint<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        for square in self.squares {
            let light = square.light_lx_s;
            let counts = light.map(|light| narrow(light[self.channel] * self.per_lx_s));
            square.add_to(counts, self.plane, self.size_px);
        }
    }
}

impl Square {
    /// Adds its light, given in counts at the corners, to a plane.
    #[inline(always)]
    fn add_to(&self, [nw, ne, sw, se]: [f32; 4], plane: &mut [u32], [width, height]: [u32; 2]) {
        let [x, y] = self.corner_px;
        let step = 1.0 / self.side_px as f32;
        let across = self.side_px.min(width.saturating_sub(x));
        if across == 0 {
            return;
        }
        for row in y..(y + self.side_px).min(height) {
            let down = ((row - y) as f32 + 0.5) * step;
            let (left, right) = (nw + (sw - nw) * down, ne + (se - ne) * down);
            let slope = (right - left) * step;
            let first = row as usize * width as usize + x as usize;
            let dither = DITHER[0].wrapping_mul(x).wrapping_add(DITHER[1].wrapping_mul(row));
            for (i, count) in (0..across.cast_signed()).zip(&mut plane[first..]) {
                let light = left + slope * (i as f32 + 0.5);
                let dither = dither.wrapping_add(DITHER[0].wrapping_mul(i.cast_unsigned()));
                let part = (dither >> 8).cast_signed() as f32 * (1.0 / 16_777_216.0);
                *count = count.wrapping_add(whole(light + part));
            }
        }
    }
}

impl Foot {
    /// Whether it stands in a square or close to it, lower than the square is wide.
    fn is_under(&self, square: &Square) -> bool {
        let side = f64::from(square.side_px);
        let near = |axis: usize| {
            (self.at_px[axis] - f64::from(square.corner_px[axis]) - 0.5 * side).abs() < side
        };
        self.height_px < side && near(0) && near(1)
    }
}

/// The foot of a source, where it is low enough to matter.
fn foot(source: &Source, camera: &Camera, floor_z_m: f64) -> Option<Foot> {
    let height_m = source.position_m.z - floor_z_m;
    let mut point_m = source.position_m;
    point_m.z = floor_z_m;
    let image = camera.image_from_world(point_m)?;
    let height_px = height_m * camera.focal_length_px() / image.depth_m;
    (height_px < f64::from(SQUARE_PX[0]))
        .then_some(Foot { at_px: [image.x_px, image.y_px], height_px })
}

/// The light of a trace while the shutter is open.
fn trees<'a>(trace: &'a LightTrace, camera: &Camera, floor_z_m: f64) -> Vec<Tree<'a>> {
    let pattern = |emitter: &Emitter| [emitter.beam_exponent, emitter.spill, emitter.visible_cos];
    let mut alike: Vec<(&Emitter, [i32; 3], Vec<Source>)> = Vec::new();
    for lamp in &trace.lamps {
        let emitter = &lamp.emitter;
        let light_cd = emitter.rgb.map(|share| share * emitter.intensity_cd);
        for moment in moments(&lamp.samples, camera, floor_z_m) {
            let way = direction(moment.axis);
            let known = |(other, other_way, _): &(&Emitter, [i32; 3], Vec<Source>)| {
                pattern(other) == pattern(emitter) && *other_way == way
            };
            let index = alike.iter().rposition(known).unwrap_or_else(|| {
                alike.push((emitter, way, Vec::new()));
                alike.len() - 1
            });
            let light_cd_s = light_cd.map(|cd| cd * moment.level);
            let LightSample { position_m, axis, .. } = moment;
            alike[index].2.push(Source { position_m, axis, light_cd_s });
        }
    }
    let tree = |(pattern, _, mut sources): (_, _, Vec<Source>)| {
        let mut branches = Vec::new();
        grow(&mut sources, floor_z_m, &mut branches);
        Tree { pattern, branches }
    };
    alike.into_iter().map(tree).collect()
}

/// An axis roughly: those within a quarter of each other are alike.
fn direction(axis: Vector3<f64>) -> [i32; 3] {
    #[expect(clippy::cast_possible_truncation, reason = "-2 to 2")]
    let rough = |value: f64| (2.0 * value).round() as i32;
    [axis.x, axis.y, axis.z].map(rough)
}

/// A lamp's light as moments, each as long as the lamp hardly moves, measured by its height. A
/// moment's level is its level times how long it lasts.
fn moments(samples: &[LightSample], camera: &Camera, floor_z_m: f64) -> Vec<LightSample> {
    let mut moments: Vec<LightSample> = Vec::new();
    let mut open: Option<Vector3<f64>> = None;
    for pair in samples.windows(2) {
        let (a, b) = (&pair[0], &pair[1]);
        let from_s = a.time_s.max(camera.shutter_open_s);
        let to_s = b.time_s.min(camera.shutter_close_s);
        if to_s <= from_s || (a.level == 0.0 && b.level == 0.0) {
            continue;
        }
        let height_m = (a.position_m.z.min(b.position_m.z) - floor_z_m).max(LOWEST_M);
        let step_m = 0.25 * OPENING * height_m;
        let way_m = (b.position_m - a.position_m).norm();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 1000")]
        let n = (way_m / step_m).ceil().clamp(1.0, 1000.0) as u32;
        for i in 0..n {
            let time_s = from_s + (to_s - from_s) * (f64::from(i) + 0.5) / f64::from(n);
            let share = (time_s - a.time_s) / (b.time_s - a.time_s);
            let mut position_m = a.position_m + (b.position_m - a.position_m) * share;
            position_m.z = position_m.z.max(floor_z_m + LOWEST_M);
            let axis = a.axis + (b.axis - a.axis) * share;
            let level = (a.level + (b.level - a.level) * share) * (to_s - from_s) / f64::from(n);
            match moments.last_mut().zip(open) {
                Some((last, start_m)) if (position_m - start_m).norm() < step_m => {
                    let part = level / (last.level + level).max(f64::MIN_POSITIVE);
                    last.position_m += (position_m - last.position_m) * part;
                    last.axis += (axis - last.axis) * part;
                    last.level += level;
                }
                _ => {
                    moments.push(LightSample { time_s, position_m, axis, level });
                    open = Some(position_m);
                }
            }
        }
    }
    moments
}

/// Adds the branch of some sources to a tree, and its own branches after it.
fn grow(sources: &mut [Source], floor_z_m: f64, branches: &mut Vec<Branch>) {
    let Some(first) = sources.first() else { return };
    let (mut low, mut high) = (first.position_m, first.position_m);
    let (mut sum, mut all) = (Source::default(), 0.0);
    for source in &*sources {
        (low, high) = (low.inf(&source.position_m), high.sup(&source.position_m));
        let weight: f64 = source.light_cd_s.iter().sum();
        sum.position_m += weight * source.position_m;
        sum.axis += weight * source.axis;
        all += weight;
        for (sum, light) in sum.light_cd_s.iter_mut().zip(source.light_cd_s) {
            *sum += light;
        }
    }
    sum.position_m = if all > 0.0 { sum.position_m / all } else { first.position_m };
    sum.axis /= sum.axis.norm().max(f64::MIN_POSITIVE);
    let (size, own) = (high - low, branches.len());
    let radius_m = 0.5 * size.norm();
    branches.push(Branch { source: sum, radius_m, next: 0 });
    if radius_m > OPENING * (low.z - floor_z_m) {
        let axis = size.imax();
        let middle = low[axis] + 0.5 * size[axis];
        let split = partition(sources, |source| source.position_m[axis] < middle);
        if split > 0 && split < sources.len() {
            let (below, above) = sources.split_at_mut(split);
            grow(below, floor_z_m, branches);
            grow(above, floor_z_m, branches);
        }
    }
    branches[own].next = branches.len();
}

/// Puts the sources that a test picks first, and says how many they are.
fn partition(sources: &mut [Source], picked: impl Fn(&Source) -> bool) -> usize {
    let mut n = 0;
    for i in 0..sources.len() {
        if picked(&sources[i]) {
            sources.swap(i, n);
            n += 1;
        }
    }
    n
}

/// What the lamps leave on a point of the floor, in lx s.
fn exposure_lx_s(trees: &[Tree<'_>], point_m: Vector3<f64>) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for Tree { pattern, branches } in trees {
        let mut index = 0;
        while let Some(branch) = branches.get(index) {
            let way = point_m - branch.source.position_m;
            let square = way.norm_squared();
            let is_last = branch.next == index + 1;
            if !is_last && branch.radius_m * branch.radius_m > OPENING * OPENING * square {
                index += 1;
                continue;
            }
            let per_m = 1.0 / square.sqrt();
            let cos_beam = branch.source.axis.dot(&way) * per_m;
            let share = pattern.share(cos_beam) * -way.z * per_m / square;
            for (sum, light) in sum.iter_mut().zip(branch.source.light_cd_s) {
                *sum += share * light;
            }
            index = branch.next;
        }
    }
    sum
}

/// Light of a photo as counts; it has its own noise beyond 24 bits.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "f32 has digits enough")]
fn narrow(value: f64) -> f32 {
    value as f32
}

/// A count below 2^31.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "saturates")]
fn whole(light: f32) -> u32 {
    (light as i32).cast_unsigned()
}

#[cfg(test)]
mod tests {
    use super::super::tests::{camera, lamp};
    use super::*;

    /// 2 m above the floor, looking down at it.
    fn looking_down() -> Camera {
        let down = Vector3::new(0.0, 1.0, -1.0).normalize();
        Camera {
            position_m: Vector3::new(0.0, 0.0, 2.0),
            camera_from_world: crate::geometry::camera_from_world(down),
            ..camera(320, 200)
        }
    }

    /// A lamp that shines straight down, still at a height for a time.
    fn hanging(place: [f64; 3], seconds: f64) -> LightTrace {
        let mut lamp = lamp([(0.0, place), (seconds, place)]);
        (lamp.emitter.spill, lamp.emitter.visible_cos) = (0.0, 0.0);
        lamp.samples.iter_mut().for_each(|sample| sample.axis = -Vector3::z());
        LightTrace { lamps: vec![lamp] }
    }

    const MATT: ExposeOptions = ExposeOptions { floor_albedo: 0.5, floor_z_m: 0.0, ..OPTIONS };
    const OPTIONS: ExposeOptions = ExposeOptions {
        backend: super::super::BackendChoice::Cpu,
        merge_tolerance_px: 0.005,
        scale_log2: None,
        floor_albedo: 0.0,
        floor_z_m: 0.0,
    };

    #[test]
    fn a_lamp_over_a_matt_floor_leaves_the_textbook_exposure() {
        let (camera, height_m) = (looking_down(), 0.4);
        let trace = hanging([0.1, 2.2, height_m], 3.0);
        let glow = Glow::new(&trace, &camera, &MATT).unwrap();
        let counts = vec![0; 3 * 320 * 200];
        let mut film = Film { width_px: 320, height_px: 200, counts, scale_log2: -24 };
        glow.add_to(&mut film);
        for point in [[0.1, 2.2], [0.0, 2.0], [-0.5, 1.6], [0.4, 2.9], [0.6, 2.0]] {
            let point_m = Vector3::new(point[0], point[1], 0.0);
            let image = camera.image_from_world(point_m).unwrap();
            // E = I cos² / d² for a lamp that shines as cosine; L = ρ E / π.
            let d_sq = height_m * height_m
                + (point[0] - 0.1) * (point[0] - 0.1)
                + (point[1] - 2.2) * (point[1] - 2.2);
            let e_lx_s = 1.8 * height_m * height_m / d_sq / d_sq * 3.0;
            let ray = (point_m - camera.position_m).normalize();
            let cos = (camera.camera_from_world * ray).z;
            let wanted = 0.5 * 0.9 / (4.0 * 64.0) * e_lx_s * cos * cos * cos * cos;
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a pixel")]
            let index = image.y_px as usize * 320 + image.x_px as usize;
            let found = film.exposure_lx_s(1, index);
            assert!((found / wanted - 1.0).abs() < 0.03, "{found} at {point:?}, wanted {wanted}");
        }
    }

    #[test]
    fn a_flight_leaves_what_its_moments_leave() {
        let mut trace = hanging([0.0; 3], 1.0);
        let at = |i: i32| {
            let s = f64::from(i) / 40.0;
            [0.7 * libm::sin(s), 2.0 + 0.1 * libm::cos(3.0 * s), 0.01 + 0.3 * s]
        };
        let samples = (0..160).map(|i| LightSample {
            time_s: f64::from(i) / 40.0,
            position_m: at(i).into(),
            axis: Vector3::new(0.1 * libm::sin(f64::from(i)), 0.0, -1.0).normalize(),
            level: 1.0,
        });
        trace.lamps[0].samples = samples.collect();
        let camera = looking_down();
        let trees = trees(&trace, &camera, 0.0);
        let n = trees.iter().map(|tree| tree.branches.len()).sum::<usize>();
        assert!(n < 1000, "{n} branches");
        let brute = |point_m: Vector3<f64>| {
            let pairs = trace.lamps[0].samples.windows(2);
            let of_pair = |pair: &[LightSample]| {
                let parts = (0..20).map(|i| (f64::from(i) + 0.5) / 20.0);
                let of_part = |part: f64| {
                    let way = point_m - pair[0].position_m.lerp(&pair[1].position_m, part);
                    let axis = pair[0].axis.lerp(&pair[1].axis, part);
                    let cos_beam = axis.normalize().dot(&way.normalize()).max(0.0);
                    1.8 * cos_beam * (-way.z / way.norm()) / way.norm_squared()
                };
                parts.map(of_part).sum::<f64>() / 20.0 * (pair[1].time_s - pair[0].time_s)
            };
            pairs.map(of_pair).sum::<f64>()
        };
        for x in -10..=10 {
            let point_m = Vector3::new(f64::from(x) * 0.1, 2.0, 0.0);
            let (found, wanted) = (exposure_lx_s(&trees, point_m)[0], brute(point_m));
            assert!((found / wanted - 1.0).abs() < 0.05, "{found} at {x}, wanted {wanted}");
        }
    }

    #[test]
    fn the_floor_is_dark_where_nothing_shines_on_it_or_nobody_looks() {
        let camera = looking_down();
        let up = |mut trace: LightTrace| {
            trace.lamps[0].samples.iter_mut().for_each(|sample| sample.axis = Vector3::z());
            trace
        };
        let trace = hanging([0.1, 2.2, 0.4], 3.0);
        assert_eq!(Glow::new(&up(trace.clone()), &camera, &MATT), None, "a lamp that shines up");
        assert_eq!(Glow::new(&trace, &camera, &OPTIONS), None, "a black floor");
        let sky = Camera {
            camera_from_world: crate::geometry::camera_from_world(Vector3::new(0.0, 1.0, 2.0)),
            ..camera.clone()
        };
        assert_eq!(Glow::new(&trace, &sky, &MATT), None, "a camera that looks up");
        let lying = Camera { position_m: Vector3::new(0.0, 0.0, 0.05), ..camera.clone() };
        assert_eq!(Glow::new(&trace, &lying, &MATT), None, "a camera on the floor");
        let later = Camera { shutter_open_s: 5.0, shutter_close_s: 9.0, ..camera };
        assert_eq!(Glow::new(&trace, &later, &MATT), None, "a shutter that opens later");
    }
}
