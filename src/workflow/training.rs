//! The training run of a residual network in its folder: begun or gone on with, its network written, and what came of it as data. The run itself
//! is [`Training`]'s.

use crate::critique::digits::significant;
use crate::critique::prose::listed;
use crate::error::{Error, Result};
use crate::flight::split::Split;
use crate::flight::{Channel, DataSet, PerChannel};
use crate::hybrid::Hybrid;
use crate::physics::Model;
use crate::train::{Ended, EpochLoss, Event, Report, Trained, Training};
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::path::PathBuf;
use std::time::Instant;

/// From this factor on a gate lets everything through, as far as words say.
const IN_FULL: f64 = 0.995;

/// What tells one set of training data from another, as a number: of a text that does.
pub fn digest(identity: &str) -> u64 {
    let digest = Sha256::digest(identity.as_bytes());
    u64::from_le_bytes(*digest.first_chunk().expect("it has 32 bytes"))
}

/// What tells these training data from others: the files, the model but for its provenance, the division.
///
/// # Errors
/// As [`Model::to_toml`].
pub fn training_digest(set: &DataSet, model: &Model, split: &Split) -> Result<u64> {
    let model = Model { provenance: Default::default(), ..model.clone() };
    Ok(digest(&format!("{}\n{}\n{split:?}", set.source.sha256, model.to_toml()?)))
}

/// The epoch under way.
#[derive(Clone, Copy, Debug, Default)]
pub struct Epoch {
    number: usize,
    sum: f64,
    steps: u32,
    /// Of the last epoch that ended.
    validation: Option<f64>,
}

impl Epoch {
    /// Takes a step in.
    pub fn take(&mut self, report: &Report) {
        if report.step.epoch != self.number {
            (self.number, self.sum, self.steps) = (report.step.epoch, 0.0, 0);
        }
        self.sum += report.step.loss;
        self.steps += 1;
        self.validation = report.epoch_ended.and_then(|losses| losses.validation).or(self.validation);
    }

    /// Mean loss over its steps so far.
    pub fn loss(&self) -> Option<f64> {
        (self.steps > 0).then(|| self.sum / f64::from(self.steps))
    }
}

impl std::fmt::Display for Epoch {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "epoch {}  loss {:.4}", self.number + 1, self.loss().unwrap_or(f64::NAN))?;
        self.validation.map_or(Ok(()), |loss| write!(f, "  validation {loss:.4}"))
    }
}

/// A network that was trained and written, as data.
#[derive(Clone, Debug, Serialize)]
pub struct TrainedNetwork {
    /// Its file.
    pub network: PathBuf,
    /// Trainable numbers.
    pub parameters: usize,
    /// Windows that trained it.
    pub windows: usize,
    /// Steps in all.
    pub steps: u64,
    /// Of the network as it is written, on the windows that trained it, without dropout: mean of the squared errors, summed over the
    /// channels, (m/s²)² + (rad/s²)²; where rollouts train, too, their loss is in it.
    pub training_loss: f64,
    /// The same on the validation part, which it was not trained on; none if the split has no validation part.
    pub validation_loss: Option<f64>,
    /// Windows that validated it.
    pub validation_windows: usize,
    /// Mean over the steps of the last epoch, dropout on; none if a finished run was gone on with.
    pub last_epoch_loss: Option<f64>,
    /// Losses of each epoch, the first one first.
    pub curve: Vec<EpochLoss>,
    /// The epoch whose weights these are, from 1: the last one, or the best where that is to be kept.
    pub epoch: usize,
    /// What share of the network's word is taken, channel by channel, 0 to 1; none if there is no gate.
    pub gate: Option<PerChannel<f64>>,
    /// Windows that did not train and made the gate; 0 if there is none.
    pub gate_windows: usize,
    /// Time that it took, s.
    pub seconds: f64,
}

impl TrainedNetwork {
    /// What the gate lets through, as a sentence; none if there is no gate.
    pub fn gate_in_words(&self) -> Option<String> {
        let gate = self.gate.as_ref()?;
        let of = |wanted: &dyn Fn(f64) -> bool| gate.pairs().filter(|(_, factor)| wanted(**factor)).collect::<Vec<_>>();
        let names = |channels: Vec<(Channel, &f64)>| channels.iter().map(|(channel, _)| channel.to_string()).collect::<Vec<_>>();
        let (full, shut) = (names(of(&|factor| factor >= IN_FULL)), names(of(&|factor| factor <= 0.0)));
        let part = of(&|factor| factor > 0.0 && factor < IN_FULL);
        let mut open: Vec<String> =
            part.into_iter().map(|(channel, factor)| format!("by {} in {channel}", significant(*factor, 2))).collect();
        if !full.is_empty() {
            open.insert(0, format!("fully in {}", listed(&full)));
        }
        let on = format!("{} windows that did not train", self.gate_windows);
        Some(match (open.is_empty(), shut.is_empty()) {
            (true, _) => format!("the network brought nothing on {on}; physics stands alone"),
            (_, true) => format!("the network counts {}, fitted on {on}", open.join(", ")),
            _ => format!(
                "the network counts {}; in {} it brought nothing on {on}, and physics stands alone",
                open.join(", "),
                listed(&shut)
            ),
        })
    }
}

/// What a run ended in.
pub struct Run {
    /// Physics and network.
    pub hybrid: Hybrid,
    /// The rest as data.
    pub network: TrainedNetwork,
}

/// Trains to the end and writes the network into the run's folder: from the beginning, where what an earlier run left goes as soon as everything
/// that the new one needs has been read, or, with `resume`, from the last checkpoint. `observe` hears what happens and says after each step whether
/// to go on.
///
/// # Errors
/// As [`Training::run`], [`RunFolder::resume`](crate::train::RunFolder::resume) and [`Hybrid::write`]; [`Error::Interrupted`] where `observe` ends it,
/// the state being saved.
pub fn train(training: &Training<'_>, resume: bool, observe: &mut dyn FnMut(Event<'_>) -> Result<bool>) -> Result<Run> {
    let Training { config, folder, data, .. } = *training;
    let begun = Instant::now();
    let state = resume.then(|| folder.resume(config, data)).transpose()?;
    let mut epoch = Epoch::default();
    let training = Training { with_losses: true, ..*training };
    let ended = training.run(state, &mut |event| {
        let begins = matches!(event, Event::Begins(_));
        if let Event::Step(report) = &event {
            epoch.take(report);
        }
        let goes_on = observe(event)?;
        if begins && !resume {
            folder.clear()?;
        }
        Ok(goes_on)
    })?;
    let Trained { hybrid, begun: did, gate_windows, losses, curve, epoch: of_epoch } = match ended {
        Ended::Trained(trained) => *trained,
        Ended::Stopped { done, steps } => {
            let saved = format!("saved after step {done} of {steps} in {}; go on with --resume", folder.checkpoint().display());
            return Err(Error::Interrupted { saved });
        }
    };
    let losses = losses.expect("they were asked for");
    hybrid.write(&folder.network())?;
    let network = TrainedNetwork {
        network: folder.network(),
        parameters: did.parameters,
        windows: did.windows,
        steps: did.steps,
        training_loss: losses.training,
        validation_loss: losses.validation,
        validation_windows: did.validation_windows,
        last_epoch_loss: epoch.loss(),
        curve,
        epoch: of_epoch + 1,
        gate: (gate_windows > 0).then_some(hybrid.description().gate),
        gate_windows,
        seconds: begun.elapsed().as_secs_f64(),
    };
    Ok(Run { hybrid, network })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gate_is_said_in_words() {
        let said = |gate: Option<[f64; 6]>| {
            let of_nothing = TrainedNetwork {
                network: PathBuf::new(),
                parameters: 0,
                windows: 0,
                steps: 0,
                training_loss: 0.0,
                validation_loss: None,
                validation_windows: 0,
                last_epoch_loss: None,
                curve: Vec::new(),
                epoch: 1,
                gate: gate.map(PerChannel::new),
                gate_windows: 90,
                seconds: 0.0,
            };
            of_nothing.gate_in_words().unwrap_or_default()
        };
        assert_eq!(said(None), "");
        assert_eq!(said(Some([0.0; 6])), "the network brought nothing on 90 windows that did not train; physics stands alone");
        assert_eq!(
            said(Some([0.743, 0.0, 0.96, 0.0, 1.0, 0.998])),
            "the network counts fully in wy_dot and wz_dot, by 0.74 in vx_dot, by 0.96 in vz_dot; in vy_dot and wx_dot it brought \
             nothing on 90 windows that did not train, and physics stands alone"
        );
        let all = said(Some([1.0; 6]));
        assert!(
            all.starts_with("the network counts fully in vx_dot, vy_dot")
                && all.ends_with("fitted on 90 windows that did not train"),
            "{all}"
        );
    }
}
