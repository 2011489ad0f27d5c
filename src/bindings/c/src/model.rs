//! What is loaded once and streamed as often as is wanted: a trained hybrid, or a model file.

use crate::border::{Fault, Text, free, guarded, path, shared};
use crate::status::PhytureStatus;
use phyture::hybrid::Hybrid;
use phyture::physics::Model;
use std::ffi::c_char;
use std::path::Path;
use std::sync::Arc;

/// A trained hybrid or a model file, loaded. It does not change: several threads may make streams of it at once.
pub struct PhytureModel {
    pub(crate) loaded: Loaded,
}

pub(crate) enum Loaded {
    Hybrid(Arc<Hybrid>),
    Physics(Box<Model>),
}

// What the header promises about threads.
const _: () = {
    const fn for_any_thread<T: Send + Sync>() {}
    for_any_thread::<PhytureModel>();
};

/// Reads with `read` what lies at `from`, and gives the handle away.
///
/// # Safety
/// As [`phyture_hybrid_read`].
unsafe fn read(
    from: *const c_char,
    out: *mut *mut PhytureModel,
    (message, message_length): (*mut c_char, usize),
    read: impl FnOnce(&Path) -> phyture::Result<Loaded>,
) -> PhytureStatus {
    // SAFETY: the caller gives a buffer that can be written, or null.
    let mut text = unsafe { Text::at(message, message_length) };
    guarded(&mut text, || {
        if out.is_null() {
            return Err(Fault::Null("out"));
        }
        // SAFETY: not null, and the caller gives a place that can be written.
        unsafe { out.write(std::ptr::null_mut()) };
        // SAFETY: the caller gives a text that ends with a zero, or null.
        let path = unsafe { path(from) }?;
        let loaded = read(&path).map_err(Fault::file)?;
        // SAFETY: as above.
        unsafe { out.write(Box::into_raw(Box::new(PhytureModel { loaded }))) };
        Ok(())
    })
}

/// Reads a trained hybrid: the `network.safetensors` of a run folder, which holds physics, network and scales.
///
/// `*out` is the hybrid, to be freed with phyture_model_free; NULL where it fails: PHYTURE_STATUS_NULL, PHYTURE_STATUS_FILE.
///
/// # Safety
/// `path` is a text that ends with a zero. `out` can be written. `message` is NULL, or `message_length` bytes there can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phyture_hybrid_read(
    path: *const c_char,
    out: *mut *mut PhytureModel,
    message: *mut c_char,
    message_length: usize,
) -> PhytureStatus {
    let hybrid = |path: &Path| Ok(Loaded::Hybrid(Arc::new(Hybrid::read(path)?)));
    // SAFETY: the contract is the same.
    unsafe { read(path, out, (message, message_length), hybrid) }
}

/// Reads a model file (TOML): physics without a network.
///
/// `*out` is the model, to be freed with phyture_model_free; NULL where it fails: PHYTURE_STATUS_NULL, PHYTURE_STATUS_FILE.
///
/// # Safety
/// As phyture_hybrid_read.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phyture_model_read(
    path: *const c_char,
    out: *mut *mut PhytureModel,
    message: *mut c_char,
    message_length: usize,
) -> PhytureStatus {
    let physics = |path: &Path| Ok(Loaded::Physics(Box::new(Model::read(path)?)));
    // SAFETY: the contract is the same.
    unsafe { read(path, out, (message, message_length), physics) }
}

/// Time between the samples that a hybrid was trained on, s; 0 for physics without a network, which takes any step; NaN for NULL.
///
/// # Safety
/// `model` is NULL, or came from phyture_hybrid_read or phyture_model_read and is not freed meanwhile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phyture_model_step_s(model: *const PhytureModel) -> f64 {
    // SAFETY: the caller keeps the contract above.
    match unsafe { shared(model, "model") }.map(|model| &model.loaded) {
        Ok(Loaded::Hybrid(hybrid)) => hybrid.description().step_s,
        Ok(Loaded::Physics(_)) => 0.0,
        Err(_) => f64::NAN,
    }
}

/// Frees a model; NULL is nothing. Its streams go on.
///
/// # Safety
/// `model` is NULL, or came from phyture_hybrid_read or phyture_model_read; it is not used any more, nor freed again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phyture_model_free(model: *mut PhytureModel) {
    // SAFETY: the caller keeps the contract above.
    unsafe { free(model) }
}
