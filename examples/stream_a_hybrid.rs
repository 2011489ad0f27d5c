//! Loads a trained hybrid, physics and network in one file, and streams samples through it: one sample in, one prediction out.
//!
//! ```text
//! phyture simulate flights --minutes 5 --seed 7
//! phyture calibrate flights -o model.toml
//! phyture train flights -m model.toml -o run
//! cargo run --release --features sim --example stream_a_hybrid -- run/network.safetensors
//! ```
//!
//! It needs the default features alone: what runs on board reads no logs. Here the built-in helicopter stands in for the aircraft.

use phyture::flight::{Channel, PerChannel};
use phyture::hybrid::Hybrid;
use phyture::sim::{Simulation, simulate};
use phyture::{Error, Result};
use std::path::Path;

fn main() -> Result<()> {
    let Some(path) = std::env::args_os().nth(1) else {
        return Err(Error::Undetermined("give the network.safetensors of a run folder".into()));
    };
    let hybrid = Hybrid::read(Path::new(&path))?;
    let description = hybrid.description();
    println!(
        "{} on the model `{}`: a history of {} samples, {} s apart",
        description.config.name(),
        description.model.name,
        description.config.history(),
        description.step_s
    );

    // Samples have to come one training step apart; the simulator logs at 100 Hz.
    let set = simulate(&Simulation { minutes: 0.5, seed: 8, ..Simulation::default() })?;
    let mut stream = hybrid.stream()?;
    let mut squares = PerChannel::splat(0.0);
    let mut predictions = 0_u32;
    let flight = &set.flights[0];
    for sample in 0..flight.len() {
        // Position, Euler angles, velocity, rates, controls, in SI units and radians: what the aircraft knows at this moment.
        let state = flight.state(sample);
        // `None` until the history is full.
        let Some(predicted) = stream.push(&state)? else { continue };
        predictions += 1;
        for channel in Channel::ALL {
            squares[channel] += (predicted[channel] - flight.column(channel.column())[sample]).powi(2);
        }
    }

    println!("root mean square error of {predictions} predictions");
    for (channel, square) in squares.pairs() {
        println!("  {channel:<7} {:.3} {}", (square / f64::from(predictions.max(1))).sqrt(), channel.unit());
    }
    Ok(())
}
