//! Report: products as pictures and pages for people.
//!
//! Products in: [`Flight`](crate::flight::Flight)s, [`Plan`](crate::plan::Plan)s. Products out: plots as SVG
//! text; and sheets of a [`Font`](crate::letters::Font)'s characters, as SVG text or pixels ([`specimen`]).
//!
//! Method: curves are thinned to what a pixel can show and drawn with plotters; nothing but the
//! numbers decides a byte. Text is left to the viewer's sans-serif typeface. Colours are those of
//! Okabe and Ito (2008), which people with any color vision can tell apart.
//!
//! Sources: the reference team's Figures 6 (x-y plane with lines at y = ±0.2 m) and 7 (x-z plane).

mod figure;
mod flights;
mod overlay;
mod plans;
pub mod specimen;

pub use flights::{Trace, error_over_time, front_view, top_view};
pub use overlay::{overlay_photo, overlay_svg};
pub use plans::plan_view;
