//! What the operations of the tape must satisfy whatever the numbers: sums of a softmax, orthogonality of a layer norm's gradient,
//! permutations of keys and heads, adjoints, and the exact inverse of a split.

use phyture::Result;
use phyture::tape::op::Op;
use phyture::tape::ops::{Affine, Attention, Half, Interleave, LayerNorm, MovingAverage, SquaredError};
use phyture::tape::{Graph, Session, Threads};
use phyture_kernels::Tolerance;
use proptest::collection::vec;
use proptest::prelude::*;

type Values = Vec<f64>;

/// Result of one operation, and the gradients of its operands for this gradient of the result.
fn run(op: impl Op<f64> + 'static, operands: &[(&[usize], &Values)], dy: Option<&Values>) -> Result<(Values, Vec<Values>)> {
    let mut graph = Graph::<f64>::new();
    let mut vars = Vec::new();
    for (index, (lengths, _)) in operands.iter().enumerate() {
        vars.push(graph.input_with_gradient(&format!("x{index}"), lengths)?);
    }
    let y = graph.apply(op, &vars)?;
    let lengths = graph.shape(y);
    let mut infer = Session::infer(&graph, &[y], Threads(1))?;
    infer.step(&[], 1, None, &|_, inputs: &mut [&mut [f64]]| {
        inputs.iter_mut().zip(operands).for_each(|(input, (_, values))| input.copy_from_slice(values));
    })?;
    let result = infer.output(0, 0)?.to_vec();
    let Some(dy) = dy else { return Ok((result, Vec::new())) };
    // Half the squared error to y − dy has the gradient dy.
    let target = graph.input("target", lengths.lengths())?;
    let loss = graph.apply(SquaredError { scale: 0.5 }, &[y, target])?;
    let targets: Values = result.iter().zip(dy).map(|(y, dy)| y - dy).collect();
    let mut train = Session::train(&graph, loss, &[], Threads(1))?;
    train.step(&[], 1, None, &|_, inputs: &mut [&mut [f64]]| {
        let values = operands.iter().map(|(_, values)| *values).chain([&targets]);
        inputs.iter_mut().zip(values).for_each(|(input, values)| input.copy_from_slice(values));
    })?;
    let gradients = (0..operands.len()).map(|index| train.input_gradient(index, 0).map(<[f64]>::to_vec));
    Ok((result, gradients.collect::<phyture::tape::Result<_>>()?))
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= Tolerance::Close.relative_f64() * b.abs().max(1.0)
}

fn all_close(a: &[f64], b: &[f64]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| close(*a, *b))
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn numbers(count: usize) -> impl Strategy<Value = Values> {
    vec(-2.0_f64..2.0, count)
}

/// Heads, width of a head, queries, keys; and q, k, v, dy of these sizes.
fn attention() -> impl Strategy<Value = ([usize; 4], Values, Values, Values, Values)> {
    (1_usize..4, 1_usize..5, 1_usize..9, 1_usize..9).prop_flat_map(|(heads, width, queries, keys)| {
        let d = heads * width;
        let (queries_d, keys_d) = (queries * d, keys * d);
        (Just([heads, width, queries, keys]), numbers(queries_d), numbers(keys_d), numbers(keys_d), numbers(queries_d))
    })
}

/// Rows in reverse order.
fn reversed_rows(values: &Values, columns: usize) -> Values {
    values.chunks(columns).rev().flatten().copied().collect()
}

/// Blocks of `width` columns in reverse order, in every row.
fn reversed_heads(values: &Values, columns: usize, width: usize) -> Values {
    values.chunks(columns).flat_map(|row| row.chunks(width).rev().flatten()).copied().collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn softmax_rows_sum_to_one_and_their_gradients_to_zero(([heads, width, queries, keys], q, k, v, dy) in attention()) {
        let d = heads * width;
        let op = Attention { heads, dropout: 0.2 };
        // With every value one, a result is the sum of a row's probabilities.
        let (o, gradients) = run(op, &[(&[queries, d], &q), (&[keys, d], &k), (&[keys, d], &vec![1.0; keys * d])], Some(&dy))?;
        prop_assert!(o.iter().all(|sum| close(*sum, 1.0)), "{:?}", o);
        prop_assert!(gradients[0].iter().chain(&gradients[1]).all(|gradient| close(*gradient, 0.0)), "{:?}", gradients);
        // A constant added to all scores of a row changes nothing: the gradient of the scores sums to zero in each row, and so
        // moving every key by the same vector does not change the result.
        let moved: Values = k.chunks(d).flat_map(|row| row.iter().enumerate().map(|(at, value)| value + 0.1 * at as f64)).collect();
        let (with, gradients) = run(op, &[(&[queries, d], &q), (&[keys, d], &k), (&[keys, d], &v)], Some(&dy))?;
        let (without, _) = run(op, &[(&[queries, d], &q), (&[keys, d], &moved), (&[keys, d], &v)], None)?;
        prop_assert!(all_close(&with, &without));
        for column in 0..d {
            prop_assert!(close(gradients[1].iter().skip(column).step_by(d).sum::<f64>(), 0.0));
        }
    }

    #[test]
    fn attention_does_not_see_the_order_of_keys_and_follows_that_of_heads(([heads, width, queries, keys], q, k, v, dy) in attention()) {
        let d = heads * width;
        let op = Attention { heads, dropout: 0.0 };
        let shapes: [&[usize]; 3] = [&[queries, d], &[keys, d], &[keys, d]];
        let call = |q: &Values, k: &Values, v: &Values, dy: &Values| run(op, &[(shapes[0], q), (shapes[1], k), (shapes[2], v)], Some(dy));
        let (o, gradients) = call(&q, &k, &v, &dy)?;

        let (other, other_gradients) = call(&q, &reversed_rows(&k, d), &reversed_rows(&v, d), &dy)?;
        prop_assert!(all_close(&o, &other));
        prop_assert!(all_close(&gradients[0], &other_gradients[0]));
        prop_assert!(all_close(&reversed_rows(&gradients[1], d), &other_gradients[1]));
        prop_assert!(all_close(&reversed_rows(&gradients[2], d), &other_gradients[2]));

        let turn = |values: &Values| reversed_heads(values, d, width);
        let (other, other_gradients) = call(&turn(&q), &turn(&k), &turn(&v), &turn(&dy))?;
        prop_assert!(all_close(&turn(&o), &other));
        for (mine, other) in gradients.iter().zip(&other_gradients) {
            prop_assert!(all_close(&turn(mine), other));
        }
    }

    #[test]
    fn the_gradient_through_a_layer_norm_is_orthogonal_to_one_and_to_its_result(
        (rows, channels, x, dy) in (1_usize..6, 2_usize..9).prop_flat_map(|(rows, channels)| {
            (Just(rows), Just(channels), numbers(rows * channels), numbers(rows * channels))
        })
    ) {
        // A row that is nearly constant has a gradient as large as 1/√ε: nothing to compare.
        prop_assume!(x.chunks(channels).all(|row| row.iter().any(|value| (value - row[0]).abs() > 0.1)));
        let (one, zero) = (vec![1.0; channels], vec![0.0; channels]);
        // Without ε the orthogonality to the normalised row is exact.
        let operands: [(&[usize], &Values); 3] = [(&[rows, channels], &x), (&[channels], &one), (&[channels], &zero)];
        let (y, gradients) = run(LayerNorm { eps: 0.0 }, &operands, Some(&dy))?;
        for (dx, y) in gradients[0].chunks(channels).zip(y.chunks(channels)) {
            let scale = dot(dx, dx).sqrt().max(1.0) * channels as f64;
            prop_assert!(close(dx.iter().sum::<f64>() / scale, 0.0) && close(dot(dx, y) / scale, 0.0));
            prop_assert!(close(y.iter().sum::<f64>(), 0.0) && close(dot(y, y), channels as f64));
        }
    }

    #[test]
    fn linear_operations_are_the_adjoints_of_their_backward_passes(
        (pairs, channels, half, x, dy) in (1_usize..8, 1_usize..5, 0_usize..4).prop_flat_map(|(pairs, channels, half)| {
            let count = 2 * pairs * channels;
            (Just(pairs), Just(channels), Just(half), numbers(count), numbers(count))
        })
    ) {
        let shape: &[usize] = &[2 * pairs, channels];
        // <A x, dy> = <x, Aᵀ dy>
        let (y, gradients) = run(MovingAverage { width: 2 * half + 1 }, &[(shape, &x)], Some(&dy))?;
        prop_assert!(close(dot(&y, &dy), dot(&x, &gradients[0])));
        let op = Affine { scale: vec![-1.5; channels], offset: vec![0.0; channels] };
        let (y, gradients) = run(op, &[(shape, &x)], Some(&dy))?;
        prop_assert!(close(dot(&y, &dy), dot(&x, &gradients[0])));
        // A constant passes a moving average unchanged, ends included.
        let constant = vec![0.75; x.len()];
        let (y, _) = run(MovingAverage { width: 2 * half + 1 }, &[(shape, &constant)], None)?;
        prop_assert!(all_close(&y, &constant));
    }

    #[test]
    fn interleaving_is_the_exact_inverse_of_splitting(
        (pairs, channels, x) in (1_usize..9, 1_usize..5).prop_flat_map(|(pairs, channels)| {
            (Just(pairs), Just(channels), numbers(2 * pairs * channels))
        })
    ) {
        let (even, _) = run(Half::Even, &[(&[2 * pairs, channels], &x)], None)?;
        let (odd, _) = run(Half::Odd, &[(&[2 * pairs, channels], &x)], None)?;
        let shape: &[usize] = &[pairs, channels];
        let (merged, gradients) = run(Interleave, &[(shape, &even), (shape, &odd)], Some(&x))?;
        prop_assert_eq!(&merged, &x);
        prop_assert!(all_close(&gradients[0], &even) && all_close(&gradients[1], &odd));
    }
}
