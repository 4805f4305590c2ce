//! The numbers that rays and triangles may have: f32 and f64.

use crate::each::Each;
use glam::{DVec3, Vec3};

/// A number of coordinates and distances.
pub(crate) trait Number: Copy + PartialEq + PartialOrd {
    /// Rounds to the nearest number, ties to even.
    fn rounded(x: f64) -> Self;

    /// Rounds a number that was rounded to f64 before, unless the bits that are lost could decide.
    fn rounded_again(x: f64) -> Option<Self>;

    fn double(self) -> f64;

    fn next_up(self) -> Self;

    fn next_down(self) -> Self;

    /// Returns whether the last bit of the fraction is set.
    fn is_odd(self) -> bool;

    fn is_finite(self) -> bool;
}

macro_rules! number {
    ($name:ident $point:ident) => {
        impl Number for $name {
            #[inline(always)]
            fn rounded(x: f64) -> Self {
                x as Self
            }

            fn rounded_again(x: f64) -> Option<Self> {
                let [below, rounded, above] = [x.next_down(), x, x.next_up()].each(|x| x as Self);
                (f64::from(rounded) == x || below == above).then_some(rounded)
            }

            #[inline(always)]
            fn double(self) -> f64 {
                self.into()
            }

            fn next_up(self) -> Self {
                self.next_up()
            }

            fn next_down(self) -> Self {
                self.next_down()
            }

            fn is_odd(self) -> bool {
                self.to_bits() & 1 == 1
            }

            #[inline(always)]
            fn is_finite(self) -> bool {
                self.is_finite()
            }
        }

        impl Point for $point {
            type Number = $name;

            #[inline(always)]
            fn double(self) -> [f64; 3] {
                self.to_array().each(f64::from)
            }
        }
    };
}
number!(f32 Vec3);
number!(f64 DVec3);

/// A point or a direction of one of the numbers.
pub(crate) trait Point: Copy {
    type Number: Number;

    fn double(self) -> [f64; 3];
}
