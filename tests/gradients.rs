//! Gradients of whole networks: every variant of Phy-Ture against differences, with and without dropout; f32 against f64; the
//! same bits on any number of threads.

use phyture::nn::{Network, OutputScale, PhyTureConfig, Variant};
use phyture::tape::{DropoutKey, Session, Threads, gradcheck};
use phyture::{Error, Result};
use phyture_kernels::random::Stream;
use phyture_kernels::{Real, Tolerance};

const KEY: DropoutKey = DropoutKey { seed: 11, step: 7 };

fn small(variant: Variant) -> PhyTureConfig {
    PhyTureConfig {
        history: 16,
        d_model: 8,
        heads: 2,
        levels: 2,
        stacks: 2,
        moving_average: 5,
        variant,
        ..PhyTureConfig::default()
    }
}

fn scale() -> OutputScale {
    OutputScale { scale: vec![2.0, 1.5, 1.0, 0.5, 0.7, 0.9], offset: vec![0.3, -0.2, 0.1, 0.0, 0.4, -0.5] }
}

fn fill<T: Real>(sample: usize, inputs: &mut [&mut [T]]) {
    for (index, input) in inputs.iter_mut().enumerate() {
        let stream = Stream::new(5, 0, index as u64, sample as u64);
        for (at, value) in input.iter_mut().enumerate() {
            // Rounded to f32, so that both precisions get the same numbers.
            *value = T::of(f64::from((4.0 * stream.uniform(at as u64) - 2.0) as f32));
        }
    }
}

fn check(config: &PhyTureConfig, samples: usize, dropout: Option<DropoutKey>) -> Result<()> {
    let network = Network::<f64>::new(config, &scale(), false)?;
    let parameters = network.initial(1);
    let last = format!("mstfe.{}.", config.stacks - 1);
    let zero = |name: &str| {
        // Softmax does not see a constant added to all keys.
        if name == "paf.key.bias" {
            return true;
        }
        // The last rows alone are read: row 15 is in the odd half of the odd half, rows 13 and 14 in the even half of the odd
        // and in the odd half of the even half. What only updates other halves of the last tree has no gradient.
        let Some(node) = name.strip_prefix(&last).filter(|_| config.variant == Variant::WithoutTsdpLastRow) else { return false };
        let unread: &[&str] = if config.horizon == 1 { &["root.eta", "o.eta", "e."] } else { &["e.eta"] };
        unread.iter().any(|prefix| node.starts_with(prefix))
    };
    gradcheck::graph(
        &gradcheck::LossOf { graph: network.graph(), loss: network.loss(), parameters: &parameters, samples, dropout, fill: &fill },
        &zero,
        1,
    )
    .map_err(|disagreement| Error::Undetermined(format!("{:?}, {dropout:?}: {disagreement}", config.variant)))
}

#[test]
fn every_variant_has_the_gradients_of_its_loss() -> Result<()> {
    check(&small(Variant::PhyTure), 2, None)?;
    Variant::ALL.into_iter().try_for_each(|variant| check(&small(variant), 2, Some(KEY)))
}

#[test]
fn unusual_sizes_have_the_gradients_of_their_loss() -> Result<()> {
    let base = || small(Variant::PhyTure);
    for config in [
        PhyTureConfig { history: 24, d_model: 6, heads: 3, levels: 3, stacks: 1, horizon: 4, ..base() },
        PhyTureConfig { hidden: 0.5, kernel1: 4, kernel2: 1, biases: false, ..base() },
        PhyTureConfig { history: 2, levels: 1, horizon: 2, moving_average: 9, stacks: 1, hidden: 1.5, ..base() },
        PhyTureConfig { horizon: 3, variant: Variant::WithoutTsdpLastRow, heads: 1, ..base() },
    ] {
        check(&config, 1, Some(KEY))?;
    }
    Ok(())
}

fn gradients<T: Real>(
    config: &PhyTureConfig,
    parameters: &[T],
    threads: usize,
    dropout: Option<DropoutKey>,
) -> Result<(f64, Vec<T>)> {
    let network = Network::<T>::new(config, &scale(), false)?;
    let mut session = Session::train(network.graph(), network.loss(), &[], Threads(threads))?;
    let loss = session.step(parameters, 9, dropout, &fill)?;
    Ok((loss, session.gradients().to_vec()))
}

#[test]
fn one_thread_and_many_give_the_same_bits() -> Result<()> {
    let config = small(Variant::PhyTure);
    let parameters = Network::<f32>::new(&config, &scale(), false)?.initial(2);
    let (loss, one) = gradients(&config, &parameters, 1, Some(KEY))?;
    for threads in [2, 16] {
        let (other, many) = gradients(&config, &parameters, threads, Some(KEY))?;
        assert_eq!(loss.to_bits(), other.to_bits());
        assert!(one.iter().zip(&many).all(|(a, b)| a.to_bits() == b.to_bits()), "{threads} threads");
    }
    Ok(())
}

/// Long enough for attention and convolutions to be cut.
#[test]
fn pieces_of_one_window_give_the_bits_of_the_whole() -> Result<()> {
    let config = PhyTureConfig { history: 304, ..small(Variant::PhyTure) };
    let network = Network::<f32>::new(&config, &scale(), false)?;
    let parameters = network.initial(4);
    let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    for samples in [1, 2] {
        let run = |threads| -> Result<_> {
            let mut infer = Session::infer(network.graph(), &[network.output()], Threads(threads))?;
            infer.step(&parameters, samples, None, &fill)?;
            let outputs =
                (0..samples).map(|sample| infer.output(0, sample).map(bits)).collect::<phyture::tape::Result<Vec<_>>>()?;
            let mut train = Session::train(network.graph(), network.loss(), &[], Threads(threads))?;
            let loss = train.step(&parameters, samples, Some(KEY), &fill)?;
            Ok((outputs, loss.to_bits(), bits(train.gradients())))
        };
        let whole = run(1)?;
        for threads in [2, 3, 4] {
            assert!(run(threads)? == whole, "{samples} samples on {threads} threads");
        }
    }
    Ok(())
}

#[test]
fn f32_follows_f64() -> Result<()> {
    let config = small(Variant::PhyTure);
    let network = Network::<f32>::new(&config, &scale(), false)?;
    let single = network.initial(3);
    let double: Vec<f64> = single.iter().map(|&value| f64::from(value)).collect();
    // The same masks: a stream is a function of its key, not of the precision.
    let (found, single) = gradients(&config, &single, 2, Some(KEY))?;
    let (expected, double) = gradients(&config, &double, 2, Some(KEY))?;
    assert!((found / expected - 1.0).abs() < Tolerance::Close.relative_f32(), "{found} against {expected}");
    for parameter in network.parameters() {
        let pairs = single[parameter.range()].iter().zip(&double[parameter.range()]);
        let scale = double[parameter.range()].iter().fold(0.0_f64, |scale, value| scale.max(value.abs())).max(1.0);
        let worst = pairs.map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max) / scale;
        assert!(worst < Tolerance::Approximate.relative_f32(), "{}: {worst:e}", parameter.name);
    }
    Ok(())
}
