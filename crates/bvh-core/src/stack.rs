//! The stack of a traversal: as deep as it must be, and without an allocation for ordinary trees.

use alloc::vec::Vec;

/// A stack whose first `N` entries need no allocation. Chains of any depth fit.
pub(crate) struct Stack<T, const N: usize> {
    inline: [T; N],
    len: usize,
    /// Non-empty only while `inline` is full.
    spilled: Vec<T>,
}

impl<T: Copy, const N: usize> Stack<T, N> {
    /// The empty stack; `filler` is any value.
    #[inline(always)]
    pub(crate) fn new(filler: T) -> Self {
        Self { inline: [filler; N], len: 0, spilled: Vec::new() }
    }

    /// Pushes `value` if `condition` holds, without a branch on it.
    #[inline(always)]
    pub(crate) fn push_if(&mut self, condition: bool, value: T) {
        match self.inline.get_mut(self.len) {
            Some(slot) => {
                *slot = value;
                self.len += usize::from(condition);
            }
            None => self.spill(condition, value),
        }
    }

    #[inline(always)]
    pub(crate) fn pop(&mut self) -> Option<T> {
        if self.len == N
            && let Some(value) = self.spilled.pop()
        {
            return Some(value);
        }
        self.len = self.len.checked_sub(1)?;
        self.inline.get(self.len).copied()
    }

    #[cold]
    #[inline(never)]
    fn spill(&mut self, condition: bool, value: T) {
        self.spilled.extend(condition.then_some(value));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_in_is_the_first_out_on_both_sides_of_the_spill() {
        let mut stack = Stack::<u32, 4>::new(0);
        for round in 0..3 {
            (0..20).for_each(|i| stack.push_if(i % 2 == 0, round + i / 2));
            assert_eq!(
                (0..10).map_while(|_| stack.pop()).collect::<Vec<_>>(),
                Vec::from_iter((0..10).rev().map(|i| round + i))
            );
            assert_eq!(stack.pop(), None);
        }
    }
}
