//! The weight of a general convolution as its products want it: in panels, packed by the call or once for many calls.
//!
//! Not here: any arithmetic.

use super::Geometry;
use crate::instruction_set::{InstructionSet, Isa, Tiled};
use crate::{Real, tile};

/// Numbers of a weight packed by [`pack`]; by [`pack_adjoint`] with inputs and outputs exchanged.
pub const fn packed_len(geometry: Geometry, inputs: usize, outputs: usize) -> usize {
    tile::panels_len(geometry.taps * inputs, outputs)
}

/// Packs a weight `[out, in, taps]` for [`forward`](super::forward).
///
/// # Panics
/// If lengths disagree.
pub fn pack<T: Real>(isa: InstructionSet, geometry: Geometry, (inputs, outputs): (usize, usize), weight: &[T], packed: &mut [T]) {
    assert_eq!(weight.len(), geometry.taps * inputs * outputs, "conv1d_general: length of the weight");
    T::conv1d_general_pack(isa, Pack { geometry, inputs, outputs, weight, packed, adjoint: false });
}

/// Packs a weight `[out, in, taps]` for [`backward_input`](super::backward_input).
///
/// # Panics
/// If lengths disagree.
pub fn pack_adjoint<T: Real>(
    isa: InstructionSet,
    geometry: Geometry,
    (inputs, outputs): (usize, usize),
    weight: &[T],
    packed: &mut [T],
) {
    assert_eq!(weight.len(), geometry.taps * inputs * outputs, "conv1d_general: length of the weight");
    T::conv1d_general_pack(isa, Pack { geometry, inputs, outputs, weight, packed, adjoint: true });
}

pub(crate) struct Pack<'a, T> {
    geometry: Geometry,
    inputs: usize,
    outputs: usize,
    weight: &'a [T],
    packed: &'a mut [T],
    adjoint: bool,
}

impl<T: Real> Tiled<T> for Pack<'_, T> {
    #[inline(always)]
    fn run<I: Isa, const MR: usize, const NR: usize>(self) {
        let Self { geometry, inputs, outputs, weight, packed, adjoint } = self;
        let taps = geometry.taps;
        if weight.is_empty() {
            return;
        }
        if !adjoint {
            let panels = &mut packed[..taps * inputs * outputs.next_multiple_of(NR)];
            for j in 0..taps {
                let row = |o: usize| &weight[o * inputs * taps + j..(o + 1) * inputs * taps];
                tile::pack_transposed::<T, NR>(inputs, outputs, taps, row, taps * inputs * NR, &mut panels[j * inputs * NR..]);
            }
            return;
        }
        // One product's panels behind the other's.
        let mut rest = packed;
        for remainder in 0..geometry.stride {
            let reading = geometry.reading(remainder);
            let count = reading.clone().count();
            let (panels, behind) = rest.split_at_mut(count * outputs * inputs.next_multiple_of(NR));
            rest = behind;
            for (place, j) in reading.enumerate() {
                let row = |c: usize| &weight[c * taps + j..];
                let panels = &mut panels[place * outputs * NR..];
                tile::pack_transposed::<T, NR>(outputs, inputs, inputs * taps, row, count * outputs * NR, panels);
            }
        }
    }
}
