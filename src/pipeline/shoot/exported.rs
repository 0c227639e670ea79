//! Exported flights: plans replaced by the trajectories that drones decode from the export.

use super::planned::{aim, in_colors};
use super::{Planned, Shoot, rehearse};
use noctograph_core::error::Result;
use noctograph_export::{Form, Length, flown};
use noctograph_picture::light::LightOptions;
use noctograph_plan::{LightClock, Plan};

impl Shoot {
    /// The shoot whose plans are the flights of exported trajectories, decoded as on board, from
    /// the command to take off on. Lights on the light's own clock are timed on these flights: a
    /// controller that holds positions trails a trajectory, and leads its own setpoints.
    ///
    /// # Errors
    ///
    /// As [`flown`], [`rehearse`] and [`aim`].
    pub fn as_exported(&self, form: Form, tolerance_m: f64, length: Length) -> Result<Self> {
        let (designs, lamps) = (self.designs().into_owned(), self.lamps());
        let timed = |plan: Plan| match self.scene.plan.light_clock {
            LightClock::Setpoint => Ok(Planned { plan, ends: Vec::new() }),
            LightClock::Light => aim(&self.scene, &lamps, &plan, &rehearse(&self.scene, &plan)?),
        };
        let release = self.scene.vehicle.firmware;
        let plans = flown(release, &designs, form, tolerance_m, length)?.into_iter().map(timed);
        Ok(Self { plans: plans.collect::<Result<_>>()?, designs, ..self.clone() })
    }

    /// The same on the clock of the scene's firmware, which paces the exported script's lights,
    /// too.
    #[must_use]
    pub fn by_its_clock(mut self) -> Self {
        let rate = self.scene.vehicle.firmware.clock();
        for Planned { plan, ends } in &mut self.plans {
            *plan = Plan::made(std::mem::take(plan).into_data().paced(rate));
            ends.iter_mut().for_each(|end| end.time_s /= rate);
        }
        self
    }

    /// The plans as a show has them: the same trajectories, whose light begins and ends where the
    /// strokes of the file do. No lamp and no controller stands between the two in a viewer.
    ///
    /// # Errors
    ///
    /// As [`flown`].
    pub fn as_shown(&self, tolerance_m: f64) -> Result<Vec<Plan>> {
        let (release, form) = (self.scene.vehicle.firmware, Form::Compressed);
        let plans = flown(release, &self.designs(), form, tolerance_m, Length::Any)?;
        let lamps = self.lamps();
        Ok(plans.into_iter().map(|plan| as_lit(plan, &lamps)).collect())
    }

    /// The plans that are exported.
    pub fn designs(&self) -> std::borrow::Cow<'_, [Plan]> {
        match self.designs.is_empty() {
            true => self.plans.iter().map(|planned| planned.plan.clone()).collect(),
            false => self.designs.as_slice().into(),
        }
    }
}

/// A plan whose lamps follow the light of its design.
fn as_lit(mut plan: Plan, light: &LightOptions) -> Plan {
    let (lit, commanded) = (plan.lit(), plan.commanded());
    let lamps: Vec<String> = plan.lamps().map(|(lamp, _)| lamp.clone()).collect();
    plan.edit(|plan| {
        for (channel, levels) in &mut plan.lights {
            if lamps.contains(channel) {
                levels.clone_from(&lit);
                continue;
            }
            // A color where no light was commanded is that of the nearest command in the stroke.
            let stretches = lit.chunk_by(|a, b| (*a > 0.0) == (*b > 0.0));
            let mut end = 0;
            for stretch in stretches {
                let rows = end..end + stretch.len();
                end = rows.end;
                let given: Vec<usize> = rows.clone().filter(|row| commanded[*row] > 0.0).collect();
                for row in rows {
                    let nearest = given.iter().min_by_key(|from| from.abs_diff(row));
                    levels[row] = nearest.map_or(levels[row], |from| levels[*from]);
                }
            }
        }
    });
    plan.edit(|plan| plan.lit.clear());
    in_colors(plan, light)
}

#[cfg(test)]
mod tests {
    use super::super::planned::ends;
    use super::*;
    use crate::scene::{Preset, Scene};
    use noctograph_plan::StrokeEnd;

    /// Largest error of the light at the ends of strokes, m, of simulated flights of the exports.
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
            let as_designed = ends(&shoot.scene, &flown[0], &flight).unwrap();
            let (timed_m, as_designed_m) = (worst_m(timed), worst_m(&as_designed));
            // Remaining error: PID cuts corners by 16 mm on average.
            assert!(timed_m <= 0.02, "{form:?}: {timed_m} m, {as_designed_m} m before");
            assert!(as_designed_m > 0.06, "{form:?}: {as_designed_m} m, half a second late");
            let again = exported.as_exported(form, form.tolerance_m(), Length::OnBoard).unwrap();
            assert_eq!(&again.plans[0].plan, plan, "the design is kept");
        }
    }
}
