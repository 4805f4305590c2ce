//! The allocator of the program: the system's, which asks Linux for huge pages for large blocks.
//!
//! A search visits the nodes of a tree in random order, and a tree of 5 million triangles takes
//! half a gigabyte. Huge pages save a fifth of the processor's time of such a bake, and most of the
//! time between Ctrl-C and its end, which page faults and the release of pages of 4 KiB take.

use std::alloc::{GlobalAlloc, Layout, System};

/// The system's allocator with huge pages for large blocks.
pub struct HugePages;

/// The size from which a block contains at least one complete huge page wherever it begins.
#[cfg(target_os = "linux")]
const LARGE: usize = 4 << 20;

// SAFETY: all methods return what the system's allocator returns for the same arguments; the advice
// changes no contents and no address.
unsafe impl GlobalAlloc for HugePages {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's layout has a size, which is all that the system's allocator needs.
        let block = unsafe { System.alloc(layout) };
        advise(block, layout.size());
        block
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as in `alloc`.
        let block = unsafe { System.alloc_zeroed(layout) };
        advise(block, layout.size());
        block
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: the block is from the system's allocator with this layout.
        unsafe { System.dealloc(block, layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: the block is from the system's allocator with this layout, and the caller's size
        // is valid.
        let block = unsafe { System.realloc(block, layout, size) };
        advise(block, size);
        block
    }
}

/// The largest page of any Linux, to which the start of advice is aligned.
#[cfg(target_os = "linux")]
const LARGEST_PAGE: usize = 64 << 10;

/// Asks for huge pages for the complete pages of a large block.
#[cfg(target_os = "linux")]
fn advise(block: *mut u8, size: usize) {
    if size < LARGE || block.is_null() {
        return;
    }
    let before = block.align_offset(LARGEST_PAGE);
    let pages = block.wrapping_add(before);
    // SAFETY: the pages are in the block, and this advice changes no contents. Systems without huge
    // pages reject it, and the block has small ones.
    unsafe { libc::madvise(pages.cast(), size - before, libc::MADV_HUGEPAGE) };
}

#[cfg(not(target_os = "linux"))]
fn advise(_: *mut u8, _: usize) {}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::LARGE;

    /// Returns the flags of the mapping that contains an address. Mappings come in order.
    fn flags(address: usize) -> String {
        let maps = std::fs::read_to_string("/proc/self/smaps").unwrap();
        let mut end = 0;
        for line in maps.lines() {
            let range = line.split(' ').next().and_then(|range| range.split_once('-'));
            end = range.and_then(|(_, end)| usize::from_str_radix(end, 16).ok()).unwrap_or(end);
            if let Some(flags) = line.strip_prefix("VmFlags:").filter(|_| end > address) {
                return flags.to_owned();
            }
        }
        panic!("no mapping contains {address:x}")
    }

    #[test]
    fn large_blocks_ask_for_huge_pages_wherever_they_come_from() {
        let reserved: Vec<u8> = Vec::with_capacity(20 * LARGE);
        let zeros = vec![0u8; 20 * LARGE];
        let mut grown = vec![1u8; LARGE / 2];
        grown.reserve_exact(20 * LARGE);
        for block in [reserved, zeros, grown] {
            let flags = flags(block.as_ptr() as usize + block.capacity() / 2);
            assert!(flags.split_whitespace().any(|flag| flag == "hg"), "{flags}");
        }
    }
}
