//! The light meter, which sets aperture and sensitivity.
//!
//! A slower lamp leaves a brighter trail, and a longer exposure makes the room brighter. Aperture
//! and sensitivity change both by the same factor. Therefore the trail of a long flight is exposed
//! less, to keep the room dark.

use serde::Serialize;

use super::problems::is_exposed;
use noctograph_core::camera::{Camera, CameraOptions, Metering, TrailMetering};
use noctograph_picture::expose::meter::{color_stops, meter};
use noctograph_picture::light::LightTrace;
use noctograph_picture::photo::PhotoOptions;

/// Nominal f-numbers in third-stop steps. Few lenses are sharp below f/2.8, and diffraction blurs
/// the picture above f/22.
const F_NUMBERS: [f64; 19] = [
    2.8, 3.2, 3.5, 4.0, 4.5, 5.0, 5.6, 6.3, 7.1, 8.0, 9.0, 10.0, 11.0, 13.0, 14.0, 16.0, 18.0,
    20.0, 22.0,
];

/// Nominal ISO sensitivities in third-stop steps. Values below 100 are for phone cameras.
const ISOS: [f64; 19] = [
    50.0, 64.0, 80.0, 100.0, 125.0, 160.0, 200.0, 250.0, 320.0, 400.0, 500.0, 640.0, 800.0, 1000.0,
    1250.0, 1600.0, 2000.0, 2500.0, 3200.0,
];

/// Width of the metered picture. In a smaller picture the pixels would blur a trail.
const WIDTH_PX: u32 = 1920;
/// Aperture number and ISO sensitivity of the camera with which the light is metered.
const REFERENCE_F_NUMBER: f64 = 8.0;
const REFERENCE_ISO: f64 = 100.0;
/// Smallest and largest ISO sensitivity that is set on a camera with exchangeable lenses.
const USUAL_ISO: [f64; 2] = [100.0, 3200.0];
/// Stops by which a trail may be darker than its target without a warning.
const TOLERATED_STOPS: f64 = 1.0;

/// Recommendation of the light meter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Metered {
    /// Recommended f-number.
    pub f_number: f64,
    /// Recommended ISO sensitivity.
    pub iso: f64,
    /// Median exposure of the brightest trail, in stops over saturation.
    pub trail_stops: f64,
    /// Exposure of the room, in stops over saturation. `None` if the room is dark.
    pub room_stops: Option<f64>,
    /// True if the trail is more than a stop darker than its target, to keep the room dark.
    #[serde(rename = "gave_way")]
    pub keeps_room_dark: bool,
    /// Strength, in whole stops, of the neutral-density filter that is required in addition to the
    /// smallest aperture and the lowest sensitivity.
    pub filter_stops: u32,
    /// Maximum duration of a single exposure, if the shutter is open for longer than the camera
    /// allows, so that several exposures must be combined.
    pub longest_s: Option<f64>,
}

impl Metered {
    /// Returns what a camera requires in addition to its settings, such as a filter, or `None`.
    pub fn help(&self) -> Option<String> {
        let mode = self.longest_s.map(|s| {
            format!("use a night or light-trail mode: one exposure lasts at most {s:.0} s")
        });
        let filter = match self.filter_stops {
            0 => None,
            1 => Some("use a neutral-density filter of 1 stop".to_owned()),
            n => Some(format!("use a neutral-density filter of {n} stops")),
        };
        let help: Vec<String> = mode.into_iter().chain(filter).collect();
        (!help.is_empty()).then(|| help.join("; "))
    }
}

/// Meters the light, and sets the camera's aperture and sensitivity. Returns `None` without
/// metering or without light.
pub(super) fn metered(
    trace: &LightTrace,
    camera: &mut Camera,
    options: &CameraOptions,
    photo: &PhotoOptions,
) -> Option<Metered> {
    if options.metering == Metering::Off {
        return None;
    }
    let metered = recommended(trace, camera, options, photo)?;
    (camera.f_number, camera.iso) = (metered.f_number, metered.iso);
    camera.vignetting = options.vignetting_at(camera.f_number);
    Some(metered)
}

/// Meters the light against the targets of the scene's metering, or against default targets.
/// Returns `None` without light.
pub fn recommended(
    trace: &LightTrace,
    camera: &Camera,
    options: &CameraOptions,
    photo: &PhotoOptions,
) -> Option<Metered> {
    let targets = match &options.metering {
        Metering::Trail(targets) => targets.clone(),
        Metering::Off => TrailMetering::default(),
    };
    let mut samples = trace.lamps.iter().flat_map(|lamp| &lamp.samples);
    if !samples.any(|sample| is_exposed(sample, camera)) {
        return None;
    }
    let camera = reference_camera(camera, options);
    let readings = meter(trace, &camera).ok()?;
    let brightest = readings.iter().max_by(|a, b| a.median_stops.total_cmp(&b.median_stops))?;
    let trail_stops = brightest.median_stops;
    let room_stops = photo.ambient_stops(&camera);
    let channel_stops = color_stops(trace, &camera, &brightest.name);
    let (stops, keeps_room_dark) =
        correction_stops(&targets, channel_stops, trail_stops, room_stops);
    let (f_number, iso) = settings(options, &camera, stops);
    // The settings have steps and limits. A filter compensates for the remaining overexposure.
    let opened_stops = 2.0 * libm::log2(camera.f_number / f_number);
    let excess_stops = opened_stops + libm::log2(iso / camera.iso) - stops;
    let set_stops = stops + excess_stops;
    let open_s = camera.shutter_close_s - camera.shutter_open_s;
    let fixed = options.body.fixed_lens();
    Some(Metered {
        f_number,
        iso,
        trail_stops: trail_stops + set_stops,
        room_stops: room_stops.map(|room_stops| room_stops + set_stops),
        keeps_room_dark: keeps_room_dark && excess_stops < 0.5,
        #[expect(clippy::cast_possible_truncation, reason = "a few stops")]
        filter_stops: excess_stops.max(0.0).round() as u32,
        longest_s: fixed.map(|lens| lens.longest_s).filter(|longest_s| *longest_s < open_s),
    })
}

/// Returns the stops by which the exposure must change to reach the targets, and true if the trail
/// is darker than its target to keep the room dark. `channel_stops` contains the exposures of the
/// strongest channel of colored light and of white light, `trail_stops` that of the trail, and
/// `room_stops` that of the room.
fn correction_stops(
    targets: &TrailMetering,
    channel_stops: [Option<f64>; 2],
    trail_stops: f64,
    room_stops: Option<f64>,
) -> (f64, bool) {
    // A clipped channel shifts a color toward white, so the strongest decides. White may clip.
    let (target_stops, metered_stops) = match channel_stops {
        [None, _] => (targets.trail_stops, trail_stops),
        [Some(color), Some(white)] if targets.trail_stops - white < targets.color_stops - color => {
            (targets.trail_stops, white)
        }
        [Some(color), _] => (targets.color_stops, color),
    };
    // The trail is exposed less to keep the room dark, but not below the minimum for a trail.
    let wanted_stops = target_stops - metered_stops;
    let least_stops = targets.least_stops.min(target_stops) - metered_stops;
    let most_stops = room_stops.map_or(f64::INFINITY, |room_stops| targets.room_stops - room_stops);
    let stops = wanted_stops.min(most_stops).max(least_stops);
    (stops, stops < wanted_stops - TOLERATED_STOPS)
}

/// Returns the camera for metering, whose width, aperture and sensitivity are always the same, so
/// that readings do not depend on them.
fn reference_camera(camera: &Camera, options: &CameraOptions) -> Camera {
    let aspect = f64::from(camera.height_px) / f64::from(camera.width_px);
    #[expect(clippy::cast_possible_truncation, reason = "a side")]
    let height_px = (f64::from(WIDTH_PX) * aspect).ceil() as u32;
    let (width_px, f_number, iso) = (WIDTH_PX, REFERENCE_F_NUMBER, REFERENCE_ISO);
    let vignetting = options.vignetting_at(f_number);
    Camera { f_number, iso, vignetting, width_px, height_px, ..camera.clone() }
}

/// Returns the f-number and the ISO sensitivity whose exposure is `stops` above that of `camera`,
/// as closely as possible. The sensitivity compensates for what the aperture cannot provide.
fn settings(options: &CameraOptions, camera: &Camera, stops: f64) -> (f64, f64) {
    // The aperture of a phone is fixed, so only the sensitivity can be set.
    let min_f_number = options.lens.figures().min_f_number;
    let fixed = options.body.fixed_lens();
    let f_number = match &fixed {
        Some(lens) => lens.f_number,
        None => {
            let wanted = camera.f_number * libm::exp2(-0.5 * stops);
            nearest(F_NUMBERS.into_iter().filter(|f| *f >= min_f_number), wanted)
        }
    };
    let opened_stops = 2.0 * libm::log2(camera.f_number / f_number);
    let [min_iso, max_iso] = fixed.map_or(USUAL_ISO, |lens| lens.iso);
    let isos = ISOS.into_iter().filter(|iso| (min_iso..=max_iso).contains(iso));
    (f_number, nearest(isos, camera.iso * libm::exp2(stops - opened_stops)))
}

/// Returns the number whose ratio to `wanted` is closest to 1.
fn nearest(numbers: impl Iterator<Item = f64>, wanted: f64) -> f64 {
    let distances = numbers.map(|number| (libm::log2(number / wanted).abs(), number));
    distances.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(wanted, |(_, number)| number)
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::camera::{BodyModel, LensModel};
    use noctograph_picture::light::csv::read;

    /// Luminous intensity of a headlight, and of the surfaces that it illuminates, from the side.
    const SIDE_CD: f64 = 0.09;

    /// Returns the light of a lamp that moves past for two seconds.
    fn trail([r, g, b]: [f64; 3]) -> LightTrace {
        let mut csv = "t,x,y,z,r,g,b\n".to_owned();
        for i in 0..=200 {
            let t = f64::from(i) / 100.0;
            csv += &format!("{t},{:.4},0,0.75,{r},{g},{b}\n", 0.2 * t - 0.2);
        }
        read(csv.as_bytes(), "a.csv").unwrap().product
    }

    /// Meters a lamp of `candela` that moves past for two seconds, in an exposure of `open_s`.
    fn pass(
        candela: f64,
        open_s: f64,
        change: fn(&mut CameraOptions),
    ) -> (Camera, Option<Metered>) {
        let trace = trail([candela; 3]);
        let mut options = CameraOptions {
            metering: Metering::Trail(TrailMetering::default()),
            shutter_close_s: Some(open_s),
            ..CameraOptions::default()
        };
        change(&mut options);
        let mut camera = options.camera([-0.6, 0.5, 0.6, 1.0], 2.0).unwrap();
        let photo = PhotoOptions { ambient_cd_m2: 0.008, ..PhotoOptions::default() };
        let metered = metered(&trace, &mut camera, &options, &photo);
        (camera, metered)
    }

    #[test]
    fn a_short_trail_is_a_stop_over_and_a_long_exposure_leaves_the_room_dark() {
        let (camera, short) = pass(SIDE_CD, 30.0, |_| {});
        let short = short.unwrap();
        assert!((short.trail_stops - 1.0).abs() < 0.2 && !short.keeps_room_dark, "{short:?}");
        assert_eq!((camera.f_number, camera.iso), (short.f_number, short.iso));
        let long = pass(SIDE_CD, 300.0, |_| {}).1.unwrap();
        assert!(long.keeps_room_dark && long.f_number > short.f_number, "{long:?}");
        assert!((long.room_stops.unwrap() + 7.0).abs() < 0.25, "{long:?}");
        // No room stays dark for an hour, so the trail takes precedence.
        let hour = pass(SIDE_CD, 3600.0, |_| {}).1.unwrap();
        assert!((hour.trail_stops + 1.0).abs() < 0.2, "{hour:?}");
    }

    #[test]
    fn a_colored_trail_is_metered_by_its_strongest_channel() {
        // At luminance 1, the strongest channel of red is 4.7 times as strong, or 2.2 stops.
        fn of_color(rgb: [f64; 3]) -> f64 {
            let trace = trail(rgb);
            let options = CameraOptions {
                metering: Metering::Trail(TrailMetering::default()),
                ..CameraOptions::default()
            };
            let mut camera = options.camera([-0.6, 0.5, 0.6, 1.0], 2.0).unwrap();
            let dark = PhotoOptions { ambient_cd_m2: 0.0, ..PhotoOptions::default() };
            metered(&trace, &mut camera, &options, &dark).unwrap().trail_stops
        }
        let (red, white) = (of_color([0.04, 0.0, 0.0]), of_color([0.01; 3]));
        assert!((red + 0.5 + libm::log2(1.0 / 0.2126)).abs() < 0.2, "{red}");
        assert!((white - 1.0).abs() < 0.2, "{white}");
        let orange = of_color([0.04, 0.015, 0.0]);
        let luminance = 0.2126 + 0.7152 * 0.015 / 0.04;
        assert!((orange + 0.5 + libm::log2(1.0 / luminance)).abs() < 0.2, "{orange}");
    }

    #[test]
    fn a_faint_lamp_raises_the_sensitivity_where_the_lens_opens_no_further() {
        let faint = pass(0.004, 0.5, |_| {}).1.unwrap();
        assert_eq!(faint.f_number, 2.8);
        assert!(faint.iso > 100.0 && (faint.trail_stops - 1.0).abs() < 0.2, "{faint:?}");
        let kit = pass(0.004, 0.5, |options| options.lens = LensModel::Kit16).1.unwrap();
        assert!(kit.f_number == 3.5, "{kit:?}");
    }

    #[test]
    fn a_telephone_sets_its_sensitivity_alone_and_says_what_it_lacks() {
        fn on_phone(candela: f64, open_s: f64) -> Metered {
            let (camera, metered) =
                pass(candela, open_s, |options| options.body = BodyModel::GalaxyS24);
            let metered = metered.unwrap();
            assert_eq!((camera.f_number, metered.f_number), (1.8, 1.8));
            assert_eq!(camera.iso, metered.iso);
            metered
        }
        let faint = on_phone(4e-3, 2.0);
        assert!(faint.iso > 50.0 && (faint.trail_stops - 1.0).abs() < 0.2, "{faint:?}");
        assert_eq!(faint.help(), None);
        // The recommended filter would correct the exposure.
        let bright = on_phone(0.5, 31.0);
        assert_eq!(bright.iso, 50.0);
        let filtered = bright.trail_stops - f64::from(bright.filter_stops);
        assert!((filtered - 1.0).abs() < 0.51 && bright.filter_stops >= 2, "{bright:?}");
        let help = bright.help().unwrap();
        assert!(help.contains("light-trail mode") && help.contains("30 s"), "{help}");
        assert!(help.contains(&format!("filter of {} stops", bright.filter_stops)), "{help}");
        // A lens with an iris requires a filter only if f/22 is not small enough.
        assert_eq!(pass(SIDE_CD, 31.0, |_| {}).1.unwrap().help(), None);
        assert!(pass(1e3, 31.0, |_| {}).1.unwrap().filter_stops > 3);
    }

    #[test]
    fn the_start_does_not_matter_and_off_is_off() {
        let apart = pass(SIDE_CD, 30.0, |options| (options.f_number, options.iso) = (22.0, 800.0));
        assert_eq!(apart.0, pass(SIDE_CD, 30.0, |_| {}).0);
        fn small(options: &mut CameraOptions) {
            (options.width_px, options.height_px) = (480, 270);
        }
        assert_eq!(
            pass(SIDE_CD, 30.0, small).1,
            pass(SIDE_CD, 30.0, |_| {}).1,
            "the picture's size"
        );
        let unmetered = pass(SIDE_CD, 30.0, |options| options.metering = Metering::Off);
        assert_eq!((unmetered.0.f_number, unmetered.1), (8.0, None));
        assert_eq!(pass(0.0, 30.0, |_| {}).1, None, "darkness");
    }
}
