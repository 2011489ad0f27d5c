//! The functions of the header, called as C calls them: they say what the library says, and refuse what cannot be.

mod common;

use common::{HISTORY, NOTHING, c_path, folder, hybrid, model, simulated, state, text};
use phyture::flight::{PerChannel, Span};
use phyture::tape::Threads;
use phyture::{Error, Result};
use phyture_c::*;
use std::ffi::c_char;
use std::path::Path;
use std::ptr::{null, null_mut};

type Read = unsafe extern "C" fn(*const c_char, *mut *mut PhytureModel, *mut c_char, usize) -> PhytureStatus;

/// Reads a file; the handle, or null with status and sentence.
fn read(with: Read, path: &Path) -> (*mut PhytureModel, PhytureStatus, String) {
    let (mut handle, mut message) = (null_mut(), [0; 256]);
    // SAFETY: a text that ends with a zero, and places that can be written.
    let status = unsafe { with(c_path(path).as_ptr(), &mut handle, message.as_mut_ptr(), message.len()) };
    // SAFETY: the message always ends with a zero.
    (handle, status, unsafe { text(message.as_ptr()) })
}

/// Makes a stream; the handle, or null with status and sentence.
fn stream(of: *const PhytureModel, step_s: f64) -> (*mut PhytureStream, PhytureStatus, String) {
    let (mut handle, mut message) = (null_mut(), [0; 256]);
    // SAFETY: a model of `read` or null, and places that can be written.
    let status = unsafe { phyture_stream_new(of, step_s, &mut handle, message.as_mut_ptr(), message.len()) };
    // SAFETY: the message always ends with a zero.
    (handle, status, unsafe { text(message.as_ptr()) })
}

fn push(stream: *mut PhytureStream, state: &[f64], own: &[f64]) -> (PhytureStatus, PhyturePrediction) {
    let mut out = NOTHING;
    // SAFETY: a stream of `stream` that this thread has for itself, slices with their lengths, and a place that can be written.
    let status = unsafe { phyture_stream_push(stream, state.as_ptr(), state.len(), own.as_ptr(), own.len(), &mut out) };
    (status, out)
}

fn said(stream: *const PhytureStream) -> String {
    // SAFETY: a stream of `stream` that is not freed yet.
    unsafe { text(phyture_stream_message(stream)) }
}

/// `[hybrid, model]` as files.
fn files(place: &Path) -> Result<[std::path::PathBuf; 2]> {
    let set = simulated()?;
    let files = [place.join("network.safetensors"), place.join("model.toml")];
    hybrid(&set)?.write(&files[0])?;
    model(&set)?.write(&files[1])?;
    Ok(files)
}

#[test]
fn a_hybrid_says_what_the_library_says_part_by_part_and_again_after_a_reset() -> Result<()> {
    let place = folder()?;
    let [file, _] = files(place.path())?;
    let (set, hybrid) = (simulated()?, phyture::hybrid::Hybrid::read(&file)?);
    let flights = std::slice::from_ref(&set.flights[0]);
    let span = [Span { flight: 0, start: 0, end: 200 }];
    let stages = hybrid.stages(flights, &phyture::flight::windows::windows(&span, HISTORY, 1), Threads(1))?;
    let (handle, status, message) = read(phyture_hybrid_read, &file);
    assert_eq!((status, message.as_str()), (PhytureStatus::Ok, ""));
    let (stream, status, message) = stream(handle, 0.0);
    assert_eq!((status, message.as_str()), (PhytureStatus::Ok, ""));
    // SAFETY: both handles are this test's own; the model is freed once.
    unsafe {
        assert_eq!(phyture_model_step_s(handle), 0.01);
        assert_eq!((phyture_stream_history(stream), phyture_stream_own_count(stream)), (HISTORY, 0));
        // The stream goes on without it.
        phyture_model_free(handle);
    }
    let physics = hybrid.description().model.predict(&flights[0])?;
    for start_s in [0.0, flights[0].start_s] {
        // SAFETY: a stream that only this thread has.
        assert_eq!(unsafe { phyture_stream_reset(stream, start_s) }, PhytureStatus::Ok);
        for sample in 0..200 {
            let (status, found) = push(stream, &state(&flights[0], sample), &[]);
            assert_eq!(status, PhytureStatus::Ok, "{}", said(stream));
            assert_eq!(found.physics, PerChannel::from_fn(|channel| physics[channel][sample]).into_array());
            assert_eq!(found.complete, sample + 1 >= HISTORY);
            let own = state(&flights[0], sample);
            let half_width = hybrid.description().intervals.as_ref().expect("it has intervals").half_width(&own);
            assert!(sample + 1 < HISTORY || found.half_width == half_width.into_array());
            assert_ne!(found.place, PhyturePlace::Unknown);
            let Some(window) = (sample + 1).checked_sub(HISTORY) else {
                let not_yet = found.acceleration.iter().chain(&found.network).chain(&found.half_width);
                assert!(not_yet.copied().all(f64::is_nan));
                continue;
            };
            assert_eq!(found.acceleration, stages.hybrid[window].into_array());
            let with_linear = stages.with_linear.as_ref().expect("it has a linear history")[window].into_array();
            for (channel, baseline) in with_linear.into_iter().enumerate() {
                assert_eq!(found.physics[channel] + found.linear[channel], baseline);
                assert_eq!(found.acceleration[channel], baseline + found.network[channel]);
            }
        }
    }
    // SAFETY: freed once.
    unsafe { phyture_stream_free(stream) };
    Ok(())
}

#[test]
fn a_state_that_no_training_saw_is_told_by_the_name_of_its_quantity() -> Result<()> {
    let place = folder()?;
    let [file, toml] = files(place.path())?;
    let (handle, ..) = read(phyture_hybrid_read, &file);
    let (stream_, status, message) = stream(handle, 0.0);
    assert_eq!(status, PhytureStatus::Ok, "{message}");
    let mut fast = state(&simulated()?.flights[0], 0);
    fast[PhytureState::Vx as usize] = 80.0;
    let (status, found) = push(stream_, &fast, &[]);
    assert_eq!((status, found.place), (PhytureStatus::Ok, PhyturePlace::Beyond));
    let (mut low, mut high) = (f64::NAN, f64::NAN);
    // SAFETY: a stream of this test's own, places that can be written, and null where null is looked for.
    unsafe {
        let names: Vec<String> =
            (0..phyture_stream_envelope_count(stream_)).map(|index| text(phyture_stream_envelope_name(stream_, index))).collect();
        assert_eq!(names[found.beyond], "vx");
        assert_eq!(phyture_stream_envelope_range(stream_, found.beyond, &mut low, &mut high), PhytureStatus::Ok);
        assert!(low < high && high < 80.0, "{low} {high}");
        assert_eq!(phyture_stream_envelope_range(stream_, names.len(), &mut low, &mut high), PhytureStatus::Length);
        assert_eq!(phyture_stream_envelope_range(stream_, 0, null_mut(), &mut high), PhytureStatus::Null);
        assert!(phyture_stream_envelope_name(stream_, names.len()).is_null() && phyture_stream_envelope_count(null()) == 0);
        phyture_model_free(handle);
        phyture_stream_free(stream_);
    }
    // A model file says nothing of what it was calibrated on.
    let (handle, ..) = read(phyture_model_read, &toml);
    let (stream_, ..) = stream(handle, 0.01);
    let (status, found) = push(stream_, &fast, &[]);
    assert_eq!((status, found.place), (PhytureStatus::Ok, PhyturePlace::Unknown));
    assert!(found.half_width.iter().all(|value| value.is_nan()));
    // SAFETY: handles of this test's own, freed once.
    unsafe {
        assert_eq!(phyture_stream_envelope_count(stream_), 0);
        phyture_model_free(handle);
        phyture_stream_free(stream_);
    }
    Ok(())
}

#[test]
fn a_network_that_looks_now_and_then_is_held_in_between() -> Result<()> {
    const EVERY: usize = 4;
    let place = folder()?;
    let [file, _] = files(place.path())?;
    let (handle, ..) = read(phyture_hybrid_read, &file);
    let ((rare, ..), (often, ..)) = (stream(handle, 0.0), stream(handle, 0.0));
    // SAFETY: streams of this test's own.
    unsafe {
        assert_eq!(phyture_stream_network_every(rare, 0), PhytureStatus::Length);
        assert_eq!(said(rare), "`samples` is 0, expected 1 or more");
        assert_eq!(phyture_stream_network_every(rare, EVERY), PhytureStatus::Ok);
    }
    let flight = &simulated()?.flights[0];
    let mut held = [f64::NAN; 6];
    for sample in 0..3 * HISTORY {
        let state = state(flight, sample);
        let (rare, often) = (push(rare, &state, &[]).1, push(often, &state, &[]).1);
        assert_eq!((rare.physics, rare.linear, rare.complete), (often.physics, often.linear, often.complete));
        if !often.complete {
            continue;
        }
        if (sample + 1 - HISTORY).is_multiple_of(EVERY) {
            held = often.network;
        }
        assert_eq!(rare.network, held);
        for (channel, held) in held.into_iter().enumerate() {
            assert_eq!(rare.acceleration[channel], rare.physics[channel] + rare.linear[channel] + held);
        }
    }
    // SAFETY: handles of this test's own, freed once.
    unsafe {
        phyture_stream_free(rare);
        phyture_stream_free(often);
        phyture_model_free(handle);
    }
    Ok(())
}

#[test]
fn a_model_file_is_physics_alone_at_any_step() -> Result<()> {
    let place = folder()?;
    let [_, file] = files(place.path())?;
    let set = simulated()?;
    let flight = &set.flights[0];
    let predicted = phyture::physics::Model::read(&file)?.predict(flight)?;
    let (handle, status, _) = read(phyture_model_read, &file);
    assert_eq!(status, PhytureStatus::Ok);
    let (stream_, status, _) = stream(handle, flight.step_s);
    assert_eq!(status, PhytureStatus::Ok);
    for sample in 0..flight.len().min(500) {
        let (status, found) = push(stream_, &state(flight, sample), &[]);
        let expected = PerChannel::from_fn(|channel| predicted[channel][sample]).into_array();
        assert_eq!((status, found.complete, found.acceleration, found.physics), (PhytureStatus::Ok, true, expected, expected));
        assert_eq!((found.linear, found.network), ([0.0; 6], [0.0; 6]));
    }
    let (none, status, message) = stream(handle, 0.0);
    assert!(none.is_null() && status == PhytureStatus::Model && message.contains("step"), "{message}");
    // SAFETY: handles of this test's own, freed once.
    unsafe {
        assert_eq!((phyture_model_step_s(handle), phyture_stream_history(stream_)), (0.0, 1));
        phyture_stream_free(stream_);
        phyture_model_free(handle);
    }
    Ok(())
}

#[test]
fn what_a_program_does_wrong_is_refused_with_a_sentence_and_the_sample_is_not_taken() -> Result<()> {
    let place = folder()?;
    let [file, toml] = files(place.path())?;
    let (handle, ..) = read(phyture_hybrid_read, &file);
    let (none, status, message) = stream(handle, 0.02);
    assert!(none.is_null() && status == PhytureStatus::Model, "{message}");
    assert!(message.contains("`step_s` is 0.02 s, expected the 0.01 s the network was trained at"), "{message}");
    let (one, ..) = stream(handle, 0.01);
    let (other, ..) = stream(handle, 0.01);
    let set = simulated()?;
    for sample in 0..2 * HISTORY {
        let good = state(&set.flights[0], sample);
        let mut bad = good;
        bad[5] = f64::NAN;
        assert_eq!(push(one, &bad, &[]), (PhytureStatus::NotFinite, NOTHING));
        assert_eq!(said(one), "`yaw` is NaN, not a finite number; the sample was not taken");
        assert_eq!(push(one, &good[..15], &[]), (PhytureStatus::Length, NOTHING));
        assert_eq!(said(one), "`state` has 15 numbers, expected 16");
        assert_eq!(push(one, &good, &[1.0]).0, PhytureStatus::Length);
        // SAFETY: null where null is looked for, and else as in `push`.
        unsafe {
            assert_eq!(phyture_stream_push(one, null(), 16, null(), 0, &mut { NOTHING }), PhytureStatus::Null);
            assert_eq!(phyture_stream_push(one, good.as_ptr(), 16, null(), 0, null_mut()), PhytureStatus::Null);
            assert_eq!(said(one), "`out` is NULL");
            assert_eq!(phyture_stream_push(null_mut(), good.as_ptr(), 16, null(), 0, &mut { NOTHING }), PhytureStatus::Null);
        }
        let (found, expected) = (push(one, &good, &[]), push(other, &good, &[]));
        // NaN is not equal to itself.
        assert_eq!(format!("{found:?}"), format!("{expected:?}"));
        assert_eq!(said(one), "");
    }
    // SAFETY: null where null is looked for; handles of this test's own, freed once.
    unsafe {
        assert_eq!(phyture_stream_reset(one, f64::INFINITY), PhytureStatus::NotFinite);
        assert_eq!(phyture_stream_reset(null_mut(), 0.0), PhytureStatus::Null);
        assert!(phyture_stream_message(null()).is_null() && phyture_stream_own_name(one, 0).is_null());
        assert_eq!((phyture_stream_history(null()), phyture_stream_own_count(null())), (0, 0));
        assert!(phyture_model_step_s(null()).is_nan());
        phyture_stream_free(one);
        phyture_stream_free(other);
        phyture_stream_free(null_mut());
        phyture_model_free(handle);
        phyture_model_free(null_mut());
        assert_eq!(phyture_stream_new(null(), 0.01, &mut null_mut(), null_mut(), 0), PhytureStatus::Null);
        assert_eq!(phyture_stream_new(null(), 0.01, null_mut(), null_mut(), 0), PhytureStatus::Null);
        assert_eq!(phyture_model_read(null(), &mut null_mut(), null_mut(), 0), PhytureStatus::Null);
        assert_eq!(phyture_model_read(c_path(&toml).as_ptr(), null_mut(), null_mut(), 0), PhytureStatus::Null);
    }
    Ok(())
}

#[test]
fn files_that_are_not_there_cut_or_of_another_kind_are_refused() -> Result<()> {
    let place = folder()?;
    let [file, toml] = files(place.path())?;
    let bytes = std::fs::read(&file).map_err(Error::io(&file))?;
    let cut = place.path().join("cut.safetensors");
    std::fs::write(&cut, &bytes[..bytes.len() / 2]).map_err(Error::io(&cut))?;
    let cases: [(Read, &Path, &str); 5] = [
        (phyture_hybrid_read, &place.path().join("none"), "there is no such file"),
        (phyture_hybrid_read, &toml, "model.toml"),
        (phyture_hybrid_read, &cut, "cut.safetensors"),
        (phyture_model_read, &file, "network.safetensors"),
        (phyture_model_read, place.path(), "folder"),
    ];
    for (with, path, part) in cases {
        let (handle, status, message) = read(with, path);
        assert!(handle.is_null() && status == PhytureStatus::File && message.contains(part), "{status:?} {message}");
    }
    Ok(())
}

#[test]
fn a_model_that_reads_columns_of_the_logs_own_is_given_them_by_name() -> Result<()> {
    let place = folder()?;
    let file = place.path().join("own.toml");
    let text_of = |formula: &str| {
        format!(
            "[model]\nmass_kg = 4.58\ninertia = [0.18, 0.34, 0.28]\nrotor_radius_m = 0.8\n\
             [[effect]]\nkind = \"formula\"\nname = \"own\"\nchannel = \"wx_dot\"\nformula = \"{formula}\"\ncoefficient = 2.0\n"
        )
    };
    let stream_of = |formula: &str| -> Result<*mut PhytureStream> {
        std::fs::write(&file, text_of(formula)).map_err(Error::io(&file))?;
        let (handle, status, message) = read(phyture_model_read, &file);
        assert_eq!(status, PhytureStatus::Ok, "{message}");
        let (made, status, message) = stream(handle, 0.01);
        assert_eq!(status, PhytureStatus::Ok, "{message}");
        // SAFETY: freed once.
        unsafe { phyture_model_free(handle) };
        Ok(made)
    };
    let made = stream_of("rear - front")?;
    // SAFETY: a stream of this test's own.
    let names = unsafe { [0, 1].map(|index| text(phyture_stream_own_name(made, index))) };
    // SAFETY: as above.
    assert_eq!(unsafe { phyture_stream_own_count(made) }, 2);
    let own = names.map(|name| if name == "rear" { 5.0 } else { 2.0 });
    let (status, found) = push(made, &[0.0; 16], &own);
    assert_eq!((status, found.acceleration[3]), (PhytureStatus::Ok, 6.0));
    assert_eq!(push(made, &[0.0; 16], &[1.0, f64::NAN]).0, PhytureStatus::NotFinite);
    assert!(said(made).starts_with("own[1] is NaN"), "{}", said(made));
    // SAFETY: freed once.
    unsafe { phyture_stream_free(made) };
    // Physics that is no number is told, and what comes after it is predicted again.
    let made = stream_of("log(front)")?;
    assert_eq!(push(made, &[0.0; 16], &[-1.0]), (PhytureStatus::Prediction, NOTHING));
    assert!(said(made).contains("the physics is not finite"), "{}", said(made));
    assert_eq!(push(made, &[0.0; 16], &[1.0]).0, PhytureStatus::Ok);
    // SAFETY: freed once.
    unsafe { phyture_stream_free(made) };
    Ok(())
}
