//! A simulated flight and a small untrained hybrid that has everything: delays and lags in the physics, a linear history, derived
//! quantities and memory in the inputs.
#![allow(dead_code, reason = "each test program uses its part")]

use phyture::flight::split::{Protocol, Split};
use phyture::flight::windows::windows;
use phyture::flight::{Channel, Column, DataSet, Flight, PerChannel};
use phyture::hybrid::linear::LinearConfig;
use phyture::hybrid::{Description, Hybrid, sequence};
use phyture::nn::PhyTureConfig;
use phyture::physics::{Effect, Model, calibrate};
use phyture::sim::{Simulation, simulate};
use phyture::tape::Threads;
use phyture::{Error, Result};
use phyture_c::{PhyturePlace, PhyturePrediction};
use std::ffi::{CStr, CString, c_char};
use std::path::Path;

/// Samples of the hybrid's history.
pub const HISTORY: usize = 16;

/// What nothing has been written to yet.
pub const NOTHING: PhyturePrediction = PhyturePrediction {
    acceleration: [0.0; 6],
    physics: [0.0; 6],
    linear: [0.0; 6],
    network: [0.0; 6],
    half_width: [0.0; 6],
    place: PhyturePlace::Unknown,
    beyond: 0,
    complete: false,
};

pub fn simulated() -> Result<DataSet> {
    simulate(&Simulation { minutes: 2.0, seed: 3, ..Simulation::default() })
}

/// The paper's model with a delay of 23 ms, between two samples, and an effect that remembers.
pub fn model(set: &DataSet) -> Result<Model> {
    let mut model = Model::paper("truth", 4.58, [0.18, 0.34, 0.28], 0.8);
    model.data.control_delay_s = 0.023;
    let split = Split::new(&set.flights, &[], &Protocol::Segments, 1)?;
    let mut model = calibrate(&model, &set.flights, &split.training)?.0;
    model.effects.push(Effect::formula("wake", Channel::WyDot, "lag(airspeed, 0.2) * slew(u2, 1.5)", 0.4)?);
    Ok(model)
}

pub fn hybrid(set: &DataSet) -> Result<Hybrid> {
    let model = model(set)?;
    let split = Split::new(&set.flights, &[], &Protocol::Segments, 1)?;
    let further = ["airspeed", "lag(u1, 0.1)", "g_x"].map(str::to_owned);
    let inputs: Vec<String> = Column::STATE.iter().map(|column| column.name().to_owned()).chain(further).collect();
    let config = PhyTureConfig {
        history: HISTORY,
        d_model: 8,
        heads: 2,
        levels: 2,
        stacks: 1,
        moving_average: 5,
        state_channels: inputs.len(),
        ..PhyTureConfig::default()
    };
    let linear = LinearConfig { lags: 3, ..LinearConfig::default() };
    let linear = sequence::linear(&set.flights, &split.training, &model, &linear)?;
    let config = config.into();
    let mut description = Description {
        envelope: None,
        intervals: None,
        scaling: sequence::scaling(&set.flights, &split.training, &model, &inputs, Some(&linear), &config)?,
        model,
        config,
        inputs,
        linear: Some(linear),
        gate: PerChannel::splat(1.0),
        step_s: 0.01,
    };
    description.set_envelope(&set.flights, &split.training)?;
    let weights = description.network(false)?.initial(1);
    let mut hybrid = Hybrid::new(description, weights)?;
    hybrid.set_intervals(&set.flights, &split.training, &windows(&split.training, HISTORY, 5), Threads(1))?;
    assert!(hybrid.description().intervals.is_some(), "the flights are too short for intervals");
    Ok(hybrid)
}

pub fn state(flight: &Flight, sample: usize) -> [f64; 16] {
    flight.state(sample)
}

pub fn folder() -> Result<tempfile::TempDir> {
    tempfile::tempdir().map_err(Error::io("temporary folder"))
}

pub fn c_path(path: &Path) -> CString {
    CString::new(path.to_str().expect("temporary folders are UTF-8")).expect("and hold no zero")
}

/// The text at a pointer.
///
/// # Safety
/// The pointer is one at a text that ends with a zero, or null.
pub unsafe fn text(pointer: *const c_char) -> String {
    if pointer.is_null() {
        return "NULL".into();
    }
    // SAFETY: not null, and the caller keeps the contract above.
    unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned()
}
