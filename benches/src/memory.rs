//! The system's allocator, with a count of the bytes that are in use on all threads, and of the most that were.
//!
//! A benchmark that tells of memory makes it its own: `#[global_allocator] static ALLOCATOR: Counting = Counting;`.
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicIsize, Ordering};

/// The system's allocator, which counts.
pub struct Counting;

static IN_USE: AtomicIsize = AtomicIsize::new(0);
static MOST: AtomicIsize = AtomicIsize::new(0);

// SAFETY: every call goes to the system's allocator with the same arguments; the counts are beside it.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let size = layout.size() as isize;
        MOST.fetch_max(IN_USE.fetch_add(size, Ordering::Relaxed) + size, Ordering::Relaxed);
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        IN_USE.fetch_sub(layout.size() as isize, Ordering::Relaxed);
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(at, layout) }
    }
}

/// Bytes in use.
pub fn in_use() -> isize {
    IN_USE.load(Ordering::Relaxed)
}

/// The most bytes in use since the last call of `forget_most`.
pub fn most() -> isize {
    MOST.load(Ordering::Relaxed)
}

/// Begins to look for the most anew; the bytes in use now.
pub fn forget_most() -> isize {
    let now = in_use();
    MOST.store(now, Ordering::Relaxed);
    now
}
