//! Converts a table's world frame to z up, from z down or y up.
//!
//! The axes are determined by the format, by an option, or by the flight: a drone takes off from
//! the floor along the vertical axis and never goes below the floor. If z has this property, z is
//! up. If not, and the drone would otherwise be on or below the floor, the axis with this property
//! is up. If there is no such axis, z is assumed to be up, with a warning. If there are two, the
//! log is refused.

use super::recording::{Block, Column, Recording, names};
use super::{Axes, ImportOptions};
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::error::{Error, Result};

/// Name patterns of vector columns. The last pattern is the vector part of a quaternion.
const VECTORS: [&str; 7] = [
    "{x y z}_m",
    "{x y z}_estimate_m",
    "{x y z}_design_m",
    "v{x y z}_world_m_s",
    "v{x y z}_body_m_s",
    "w{x y z}_body_rad_s",
    "q{x y z}",
];

/// Angles that change sign if z points down. Roll is unaffected.
const ANGLES: [&str; 2] = ["yaw_rad", "pitch_rad"];

/// Climb height that indicates a take-off.
const CLIMB_M: f64 = 0.2;
/// First part of the climb, in which the path must be vertical, and the maximum drift within it.
const STRAIGHT_M: f64 = 0.12;
const DRIFT_M: f64 = 0.08;
/// Maximum height above the lowest position of a drone that counts as on the floor.
const FLOOR_M: f64 = 0.05;

/// Converts the plain columns of a log to a world frame with z up. Inferred axes and those of a
/// format cause a warning. Returns [`Error::Input`] if the flight shows two axes that may point up.
pub(super) fn with_z_up(mut log: Recording, options: &ImportOptions) -> Result<Recording> {
    // An option takes precedence over the format, and the format over the inferred axes.
    let (axes, why) = match (options.axes, log.axes) {
        (Axes::Auto, Axes::Auto) => inferred(&log)?,
        (Axes::Auto, axes) => (axes, log.in_format.map(|format| format!("as {format} writes it"))),
        (axes, _) => (axes, None),
    };
    let to = match axes {
        Axes::ZDown => "x, -y, -z",
        Axes::YUp => "x, -z, y",
        // Only guesses cause a warning.
        Axes::Auto | Axes::ZUp => {
            let z_up_guess = why.filter(|_| axes == Axes::Auto);
            log.warnings.extend(z_up_guess.map(|why| Diagnostic::warning("axes-guessed", why)));
            return Ok(log);
        }
    };
    log.blocks.iter_mut().for_each(|block| rotate_to_z_up(block, axes));
    if let Some(why) = why {
        let axes = axes.name();
        let text = format!(
            "the world's axes are assumed to be {axes}, {why}, and converted to \
                            {to}"
        );
        log.warn("axes-turned", text);
    }
    Ok(log)
}

/// Rotates the vectors and angles of a block from `axes`, which have z down or y up, to z up.
fn rotate_to_z_up(block: &mut Block, axes: Axes) {
    if axes == Axes::ZDown {
        // A half turn about x keeps x and changes the signs of y and z.
        let vectors = VECTORS.into_iter().flat_map(|pattern| names(pattern).skip(1));
        vectors.chain(ANGLES.map(str::to_owned)).for_each(|name| negate(block.column_mut(&name)));
        return;
    }
    for pattern in VECTORS {
        // A quarter turn about x makes y the new z, and z the new −y.
        let indices =
            names(pattern).map(|name| block.columns.iter().position(|column| column.name == name));
        let indices: Option<Vec<usize>> = indices.collect();
        if let Some([_, y, z]) = indices.as_deref()
            && let Ok([y, z]) = block.columns.get_disjoint_mut([*y, *z])
        {
            std::mem::swap(&mut y.values, &mut z.values);
            negate(Some(y));
        }
    }
}

/// Changes the signs of a column's values if the column exists.
fn negate(column: Option<&mut Column>) {
    let values = column.into_iter().flat_map(|column| &mut column.values);
    values.for_each(|value| *value = -*value);
}

/// Returns a reason if positions probably do not have z up, as a part of a sentence.
pub(super) fn axes_doubt(recording: &Recording) -> Option<String> {
    let (axes, why) = match inferred(recording) {
        Ok((axes, why)) => (axes, why?),
        Err(error) => return Some(error.to_string()),
    };
    match axes {
        Axes::ZDown => Some(format!("is z down, {why}? Then pass x, -y, -z")),
        Axes::YUp => Some(format!("is y up, {why}? Then pass x, -z, y")),
        // A flight may begin in the air, but not below the floor.
        _ => {
            let heights_m =
                recording.blocks.iter().find_map(positions_m)?.into_iter().map(|p| p[2]);
            let highest_m = heights_m.fold(f64::NEG_INFINITY, f64::max);
            let is_below = highest_m < -FLOOR_M;
            is_below.then(|| {
                format!("the flight is below the floor (its highest z is {highest_m:.2} m)")
            })
        }
    }
}

/// Returns the positions in m of a block's complete rows, if there are more than two.
fn positions_m(block: &Block) -> Option<Vec<[f64; 3]>> {
    let [x, y, z] = ["x_m", "y_m", "z_m"].map(|name| block.column(name));
    let rows = x?.values.iter().zip(&y?.values).zip(&z?.values).map(|((x, y), z)| [*x, *y, *z]);
    let rows: Vec<_> = rows.filter(|row| row.iter().all(|value| value.is_finite())).collect();
    (rows.len() > 2).then_some(rows)
}

/// Returns `Auto`, and a warning that z is assumed to point up because of `seen`.
fn z_up_guess(seen: &str) -> (Axes, Option<String>) {
    (Axes::Auto, Some(format!("{seen}: z is assumed to point up")))
}

/// Returns the axes inferred from the flight with the reason, or `Auto` and possibly a warning.
/// Returns [`Error::Input`] if two axes may point up.
fn inferred(recording: &Recording) -> Result<(Axes, Option<String>)> {
    let none = Ok((Axes::Auto, None));
    let Some(rows) = recording.blocks.iter().find_map(positions_m) else { return none };
    // Usually z is up, and the other axes are not tested.
    if takes_off(&rows, 2, 1.0) {
        return none;
    }
    let mut heights: Vec<f64> = rows.iter().map(|row| row[2]).collect();
    heights.sort_by(f64::total_cmp);
    let (lowest_m, median_m) = (heights[0], heights[heights.len() / 2]);
    let is_level = heights[heights.len() - 1] - lowest_m < FLOOR_M;
    let is_below = median_m < -FLOOR_M;
    let is_on_floor = is_level && median_m.abs() < FLOOR_M;
    // If the drone departs and returns along y, then y is up, unless z is constant and above zero.
    // In that case the drone may hover at a constant height while it moves along y.
    let is_low = [rows[0], rows[rows.len() - 1]].iter().any(|row| row[2].abs() < CLIMB_M);
    let climbs_along_y =
        climbs(rows.iter(), &rows, 1, 1.0) && climbs(rows.iter().rev(), &rows, 1, 1.0);
    let rises_along_y = climbs_along_y && (is_low || !is_level);

    let unseen = if climbs_along_y {
        "the flight rises and ends straight along y, at one height z"
    } else {
        "no take-off or landing is straight along an axis"
    };
    if !(is_below || is_on_floor || rises_along_y) {
        return Ok(z_up_guess(unseen));
    }
    // With z up, the drone would be on or below the floor, or would rise along y only.
    Ok(match other_axes(&rows, lowest_m).map_err(|error| error.in_file(&recording.file, None))? {
        Some((axes, why)) => (axes, Some(why)),
        None if is_below => {
            z_up_guess(&format!("most of the flight is below zero (z = {median_m:.2} m)"))
        }
        None => z_up_guess(unseen),
    })
}

/// Returns the axes with z down or y up, if the flight takes off or lands along one of these, with
/// the reason. Returns `None` if it does so along neither, and [`Error::Input`] for both.
/// `lowest_m` is the least z.
fn other_axes(rows: &[[f64; 3]], lowest_m: f64) -> Result<Option<(Axes, String)>> {
    match (takes_off(rows, 2, -1.0), takes_off(rows, 1, 1.0)) {
        (true, true) => {
            let flight = "a flight that rises along -z and along y";
            let hint = "name the axes of its world: z-down or y-up";
            let error = Error::input("axes", flight, "one axis that points up", hint);
            Err(error.coded("axes-unknown"))
        }
        (true, false) => {
            let down = format!("goes down to z = {lowest_m:.2} m, below its start and end");
            Ok(Some((Axes::ZDown, format!("since it {down}"))))
        }
        (false, true) => {
            Ok(Some((Axes::YUp, "because it takes off and lands only along y".to_owned())))
        }
        (false, false) => Ok(None),
    }
}

/// True if the flight begins or ends with a climb from its lowest position along one axis. The axis
/// points up for a `sign` of 1, and down for -1.
fn takes_off(rows: &[[f64; 3]], axis: usize, sign: f64) -> bool {
    climbs(rows.iter(), rows, axis, sign) || climbs(rows.iter().rev(), rows, axis, sign)
}

/// True if the rows, ordered by `from_end`, begin at the lowest position and climb along one axis.
/// The axis points up for a `sign` of 1, and down for -1.
fn climbs<'a>(
    mut from_end: impl Iterator<Item = &'a [f64; 3]>,
    rows: &[[f64; 3]],
    axis: usize,
    sign: f64,
) -> bool {
    let lowest_m = rows.iter().map(|row| sign * row[axis]).fold(f64::INFINITY, f64::min);
    let Some(first) = from_end.next().filter(|first| sign * first[axis] <= lowest_m + FLOOR_M)
    else {
        return false;
    };
    for row in from_end {
        // The drone must not drift in the first part of the climb.
        let climb_m = sign * row[axis] - sign * first[axis];
        if climb_m >= CLIMB_M {
            return true;
        }
        let other_axes = (0..3).filter(|other| *other != axis);
        let drift_m = other_axes.map(|other| (row[other] - first[other]).abs()).fold(0.0, f64::max);
        if drift_m > DRIFT_M && climb_m < STRAIGHT_M {
            return false;
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a flight that takes off, writes an L and lands, with positions transformed by `to`.
    fn flight(to: impl Fn([f64; 3]) -> [f64; 3]) -> Recording {
        let place = |t: f64| [(t - 2.0).clamp(0.0, 1.0), 0.1, t.min(8.0 - t).clamp(0.0, 1.0)];
        let rows: Vec<[f64; 3]> = (0..=80).map(|i| to(place(0.1 * f64::from(i)))).collect();
        let column = |axis: usize| {
            let values = rows.iter().map(|row| row[axis]).collect();
            Column::new(["x_m", "y_m", "z_m"][axis].into(), values)
        };
        let block = Block {
            time_s: (0..=80).map(f64::from).collect(),
            columns: (0..3).map(column).collect(),
            ..Block::default()
        };
        Recording { blocks: vec![block], ..Recording::default() }
    }

    fn settled(recording: Recording, axes: Axes) -> ([f64; 3], usize) {
        let options = ImportOptions { axes, ..ImportOptions::default() };
        let recording = with_z_up(recording, &options).unwrap();
        let columns = &recording.blocks[0].columns;
        ([0, 1, 2].map(|axis: usize| columns[axis].values[40]), recording.warnings.len())
    }

    #[test]
    fn a_world_whose_z_points_down_or_whose_y_points_up_is_turned() {
        let wanted = [1.0, 0.1, 1.0];
        assert_eq!(settled(flight(|p| p), Axes::Auto), (wanted, 0));
        assert_eq!(settled(flight(|[x, y, z]| [x, -y, -z]), Axes::Auto), (wanted, 1));
        assert_eq!(settled(flight(|[x, y, z]| [x, z, -y - 0.3]), Axes::Auto).0, [1.0, 0.4, 1.0]);
        assert_eq!(settled(flight(|[x, y, z]| [x, z, -y]), Axes::YUp), (wanted, 0), "as told");
    }

    #[test]
    fn a_flight_above_a_low_origin_or_in_the_air_is_not_turned() {
        let low = |[x, y, z]: [f64; 3]| [x, y, z - 1.5];
        assert_eq!(settled(flight(low), Axes::Auto), ([1.0, 0.1, -0.5], 0), "an origin on a table");
    }

    #[test]
    fn where_no_axis_shows_a_take_off_the_guess_is_said() {
        fn said(to: &dyn Fn([f64; 3]) -> [f64; 3], axes: Axes) -> (f64, String) {
            let options = ImportOptions { axes, ..ImportOptions::default() };
            let log = with_z_up(flight(to), &options).unwrap();
            (log.blocks[0].columns[2].values[40], crate::tests::said(&log))
        }
        // Here the drone drifts while it takes off and lands along y, and z points to the viewer.
        let drifts = |[x, y, z]: [f64; 3]| [x + z, z, y];
        let shuttles = |[x, _, z]: [f64; 3]| [x, z, 0.8];
        let deep = |[x, y, z]: [f64; 3]| [x, z, -y - 0.09 * x];
        assert_eq!(settled(flight(deep), Axes::Auto).0, [1.0, 0.19, 1.0], "y up, and deep");
        for to in [&drifts as &dyn Fn([f64; 3]) -> [f64; 3], &shuttles] {
            let (z_m, warning) = said(to, Axes::Auto);
            assert!(z_m < 1.0 && warning.contains("z is assumed to point up"), "{z_m}: {warning}");
            assert_eq!(said(to, Axes::ZUp).1, "", "as told");
        }
        assert_eq!(said(&drifts, Axes::YUp), (1.0, String::new()), "as told");
    }
}
