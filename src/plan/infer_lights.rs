//! Inference of letters and headlight levels for a flight whose log contains neither.
//!
//! Setpoints are matched to the moves of the letters in order. A setpoint belongs to the first move
//! that contains it, at or after the current one, and never moves backward along it.

use nalgebra::Vector2;

use noctograph_core::error::{Error, Result};
use noctograph_core::flight::{Flight, Quantity};
use noctograph_core::geometry::{distance, segment_distance};
use noctograph_core::lamps::HEADLIGHTS;
use noctograph_core::strokes::{Move, Strokes};

/// Maximum distance in m of a setpoint from its move. Logs round positions to a millimeter, whereas
/// strokes are centimeters apart.
const ON_MOVE_M: f64 = 0.01;

/// Minimum fraction of the word's strokes that setpoints must follow. Different words have
/// strokes in common.
const LEAST_FLOWN: f64 = 0.6;

const HINT: &str = "name the word that was flown, and the size of its letters under [letters]. In \
                    a log without lights, the letters must be written stroke by stroke, as in \
                    style team";

/// Adds letters and the column `light.headlights` to a flight that draws the given strokes.
///
/// # Errors
///
/// Returns [`Error::Input`] if the flight has no setpoints, or too few of them on the strokes.
pub fn infer_lights(flight: &mut Flight, strokes: &Strokes) -> Result<()> {
    if !flight.has(Quantity::Design) {
        let wanted = "setpoints, from which letters and lights are inferred";
        return Err(Error::input("flight", "no setpoints", wanted, HINT));
    }
    let glyphs = strokes.glyphs.iter().enumerate();
    let moves: Vec<(usize, Move)> =
        glyphs.flat_map(|(letter, glyph)| glyph.moves.iter().map(move |m| (letter, *m))).collect();
    let (mut progress, mut levels) = (Progress::default(), Vec::new());
    // For each move, `flown_m` contains the ends of the stretch that setpoints covered.
    let mut flown_m = vec![[f64::INFINITY, 0.0]; moves.len()];
    let mut letters = Vec::with_capacity(flight.samples.len());
    for sample in &flight.samples {
        // The current letter, and whether the lamp is lit, are those of the move that contains
        // the setpoint. Between moves, no letter is current.
        let current = progress.advance(&moves, [sample.design_m.x, sample.design_m.z]);
        letters.push(current.map(|(letter, _)| letter));
        levels.push(f64::from(current.is_some_and(|(_, lit)| lit)));
        if current.is_some() {
            let [from_m, to_m] = &mut flown_m[progress.index];
            (*from_m, *to_m) = (from_m.min(progress.along_m), to_m.max(progress.along_m));
        }
    }
    check_flown(flight, &strokes.word, &moves, &flown_m)?;
    flight.edit(|flight| {
        for (sample, letter) in flight.samples.iter_mut().zip(letters) {
            sample.letter = letter;
        }
        flight.lights.insert(HEADLIGHTS.to_owned(), levels);
    });
    Ok(())
}

/// Returns an error if the setpoints do not follow most of the lit strokes in their order.
/// `flown_m` contains the stretch of each move that they covered.
fn check_flown(
    flight: &Flight,
    word: &str,
    moves: &[(usize, Move)],
    flown_m: &[[f64; 2]],
) -> Result<()> {
    let (mut ordered_m, mut strokes_m) = (0.0, 0.0);
    for ((_, step), [began_m, ended_m]) in moves.iter().zip(flown_m).filter(|m| m.0.1.lit) {
        ordered_m += (ended_m - began_m).max(0.0);
        strokes_m += distance(step.from_m, step.to_m);
    }
    if ordered_m >= LEAST_FLOWN * strokes_m {
        return Ok(());
    }
    // The setpoints draw another word, or the same word in another order.
    let near_m = near_m(moves, flight);
    let (actual, wanted) = if near_m < LEAST_FLOWN * strokes_m {
        (
            format!("setpoints on {ordered_m:.2} m of the {strokes_m:.2} m of its strokes"),
            "a flight that writes this word",
        )
    } else {
        (
            format!(
                "setpoints on {near_m:.2} m of the {strokes_m:.2} m of its strokes, and on \
                 {ordered_m:.2} m in their order"
            ),
            "the strokes in the order of style team, or a log with lights",
        )
    };
    Err(Error::input(format!("word {word}"), actual, wanted, HINT))
}

/// Returns the total length in m of the lit moves' stretches that setpoints cover, in any order.
fn near_m(moves: &[(usize, Move)], flight: &Flight) -> f64 {
    let lit = moves.iter().filter(|(_, step)| step.lit).map(|(_, step)| {
        let designs_m = flight.samples.iter().map(|sample| [sample.design_m.x, sample.design_m.z]);
        let along_m = designs_m.filter_map(|design_m| along(step, design_m));
        let [from_m, to_m] =
            along_m.fold([f64::INFINITY, 0.0], |[from, to], m| [m.min(from), m.max(to)]);
        (to_m - from_m).max(0.0)
    });
    lit.sum()
}

/// Progress of the setpoints along the moves.
#[derive(Debug, Default)]
struct Progress {
    index: usize,
    along_m: f64,
}

impl Progress {
    /// Advances to the move that contains `point`, a setpoint in m in the word's plane. Returns the
    /// move's letter, and true if the move is lit. Returns `None` if no move contains the setpoint,
    /// or if the drone still waits at the beginning of a letter.
    fn advance(&mut self, moves: &[(usize, Move)], point: [f64; 2]) -> Option<(usize, bool)> {
        let remaining = moves.iter().enumerate().skip(self.index);
        let (index, along_m) = remaining.into_iter().find_map(|(index, (_, step))| {
            let along_m = along(step, point)?;
            let backward = index == self.index && along_m < self.along_m - ON_MOVE_M;
            (!backward).then_some((index, along_m))
        })?;
        let (letter, step) = moves[index];
        let first_of_letter = index == 0 || moves[index - 1].0 != letter;
        // The farthest point so far is kept, so that progress along a move never decreases.
        let farthest_m = if index == self.index { self.along_m.max(along_m) } else { along_m };
        *self = Self { index, along_m: farthest_m };
        (along_m > 0.0 || !first_of_letter).then_some((letter, step.lit))
    }
}

/// Returns the distance in m of a point along a move from the move's beginning. Returns `None` for
/// a point that is not within [`ON_MOVE_M`] of the move.
fn along(step: &Move, point: [f64; 2]) -> Option<f64> {
    if segment_distance(point, [step.from_m, step.to_m]) >= ON_MOVE_M {
        return None;
    }
    let [from_m, to_m] = [step.from_m, step.to_m].map(Vector2::from);
    let (step_m, length_m) = (to_m - from_m, distance(step.from_m, step.to_m));
    if length_m == 0.0 {
        return Some(0.0);
    }
    let along_m = (Vector2::from(point) - from_m).dot(&step_m) / length_m;
    Some(along_m.clamp(0.0, length_m))
}
