//! Declarations of settings, each with the setting's documentation, type, default and range.
//!
//! The macro [`settings!`] declares groups of settings, choices by name, and choices with settings
//! of their own. Each declaration produces the Rust type with its `Default`, its form in a scene
//! file, the check of its ranges, the commented scene that `noctograph scene` prints, and the
//! suggestions for an unknown key.
//!
//! ```ignore
//! settings! {
//!     /// A group: a table of the scene file.
//!     pub struct PenOptions {
//!         /// Speed along lit strokes.          (printed up to the first empty line)
//!         speed_m_s: f64 = 0.2, in 0.001..=100.0;
//!         /// What happens where strokes meet.
//!         joint: Joint = Joint::Round;
//!         /// Radius at corners. It has an effect with one choice only.
//!         radius_m: f64 = 0.01, in 0.0..=1.0, for "pen.joint" = "round";
//!     }
//!
//!     /// A choice by name: a string. The first name is the default.
//!     pub enum Joint {
//!         /// Rounded within the corner tolerance.
//!         "round" => Round,
//!         /// A full stop.
//!         "sharp" => Sharp,
//!     }
//!
//!     /// A choice with settings of its own: a table with the key `kind`, or only the name.
//!     pub enum Pen tagged {
//!         /// Any light.
//!         "brush" => Brush(BrushOptions),
//!         /// None at all.
//!         "none" => None,
//!     }
//! }
//! ```
//!
//! `for KEY = NAMES` and `unless KEY = NAMES` restrict the effect of a setting to some values of
//! another key, which may be names, members of its list, or numbers. Without names, a restriction
//! depends only on whether that key is set to a nonzero value. Settings without effect keep their
//! values, so that a preset's gains survive when another choice is tried and undone.
//!
//! A group may end with `fixed { ... }`, which declares constants that tests and conditions can
//! vary but no scene can set.
//!
//! Numbers without a range must be finite. A function `check` of the type contains the rules that
//! involve several settings, and calls [`Described::check`] for the ranges.

use std::collections::BTreeSet;

use crate::error::{Error, Result};

/// Setting of a group.
#[derive(Debug)]
pub struct Setting {
    /// Key of the setting in the scene file.
    pub key: &'static str,
    /// Documentation of the setting, line by line.
    pub doc: &'static [&'static str],
    /// Smallest and largest value of the setting.
    pub range: Option<[f64; 2]>,
    /// Form of the setting's value.
    pub shape: Shape,
    /// Conditions that must all hold for the key to have an effect.
    pub needs: &'static [Need],
}

/// Condition on another setting under which a setting has an effect.
#[derive(Debug)]
pub struct Need {
    /// Dotted key of the other setting in the scene file.
    pub key: &'static str,
    /// Values of the other setting that satisfy the condition. If this list is empty, all values
    /// except 0 satisfy it.
    pub names: &'static [&'static str],
    /// True if the other setting must have such a value, false if it must not.
    pub holds: bool,
}

/// Name that a choice offers.
#[derive(Debug)]
pub struct Variant {
    /// Name in the scene file.
    pub name: &'static str,
    /// Documentation of the name, line by line.
    pub doc: &'static [&'static str],
    /// Settings that exist only if this name is chosen.
    pub settings: &'static [Setting],
}

/// Form of a setting's value in the scene file.
#[derive(Clone, Copy, Debug)]
pub enum Shape {
    /// A number, a string or a list.
    Plain,
    /// One of several names.
    Names(&'static [Variant]),
    /// A table.
    Group(&'static [Setting]),
    /// A table whose key `kind` decides which other keys it has.
    Tagged(&'static [Variant]),
}

impl Shape {
    /// Returns the settings of a group. Panics for any other form.
    pub const fn settings(self) -> &'static [Setting] {
        match self {
            Self::Group(settings) => settings,
            _ => panic!("the payload of a choice is a group"),
        }
    }
}

/// Type that a setting may have.
pub trait Described {
    /// Form of the type's value in the scene file.
    const SHAPE: Shape = Shape::Plain;

    /// Checks all ranges within the value. `place` is the value's key, and `range` the key's range.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] with the key that is out of range.
    fn check(&self, _place: &str, _range: Option<[f64; 2]>) -> Result<()> {
        Ok(())
    }
}

/// Returns the names of a choice, or none for another form.
pub fn names(shape: Shape) -> impl Iterator<Item = &'static str> {
    let variants: &[Variant] = match shape {
        Shape::Names(variants) | Shape::Tagged(variants) => variants,
        Shape::Plain | Shape::Group(_) => &[],
    };
    variants.iter().map(|variant| variant.name)
}

/// Returns the dotted key of a setting within the table at `path`.
pub fn joined(path: &str, key: &str) -> String {
    let dot = if path.is_empty() { "" } else { "." };
    format!("{path}{dot}{key}")
}

/// Returns the dotted keys of all settings, without the keys of groups. For a choice, the keys of
/// all its kinds are included.
pub fn paths(settings: &[Setting]) -> BTreeSet<String> {
    let mut keys = BTreeSet::new();
    for Setting { key, shape, .. } in settings {
        // The keys within the setting are added first, followed by the setting's key.
        let below = match shape {
            Shape::Group(settings) => paths(settings),
            Shape::Tagged(kinds) => kinds.iter().flat_map(|kind| paths(kind.settings)).collect(),
            Shape::Plain | Shape::Names(_) => BTreeSet::new(),
        };
        keys.extend(below.iter().map(|path| joined(key, path)));
        if !matches!(shape, Shape::Group(_)) {
            keys.insert((*key).to_owned());
        }
    }
    keys
}

/// Returns the settings of the kind selected in a choice's table, or none for an unknown kind.
pub fn of_kind(variants: &[Variant], table: &toml::Table) -> &'static [Setting] {
    let kind = table.get("kind").and_then(toml::Value::as_str);
    let variant = variants.iter().find(|variant| Some(variant.name) == kind);
    variant.map_or(&[], |variant| variant.settings)
}

/// Returns the hint for an unknown name, which is the most similar candidate, or `otherwise`.
pub fn suggestion<'a>(
    name: &str,
    candidates: impl IntoIterator<Item = &'a str>,
    otherwise: impl FnOnce() -> String,
) -> String {
    similar(name, candidates).map_or_else(otherwise, |similar| format!("did you mean {similar}?"))
}

/// Returns the candidate with the smallest edit distance from an unknown name, or `None` if that
/// distance is greater than a quarter of the candidate's length plus one.
pub fn similar<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // The edit distance is at least the difference in length, so a much longer name is not
    // compared.
    let n_letters = name.chars().count();
    let distances = candidates.into_iter().filter_map(|candidate| {
        let max_distance = 1 + candidate.len() / 4;
        let may_be_near = n_letters.abs_diff(candidate.len()) <= max_distance;
        let distance = may_be_near.then(|| strsim::damerau_levenshtein(name, candidate))?;
        Some((distance, max_distance, candidate))
    });
    let (distance, max_distance, nearest) = distances.min_by_key(|(distance, ..)| *distance)?;
    (distance <= max_distance).then_some(nearest)
}

/// Returns the error for a name that a choice does not offer.
pub fn unknown_name(place: &str, name: &str, shape: Shape) -> Error {
    let wanted = names(shape).collect::<Vec<_>>().join(", ");
    let hint = suggestion(name, names(shape), || "choose a name from the list".into());
    Error::input(place, name, format!("one of {wanted}"), hint)
}

/// Implements [`Described`] for types of numbers, to which a range applies.
macro_rules! number {
    ($($type:ty),*) => {$(
        impl Described for $type {
            /// Checks that a number is within a range, or finite without one.
            fn check(&self, place: &str, range: Option<[f64; 2]>) -> Result<()> {
                let [min, max] = range.unwrap_or([f64::MIN, f64::MAX]);
                if (min..=max).contains(&(*self as f64)) {
                    return Ok(());
                }
                let wanted = match range {
                    Some([min, max]) => format!("a number from {min} to {max}"),
                    None => "a finite number".to_owned(),
                };
                Err(Error::input(place, self, wanted, "set a number within the range"))
            }
        }
    )*};
}
number!(f64, u8, u32, u64, usize);

impl Described for bool {}
impl Described for String {}

impl<T: Described> Described for Option<T> {
    const SHAPE: Shape = T::SHAPE;

    fn check(&self, place: &str, range: Option<[f64; 2]>) -> Result<()> {
        self.iter().try_for_each(|value| value.check(place, range))
    }
}

impl<T: Described> Described for Vec<T> {
    fn check(&self, place: &str, range: Option<[f64; 2]>) -> Result<()> {
        check_items(self, place, range)
    }
}

impl<T: Described, const N: usize> Described for [T; N] {
    fn check(&self, place: &str, range: Option<[f64; 2]>) -> Result<()> {
        check_items(self, place, range)
    }
}

/// Checks each item of a list at the key `place`. Numbers must lie within `range`, if one is given.
fn check_items(items: &[impl Described], place: &str, range: Option<[f64; 2]>) -> Result<()> {
    let mut items = items.iter().enumerate();
    items.try_for_each(|(i, item)| item.check("", range).map_err(|error| error.of_item(place, i)))
}

/// Declares groups and choices of settings. The module's documentation describes their form.
#[doc(hidden)]
#[macro_export]
macro_rules! described {
    () => {};

    // A group of settings.
    (
        $(#[$meta:meta])*
        $vis:vis struct $name:ident {
            $(
                $(#[doc = $doc:literal])+
                $key:ident: $type:ty = $default:expr
                    $(, in $range:expr)?
                    $(, for $need:literal $(= $($needed:literal)|+)?)*
                    $(, unless $bar:literal $(= $($barred:literal)|+)?)*;
            )*
            $(fixed {
                $(
                    $(#[doc = $fixed_doc:literal])+
                    $fixed:ident: $fixed_type:ty = $fixed_default:expr;
                )*
            })?
        }
        $($rest:tt)*
    ) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(default, deny_unknown_fields)]
        $vis struct $name {
            $(
                $(#[doc = $doc])+
                pub $key: $type,
            )*
            $($(
                $(#[doc = $fixed_doc])+
                #[serde(skip)]
                pub $fixed: $fixed_type,
            )*)?
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($key: $default,)* $($($fixed: $fixed_default,)*)? }
            }
        }

        impl $crate::settings::Described for $name {
            const SHAPE: $crate::settings::Shape = $crate::settings::Shape::Group(&[
                $($crate::settings::Setting {
                    key: stringify!($key),
                    doc: &[$($doc),+],
                    range: $crate::settings::range_of!($($range)?),
                    shape: <$type as $crate::settings::Described>::SHAPE,
                    needs: &[
                        $($crate::settings::Need {
                            key: $need,
                            names: &[$($($needed),+)?],
                            holds: true,
                        },)*
                        $($crate::settings::Need {
                            key: $bar,
                            names: &[$($($barred),+)?],
                            holds: false,
                        },)*
                    ],
                },)*
            ]);

            fn check(&self, place: &str, _: Option<[f64; 2]>) -> $crate::error::Result<()> {
                $($crate::settings::Described::check(
                    &self.$key,
                    &$crate::settings::joined(place, stringify!($key)),
                    $crate::settings::range_of!($($range)?),
                )?;)*
                Ok(())
            }
        }

        $crate::settings::settings! { $($rest)* }
    };

    // A choice with settings of its own.
    (
        $(#[$meta:meta])*
        $vis:vis enum $name:ident tagged {
            $(#[doc = $first_doc:literal])+
            $first_text:literal => $first:ident $(($first_payload:ty))?,
            $(
                $(#[doc = $doc:literal])+
                $text:literal => $variant:ident $(($payload:ty))?,
            )*
        }
        $($rest:tt)*
    ) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(tag = "kind", deny_unknown_fields)]
        $vis enum $name {
            $(#[doc = $first_doc])+
            #[serde(rename = $first_text)]
            $first $(($first_payload))?,
            $(
                $(#[doc = $doc])+
                #[serde(rename = $text)]
                $variant $(($payload))?,
            )*
        }

        impl Default for $name {
            fn default() -> Self {
                Self::$first $((<$first_payload>::default()))?
            }
        }

        impl $crate::settings::Described for $name {
            const SHAPE: $crate::settings::Shape = $crate::settings::Shape::Tagged(&[
                $crate::settings::Variant {
                    name: $first_text,
                    doc: &[$($first_doc),+],
                    settings: $crate::settings::payload_of!($($first_payload)?),
                },
                $($crate::settings::Variant {
                    name: $text,
                    doc: &[$($doc),+],
                    settings: $crate::settings::payload_of!($($payload)?),
                },)*
            ]);

            #[allow(unused_variables, reason = "a variant without settings has no place")]
            fn check(&self, place: &str, _: Option<[f64; 2]>) -> $crate::error::Result<()> {
                $crate::settings::check_variant!(
                    self, place, $first $($first_payload)?, $($variant $($payload)?,)*
                )
            }
        }

        $crate::settings::settings! { $($rest)* }
    };

    // A choice by name only.
    (
        $(#[$meta:meta])*
        $vis:vis enum $name:ident {
            $(#[doc = $first_doc:literal])+
            $first_text:literal => $first:ident,
            $(
                $(#[doc = $doc:literal])+
                $text:literal => $variant:ident,
            )*
        }
        $($rest:tt)*
    ) => {
        $(#[$meta])*
        #[derive(
            Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize,
        )]
        $vis enum $name {
            $(#[doc = $first_doc])+
            #[default]
            #[serde(rename = $first_text)]
            $first,
            $(
                $(#[doc = $doc])+
                #[serde(rename = $text)]
                $variant,
            )*
        }

        #[allow(dead_code, reason = "not every choice is listed or printed")]
        impl $name {
            /// Names of the choice, in the order of their declaration.
            $vis const ALL: &[Self] = &[Self::$first, $(Self::$variant,)*];

            /// Returns the name in a scene file.
            $vis fn name(self) -> &'static str {
                match self {
                    Self::$first => $first_text,
                    $(Self::$variant => $text,)*
                }
            }
        }

        impl std::str::FromStr for $name {
            type Err = $crate::error::Error;

            fn from_str(name: &str) -> $crate::error::Result<Self> {
                Self::ALL.iter().copied().find(|choice| choice.name() == name).ok_or_else(|| {
                    let shape = <Self as $crate::settings::Described>::SHAPE;
                    $crate::settings::unknown_name("name", name, shape)
                })
            }
        }

        impl $crate::settings::Described for $name {
            const SHAPE: $crate::settings::Shape = $crate::settings::Shape::Names(&[
                $crate::settings::Variant {
                    name: $first_text,
                    doc: &[$($first_doc),+],
                    settings: &[],
                },
                $($crate::settings::Variant { name: $text, doc: &[$($doc),+], settings: &[] },)*
            ]);
        }

        $crate::settings::settings! { $($rest)* }
    };
}

/// Returns the range of a declaration, if it has one.
#[doc(hidden)]
#[macro_export]
macro_rules! range_of {
    () => {
        None
    };
    ($range:expr) => {{
        const RANGE: std::ops::RangeInclusive<f64> = $range;
        Some([*RANGE.start(), *RANGE.end()])
    }};
}

/// Returns the settings of a variant's payload.
#[doc(hidden)]
#[macro_export]
macro_rules! payload_of {
    () => {
        &[]
    };
    ($payload:ty) => {
        <$payload as $crate::settings::Described>::SHAPE.settings()
    };
}

/// Checks the payload of the selected variant.
#[doc(hidden)]
#[macro_export]
macro_rules! check_variant {
    ($self:ident, $place:ident, $($variant:ident $($payload:ty)?,)*) => {{
        $($crate::settings::check_variant!(@one $self, $place, $variant $($payload)?);)*
        Ok(())
    }};
    (@one $self:ident, $place:ident, $variant:ident) => {};
    (@one $self:ident, $place:ident, $variant:ident $payload:ty) => {
        if let Self::$variant(payload) = $self {
            $crate::settings::Described::check(payload, $place, None)?;
        }
    };
}

pub use described as settings;
#[doc(hidden)]
pub use {check_variant, payload_of, range_of};

#[cfg(test)]
mod tests {
    use super::*;

    settings! {
        /// A pen.
        pub(crate) struct PenOptions {
            /// Speed along lit strokes.
            speed_m_s: f64 = 0.2, in 0.001..=100.0;
            /// Positions of the path's corners.
            corners_m: [f64; 2] = [0.0, 1.0], in -1.0..=1.0;
            /// Treatment of the places where strokes meet.
            joint: Joint = Joint::Round;
            /// Tip of the pen.
            tip: Tip = Tip::default();
            fixed {
                /// Length of the pen.
                length_m: f64 = 0.14;
            }
        }

        /// Treatment of the places where strokes meet.
        pub(super) enum Joint {
            /// Rounded.
            "round" => Round,
            /// A full stop.
            "sharp" => Sharp,
        }

        /// A tip.
        pub(crate) enum Tip tagged {
            /// Hair.
            "brush" => Brush(BrushOptions),
            /// Lead, which has no settings.
            "pencil" => Pencil,
        }

        /// A brush.
        pub(crate) struct BrushOptions {
            /// Width of the brush.
            width_m: f64 = 0.01, in 0.0..=1.0;
        }
    }

    #[test]
    fn a_declaration_is_a_type_a_file_and_its_checks() {
        let pen = PenOptions::default();
        let toml = "speed_m_s = 0.2\ncorners_m = [0.0, 1.0]\njoint = \"round\"\n\n[tip]\n\
                    kind = \"brush\"\nwidth_m = 0.01\n";
        assert_eq!(toml::to_string(&pen).unwrap(), toml);
        assert_eq!(toml::from_str::<PenOptions>("").unwrap(), pen);
        let pencil: PenOptions = toml::from_str("tip = { kind = \"pencil\" }").unwrap();
        assert_eq!(pencil.tip, Tip::Pencil);
        for unknown in ["width_m = 1", "length_m = 1", "tip = { kind = \"brush\", length_m = 1 }"] {
            assert!(toml::from_str::<PenOptions>(unknown).is_err(), "{unknown}");
        }
    }

    #[test]
    fn a_value_out_of_its_range_is_named_by_its_key() {
        fn fault(change: fn(&mut PenOptions)) -> String {
            let mut pen = PenOptions::default();
            change(&mut pen);
            pen.check("pen", None).unwrap_err().to_string()
        }
        let brush = |pen: &mut PenOptions| pen.tip = Tip::Brush(BrushOptions { width_m: 2.0 });
        assert_eq!(fault(brush), "pen.tip.width_m: found 2, wanted a number from 0 to 1");
        assert!(fault(|pen| pen.corners_m[1] = -2.0).starts_with("pen.corners_m[1]: found -2"));
        assert!(fault(|pen| pen.speed_m_s = f64::NAN).contains("found NaN"));
        PenOptions::default().check("pen", None).unwrap();
    }

    #[test]
    fn a_name_that_is_nearly_right_is_suggested() {
        assert_eq!("sharp".parse::<Joint>().unwrap(), Joint::Sharp);
        let error = "sharpe".parse::<Joint>().unwrap_err();
        assert_eq!(error.hint(), "did you mean sharp?");
        assert!(error.to_string().contains("one of round, sharp"), "{error}");
        assert_eq!("blunt".parse::<Joint>().unwrap_err().hint(), "choose a name from the list");
    }
}
