//! A stream behind a handle: a state in, a prediction with its parts out. The computing is `phyture`'s.

use crate::border::{Fault, Text, free, guarded, numbers, shared};
use crate::layout::{PHYTURE_ACCELERATIONS, PHYTURE_STATES, PhyturePlace, PhyturePrediction};
use crate::model::{Loaded, PhytureModel};
use crate::status::PhytureStatus;
use phyture::hybrid::envelope::{Envelope, Place};
use phyture::hybrid::{Hybrid, StreamingHybrid};
use phyture::physics::StreamingModel;
use phyture::{Error, Result};
use std::ffi::{CString, c_char};
use std::mem::MaybeUninit;
use std::num::NonZeroUsize;
use std::sync::Arc;

/// Bytes of the sentence about the last fault.
const MESSAGE: usize = 512;

/// A model that takes one sample at a time. One thread at a time uses it.
pub struct PhytureStream {
    streaming: Streaming,
    /// Names of the log's own columns.
    own: Vec<CString>,
    /// Names of the quantities of the envelope.
    envelope: Vec<CString>,
    message: [MaybeUninit<u8>; MESSAGE],
    /// There was a panic, and nobody knows what it left behind.
    broken: bool,
}

enum Streaming {
    Hybrid(Box<StreamingHybrid<Arc<Hybrid>>>),
    Physics(Box<StreamingModel>),
}

// What the header promises about threads.
const _: () = {
    const fn for_one_thread_at_a_time<T: Send>() {}
    for_one_thread_at_a_time::<PhytureStream>();
};

impl Streaming {
    fn new(loaded: &Loaded, step_s: f64) -> Result<Self> {
        match loaded {
            Loaded::Physics(model) => Ok(Self::Physics(Box::new(model.stream(step_s)?))),
            Loaded::Hybrid(hybrid) => {
                let description = hybrid.description();
                if step_s != 0.0 && !description.is_trained_at(step_s) {
                    return Err(Error::Config {
                        place: "stream".into(),
                        field: "step_s".into(),
                        found: format!("{step_s} s"),
                        expected: format!("the {} s the network was trained at, or 0 for them", description.step_s),
                    });
                }
                Ok(Self::Hybrid(Box::new(Arc::clone(hybrid).into_stream()?)))
            }
        }
    }

    fn own_columns(&self) -> &[String] {
        match self {
            Self::Hybrid(stream) => stream.own_columns(),
            Self::Physics(stream) => stream.extra_inputs(),
        }
    }

    fn envelope(&self) -> Option<&Envelope> {
        match self {
            Self::Hybrid(stream) => stream.envelope(),
            Self::Physics(_) => None,
        }
    }

    fn set_network_every(&mut self, samples: NonZeroUsize) {
        match self {
            Self::Hybrid(stream) => stream.set_network_every(samples),
            // There is no network that could wait.
            Self::Physics(_) => (),
        }
    }

    fn reset(&mut self, start_s: f64) {
        match self {
            Self::Hybrid(stream) => stream.reset(start_s),
            Self::Physics(stream) => stream.reset(start_s),
        }
    }

    fn push(&mut self, state: &[f64; PHYTURE_STATES], own: &[f64]) -> std::result::Result<PhyturePrediction, Fault> {
        const NOTHING: [f64; PHYTURE_ACCELERATIONS] = [0.0; PHYTURE_ACCELERATIONS];
        const NOT_YET: [f64; PHYTURE_ACCELERATIONS] = [f64::NAN; PHYTURE_ACCELERATIONS];
        match self {
            Self::Physics(stream) => {
                let physics = stream.push_with(state, own).map_err(Fault::model)?.into_array();
                if physics.iter().any(|value| !value.is_finite()) {
                    return Err(Fault::Physics);
                }
                Ok(PhyturePrediction {
                    acceleration: physics,
                    physics,
                    linear: NOTHING,
                    network: NOTHING,
                    half_width: NOT_YET,
                    place: PhyturePlace::Unknown,
                    beyond: 0,
                    complete: true,
                })
            }
            Self::Hybrid(stream) => {
                // Numbers that are not finite were refused before: what is still undetermined is the prediction.
                let parts = stream.push_parts(state, own).map_err(|error| match error {
                    Error::Undetermined(_) => Fault::Library(PhytureStatus::Prediction, error),
                    _ => Fault::model(error),
                })?;
                let (place, beyond) = match parts.place {
                    None => (PhyturePlace::Unknown, 0),
                    Some(Place::Inside) => (PhyturePlace::Inside, 0),
                    Some(Place::Beyond { quantity, .. }) => (PhyturePlace::Beyond, quantity),
                    Some(Place::Apart { .. }) => (PhyturePlace::Apart, 0),
                };
                Ok(PhyturePrediction {
                    acceleration: parts.acceleration.map_or(NOT_YET, Into::into),
                    physics: parts.physics.into(),
                    linear: parts.linear.into(),
                    network: parts.network.map_or(NOT_YET, Into::into),
                    half_width: parts.half_width.map_or(NOT_YET, Into::into),
                    place,
                    beyond,
                    complete: parts.acceleration.is_some(),
                })
            }
        }
    }
}

impl PhytureStream {
    fn new(loaded: &Loaded, step_s: f64) -> Result<Self> {
        let streaming = Streaming::new(loaded, step_s)?;
        // Names are those of columns, in which nothing but a zero byte has no place in C.
        let text = |name: &str| CString::new(name).unwrap_or_default();
        let own = streaming.own_columns().iter().map(|name| text(name)).collect();
        let envelope = streaming.envelope().map_or(&[][..], Envelope::ranges).iter().map(|range| text(&range.name)).collect();
        Ok(Self { streaming, own, envelope, message: [MaybeUninit::new(0); MESSAGE], broken: false })
    }

    /// Runs a call on the stream; a panic breaks it for good.
    fn call(&mut self, work: impl FnOnce(&mut Streaming, usize) -> std::result::Result<(), Fault>) -> PhytureStatus {
        let Self { streaming, own, message, broken, .. } = self;
        let is_broken = *broken;
        let status = guarded(&mut Text::new(message), || if is_broken { Err(Fault::Broken) } else { work(streaming, own.len()) });
        *broken |= status == PhytureStatus::Panic;
        status
    }
}

/// Refuses what is no finite number, before anything is taken.
fn check(values: &[f64], fault: impl Fn(usize, f64) -> Fault) -> std::result::Result<(), Fault> {
    match values.iter().position(|value| !value.is_finite()) {
        Some(place) => Err(fault(place, values[place])),
        None => Ok(()),
    }
}

/// Makes a stream. Samples have to come `step_s` seconds apart: a hybrid takes the step that it was trained at, or 0 for that; physics alone
/// takes any.
///
/// `*out` is the stream, to be freed with phyture_stream_free; NULL where it fails: PHYTURE_STATUS_NULL, PHYTURE_STATUS_MODEL. All
/// memory is asked for here.
///
/// # Safety
/// `model` came from phyture_hybrid_read or phyture_model_read. `out` can be written. `message` is NULL, or `message_length` bytes there
/// can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phyture_stream_new(
    model: *const PhytureModel,
    step_s: f64,
    out: *mut *mut PhytureStream,
    message: *mut c_char,
    message_length: usize,
) -> PhytureStatus {
    // SAFETY: the caller gives a buffer that can be written, or null.
    let mut text = unsafe { Text::at(message, message_length) };
    guarded(&mut text, || {
        if out.is_null() {
            return Err(Fault::Null("out"));
        }
        // SAFETY: not null, and the caller gives a place that can be written.
        unsafe { out.write(std::ptr::null_mut()) };
        // SAFETY: the caller keeps the contract above.
        let model = unsafe { shared(model, "model") }?;
        let stream = PhytureStream::new(&model.loaded, step_s).map_err(Fault::model)?;
        // SAFETY: as above.
        unsafe { out.write(Box::into_raw(Box::new(stream))) };
        Ok(())
    })
}

/// Takes the next sample and predicts its accelerations.
///
/// `state` is PHYTURE_STATES numbers in the order of PhytureState; `own` has one number for each of phyture_stream_own_name, in the unit of
/// the log, and is NULL with 0 where there are none. Where it fails `*out` is as it was: PHYTURE_STATUS_NULL, PHYTURE_STATUS_LENGTH and
/// PHYTURE_STATUS_NOT_FINITE (the sample was not taken, and the next one is taken to follow the last that was), PHYTURE_STATUS_PREDICTION,
/// PHYTURE_STATUS_PANIC. phyture_stream_message has the sentence.
///
/// # Safety
/// `stream` came from phyture_stream_new, and no other thread uses it. `state` and `own` point at as many numbers as their lengths say.
/// `out` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phyture_stream_push(
    stream: *mut PhytureStream,
    state: *const f64,
    state_length: usize,
    own: *const f64,
    own_length: usize,
    out: *mut PhyturePrediction,
) -> PhytureStatus {
    // SAFETY: the caller keeps the contract above.
    let Some(stream) = (unsafe { stream.as_mut() }) else { return PhytureStatus::Null };
    stream.call(|streaming, own_count| {
        // SAFETY: the caller keeps the contract above.
        let (state, own) =
            unsafe { (numbers(state, state_length, PHYTURE_STATES, "state")?, numbers(own, own_length, own_count, "own")?) };
        if out.is_null() {
            return Err(Fault::Null("out"));
        }
        check(state, Fault::State)?;
        check(own, Fault::Own)?;
        let state = state.try_into().expect("the length was looked at");
        let prediction = streaming.push(state, own)?;
        // SAFETY: not null, and the caller gives a place that can be written.
        unsafe { out.write(prediction) };
        Ok(())
    })
}

/// Starts anew: the next sample is the first one, at time `start_s` in seconds (0 after phyture_stream_new), and the history is empty.
/// Fails with PHYTURE_STATUS_NULL, PHYTURE_STATUS_NOT_FINITE, PHYTURE_STATUS_PANIC.
///
/// # Safety
/// `stream` is NULL, or came from phyture_stream_new, and no other thread uses it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phyture_stream_reset(stream: *mut PhytureStream, start_s: f64) -> PhytureStatus {
    // SAFETY: the caller keeps the contract above.
    let Some(stream) = (unsafe { stream.as_mut() }) else { return PhytureStatus::Null };
    stream.call(|streaming, _| {
        check(&[start_s], |_, value| Fault::Start(value))?;
        streaming.reset(start_s);
        Ok(())
    })
}

/// Samples until a prediction is complete: the network's history, 1 without a network; 0 for NULL.
///
/// # Safety
/// `stream` is NULL, or came from phyture_stream_new, and no other thread uses it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phyture_stream_history(stream: *const PhytureStream) -> usize {
    // SAFETY: the caller keeps the contract above.
    match unsafe { stream.as_ref() }.map(|stream| &stream.streaming) {
        Some(Streaming::Hybrid(stream)) => stream.history(),
        Some(Streaming::Physics(_)) => 1,
        None => 0,
    }
}

/// How many columns of the log's own (motor commands, rotor speeds) are read besides the state; 0 for NULL, and for most models.
///
/// # Safety
/// `stream` is NULL, or came from phyture_stream_new, and no other thread uses it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phyture_stream_own_count(stream: *const PhytureStream) -> usize {
    // SAFETY: the caller keeps the contract above.
    unsafe { stream.as_ref() }.map_or(0, |stream| stream.own.len())
}

/// Name of one of these columns, as in the log; NULL where there is none. The text belongs to the stream.
///
/// # Safety
/// `stream` is NULL, or came from phyture_stream_new, and no other thread uses it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phyture_stream_own_name(stream: *const PhytureStream, index: usize) -> *const c_char {
    // SAFETY: the caller keeps the contract above.
    let name = unsafe { stream.as_ref() }.and_then(|stream| stream.own.get(index));
    name.map_or(std::ptr::null(), |name| name.as_ptr())
}

/// How many quantities the envelope asks for; 0 for NULL, and for a model without an envelope.
///
/// # Safety
/// `stream` is NULL, or came from phyture_stream_new, and no other thread uses it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phyture_stream_envelope_count(stream: *const PhytureStream) -> usize {
    // SAFETY: the caller keeps the contract above.
    unsafe { stream.as_ref() }.map_or(0, |stream| stream.envelope.len())
}

/// Name of one of these quantities, a state or a column of the log's own; NULL where there is none. The text belongs to the stream.
///
/// # Safety
/// `stream` is NULL, or came from phyture_stream_new, and no other thread uses it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phyture_stream_envelope_name(stream: *const PhytureStream, index: usize) -> *const c_char {
    // SAFETY: the caller keeps the contract above.
    let name = unsafe { stream.as_ref() }.and_then(|stream| stream.envelope.get(index));
    name.map_or(std::ptr::null(), |name| name.as_ptr())
}

/// Smallest and largest value of one of these quantities in the training, in its unit; PHYTURE_STATUS_LENGTH where there is no such quantity, and
/// `low` and `high` are then as they were.
///
/// # Safety
/// `stream` is NULL, or came from phyture_stream_new, and no other thread uses it. `low` and `high` are NULL or can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phyture_stream_envelope_range(
    stream: *const PhytureStream,
    index: usize,
    low: *mut f64,
    high: *mut f64,
) -> PhytureStatus {
    // SAFETY: the caller keeps the contract above.
    let Some(stream) = (unsafe { stream.as_ref() }) else { return PhytureStatus::Null };
    if low.is_null() || high.is_null() {
        return PhytureStatus::Null;
    }
    let Some(range) = stream.streaming.envelope().and_then(|envelope| envelope.ranges().get(index)) else {
        return PhytureStatus::Length;
    };
    // SAFETY: not null, and the caller gives places that can be written.
    unsafe {
        low.write(range.low);
        high.write(range.high);
    }
    PhytureStatus::Ok
}

/// Lets the network look at every `samples`-th sample only and holds what it said in between; physics and linear history are of each sample all the
/// same. 1 after phyture_stream_new. Without a network nothing changes. Fails with PHYTURE_STATUS_NULL, PHYTURE_STATUS_LENGTH for 0,
/// PHYTURE_STATUS_PANIC.
///
/// # Safety
/// `stream` is NULL, or came from phyture_stream_new, and no other thread uses it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phyture_stream_network_every(stream: *mut PhytureStream, samples: usize) -> PhytureStatus {
    // SAFETY: the caller keeps the contract above.
    let Some(stream) = (unsafe { stream.as_mut() }) else { return PhytureStatus::Null };
    stream.call(|streaming, _| {
        let samples = NonZeroUsize::new(samples).ok_or(Fault::Every)?;
        streaming.set_network_every(samples);
        Ok(())
    })
}

/// The sentence about the last phyture_stream_push, phyture_stream_reset or phyture_stream_network_every; empty where that was done, NULL for NULL. The text belongs to the stream and
/// stays as it is until the next of these calls.
///
/// # Safety
/// `stream` is NULL, or came from phyture_stream_new, and no other thread uses it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phyture_stream_message(stream: *const PhytureStream) -> *const c_char {
    // SAFETY: the caller keeps the contract above.
    unsafe { stream.as_ref() }.map_or(std::ptr::null(), |stream| stream.message.as_ptr().cast())
}

/// Frees a stream; NULL is nothing.
///
/// # Safety
/// `stream` is NULL, or came from phyture_stream_new; it is not used any more, nor freed again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phyture_stream_free(stream: *mut PhytureStream) {
    // SAFETY: the caller keeps the contract above.
    unsafe { free(stream) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phyture::physics::Model;
    use std::ffi::CStr;

    #[test]
    fn a_stream_that_panicked_refuses_everything_from_then_on() -> Result<()> {
        let loaded = Loaded::Physics(Box::new(Model::paper("n9", 4.58, [0.18, 0.34, 0.28], 0.8)));
        let mut stream = PhytureStream::new(&loaded, 0.01)?;
        // SAFETY: the message of a stream always ends with a zero.
        let said = |stream: &PhytureStream| unsafe { CStr::from_ptr(phyture_stream_message(stream)) }.to_str().map(str::to_owned);
        assert_eq!(stream.call(|_, _| Ok(())), PhytureStatus::Ok);
        assert_eq!(said(&stream).as_deref(), Ok(""));
        assert_eq!(stream.call(|_, _| panic!("index 7 of 3")), PhytureStatus::Panic);
        assert_eq!(said(&stream).as_deref(), Ok("a fault of the library: index 7 of 3"));
        assert_eq!(stream.call(|_, _| unreachable!("not asked any more")), PhytureStatus::Panic);
        assert!(said(&stream).is_ok_and(|text| text.contains("can only be freed")));
        // SAFETY: a stream of this thread's own.
        assert_eq!(unsafe { phyture_stream_reset(&mut stream, 0.0) }, PhytureStatus::Panic);
        Ok(())
    }
}
