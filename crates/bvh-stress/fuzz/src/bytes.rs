//! Reads numbers from bytes; zeros follow the last byte.

use glam::Vec3;

/// Bytes that have not been read yet.
pub struct Bytes<'a>(pub &'a [u8]);

impl Bytes<'_> {
    /// Returns the next `N` bytes.
    pub fn take<const N: usize>(&mut self) -> [u8; N] {
        let mut taken = [0; N];
        let (head, rest) = self.0.split_at(self.0.len().min(N));
        taken[..head.len()].copy_from_slice(head);
        self.0 = rest;
        taken
    }

    /// Returns the next byte.
    pub fn byte(&mut self) -> u8 {
        let [byte] = self.take();
        byte
    }

    /// Returns the next number: any bits, or one of a few numbers, which coincide often.
    pub fn number(&mut self, few: bool) -> f32 {
        if few { f32::from(self.byte() as i8) / 16.0 } else { f32::from_le_bytes(self.take()) }
    }

    /// Returns the next point.
    pub fn point(&mut self, few: bool) -> Vec3 {
        Vec3::from([(); 3].map(|()| self.number(few)))
    }
}
