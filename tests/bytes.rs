//! A hybrid that never was a file: what the library without any feature is given.

use phyture::flight::{Column, Flight, PerChannel, Span, Targets};
use phyture::hybrid::{Description, Hybrid, sequence};
use phyture::nn::PhyTureConfig;
use phyture::physics::Model;
use phyture::{Error, Result};
use std::path::Path;

const HISTORY: usize = 8;

/// Two seconds of a helicopter that sways on all axes.
fn flight() -> Result<Flight> {
    let sway = |column: usize, sample: usize| 0.3 * (sample as f64 * 0.01 * (1.0 + column as f64 / 7.0)).sin();
    let columns = std::array::from_fn(|column| (0..200).map(|sample| sway(column, sample)).collect());
    Flight::new("swaying", "made_up", 0.0, 0.01, columns, Targets::Recorded)
}

/// An untrained network on the paper's model.
fn hybrid(flight: &Flight) -> Result<Hybrid> {
    let inputs: Vec<String> = Column::STATE.iter().map(|column| column.name().to_owned()).collect();
    let state_channels = inputs.len();
    let sizes = PhyTureConfig {
        history: HISTORY,
        d_model: 8,
        heads: 2,
        levels: 1,
        stacks: 1,
        moving_average: 3,
        ..PhyTureConfig::default()
    };
    let config = PhyTureConfig { state_channels, ..sizes }.into();
    let model = Model::paper("swaying", 4.58, [0.18, 0.34, 0.28], 0.8);
    let span = Span { flight: 0, start: 0, end: flight.len() };
    let scaling = sequence::scaling(std::slice::from_ref(flight), &[span], &model, &inputs, None, &config)?;
    let gate = PerChannel::splat(1.0);
    let description =
        Description { model, config, inputs, linear: None, scaling, gate, step_s: 0.01, envelope: None, intervals: None };
    let weights = description.network(false)?.initial(1);
    Hybrid::new(description, weights)
}

#[test]
fn a_hybrid_from_its_own_bytes_streams_the_same_bits() -> Result<()> {
    let flight = flight()?;
    let given = hybrid(&flight)?;
    let bytes = given.to_bytes()?;
    let read = Hybrid::from_bytes(&bytes, Path::new("memory"))?;
    assert_eq!(read.to_bytes()?, bytes);
    let (mut given, mut read) = (given.stream()?, read.stream()?);
    let mut complete = 0;
    for sample in 0..flight.len() {
        let expected = given.push(&flight.state(sample))?;
        assert_eq!(read.push(&flight.state(sample))?, expected);
        complete += usize::from(expected.is_some());
    }
    assert_eq!(complete, flight.len() + 1 - HISTORY);
    Ok(())
}

#[test]
fn bytes_that_are_cut_are_refused_under_the_name_that_they_were_given() -> Result<()> {
    let bytes = hybrid(&flight()?)?.to_bytes()?;
    for length in (0..bytes.len()).step_by(97) {
        let refused = Hybrid::from_bytes(&bytes[..length], Path::new("uplink"));
        assert!(matches!(&refused, Err(Error::File { path, .. }) if path == Path::new("uplink")), "cut to {length}");
    }
    Ok(())
}
