//! Exact sums and products of f64: numbers as unevaluated sums of floating-point terms.
//!
//! An expansion is a sum of terms, the smallest first, none of them zero. Terms neither overlap nor
//! are adjacent: between the last bit of a term and the first bit of the term before it is a zero
//! bit. The terms before the last one together are therefore smaller than half of the last one,
//! which has the sign of the sum. Sums and products of expansions are exact as long as nothing
//! overflows or underflows, which the [range](super) of coordinates guarantees.
//!
//! Source: Shewchuk 1997, 'Adaptive precision floating-point arithmetic and fast robust geometric
//! predicates', theorems 6 (Knuth's sum), 10 (grow-expansion), 18 (Dekker's product); zero terms
//! are eliminated as in section 2.3.

use super::twice::{Twice, two_product};

/// An exact number: the sum of at most `N` terms.
#[derive(Clone, Copy, Debug)]
pub(super) struct Expansion<const N: usize> {
    terms: [f64; N],
    len: usize,
}

impl<const N: usize> Expansion<N> {
    /// Returns zero. A constant would be copied, terms that nobody reads included.
    #[inline(always)]
    pub(super) fn zero() -> Self {
        Self { terms: [0.0; N], len: 0 }
    }

    pub(super) fn widened<const M: usize>(&self) -> Expansion<M> {
        let mut wide = Expansion::zero();
        wide.terms[..self.len].copy_from_slice(self.terms());
        wide.len = self.len;
        wide
    }

    fn terms(&self) -> &[f64] {
        &self.terms[..self.len]
    }

    /// Adds a number. The expansion grows by at most one term.
    ///
    /// # Panics
    /// Panics if there is no room for another term.
    pub(super) fn add(&mut self, number: f64) {
        let mut carry = number;
        let mut kept = 0;
        for i in 0..self.len {
            let Twice(sum, rest) = Twice::sum(carry, self.terms[i]);
            if rest != 0.0 {
                self.terms[kept] = rest;
                kept += 1;
            }
            carry = sum;
        }
        if carry != 0.0 {
            self.terms[kept] = carry;
            kept += 1;
        }
        self.len = kept;
    }

    /// Adds the product of an expansion and a number: at most two terms for each term of the
    /// expansion.
    pub(super) fn add_scaled<const M: usize>(&mut self, factor: &Expansion<M>, number: f64) {
        for &term in factor.terms() {
            let (product, rest) = two_product(term, number);
            self.add(rest);
            self.add(product);
        }
    }

    /// Adds the product of two expansions and a `sign`, 1 or −1: at most two terms for each pair of
    /// their terms.
    pub(super) fn add_product<const A: usize, const B: usize>(
        &mut self,
        a: &Expansion<A>,
        b: &Expansion<B>,
        sign: f64,
    ) {
        for &term in b.terms() {
            self.add_scaled(a, sign * term);
        }
    }

    /// Returns the value times a power of two, which must neither overflow nor underflow.
    pub(super) fn scaled(mut self, power: f64) -> Self {
        self.terms[..self.len].iter_mut().for_each(|term| *term *= power);
        self
    }

    /// Returns the sign of the exact value: −1, 0 or 1.
    pub(super) fn sign(&self) -> i32 {
        match self.terms().last() {
            None => 0,
            Some(last) if *last < 0.0 => -1,
            Some(_) => 1,
        }
    }

    /// Returns the value in f64, with a relative error below 2⁻⁴⁰ and with the sign of the exact
    /// value.
    pub(super) fn approximate(&self) -> f64 {
        self.terms().iter().sum()
    }
}

impl Expansion<2> {
    /// Returns a sum and its rounding error, which is never adjacent to it.
    pub(super) fn of(Twice(sum, rest): Twice<f64>) -> Self {
        let mut both = Self::zero();
        for term in [rest, sum] {
            if term != 0.0 {
                both.terms[both.len] = term;
                both.len += 1;
            }
        }
        both
    }
}
