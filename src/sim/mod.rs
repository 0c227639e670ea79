//! Sim: a plan is flown.
