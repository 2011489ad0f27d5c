//! Pushing allocates nothing once a stream is made, from the first sample on, nor do refusals that a program in flight may meet.
//!
//! A file of its own, because the allocator counts for the whole program.

mod common;
#[path = "../../../../tests/counting/mod.rs"]
mod counting;

use common::{HISTORY, NOTHING, c_path, folder, hybrid, model, simulated, state};
use counting::REQUESTS;
use phyture::Result;
use phyture_c::*;
use std::ptr::{null, null_mut};
use std::sync::atomic::Ordering;

#[test]
fn pushing_allocates_nothing() -> Result<()> {
    let place = folder()?;
    let (network, toml) = (place.path().join("network.safetensors"), place.path().join("model.toml"));
    let set = simulated()?;
    hybrid(&set)?.write(&network)?;
    model(&set)?.write(&toml)?;
    let flight = &set.flights[0];
    // Longer than what a delay keeps before it lets go of the past.
    let states: Vec<[f64; 16]> = (0..flight.len().min(1200)).map(|sample| state(flight, sample)).collect();
    assert!(states.len() > 600, "{}", states.len());
    for is_hybrid in [true, false] {
        let (mut loaded, mut stream) = (null_mut(), null_mut());
        let path = c_path(if is_hybrid { &network } else { &toml });
        // SAFETY: texts that end with a zero, places that can be written, handles that only this thread has and frees once.
        unsafe {
            let read = if is_hybrid { phyture_hybrid_read } else { phyture_model_read };
            assert_eq!(read(path.as_ptr(), &mut loaded, null_mut(), 0), PhytureStatus::Ok);
            assert_eq!(phyture_stream_new(loaded, flight.step_s, &mut stream, null_mut(), 0), PhytureStatus::Ok);
            let mut out = NOTHING;
            let mut complete = 0;
            let before = REQUESTS.load(Ordering::Relaxed);
            for _ in 0..2 {
                for state in &states {
                    let status = phyture_stream_push(stream, state.as_ptr(), 16, null(), 0, &mut out);
                    assert!(status == PhytureStatus::Ok);
                    complete += usize::from(out.complete);
                    let bad = [f64::NAN; 16];
                    let status = phyture_stream_push(stream, bad.as_ptr(), 16, null(), 0, &mut out);
                    assert!(status == PhytureStatus::NotFinite);
                }
                assert!(phyture_stream_reset(stream, 0.0) == PhytureStatus::Ok);
            }
            let requests = REQUESTS.load(Ordering::Relaxed) - before;
            let missing = if is_hybrid { HISTORY - 1 } else { 0 };
            assert_eq!((requests, complete), (0, 2 * (states.len() - missing)));
            phyture_stream_free(stream);
            phyture_model_free(loaded);
        }
    }
    Ok(())
}
