//! Mathematics of linear systems with no drone in it.
