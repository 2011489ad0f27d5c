//! The program at the sizes its users have: a training step, a forward pass, one window on one thread and on two, and the calibration and
//! the search of 7376 s at 100 Hz. Times depend on the machine; the ids are stable.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use phyture::Result;
use phyture::critique::diagnose::{Options, diagnose};
use phyture::flight::Span;
use phyture::flight::split::Split;
use phyture::nn::{Network, OutputScale, PhyTureConfig};
use phyture::physics::{Model, calibrate};
use phyture::sim::{INERTIA_KG_M2, Level, Like, MASS_KG, ROTOR_RADIUS_M, Simulation, simulate};
use phyture::tape::{DropoutKey, Session, Threads};
use phyture_kernels::adam::Adam;
use phyture_kernels::random::Stream;
use std::time::Duration;

/// Windows of a training step.
const BATCH: usize = 32;

/// Numbers that look like standardised inputs; the same for every sample, for time does not depend on them.
fn fill(_: usize, inputs: &mut [&mut [f32]]) {
    for (index, slab) in inputs.iter_mut().enumerate() {
        let stream = Stream::new(1, 0, index as u64, 0);
        slab.iter_mut().zip(0..).for_each(|(value, at)| *value = (2.0 * stream.uniform(at) - 1.0) as f32);
    }
}

fn network(history: usize) -> phyture::nn::Result<Network<f32>> {
    Network::new(&PhyTureConfig { history, ..PhyTureConfig::default() }, &OutputScale::unit(6), false)
}

fn training(criterion: &mut Criterion) -> Result<()> {
    let mut group = criterion.benchmark_group("train_step");
    group.sample_size(10).warm_up_time(Duration::from_secs(3)).measurement_time(Duration::from_secs(30));
    group.throughput(Throughput::Elements(BATCH as u64));
    let network = network(1000)?;
    for (id, dropout) in [("phyture_h1000_b32", true), ("phyture_h1000_b32_nodropout", false)] {
        let mut session = Session::train(network.graph(), network.loss(), &[], Threads(0))?;
        let mut parameters = network.initial(0);
        let (mut first, mut second) = (vec![0.0; parameters.len()], vec![0.0; parameters.len()]);
        let mut step = 0;
        group.bench_function(BenchmarkId::from_parameter(id), |bencher| {
            bencher.iter(|| {
                let key = dropout.then_some(DropoutKey { seed: 0, step });
                let loss = session.step(&parameters, BATCH, key, &fill);
                step += 1;
                loss.and_then(|_| session.adam(&Adam::default(), step, &mut parameters, &mut first, &mut second)).is_ok()
            });
        });
    }
    group.finish();
    Ok(())
}

fn inference(criterion: &mut Criterion) -> Result<()> {
    let network = network(1000)?;
    let parameters = network.initial(0);
    for (group, id, threads, samples) in [
        ("forward", "phyture_h1000_b32", 0, BATCH),
        ("latency", "phyture_h1000_b1_1thread", 1, 1),
        ("latency", "phyture_h1000_b1_2threads", 2, 1),
    ] {
        let mut group = criterion.benchmark_group(group);
        group.sample_size(10).measurement_time(Duration::from_secs(10));
        let mut session = Session::infer(network.graph(), &[network.output()], Threads(threads))?;
        session.load(&parameters)?;
        group.bench_function(BenchmarkId::from_parameter(id), |bencher| {
            bencher.iter(|| session.predict(samples, &fill, &mut |_, _| {}).is_ok());
        });
        group.finish();
    }
    Ok(())
}

fn calibration(criterion: &mut Criterion) -> Result<()> {
    let set = simulate(&Simulation { like: Like::Stanford, ..Simulation::default() })?;
    let spans: Vec<Span> = set.flights.iter().enumerate().map(|(flight, log)| Span { flight, start: 0, end: log.len() }).collect();
    let model = Model::paper("truth", MASS_KG, INERTIA_KG_M2, ROTOR_RADIUS_M);
    let mut group = criterion.benchmark_group("calibrate");
    group.sample_size(10);
    group.bench_function(BenchmarkId::from_parameter("7376s"), |bencher| {
        bencher.iter(|| calibrate(&model, &set.flights, &spans).is_ok())
    });
    group.finish();
    Ok(())
}

/// A search of the whole data set: one hidden effect of each kind, and the wind and noise of level two.
fn diagnosis(criterion: &mut Criterion) -> Result<()> {
    let simulation = Simulation { like: Like::Stanford, level: Level::TWO, ..Simulation::baseline() };
    let set = simulate(&simulation.hide("weathercock", 0.3)?.hide("cyclic_lag", 0.5)?)?;
    let model = Model::paper("truth", MASS_KG, INERTIA_KG_M2, ROTOR_RADIUS_M);
    let split = Split::for_search(&set.flights, 1);
    let mut group = criterion.benchmark_group("diagnose");
    group.sample_size(10);
    group.bench_function(BenchmarkId::from_parameter("7376s"), |bencher| {
        bencher.iter(|| diagnose(&set.flights, &model, &split.training, &split.test, "test", &Options::default()).is_ok())
    });
    group.finish();
    Ok(())
}

fn all(criterion: &mut Criterion) {
    for bench in [training, inference, calibration, diagnosis] {
        if let Err(error) = bench(criterion) {
            eprintln!("not measured: {error}");
        }
    }
}

criterion_group!(benches, all);
criterion_main!(benches);
