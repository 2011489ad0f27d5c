//! Parity: weights, inputs, outputs and gradients of another program's network against this one's.
//!
//! The file (safetensors) holds the configuration, `param.*`, `input.state`, `input.physics`, `target`, and what the other program
//! found: `output`, `loss` (mean over all elements of the squared error), `grad.param.*`, `grad.input.*`, and optionally
//! `adam1.param.*` after one Adam step. Everything is computed again in the file's precision, without dropout. This file
//! measures; what difference is too large is for the caller to say.

use super::architecture::Architecture;
use super::network::{LossRule, Network, OutputScale};
use super::safetensors::{Numbers, SafeTensors, Tensor};
use crate::error::{Error, Result};
use crate::tape::{Session, Threads};
use phyture_kernels::Real;
use phyture_kernels::adam::{self, Adam};
use phyture_kernels::instruction_set::InstructionSet;
use std::collections::BTreeMap;
use std::path::Path;

/// Its true gradient is zero (a softmax does not see a constant added to all keys): any value is rounding, and so is the sign
/// from which Adam takes its step.
const WITHOUT_GRADIENT: &str = ".key.bias";

/// Largest relative error of each tensor.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Parity {
    /// `f32` or `f64`, the file's.
    pub precision: &'static str,
    /// By tensor: largest absolute difference over the largest absolute reference value (over 1 if the reference is all zero).
    pub relative_error: BTreeMap<String, f64>,
    /// The largest of them.
    pub worst: Worst,
}

/// The tensor that is furthest off.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Worst {
    /// Its name.
    pub tensor: String,
    /// Its relative error; the largest finite number if something is not finite.
    pub relative_error: f64,
}

impl std::fmt::Display for Parity {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(f, "largest absolute difference over largest absolute reference value, computed in {}", self.precision)?;
        for group in ["output", "loss", "grad.input.", "grad.param.", "adam1.param."] {
            let errors = self.relative_error.iter().filter(|(tensor, _)| tensor.starts_with(group));
            let (count, largest) = errors.fold((0, 0.0_f64), |(count, largest), (_, error)| (count + 1, largest.max(*error)));
            if count > 0 {
                writeln!(f, "  {:<14} {count:>4} tensors   largest {largest:.2e}", group.trim_end_matches('.'))?;
            }
        }
        write!(f, "worst: {} {:.2e}", self.worst.tensor, self.worst.relative_error)
    }
}

/// Computes everything in a parity file again and compares.
///
/// # Errors
/// [`Error::Io`] and [`Error::File`] if the file cannot be read or lacks something, [`Error::Config`] if its configuration is wrong.
pub fn compare(path: &Path, threads: Threads) -> Result<Parity> {
    let file = SafeTensors::read(path)?;
    let fault = |message: String| Error::File { path: path.into(), message };
    let config =
        file.metadata.get("config").ok_or_else(|| fault("no `config` in the metadata; export it with the weights".into()))?;
    let architecture: Architecture =
        serde_json::from_str(config).map_err(|error| fault(format!("`config` in the metadata: {error}")))?;
    let run = match file.tensors.get("input.state").map(|tensor| &tensor.numbers) {
        Some(Numbers::F32(_)) => run::<f32>,
        Some(Numbers::F64(_)) => run::<f64>,
        None => return Err(fault("no tensor `input.state`; export the inputs with the weights".into())),
    };
    run(&file, &architecture, threads).map_err(|error| match error {
        Problem::File(message) => fault(message),
        Problem::Other(error) => error,
    })
}

enum Problem {
    File(String),
    Other(Error),
}

/// Whatever becomes an error of the crate.
impl<E: Into<Error>> From<E> for Problem {
    fn from(error: E) -> Self {
        Self::Other(error.into())
    }
}

/// The two precisions a file may have.
trait Precision: Real {
    const NAME: &'static str;
    fn numbers(numbers: &Numbers) -> Option<&[Self]>;
}

impl Precision for f32 {
    const NAME: &'static str = "f32";
    fn numbers(numbers: &Numbers) -> Option<&[Self]> {
        if let Numbers::F32(numbers) = numbers { Some(numbers) } else { None }
    }
}

impl Precision for f64 {
    const NAME: &'static str = "f64";
    fn numbers(numbers: &Numbers) -> Option<&[Self]> {
        if let Numbers::F64(numbers) = numbers { Some(numbers) } else { None }
    }
}

fn tensor<'a, T: Precision>(file: &'a SafeTensors, name: &str, shape: &[usize]) -> Result<&'a [T], Problem> {
    let Tensor { shape: found, numbers } = file.tensors.get(name).ok_or_else(|| Problem::File(format!("no tensor `{name}`")))?;
    if found != shape {
        return Err(Problem::File(format!("`{name}` has shape {found:?}; the configuration expects {shape:?}")));
    }
    T::numbers(numbers).ok_or_else(|| {
        Problem::File(format!("`{name}` is {}, but `input.state` is {}; one precision a file", numbers.dtype(), T::NAME))
    })
}

/// Tensors by the name they are compared under.
type Compared<'a, T> = BTreeMap<String, (Vec<T>, &'a [T])>;

fn run<T: Precision>(file: &SafeTensors, architecture: &Architecture, threads: Threads) -> Result<Parity, Problem> {
    let (history, horizon, outputs) = (architecture.history(), architecture.horizon(), architecture.outputs());
    let elements = horizon as f64 * outputs as f64;
    let rule = LossRule { scale: 1.0 / elements, standardise: false, input_gradients: true };
    let network = Network::<T>::record(architecture, &OutputScale::unit(outputs), rule)?;
    let samples = match file.tensors.get("input.state").map(|tensor| tensor.shape.as_slice()) {
        Some([samples, _, _]) if *samples > 0 => *samples,
        found => return Err(Problem::File(format!("`input.state` has shape {found:?}; expected [samples, history, channels]"))),
    };
    let inputs = [
        ("input.state", [samples, history, architecture.state_channels()]),
        ("input.physics", [samples, history, architecture.physics_channels()]),
        ("target", [samples, horizon, outputs]),
    ];
    let [state, physics, target] = inputs.map(|(name, shape)| tensor::<T>(file, name, &shape));
    let given = [state?, physics?, target?];
    // All of them are found before memory for them is asked for: the sizes are the file's claim.
    let of_file = network
        .parameters()
        .iter()
        .map(|parameter| Ok((parameter, tensor::<T>(file, &format!("param.{}", parameter.name), &parameter.file_lengths())?)));
    let of_file: Vec<_> = of_file.collect::<Result<_, Problem>>()?;
    let mut parameters = vec![T::ZERO; network.graph().parameter_count()];
    for (parameter, numbers) in of_file {
        parameter.put_file_order(numbers, &mut parameters);
    }
    let known = |name: &str| network.parameters().iter().any(|parameter| parameter.name == name);
    if let Some(name) = file.tensors.keys().filter_map(|name| name.strip_prefix("param.")).find(|name| !known(name)) {
        return Err(Problem::File(format!("`param.{name}` is no parameter of the network that the configuration describes")));
    }

    let mut session = Session::train(network.graph(), network.loss(), &[network.output()], threads)?;
    let loss = session.step(&parameters, samples, None, &|sample, inputs: &mut [&mut [T]]| {
        for (input, given) in inputs.iter_mut().zip(given) {
            let len = input.len();
            input.copy_from_slice(&given[sample * len..][..len]);
        }
    })?;

    let mut compared = Compared::<T>::new();
    let all = |of: &dyn Fn(usize) -> Result<Vec<T>>| (0..samples).map(of).collect::<Result<Vec<_>>>().map(|each| each.concat());
    let output = all(&|sample| Ok(session.output(0, sample)?.to_vec()))?;
    compared.insert("output".into(), (output, tensor(file, "output", &[samples, horizon, outputs])?));
    compared.insert("loss".into(), (vec![T::of(loss)], tensor(file, "loss", &[1])?));
    for (index, (name, shape)) in inputs.into_iter().take(2).enumerate() {
        let mut gradient = all(&|sample| Ok(session.input_gradient(index, sample)?.to_vec()))?;
        // Physics does not reach the loss of a network without physics.
        if gradient.is_empty() {
            gradient.resize(shape.iter().product(), T::ZERO);
        }
        compared.insert(format!("grad.{name}"), (gradient, tensor(file, &format!("grad.{name}"), &shape)?));
    }
    let with_gradient = network.parameters().iter().filter(|parameter| !parameter.name.ends_with(WITHOUT_GRADIENT));
    for parameter in with_gradient.clone() {
        let name = format!("grad.param.{}", parameter.name);
        let reference = tensor(file, &name, &parameter.file_lengths())?;
        compared.insert(name, (parameter.to_file_order(session.gradients()), reference));
    }
    if file.tensors.keys().any(|name| name.starts_with("adam1.")) {
        let isa = InstructionSet::detect().unwrap_or(InstructionSet::PLAIN);
        let (mut first, mut second) = (vec![T::ZERO; parameters.len()], vec![T::ZERO; parameters.len()]);
        adam::step(isa, &Adam::default(), 1, 1.0, session.gradients(), &mut parameters, (&mut first, &mut second));
        for parameter in with_gradient {
            let name = format!("adam1.param.{}", parameter.name);
            let reference = tensor(file, &name, &parameter.file_lengths())?;
            compared.insert(name, (parameter.to_file_order(&parameters), reference));
        }
    }
    let relative_error: BTreeMap<String, f64> =
        compared.into_iter().map(|(name, (found, reference))| (name, relative_error(&found, reference))).collect();
    let worst = relative_error.iter().max_by(|a, b| a.1.total_cmp(b.1));
    let worst = worst.map(|(tensor, &relative_error)| Worst { tensor: tensor.clone(), relative_error }).unwrap_or_default();
    Ok(Parity { precision: T::NAME, relative_error, worst })
}

/// Largest absolute difference over the largest absolute reference value.
fn relative_error<T: Real>(found: &[T], reference: &[T]) -> f64 {
    let scale = reference.iter().fold(0.0_f64, |scale, value| scale.max(value.f64().abs()));
    let difference = found.iter().zip(reference).map(|(a, b)| (a.f64() - b.f64()).abs()).fold(0.0, |worst: f64, difference| {
        // `max` would drop a NaN.
        if difference.is_nan() { f64::MAX } else { worst.max(difference) }
    });
    let relative = if scale > 0.0 { difference / scale } else { difference };
    if found.len() == reference.len() && relative.is_finite() { relative } else { f64::MAX }
}

#[cfg(test)]
mod tests {
    use super::super::config::{PhyTureConfig, Variant};
    use super::*;
    use phyture_kernels::random::Stream;

    fn small() -> PhyTureConfig {
        PhyTureConfig { history: 8, d_model: 4, heads: 2, levels: 1, stacks: 1, moving_average: 3, ..PhyTureConfig::default() }
    }

    /// A parity file whose references are this program's own, so that the reading and the bookkeeping are tested.
    fn own_file(variant: Variant) -> Result<SafeTensors> {
        let config = PhyTureConfig { variant, ..small() };
        let network = Network::<f64>::record(
            &config,
            &OutputScale::unit(6),
            LossRule { scale: 1.0 / 6.0, standardise: false, input_gradients: true },
        )?;
        let parameters = network.initial(3);
        let (mut file, samples) = (SafeTensors::default(), 3);
        let mut put = |name: &str, shape: &[usize], numbers: Vec<f64>| {
            file.tensors.insert(name.to_owned(), Tensor { shape: shape.to_vec(), numbers: Numbers::F64(numbers) });
        };
        let shapes = [("input.state", [samples, 8, 16]), ("input.physics", [samples, 8, 6]), ("target", [samples, 1, 6])];
        let mut given = Vec::new();
        for (index, (name, shape)) in shapes.into_iter().enumerate() {
            let stream = Stream::new(9, 0, 0, index as u64);
            let numbers: Vec<f64> = (0..shape.iter().product::<usize>()).map(|at| stream.uniform(at as u64) - 0.5).collect();
            put(name, &shape, numbers.clone());
            given.push(numbers);
        }
        let mut session = Session::train(network.graph(), network.loss(), &[network.output()], Threads(1))?;
        let loss = session.step(&parameters, samples, None, &|sample, inputs: &mut [&mut [f64]]| {
            for (input, given) in inputs.iter_mut().zip(&given) {
                let len = input.len();
                input.copy_from_slice(&given[sample * len..][..len]);
            }
        })?;
        let collect = |part: &dyn Fn(usize) -> crate::tape::Result<Vec<f64>>| {
            (0..samples).map(part).collect::<crate::tape::Result<Vec<_>>>().map(|each| each.concat())
        };
        put("loss", &[1], vec![loss]);
        put("output", &[samples, 1, 6], collect(&|sample| Ok(session.output(0, sample)?.to_vec()))?);
        for (index, (name, shape)) in shapes.into_iter().take(2).enumerate() {
            let mut gradient = collect(&|sample| Ok(session.input_gradient(index, sample)?.to_vec()))?;
            gradient.resize(shape.iter().product(), 0.0);
            put(&format!("grad.{name}"), &shape, gradient);
        }
        for parameter in network.parameters() {
            let shape = parameter.file_lengths();
            put(&format!("param.{}", parameter.name), &shape, parameter.to_file_order(&parameters));
            put(&format!("grad.param.{}", parameter.name), &shape, parameter.to_file_order(session.gradients()));
        }
        let config = serde_json::to_string(&config).map_err(|error| Error::Undetermined(error.to_string()))?;
        file.metadata.insert("config".into(), config);
        Ok(file)
    }

    fn compared(file: &SafeTensors) -> Result<Parity> {
        let folder = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
        let path = folder.path().join("parity.safetensors");
        file.write(&path)?;
        compare(&path, Threads(2))
    }

    #[test]
    fn a_file_of_our_own_agrees_to_the_last_bit_for_every_variant() -> Result<()> {
        for variant in Variant::ALL {
            let parity = compared(&own_file(variant)?)?;
            assert!(parity.relative_error.values().all(|&error| error == 0.0), "{variant:?}: {:?}", parity.worst);
            assert_eq!(
                parity.relative_error.contains_key("grad.param.paf.query.weight"),
                variant == Variant::PhyTure || variant.reads_physics() && variant.predicts_residual()
            );
            assert!(!parity.relative_error.contains_key("grad.param.paf.key.bias"));
        }
        Ok(())
    }

    #[test]
    fn a_wrong_reference_is_the_worst_tensor() -> Result<()> {
        let mut file = own_file(Variant::PhyTure)?;
        let name = "grad.param.tsdp.trend.weight";
        if let Some(Tensor { numbers: Numbers::F64(numbers), .. }) = file.tensors.get_mut(name) {
            let scale = numbers.iter().fold(0.0_f64, |scale, value| scale.max(value.abs()));
            let largest = numbers.iter().position(|value| value.abs() == scale).unwrap_or_default();
            let other = (largest + 1) % numbers.len();
            numbers[other] += 0.25 * scale.copysign(-numbers[other]);
        }
        let parity = compared(&file)?;
        assert_eq!(parity.worst.tensor, name);
        assert!((parity.worst.relative_error - 0.25).abs() < 1e-12, "{:?}", parity.worst);
        if let Some(Tensor { numbers: Numbers::F64(numbers), .. }) = file.tensors.get_mut("output") {
            numbers[0] = f64::NAN;
        }
        assert_eq!(compared(&file)?.worst, Worst { tensor: "output".into(), relative_error: f64::MAX });
        Ok(())
    }

    #[test]
    fn what_is_missing_or_superfluous_is_named() -> Result<()> {
        for missing in ["param.paf.state.weight", "input.physics", "input.state", "grad.input.state", "loss"] {
            let mut file = own_file(Variant::PhyTure)?;
            file.tensors.remove(missing);
            let text = compared(&file).err().map(|error| error.to_string()).unwrap_or_default();
            assert!(text.contains(missing), "{missing}: {text}");
        }
        let mut file = own_file(Variant::PhyTure)?;
        file.tensors.insert("param.extra".into(), Tensor { shape: vec![1], numbers: Numbers::F64(vec![0.0]) });
        assert!(compared(&file).err().is_some_and(|error| error.to_string().contains("param.extra")));
        file.metadata.clear();
        assert!(compared(&file).err().is_some_and(|error| error.to_string().contains("config")));
        Ok(())
    }
}
