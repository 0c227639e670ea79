//! The even way: strokes in the shortest order at one speed, dark ways at the limits between them.
//!
//! The drone rises below the first stroke, draws, and comes down below the last, in the dark. Every
//! stroke begins and ends on a tick of 50 ms, the lamps' timer, so that light commands can meet its
//! ends. Setpoints come on one grid from the beginning to the end, so that a controller of held
//! positions is a linear filter of them.

use nalgebra::{Vector2, Vector3};

use super::motion::{Moment, Motion};
use super::pen::PenStroke;
use super::transit::Transit;
use super::{Exposure, Extent, Plan, PlanOptions, Setpoint};
use crate::error::{Error, Result};
use crate::flight::table::on_grid;

/// The lamps' timer of the firmware (`ledring12.c`).
pub(super) const TICK_S: f64 = 0.05;
/// Steps of a dimmed light: finer ones are not seen, and every one is a command.
const LEVEL_STEPS: f64 = 50.0;
/// The least level, so that a slow corner does not go dark.
const LEAST_LEVEL: f64 = 0.04;

/// One part of the flight.
#[derive(Debug)]
enum Way {
    /// Motors off, on the floor.
    Floor(Vector2<f64>),
    Rest(Vector2<f64>),
    Lit(Motion),
    Dark(Transit),
}

#[derive(Debug)]
struct Piece {
    start_s: f64,
    letter: Option<usize>,
    way: Way,
}

/// Where a drone of several rises straight to before it goes to its first stroke, and comes straight
/// down from.
const OVER_HOME_M: f64 = 0.3;

/// Strokes in the order in which they are flown, each with its corners in order. The drone takes off
/// and lands at `home_x_m`, or below its first and last stroke where there is none.
pub(super) fn even(
    drawn: &[PenStroke],
    options: &PlanOptions,
    home_x_m: Option<f64>,
) -> Result<Plan> {
    let home_x_m = home_x_m.filter(|_| options.extent == Extent::Whole);
    let mut tour =
        Tour { options, home_x_m, pieces: Vec::new(), end_s: 0.0, at: Moment::default() };
    tour.begin(drawn)?;
    for stroke in drawn {
        tour.draw(stroke)?;
    }
    tour.finish()?;
    Ok(tour.plan())
}

struct Tour<'a> {
    options: &'a PlanOptions,
    home_x_m: Option<f64>,
    pieces: Vec<Piece>,
    end_s: f64,
    at: Moment,
}

impl Tour<'_> {
    fn begin(&mut self, drawn: &[PenStroke]) -> Result<()> {
        let first = Motion::new(&drawn[0].points_m, self.options, TICK_S).at(0.0);
        let below = Vector2::new(self.home_x_m.unwrap_or(first.position_m.x), 0.0);
        match self.options.extent {
            Extent::Whole => self.push(None, Way::Floor(below), self.options.floor_wait_s),
            Extent::Letters => self.push(None, Way::Rest(first.position_m), 0.5),
        }
        match self.home_x_m {
            Some(home_x_m) => self.go(None, &rest(home_x_m, OVER_HOME_M)),
            None => Ok(()),
        }
    }

    fn draw(&mut self, stroke: &PenStroke) -> Result<()> {
        let motion = Motion::new(&stroke.points_m, self.options, TICK_S);
        let drawing = self.pieces.iter().any(|piece| matches!(piece.way, Way::Lit(_)));
        let letter = Some(stroke.letter).filter(|_| drawing);
        self.go(letter, &motion.at(0.0))?;
        let duration_s = motion.duration_s();
        self.push(Some(stroke.letter), Way::Lit(motion), duration_s);
        Ok(())
    }

    fn finish(&mut self) -> Result<()> {
        let (x, y) = (self.at.position_m.x, self.at.position_m.y);
        if self.options.extent == Extent::Letters {
            return self.go(None, &rest(x, y));
        }
        if let Some(home_x_m) = self.home_x_m {
            self.go(None, &rest(home_x_m, OVER_HOME_M))?;
        }
        let home = Vector2::new(self.home_x_m.unwrap_or(x), 0.0);
        self.go(None, &rest(home.x, self.options.landing_height_m))?;
        self.push(None, Way::Floor(home), self.options.floor_wait_s);
        Ok(())
    }

    /// A dark way to a state.
    fn go(&mut self, letter: Option<usize>, to: &Moment) -> Result<()> {
        let level = |moment: &Moment| Moment { acceleration_m_s2: Vector2::zeros(), ..*moment };
        let transit = Transit::new(&self.at, to, self.options, TICK_S)
            .or_else(|| Transit::new(&level(&self.at), &level(to), self.options, TICK_S));
        let transit = transit.ok_or_else(|| Error::Infeasible {
            what: format!("no dark way was found after {:.2} s", self.end_s),
            hint: "raise plan.dark_speed_m_s above plan.stroke_speed_m_s, or plan.jerk_m_s3".into(),
        })?;
        let duration_s = transit.duration_s();
        self.push(letter, Way::Dark(transit), duration_s);
        Ok(())
    }

    fn push(&mut self, letter: Option<usize>, way: Way, lasts_s: f64) {
        let lasts_s = (lasts_s / TICK_S - 1e-6).ceil() * TICK_S;
        self.at = way.at(lasts_s);
        self.pieces.push(Piece { start_s: self.end_s, letter, way });
        self.end_s += lasts_s;
    }

    /// Setpoints on the grid, and where a stroke begins or ends.
    fn plan(&self) -> Plan {
        let interval_s = self.options.setpoint_interval_s;
        let mut times_s: Vec<f64> = self.pieces.iter().map(|piece| piece.start_s).collect();
        times_s.push(self.end_s);
        let mut n = 0.0;
        while n * interval_s < self.end_s {
            times_s.push(n * interval_s);
            n += 1.0;
        }
        times_s.sort_unstable_by(f64::total_cmp);
        times_s.dedup_by(|later, earlier| *later - *earlier < 1e-4);
        let lights = self.options.lights.iter().map(|channel| (channel.clone(), Vec::new()));
        let mut plan = Plan { lights: lights.collect(), ..Plan::default() };
        let mut index = 0;
        for (row, time_s) in times_s.iter().enumerate() {
            while self.pieces.get(index + 1).is_some_and(|next| next.start_s <= time_s + 1e-6) {
                index += 1;
            }
            let piece = &self.pieces[index];
            let until_s = times_s.get(row + 1).copied().unwrap_or(*time_s);
            let last = row + 1 == times_s.len();
            let Moment { position_m: p, velocity_m_s: v, acceleration_m_s2: a } =
                piece.way.at(time_s - piece.start_s);
            let world = |v: Vector2<f64>| Vector3::new(v.x, 0.0, v.y).map(on_grid);
            plan.setpoints.push(Setpoint {
                time_s: on_grid(*time_s),
                position_m: world(p),
                velocity_m_s: world(v),
                acceleration_m_s2: world(a),
                letter: piece.letter.filter(|_| !last),
            });
            let level = if last { 0.0 } else { self.level(piece, *time_s, until_s) };
            plan.lights.values_mut().for_each(|levels| levels.push(level));
        }
        plan
    }

    /// The light from a setpoint to the next: the mean speed over the nominal one.
    fn level(&self, piece: &Piece, from_s: f64, until_s: f64) -> f64 {
        let Way::Lit(motion) = &piece.way else { return 0.0 };
        if self.options.even_style().exposure == Exposure::Switched {
            return 1.0;
        }
        let speeds = [1.0, 3.0, 5.0, 7.0].map(|eighth| {
            let time_s = from_s + (until_s - from_s) * eighth / 8.0 - piece.start_s;
            motion.at(time_s).velocity_m_s.norm()
        });
        let level = speeds.iter().sum::<f64>() / 4.0 / self.options.stroke_speed_m_s;
        ((level * LEVEL_STEPS).round() / LEVEL_STEPS).clamp(LEAST_LEVEL, 1.0)
    }
}

/// At rest at a place.
fn rest(x_m: f64, height_m: f64) -> Moment {
    Moment { position_m: Vector2::new(x_m, height_m), ..Moment::default() }
}

impl Way {
    fn at(&self, time_s: f64) -> Moment {
        match self {
            Self::Floor(place) | Self::Rest(place) => {
                Moment { position_m: *place, ..Moment::default() }
            }
            Self::Lit(motion) => motion.at(time_s),
            Self::Dark(transit) => transit.at(time_s),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::letters::{LetterOptions, write};
    use crate::plan::EvenStyle;
    use crate::plan::{Plan, PlanOptions, plan};

    fn noor(options: &PlanOptions) -> Plan {
        plan(&write("NOOR", &LetterOptions::default()).unwrap(), options).unwrap()
    }

    #[test]
    fn noor_at_the_teams_speed_takes_less_than_seven_tenths_of_their_time() {
        // 56.9 s is how long the team's flight had a setpoint; their script as planned: 58.2 s.
        let even_s = noor(&PlanOptions::even()).duration_s();
        assert!(even_s < 0.7 * 56.9, "{even_s} s");
    }

    #[test]
    fn noor_at_half_a_metre_a_second_takes_less_than_four_tenths() {
        // Corners may be cut by 3 cm of the letters' 50; by 1 cm it takes 23.95 s.
        let fast = PlanOptions {
            stroke_speed_m_s: 0.5,
            ..PlanOptions::even_with(EvenStyle {
                dark_speed_m_s: 0.5,
                corner_error_m: 0.03,
                ..EvenStyle::default()
            })
        };
        let fast_s = noor(&fast).duration_s();
        assert!(fast_s < 0.4 * 56.9, "{fast_s} s");
    }

    #[test]
    fn the_design_goes_on_smoothly_within_the_limits() {
        let plan = noor(&PlanOptions::even());
        for pair in plan.setpoints.windows(2) {
            let [now, next] = [&pair[0], &pair[1]];
            assert!((next.time_s - now.time_s - 0.05).abs() < 2e-6, "one grid: {}", now.time_s);
            assert!(now.velocity_m_s.norm() < 1.0 + 1e-5, "{now:?}");
            assert!(now.acceleration_m_s2.norm() < 2.0 * 1.04, "{now:?}");
            if next.position_m.z > 0.0 && now.position_m.z > 0.0 {
                // What jerk does in a setpoint's time: j t³ / 6.
                let jump_m = (next.position_m - now.design_m(next.time_s)).norm();
                assert!(jump_m < 30.0 * 0.05 * 0.05 * 0.05 / 6.0 * 1.5, "{jump_m} m at {now:?}");
            }
        }
    }

    #[test]
    fn light_times_length_is_the_word() {
        let plan = noor(&PlanOptions::even());
        let painted_m: f64 = plan
            .setpoints
            .windows(2)
            .zip(&plan.lights["headlights"])
            .map(|(p, level)| 0.2 * level * (p[1].time_s - p[0].time_s))
            .sum();
        assert!((painted_m - (1.583_095 + 3.2 + 1.740_512)).abs() < 0.12, "{painted_m} m");
        let lit = plan.lights["headlights"].iter().zip(&plan.setpoints);
        for (_, setpoint) in lit.filter(|(level, _)| **level > 0.0) {
            assert!(setpoint.velocity_m_s.norm() > 0.03, "no lit dwell: {setpoint:?}");
        }
    }
}
