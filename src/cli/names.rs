//! Parsers of command-line values, which are numbers, and choices by their names in scene files.

use std::str::FromStr;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use crate::error::Error;
use noctograph_core::settings::{Described, Shape};

/// A scene key with its new value.
pub(super) type Setting = (String, String);

/// Returns a parser for a choice, which lists its names in the help and suggests the nearest one.
pub(super) fn named<T>() -> impl TypedValueParser<Value = T>
where
    T: Described + FromStr<Err = Error> + Clone + Send + Sync + 'static,
{
    names::<T>().try_map(|name| name.parse::<T>())
}

/// Returns a parser that accepts the names of a choice, and yields the name. Its help explains each
/// name.
pub(super) fn names<T: Described>() -> PossibleValuesParser {
    let variants = match T::SHAPE {
        Shape::Names(variants) | Shape::Tagged(variants) => variants,
        Shape::Plain | Shape::Group(_) => &[],
    };
    // The help text of a name is the first paragraph of the variant's doc comment.
    let names = variants.iter().map(|variant| {
        let doc = variant.doc.iter().map(|line| line.trim()).take_while(|line| !line.is_empty());
        let doc = doc.collect::<Vec<_>>().join(" ");
        PossibleValue::new(variant.name).help(doc.trim_end_matches('.').to_owned())
    });
    names.collect::<Vec<_>>().into()
}

/// Parses `N` numbers that are separated by any of the given characters. Returns `None` for another
/// number of them, and for other texts.
pub(super) fn numbers<const N: usize>(text: &str, separators: &[char]) -> Option<[f64; N]> {
    let numbers = text.split(separators).map(|number| number.trim().parse().ok());
    numbers.collect::<Option<Vec<f64>>>()?.try_into().ok()
}

/// Four corners in a photo, in pixels, clockwise from the upper left.
#[derive(Clone, Debug)]
pub(super) struct Corners(pub(super) [[f64; 2]; 4]);

impl FromStr for Corners {
    type Err = String;

    /// Parses four corners in pixels, such as `10,20 300,20 300,90 10,90`. Returns a message for
    /// other texts.
    fn from_str(text: &str) -> Result<Self, String> {
        /// Reads a pair such as `10,20` as x and y.
        fn corner(pair: &str) -> Option<[f64; 2]> {
            let (x, y) = pair.split_once(',')?;
            Some([x.trim().parse().ok()?, y.trim().parse().ok()?])
        }
        let corners: Option<Vec<[f64; 2]>> = text.split_whitespace().map(corner).collect();
        corners.and_then(|corners| corners.try_into().ok()).map(Self).ok_or_else(|| {
            "wanted four corners \"X,Y X,Y X,Y X,Y\" in pixels, clockwise from the upper left"
                .into()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expose::BackendChoice;

    #[test]
    fn a_choice_is_parsed_by_its_names_in_scene_files() {
        let flag = clap::Arg::new("backend").value_parser(named::<BackendChoice>());
        let command = clap::Command::new("x").arg(flag);
        let parse = |name| command.clone().try_get_matches_from(["x", name]);
        let actual = parse("cpu").unwrap().remove_one::<BackendChoice>("backend");
        assert_eq!(actual, Some(BackendChoice::Cpu));
        assert!(parse("cpp").unwrap_err().to_string().contains("'cpu'"), "a suggestion");
    }
}
