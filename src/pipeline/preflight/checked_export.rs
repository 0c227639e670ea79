//! An export with its checks: the exported flights, their findings, and the files.

use super::{Profile, checks, fly_plans, platform, preflight, preflight_flights};
use crate::scene::Scene;
use crate::shoot::Shoot;
use noctograph_core::crazyflie::Feature;
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::error::{Error, Result};
use noctograph_core::geometry::bounds;
use noctograph_core::lamps::COLOR_LED;
use noctograph_export::safety::{Checks, Platform};
use noctograph_export::{File, Form, Format, Job, Length, Mode, deviation_m, export};
use noctograph_plan::Plan;
use noctograph_sim::{Law, SetpointKind};

/// Options of an export: format, mode, tolerance, and the limits of the checks.
#[derive(Clone, Debug)]
pub struct ExportOptions {
    /// Format of the files.
    pub format: Format,
    /// Setpoints that the cflib script sends, unless it is run with its own --mode.
    pub mode: Mode,
    /// Maximum distance of a trajectory from the design.
    pub tolerance_m: f64,
    /// Limits against which the flight is checked.
    pub profile: Profile,
    /// True if files are also written for unsafe flights.
    pub is_unchecked: bool,
}

/// An export with a checked flight.
#[derive(Debug)]
pub struct CheckedExport {
    options: ExportOptions,
    shoot: Shoot,
    /// Trajectory that is exported in place of the plans.
    trajectory: Option<Shoot>,
    checks: Checks,
    /// Findings of all checks. Empty for a format that does not command a flight.
    pub findings: Vec<Diagnostic>,
}

/// Files of an export.
#[derive(Debug)]
pub struct ExportedFiles {
    /// Files by name.
    pub files: Vec<File>,
    /// Maximum distance of a trajectory from the design.
    pub deviation_m: Option<f64>,
}

/// Changes a scene to what an export flies: no faster than the profile `slow`, paced by a clock
/// that the script can set, and with the kind of setpoints that the script sends. Returns the
/// script's mode, which by default follows the scene's setpoints.
///
/// # Errors
///
/// Returns [`Error::Input`] if the scene's controller cannot fly such setpoints.
pub fn make_exportable(
    scene: &mut Scene,
    slow: Option<&Profile>,
    format: Format,
    mode: Option<Mode>,
) -> Result<Mode> {
    if let Some(profile) = slow {
        profile.slow(scene);
    }
    // The scripts detect the drone's clock and use it for timing.
    if scene.trajectory_clock() != 1.0 {
        scene.plan.trajectory_clock.get_or_insert(1.0);
    }
    let kind = SetpointKind::ALL.iter().find(|kind| mode == Some(mode_of(**kind)));
    if let Some(kind) = kind.filter(|_| format == Format::Cflib) {
        set_setpoint_kind(scene, *kind)?;
    }
    Ok(mode.unwrap_or(mode_of(scene.controller.sends())))
}

/// Returns the mode in which the script sends this kind of setpoint.
fn mode_of(kind: SetpointKind) -> Mode {
    kind.name().parse().expect("setpoints have the names of modes")
}

/// Sets the kind of setpoints that the controller flies. Returns [`Error::Input`] if it cannot fly
/// them.
fn set_setpoint_kind(scene: &mut Scene, kind: SetpointKind) -> Result<()> {
    let controller = &mut scene.controller;
    // Only the cascade accepts setpoints of several kinds.
    if controller.kind.law() == Law::Cascade {
        controller.setpoints = kind;
    }
    let flown_kind = controller.sends();
    if flown_kind == kind {
        return Ok(());
    }
    let (law, flown_name) = (controller.kind.name(), flown_kind.name());
    let hint = format!(
        "under controller.kind = {law} flights are checked with {flown_name} setpoints or as a \
         trajectory"
    );
    Err(Error::input("the mode", kind.name(), format!("{flown_name}, or trajectory"), hint))
}

impl CheckedExport {
    /// Simulates a shoot's plans as exported, and checks the flights.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Shoot::as_exported`] and [`preflight`]. Returns [`Error::Input`] if
    /// a script needs a feature that the scene's firmware release lacks.
    pub fn new(shoot: Shoot, options: ExportOptions) -> Result<Self> {
        check_release(&shoot, options.format)?;
        let wanted_form = options.format.trajectory(options.mode);
        let trajectory = wanted_form
            .map(|(form, length)| shoot.as_exported(form, options.tolerance_m, length))
            .transpose()?;
        // The checks apply to what the file commands: the decoded trajectory, or the plans.
        let exported = trajectory.as_ref().unwrap_or(&shoot);
        let flights = if options.format.flies() { fly_plans(exported)? } else { Vec::new() };
        let checks = checks(exported, &flights, &options.profile);
        let findings = if options.format.flies() {
            preflight_flights(exported, flights, &options.profile)?.findings
        } else {
            Vec::new()
        };
        Ok(Self { options, shoot, trajectory, checks, findings })
    }

    /// Returns the shoot whose plans are flown: the exported trajectory or, without one, the plans.
    pub fn flies(&self) -> &Shoot {
        self.trajectory.as_ref().unwrap_or(&self.shoot)
    }

    /// Returns the word, or `drawing` if there is no word.
    pub fn word(&self) -> &str {
        let strokes = self.shoot.strokes.as_ref().filter(|strokes| strokes.font.is_some());
        strokes.map_or("drawing", |strokes| strokes.word.as_str())
    }

    /// Returns the files to write, and how far they deviate from the plans. A script that is
    /// written although it is unsafe warns below its first line, with the reason
    /// `unsafe_because`.
    pub fn files(&self, unsafe_because: Option<&str>) -> Result<ExportedFiles> {
        let Self { options, shoot, trajectory, checks, .. } = self;
        let ExportOptions { format, mode, tolerance_m, .. } = options;
        // A script that sends setpoints also offers the trajectory if it is safe.
        let on_board = match format {
            Format::Cflib if trajectory.is_none() => {
                let compressed = shoot.as_exported(Form::Compressed, *tolerance_m, Length::OnBoard);
                compressed.ok().filter(|compressed| self.may_fly(compressed))
            }
            _ => trajectory.clone(),
        };
        let refused = if *format == Format::Cflib { self.refused() } else { Vec::new() };
        let plans = plans_of(shoot);
        // A show contains the design's light, because a viewer does not simulate the lamps' delay.
        let flown = match format {
            Format::Skyc | Format::Vviz => shoot.as_shown(*tolerance_m)?,
            _ => on_board.as_ref().map(plans_of).unwrap_or_default(),
        };
        let job = Job {
            plans: &plans,
            flown: &flown,
            unsafe_because,
            word: self.word(),
            light: &shoot.lamps(),
            sim: &shoot.scene.sim(),
            camera: &shoot.scene.camera.camera(bounds_m(shoot), 0.0)?,
            tolerance_m: *tolerance_m,
            mode: *mode,
            refused: &refused,
            trajectory_clock: shoot.scene.trajectory_clock(),
            checks,
        };
        Ok(ExportedFiles {
            files: export(*format, &job)?,
            deviation_m: deviation_m(*format, &job)?,
        })
    }

    /// Returns the kinds of setpoints that the script refuses to send, with the reason for each.
    fn refused(&self) -> Vec<(&'static str, String)> {
        let kinds = SetpointKind::ALL.iter();
        kinds.filter_map(|kind| Some((kind.name(), self.refusal(*kind)?))).collect()
    }

    /// Returns the reason why the script refuses a kind of setpoints: the controller cannot fly
    /// them, or the flight is unsafe. Returns `None` if the script sends them.
    fn refusal(&self, kind: SetpointKind) -> Option<String> {
        let mut shoot = self.shoot.clone();
        if let Err(error) = set_setpoint_kind(&mut shoot.scene, kind) {
            return Some(error.hint().to_owned());
        }
        let is_unsafe = mode_of(kind) != self.options.mode && !self.may_fly(&shoot);
        let reason =
            "the flight is not safe with these setpoints, and exporting it with them shows why";
        is_unsafe.then(|| reason.to_owned())
    }

    /// Returns true if no check stops a shoot's flights, or if unsafe flights are also exported. A
    /// shoot that cannot be checked may not fly.
    fn may_fly(&self, shoot: &Shoot) -> bool {
        self.options.is_unchecked
            || preflight(shoot, &self.options.profile)
                .is_ok_and(|checked| !checked.findings.iter().any(Diagnostic::is_stop))
    }
}

/// Checks that the firmware release has the controller, the lamp and the drone that a script needs.
/// Other formats need no release.
fn check_release(shoot: &Shoot, format: Format) -> Result<()> {
    if !matches!(format, Format::Cflib | Format::Crazyswarm2) {
        return Ok(());
    }
    let (scene, release) = (&shoot.scene, shoot.scene.vehicle.firmware);
    let mut lamps = shoot.plans.iter().flat_map(|planned| planned.plan.lamps());
    let is_lee = scene.controller.kind.law() == Law::Geometric;
    let has_color_led = lamps.any(|(lamp, _)| lamp == COLOR_LED.name);
    let is_brushless = platform(scene) == Some(Platform::Brushless);
    // Without the feature, the drone would ignore a parameter of the script, or fail in flight.
    let needs = [
        (is_lee, Feature::LEE, "fly PID (controller.kind)"),
        (has_color_led, Feature::COLOR_LED, "light the ring (light.deck)"),
        (is_brushless, Feature::BRUSHLESS, "name the preset of the drone"),
    ];
    let mut needed = needs.iter().filter(|(is_needed, ..)| *is_needed);
    let Some((_, feature, hint)) = needed.find(|(_, feature, _)| !release.has(feature)) else {
        return Ok(());
    };
    let wanted = format!("{} or newer for {}", feature.since.name(), feature.what);
    let hint = format!("{hint}, or set vehicle.firmware to what the drone has");
    Err(Error::input("vehicle.firmware", release.name(), wanted, hint))
}

/// Returns the plans of all drones.
pub(super) fn plans_of(shoot: &Shoot) -> Vec<Plan> {
    shoot.plans.iter().map(|planned| planned.plan.clone()).collect()
}

/// Returns the box `[left, bottom, right, top]` in m of the strokes or, without strokes, of the
/// plans' letters.
pub(super) fn bounds_m(shoot: &Shoot) -> [f64; 4] {
    if let Some(strokes) = &shoot.strokes {
        return strokes.bounds_m();
    }
    let setpoints = shoot.plans.iter().flat_map(|planned| &planned.plan.setpoints);
    let written = setpoints.filter(|setpoint| setpoint.letter.is_some());
    bounds(written.map(|setpoint| [setpoint.position_m.x, setpoint.position_m.z]))
}
