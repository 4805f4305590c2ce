//! The stack of a traversal. It allocates memory only for very deep trees.

use alloc::vec::Vec;

/// A stack with room for `N` entries inline. The lower entries of a deeper stack are on the heap.
pub(crate) struct Stack<T, const N: usize> {
    inline: [T; N],
    len: usize,
    spilled: Vec<T>,
}

impl<T: Copy, const N: usize> Stack<T, N> {
    /// Makes an empty stack. `filler` may be any value; a value whose bits are all zero is fastest.
    #[inline(always)]
    pub(crate) fn new(filler: T) -> Self {
        Self { inline: [filler; N], len: 0, spilled: Vec::new() }
    }

    /// Returns the space for `K` entries above the topmost entry. The caller writes entries there,
    /// and [`grow`](Self::grow) adds them to the stack.
    #[inline(always)]
    pub(crate) fn room<const K: usize>(&mut self) -> &mut [T; K] {
        const { assert!(K <= N) };
        if self.len > N - K {
            spill(&self.inline[..self.len], &mut self.spilled);
            self.len = 0;
        }
        // The check above and `K <= N` leave room for `K` entries.
        match self.inline[self.len..].first_chunk_mut() {
            Some(room) => room,
            None => unreachable!("at most N - K entries are inline"),
        }
    }

    /// Adds the first `entries` of the [`room`](Self::room) to the stack.
    #[inline(always)]
    pub(crate) fn grow(&mut self, entries: usize) {
        self.len += entries;
    }

    /// Pushes `value` if `condition` holds, without a branch on it.
    #[inline(always)]
    pub(crate) fn push_if(&mut self, condition: bool, value: T) {
        *self.room::<1>() = [value];
        self.grow(usize::from(condition));
    }

    #[inline(always)]
    pub(crate) fn pop(&mut self) -> Option<T> {
        if self.len == 0 {
            return self.spilled.pop();
        }
        self.len -= 1;
        self.inline.get(self.len).copied()
    }
}

/// Moves all inline entries to the heap. A method would take `&mut self`, and the stack's length
/// could not stay in a register.
#[cold]
#[inline(never)]
fn spill<T: Copy>(inline: &[T], spilled: &mut Vec<T>) {
    spilled.extend_from_slice(inline);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_in_is_the_first_out_on_both_sides_of_the_spill() {
        let mut stack = Stack::<u32, 4>::new(0);
        for round in 0..3 {
            (0..20).for_each(|i| stack.push_if(i % 2 == 0, round + i / 2));
            *stack.room() = [round + 10, round + 11, 99];
            stack.grow(2);
            let popped: Vec<u32> = core::iter::from_fn(|| stack.pop()).collect();
            assert_eq!(popped, Vec::from_iter((0..12).rev().map(|i| round + i)));
        }
    }
}
