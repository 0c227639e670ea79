//! Represents lamps by point sources that light floor and walls, sorted into trees.
//!
//! Each lamp becomes point sources along its path. Sources with the same beam shape and nearly the
//! same axis form a tree (Barnes and Hut 1986). A branch that is small relative to its distance
//! counts as one source.

use std::sync::LazyLock;

use nalgebra::Vector3;

use super::Detail;
use super::room::Surface;
use crate::light::{Emitter, LightSample, LightTrace};
use crate::whole;
use noctograph_core::camera::Camera;

/// Minimum height of a lamp above the floor: half the thickness of an LED package. A flight's
/// heights may be off by centimeters, but no lamp can shine from below the floor.
const LOWEST_M: f64 = 0.002;

/// Maximum step between two sources along a lamp's path, relative to the lamp's height and to
/// [`Detail::opening`].
const STEP: f64 = 0.25;

pub(super) type Rgb = [f64; 3];

/// Sources with the same beam shape and nearly the same axis.
pub(super) struct Tree<'a> {
    pub(super) emitter: &'a Emitter,
    pub(super) branches: Vec<Branch>,
    /// Maximum ratio of a branch's radius to its distance ([`Detail::opening`]).
    opening: f64,
}

/// A branch of a tree, which is followed by its children.
pub(super) struct Branch {
    /// All sources of the branch, combined into one.
    pub(super) source: Source,
    /// Half the diagonal of the bounding box of its sources.
    radius_m: f64,
    /// Index of the first branch after all descendants of this one.
    next: usize,
}

/// The light that a lamp emits at one point.
#[derive(Clone, Copy, Default)]
pub(super) struct Source {
    pub(super) position_m: Vector3<f64>,
    axis: Vector3<f64>,
    /// Luminous intensity on the axis, multiplied by the duration.
    light_cd_s: Rgb,
}

/// Returns the light of a trace while the shutter is open: one tree per beam shape and axis.
pub(super) fn trees<'a>(
    trace: &'a LightTrace,
    camera: &Camera,
    floor_z_m: f64,
    opening: f64,
) -> Vec<Tree<'a>> {
    // Groups the sources of each emitter by beam shape and axis.
    let mut groups: Vec<(&Emitter, [f64; 6], Vec<Source>)> = Vec::new();
    for lamp in &trace.lamps {
        let emitter = &lamp.emitter;
        let light_cd = emitter.rgb.map(|channel| channel * emitter.intensity_cd);
        let points = points(&lamp.samples, camera, floor_z_m, STEP * opening);
        for LightSample { position_m, axis, level, .. } in points {
            let source = Source { position_m, axis, light_cd_s: light_cd.map(|cd| cd * level) };
            // Axes are grouped by coordinates, rounded to halves. An isotropic lamp has no axis.
            let scale = if emitter.is_isotropic() { 0.0 } else { 2.0 };
            let [x, y, z] = axis.map(|value| (scale * value).round()).into();
            let key =
                [emitter.beam_exponent, emitter.isotropic_fraction, emitter.visible_cos, x, y, z];
            match groups.iter_mut().rev().find(|(_, other, _)| *other == key) {
                Some((.., sources)) => sources.push(source),
                None => groups.push((emitter, key, vec![source])),
            }
        }
    }
    Vec::from_iter(groups.into_iter().map(|(emitter, _, sources)| {
        let mut branches = Vec::new();
        grow(sources, floor_z_m, opening, &mut branches);
        Tree { emitter, branches, opening }
    }))
}

/// Divides a lamp's path into points between which the lamp moves by `step` times its height at
/// most. The level of each point is multiplied by its duration in s.
fn points(samples: &[LightSample], camera: &Camera, floor_z_m: f64, step: f64) -> Vec<LightSample> {
    let mut points: Vec<LightSample> = Vec::new();
    let mut start_m: Option<Vector3<f64>> = None;
    for pair in samples.windows(2) {
        // Cuts the interval to the time that the shutter is open, and divides it into short steps.
        let (a, b) = (&pair[0], &pair[1]);
        let from_s = a.time_s.max(camera.shutter_open_s);
        let to_s = b.time_s.min(camera.shutter_close_s);
        if to_s <= from_s || (a.level == 0.0 && b.level == 0.0) {
            continue;
        }
        let height_m = (a.position_m.z.min(b.position_m.z) - floor_z_m).max(LOWEST_M);
        let step_m = step * height_m;
        let length_m = (b.position_m - a.position_m).norm();
        #[expect(clippy::cast_possible_truncation, reason = "1 to 1000")]
        let n = (length_m / step_m).ceil().clamp(1.0, 1000.0) as u32;
        for i in 0..n {
            let time_s = from_s + (to_s - from_s) * (f64::from(i) + 0.5) / f64::from(n);
            let mut next = a.toward(b, time_s);
            next.position_m.z = next.position_m.z.max(floor_z_m + LOWEST_M);
            next.level = next.level * (to_s - from_s) / f64::from(n);
            // Steps close to the start of a point are merged into it, weighted by their light.
            match points.last_mut().zip(start_m) {
                Some((last, start_m)) if (next.position_m - start_m).norm() < step_m => {
                    let weight = next.level / (last.level + next.level).max(f64::MIN_POSITIVE);
                    last.position_m += (next.position_m - last.position_m) * weight;
                    last.axis += (next.axis - last.axis) * weight;
                    last.level += next.level;
                }
                _ => {
                    points.push(next);
                    start_m = Some(next.position_m);
                }
            }
        }
    }
    points
}

/// Appends the branch that contains all `sources`, followed by its children, which have less
/// extent.
fn grow(sources: Vec<Source>, floor_z_m: f64, opening: f64, branches: &mut Vec<Branch>) {
    let Some(first) = sources.first() else { return };
    // The branch's combined source has the sum of the light, at the light-weighted mean position.
    let (mut low, mut high) = (first.position_m, first.position_m);
    let (mut sum, mut total) = (Source::default(), 0.0);
    for source in &sources {
        (low, high) = (low.inf(&source.position_m), high.sup(&source.position_m));
        let weight: f64 = source.light_cd_s.iter().sum();
        sum.position_m += weight * source.position_m;
        sum.axis += weight * source.axis;
        total += weight;
        for (sum, light) in sum.light_cd_s.iter_mut().zip(source.light_cd_s) {
            *sum += light;
        }
    }
    sum.position_m = if total > 0.0 { sum.position_m / total } else { first.position_m };
    sum.axis /= sum.axis.norm().max(f64::MIN_POSITIVE);
    let (size, index) = (high - low, branches.len());
    let radius_m = 0.5 * size.norm();
    branches.push(Branch { source: sum, radius_m, next: 0 });
    // A branch that is large relative to its height above floor is halved along its longest side.
    if radius_m > opening * (low.z - floor_z_m) {
        let axis = size.imax();
        let middle = low[axis] + 0.5 * size[axis];
        let halves: (Vec<_>, Vec<_>) =
            sources.into_iter().partition(|source| source.position_m[axis] < middle);
        if !halves.0.is_empty() && !halves.1.is_empty() {
            grow(halves.0, floor_z_m, opening, branches);
            grow(halves.1, floor_z_m, opening, branches);
        }
    }
    branches[index].next = branches.len();
}

/// Minimum side of the floor squares that light the walls, and maximum number along a wall.
const PATCH_M: f64 = 0.5;
const MAX_PATCHES: f64 = 32.0;

/// Emitter of one square of the floor, with a Lambertian beam.
static PATCH: LazyLock<Emitter> = LazyLock::new(|| Emitter {
    name: "floor".to_owned(),
    intensity_cd: 1.0,
    rgb: [1.0; 3],
    beam_exponent: 1.0,
    isotropic_fraction: 0.0,
    visible_cos: 0.0,
    diameter_m: PATCH_M,
    depth_m: None,
});

/// Returns sources that emit the light reflected by a room's floor, one for each square. The floor
/// reflects the fraction `albedo` of the light.
///
/// The exposure of a square is computed at the point one side length below its center. A lamp close
/// to the floor then neither illuminates a single square too much nor is missed between squares.
pub(super) fn reflected(
    trees: &[Tree<'_>],
    [width_m, depth_m]: [f64; 2],
    floor_z_m: f64,
    albedo: f64,
) -> Tree<'static> {
    let side_m = PATCH_M.max(width_m.max(depth_m) / MAX_PATCHES);
    let (columns, rows) = ((width_m / side_m).ceil(), (depth_m / side_m).ceil());
    let floor = Surface::matte(Vector3::z(), floor_z_m, albedo);
    // A Lambertian square of area A that receives E lx s has an intensity of ρ A E / π cd s.
    let area_m2 = width_m * depth_m / (columns * rows);
    let factor = albedo * area_m2 / std::f64::consts::PI;
    let sources = (0..whole(columns * rows)).map(|square| {
        let [column, row] = [square % whole(columns), square / whole(columns)];
        let x_m = ((column as f64 + 0.5) / columns - 0.5) * width_m;
        let y_m = ((row as f64 + 0.5) / rows - 0.5) * depth_m;
        let sample_m = Vector3::new(x_m, y_m, floor_z_m - side_m);
        let [exposure_lx_s] = exposures_lx_s(trees, [sample_m], &floor, [Vector3::z()]);
        Source {
            position_m: Vector3::new(x_m, y_m, floor_z_m),
            axis: Vector3::z(),
            light_cd_s: exposure_lx_s.map(|channel| channel * factor),
        }
    });
    let (opening, mut branches) = (Detail::PICTURE.opening, Vec::new());
    grow(sources.collect(), floor_z_m, opening, &mut branches);
    Tree { emitter: &PATCH, branches, opening }
}

/// Returns the exposure in lx s at points of a surface. On a surface with sheen, light is weighted
/// by its reflection toward a unit vector at each point, relative to a matte surface.
///
/// The points are computed together because they are close to each other and mostly open the same
/// branches. The result has the same bits as if each point were computed separately.
#[inline(always)]
pub(super) fn exposures_lx_s<const N: usize>(
    trees: &[Tree<'_>],
    points_m: [Vector3<f64>; N],
    surface: &Surface,
    toward: [Vector3<f64>; N],
) -> [Rgb; N] {
    let points_m: [[f64; N]; 3] = std::array::from_fn(|axis| points_m.map(|point| point[axis]));
    let mut sums = [[0.0; N]; 3];
    for Tree { emitter, branches, opening } in trees {
        // A shiny surface resolves lamps that a matte one blurs, so their branches are opened
        // sooner.
        let opening = surface.roughness.map_or(*opening, |roughness| opening.min(0.5 * roughness));
        // Computes the intensity at the edge of the body's shadow, where the light ends abruptly.
        let edge = if emitter.visible_cos <= -1.0 {
            0.0
        } else {
            emitter.relative_intensity(emitter.visible_cos)
        };
        let is_even = emitter.is_isotropic();
        // Walks down the tree. Each point skips the children of a branch that it has counted.
        let mut index = 0;
        let mut skipped_until = [0; N];
        while let Some(Branch { source, radius_m, next }) = branches.get(index) {
            let to: [[f64; N]; 3] = std::array::from_fn(|axis| {
                points_m[axis].map(|point| point - source.position_m[axis])
            });
            let dot = |v: &Vector3<f64>| -> [f64; N] {
                std::array::from_fn(|n| v.x * to[0][n] + v.y * to[1][n] + v.z * to[2][n])
            };
            let squares: [f64; N] = std::array::from_fn(|n| {
                to[0][n] * to[0][n] + to[1][n] * to[1][n] + to[2][n] * to[2][n]
            });
            // Opening criterion: the ratio of a branch's radius to its distance is too large.
            let is_leaf = *next == index + 1;
            let is_near: [bool; N] =
                std::array::from_fn(|n| radius_m * radius_m > opening * opening * squares[n]);
            // Near the root every point opens the branch, and the steps below are not needed.
            if !is_leaf && (0..N).all(|n| is_near[n] && skipped_until[n] <= index) {
                index += 1;
                continue;
            }
            // Branches at the edge of the body's shadow are opened as well.
            let per_m = squares.map(|square| 1.0 / square.sqrt());
            let cos_beam = if is_even { [0.0; N] } else { dot(&source.axis) };
            let cos_beam: [f64; N] = std::array::from_fn(|n| cos_beam[n] * per_m[n]);
            let at_edge: [bool; N] = std::array::from_fn(|n| {
                edge > 0.0 && (cos_beam[n] - emitter.visible_cos).abs() < radius_m * per_m[n]
            });
            let opens: [bool; N] = std::array::from_fn(|n| !is_leaf && (is_near[n] || at_edge[n]));
            let counts: [bool; N] = std::array::from_fn(|n| skipped_until[n] <= index && !opens[n]);
            // The cosine law and the inverse square law give cos / d² lx per cd.
            let down = dot(&surface.normal);
            let mut weights: [f64; N] = std::array::from_fn(|n| {
                let weight = (-down[n] * per_m[n] / squares[n]).max(0.0);
                if counts[n] { weight } else { 0.0 }
            });
            // Applies beam shape and sheen, relative to an isotropic lamp and a matte surface.
            if !is_even {
                let beams =
                    beams(emitter, edge, cos_beam, at_edge, per_m.map(|per| radius_m * per));
                weights =
                    std::array::from_fn(|n| if counts[n] { weights[n] * beams[n] } else { 0.0 });
            }
            if let Some(roughness) = surface.roughness {
                for (n, weight) in weights.iter_mut().enumerate().filter(|(_, w)| **w > 0.0) {
                    let from = Vector3::new(to[0][n], to[1][n], to[2][n]) * -per_m[n];
                    *weight *= surface.sheen(roughness, from, toward[n]);
                }
            }
            for (sums, light) in sums.iter_mut().zip(source.light_cd_s) {
                sums.iter_mut().zip(weights).for_each(|(sum, weight)| *sum += weight * light);
            }
            // Continues with the children if any point opens the branch, and otherwise skips them.
            let mut any_opens = false;
            for n in 0..N {
                any_opens |= opens[n] && skipped_until[n] <= index;
                skipped_until[n] = if counts[n] { *next } else { skipped_until[n] };
            }
            index = if any_opens { index + 1 } else { *next };
        }
    }
    std::array::from_fn(|n| sums.map(|sums| sums[n]))
}

/// Returns the intensity of a branch toward points, relative to the axis, given the cosines of the
/// angles to it. At the edge of the body's shadow, where the intensity is `edge`, only a part of
/// the branch's sources is visible. `angles` is the branch's radius over each distance.
#[inline(always)]
fn beams<const N: usize>(
    emitter: &Emitter,
    edge: f64,
    cos_beam: [f64; N],
    at_edge: [bool; N],
    angles: [f64; N],
) -> [f64; N] {
    let Emitter { isotropic_fraction, visible_cos, .. } = *emitter;
    let beams: [f64; N] = if emitter.beam_exponent == 1.0 {
        // Computes [`Emitter::relative_intensity`] for all points at once.
        std::array::from_fn(|n| {
            #[expect(
                clippy::manual_clamp,
                reason = "0 for a point in the source, without a cosine"
            )]
            let beam = cos_beam[n].max(0.0).min(1.0);
            let intensity = isotropic_fraction + (1.0 - isotropic_fraction) * beam;
            if cos_beam[n] < visible_cos { 0.0 } else { intensity }
        })
    } else {
        cos_beam.map(|cos| emitter.relative_intensity(cos))
    };
    // At the shadow's edge, counts the visible fraction of a branch's sources, not all or none.
    std::array::from_fn(|n| {
        let beyond_edge = cos_beam[n] - visible_cos;
        let visible = 0.5 + 0.5 * beyond_edge / angles[n];
        let hidden = if beyond_edge >= 0.0 { 1.0 } else { 0.0 };
        beams[n] + if at_edge[n] { edge * (visible - hidden) } else { 0.0 }
    })
}

#[cfg(test)]
mod tests {
    use super::super::tests::{hanging, looking_down};
    use super::*;

    fn seen(trees: &[Tree<'_>], point_m: Vector3<f64>) -> Rgb {
        let floor = Surface::matte(Vector3::z(), 0.0, 0.5);
        exposures_lx_s(trees, [point_m], &floor, [Vector3::z()])[0]
    }

    #[test]
    fn behind_a_lamp_that_flies_on_the_floor_darkens_without_steps() {
        let mut trace = hanging([0.0; 3]);
        let samples = (0..=200).map(|i| LightSample {
            time_s: 0.01 * f64::from(i),
            position_m: Vector3::new(0.01 * f64::from(i), 2.0, 0.5),
            axis: Vector3::x(),
            level: 1.0,
        });
        trace.edit(|trace| {
            let lamp = &mut trace.lamps[0];
            (lamp.emitter.isotropic_fraction, lamp.emitter.visible_cos) = (0.05, -0.5);
            lamp.samples = samples.collect();
        });
        let trees = trees(&trace, &looking_down(), 0.0, Detail::PICTURE.opening);
        let lit = |mm: i32| seen(&trees, Vector3::new(f64::from(mm) * 0.001, 2.0, 0.0))[1];
        let most = (-500..0).map(lit).fold(0.0, f64::max);
        let steps = (-500..0).map(|mm| (lit(mm + 1) - lit(mm)).abs());
        let step = steps.fold(0.0, f64::max) / most;
        assert!(step < 0.01, "a step of {step} within a millimeter");
    }

    #[test]
    fn the_tree_of_a_flight_is_within_5_percent_of_the_sum_over_its_samples() {
        let mut trace = hanging([0.0; 3]);
        let samples = (0..160).map(|i| {
            let s = f64::from(i) / 40.0;
            LightSample {
                time_s: s,
                position_m: Vector3::new(
                    0.7 * libm::sin(s),
                    2.0 + 0.1 * libm::cos(3.0 * s),
                    0.01 + 0.3 * s,
                ),
                axis: Vector3::new(0.1 * libm::sin(f64::from(i)), 0.0, -1.0).normalize(),
                level: 1.0,
            }
        });
        trace.edit(|trace| trace.lamps[0].samples = samples.collect());
        let trees = trees(&trace, &looking_down(), 0.0, Detail::PICTURE.opening);
        let n = trees.iter().map(|tree| tree.branches.len()).sum::<usize>();
        assert!(n < 1000, "{n} branches");
        for x in -10..=10 {
            let point_m = Vector3::new(f64::from(x) * 0.1, 2.0, 0.0);
            let mut wanted = 0.0;
            for pair in trace.lamps[0].samples.windows(2) {
                for step in 0..20 {
                    let part = (f64::from(step) + 0.5) / 20.0;
                    let to_point_m = point_m - pair[0].position_m.lerp(&pair[1].position_m, part);
                    let axis = pair[0].axis.lerp(&pair[1].axis, part).normalize();
                    let cos_beam = axis.dot(&to_point_m.normalize()).max(0.0);
                    let cos_floor = -to_point_m.z / to_point_m.norm();
                    wanted += 1.8 * cos_beam * cos_floor / to_point_m.norm_squared() / 800.0;
                }
            }
            let actual = seen(&trees, point_m)[0];
            assert!((actual / wanted - 1.0).abs() < 0.05, "{actual} at {x}, wanted {wanted}");
        }
    }
}
