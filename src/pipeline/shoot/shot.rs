//! A photograph with all intermediate products.

use std::io::Write;
use std::sync::OnceLock;

use super::file::{Format, Shown, encode};
use super::problems::{self, UNDEREXPOSED};
use super::{Judging, Lighting, Metered, Shoot};
use noctograph_core::camera::Camera;
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::error::Result;
use noctograph_core::flight::Flight;
use noctograph_core::parallel;
use noctograph_picture::expose::{Backend, Exposure, Film, Latent, project};
use noctograph_picture::light::LightTrace;
use noctograph_picture::light::gaps::{Gap, dark};
use noctograph_picture::photo::{Photo, develop, reflectance};
use noctograph_plan::PlanOptions;
use noctograph_plan::tracking::{Part, Tracking, track};
use noctograph_score::{Known, LogGap, Marks, Reader, Reason, Verdict, View};

/// A photograph with all intermediate products.
#[derive(Clone, Debug)]
pub struct Shot {
    /// Scene, strokes and plans of the photograph, without recordings.
    pub shoot: Shoot,
    /// Flights, one for each drone. Empty for recorded light.
    pub flights: Vec<Flight>,
    /// Lamps of all drones.
    pub trace: LightTrace,
    /// Camera that took the photo.
    pub camera: Camera,
    /// Settings chosen by the light meter. `None` without metering.
    pub metered: Option<Metered>,
    /// Exposed film, if [`Shoot::keeps_film`] is true.
    pub film: Option<Film>,
    /// Backend that exposed the film.
    pub backend: Backend,
    /// Name and driver of the graphics device, or `CPU` without one.
    pub adapter: String,
    /// The photo.
    pub photo: Photo,
    /// Contents of the photo's file in [`Shoot::format`].
    pub file: Option<Vec<u8>>,
    /// Verdict of the reader. `None` if reading is skipped, for a drawing, and for a word in
    /// letters that the reader does not know.
    pub verdict: Option<Verdict>,
    /// Marks of the reader in the picture, if faults were searched for ([`Judging::Explained`]).
    pub marks: Option<Marks>,
    /// Problems of flights and picture, beginning with those that make any word unreadable.
    pub problems: Vec<Diagnostic>,
    digests: OnceLock<Vec<String>>,
    tracking: OnceLock<Vec<Option<Tracking>>>,
}

impl Shot {
    /// Returns the SHA-256 of each flight.
    pub fn digests(&self) -> &[String] {
        self.digests.get_or_init(|| digests(&self.flights))
    }

    /// Returns the tracking errors of each flight, or `None` for a flight without a design.
    pub fn tracking(&self) -> &[Option<Tracking>] {
        self.tracking.get_or_init(|| tracking(&self.flights))
    }

    /// Returns the SHA-256 of the flights, separated by spaces, or `None` without flights.
    pub fn flight_sha256(&self) -> Option<String> {
        joined(self.digests())
    }

    /// Calls `put` with the name and the contents of each file: the photo (PNG), and each drone's
    /// flight and plan, numbered if there are several drones. `put` writes a file and returns its
    /// SHA-256. Returns the names and digests of flights and plans, for the scene next to them.
    ///
    /// # Errors
    ///
    /// Returns the errors of `put`.
    pub fn each_file(
        &self,
        mut put: impl FnMut(&str, &WriteFile<'_>) -> Result<String>,
    ) -> Result<Vec<(String, String)>> {
        if let Some(png) = &self.file {
            put("photo.png", &|out| out.write_all(png))?;
        }
        // The scene next to the files contains these digests. The photo contains its own scene.
        let mut digests = Vec::new();
        for (index, (flight, planned)) in self.flights.iter().zip(&self.shoot.plans).enumerate() {
            let number = match self.shoot.plans.len() {
                1 => String::new(),
                _ => format!("-{}", index + 1),
            };
            let [flown, plan] = ["flight", "plan"].map(|kind| format!("{kind}{number}.csv"));
            let sha256 = put(&flown, &|mut out| flight.write_csv(&mut out))?;
            digests.push((flown, sha256));
            let sha256 = put(&plan, &|mut out| planned.plan.write_csv(&mut out))?;
            digests.push((plan, sha256));
        }
        Ok(digests)
    }
}

/// Function that writes the contents of a file.
pub type WriteFile<'a> = dyn Fn(&mut dyn Write) -> std::io::Result<()> + 'a;

/// Returns the SHA-256 of flights, separated by spaces, or `None` without flights.
pub fn flight_sha256(flights: &[Flight]) -> Option<String> {
    joined(&digests(flights))
}

/// Returns the SHA-256 of each flight.
fn digests(flights: &[Flight]) -> Vec<String> {
    flights.iter().map(|flight| flight.sha256()).collect()
}

/// Returns the tracking errors of each flight, or `None` for a flight without a design.
fn tracking(flights: &[Flight]) -> Vec<Option<Tracking>> {
    flights.iter().map(|flight| track(flight, Part::from_flight(flight)).ok()).collect()
}

/// Returns digests separated by spaces, or `None` if there are none.
fn joined(digests: &[String]) -> Option<String> {
    (!digests.is_empty()).then(|| digests.join(" "))
}

impl Shoot {
    /// Exposes the film with `add_up`, develops it, encodes the photo and reads it.
    pub(super) fn expose(
        self,
        lighting: Lighting,
        add_up: impl FnOnce(Latent) -> Result<Exposure> + Send,
        reader: Option<&Reader>,
    ) -> Result<Shot> {
        let Lighting { flights, trace, camera, metered, mut problems, .. } = lighting;
        let scene = &self.scene;
        // 1. The film is exposed and developed.
        if let Some(format) = self.format {
            format.check([camera.width_px, camera.height_px])?;
        }
        let latent = project(&trace, &camera, &scene.expose)?;
        let latent = latent.reflected_by(reflectance(&camera, &scene.photo)?);
        // The scene's text is written while a graphics device opens.
        let (exposure, scene_toml) =
            parallel::join(|| add_up(latent), || self.format.map(|_| scene.portable().to_toml()));
        let Exposure { film, backend, adapter } = exposure?;
        let mut photo = develop(&film, &camera, &scene.expose, &scene.photo, scene.seed)?;
        let is_read_out = matches!(self.format, Some(Format::Png16 | Format::Exr));
        let (film, unused) =
            if self.keeps_film || is_read_out { (Some(film), None) } else { (None, Some(film)) };
        self.stop.check()?;
        photo.edit(|photo| photo.scene_toml = scene_toml);
        // 2. Reading, encoding and the search for problems run in parallel.
        let (digests, tracking) = (OnceLock::new(), OnceLock::new());
        let (read, (file, exposed)) = parallel::join(
            || self.read(reader, &photo, &camera, &flights, &tracking),
            || {
                drop(unused);
                parallel::join(
                    || self.encoded(&photo, film.as_ref(), &camera, &flights, &digests),
                    || problems::exposure_obstacle(&photo, &camera),
                )
            },
        );
        let ((mut verdict, marks), file) = (read?, file?);
        // 3. Obstacles are taken into account in the verdict on the letters.
        add_exposure_problem(exposed, &mut problems, verdict.as_mut());
        Ok(Shot {
            film: film.filter(|_| self.keeps_film),
            shoot: self,
            flights,
            trace,
            camera,
            metered,
            backend,
            adapter,
            photo,
            file,
            verdict,
            marks,
            problems,
            digests,
            tracking,
        })
    }

    /// Encodes the photo in [`Self::format`], or returns `None` if no format is set. Computes the
    /// digests of the flights if `known_digests` is empty.
    fn encoded(
        &self,
        photo: &Photo,
        film: Option<&Film>,
        camera: &Camera,
        flights: &[Flight],
        known_digests: &OnceLock<Vec<String>>,
    ) -> Result<Option<Vec<u8>>> {
        let Some(format) = self.format else { return Ok(None) };
        // The scene does not contain the strokes of a user's file, so the photo states their
        // digest.
        let from_file = self.scene.letters.files().next().is_some();
        let strokes = self.strokes.as_ref().filter(|_| from_file);
        let shown = Shown {
            flight_sha256: joined(known_digests.get_or_init(|| digests(flights))),
            strokes_sha256: strokes.map(|strokes| strokes.sha256()),
            log_gaps: flights.iter().flat_map(log_gaps).collect(),
        };
        encode(format, &self.scene, photo, film, camera, shown).map(Some)
    }

    /// Reads the photo. Returns the verdict if there is a reader, and its marks if faults are
    /// searched for. Computes the tracking errors if `tracked` is empty.
    fn read(
        &self,
        reader: Option<&Reader>,
        photo: &Photo,
        camera: &Camera,
        flights: &[Flight],
        tracked: &OnceLock<Vec<Option<Tracking>>>,
    ) -> Result<(Option<Verdict>, Option<Marks>)> {
        let Some(reader) = reader else { return Ok((None, None)) };
        let view = View::from(camera);
        if self.judging != Judging::Explained {
            return Ok((Some(reader.score(photo, &view)?), None));
        }
        let tracked = tracked.get_or_init(|| tracking(flights));
        let known = known_of(flights, tracked, &self.scene.plan);
        let (verdict, marks) = reader.explain(photo, &view, &known)?;
        Ok((Some(verdict), Some(marks)))
    }
}

/// Adds the exposure problem, if there is one, to the problems, and updates the verdict for
/// obstacles.
fn add_exposure_problem(
    exposed: Option<Diagnostic>,
    problems: &mut Vec<Diagnostic>,
    mut verdict: Option<&mut Verdict>,
) {
    if let Some(exposed) = exposed {
        // The reader amplifies faint light, and may find letters in noise.
        let is_dark = exposed.code == UNDEREXPOSED;
        if let Some(verdict) = verdict.as_mut().filter(|_| is_dark) {
            verdict.refuse(Reason::NoLight);
        }
        // An obstacle found earlier explains the missing trail, and therefore stays first.
        let is_hidden = problems.first().is_some_and(Diagnostic::is_stop);
        problems.insert(usize::from(is_hidden), exposed);
    }
    let is_hidden = problems.first().is_some_and(Diagnostic::is_stop);
    if let Some(verdict) = verdict.filter(|verdict| !verdict.legible && is_hidden) {
        // Advice about letters does not help against an obstacle.
        verdict.advice.clear();
    }
}

/// Returns facts about flights that help to explain their photo: speed along the strokes, distance
/// from the path and lag (means over the drones), and the gaps in logs.
pub fn known(flights: &[Flight], plan: &PlanOptions) -> Known {
    known_of(flights, &tracking(flights), plan)
}

/// Returns the facts as [`known`] does, from tracking errors that were already computed.
fn known_of(flights: &[Flight], tracked: &[Option<Tracking>], plan: &PlanOptions) -> Known {
    let tracked: Vec<&Tracking> = tracked.iter().flatten().collect();
    Known {
        speed_m_s: (!flights.is_empty()).then_some(plan.stroke_speed_m_s),
        contour_m: mean(tracked.iter().map(|tracking| tracking.contour.mean_m)),
        lag_s: mean(tracked.iter().map(|tracking| tracking.lag_s)),
        gaps: flights.iter().flat_map(log_gaps).collect(),
    }
}

/// Returns the mean of the values, or `None` without values.
fn mean(values: impl ExactSizeIterator<Item = f64>) -> Option<f64> {
    let n = values.len();
    (n > 0).then(|| values.sum::<f64>() / n as f64)
}

/// Maximum number of log gaps listed in a photo's file. The reference flight has three.
const MAX_LOG_GAPS: usize = 1000;

/// Returns the gaps in a real flight's log during which its photo is dark, up to [`MAX_LOG_GAPS`].
fn log_gaps(flight: &Flight) -> Vec<LogGap> {
    let mut gaps = Vec::new();
    for (Gap { span_s, .. }, way_m) in dark(flight) {
        // The positions are those at the start and the end of the gap.
        let ends_m = span_s.map(|time_s| {
            let row = flight.samples.partition_point(|sample| sample.time_s < time_s);
            flight.samples.get(row).map(|sample| [sample.position_m.x, sample.position_m.z])
        });
        if let [Some(from_m), Some(to_m)] = ends_m {
            gaps.push(LogGap { span_s, ends_m: [from_m, to_m], way_m });
        }
    }
    gaps.truncate(MAX_LOG_GAPS);
    gaps
}
