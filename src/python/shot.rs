//! Shots, which are photographs with their flights and verdicts.

use std::path::PathBuf;

use base64::prelude::{BASE64_STANDARD, Engine};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use super::flight::PyFlight;
use super::scene::PyScene;
use super::{Reduced, array_of, raised, refused, run, save, to_python, warn};
use noctograph::cli::verdict_table;
use noctograph::diagnostic::{Change, Diagnostic, Warned};
use noctograph::error::Error;
use noctograph::expose::Film;
use noctograph::logs::ImportOptions;
use noctograph::photo::flip::difference;
use noctograph::photo::{self, Photo, PhotoData};
use noctograph::report::{escaped, photos::shrink};
use noctograph::scene::Scene;
use noctograph::score::{Reader, Reason, View};
use noctograph::shoot::{Format, Recording, Shoot, Shot, Stop, infer_lights_if_dark, is_dark};

/// A photograph, its flights and its verdict.
#[pyclass(frozen, name = "Shot", module = "noctograph")]
#[derive(Debug)]
pub(super) struct PyShot {
    shot: Shot,
    image: Py<PyAny>,
    /// Warnings about the flights and their files.
    warnings: Vec<Diagnostic>,
}

/// Maximum size of a picture in a notebook, in bytes. In base64, this is 200 kB.
const MOST_BYTES: usize = 150_000;

impl PyShot {
    /// Returns the film, which `photograph` always keeps.
    fn film(&self) -> &Film {
        self.shot.film.as_ref().expect("its shoot keeps it")
    }

    /// Returns the photo as a JPEG of at most [`MOST_BYTES`], at a reduced quality or size if
    /// necessary.
    fn small_jpeg(&self) -> Vec<u8> {
        let mut photo = self.shot.photo.clone();
        loop {
            // Below a quality of 60, JPEG blocks are visible, so the sides are halved instead.
            for quality in [90, 75, 60] {
                let bytes = photo::jpeg(&photo, quality);
                if bytes.len() <= MOST_BYTES || photo.width_px.min(photo.height_px) < 2 {
                    return bytes;
                }
            }
            let longest_px = photo.width_px.max(photo.height_px) / 2;
            photo = shrink(photo, longest_px);
        }
    }
}

#[pymethods]
impl PyShot {
    /// numpy.ndarray: The photo, shape (height, width, 3), uint8, sRGB. Read-only.
    #[getter]
    fn image<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        self.image.bind(py).clone()
    }

    /// noctograph.answers.Verdict or None: The verdict, a dict with the keys of ``verdict.json``. None for a
    /// drawing.
    #[getter]
    fn verdict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &self.shot.verdict)
    }

    /// bool: True if a viewer reads the word and no other.
    #[getter]
    fn legible(&self) -> bool {
        self.shot.verdict.as_ref().is_some_and(|verdict| verdict.legible)
    }

    /// list of str: The warnings of the flights, and those of ``noctograph expose``: light outside the picture,
    /// lamps that are dark or face away, a shutter that misses the word. Each is one sentence.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        let of_flights = self.warnings.iter().map(ToString::to_string);
        of_flights.chain(problems(&self.shot)).collect()
    }

    /// list of Flight: One for each drone.
    #[getter]
    fn flights(&self) -> Vec<PyFlight> {
        self.shot.flights.iter().cloned().map(PyFlight::new).collect()
    }

    /// Scene: The photo's scene, with the exposure that the light meter set.
    #[getter]
    fn scene(&self) -> PyScene {
        PyScene(self.shot.shoot.scene.clone())
    }

    /// str: SHA-256 digest of the film's sums of light, as the command line prints it.
    #[getter]
    fn film_sha256(&self) -> String {
        self.film().sha256()
    }

    /// numpy.ndarray: Luminous exposure from the lamps in lx s, linear sRGB, shape (height, width,
    /// 3), float32. The values exclude the room's light and the sensor's noise and limits.
    #[getter]
    fn film_lx_s<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let film = self.film();
        let n_pixels = film.counts.len() / 3;
        let lx_s = (0..n_pixels)
            .flat_map(|pixel| [0, 1, 2].map(|channel| film.exposure_lx_s(channel, pixel)));
        #[expect(clippy::cast_possible_truncation, reason = "24 bits are finer than a photo needs")]
        let lx_s: Vec<f32> = lx_s.map(|lx_s| lx_s as f32).collect();
        let shape = [film.height_px as usize, film.width_px as usize, 3];
        array_of(py, bytemuck::cast_slice(&lx_s), "f4", &shape)
    }

    /// Returns the photo as PNG with its scene, the same bytes as ``noctograph preview`` writes.
    fn to_png<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, self.shot.file.as_deref().unwrap_or_default())
    }

    /// Writes ``to_png`` to a file, which appears when it is complete.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        save(py, &path, self.shot.file.as_deref().unwrap_or_default())
    }

    /// Supports pickle, by which the photo is taken again from the same flights.
    fn __reduce__(&self, py: Python<'_>) -> PyResult<Reduced<(PyScene, Vec<PyFlight>)>> {
        let photograph = py.import("noctograph")?.getattr("photograph")?;
        Ok((photograph.unbind(), (self.scene(), self.flights())))
    }

    /// Returns a JPEG for notebooks, at most 200 kB. ``to_png`` and ``save`` provide the photo
    /// itself.
    fn _repr_jpeg_<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.small_jpeg())
    }

    /// Returns HTML with the photo, at most 200 kB, and the verdict as ``noctograph score`` prints it.
    fn _repr_html_(&self) -> String {
        let jpeg = BASE64_STANDARD.encode(self.small_jpeg());
        let table = self.shot.verdict.as_ref().map_or_else(String::new, verdict_table);
        format!(
            "<img width=\"100%\" src=\"data:image/jpeg;base64,{jpeg}\"><pre>{}</pre>",
            escaped(&table)
        )
    }

    /// Returns the photo's width and height in pixels and whether its word is legible, in angle
    /// brackets.
    fn __repr__(&self) -> String {
        let (width, height) = (self.shot.photo.width_px, self.shot.photo.height_px);
        let verdict = self.shot.verdict.as_ref().map_or_else(String::new, |verdict| {
            let not = if verdict.legible { "" } else { "not " };
            format!(", {} reads as {}: {not}legible", verdict.word, verdict.read)
        });
        format!("<Shot: {width} × {height}{verdict}>")
    }
}

/// Photographs the given flights, or those of a scene's plans.
///
/// Parameters
/// ----------
/// scene : Scene
///     Word, lamps, camera and seed. Without a word the photo is not read.
/// flights : Flight, str or os.PathLike, or list of them, optional
///     One for each drone, from any simulator, or files: flights, logs, and light traces (a lamp's positions,
///     directions and candela, as ``noctograph expose`` reads them). By default the scene's plans are flown. The
///     exposure begins with the first of them. A log without lights gets those of the scene's word.
///
/// Returns
/// -------
/// Shot
///     Its ``warnings`` list problems and doubts, which are also issued as `NoctographWarning`.
#[pyfunction]
#[pyo3(signature = (scene, flights = None))]
pub(super) fn photograph(
    py: Python<'_>,
    scene: &PyScene,
    flights: Option<Bound<'_, PyAny>>,
) -> PyResult<PyShot> {
    let mut scene = scene.0.clone();
    let recordings = flights.map(|flights| recordings_of(py, &flights, &scene)).transpose()?;
    let (recordings, warnings) = recordings
        .map_or((None, Vec::new()), |Warned { product, warnings }| (Some(product), warnings));
    let stop = Stop::default();
    let inner_stop = stop.clone();
    let shot = run(py, &stop, move || {
        let shoot = match recordings {
            None => Shoot::new(scene)?,
            Some(mut recordings) => {
                // A log without lights gets those of the scene's word.
                for recording in &mut recordings {
                    if let Recording::Flight(flight) = recording {
                        infer_lights_if_dark(flight, &mut scene)?;
                    }
                }
                Shoot::with_recordings(scene, recordings)?
            }
        };
        Shoot { format: Some(Format::Png), stop: inner_stop, ..shoot }.take(&|_, _| {})
    })?;
    warn(py, problems(&shot))?;
    let shape = [shot.photo.height_px as usize, shot.photo.width_px as usize, 3];
    let image = array_of(py, &shot.photo.rgb8, "u1", &shape)?;
    // The array is read-only, because every caller gets the same array.
    image.call_method1("setflags", (false,))?;
    Ok(PyShot { image: image.unbind(), shot, warnings })
}

/// Returns the problems of a shot, each as a sentence.
fn problems(shot: &Shot) -> impl Iterator<Item = String> {
    shot.problems.iter().map(|problem| problem.sentence(Change::to_string))
}

/// Returns the recordings in `flights`, which is one or an iterable of them, with all their
/// warnings. Each is a flight or the path of a file. Issues only the warnings about files, because
/// those about flights were issued when the flights were created.
fn recordings_of(
    py: Python<'_>,
    flights: &Bound<'_, PyAny>,
    scene: &Scene,
) -> PyResult<Warned<Vec<Recording>>> {
    // A single path is recognized first, because a string is also iterable.
    let is_one = flights.cast::<PyFlight>().is_ok() || flights.extract::<PathBuf>().is_ok();
    let flights: Vec<Bound<'_, PyAny>> = match flights.try_iter() {
        Ok(each) if !is_one => each.collect::<PyResult<_>>()?,
        // A value that is neither a flight nor an iterable of flights is refused below.
        _ => vec![flights.clone()],
    };
    if flights.is_empty() {
        let hint = "leave it out to fly the scene's plans";
        return Err(refused(py, "flights", "none", "one for each drone", hint));
    }
    let firmware = Some(scene.vehicle.firmware);
    let options = ImportOptions { firmware, ..ImportOptions::default() };
    let mut recordings = Warned::<Vec<Recording>>::default();
    for flight in flights {
        if let Ok(flight) = flight.cast::<PyFlight>() {
            let flight = &flight.get().flight;
            recordings.warnings.extend(flight.warnings.iter().cloned());
            recordings.product.push(Recording::Flight(flight.clone()));
            continue;
        }
        let Warned { product, warnings } = recording_in_file(&flight, &options)?;
        recordings.warnings.extend(warnings);
        recordings.product.push(product);
    }
    Ok(recordings)
}

/// Reads the recording in the file whose path is the value `path`, and issues its warnings. Raises
/// `InputError` for a value that is no path.
fn recording_in_file(
    path: &Bound<'_, PyAny>,
    options: &ImportOptions,
) -> PyResult<Warned<Recording>> {
    let py = path.py();
    let file = path.extract::<PathBuf>().map_err(|_no_path| {
        let actual = path.get_type().to_string();
        let hint = "make a Flight from its columns: nc.Flight(time_s, position_m, light=on)";
        raised(py, &Error::input("flights", actual, "a Flight, or a file's path", hint))
    })?;
    let read = Recording::read(&file, options);
    let Warned { product, warnings } = read.map_err(|error| raised(py, &error))?;
    let name = file.display().to_string();
    let warnings: Vec<_> = warnings.into_iter().map(|warning| warning.in_file(&name)).collect();
    warn(py, warnings.iter().map(ToString::to_string))?;
    Ok(Warned { product, warnings })
}

/// Scores the photo of a scene's word, taken by its camera.
///
/// Parameters
/// ----------
/// image : numpy.ndarray
///     Photo, shape (height, width, 3), uint8, sRGB.
/// scene : Scene
///     Word, letters and camera.
///
/// Returns
/// -------
/// noctograph.answers.Verdict
///     The verdict, a dict with the keys of ``verdict.json``.
#[pyfunction]
pub(super) fn score<'py>(
    py: Python<'py>,
    image: &Bound<'py, PyAny>,
    scene: &PyScene,
) -> PyResult<Bound<'py, PyAny>> {
    let photo = pixels(image)?;
    let (width_px, height_px) = (photo.width_px, photo.height_px);
    let mut scene = scene.0.clone();
    (scene.camera.width_px, scene.camera.height_px) = (width_px, height_px);
    // The scene's camera determines the position of the word in the photo.
    let stage = move || {
        let strokes = scene.strokes()?;
        let camera = scene.camera.camera(strokes.bounds_m(), 0.0)?;
        let mut verdict =
            Reader::new(&strokes, &scene.score)?.score(&photo, &View::from(&camera))?;
        if is_dark(&photo, &camera) {
            verdict.refuse(Reason::NoLight);
        }
        Ok(verdict)
    };
    to_python(py, &run(py, &Stop::default(), stage)?)
}

/// Returns the mean FLIP difference between a photo and the photo in a file, 0 to 1, and the bytes
/// of a PNG that shows the difference. If their sizes differ, returns 1 and no bytes. See
/// `noctograph/testing.py`.
#[pyfunction]
pub(super) fn flip<'py>(
    py: Python<'py>,
    wanted: PathBuf,
    found: &PyShot,
) -> PyResult<(f64, Bound<'py, PyBytes>)> {
    let wanted = photo::read(&wanted).map_err(|error| raised(py, &error))?;
    let actual = &found.shot.photo;
    if (wanted.width_px, wanted.height_px) != (actual.width_px, actual.height_px) {
        return Ok((1.0, PyBytes::new(py, &[])));
    }
    let difference = difference(&wanted, actual);
    let png = photo::encode_png(&difference.picture(), None, &[]);
    Ok((difference.mean(|_| true), PyBytes::new(py, &png)))
}

/// Reads a photograph without knowing its word.
///
/// Parameters
/// ----------
/// photo : str, os.PathLike or numpy.ndarray
///     PNG or JPEG, or an array of shape (height, width, 3), uint8, sRGB.
///
/// Returns
/// -------
/// str
///     The text, lines separated by ``\n``.
#[pyfunction]
pub(super) fn read(py: Python<'_>, photo: &Bound<'_, PyAny>) -> PyResult<String> {
    let pixels = if photo.hasattr("dtype")? { Some(pixels(photo)?) } else { None };
    let path = if pixels.is_none() { photo.extract()? } else { PathBuf::new() };
    run(py, &Stop::default(), move || {
        // Because the photo may be rotated, the most likely of four readings is returned.
        let photo = pixels.map_or_else(|| photo::read(&path), Ok)?;
        Ok(noctograph::score::read_any_way_up(&photo, "").0.of_writing().text)
    })
}

/// Converts an array of uint8 and shape (height, width, 3) to a photo. Raises `InputError` for
/// other arrays.
fn pixels(image: &Bound<'_, PyAny>) -> PyResult<Photo> {
    let py = image.py();
    let image = py.import("numpy")?.call_method1("ascontiguousarray", (image,))?;
    let shape: Vec<usize> = image.getattr("shape")?.extract()?;
    let dtype: String = image.getattr("dtype")?.str()?.extract()?;
    let sides = match (&*shape, &*dtype) {
        ([height, width, 3], "uint8") if height * width > 0 => {
            u32::try_from(*width).ok().zip(u32::try_from(*height).ok())
        }
        _ => None,
    };
    let Some((width_px, height_px)) = sides else {
        let (actual, wanted) =
            (format!("{dtype} of shape {shape:?}"), "uint8 of (height, width, 3)");
        return Err(refused(py, "image", actual, wanted, "leave out transparency"));
    };
    let bytes = image.call_method0("tobytes")?;
    let rgb8 = bytes.cast::<PyBytes>()?.as_bytes().to_vec();
    Photo::new(PhotoData { width_px, height_px, rgb8, scene_toml: None })
        .map_err(|error| raised(py, &error))
}
