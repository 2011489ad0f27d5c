//! The C interface of phyture: a trained hybrid or a model file is loaded, a stream is made of it, states are pushed, accelerations and
//! their parts are read. What C programmers read is `include/phyture.h`, which is made of these sources.
//!
//! Rust programs use `phyture::hybrid::StreamingHybrid` and `phyture::physics::StreamingModel`, which stand behind this. Pointers,
//! lengths, texts and panics are the business of `border`; nothing is computed here.

mod border;
mod layout;
mod model;
mod status;
mod stream;

pub use layout::{PHYTURE_ACCELERATIONS, PHYTURE_STATES, PhytureAcceleration, PhyturePlace, PhyturePrediction, PhytureState};
pub use model::{PhytureModel, phyture_hybrid_read, phyture_model_free, phyture_model_read, phyture_model_step_s};
pub use status::{PhytureStatus, phyture_status_text, phyture_version};
pub use stream::{
    PhytureStream, phyture_stream_envelope_count, phyture_stream_envelope_name, phyture_stream_envelope_range, phyture_stream_free,
    phyture_stream_history, phyture_stream_message, phyture_stream_network_every, phyture_stream_new, phyture_stream_own_count,
    phyture_stream_own_name, phyture_stream_push, phyture_stream_reset,
};
