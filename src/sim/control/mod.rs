//! Control theory of linear systems, independent of any drone.
//!
//! The input is a model `ẋ = A x + B u`, `y = C x`, and weights. The output is the gain of a
//! linear-quadratic regulator, the gain of an observer by duality, and properties of the model,
//! which are its stability, number of observable states, poles, and gain and phase margins.
//!
//! Algebraic Riccati equations are solved by structure-preserving doubling. A Cayley transform
//! converts the continuous equation to a discrete one. No gain is computed from eigenvalues,
//! because nalgebra's QR iteration does not converge on some Hamiltonian matrices. The eigenvalues
//! of a closed loop are only reported.
//!
//! Sources: Chu, Fan, Lin, "A structure-preserving doubling algorithm for continuous-time algebraic
//! Riccati equations", Linear Algebra Appl. 396 (2005) 55–80. Chu, Fan, Lin, Wang,
//! "Structure-preserving algorithms for periodic discrete-time algebraic Riccati equations", Int.
//! J. Control 77 (2004) 767–788. Anderson, Moore, "Optimal Control: Linear Quadratic Methods"
//! (1990).
//!
//! Cross weights between state and input, descriptor systems, and semidefinite solutions (for a
//! state without cost) are not supported.

use nalgebra::DMatrix;

/// Matrix of dynamic size from its rows, separated by semicolons. nalgebra's macro of this name is
/// a procedural macro, whose parser takes seconds to build.
#[cfg(test)]
macro_rules! dmatrix {
    ($($($value:expr),+);+) => {{
        let rows = [$(&[$($value),+][..]),+];
        nalgebra::DMatrix::<f64>::from_row_slice(rows.len(), rows[0].len(), &rows.concat())
    }};
}

mod linear;
mod lqr;
mod margins;
mod poles;
mod riccati;

/// Matrix of dynamic size, so that analysis and design are compiled once for systems of any size.
type Matrix = DMatrix<f64>;

pub(crate) use linear::block_matrix;
pub use linear::{
    dynamic, is_hurwitz, linearize, linearize_finely, observability_rank, unobservable_states,
};
pub use lqr::{lqr, observer_gain};
pub use margins::{Margins, margins, with_input_lag};
pub use poles::poles;
