//! The steady state allocates nothing: a counting allocator sees no request in steps 3 to 10, on one thread and on two, neither in
//! training nor in the prediction of one window, whose large operations two threads share.
//!
//! A file of its own, because the allocator counts for the whole program.

use phyture::Result;
use phyture::nn::{Network, OutputScale, PhyTureConfig};
use phyture::tape::{DropoutKey, Session, Threads};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

static REQUESTS: AtomicUsize = AtomicUsize::new(0);

struct Counting;

// SAFETY: every call is passed on to the system's allocator unchanged; counting touches no memory of theirs.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        REQUESTS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `alloc`, which is the system allocator's.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the pointer came from `alloc` above, so from the system's allocator, with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn the_steady_state_allocates_nothing() -> Result<()> {
    for (history, samples, trains) in [(32, 9, true), (240, 1, false)] {
        let config = PhyTureConfig { history, d_model: 16, moving_average: 5, ..PhyTureConfig::default() };
        let network = Network::<f32>::new(&config, &OutputScale::unit(6), false)?;
        let parameters = network.initial(1);
        let fill = |sample: usize, inputs: &mut [&mut [f32]]| inputs.iter_mut().for_each(|input| input.fill(0.1 * sample as f32));
        for threads in [1, 2] {
            let (graph, outputs, threads) = (network.graph(), [network.output()], Threads(threads));
            let mut session = if trains {
                Session::train(graph, network.loss(), &outputs, threads)?
            } else {
                Session::infer(graph, &outputs, threads)?
            };
            for step in 0..10 {
                let before = REQUESTS.load(Ordering::Relaxed);
                session.step(&parameters, samples, trains.then_some(DropoutKey { seed: 1, step }), &fill)?;
                let requests = REQUESTS.load(Ordering::Relaxed) - before;
                // Entering a thread pool from outside may grow one of its queues once in a while; a step makes no other request.
                let allowed = usize::from(threads.0 > 1);
                assert!(step < 2 || requests <= allowed, "step {step}, {samples} samples, {threads:?}: {requests} allocations");
            }
        }
    }
    Ok(())
}
