//! An allocator that counts what the whole program asks for. A test that includes it is a program of its own.
#![allow(dead_code, reason = "each test program uses its part")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Requests so far.
pub static REQUESTS: AtomicUsize = AtomicUsize::new(0);

/// Bytes that are asked for and not given back.
static HELD: AtomicUsize = AtomicUsize::new(0);

/// Most of them at a time.
static MOST_HELD: AtomicUsize = AtomicUsize::new(0);

/// The most bytes that the program holds, while it works, beyond those it held before.
pub fn most_held(work: impl FnOnce()) -> usize {
    let before = HELD.load(Ordering::Relaxed);
    MOST_HELD.store(before, Ordering::Relaxed);
    work();
    MOST_HELD.load(Ordering::Relaxed).saturating_sub(before)
}

struct Counting;

// SAFETY: every call is passed on to the system's allocator unchanged; counting touches no memory of theirs.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        REQUESTS.fetch_add(1, Ordering::Relaxed);
        let held = HELD.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        MOST_HELD.fetch_max(held, Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `alloc`, which is the system allocator's.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the pointer came from `alloc` above, so from the system's allocator, with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;
