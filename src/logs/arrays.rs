//! Checks whether flights from a caller's arrays are plausible. The checks are those of tables,
//! although arrays have no titles.

use super::recording::{Block, Channel, Column, Recording};
use super::{ImportOptions, frames, mapper, plain_csv, speed};
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::error::Error;
use noctograph_core::flight::{Flight, FlightSample, Quantity, rests_on_floor};

/// Returns warnings if the data are probably not in meters, radians and seconds with z up, or not a
/// flight. Nothing is converted.
pub fn doubts(flight: &Flight) -> Vec<Diagnostic> {
    let samples = &flight.samples;
    if samples.len() < 2 {
        return Vec::new();
    }
    let first_s = samples[0].time_s;
    let text = format!(
        "the flight's clock begins at {first_s} s instead of 0 s, and so does the exposure of a \
         photo"
    );
    let begins = (first_s < 0.0).then(|| Diagnostic::warning("time-negative", text));
    // The flight's columns are copied to a table, to which the checks of tables apply.
    let block = pose_columns(samples);
    let rising = samples.windows(2).all(|pair| pair[0].time_s < pair[1].time_s);
    let channels = block.columns.iter().take(3).filter(|_| rising);
    let channels: Vec<Channel> =
        channels.map(|column| Channel::new(block.time_s.clone(), column.values.clone())).collect();
    let speed = speed::check(&channels, &ImportOptions::default(), "the flight");
    let speed = speed.unwrap_or_else(|error| {
        let text = match error {
            Error::Input { found, .. } => {
                format!("{found}: is it in meters and seconds, and of one drone?")
            }
            error => error.to_string(),
        };
        Some(Diagnostic::warning("position-fast", text))
    });
    let size = mapper::warn_of_size(samples);
    let (are_degrees, why) = plain_csv::are_degrees(&block);
    let why = why.filter(|_| are_degrees && flight.has(Quantity::Attitude));
    let angles = why.map(|why| {
        let text = "are they degrees, or from a quaternion with another order of components?";
        Diagnostic::warning("unit-guessed", format!("{why}: {text}"))
    });
    // A flight along a different axis may stay at height zero without being at rest.
    let axes = frames::axes_doubt(&Recording { blocks: vec![block], ..Recording::default() });
    let rests = (axes.is_none() && rests_on_floor(samples, 0.0)).then(|| {
        let highest_m = samples.iter().map(|sample| sample.position_m.z).fold(0.0, f64::max);
        let text = format!("the drone never left the floor: its height reaches {highest_m:.2} m");
        Diagnostic::warning("grounded", text)
    });
    let axes = axes.map(|text| Diagnostic::warning("axes-guessed", text));
    let repeats = repeated_times(samples);
    let design = flight.has(Quantity::Design).then(|| far_design(samples)).flatten();
    [begins, repeats, speed, size, axes, angles, rests, design].into_iter().flatten().collect()
}

/// Maximum fraction of repeated times that causes no warning. A log may repeat a few rows.
const FEW_REPEATS: f64 = 0.01;

/// Returns a warning if the drone moves while its clock stands still, in more than 1 % of the
/// steps.
fn repeated_times(samples: &[FlightSample]) -> Option<Diagnostic> {
    let moves_at_once = |pair: &&[FlightSample]| {
        pair[0].time_s == pair[1].time_s && pair[0].position_m != pair[1].position_m
    };
    let repeats = samples.windows(2).filter(moves_at_once).count();
    let steps = samples.len() - 1;
    (repeats as f64 > FEW_REPEATS * steps as f64).then(|| {
        let text = format!(
            "{repeats} of {steps} timestamps equal the one before, at another position: are they \
             in float32? Subtract the first timestamp in float64"
        );
        Diagnostic::warning("time-repeated", text)
    })
}

/// Median distance from the design that no actual flight reaches, m.
const FAR_M: f64 = 1.0;

/// Returns a warning if the flight is more than 1 m from its design most of the time.
fn far_design(samples: &[FlightSample]) -> Option<Diagnostic> {
    let distance_m = |sample: &FlightSample| (sample.position_m - sample.design_m).norm();
    let mut distances_m: Vec<f64> = samples.iter().map(distance_m).collect();
    distances_m.sort_by(f64::total_cmp);
    let median_m = *distances_m.get(samples.len() / 2)?;
    (median_m > FAR_M).then(|| {
        let text = format!(
            "the design is {median_m:.1} m from the flown positions (median): does it have the \
             same units and axes, and belong to this flight?"
        );
        Diagnostic::warning("design-far", text)
    })
}

/// Returns the position in m and the attitude of a flight as columns of a table.
fn pose_columns(samples: &[FlightSample]) -> Block {
    let columns = [Quantity::Position, Quantity::Attitude].into_iter().flat_map(|quantity| {
        let names = Quantity::TABLE[quantity as usize].2;
        names.iter().zip(quantity.places()).map(move |(name, number)| Column {
            // The unit of the angles has yet to be checked.
            is_open_angle: quantity == Quantity::Attitude,
            ..Column::new(
                (*name).to_owned(),
                samples.iter().map(|sample| sample.numbers()[number]).collect(),
            )
        })
    });
    Block {
        time_s: samples.iter().map(|sample| sample.time_s).collect(),
        columns: columns.collect(),
        ..Block::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use noctograph_core::flight::FlightData;
    use noctograph_core::geometry::Attitude;

    /// Returns warnings about a flight that takes off, writes an L and lands, tilted by 0.1 rad.
    fn said(to: impl Fn(FlightSample) -> FlightSample) -> String {
        let samples = (0..=400).map(|row| {
            let t = 0.02 * f64::from(row);
            let position_m =
                Vector3::new((t - 2.0).clamp(0.0, 1.0), 0.1, t.min(8.0 - t).clamp(0.0, 1.0));
            let attitude = Attitude { roll_rad: 0.1 * libm::sin(t), ..Attitude::default() };
            let design_m = position_m;
            let sample = FlightSample {
                time_s: t,
                position_m,
                design_m,
                attitude,
                ..FlightSample::default()
            };
            to(sample)
        });
        let samples = samples.collect();
        let flight = Flight::made(FlightData { samples, ..FlightData::default() });
        doubts(&flight).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn a_flight_in_other_units_or_axes_is_asked_about() {
        assert_eq!(said(|it| it), "", "meters, radians, z up");
        let scaled = |scale: f64| {
            move |it: FlightSample| FlightSample { position_m: scale * it.position_m, ..it }
        };
        assert!(said(scaled(1000.0)).contains("meters"), "{}", said(scaled(1000.0)));
        assert!(said(scaled(100.0)).contains("meters"), "{}", said(scaled(100.0)));
        let turned = |to: fn(Vector3<f64>) -> Vector3<f64>| {
            move |it: FlightSample| FlightSample { position_m: to(it.position_m), ..it }
        };
        let down = said(turned(|p| Vector3::new(p.x, -p.y, -p.z)));
        assert!(down.contains("is z down") && down.contains("x, -y, -z"), "{down}");
        let y_up = said(turned(|p| Vector3::new(p.x, p.z, -p.y)));
        assert!(y_up.contains("is y up"), "{y_up}");
        let rests = said(turned(|p| Vector3::new(p.x, p.y, 0.0)));
        assert!(rests.contains("never left the floor"), "{rests}");
        let far = said(|it| FlightSample { design_m: 1000.0 * it.design_m, ..it });
        assert!(far.contains("the design is"), "{far}");
        let float32 = said(|it| FlightSample { time_s: 128.0 * (it.time_s / 128.0).round(), ..it });
        assert!(float32.contains("float32"), "{float32}");
    }

    #[test]
    fn degrees_and_quaternions_in_another_order_are_asked_about() {
        let rolled = |roll: fn(f64) -> f64| {
            move |it: FlightSample| {
                let roll_rad = roll(it.attitude.roll_rad);
                FlightSample { attitude: Attitude { roll_rad, ..it.attitude }, ..it }
            }
        };
        let degrees = said(rolled(f64::to_degrees));
        assert!(degrees.contains("degrees"), "{degrees}");
        let upside_down = said(rolled(|roll| std::f64::consts::PI - roll));
        assert!(upside_down.contains("quaternion"), "{upside_down}");
    }
}
