//! Allocator that counts the memory in use.
#![expect(unsafe_code, reason = "an allocator is unsafe; this one hands on to the system's")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

static NOW: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

/// Size in bytes above which an allocation fails, so that a decompression bomb does not exhaust the
/// machine's memory.
const REFUSED: usize = 8 << 30;

struct Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn took(bytes: usize) {
    let now = NOW.fetch_add(bytes, Ordering::Relaxed) + bytes;
    PEAK.fetch_max(now, Ordering::Relaxed);
}

// SAFETY: every call is forwarded to the system's allocator unchanged, or fails, which is allowed.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if NOW.load(Ordering::Relaxed) + layout.size() > REFUSED {
            return std::ptr::null_mut();
        }
        took(layout.size());
        // SAFETY: the caller fulfills the contract of `GlobalAlloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: as above.
        unsafe { System.dealloc(memory, layout) }
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        if NOW.load(Ordering::Relaxed) + size > REFUSED {
            return std::ptr::null_mut();
        }
        // The system moves a large block by remapping its pages instead of copying it, so that the
        // old and the new block never exist at the same time.
        NOW.fetch_sub(layout.size(), Ordering::Relaxed);
        took(size);
        // SAFETY: as above.
        unsafe { System.realloc(memory, layout, size) }
    }
}

/// Resets the peak, and returns the memory in use in bytes.
pub(crate) fn begin() -> usize {
    let now = NOW.load(Ordering::Relaxed);
    PEAK.store(now, Ordering::Relaxed);
    now
}

/// Returns the peak memory in use since [`begin`], in excess of `before`, in bytes.
pub(crate) fn peak_since(before: usize) -> usize {
    PEAK.load(Ordering::Relaxed).saturating_sub(before)
}
