//! Stroke fonts: letters as runs of the pen in a unit box, kept as text under `fonts/`.
//!
//! A line is a letter: the character, then runs, each `+` (lit) or `-` (dark) and its points
//! `x,y` with 0,0 lower left and 1,1 upper right. `#` begins a comment line.

use super::{Cell, Glyph, Move};

/// A single-line font.
#[derive(Debug)]
pub(super) struct StrokeFont {
    letters: Vec<(char, Vec<Run>)>,
}

/// A run of the pen in the unit box.
#[derive(Debug)]
struct Run {
    lit: bool,
    points: Vec<[f64; 2]>,
}

impl StrokeFont {
    /// Reads a font; `None` where a line is not of the form above.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let lines = text.lines().filter(|line| !line.is_empty() && !line.starts_with('#'));
        lines.map(parse_letter).collect::<Option<Vec<_>>>().map(|letters| Self { letters })
    }

    /// The characters that the font can draw, in the font's order.
    pub(super) fn characters(&self) -> impl Iterator<Item = char> {
        self.letters.iter().map(|(character, _)| *character)
    }

    /// Draws a character into a cell; `None` where the font lacks it.
    pub(super) fn glyph(&self, character: char, cell: Cell) -> Option<Glyph> {
        let (_, runs) = self.letters.iter().find(|(c, _)| *c == character)?;
        let place = |[x, y]: [f64; 2]| {
            [cell.left_m + x * cell.width_m, cell.baseline_m + y * cell.cap_height_m]
        };
        let moves = runs.iter().flat_map(|run| {
            run.points.windows(2).map(move |leg| Move {
                from_m: place(leg[0]),
                to_m: place(leg[1]),
                lit: run.lit,
            })
        });
        Some(Glyph { character, cell, moves: moves.collect() })
    }
}

fn parse_letter(line: &str) -> Option<(char, Vec<Run>)> {
    let mut words = line.split_whitespace();
    let mut name = words.next()?.chars();
    let (character, None) = (name.next()?, name.next()) else { return None };
    let mut runs: Vec<Run> = Vec::new();
    for word in words {
        match word {
            "+" | "-" => runs.push(Run { lit: word == "+", points: Vec::new() }),
            point => {
                let (x, y) = point.split_once(',')?;
                runs.last_mut()?.points.push([x.parse().ok()?, y.parse().ok()?]);
            }
        }
    }
    runs.iter().all(|run| run.points.len() >= 2).then_some((character, runs))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_broken_line_is_refused() {
        for broken in ["A 0,0 1,1", "A + 0,0", "AB + 0,0 1,1", "A + 0;0 1,1", "A + 0,x 1,1"] {
            assert!(StrokeFont::parse(broken).is_none(), "accepted {broken:?}");
        }
        assert!(StrokeFont::parse("# note\n\nA + 0,0 1,1\n").is_some(), "a good line is accepted");
    }

    #[test]
    fn a_letter_fills_its_cell() {
        let font = StrokeFont::parse("L - 0,1 0,1 + 0,1 0,0 1,0").unwrap();
        let cell = Cell { left_m: 2.0, baseline_m: 0.5, width_m: 0.3, cap_height_m: 0.4 };
        let glyph = font.glyph('L', cell).unwrap();
        assert_eq!(glyph.moves.len(), 3, "one dark and two lit moves");
        assert_eq!(glyph.moves[1].from_m, [2.0, 0.9], "upper left corner");
        assert_eq!(glyph.moves[2].to_m, [2.3, 0.5], "lower right corner");
        assert!(!glyph.moves[0].lit && glyph.moves[2].lit, "the signs are kept");
        assert!(font.glyph('M', cell).is_none(), "a missing letter is no letter");
    }
}
