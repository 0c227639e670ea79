//! Room: the planes of floor and walls, their intersections with rays, and their reflectance.
//!
//! Walls are matte. The floor is matte or also has a sheen: microfacets with GGX-distributed
//! normals (Walter et al., "Microfacet models for refraction through rough surfaces", 2007) reflect
//! like glass and polish, with 4 % of the light at normal incidence and all of it at grazing angles
//! (Schlick 1994).
//!
//! Furniture, doors, and surfaces that hide each other are not modeled.

use nalgebra::Vector3;

use super::project::NEAREST_M;
use super::{ExposeOptions, texture};

/// Fraction of light that a polished surface of refractive index 1.5 reflects at normal incidence.
const NORMAL_REFLECTANCE: f64 = 0.04;

/// Maximum light from a gap on surfaces close to it, relative to light at the depth of the room.
const MAX_GAP_LIGHT: f64 = 30.0;

/// Minimum cosine at which a ray meets a surface, and lower limit of cosines in divisors.
const MIN_RAY_COS: f64 = 1e-9;
const MIN_COS: f64 = 1e-6;

/// A plane of the room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Surface {
    pub(super) normal: Vector3<f64>,
    /// Value of `normal · p` at the points of the plane.
    at_m: f64,
    /// Fraction of the light that the surface reflects diffusely.
    pub(super) albedo: f64,
    /// Mean slope of the facets of the sheen.
    pub(super) roughness: Option<f64>,
}

/// The surfaces that a camera inside the room sees.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Room {
    camera_m: Vector3<f64>,
    /// The surfaces. The floor is the first one if the camera is above it.
    pub(super) surfaces: Vec<Surface>,
    /// Width, depth and height of the room if it has walls.
    size_m: Option<[f64; 3]>,
    /// Relative standard deviation of the albedo.
    pub(super) unevenness: f64,
}

impl Room {
    /// Returns the surfaces that face a camera at `camera_m`. A camera outside the room sees
    /// through the wall.
    pub(crate) fn new(options: &ExposeOptions, camera_m: Vector3<f64>) -> Self {
        let ExposeOptions { floor_z_m, floor_albedo, floor_roughness, wall_albedo, .. } = *options;
        let floor = Surface::matte(Vector3::z(), floor_z_m, floor_albedo);
        let mut surfaces = vec![Surface { roughness: floor_roughness, ..floor }];
        if let Some([width_m, depth_m, height_m]) = options.room_m {
            let walls = [
                (-Vector3::y(), -0.5 * depth_m),
                (Vector3::y(), -0.5 * depth_m),
                (Vector3::x(), -0.5 * width_m),
                (-Vector3::x(), -0.5 * width_m),
                (-Vector3::z(), -(floor_z_m + height_m)),
            ];
            surfaces.extend(walls.map(|(normal, at_m)| Surface::matte(normal, at_m, wall_albedo)));
        }
        // A wall is invisible from behind. Nearer walls than a visible lamp are left out too.
        surfaces.retain(|surface| surface.height_m(camera_m) >= NEAREST_M);
        Self { camera_m, surfaces, size_m: options.room_m, unevenness: options.unevenness }
    }

    /// Intersects a ray from the camera with the room. Returns the index of the nearest surface and
    /// the point on it, or `None` if the ray meets no surface.
    pub(crate) fn intersection(&self, ray: Vector3<f64>) -> Option<(usize, Vector3<f64>)> {
        let hits = self.surfaces.iter().enumerate().filter_map(|(i, surface)| {
            let cos = surface.normal.dot(&ray);
            (cos <= -MIN_RAY_COS).then(|| (i, surface.height_m(self.camera_m) / -cos))
        });
        let (i, distance) = hits.min_by(|a, b| a.1.total_cmp(&b.1))?;
        Some((i, self.camera_m + ray * distance))
    }

    /// Returns the texture coordinates of a point on surface `on`, in nodes of the texture.
    pub(super) fn on_texture(&self, on: usize, point_m: Vector3<f64>) -> [f32; 2] {
        let normal = self.surfaces[on].normal;
        texture::on_tile(match (normal.x != 0.0, normal.y != 0.0) {
            (true, _) => [point_m.y, point_m.z],
            (_, true) => [point_m.x, point_m.z],
            _ => [point_m.x, point_m.y],
        })
    }

    /// Returns the albedo at a point on surface `on`, relative to the surface's mean. Walls are
    /// half as uneven as the floor.
    pub(crate) fn relative_albedo(&self, on: usize, point_m: Vector3<f64>) -> f64 {
        let deviation = f64::from(texture::deviation(self.on_texture(on, point_m)));
        let factor = if self.surfaces[on].is_floor() { 1.0 } else { 0.5 };
        (1.0 + factor * self.unevenness * deviation).max(0.0)
    }

    /// Returns the luminance of a point on surface `on` in the light of the room, relative to that
    /// of a wall far from the floor. The luminance is 1 if there are no walls.
    ///
    /// The light is diffuse because walls and ceiling reflect it. If there is a gap at `gap_m`,
    /// half of the light comes from it.
    pub(crate) fn ambient(
        &self,
        on: usize,
        point_m: Vector3<f64>,
        gap_m: Option<Vector3<f64>>,
    ) -> f64 {
        let Some([width_m, depth_m, height_m]) = self.size_m else { return 1.0 };
        let surface = &self.surfaces[on];
        // The lower limit prevents a division by zero in a black room.
        let albedos = self.surfaces.iter().map(|surface| surface.albedo);
        let brightest = albedos.fold(1e-9, f64::max);
        // A darker perpendicular plane, with width h at distance d, fills the fraction (1 - d /
        // √(d² + h²)) / 2 of the view (its form factor).
        let others = self.surfaces.iter().filter(|other| other.normal.dot(&surface.normal) == 0.0);
        let hidden = others.map(|other| {
            let d = other.height_m(point_m).max(0.0);
            let size_m = Vector3::new(width_m, depth_m, height_m);
            let h = size_m.dot(&surface.normal.abs());
            0.5 * (1.0 - d / (d * d + h * h).sqrt()) * (1.0 - other.albedo / brightest).max(0.0)
        });
        let diffuse = 1.0 - hidden.sum::<f64>();
        // The gap's light decreases as the cosine divided by d², relative to the depth of the room.
        // An added constant, 0.1 m², limits it near the gap.
        let light = gap_m.map_or(diffuse, |gap_m| {
            let to_gap_m = gap_m - point_m;
            let d_sq = to_gap_m.norm_squared() + NEAREST_M;
            let from_gap =
                depth_m * depth_m * surface.normal.dot(&to_gap_m).max(0.0) / (d_sq * d_sq.sqrt());
            0.5 * (diffuse + from_gap.min(MAX_GAP_LIGHT))
        });
        light * surface.albedo / brightest
    }
}

impl Surface {
    /// Returns a surface without sheen, whose points satisfy `normal · p = at_m`. It reflects the
    /// fraction `albedo` of the light.
    pub(super) fn matte(normal: Vector3<f64>, at_m: f64, albedo: f64) -> Self {
        Self { normal, at_m, albedo, roughness: None }
    }

    /// True if the surface faces up.
    pub(super) fn is_floor(&self) -> bool {
        self.normal == Vector3::z()
    }

    /// Returns the distance in m of a point from the surface, which is positive inside the room.
    fn height_m(&self, point_m: Vector3<f64>) -> f64 {
        self.normal.dot(&point_m) - self.at_m
    }

    /// Returns the light that a floor with sheen reflects from one direction to another, relative
    /// to a matte floor. Both directions are unit vectors away from the surface. A `roughness` of 1
    /// is matte, and one near 0 is a mirror.
    pub(super) fn sheen(&self, roughness: f64, from: Vector3<f64>, to: Vector3<f64>) -> f64 {
        // Facets along the half vector act as mirrors: D = α² / (π (cos² (α² - 1) + 1)²).
        let half = (from + to).normalize();
        let [cos_from, cos_to, cos] = [from, to, half].map(|v| self.normal.dot(&v).max(MIN_COS));
        let a_sq = roughness * roughness;
        let spread = cos * cos * (a_sq - 1.0) + 1.0;
        let facets = a_sq / (std::f64::consts::PI * spread * spread);
        // Schlick's approximation of the Fresnel term.
        let x = 1.0 - from.dot(&half).clamp(0.0, 1.0);
        let reflected = NORMAL_REFLECTANCE + (1.0 - NORMAL_REFLECTANCE) * x * x * x * x * x;
        // Smith's shadowing term, divided by the cosines of the microfacet model.
        let shadow = |cos: f64| 1.0 / (cos + (a_sq + (1.0 - a_sq) * cos * cos).sqrt());
        let lobe = facets * reflected * shadow(cos_from) * shadow(cos_to);
        1.0 + std::f64::consts::PI * lobe / self.albedo
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROOM: ExposeOptions = ExposeOptions {
        merge_tolerance_px: 0.005,
        detail: crate::expose::Detail::PICTURE,
        floor_albedo: 0.2,
        floor_z_m: 0.0,
        floor_roughness: Some(0.3),
        room_m: Some([4.0, 6.0, 2.5]),
        wall_albedo: 0.5,
        unevenness: 0.0,
    };

    #[test]
    fn a_ray_meets_the_nearest_surface_and_passes_a_wall_from_behind() {
        let camera_m = Vector3::new(0.5, -4.0, 1.0);
        let room = Room::new(&ROOM, camera_m);
        for (ray, wanted) in [
            ([0.0, 1.0, 0.0], [0.5, 3.0, 1.0]),
            ([0.0, 1.0, -0.5], [0.5, -2.0, 0.0]),
            ([0.5, 1.0, 0.0], [2.0, -1.0, 1.0]),
            ([0.0, 1.0, 0.5], [0.5, -1.0, 2.5]),
        ] {
            let (_, point_m) = room.intersection(Vector3::from(ray)).unwrap();
            assert!((point_m - Vector3::from(wanted)).norm() < 1e-12, "{point_m}");
        }
        let bare = Room::new(&ExposeOptions { room_m: None, ..ROOM }, camera_m);
        assert_eq!(bare.intersection(Vector3::y()), None);
        assert_eq!(bare.ambient(0, Vector3::zeros(), None), 1.0);
    }

    #[test]
    fn walls_darken_toward_a_dark_floor_which_is_as_dark_as_it_is() {
        let room = Room::new(&ROOM, Vector3::new(0.0, -2.0, 1.0));
        let [low, high] = [0.01, 1.2].map(|z| room.ambient(1, Vector3::new(0.0, 3.0, z), None));
        assert!(low < 0.95 * high && low > 0.7, "{low} {high}");
        let floor = room.ambient(0, Vector3::zeros(), None);
        assert!((floor - 0.2 / 0.5).abs() < 1e-12, "{floor}");
    }

    #[test]
    fn a_gap_lights_what_is_near_and_faces_it() {
        let room = Room::new(&ROOM, Vector3::new(0.0, -2.0, 1.5));
        let lit = |x| {
            let (on, point_m) = room.intersection(Vector3::new(x, 5.0, 0.5)).unwrap();
            let gap_m = Some(Vector3::new(-1.9, 0.0, 2.0));
            2.0 * room.ambient(on, point_m, gap_m) - room.ambient(on, point_m, None)
        };
        // cos / d² is 1 at the room's depth. The test checks it beside the gap and at the far end.
        for (x, x_sq) in [(-1.9, 0.0), (1.9, 3.8 * 3.8)] {
            let d_sq: f64 = x_sq + 9.0;
            let wanted = 36.0 * 3.0 / (d_sq * d_sq.sqrt());
            assert!((lit(x) / wanted - 1.0).abs() < 0.03, "{} at {x}, {wanted}", lit(x));
        }
    }

    #[test]
    fn a_sheen_reflects_no_more_light_than_it_receives() {
        // Integrates over the hemisphere, without the matte part, whose albedo is 0.2.
        let floor = Room::new(&ROOM, Vector3::z()).surfaces[0];
        for (roughness, degrees) in [(0.1, 10.0_f64), (0.3, 45.0), (0.3, 75.0), (1.0, 60.0)] {
            let angle = degrees.to_radians();
            let from = Vector3::new(libm::sin(angle), 0.0, libm::cos(angle));
            let (n, mut sum) = (400, 0.0);
            for i in 0..n {
                let cos = (f64::from(i) + 0.5) / f64::from(n);
                let sin = (1.0 - cos * cos).sqrt();
                for j in 0..n {
                    let turn = (f64::from(j) + 0.5) / f64::from(n) * std::f64::consts::TAU;
                    let to = Vector3::new(sin * libm::cos(turn), sin * libm::sin(turn), cos);
                    sum += (floor.sheen(roughness, from, to) - 1.0) * 0.2 * 2.0 * cos;
                }
            }
            let fraction = sum / f64::from(n * n);
            let straight = 1.0 - libm::cos(angle);
            let wanted = 0.04 + 0.96 * libm::pow(straight, 5.0);
            assert!(
                fraction < 1.0 && fraction > 0.2 * wanted,
                "{fraction} at {degrees}, {roughness}"
            );
            if roughness < 0.2 {
                assert!((fraction / wanted - 1.0).abs() < 0.1, "{fraction}, Fresnel {wanted}");
            }
        }
    }
}
