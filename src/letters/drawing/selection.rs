//! Selects a drawing's strokes by number or color.

use super::LetterOptions;
use noctograph_core::error::{Error, Result};
use noctograph_core::strokes::SourceStroke;

/// Strokes with their numbers in the whole drawing, counted from 1.
pub(super) type Numbered<T> = Vec<(usize, T)>;

/// Names of colors, and the maximum hue in degrees of each except the last.
const HUES: [&str; 9] =
    ["red", "orange", "yellow", "green", "cyan", "blue", "purple", "pink", "red"];
const HUE_ENDS: [f64; 8] = [15.0, 45.0, 70.0, 165.0, 195.0, 260.0, 320.0, 345.0];
/// Minimum chroma, out of 255, of a color with a hue name, and the levels that separate black, gray
/// and white.
const CHROMA: u8 = 24;
const GRAY: [u8; 2] = [64, 192];

/// Returns the strokes that the options `ink` and `without` select, with their numbers. Fails if
/// none is left, or if the options name strokes that the drawing lacks.
pub(super) fn chosen<T>(
    strokes: Vec<T>,
    color: impl Fn(&T) -> Option<[u8; 3]>,
    options: &LetterOptions,
    file: &str,
) -> Result<Numbered<T>> {
    let colors: Vec<Option<&str>> = strokes.iter().map(|stroke| color(stroke).map(name)).collect();
    let wanted = named("ink", &options.ink, &colors)?;
    let unwanted = named("without", &options.without, &colors)?;
    // An empty list of wanted strokes selects all strokes.
    let is_all = !wanted.contains(&true);
    let is_empty = strokes.is_empty();
    let mut kept: Numbered<T> = (1..).zip(strokes).collect();
    kept.retain(|(number, _)| (is_all || wanted[number - 1]) && !unwanted[number - 1]);
    if kept.is_empty() && !is_empty {
        let (choice, hint) = ("a selection that leaves no strokes", "leave out fewer strokes");
        let error = Error::input("letters.without", choice, "at least one stroke", hint);
        return Err(error.coded(super::EMPTY).in_file(file, None));
    }
    Ok(kept)
}

/// Returns all strokes with their color names. `in_file` maps points with y down to the file.
pub(super) fn in_source<'a>(
    strokes: impl Iterator<Item = (&'a Vec<[f64; 2]>, Option<[u8; 3]>)>,
    in_file: impl Fn([f64; 2]) -> [f64; 2],
) -> Vec<SourceStroke> {
    Vec::from_iter(strokes.map(|(points, color)| SourceStroke {
        points: points.iter().map(|[x, y]| in_file([*x, -y])).collect(),
        color: color.map(name),
    }))
}

/// Returns true for each stroke that a list such as `2,5-7,red` names. Fails if the drawing lacks
/// an item of the list. `key` is the setting that contains the list.
fn named(key: &str, list: &str, colors: &[Option<&'static str>]) -> Result<Vec<bool>> {
    let n_strokes = colors.len();
    let mut named = vec![false; n_strokes];
    // Each part is a number, a range of numbers, or a color by its name or in CSS syntax.
    for text in list.split(',').map(str::trim).filter(|text| !text.is_empty()) {
        let (first, last) = text.split_once('-').unwrap_or((text, text));
        let range = first.trim().parse().ok().zip(last.trim().parse().ok());
        let color = text.parse::<svgtypes::Color>().ok();
        let color = color.map(|color| name([color.red, color.green, color.blue]));
        let matches = Vec::from_iter((0..n_strokes).filter(|index| match range {
            Some((first, last)) => {
                first >= 1 && last <= n_strokes && (first..=last).contains(&(index + 1))
            }
            None => color.is_some() && colors[*index] == color,
        }));
        if matches.is_empty() {
            let mut color_names: Vec<&str> = colors.iter().copied().flatten().collect();
            color_names.sort_unstable();
            color_names.dedup();
            let wanted = format!(
                "numbers from 1 to {n_strokes}, or one of the colors {}",
                color_names.join(", ")
            );
            let hint = "the drawing of the plan (*.svg) shows the strokes' numbers";
            return Err(Error::input(format!("letters.{key}"), format!("{text:?}"), wanted, hint));
        }
        matches.into_iter().for_each(|index| named[index] = true);
    }
    Ok(named)
}

/// Returns the name of a color: its hue, or black, gray or white. Colors of little chroma are gray.
pub(super) fn name([r, g, b]: [u8; 3]) -> &'static str {
    let (most, least) = (r.max(g).max(b), r.min(g).min(b));
    if most - least < CHROMA {
        return ["black", "gray", "white"][GRAY.iter().filter(|level| most >= **level).count()];
    }
    // The hue is that of the HSV model, in degrees.
    let [r, g, b] = [r, g, b].map(f64::from);
    let chroma = f64::from(most - least);
    let hue = if r >= g && r >= b {
        60.0 * ((g - b) / chroma)
    } else if g >= b {
        60.0 * ((b - r) / chroma + 2.0)
    } else {
        60.0 * ((r - g) / chroma + 4.0)
    };
    HUES[HUE_ENDS.partition_point(|end| *end < hue.rem_euclid(360.0))]
}

#[cfg(test)]
mod tests {
    use super::super::{Ink, tests::drawn_in};
    use super::*;

    #[test]
    fn colors_have_the_names_that_people_give_them() {
        fn named(text: &str) -> &'static str {
            let color: svgtypes::Color = text.parse().unwrap();
            name([color.red, color.green, color.blue])
        }
        for own in "black gray white red orange yellow green cyan blue purple".split(' ') {
            assert_eq!(named(own), own);
        }
        let others = "crimson red hotpink pink lime green navy blue gold yellow #00ff80 green \
                      #0080ff blue";
        let words: Vec<&str> = others.split(' ').collect();
        for (other, own) in words.chunks(2).map(|pair| (pair[0], pair[1])) {
            assert_eq!(named(other), own, "{other}");
        }
    }

    #[test]
    fn strokes_are_chosen_by_number_and_color_and_keep_their_numbers() {
        let colors = [[0; 3], [255, 0, 0], [0; 3], [255, 255, 0]];
        let numbers = |ink: &str, without: &str| {
            let options =
                LetterOptions { ink: ink.into(), without: without.into(), ..Default::default() };
            let kept = chosen(colors.to_vec(), |color| Some(*color), &options, "a.png");
            kept.map(|kept| kept.into_iter().map(|(number, _)| number).collect::<Vec<_>>())
        };
        assert_eq!(numbers("", "").unwrap(), [1, 2, 3, 4]);
        assert_eq!(numbers("red, 3", "").unwrap(), [2, 3]);
        assert_eq!(numbers("2-4", "black").unwrap(), [2, 4]);
        assert_eq!(numbers("", "#cc0000,1").unwrap(), [3, 4]);
        for (ink, without) in [("5", ""), ("0", ""), ("3-2", ""), ("blue", ""), ("", "x")] {
            let told = numbers(ink, without).unwrap_err().to_string();
            assert!(told.contains("1 to 4") && told.contains("black, red, yellow"), "{told}");
        }
        assert!(numbers("red", "2").unwrap_err().to_string().contains("no stroke"));
    }

    #[test]
    fn what_is_chosen_fills_the_canvas_and_is_drawn_as_before() {
        let svg = "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 99 99' fill='none'>\
                   <path d='M0 0h90v90' stroke='black'/><path d='M20 40h20v10' stroke='#c00'/>\
                   <path d='M1 1h9' stroke='lime'/></svg>";
        let json = "{\"strokes\": [[[0, 0], [90, 90]], [[20, 40], [40, 50]], [[9, 9], [1, 9]]],\
                    \"colors\": [[0, 0, 0], [200, 0, 0], [0, 255, 0]]}";
        for (name, text) in [("a.svg", svg), ("a.json", json)] {
            for (ink, without) in [("red", ""), ("2", ""), ("", "black,3")] {
                let canvas_m = Some([2.0, 1.0]);
                let (ink, without) = (ink.to_owned(), without.to_owned());
                let options = LetterOptions { ink, without, canvas_m, ..LetterOptions::default() };
                let strokes = drawn_in(name, text, &options, Ink::ByColor).unwrap();
                assert_eq!((strokes.n_strokes(), strokes.colors.len()), (1, 1), "{name}");
                assert_eq!(strokes.numbers.iter().map(|it| it.0).collect::<Vec<_>>(), [2]);
                let [left, bottom, right, top] = strokes.bounds_m();
                assert!((right - left - 2.0).abs() < 1e-9 && (top - bottom - 1.0).abs() < 1e-9);
                let [x, y] = strokes.numbers[0].1;
                assert!((left..=right).contains(&x) && (bottom..=top).contains(&y), "{x}, {y}");
                // Strokes that are left out are still listed.
                let colors: Vec<_> = strokes.source.strokes.iter().map(|it| it.color).collect();
                assert_eq!(colors, [Some("black"), Some("red"), Some("green")], "{name}");
                assert_eq!(
                    strokes.source.strokes[1].points.len(),
                    3 - usize::from(name == "a.json")
                );
            }
        }
    }
}
