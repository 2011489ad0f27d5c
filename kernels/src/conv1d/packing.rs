//! The weight of a convolution as its products want it: in panels, packed by the call or once for many calls.
//!
//! Not here: any arithmetic.

use super::{Geometry, winograd};
use crate::instruction_set::{InstructionSet, Isa, Tiled};
use crate::{Real, Rows, tile};

/// Numbers of a weight packed by [`pack`]; by [`pack_transposed`] with inputs and outputs exchanged.
pub const fn packed_len(geometry: Geometry, inputs: usize, outputs: usize) -> usize {
    if winograd::applies(geometry, inputs, outputs) {
        winograd::packed_len(inputs, outputs)
    } else {
        tile::panels_len(geometry.taps * inputs, outputs)
    }
}

/// A weight in the layout of its convolution, `[taps, in, out]` or `[out, in, taps]`, as it is or as packed once for many calls.
#[derive(Clone, Copy, Debug)]
pub enum Weight<'a, T> {
    /// Packed by the call, in its scratch.
    Plain(&'a [T]),
    /// At the same level, for the pass that it is given to: by [`pack`] for [`forward`](super::forward), by [`pack_transposed`] for
    /// [`backward_input`](super::backward_input), or by their like of [`conv1d_general`](crate::conv1d_general).
    Packed(&'a [T]),
}

impl<'a, T> Weight<'a, T> {
    /// The packed weight, by `pack` into the first `len` numbers of the scratch where it is not yet; and the rest of the scratch.
    pub(crate) fn panels(self, len: usize, scratch: &'a mut [T], pack: impl FnOnce(&[T], &mut [T])) -> (&'a [T], &'a mut [T]) {
        let weight = match self {
            Self::Packed(packed) => return (packed, scratch),
            Self::Plain(weight) => weight,
        };
        let (packed, rest) = scratch.split_at_mut(len);
        pack(weight, packed);
        (packed, rest)
    }
}

/// Packs a weight for [`forward`](super::forward).
///
/// # Panics
/// If lengths disagree.
pub fn pack<T: Real>(isa: InstructionSet, geometry: Geometry, (inputs, outputs): (usize, usize), weight: &[T], packed: &mut [T]) {
    assert_eq!(weight.len(), geometry.taps * inputs * outputs, "conv1d: length of the weight");
    T::conv1d_pack(isa, Pack { geometry, inputs, outputs, weight, packed, transposed: false });
}

/// Packs a weight for [`backward_input`](super::backward_input).
///
/// # Panics
/// If lengths disagree.
pub fn pack_transposed<T: Real>(
    isa: InstructionSet,
    geometry: Geometry,
    (inputs, outputs): (usize, usize),
    weight: &[T],
    packed: &mut [T],
) {
    assert_eq!(weight.len(), geometry.taps * inputs * outputs, "conv1d: length of the weight");
    T::conv1d_pack(isa, Pack { geometry, inputs, outputs, weight, packed, transposed: true });
}

/// The weight packed for [`forward`](super::forward), or for [`backward_input`](super::backward_input) if `transposed`, in the scratch where it is not yet; and
/// the rest of the scratch.
pub(super) fn panels<'a, T: Real>(
    isa: InstructionSet,
    geometry: Geometry,
    (inputs, outputs): (usize, usize),
    (weight, transposed): (Weight<'a, T>, bool),
    scratch: &'a mut [T],
) -> (&'a [T], &'a mut [T]) {
    let (reads, writes) = if transposed { (outputs, inputs) } else { (inputs, outputs) };
    let pack = if transposed { pack_transposed } else { pack };
    weight.panels(packed_len(geometry, reads, writes), scratch, |weight, packed| {
        pack(isa, geometry, (inputs, outputs), weight, packed);
    })
}

pub(crate) struct Pack<'a, T> {
    geometry: Geometry,
    inputs: usize,
    outputs: usize,
    weight: &'a [T],
    packed: &'a mut [T],
    transposed: bool,
}

impl<T: Real> Tiled<T> for Pack<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        let Self { geometry, inputs, outputs, weight, packed, transposed } = self;
        let Geometry { taps, .. } = geometry;
        if weight.is_empty() {
            return;
        }
        if winograd::applies(geometry, inputs, outputs) {
            let packed = &mut packed[..winograd::packed_len(inputs, outputs)];
            // Called by name: through a pointer they would be compiled without the level's instructions.
            return if transposed {
                winograd::pack_transposed::<T, I, NR>(taps, inputs, outputs, weight, packed)
            } else {
                winograd::pack::<T, I, NR>(taps, inputs, outputs, weight, packed)
            };
        }
        if !transposed {
            let panels = &mut packed[..taps * inputs * outputs.next_multiple_of(NR)];
            return tile::pack::<T, NR>(Rows::packed(weight, taps * inputs, outputs), panels);
        }
        let panels = &mut packed[..taps * outputs * inputs.next_multiple_of(NR)];
        for j in 0..taps {
            let row = |c: usize| &weight[(j * inputs + c) * outputs..][..outputs];
            tile::pack_transposed::<T, NR>(outputs, inputs, 1, row, taps * outputs * NR, &mut panels[j * outputs * NR..]);
        }
    }
}
