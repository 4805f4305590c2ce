//! Lanes as a type: numbers side by side in one register. Kernels are written once over [`Lanes`];
//! instruction sets are its implementations.

use crate::exact::Numbers;
use core::ops::{Add, BitAnd, BitOr, BitXor, Div, Mul, Sub};

/// A value that begins with a line of the cache, and is aligned for any register.
#[repr(align(64))]
pub(crate) struct Aligned<T>(pub(crate) T);

/// Functions that are one expression each.
#[allow(unused_macros)] // Some machines have no vector kernel.
macro_rules! functions {
    ($(fn $name:ident($($parameters:tt)*) -> $result:ty = $value:expr;)*) => {$(
        #[inline(always)]
        fn $name($($parameters)*) -> $result {
            #[allow(unused_unsafe)]
            unsafe {
                $value
            }
        }
    )*};
}
#[allow(unused_imports)] // As above.
pub(crate) use functions;

/// `N` numbers of f32, or of u32 where an operation says so.
///
/// A value exists only where the processor has the instructions: what makes one out of nothing is
/// unsafe, what takes one is not. Every function is inlined into one that is compiled with these
/// instructions, or it is very slow.
pub(crate) trait Lanes:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + BitAnd<Output = Self>
    + BitOr<Output = Self>
    + BitXor<Output = Self>
{
    const N: usize;
    type Mask: Mask;
    type Double: DoubleLanes;

    unsafe fn splat(x: f32) -> Self;

    /// `N` numbers from memory.
    ///
    /// # Safety
    /// The processor has the instructions; `from` is aligned to `N` numbers.
    unsafe fn load(from: *const f32) -> Self;

    /// Writes `N` numbers to any place.
    ///
    /// # Safety
    /// There is room.
    unsafe fn store(self, to: *mut f32);

    /// The lesser, or the greater; of two zeros, or a NaN and a number, `other`.
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;

    /// `self · factor + term`, rounded once, or twice where no instruction fuses them. The error
    /// bounds of tests that use it cover both.
    fn mul_add(self, factor: Self, term: Self) -> Self;

    /// `self · factor − term`, as [`mul_add`](Self::mul_add).
    #[inline(always)]
    fn mul_sub(self, factor: Self, term: Self) -> Self {
        self * factor - term
    }

    /// Where `self` is less than, at most, or equal to `other`; not where either is NaN.
    fn lt(self, other: Self) -> Self::Mask;
    fn le(self, other: Self) -> Self::Mask;
    fn eq(self, other: Self) -> Self::Mask;

    /// Where `self < other` as u32.
    fn below(self, other: Self) -> Self::Mask;

    /// Returns a bit per lane whose sign is set, lane 0 lowest.
    fn signs(self) -> u32;

    /// Returns the greatest number. None may be NaN.
    fn greatest(self) -> f32;

    /// `yes` where the mask is set, else `no`.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;

    fn double(self) -> Self::Double;

    /// The numbers of f64 rounded to f32.
    fn single(double: Self::Double) -> Self;

    /// The same set of lanes.
    fn narrow(mask: <Self::Double as DoubleLanes>::Mask) -> Self::Mask;

    /// Four lanes from each of `N / 4` places.
    ///
    /// # Safety
    /// The processor has the instructions; the first `N / 4` places are aligned to four numbers.
    unsafe fn load_quarters(from: [*const f32; 4]) -> Self;

    /// Writes four lanes to each of `N / 4` places.
    ///
    /// # Safety
    /// The first `N / 4` places are aligned to four numbers.
    unsafe fn store_quarters(self, to: [*mut f32; 4]);

    /// Transposes four rows of four lanes in each quarter.
    fn transpose_quarters(rows: [Self; 4]) -> [Self; 4];

    /// One of its four lanes in every lane of a quarter.
    fn spread<const LANE: usize>(self) -> Self;

    /// A number in all lanes of a register like this one.
    #[inline(always)]
    fn filled(self, x: f32) -> Self {
        // SAFETY: a value exists.
        unsafe { Self::splat(x) }
    }

    /// The same bits in all lanes of a register like this one.
    #[inline(always)]
    fn filled_with_bits(self, bits: u32) -> Self {
        self.filled(f32::from_bits(bits))
    }

    /// The set of these bits.
    #[inline(always)]
    fn mask(self, bits: u32) -> Self::Mask {
        // SAFETY: a value exists.
        unsafe { Self::Mask::from_bits(bits) }
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self & self.filled_with_bits(u32::MAX >> 1)
    }
}

/// A set of lanes.
pub(crate) trait Mask: Copy + BitAnd<Output = Self> + BitOr<Output = Self> {
    /// Returns a bit per lane, lane 0 lowest.
    fn bits(self) -> u32;

    /// The set of these bits, of which those beyond the lanes are ignored.
    unsafe fn from_bits(bits: u32) -> Self;
}

/// One f64 per lane.
pub(crate) trait DoubleLanes:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + BitAnd<Output = Self>
{
    type Mask: Copy + BitAnd<Output = Self::Mask> + BitOr<Output = Self::Mask>;

    unsafe fn splat(x: f64) -> Self;

    /// As many numbers from any place as there are lanes.
    unsafe fn load(from: *const f64) -> Self;

    /// Two numbers from each of at least as many places as there are lanes: the first of every
    /// place, and the second.
    ///
    /// # Safety
    /// The processor has the instructions; there are two numbers at a place per lane.
    #[inline(always)]
    unsafe fn load_twos(from: &[*const f64]) -> [Self; 2] {
        let mut rows = [[0.0; 16]; 2];
        for (lane, from) in from.iter().enumerate().take(size_of::<Self>() / size_of::<f64>()) {
            // SAFETY: there are two numbers.
            (rows[0][lane], rows[1][lane]) = unsafe { (**from, *from.add(1)) };
        }
        // SAFETY: there are as many numbers as lanes.
        unsafe { [Self::load(rows[0].as_ptr()), Self::load(rows[1].as_ptr())] }
    }

    /// Writes the numbers to any place.
    ///
    /// # Safety
    /// There is room.
    unsafe fn store(self, to: *mut f64);

    /// Returns `yes` where the mask is set, otherwise `no`.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;

    /// A number in all lanes of a register like this one.
    #[inline(always)]
    fn filled(self, x: f64) -> Self {
        // SAFETY: a value exists.
        unsafe { Self::splat(x) }
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self & self.filled(f64::from_bits(u64::MAX >> 1))
    }

    /// The powers of two in normal numbers above 0.
    #[inline(always)]
    fn power_of_two(self) -> Self {
        // Its bits are those of the exponent.
        self & self.filled(f64::INFINITY)
    }

    /// One over each number, off by at most 1.2 units of 2⁻⁵³ of it.
    #[inline(always)]
    fn inverse(self) -> Self {
        self.filled(1.0) / self
    }

    /// As those of [`Lanes`].
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    fn lt(self, other: Self) -> Self::Mask;
    fn le(self, other: Self) -> Self::Mask;
    fn eq(self, other: Self) -> Self::Mask;

    /// `self · factor + term`, as [`mul_sub`](Self::mul_sub).
    fn mul_add(self, factor: Self, term: Self) -> Self;

    /// `self · factor − term`, rounded once or twice. The error bounds of tests that use it cover
    /// both.
    fn mul_sub(self, factor: Self, term: Self) -> Self;

    /// The rounded products and their rounding errors. Where [`mul_sub`](Self::mul_sub) rounds twice,
    /// they are found otherwise.
    #[inline(always)]
    fn two_product(self, other: Self) -> (Self, Self) {
        let product = self * other;
        (product, self.mul_sub(other, product))
    }
}

impl<D: DoubleLanes> Numbers for D {
    #[inline(always)]
    fn two_product(self, other: Self) -> (Self, Self) {
        DoubleLanes::two_product(self, other)
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        DoubleLanes::mul_add(self, factor, term)
    }

    #[inline(always)]
    fn inverse(self) -> Self {
        DoubleLanes::inverse(self)
    }

    #[inline(always)]
    fn abs(self) -> Self {
        DoubleLanes::abs(self)
    }

    #[inline(always)]
    fn filled(self, x: f64) -> Self {
        DoubleLanes::filled(self, x)
    }
}
