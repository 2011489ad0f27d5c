//! The peer networks: gradients of each against differences, agreement with PyTorch on the golden files, the same bits on any number
//! of threads, and a training step.
#![cfg(feature = "disk")]

use phyture::nn::{Architecture, Network, OutputScale, parity};
use phyture::tape::{DropoutKey, Session, Threads, gradcheck};
use phyture::{Error, Result};
use phyture_kernels::Tolerance;
use phyture_kernels::random::Stream;
use std::path::Path;

const KEY: DropoutKey = DropoutKey { seed: 11, step: 7 };

/// Each peer at small sizes.
const SMALL: &[&str] = &[
    r#"{"kind": "cnn", "history": 24, "state_channels": 3, "channels": [5, 4, 4, 5], "hidden": 6}"#,
    r#"{"kind": "cnn_lstm", "history": 16, "state_channels": 3, "channels": [5, 4], "hidden": 3}"#,
    r#"{"kind": "tcn", "history": 21, "state_channels": 3, "channels": 4, "kernel": 3, "levels": 3}"#,
    r#"{"kind": "dlinear", "history": 12, "state_channels": 3, "moving_average": 5}"#,
    r#"{"kind": "dlinear", "history": 12, "state_channels": 3, "moving_average": 5, "individual": true}"#,
    r#"{"kind": "timemixer", "history": 16, "state_channels": 3, "d_model": 4, "d_ff": 5, "scales": 2, "moving_average": 5}"#,
    r#"{"kind": "timesnet", "history": 14, "state_channels": 3, "d_model": 4, "d_ff": 3, "periods": 3, "kernels": 3}"#,
    r#"{"kind": "informer", "history": 20, "state_channels": 3, "d_model": 8, "d_ff": 6, "heads": 2, "decoder_rows": 9, "factor": 2}"#,
];

fn small() -> Result<Vec<Architecture>> {
    let read = |text: &&str| serde_json::from_str(text).map_err(|error| Error::Undetermined(format!("{text}: {error}")));
    SMALL.iter().map(read).collect()
}

fn scale() -> OutputScale {
    OutputScale { scale: vec![2.0, 1.5, 1.0, 0.5, 0.7, 0.9], offset: vec![0.3, -0.2, 0.1, 0.0, 0.4, -0.5] }
}

fn fill<T: phyture_kernels::Real>(sample: usize, inputs: &mut [&mut [T]]) {
    for (index, input) in inputs.iter_mut().enumerate() {
        let stream = Stream::new(5, 0, index as u64, sample as u64);
        for (at, value) in input.iter_mut().enumerate() {
            *value = T::of(f64::from((4.0 * stream.uniform(at as u64) - 2.0) as f32));
        }
    }
}

#[test]
fn every_peer_has_the_gradients_of_its_loss() -> Result<()> {
    for architecture in small()? {
        let network = Network::<f64>::new(&architecture, &scale(), false)?;
        let parameters = network.initial(1);
        // Without random parts a loss depends on the running values of a batch norm, which have no gradient: then the operation's own
        // check and the golden files say that all is well.
        let settles = network.parameters().iter().any(|parameter| parameter.name.contains(".running_"));
        for dropout in [None, Some(KEY)].into_iter().filter(|dropout| dropout.is_some() || !settles) {
            let zero = |name: &str| {
                // Softmax does not see a constant added to all keys; running values are not trained; and a constant before a batch norm
                // is taken off again, also by way of a circular convolution.
                let settled = settles && ["distilling.bias", "encoder.0.norm2.bias"].iter().any(|end| name.ends_with(end));
                name.ends_with(".key.bias") || name.contains(".running_") || settled
            };
            gradcheck::graph(
                &gradcheck::LossOf {
                    graph: network.graph(),
                    loss: network.loss(),
                    parameters: &parameters,
                    samples: 3,
                    dropout,
                    fill: &fill,
                },
                &zero,
                1,
            )
            .map_err(|disagreement| Error::Undetermined(format!("{}, {dropout:?}: {disagreement}", architecture.name())))?;
        }
    }
    Ok(())
}

#[test]
fn every_peer_agrees_with_pytorch() -> Result<()> {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/peers"));
    let files = std::fs::read_dir(folder).map_err(|source| Error::Io { path: folder.into(), source })?;
    for text in SMALL {
        let sizes: serde_json::Value =
            serde_json::from_str(text).map_err(|error| Error::Undetermined(format!("{text}: {error}")))?;
        let kind = sizes["kind"].as_str().unwrap_or_default();
        let golden = folder.join(format!("{kind}.safetensors"));
        assert!(golden.exists(), "no {}; `python fixtures/peers/generate.py {kind}` makes it, with PyTorch", golden.display());
    }
    for path in files.flatten().map(|file| file.path()).filter(|path| path.extension().is_some_and(|kind| kind == "safetensors")) {
        let found = parity::compare(&path, Threads(2))?;
        let off: Vec<_> = found.relative_error.iter().filter(|(_, error)| **error > Tolerance::Close.relative_f64()).collect();
        assert!(off.is_empty(), "{}: {off:?}", path.display());
    }
    Ok(())
}

#[test]
fn every_peer_gives_the_same_bits_on_one_thread_and_on_two() -> Result<()> {
    for architecture in small()? {
        let network = Network::<f32>::new(&architecture, &scale(), false)?;
        let parameters = network.initial(2);
        let mut found = Vec::new();
        for threads in [1, 2] {
            let mut session = Session::train(network.graph(), network.loss(), &[], Threads(threads))?;
            let loss = session.step(&parameters, 9, Some(KEY), &fill)?;
            found.push((loss.to_bits(), session.gradients().iter().map(|gradient| gradient.to_bits()).collect::<Vec<_>>()));
        }
        assert!(found[0] == found[1], "{}", architecture.name());
    }
    Ok(())
}

#[test]
fn gradient_descent_lowers_the_loss_of_every_peer() -> Result<()> {
    for architecture in small()? {
        let network = Network::<f32>::new(&architecture, &scale(), false)?;
        let mut parameters = network.initial(3);
        let mut session = Session::train(network.graph(), network.loss(), &[], Threads(1))?;
        let before = session.step(&parameters, 4, None, &fill)?;
        for _ in 0..20 {
            session.step(&parameters, 4, None, &fill)?;
            let norm = session.gradients().iter().map(|gradient| gradient * gradient).sum::<f32>().sqrt().max(1.0);
            parameters.iter_mut().zip(session.gradients()).for_each(|(value, gradient)| *value -= 0.02 * gradient / norm);
        }
        let after = session.step(&parameters, 4, None, &fill)?;
        assert!(after < before, "{}: {before} to {after}", architecture.name());
    }
    Ok(())
}
