//! The steady state allocates nothing: a counting allocator sees no request in steps 3 to 10, nor, once its threads have started, on two
//! threads; neither in training, Adam included, nor in the prediction of one window, whose large operations two threads share, nor where
//! a batch normalisation couples the samples of a step.
//!
//! A file of its own, because the allocator counts for the whole program.

mod counting;

use counting::REQUESTS;
use phyture::Result;
use phyture::nn::peers::InformerConfig;
use phyture::nn::{Architecture, Network, OutputScale, PhyTureConfig};
use phyture::tape::{DropoutKey, Session, Threads};
use phyture_kernels::adam::Adam;
use std::sync::atomic::Ordering;

/// Steps in a row that have to be without a request.
const QUIET: usize = 8;

#[test]
fn the_steady_state_allocates_nothing() -> Result<()> {
    // Sessions live to the end: the threads of one that is dropped end some time later, and allocate while they do.
    let mut sessions = Vec::new();
    // On one thread steps 3 to 10. On two the second one starts when the system likes, and entering a thread pool grows one of its
    // queues once in some dozens of calls: there the same number of steps in a row, soon or late.
    for (threads, most) in [(1, 2 + QUIET), (2, 25 * QUIET)] {
        let phyture = |history| -> Architecture {
            PhyTureConfig { history, d_model: 16, moving_average: 5, ..PhyTureConfig::default() }.into()
        };
        // Two encoder layers, so that there is a batch normalisation between them.
        let coupled =
            InformerConfig { history: 32, d_model: 16, d_ff: 16, heads: 2, decoder_rows: 8, ..InformerConfig::default() }.into();
        for (config, samples, trains) in [(phyture(32), 9, true), (phyture(240), 1, false), (coupled, 9, true)] {
            let network = Network::<f32>::new(&config, &OutputScale::unit(6), false)?;
            let mut parameters = network.initial(1);
            let mut moments = [(); 2].map(|()| vec![0.0; parameters.len()]);
            let fill =
                |sample: usize, inputs: &mut [&mut [f32]]| inputs.iter_mut().for_each(|input| input.fill(0.1 * sample as f32));
            let (graph, outputs, threads) = (network.graph(), [network.output()], Threads(threads));
            let mut session = if trains {
                Session::train(graph, network.loss(), &outputs, threads)?
            } else {
                Session::infer(graph, &outputs, threads)?
            };
            let (mut steps, mut quiet) = (0, 0);
            while steps < most && quiet < QUIET {
                let before = REQUESTS.load(Ordering::Relaxed);
                session.step(&parameters, samples, trains.then_some(DropoutKey { seed: 1, step: steps as u64 }), &fill)?;
                if trains {
                    let [first, second] = moments.each_mut().map(|values| &mut values[..]);
                    session.adam(&Adam::default(), steps as u64 + 1, &mut parameters, first, second)?;
                    session.settle(&mut parameters);
                }
                steps += 1;
                quiet = if REQUESTS.load(Ordering::Relaxed) == before { quiet + 1 } else { 0 };
            }
            assert_eq!(
                quiet,
                QUIET,
                "{}, {samples} samples, {threads:?}: no {QUIET} quiet steps in a row among {steps}",
                config.name()
            );
            sessions.push(session);
        }
    }
    Ok(())
}
