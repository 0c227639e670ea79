//! Detail: the accuracy of a film, for which computing time grows.

/// Accuracy of the spots of moving lamps, and of the glow of floor and walls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detail {
    /// Maximum length, in σ, of a segment that 1, 2, 3 and 4 spots represent, respectively. Longer
    /// segments are split. The lengths follow from the error term of n-point quadrature, with the
    /// derivative of order 2n at the Gaussian's center.
    pub(super) longest_sigma: [f64; 4],
    /// Maximum difference of glow between the center of an undivided square and the mean of its
    /// corners, relative to the center and relative to saturation.
    pub(super) even: [f64; 2],
    /// Minimum side of the glow's squares.
    pub(super) least_square_px: u32,
    /// Maximum ratio of a branch's radius to its distance. The error of an evenly filled branch
    /// straight below it grows with the square, and is less elsewhere.
    pub(super) opening: f64,
}

impl Detail {
    /// Accuracy of a picture. A spot errs by 6e-6 of its peak. The glow errs by one 8-bit level or
    /// by a fifth of the light that the camera tone maps to black, and a branch by 4 %.
    pub const PICTURE: Self = Self {
        longest_sigma: [0.011, 0.3, 0.95, 1.8],
        even: [0.02, 1e-4],
        least_square_px: 1,
        opening: 0.3,
    };

    /// Accuracy of a small film that is only read. A spot errs by 1e-3 of its peak, less than half
    /// an 8-bit level. The glow, which the reader subtracts, errs by five levels.
    pub const READING: Self = Self {
        longest_sigma: [0.142, 1.08, 2.23, 3.41],
        even: [0.1, 1e-3],
        least_square_px: 4,
        opening: 0.6,
    };
}
