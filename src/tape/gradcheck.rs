//! Checks of backward passes against differences of the forward pass, in f64, and of what every backward pass must satisfy.
//!
//! For one operation ([`operation`]): the full Jacobian for small shapes and directional derivatives otherwise, `Set` and `Add`,
//! linearity in dy, f32 against f64, every instruction-set level, the forward pass in pieces, and buffers full of NaN where nothing may be read. For a
//! whole graph ([`graph`]): directional derivatives along every parameter tensor. The numeric derivative is the four-point
//! central difference (Richardson's extrapolation of the two-point one) at two steps; where the two disagree there is a kink
//! between the points, and another point is drawn. This file knows no operation.

use super::op::{Backward, Differentiable, Forward, Gradient, MAX_OPERANDS, Op};
use super::slab::Slabs;
use super::threads::Parallelism;
use super::{DropoutKey, Fill, Graph, Parts, Session, Shape, Threads, Var};
use crate::tape::error::Error;
use phyture_kernels::instruction_set::InstructionSet;
use phyture_kernels::random::Stream;
use phyture_kernels::{Real, Tolerance, Write};
use std::fmt;

/// Step of the central difference for operands of order one: truncation h⁴/30·f⁽⁵⁾ and rounding ε·f/h are both near 1e-13.
const STEP: f64 = 1e-3;

/// Step for a whole graph along a direction of unit length: small, because thousands of rectifiers have their kinks somewhere.
const GRAPH_STEP: f64 = 3e-5;

/// Draws at ever smaller steps: the step is divided by three up to this many times, then starts again.
const STEP_SIZES: u64 = 3;

/// Smallest gradient norm that the derivative along a tensor is measured in: below it, rounding of the loss would show.
const SMALLEST_NORM: f64 = 1e-3;

/// Points drawn before giving up on finding one away from every kink.
const ATTEMPTS: u64 = 8;

/// Up to this many pieces of a forward pass are compared with the whole.
const MOST_PIECES: usize = 3;

/// Up to this many elements of operand times result, the full Jacobian is compared.
const FULL_JACOBIAN: usize = 200;

/// A backward pass that is not the derivative of its forward pass, or breaks a rule.
#[derive(Clone, Debug, PartialEq)]
pub struct Disagreement {
    /// Operation or parameter.
    pub subject: String,
    /// What was compared, and by how much it is off.
    pub message: String,
}

impl fmt::Display for Disagreement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.subject, self.message)
    }
}

impl std::error::Error for Disagreement {}

impl From<Error> for Disagreement {
    fn from(error: Error) -> Self {
        Self { subject: "gradient check".into(), message: error.to_string() }
    }
}

/// Result of a check.
pub type Checked = Result<(), Disagreement>;

/// Numbers of magnitude 0.2 to 1.2 and either sign: away from the kink at 0.
fn numbers<T: Real>(stream: Stream, count: usize) -> Vec<T> {
    let number = |index: u64| {
        let magnitude = 0.2 + stream.uniform(2 * index);
        if stream.uniform(2 * index + 1) < 0.5 { -magnitude } else { magnitude }
    };
    // Rounded to f32, so that both precisions get the same operands.
    (0..count as u64).map(|index| T::of(f64::from(number(index) as f32))).collect()
}

/// Largest difference over the largest reference magnitude, never below one unit; infinite, never NaN, for numbers that are not finite or other lengths.
fn distance<A: Real, B: Real>(found: &[A], expected: &[B]) -> f64 {
    if found.len() != expected.len() {
        return f64::INFINITY;
    }
    let scale = expected.iter().fold(1.0_f64, |scale, value| scale.max(value.f64().abs()));
    let worst = |worst: f64, (a, b): (&A, &B)| {
        let difference = (a.f64() - b.f64()).abs();
        if difference.is_nan() { f64::INFINITY } else { worst.max(difference) }
    };
    let relative = found.iter().zip(expected).fold(0.0, worst) / scale;
    if relative.is_nan() { f64::INFINITY } else { relative }
}

/// One operation at fixed shapes: plain calls without graph or session.
struct Trial<'a, T: Real> {
    op: &'a dyn Op<T>,
    shapes: Vec<Shape>,
    result: Shape,
    isa: InstructionSet,
    stream: Option<Stream>,
}

impl<'a, T: Real> Trial<'a, T> {
    fn new(op: &'a dyn Op<T>, operands: &[&[usize]], isa: InstructionSet, stream: Option<Stream>) -> Result<Self, Disagreement> {
        let shapes = operands.iter().map(|lengths| Shape::new("gradient check", lengths)).collect::<Result<Vec<_>, _>>()?;
        let result = op.shape(&shapes)?;
        Ok(Self { op, shapes, result, isa, stream })
    }

    fn fault(&self, message: String) -> Disagreement {
        Disagreement { subject: format!("{}{:?} at level {}", self.op.name(), self.shapes, self.isa), message }
    }

    fn differentiable(&self) -> Result<&'a dyn Differentiable<T>, Disagreement> {
        self.op.differentiable().ok_or_else(|| self.fault("no backward pass to check".into()))
    }

    fn operands(&self, seed: u64) -> Vec<Vec<T>> {
        let stream = Stream::new(seed, 0, 0, 0);
        self.shapes.iter().enumerate().map(|(index, shape)| numbers(stream.sub(index as u64), shape.len())).collect()
    }

    /// Result and workspace; both start as NaN, and so does the scratch.
    fn forward(&self, x: &[Vec<T>]) -> (Vec<T>, Vec<T>) {
        self.forward_in(Parts::ONE, x)
    }

    fn forward_in(&self, parts: Parts<'_, T>, x: &[Vec<T>]) -> (Vec<T>, Vec<T>) {
        let memory = self.op.memory(&self.shapes);
        let nan = |len| vec![T::NAN; len];
        let (mut y, mut workspace, mut scratch) = (nan(self.result.len()), nan(memory.workspace), nan(memory.forward_scratch));
        self.op.forward(Forward {
            x: std::array::from_fn(|index| x.get(index).map(Vec::as_slice).unwrap_or_default()),
            y: &mut y,
            workspace: &mut workspace,
            scratch: &mut scratch,
            // Networks' own checks run with packed weights.
            packed: &[],
            shapes: &self.shapes,
            isa: self.isa,
            parts,
            stream: self.stream,
            coupled: None,
        });
        (y, workspace)
    }

    /// Gradients of all operands, set into buffers of NaN or added to `start`.
    fn backward(&self, x: &[Vec<T>], dy: &[T], start: Option<&[Vec<T>]>) -> Result<Vec<Vec<T>>, Disagreement> {
        let differentiable = self.differentiable()?;
        let (y, workspace) = self.forward(x);
        let reads = differentiable.reads();
        let mut scratch = vec![T::NAN; self.op.memory(&self.shapes).backward_scratch];
        let fresh = || self.shapes.iter().map(|shape| vec![T::NAN; shape.len()]).collect();
        let mut dx: Vec<Vec<T>> = start.map_or_else(fresh, <[Vec<T>]>::to_vec);
        let write = if start.is_some() { Write::Add } else { Write::Set };
        let mut slots: [Option<Gradient<'_, T>>; MAX_OPERANDS] = [const { None }; MAX_OPERANDS];
        for (index, (slot, values)) in slots.iter_mut().zip(&mut dx).enumerate() {
            *slot = differentiable.reaches(index).then_some(Gradient { values, write });
        }
        differentiable.backward(Backward {
            x: std::array::from_fn(|index| x.get(index).filter(|_| reads.operands[index]).map(Vec::as_slice).unwrap_or_default()),
            y: if reads.result { &y } else { &[] },
            dy,
            workspace: &workspace,
            dx: slots,
            scratch: &mut scratch,
            // Networks' own checks run with packed weights.
            packed: &[],
            shapes: &self.shapes,
            isa: self.isa,
            stream: self.stream,
            coupled: None,
        });
        (0..dx.len()).filter(|&index| !differentiable.reaches(index)).for_each(|index| dx[index].fill(T::ZERO));
        Ok(dx)
    }
}

/// Four-point central difference of a vector function along the line ε ↦ f(ε); `None` where two steps disagree.
fn derivative(step: f64, f: &mut dyn FnMut(f64) -> Vec<f64>) -> Option<Vec<f64>> {
    let mut at = |h: f64| -> Vec<f64> {
        let (near, far) = ([f(h), f(-h)], [f(2.0 * h), f(-2.0 * h)]);
        let [plus, minus] = &near;
        let [far_plus, far_minus] = &far;
        (0..plus.len()).map(|i| (8.0 * (plus[i] - minus[i]) - (far_plus[i] - far_minus[i])) / (12.0 * h)).collect()
    };
    let (coarse, fine) = (at(step), at(step / 2.0));
    // Half the bound of the comparison is left to the backward pass.
    (distance(&fine, &coarse) < Tolerance::Approximate.relative_f64() / 2.0).then_some(fine)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// All checks of one operation at one set of operand shapes.
///
/// # Errors
/// The first [`Disagreement`].
pub fn operation<O: Op<f64> + Op<f32>>(op: &O, operands: &[&[usize]]) -> Checked {
    let random = Some(Stream::new(7, 0, 0, 0));
    for isa in InstructionSet::available() {
        for stream in [None, random] {
            let double = Trial::<f64>::new(op, operands, isa, stream)?;
            jacobian(&double)?;
            rules(&double)?;
            let single = Trial::<f32>::new(op, operands, isa, stream)?;
            precision(&double, &single)?;
            pieces(&double)?;
            pieces(&single)?;
        }
    }
    Ok(())
}

/// Backward against numeric derivative: all of the Jacobian if small, else random directions and weights.
fn jacobian(trial: &Trial<'_, f64>) -> Checked {
    let differentiable = trial.differentiable()?;
    for (operand, shape) in trial.shapes.iter().enumerate().filter(|(operand, _)| differentiable.reaches(*operand)) {
        let full = shape.len() * trial.result.len() <= FULL_JACOBIAN;
        let directions: Vec<Vec<f64>> = if full {
            (0..shape.len()).map(|one| (0..shape.len()).map(|at| f64::from(u8::from(at == one))).collect()).collect()
        } else {
            (0..3).map(|index| numbers(Stream::new(11, operand as u64, index, 0), shape.len())).collect()
        };
        let found = (0..ATTEMPTS).find_map(|attempt| {
            let x = trial.operands(attempt);
            let along = |direction: &Vec<f64>| {
                derivative(STEP, &mut |step| {
                    let mut moved = x.clone();
                    moved[operand].iter_mut().zip(direction).for_each(|(x, direction)| *x += step * direction);
                    trial.forward(&moved).0
                })
            };
            Some((directions.iter().map(along).collect::<Option<Vec<_>>>()?, x))
        });
        let Some((numeric, x)) = found else {
            return Err(trial.fault(format!("no smooth point for operand {operand} in {ATTEMPTS} draws")));
        };
        let weights: Vec<Vec<f64>> = if full {
            (0..trial.result.len()).map(|one| (0..trial.result.len()).map(|at| f64::from(u8::from(at == one))).collect()).collect()
        } else {
            (0..3).map(|index| numbers(Stream::new(13, operand as u64, index, 0), trial.result.len())).collect()
        };
        for (row, dy) in weights.iter().enumerate() {
            let dx = trial.backward(&x, dy, None)?;
            let analytic: Vec<f64> = directions.iter().map(|direction| dot(&dx[operand], direction)).collect();
            let expected: Vec<f64> = numeric.iter().map(|column| dot(column, dy)).collect();
            let off = distance(&analytic, &expected);
            if off > Tolerance::Approximate.relative_f64() {
                let kind = if full { "Jacobian row" } else { "directional derivative" };
                return Err(
                    trial.fault(format!("operand {operand}, {kind} {row}: off by {off:e}: {analytic:?} against {expected:?}"))
                );
            }
        }
    }
    Ok(())
}

/// Adding to a buffer of numbers gives their sum with what setting gives; the backward pass is linear in dy.
fn rules(trial: &Trial<'_, f64>) -> Checked {
    let x = trial.operands(1);
    let weights = |index| numbers::<f64>(Stream::new(17, 0, index, 0), trial.result.len());
    let (first, second) = (weights(0), weights(1));
    let set = trial.backward(&x, &first, None)?;
    let twice = trial.backward(&x, &first, Some(&set))?;
    let other = trial.backward(&x, &second, None)?;
    let mixed: Vec<f64> = first.iter().zip(&second).map(|(a, b)| 2.0 * a - 3.0 * b).collect();
    let mixed = trial.backward(&x, &mixed, None)?;
    for (operand, set) in set.iter().enumerate() {
        let double: Vec<f64> = set.iter().map(|value| 2.0 * value).collect();
        let combined: Vec<f64> = set.iter().zip(&other[operand]).map(|(a, b)| 2.0 * a - 3.0 * b).collect();
        for (rule, found, expected) in [("set, then add", &twice[operand], double), ("linear in dy", &mixed[operand], combined)] {
            let off = distance(found, &expected);
            if off > Tolerance::Close.relative_f64() {
                return Err(trial.fault(format!("operand {operand}: {rule}: off by {off:e}")));
            }
        }
    }
    Ok(())
}

/// f32 against f64 of the same source on the same operands.
fn precision(double: &Trial<'_, f64>, single: &Trial<'_, f32>) -> Checked {
    let (x, x_single) = (double.operands(2), single.operands(2));
    let weights = Stream::new(19, 0, 0, 0);
    let dx = double.backward(&x, &numbers(weights, double.result.len()), None)?;
    let dx_single = single.backward(&x_single, &numbers(weights, single.result.len()), None)?;
    let forward = distance(&single.forward(&x_single).0, &double.forward(&x).0);
    let worst = dx_single.iter().zip(&dx).map(|(single, double)| distance(single, double)).fold(forward, f64::max);
    if worst <= Tolerance::Approximate.relative_f32() {
        Ok(())
    } else {
        Err(double.fault(format!("f32 against f64: off by {worst:e}")))
    }
}

/// The forward pass has the same bits in pieces as in one.
fn pieces<T: Real>(trial: &Trial<'_, T>) -> Checked {
    let x = trial.operands(3);
    let (y, workspace) = trial.forward(&x);
    for count in 2..=MOST_PIECES {
        let slabs = Slabs::new(count, trial.op.memory(&trial.shapes).forward_scratch);
        let cut = trial.forward_in(Parts::of(Parallelism::Sequential, &slabs, 1), &x);
        let pairs = cut.0.iter().zip(&y).chain(cut.1.iter().zip(&workspace));
        if pairs.into_iter().any(|(cut, whole)| cut.f64().to_bits() != whole.f64().to_bits()) {
            return Err(trial.fault(format!("other bits in {count} pieces than in one")));
        }
    }
    Ok(())
}

/// What the mean loss of a step depends on, as a session is given it.
#[derive(Clone, Copy)]
pub struct LossOf<'a> {
    /// The graph.
    pub graph: &'a Graph<f64>,
    /// Its loss.
    pub loss: Var,
    /// The flat slab.
    pub parameters: &'a [f64],
    /// Samples of the step.
    pub samples: usize,
    /// Of the random parts; `None` switches them off.
    pub dropout: Option<DropoutKey>,
    /// Fills the inputs of a sample.
    pub fill: Fill<'a, f64>,
}

/// Gradients of a whole graph's mean loss: directional derivatives along each parameter tensor, and along all at once.
///
/// # Errors
/// The first [`Disagreement`], naming the parameter; also if a parameter's gradient is not finite, or is zero where `zero` of
/// its name is false, or the reverse (a bias of keys, for example, has none: softmax does not see it).
pub fn graph(of: &LossOf<'_>, zero: &dyn Fn(&str) -> bool, seed: u64) -> Checked {
    let LossOf { graph, loss, parameters, samples, dropout, fill } = *of;
    let mut session = Session::train(graph, loss, &[], Threads(1))?;
    session.set_poison(true);
    session.step(parameters, samples, dropout, fill)?;
    let gradients = session.gradients().to_vec();
    // The loss is computed by the other plan, which keeps nothing for a backward pass.
    let mut values = Session::infer(graph, &[loss], Threads(1))?;
    values.set_poison(true);
    let mut moved = parameters.to_vec();
    let tensors = graph.parameters().iter().map(|parameter| (parameter.name.as_str(), parameter.range()));
    for (index, (name, range)) in tensors.chain([("all parameters", 0..parameters.len())]).enumerate() {
        let fault = |message: String| Disagreement { subject: name.to_owned(), message };
        let own = &gradients[range.clone()];
        let is_zero = own.iter().all(|value| value.abs() < Tolerance::Close.relative_f64());
        if own.iter().any(|value| !value.is_finite()) || is_zero != zero(name) {
            return Err(fault("the gradient is not finite, or is zero where it must not be (or the reverse)".into()));
        }
        // Half along the gradient, so that the derivative is of its order, half at random; of unit length.
        let norm = if is_zero { 1.0 } else { dot(own, own).sqrt().max(SMALLEST_NORM) };
        let direction = |attempt: u64| {
            let random: Vec<f64> = numbers(Stream::new(seed, index as u64, attempt, 0), range.len());
            let length = dot(&random, &random).sqrt();
            let mixed: Vec<f64> = own.iter().zip(&random).map(|(own, random)| own / norm + random / length).collect();
            let length = dot(&mixed, &mixed).sqrt();
            mixed.into_iter().map(|value| value / length).collect::<Vec<f64>>()
        };
        let mut result = None;
        for attempt in 0..ATTEMPTS {
            let direction = direction(attempt);
            let mut failure = None;
            let step = GRAPH_STEP / 3_f64.powi((attempt % STEP_SIZES) as i32);
            let numeric = derivative(step, &mut |step| {
                for ((to, from), direction) in moved[range.clone()].iter_mut().zip(&parameters[range.clone()]).zip(&direction) {
                    *to = from + step * direction;
                }
                let mut run = || -> Result<f64, Error> {
                    values.step(&moved, samples, dropout, fill)?;
                    let each = (0..samples).map(|sample| values.output(0, sample).map(|loss| loss.iter().sum::<f64>()));
                    each.sum()
                };
                let sum = run().unwrap_or_else(|error| {
                    failure = Some(error);
                    f64::NAN
                });
                vec![sum / (samples as f64 * norm)]
            });
            moved[range.clone()].copy_from_slice(&parameters[range.clone()]);
            if let Some(error) = failure {
                return Err(error.into());
            }
            if let Some(numeric) = numeric {
                result = Some((dot(own, &direction) / norm, numeric));
                break;
            }
        }
        let Some((analytic, numeric)) = result else {
            return Err(fault(format!("no smooth direction in {ATTEMPTS} draws")));
        };
        let off = distance(&[analytic], &numeric);
        if off > Tolerance::Approximate.relative_f64() {
            return Err(fault(format!("directional derivative off by {off:e}: {analytic:e} against {numeric:?}")));
        }
    }
    Ok(())
}

/// One test of an operation at one or several sets of operand shapes: `gradcheck!(name: operation, [[7, 64], [64]]);`
#[cfg(test)]
macro_rules! gradcheck {
    ($name:ident: $op:expr, $([$([$($length:expr),+]),+]),+ $(,)?) => {
        #[test]
        fn $name() {
            for shapes in [$(&[$(&[$($length),+][..]),+][..]),+] {
                if let Err(disagreement) = $crate::tape::gradcheck::operation(&$op, shapes) {
                    panic!("{disagreement}");
                }
            }
        }
    };
}

#[cfg(test)]
mod tests {
    use super::super::op::Reads;
    use super::super::ops::{Add, Linear};
    use super::*;
    use crate::tape::error::Result;

    /// A backward pass with one planted fault.
    #[derive(Clone, Copy, Debug)]
    enum Fault {
        /// One gradient is a thousandth too large.
        Scaled(usize),
        /// One gradient is not written at all.
        Dropped(usize),
        /// One element of one gradient has the wrong sign.
        Flipped(usize),
        /// Adds where it should set.
        NeverSets(usize),
        /// Sets where it should add.
        NeverAdds(usize),
        /// Adds a constant: no longer linear in dy.
        Offset(usize),
    }

    struct Broken<O> {
        op: O,
        fault: Fault,
    }

    impl<T: Real, O: Op<T>> Op<T> for Broken<O> {
        fn name(&self) -> &'static str {
            self.op.name()
        }
        fn shape(&self, operands: &[Shape]) -> Result<Shape> {
            self.op.shape(operands)
        }
        fn memory(&self, operands: &[Shape]) -> super::super::op::Memory {
            self.op.memory(operands)
        }
        fn forward(&self, io: Forward<'_, T>) {
            self.op.forward(io);
        }
        fn differentiable(&self) -> Option<&dyn Differentiable<T>> {
            Some(self)
        }
    }

    impl<T: Real, O: Op<T>> Differentiable<T> for Broken<O> {
        fn reads(&self) -> Reads {
            self.op.differentiable().map(|inner| inner.reads()).unwrap_or_default()
        }
        fn backward(&self, io: Backward<'_, T>) {
            let Backward { x, y, dy, workspace, mut dx, scratch, packed, shapes, isa, stream, coupled } = io;
            let Some(inner) = self.op.differentiable() else { return };
            let (Fault::Scaled(at)
            | Fault::Dropped(at)
            | Fault::Flipped(at)
            | Fault::NeverSets(at)
            | Fault::NeverAdds(at)
            | Fault::Offset(at)) = self.fault;
            let Some(target) = dx[at].take() else { return };
            let mut own = vec![T::ZERO; target.values.len()];
            let mut slots: [Option<Gradient<'_, T>>; MAX_OPERANDS] = dx;
            slots[at] = Some(Gradient { values: &mut own, write: Write::Set });
            inner.backward(Backward { x, y, dy, workspace, dx: slots, scratch, packed, shapes, isa, stream, coupled });
            let write = match self.fault {
                Fault::Dropped(_) => return,
                Fault::NeverSets(_) => Write::Add,
                Fault::NeverAdds(_) => Write::Set,
                _ => target.write,
            };
            match self.fault {
                Fault::Scaled(_) => own.iter_mut().for_each(|value| *value *= T::of(1.001)),
                Fault::Flipped(_) => own.iter_mut().take(1).for_each(|value| *value = -*value),
                Fault::Offset(_) => own.iter_mut().for_each(|value| *value += T::of(0.01)),
                _ => {}
            }
            for (to, from) in target.values.iter_mut().zip(own) {
                match write {
                    Write::Set => *to = from,
                    Write::Add => *to += from,
                }
            }
        }
    }

    #[test]
    fn every_planted_fault_is_found_in_small_and_large_shapes() {
        for shapes in [[&[3, 4][..], &[2, 4], &[2]], [&[20, 8], &[6, 8], &[6]]] {
            assert_eq!(operation(&Linear, &shapes), Ok(()));
            for operand in 0..3 {
                for fault in [
                    Fault::Scaled(operand),
                    Fault::Dropped(operand),
                    Fault::Flipped(operand),
                    Fault::NeverSets(operand),
                    Fault::NeverAdds(operand),
                    Fault::Offset(operand),
                ] {
                    assert!(operation(&Broken { op: Linear, fault }, &shapes).is_err(), "{fault:?} passed at {shapes:?}");
                }
            }
        }
    }

    #[test]
    fn a_fault_inside_a_graph_is_found() -> Result<()> {
        for (fault, fine) in [(None, true), (Some(Fault::Scaled(1)), false), (Some(Fault::Dropped(2)), false)] {
            let mut recorded = Graph::<f64>::new();
            let x = recorded.input("x", &[5, 3])?;
            let (weight, bias) = (recorded.parameter("weight", &[3, 3])?, recorded.parameter("bias", &[3])?);
            let y = match fault {
                Some(fault) => recorded.apply(Broken { op: Linear, fault }, &[x, weight, bias])?,
                None => recorded.apply(Linear, &[x, weight, bias])?,
            };
            let y = recorded.apply(Add, &[y, y])?;
            let target = recorded.input("target", &[5, 3])?;
            let loss = recorded.apply(super::super::ops::SquaredError { scale: 1.0 }, &[y, target])?;
            let fill = |sample: usize, inputs: &mut [&mut [f64]]| {
                for (index, input) in inputs.iter_mut().enumerate() {
                    input.copy_from_slice(&numbers::<f64>(Stream::new(5, 0, index as u64, sample as u64), input.len()));
                }
            };
            let parameters = numbers::<f64>(Stream::new(3, 0, 0, 0), recorded.parameter_count());
            let of = LossOf { graph: &recorded, loss, parameters: &parameters, samples: 3, dropout: None, fill: &fill };
            let checked = graph(&of, &|_| false, 1);
            assert_eq!(checked.is_ok(), fine, "{fault:?}: {checked:?}");
        }
        Ok(())
    }
}
