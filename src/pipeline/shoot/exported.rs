//! Exported flights, in which the decoded trajectories replace the plans.

use super::planned::{aim, with_color_channels};
use super::{Planned, Shoot, rehearse};
use noctograph_core::error::Result;
use noctograph_export::{Form, Length, flown};
use noctograph_picture::light::LightOptions;
use noctograph_plan::{LightClock, Plan};

impl Shoot {
    /// Returns the shoot with its plans replaced by the exported trajectories, as the firmware
    /// decodes them, from the take-off command on. With the clock `light`, lights are timed by
    /// simulated flights of the trajectories, because the drone lags behind them.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`flown`], [`rehearse`] and [`aim`].
    pub fn as_exported(&self, form: Form, tolerance_m: f64, length: Length) -> Result<Self> {
        let (scene, designs, lamps) = (&self.scene, self.designs().into_owned(), self.lamps());
        let mut plans = Vec::new();
        for plan in flown(scene.vehicle.firmware, &designs, form, tolerance_m, length)? {
            plans.push(match scene.plan.light_clock {
                LightClock::Setpoint => Planned { plan, ends: Vec::new() },
                LightClock::Light => aim(scene, &lamps, &plan, &rehearse(scene, &plan)?)?,
            });
        }
        Ok(Self { plans, designs, ..self.clone() })
    }

    /// Returns the shoot with plans paced by the firmware's clock, which also times a script's
    /// lights.
    #[must_use]
    pub fn by_firmware_clock(mut self) -> Self {
        let rate = self.scene.vehicle.firmware.clock();
        for Planned { plan, ends } in &mut self.plans {
            *plan = Plan::made(std::mem::take(plan).into_data().paced(rate));
            ends.iter_mut().for_each(|end| end.time_s /= rate);
        }
        self
    }

    /// Returns the plans of a show: the exported trajectories, lit over the whole of each stroke,
    /// because a viewer does not simulate delays.
    pub fn as_shown(&self, tolerance_m: f64) -> Result<Vec<Plan>> {
        let (release, form) = (self.scene.vehicle.firmware, Form::Compressed);
        let plans = flown(release, &self.designs(), form, tolerance_m, Length::Any)?;
        let lamps = self.lamps();
        Ok(plans.into_iter().map(|plan| as_lit(plan, &lamps)).collect())
    }

    /// Returns the exported plans: the designs or, if there are none, the plans.
    pub fn designs(&self) -> std::borrow::Cow<'_, [Plan]> {
        if self.designs.is_empty() {
            self.plans.iter().map(|planned| planned.plan.clone()).collect()
        } else {
            self.designs.as_slice().into()
        }
    }
}

/// Returns a plan whose lamps are switched by the light of its design instead of the light
/// commands.
fn as_lit(mut plan: Plan, light: &LightOptions) -> Plan {
    let (lit, commanded) = (plan.lit(), plan.commanded());
    let lamps: Vec<String> = plan.lamps().map(|(lamp, _)| lamp.clone()).collect();
    plan.edit(|plan| {
        for (channel, levels) in &mut plan.lights {
            // A channel is either a lamp or one of a lamp's colors.
            if lamps.contains(channel) {
                levels.clone_from(&lit)
            } else {
                extend_color(levels, &lit, &commanded)
            }
        }
        plan.lit.clear();
    });
    with_color_channels(plan, light)
}

/// Extends the levels of a color over the strokes of a plan. `lit` and `commanded` are the levels
/// of the design and of the commands. Each row takes the level of the nearest commanded row in the
/// stroke. Strokes without a command are not changed.
fn extend_color(levels: &mut [f64], lit: &[f64], commanded: &[f64]) {
    let mut end = 0;
    for stroke in lit.chunk_by(|a, b| (*a > 0.0) == (*b > 0.0)) {
        let rows = end..end + stroke.len();
        end = rows.end;
        let sources: Vec<usize> = rows.clone().filter(|row| commanded[*row] > 0.0).collect();
        for row in rows {
            let nearest = sources.iter().min_by_key(|source| source.abs_diff(row));
            levels[row] = nearest.map_or(levels[row], |source| levels[*source]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::planned::stroke_end_errors;
    use super::*;
    use crate::scene::{Preset, Scene};
    use noctograph_plan::StrokeEnd;

    /// Compares the maximum errors of the light at the ends of strokes, m, in simulated flights.
    #[test]
    fn the_firmwares_pid_lights_an_exported_trajectory_where_it_is() {
        let shoot =
            Shoot::new(Scene { word: "NOOR".into(), ..Scene::preset(Preset::default()) }).unwrap();
        let worst_m =
            |ends: &[StrokeEnd]| ends.iter().map(|e| e.streak_m.abs()).fold(0.0, f64::max);
        for form in [Form::Compressed, Form::Poly4d] {
            let exported = shoot.as_exported(form, form.tolerance_m(), Length::OnBoard).unwrap();
            let Planned { plan, ends: timed } = &exported.plans[0];
            let (release, within_m) = (shoot.scene.vehicle.firmware, form.tolerance_m());
            let designs = shoot.designs();
            let flown = flown(release, &designs, form, within_m, Length::OnBoard).unwrap();
            let flight = rehearse(&shoot.scene, &flown[0]).unwrap();
            let as_designed = stroke_end_errors(&shoot.scene, &flown[0], &flight).unwrap();
            let (timed_m, as_designed_m) = (worst_m(timed), worst_m(&as_designed));
            // An error remains because PID cuts corners by 16 mm on average.
            assert!(timed_m <= 0.02, "{form:?}: {timed_m} m, {as_designed_m} m before");
            assert!(as_designed_m > 0.06, "{form:?}: {as_designed_m} m, half a second late");
            let again = exported.as_exported(form, form.tolerance_m(), Length::OnBoard).unwrap();
            assert_eq!(&again.plans[0].plan, plan, "the design is kept");
        }
    }
}
