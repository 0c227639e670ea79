//! Reports: draws products as pictures and pages.
//!
//! Products in: [`Flight`](noctograph_core::flight::Flight)s, [`Plan`](noctograph_plan::Plan)s and
//! [`Photo`](noctograph_picture::photo::Photo)s. Products out: plots as SVG text, and photos
//! overlaid on each other ([`photos`]).
//!
//! Method: curves are thinned to pixel resolution and drawn on one canvas. The output bytes depend
//! only on the numbers. Text uses the viewer's sans-serif typeface. The colors are those of Okabe
//! and Ito (2008), which people with any kind of color vision can distinguish.
//!
//! Sources: Figures 6 (x-y plane with lines at y = ±0.2 m) and 7 (x-z plane) of the reference team.
//!
//! Studies are drawn as sheets of photos ([`study_sheet`]) and as plots of their figures.

mod bound;
mod canvas;
mod coverage;
mod evening;
mod figure;
mod flights;
mod hold;
mod labels;
mod overlay;
mod page;
pub mod photos;
mod place;
mod plans;
mod sheet;
mod shot;
mod spread;
mod studies;

pub use bound::bound_map;
pub use canvas::escaped;
pub use coverage::coverage_map;
pub use evening::evening_page;
pub use flights::{NamedFlight, error_over_time, front_view, top_view};
pub use hold::hold_figure;
pub use labels::{Label, labeled};
pub use overlay::{overlay_photo, overlay_svg};
pub use page::Page;
pub use plans::plan_view;
pub use sheet::{acuity_sheet, spread_sheet, study_sheet};
pub use shot::{FlownNotes, LEAST_PROBABILITY, ShotNotes, rivals, shot_page};
pub use spread::{spread_front, spread_over_time};
pub use studies::pareto;
