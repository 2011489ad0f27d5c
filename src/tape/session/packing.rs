//! Weights in the form their kernels want, made once a step for all its samples.

use crate::tape::op::{Pack, Pass};
use crate::tape::plan::Step;
use crate::tape::threads::Parallelism;
use phyture_kernels::Real;
use phyture_kernels::instruction_set::InstructionSet;

/// Packs the weights of a list of steps, whose packed forms lie one after another from `start` on.
pub(super) fn pack<T: Real>(
    parallelism: Parallelism,
    steps: &[Step<T>],
    pass: Pass,
    isa: InstructionSet,
    parameters: &[T],
    start: usize,
    packed: &mut [T],
) {
    match steps {
        [] => {}
        [step] => {
            if let Some((weight, range)) = &step.packed {
                let (weight, packed) = (&parameters[weight.clone()], &mut packed[range.start - start..range.end - start]);
                step.op.pack(Pack { pass, weight, packed, shapes: &step.shapes, isa });
            }
        }
        _ => {
            let (low, high) = steps.split_at(steps.len() / 2);
            let middle = low.iter().rev().find_map(|step| step.packed.as_ref()).map_or(start, |(_, range)| range.end);
            let (low_packed, high_packed) = packed.split_at_mut(middle - start);
            parallelism.join(
                || pack(parallelism, low, pass, isa, parameters, start, low_packed),
                || pack(parallelism, high, pass, isa, parameters, middle, high_packed),
            );
        }
    }
}
