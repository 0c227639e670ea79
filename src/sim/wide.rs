//! Numbers of several drones at once: one drone a lane of the processor's widest registers.
//!
//! What is written for any [`Real`] flies one drone with `f64`, and with [`Wide`] as many as a
//! register holds: four or eight on x86, one where a processor has none. Each lane makes the same
//! operations in the same order, and no product is fused with a sum, so that a drone flies bit for
//! bit alike in a lane and alone.
//!
//! Code for any [`Real`] has loops where it might have closures: a compiler that leaves a closure as a
//! function of its own makes it without the wide registers.

use std::fmt::Debug;
use std::ops::{Add, Div, Mul, Neg, Sub};

use pulp::{Arch, NullaryFnOnce, Simd, bytemuck};

/// A number of one drone, or one of each of several.
pub(super) trait Real:
    Copy
    + Debug
    + Add<Output = Self>
    + Add<f64, Output = Self>
    + Sub<Output = Self>
    + Sub<f64, Output = Self>
    + Mul<Output = Self>
    + Mul<f64, Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// What is needed to make one: leave to use the registers.
    type Leave: Copy + Debug;
    /// Drones.
    const LANES: usize;

    /// Runs something in the widest registers that the processor has.
    fn run<F: NullaryFnOnce>(leave: Self::Leave, call: F) -> F::Output;

    /// The number of each lane.
    fn of(leave: Self::Leave, value: impl Fn(usize) -> f64) -> Self;
    /// The same number in all lanes.
    fn all(self, value: f64) -> Self;
    /// That of one lane.
    fn lane(&self, lane: usize) -> f64;
    /// Puts another number into one lane.
    fn set_lane(&mut self, lane: usize, value: f64);
    /// Square root.
    fn root(self) -> Self;
    /// `below` in lanes that are less than `limit`, `otherwise` in others.
    fn pick(self, limit: Self, below: Self, otherwise: Self) -> Self;
    /// The two knots of a table about this number, which counts knots, and what it is beyond the
    /// first of the two.
    fn knots<const N: usize>(self, table: &[Self; N]) -> [Self; 3];

    /// No less than `least`, which also stands for what is not a number.
    #[inline(always)]
    fn at_least(self, least: Self) -> Self {
        least.pick(self, self, least)
    }

    /// No more than `most`, which also stands for what is not a number.
    #[inline(always)]
    fn at_most(self, most: Self) -> Self {
        self.pick(most, self, most)
    }

    /// Whether some lane passes.
    #[inline(always)]
    fn any(self, passes: impl Fn(f64) -> bool) -> bool {
        (0..Self::LANES).fold(false, |any, lane| any | passes(self.lane(lane)))
    }
}

impl Real for f64 {
    type Leave = ();
    const LANES: usize = 1;

    fn run<F: NullaryFnOnce>((): (), call: F) -> F::Output {
        Arch::new().dispatch(call)
    }

    #[inline(always)]
    fn of((): (), value: impl Fn(usize) -> Self) -> Self {
        value(0)
    }

    #[inline(always)]
    fn all(self, value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn lane(&self, _: usize) -> f64 {
        *self
    }

    #[inline(always)]
    fn set_lane(&mut self, _: usize, value: f64) {
        *self = value;
    }

    #[inline(always)]
    fn root(self) -> Self {
        self.sqrt()
    }

    #[inline(always)]
    fn pick(self, limit: Self, below: Self, otherwise: Self) -> Self {
        if self < limit { below } else { otherwise }
    }

    #[inline(always)]
    fn knots<const N: usize>(self, table: &[Self; N]) -> [Self; 3] {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to N")]
        let below = (self as usize).min(N - 2);
        #[expect(clippy::cast_precision_loss, reason = "a small number")]
        let beyond = self - below as Self;
        [table[below], table[below + 1], beyond]
    }
}

/// A number of each of several drones.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wide<S: Simd> {
    leave: S,
    value: S::f64s,
}

impl<S: Simd> Wide<S> {
    #[inline(always)]
    fn with(self, value: S::f64s) -> Self {
        Self { value, ..self }
    }
}

impl<S: Simd> Real for Wide<S> {
    type Leave = S;
    const LANES: usize = S::F64_LANES;

    fn run<F: NullaryFnOnce>(leave: S, call: F) -> F::Output {
        leave.vectorize(call)
    }

    fn of(leave: S, value: impl Fn(usize) -> f64) -> Self {
        let mut wide = Self { leave, value: leave.splat_f64s(0.0) };
        (0..Self::LANES).for_each(|lane| wide.set_lane(lane, value(lane)));
        wide
    }

    #[inline(always)]
    fn all(self, value: f64) -> Self {
        self.with(self.leave.splat_f64s(value))
    }

    #[inline(always)]
    fn lane(&self, lane: usize) -> f64 {
        bytemuck::cast_slice::<S::f64s, f64>(std::slice::from_ref(&self.value))[lane]
    }

    #[inline(always)]
    fn set_lane(&mut self, lane: usize, value: f64) {
        bytemuck::cast_slice_mut::<S::f64s, f64>(std::slice::from_mut(&mut self.value))[lane] =
            value;
    }

    #[inline(always)]
    fn root(self) -> Self {
        self.with(self.leave.sqrt_f64s(self.value))
    }

    #[inline(always)]
    fn pick(self, limit: Self, below: Self, otherwise: Self) -> Self {
        let mask = self.leave.less_than_f64s(self.value, limit.value);
        self.with(self.leave.select_f64s(mask, below.value, otherwise.value))
    }

    /// Every knot is looked at, which for a dozen is faster than to fetch each lane's own.
    #[inline(always)]
    fn knots<const N: usize>(self, table: &[Self; N]) -> [Self; 3] {
        let [mut low, mut high, mut below] = [table[0], table[1], self.all(0.0)];
        for (knot, count) in (1..N - 1).zip(1_u32..) {
            let count = self.all(f64::from(count));
            low = self.pick(count, low, table[knot]);
            high = self.pick(count, high, table[knot + 1]);
            below = self.pick(count, below, count);
        }
        [low, high, self - below]
    }
}

/// An operation between two, and with one number for all lanes.
macro_rules! operator {
    ($trait:ident, $method:ident, $operation:ident) => {
        impl<S: Simd> $trait for Wide<S> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.with(self.leave.$operation(self.value, other.value))
            }
        }

        impl<S: Simd> $trait<f64> for Wide<S> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: f64) -> Self {
                self.with(self.leave.$operation(self.value, self.leave.splat_f64s(other)))
            }
        }
    };
}

operator!(Add, add, add_f64s);
operator!(Sub, sub, sub_f64s);
operator!(Mul, mul, mul_f64s);
operator!(Div, div, div_f64s);

impl<S: Simd> Neg for Wide<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        self.with(self.leave.neg_f64s(self.value))
    }
}

/// Settings of the drones that are flown together, one set a lane; lanes beyond the last are flown
/// as the last.
#[derive(Debug)]
pub(super) struct Each<'a, O, T: Real> {
    leave: T::Leave,
    options: Vec<&'a O>,
}

impl<'a, O, T: Real> Each<'a, O, T> {
    /// Settings of at least one drone.
    pub(super) fn new(leave: T::Leave, options: Vec<&'a O>) -> Self {
        assert!((1..=T::LANES).contains(&options.len()), "no drone, or more than there are lanes");
        Self { leave, options }
    }

    /// A part of each one's settings.
    pub(super) fn part<P>(&self, part: impl Fn(&'a O) -> &'a P) -> Each<'a, P, T> {
        Each { leave: self.leave, options: self.options.iter().map(|o| part(o)).collect() }
    }

    /// A figure of each one's settings.
    pub(super) fn figure(&self, figure: impl Fn(&O) -> f64) -> T {
        let last = self.options.len() - 1;
        T::of(self.leave, |lane| figure(self.options[lane.min(last)]))
    }

    /// Some figures of each one's settings.
    pub(super) fn figures<const N: usize>(&self, figures: impl Fn(&O) -> [f64; N]) -> [T; N] {
        std::array::from_fn(|i| self.figure(|options| figures(options)[i]))
    }

    /// Every one's settings.
    pub(super) fn all(&self) -> impl Iterator<Item = &'a O> {
        self.options.iter().copied()
    }

    /// What all have in common is that of the first.
    pub(super) fn first(&self) -> &'a O {
        self.options[0]
    }
}

impl<'a, O> Each<'a, O, f64> {
    /// One drone.
    pub(super) fn one(options: &'a O) -> Self {
        Self::new((), vec![options])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Operations on three numbers in each lane, and on each alone.
    struct Check([Vec<f64>; 3]);

    #[inline(always)]
    fn all_operations<T: Real>([a, b, c]: [T; 3]) -> Vec<T> {
        let table = [a, b, c, a * b];
        let [low, high, beyond] = (c * c).knots(&table);
        vec![
            a + b * c,
            a - b,
            a / c,
            -a,
            (a + 1.0) * 0.3 - 0.7,
            (a * a).root(),
            a.pick(b, b, c),
            a.at_least(b),
            a.at_most(b),
            a.all(0.5),
            low,
            high,
            beyond,
        ]
    }

    impl pulp::WithSimd for Check {
        type Output = ();

        fn with_simd<S: Simd>(self, simd: S) {
            let n = Wide::<S>::LANES;
            for at in (0..self.0[0].len() - n).step_by(n) {
                let wide = [0, 1, 2].map(|i| Wide::of(simd, |lane| self.0[i][at + lane]));
                let wide = all_operations(wide);
                for lane in 0..n {
                    let alone = all_operations([0, 1, 2].map(|i| self.0[i][at + lane]));
                    for (which, (wide, alone)) in wide.iter().zip(alone).enumerate() {
                        let found = wide.lane(lane);
                        assert_eq!(found.to_bits(), alone.to_bits(), "{which}: {found} {alone}");
                    }
                    assert!(wide[0].any(|x| x == wide[0].lane(lane)), "lane {lane}");
                }
            }
        }
    }

    #[test]
    fn a_lane_computes_as_one_number_does_bit_for_bit() {
        let mut noise = crate::sim::noise::Noise::new(9, 0, "numbers");
        let numbers = [(); 3].map(|()| (0..4000).map(|_| noise.normal()).collect());
        Arch::new().dispatch(Check(numbers));
    }
}
