//! Control: mathematics of linear systems with no drone in it.
//!
//! In: a model `ẋ = A x + B u`, `y = C x`, and weights. Out: the gain of a linear-quadratic
//! regulator, the gain of an observer by duality, and answers about a model (is it stable, how
//! many of its states are observable, its poles, its margins of gain and phase).
//!
//! Method: algebraic Riccati equations by structure-preserving doubling. A Cayley transform
//! converts the continuous equation to a discrete equation. No gain is made from eigenvalues:
//! nalgebra's QR iteration does not converge on some Hamiltonian matrices. Those of a closed loop
//! are reported.
//!
//! Sources: Chu, Fan, Lin, "A structure-preserving doubling algorithm for continuous-time algebraic
//! Riccati equations", Linear Algebra Appl. 396 (2005) 55–80. Chu, Fan, Lin, Wang, "Structure-
//! preserving algorithms for periodic discrete-time algebraic Riccati equations", Int. J. Control
//! 77 (2004) 767–788. Anderson, Moore, "Optimal Control: Linear Quadratic Methods" (1990).
//!
//! Not modeled: cross weights between state and input, descriptor systems, semidefinite solutions
//! (a state that costs nothing is refused).

use nalgebra::DMatrix;

mod linear;
mod lqr;
mod margins;
mod poles;
mod riccati;

/// A matrix of dynamic size: analysis and design are compiled once, for all sizes of systems.
type Matrix = DMatrix<f64>;

pub(crate) use linear::with_states;
pub use linear::{
    dynamic, is_hurwitz, linearize, linearize_finely, observability_rank, unobservable_states,
};
pub use lqr::{lqr, observer_gain};
pub use margins::{Margins, margins, with_input_lag};
pub use poles::poles;
