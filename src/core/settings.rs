//! Settings. A declaration holds a setting's documentation, type, default and range.
//!
//! The macro [`settings!`] declares three kinds of type. From the same lines come the Rust type
//! with its `Default`, its form in a scene file, the check of its ranges, the commented scene that
//! `noctograph scene` prints, and the suggestions for a key that does not exist.
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
//! another key, members of its list, or numbers. Without names, to that key being set and not 0.
//! Settings without effect keep their values, so that a preset's gains survive a change of the
//! choice.
//!
//! A group may end with `fixed { ... }`: constants that no scene sets, but tests and conditions.
//!
//! Numbers without a range must be finite. Rules that involve several settings stay in a function
//! `check` of the type, which calls [`Described::check`] for the ranges.

use std::collections::BTreeSet;

use crate::error::{Error, Result};

/// One setting of a group.
#[derive(Debug)]
pub struct Setting {
    /// Its key in the scene file.
    pub key: &'static str,
    /// Its documentation, line by line.
    pub doc: &'static [&'static str],
    /// Smallest and largest value.
    pub range: Option<[f64; 2]>,
    /// Form of its value.
    pub shape: Shape,
    /// All conditions under which the key has an effect.
    pub needs: &'static [Need],
}

/// A condition for the effect of a setting: another setting, by its dotted key in the scene file.
#[derive(Debug)]
pub struct Need {
    /// The other setting.
    pub key: &'static str,
    /// Values of that key that count. With none listed, any value but 0 counts.
    pub names: &'static [&'static str],
    /// True if that must be so, false if it must not.
    pub holds: bool,
}

/// One name of a choice.
#[derive(Debug)]
pub struct Variant {
    /// The name in the scene file.
    pub name: &'static str,
    /// Its documentation, line by line.
    pub doc: &'static [&'static str],
    /// Settings that exist with this name only.
    pub settings: &'static [Setting],
}

/// Form of a setting's value in the scene file.
#[derive(Clone, Copy, Debug)]
pub enum Shape {
    /// A number, text, or a list.
    Plain,
    /// One of several names.
    Names(&'static [Variant]),
    /// A table.
    Group(&'static [Setting]),
    /// A table whose key `kind` decides which other keys it has.
    Tagged(&'static [Variant]),
}

impl Shape {
    /// The settings of a group. Panics for another shape.
    pub const fn settings(self) -> &'static [Setting] {
        match self {
            Self::Group(settings) => settings,
            _ => panic!("the payload of a choice is a group"),
        }
    }
}

/// A type that a setting may have.
pub trait Described {
    /// Form in the scene file.
    const SHAPE: Shape = Shape::Plain;

    /// Checks all ranges within the value. `place` is its key, and `range` is its range.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] with the key that is out of range.
    fn check(&self, _place: &str, _range: Option<[f64; 2]>) -> Result<()> {
        Ok(())
    }
}

/// The names of a choice, or none for another shape.
pub fn names(shape: Shape) -> impl Iterator<Item = &'static str> {
    let variants: &[Variant] = match shape {
        Shape::Names(variants) | Shape::Tagged(variants) => variants,
        Shape::Plain | Shape::Group(_) => &[],
    };
    variants.iter().map(|variant| variant.name)
}

/// The key of a setting within the table at `path`.
pub fn joined(path: &str, key: &str) -> String {
    let dot = if path.is_empty() { "" } else { "." };
    format!("{path}{dot}{key}")
}

/// The dotted keys of all settings, without the keys of groups.
pub fn paths(settings: &[Setting]) -> BTreeSet<String> {
    let mut keys = BTreeSet::new();
    for Setting { key, shape, .. } in settings {
        // Keys of the table below it, then its own.
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

/// The settings of the kind that a choice's table names, or none for an unknown kind.
pub fn of_kind(variants: &[Variant], table: &toml::Table) -> &'static [Setting] {
    let kind = table.get("kind").and_then(toml::Value::as_str);
    let variant = variants.iter().find(|variant| Some(variant.name) == kind);
    variant.map_or(&[], |variant| variant.settings)
}

/// Advice on an unknown name: the most similar candidate, or `otherwise` if none is similar.
pub fn suggestion<'a>(
    name: &str,
    candidates: impl IntoIterator<Item = &'a str>,
    otherwise: impl FnOnce() -> String,
) -> String {
    similar(name, candidates).map_or_else(otherwise, |similar| format!("did you mean {similar}?"))
}

/// The candidate with the smallest edit distance from an unknown name, or `None` if that is more
/// than a quarter of its length plus one.
pub fn similar<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // The edit distance is at least the difference in length, which decides on a huge name at once.
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

/// The error for a name that a choice does not have.
pub fn unknown_name(place: &str, name: &str, shape: Shape) -> Error {
    let wanted = names(shape).collect::<Vec<_>>().join(", ");
    let hint = suggestion(name, names(shape), || "choose a name from the list".into());
    Error::input(place, name, format!("one of {wanted}"), hint)
}

/// Numbers that a range applies to.
macro_rules! number {
    ($($type:ty),*) => {$(
        impl Described for $type {
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

/// Checks each item of a list.
fn check_items(items: &[impl Described], place: &str, range: Option<[f64; 2]>) -> Result<()> {
    let mut items = items.iter().enumerate();
    items.try_for_each(|(i, item)| item.check("", range).map_err(|error| error.of_item(place, i)))
}

/// Declares groups and choices of settings. See the module's documentation.
#[doc(hidden)]
#[macro_export]
macro_rules! described {
    () => {};

    // A group.
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

    // A choice with settings.
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

    // A choice by name.
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
            /// All of them, in the order of their declaration.
            $vis const ALL: &[Self] = &[Self::$first, $(Self::$variant,)*];

            /// Its name in a scene file.
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

/// The range of a declaration.
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

/// The settings of a variant's payload.
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

/// Checks the payload of the present variant.
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
            /// Corners of its path.
            corners_m: [f64; 2] = [0.0, 1.0], in -1.0..=1.0;
            /// Where strokes meet.
            joint: Joint = Joint::Round;
            /// Its tip.
            tip: Tip = Tip::default();
            fixed {
                /// Its length.
                length_m: f64 = 0.14;
            }
        }

        /// Where strokes meet.
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
            /// Width.
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
