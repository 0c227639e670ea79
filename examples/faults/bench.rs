//! Test bench of ten faults of the flight, the lamps or the camera, at six levels each. The example
//! beside this file photographs the faults, and `tests/it/faults.rs` compares their scores with a
//! golden table.
//!
//! The planner uses one scene. The flight and the photograph use another scene that contains the
//! fault as a setting of the simulator, the lamps or the camera. No such setting exists for two of
//! the faults. Lost light commands are removed from the plan, and underexposure is simulated by
//! dimmer lamps, because an exposure cannot be shorter than its flight.

use std::num::NonZero;
use std::sync::Mutex;

use nalgebra::Vector3;
use noctograph::camera::{Camera, CustomLens, ImagePoint, LensModel};
use noctograph::error::Result;
use noctograph::flight::Flight;
use noctograph::letters::{self, Strokes};
use noctograph::light::RingEffect;
use noctograph::plan::{EvenStyle, LightLevel, Plan, PlanOptions};
use noctograph::scene::{Preset, Scene};
use noctograph::score::Reader;
use noctograph::shoot::{Judging, Planned, Recording, Shoot, Shot};
use noctograph::sim::{ControllerKind, SimOptions};
use noctograph::studies::Conditions;

/// Number of levels of a fault.
pub(crate) const LEVELS: usize = 6;

/// Words over which each cell of the table is averaged. A word's index, from 1, is its seed.
pub(crate) const WORDS: [&str; 3] = ["NOOR", "HAZE", "JUMP"];

/// A fault that spoils a photograph.
pub(crate) struct Fault {
    pub(crate) name: &'static str,
    /// Unit of the levels.
    pub(crate) unit: &'static str,
    /// Levels from slight to severe.
    pub(crate) levels: [f64; LEVELS],
    /// Function that applies a level to a setting.
    pub(crate) turn: fn(&mut Setting, f64) -> Result<()>,
}

/// Scenes and conditions with which a word is photographed.
#[derive(Clone)]
pub(crate) struct Setting {
    /// Scene that the planner and the controller assume, including the word and its style.
    pub(crate) known: Scene,
    /// Scene that is flown and photographed.
    pub(crate) actual: Scene,
    /// Conditions that determine how the drone and its room differ from `actual`.
    pub(crate) conditions: Conditions,
    /// Fraction of each letter's light commands that are lost. The lost commands are consecutive.
    pub(crate) missing_frac: f64,
}

/// The ten faults, with levels for letters half a meter high that are written at 0.2 m/s.
pub(crate) const FAULTS: [Fault; 10] = [
    Fault {
        name: "wander",
        unit: "m/s of gusts",
        levels: [0.08, 0.12, 0.16, 0.19, 0.23, 0.28],
        turn: |setting, gust_m_s| {
            setting.conditions.gust_m_s = gust_m_s;
            Ok(())
        },
    },
    Fault {
        // The drone lags behind held positions by half a second, and therefore cuts corners.
        name: "lag",
        unit: "m/s by held positions",
        levels: [0.15, 0.2, 0.25, 0.3, 0.4, 0.6],
        turn: |setting, speed_m_s| {
            for scene in setting.scenes() {
                scene.controller.kind = ControllerKind::Lqr;
                scene.plan = PlanOptions { stroke_speed_m_s: speed_m_s, ..PlanOptions::default() };
            }
            Ok(())
        },
    },
    Fault {
        name: "LED latency",
        unit: "s",
        levels: [0.4, 0.8, 1.0, 1.2, 1.4, 1.7],
        turn: |setting, delay_s| {
            setting.actual.light.radio_delay_s += delay_s;
            Ok(())
        },
    },
    Fault {
        name: "missing run",
        unit: "of each letter",
        levels: [0.08, 0.15, 0.25, 0.35, 0.5, 0.65],
        turn: |setting, share| {
            setting.missing_frac = share;
            Ok(())
        },
    },
    Fault {
        name: "drift",
        unit: "m of Lighthouse distortion",
        levels: [0.02, 0.04, 0.06, 0.08, 0.1, 0.15],
        turn: |setting, sigma_m| {
            setting.conditions.lighthouse_distortion_m = sigma_m;
            Ok(())
        },
    },
    Fault {
        name: "spacing",
        unit: "m closer",
        levels: [0.05, 0.1, 0.2, 0.3, 0.4, 0.46],
        turn: |setting, closer_m| {
            // Letters of the box font cannot overlap, but those of simplex can.
            for scene in setting.scenes() {
                scene.letters.font = "simplex".into();
                scene.letters.spacing_m -= closer_m;
            }
            Ok(())
        },
    },
    Fault {
        // The lens at f/1.4 behind a gray filter is focused in front of the word.
        name: "blur",
        unit: "m across",
        levels: [0.1, 0.2, 0.3, 0.35, 0.4, 0.45],
        turn: |setting, circle_m| {
            let (placed, [middle, _, _]) = setting.sight()?;
            let camera = &mut setting.actual.camera;
            let aperture_m = placed.focal_length_m / 1.4;
            camera.lens = LensModel::Custom(CustomLens {
                focal_length_m: placed.focal_length_m,
                distortion: placed.distortion,
            });
            camera.transmission *= (1.4 / camera.f_number) * (1.4 / camera.f_number);
            camera.f_number = 1.4;
            camera.focus_m = Some(middle.depth_m / (1.0 + circle_m / aperture_m));
            Ok(())
        },
    },
    Fault {
        name: "resolution",
        unit: "px a capital",
        levels: [30.0, 20.0, 14.0, 7.0, 5.0, 3.0],
        turn: |setting, cap_px| {
            let (_, [_, foot, head]) = setting.sight()?;
            let camera = &mut setting.actual.camera;
            let smaller = cap_px / (foot.y_px - head.y_px);
            #[expect(clippy::cast_possible_truncation, reason = "smaller")]
            let side = |side_px: u32| (f64::from(side_px) * smaller).round() as u32;
            [camera.width_px, camera.height_px] = [camera.width_px, camera.height_px].map(side);
            Ok(())
        },
    },
    Fault {
        name: "exposure",
        unit: "stops less light",
        levels: [8.0, 9.5, 10.0, 10.2, 10.5, 11.0],
        turn: |setting, stops| {
            let light = &mut setting.actual.light;
            let lamps = light.fixtures();
            for fixture in light.fixtures.insert(lamps) {
                fixture.dies.iter_mut().for_each(|die| die.intensity_cd *= libm::exp2(-stops));
            }
            Ok(())
        },
    },
    Fault {
        name: "mixture",
        unit: "of wander, lateness, gaps and blur",
        levels: [1.0, 1.5, 2.0, 2.5, 3.0, 4.0],
        turn: |setting, times| {
            setting.conditions.gust_m_s = 0.03 * times;
            setting.conditions.lighthouse_distortion_m = 0.01 * times;
            setting.actual.light.radio_delay_s += 0.2 * times;
            setting.missing_frac = 0.03 * times;
            (FAULTS[6].turn)(setting, 0.05 * times)
        },
    },
];

/// Returns the number of rows in a fraction of `n` rows.
#[expect(clippy::cast_possible_truncation, reason = "0 to 1")]
fn share_of(n: usize, share: f64) -> usize {
    (share * n as f64) as usize
}

impl Setting {
    /// Returns the setting of a word without faults, in the style `even` and the team's repaired
    /// letters. The controller follows the design, and only the lamps that write are on.
    pub(crate) fn clean(word: &str, seed: u64) -> Self {
        let style = EvenStyle { exposure: LightLevel::Dimmed, ..EvenStyle::default() };
        let mut scene =
            Scene { plan: PlanOptions::even_with(style), seed, ..Scene::preset(Preset::Ae4832022) };
        word.clone_into(&mut scene.word);
        scene.letters.font = "ae483-fixed".into();
        scene.controller.kind = ControllerKind::LqrFeedforward;
        scene.light.led_bitmask = 128;
        scene.light.ring = RingEffect::Off;
        [scene.camera.width_px, scene.camera.height_px] = [320, 180];
        Self {
            known: scene.clone(),
            actual: scene,
            conditions: Conditions::still(),
            missing_frac: 0.0,
        }
    }

    /// Returns both scenes, to which a fault of the design applies equally.
    pub(crate) fn scenes(&mut self) -> [&mut Scene; 2] {
        [&mut self.known, &mut self.actual]
    }

    /// Returns the camera, and the middle, bottom and top of the word in its picture.
    fn sight(&self) -> Result<(Camera, [ImagePoint; 3])> {
        let strokes = letters::write(&self.known.word, &self.known.letters)?;
        let [left, bottom, right, top] = strokes.bounds_m();
        let camera = self.actual.camera.camera(strokes.bounds_m(), 1.0)?;
        let cell = strokes.glyphs[0].cell;
        let heights_m =
            [0.5 * (bottom + top), cell.baseline_m, cell.baseline_m + cell.cap_height_m];
        let middle_m = 0.5 * (left + right);
        let see = |height_m| camera.image_from_world(Vector3::new(middle_m, 0.0, height_m));
        let points = heights_m.map(|height_m| see(height_m).expect("a camera that sees its word"));
        Ok((camera, points))
    }

    /// Plans, flies and photographs the word.
    pub(crate) fn shoot(&self) -> Result<Shot> {
        let (known, actual) = (&self.known, &self.actual);
        let scene = Scene {
            seed: actual.seed,
            camera: actual.camera.clone(),
            expose: actual.expose.clone(),
            photo: actual.photo.clone(),
            ..known.clone()
        };
        let mut shoot = Shoot { scene, judging: Judging::Skipped, ..planned(known)? };
        let plan = &mut shoot.plans[0].plan;
        self.lose_light(plan);
        shoot.scene.camera.shutter_close_s.get_or_insert(plan.duration_s());
        shoot.actual = vec![self.conditions.draw(actual, actual.seed, 0)];
        shoot.cores = Some(NonZero::<usize>::MIN);
        shoot.recordings = flown(known, &shoot)?.into_iter().map(Recording::Flight).collect();
        shoot.take(&|_, _| {})
    }

    /// Removes consecutive light commands from each letter. Those removed at a more severe level
    /// include those removed at a slighter one.
    fn lose_light(&self, plan: &mut Plan) {
        let letters = plan.setpoints.iter().map(|setpoint| setpoint.letter);
        let letters: Vec<Option<usize>> = letters.collect();
        let n_letters = letters.iter().flatten().max().map_or(0, |last| last + 1);
        for letter in 0..n_letters {
            plan.edit(|plan| {
                for levels in plan.lights.values_mut() {
                    let lit: Vec<usize> = (0..letters.len())
                        .filter(|&row| letters[row] == Some(letter) && levels[row] > 0.0)
                        .collect();
                    // Multiples of the golden ratio distribute the removed parts over all letters.
                    let place = ((self.actual.seed as f64 + letter as f64) * 0.618_034).fract();
                    let from = share_of(lit.len(), place * (1.0 - self.missing_frac));
                    let run = share_of(lit.len(), self.missing_frac);
                    lit.iter().skip(from).take(run).for_each(|&row| levels[row] = 0.0);
                }
            });
        }
    }
}

/// Returns the shoot of a scene. Its plans are cached, because all faults of flight, lamps and
/// camera use the same plans.
fn planned(known: &Scene) -> Result<Shoot> {
    static MADE: Mutex<Vec<Shoot>> = Mutex::new(Vec::new());
    let mut made = MADE.lock().expect("no panic");
    if let Some(shoot) = made.iter().find(|shoot| shoot.scene == *known) {
        return Ok(shoot.clone());
    }
    made.push(Shoot::new(known.clone())?);
    Ok(made[made.len() - 1].clone())
}

/// Returns the flights of a shoot. Flights of words without faults are cached, because all faults
/// of lamps and camera use them.
fn flown(known: &Scene, shoot: &Shoot) -> Result<Vec<Flight>> {
    type Flown = (Scene, Vec<Planned>, SimOptions, Vec<Flight>);
    static CLEAN: Mutex<Vec<Flown>> = Mutex::new(Vec::new());
    let mut clean = CLEAN.lock().expect("no panic");
    let sim = &shoot.actual[0].sim;
    let same = |flown: &&Flown| (&flown.0, &flown.1, &flown.2) == (known, &shoot.plans, sim);
    if let Some((.., flights)) = clean.iter().find(same) {
        return Ok(flights.clone());
    }
    let flights = shoot.fly(&|_, _| {})?;
    if clean.len() < WORDS.len() {
        clean.push((known.clone(), shoot.plans.clone(), sim.clone(), flights.clone()));
    }
    Ok(flights)
}

/// Returns the table of scores, with a line for the clean words and one for each level of each
/// fault. A line contains the mean readability, and for each word its readability, its reading, and
/// its worst letter.
pub(crate) fn table(faults: &[Fault]) -> Result<String> {
    let mut readers = Vec::new();
    let mut text =
        "fault, level | mean P | of each word: P, what is read, worst letter\n".to_owned();
    text += &line(&mut readers, "none", |_| Ok(()))?;
    for fault in faults {
        for level in fault.levels {
            let name = format!("{} {level} {}", fault.name, fault.unit);
            text += &line(&mut readers, &name, |setting| (fault.turn)(setting, level))?;
        }
    }
    Ok(text)
}

/// Returns one line of the table. Readers are cached, because creating one is slow.
fn line(
    readers: &mut Vec<(Strokes, Reader)>,
    name: &str,
    turn: impl Fn(&mut Setting) -> Result<()>,
) -> Result<String> {
    let (mut sum, mut each) = (0.0, String::new());
    for (seed, word) in (1..).zip(WORDS) {
        let mut setting = Setting::clean(word, seed);
        turn(&mut setting)?;
        let shot = setting.shoot()?;
        let written = shot.shoot.strokes.expect("a word was written");
        let at = match readers.iter().position(|(strokes, _)| *strokes == written) {
            Some(at) => at,
            None => {
                let reader = Reader::new(&written, &setting.known.score)?;
                readers.push((written, reader));
                readers.len() - 1
            }
        };
        let verdict = readers[at].1.score(&shot.photo, &(&shot.camera).into())?;
        let judged = verdict.letters.iter().filter_map(|letter| Some((letter.p?, letter.expected)));
        let worst = judged.min_by(|a, b| a.0.total_cmp(&b.0)).map_or('?', |(_, letter)| letter);
        sum += verdict.readability;
        each += &format!(" | {:.3} {} {worst}", verdict.readability, verdict.read);
    }
    Ok(format!("{name} | {:.4}{each}\n", sum / WORDS.len() as f64))
}
