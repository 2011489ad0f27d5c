//! Every kernel, compiled here: once for f32 and once for f64, at each instruction-set level.
//!
//! A generic function is compiled by the crate that calls it, and again by each crate that calls that one. The bodies of kernels
//! are large loops, unrolled for each level; so they are made concrete in this one place, and the generic functions around them,
//! which check shapes, are all that a caller compiles.
//!
//! To add a kernel: one line in the table below.

use crate::instruction_set::InstructionSet;
use crate::{
    activation, adam, attention, batch_norm, conv1d, conv1d_general, dropout, elementary, fold, gemm, layer_norm, linear, loss,
    lstm, moving_average, pool, prob_sparse, sci, spectrum, strided, temporal, temporal_each, weight_norm,
};

macro_rules! kernels {
    (loops { $($loop:ident: $loop_module:ident::$loop_kernel:ident,)* } tiles { $($tile:ident: $tile_module:ident::$tile_kernel:ident,)* }) => {
        /// The kernels of one float type. A supertrait of [`Real`](crate::Real); not for use outside this crate.
        #[expect(private_interfaces, reason = "the kernels' types are this crate's own; nobody else can call these")]
        pub trait Compiled: Sized {
            $(#[doc(hidden)] fn $loop(isa: InstructionSet, kernel: $loop_module::$loop_kernel<'_, Self>);)*
            $(#[doc(hidden)] fn $tile(isa: InstructionSet, kernel: $tile_module::$tile_kernel<'_, Self>);)*
        }
        kernels!(@for f32 loops { $($loop: $loop_module::$loop_kernel,)* } tiles { $($tile: $tile_module::$tile_kernel,)* });
        kernels!(@for f64 loops { $($loop: $loop_module::$loop_kernel,)* } tiles { $($tile: $tile_module::$tile_kernel,)* });
    };
    (@for $t:ident loops { $($loop:ident: $loop_module:ident::$loop_kernel:ident,)* } tiles { $($tile:ident: $tile_module:ident::$tile_kernel:ident,)* }) => {
        #[expect(private_interfaces, reason = "as above")]
        impl Compiled for $t {
            $(#[inline(never)] fn $loop(isa: InstructionSet, kernel: $loop_module::$loop_kernel<'_, Self>) { isa.run(kernel); })*
            $(#[inline(never)] fn $tile(isa: InstructionSet, kernel: $tile_module::$tile_kernel<'_, Self>) { isa.run_tiled::<Self, _>(kernel); })*
        }
    };
}

kernels! {
    loops {
        activation_forward: activation::Forward,
        activation_backward: activation::Backward,
        adam_step: adam::Step,
        conv1d_backward_epilogue: conv1d::BackwardEpilogue,
        dropout_apply: dropout::Apply,
        elementary_apply: elementary::Apply,
        layer_norm_forward: layer_norm::Forward,
        layer_norm_backward_input: layer_norm::BackwardInput,
        layer_norm_backward_parameters: layer_norm::BackwardParameters,
        linear_sum_rows: linear::SumRows,
        loss_gradient: loss::Gradient,
        moving_average: moving_average::Average,
        rows_scale: strided::Scale,
        rows_combine: strided::Combine,
        rows_inner: strided::Inner,
        sci_scale: sci::Scale,
        sci_backward: sci::Backward,
        temporal_weighted_sum: temporal::WeightedSum,
        temporal_row_dots: temporal::RowDots,
        temporal_row_sums: temporal::RowSums,
        batch_norm_moments: batch_norm::Moments,
        batch_norm_forward: batch_norm::Forward,
        batch_norm_backward_sums: batch_norm::BackwardSums,
        batch_norm_backward_input: batch_norm::BackwardInput,
        lstm_forward: lstm::Forward,
        lstm_backward: lstm::Backward,
        pool_forward: pool::Forward,
        pool_backward: pool::Backward,
        prob_sparse_scores: prob_sparse::Scores,
        prob_sparse_rest: prob_sparse::Rest,
        prob_sparse_softmax: prob_sparse::Softmax,
        prob_sparse_backward_rest: prob_sparse::BackwardRest,
        prob_sparse_backward_softmax: prob_sparse::BackwardSoftmax,
        spectrum_amplitudes: spectrum::Amplitudes,
        spectrum_backward: spectrum::Backward,
        temporal_each_forward: temporal_each::Forward,
        temporal_each_backward_input: temporal_each::BackwardInput,
        temporal_each_backward_weight: temporal_each::BackwardWeight,
        weight_norm_forward: weight_norm::Forward,
        weight_norm_direction: weight_norm::Direction,
        weight_norm_length: weight_norm::Length,
    }
    tiles {
        attention_forward: attention::Forward,
        attention_backward: attention::Backward,
        conv1d_pack: conv1d::Pack,
        conv1d_forward: conv1d::Forward,
        conv1d_backward_input: conv1d::BackwardInput,
        conv1d_backward_weight: conv1d::BackwardWeight,
        conv1d_forward_sequences: conv1d::ForwardSequences,
        conv1d_backward_input_sequences: conv1d::BackwardInputSequences,
        conv1d_backward_weight_sequences: conv1d::BackwardWeightSequences,
        gemm_product: gemm::Product,
        gemm_transposed_product: gemm::TransposedProduct,
        conv1d_general_pack: conv1d_general::Pack,
        conv1d_general_forward: conv1d_general::Forward,
        conv1d_general_backward_input: conv1d_general::BackwardInput,
        conv1d_general_backward_weight: conv1d_general::BackwardWeight,
        fold_product: fold::Product,
        fold_backward_weight: fold::BackwardWeight,
    }
}
