//! Every kernel at the sizes of the networks, one thread, f32: this processor's best level beside the plain level, the naive
//! reference, and for matrix products `matrixmultiply` and `gemm` called directly. Ids: `kernel/<name>/<shape>/<level | plain | reference>`.

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use phyture_kernels::activation::{self, Activation};
use phyture_kernels::attention::{self, Gradients, Inputs};
use phyture_kernels::conv1d::{self, Epilogue, Geometry, Weight};
use phyture_kernels::dropout::{self, Mask};
use phyture_kernels::random::Stream;
use phyture_kernels::{
    InstructionSet, Rows, RowsMut, Write, adam, gemm as own_gemm, layer_norm, moving_average, peak, reference, sci, temporal,
};

/// Numbers in [−1, 1).
fn numbers(seed: u64, len: usize) -> Vec<f32> {
    let stream = Stream::new(seed, 0, 0, 0);
    (0..len as u64).map(|i| (2.0 * stream.uniform(i) - 1.0) as f32).collect()
}

/// One row of a comparison: its name and what is timed.
type Contender<'a> = (&'a str, Box<dyn FnMut() + 'a>);

fn compare(criterion: &mut Criterion, name: &str, shape: &str, operations: u64, contenders: Vec<Contender<'_>>) {
    let mut group = criterion.benchmark_group(format!("kernel/{name}/{shape}"));
    group.throughput(Throughput::Elements(operations));
    for (contender, mut run) in contenders {
        group.bench_function(contender, |bencher| bencher.iter(&mut run));
    }
    group.finish();
}

/// The best level and the plain one; one row if they are the same.
fn levels() -> Vec<InstructionSet> {
    let best = InstructionSet::detect().unwrap_or(InstructionSet::PLAIN);
    if best == InstructionSet::PLAIN { vec![best] } else { vec![best, InstructionSet::PLAIN] }
}

/// A row for each level, made by `row`.
fn each_level<'a>(row: impl Fn(InstructionSet) -> Box<dyn FnMut() + 'a>) -> Vec<Contender<'a>> {
    levels().into_iter().map(|isa| (isa.name(), row(isa))).collect()
}

/// What shares of the peak are shares of, measured before everything else.
fn say_peak(_: &mut Criterion) {
    let isa = levels()[0];
    println!("multiply-add peak at level {isa}: {:.1} GFLOP/s", peak::f32_gflops(isa));
}

/// Strides of a and b, by row and by column of each.
type Strides = [isize; 4];

fn matrixmultiply_product(
    [m, k, n]: [usize; 3],
    (a, b): (&'static [f32], &'static [f32]),
    [row_a, column_a, row_b, column_b]: Strides,
) -> Contender<'static> {
    let mut c = vec![0.0_f32; m * n];
    let product = move || {
        let (a, b, to) = (a.as_ptr(), b.as_ptr(), c.as_mut_ptr());
        // SAFETY: a, b and c hold m·k, k·n and m·n numbers, and the strides are those of their layouts.
        unsafe { matrixmultiply::sgemm(m, k, n, 1.0, a, row_a, column_a, b, row_b, column_b, 0.0, to, n.cast_signed(), 1) };
        black_box(&mut c);
    };
    ("matrixmultiply", Box::new(product))
}

fn gemm_product(
    [m, k, n]: [usize; 3],
    (a, b): (&'static [f32], &'static [f32]),
    [row_a, column_a, row_b, column_b]: Strides,
) -> Contender<'static> {
    let mut c = vec![0.0_f32; m * n];
    let product = move || {
        let (a, b, to, row_c) = (a.as_ptr(), b.as_ptr(), c.as_mut_ptr(), n.cast_signed());
        let alone = gemm::Parallelism::None;
        // SAFETY: as above; c is overwritten, not read.
        unsafe {
            gemm::gemm(m, n, k, to, 1, row_c, false, a, column_a, row_a, b, column_b, row_b, 0.0, 1.0, false, false, false, alone);
        }
        black_box(&mut c);
    };
    ("gemm", Box::new(product))
}

fn products(criterion: &mut Criterion) {
    for (m, k, n) in [(1000, 64, 64), (500, 320, 64), (1000, 16, 64), (64, 1000, 64)] {
        let (a, b) = (&*numbers(1, m * k).leak(), &*numbers(2, k * n).leak());
        let views = (Rows::packed(a, m, k), Rows::packed(b, k, n), Rows::packed(a, k, m), Rows::packed(b, n, k));
        let (shape, operations) = (format!("{m}x{k}x{n}"), (2 * m * k * n) as u64);
        type Form = fn(InstructionSet, Rows<'_, f32>, Rows<'_, f32>, RowsMut<'_, f32>, Write, &mut [f32]);
        let forms: [(&str, Form, _, _); 3] = [
            ("gemm_ab", own_gemm::ab, views.0, views.1),
            ("gemm_atb", own_gemm::atb, views.2, views.1),
            ("gemm_abt", own_gemm::abt, views.0, views.3),
        ];
        for (name, form, a_view, b_view) in forms {
            let mut rows = each_level(|isa| {
                let (mut c, mut scratch) = (vec![0.0; m * n], vec![0.0; own_gemm::scratch_len(m, k, n)]);
                Box::new(move || form(isa, a_view, b_view, RowsMut::packed(black_box(&mut c), m, n), Write::Set, &mut scratch))
            });
            // Element (i, p) of a and (p, j) of b, by their distances.
            let strides = match name {
                "gemm_atb" => [1, m, n, 1],
                "gemm_abt" => [k, 1, 1, k],
                _ => [k, 1, n, 1],
            };
            rows.push(matrixmultiply_product([m, k, n], (a, b), strides.map(usize::cast_signed)));
            rows.push(gemm_product([m, k, n], (a, b), strides.map(usize::cast_signed)));
            if name == "gemm_ab" {
                let mut c = vec![0.0_f32; m * n];
                rows.push((
                    "reference",
                    Box::new(move || reference::gemm_ab(a_view, b_view, RowsMut::packed(black_box(&mut c), m, n))),
                ));
            }
            compare(criterion, name, &shape, operations, rows);
        }
    }
}

fn convolution(criterion: &mut Criterion) {
    const WIDTH: usize = 64;
    let epilogue =
        Epilogue { activation: Activation::LeakyRelu { slope: 0.01 }, dropout: Some(Mask::new(Stream::new(1, 2, 3, 4), 0.2)) };
    for rows in [500, 125] {
        let geometry = Geometry { taps: 5, left: 3, right: 3 };
        let after = geometry.output_rows(rows);
        let (x, weight, dz) = (numbers(1, rows * WIDTH), numbers(2, 5 * WIDTH * WIDTH), numbers(3, after * WIDTH));
        let (x, weight, dz) = (Rows::packed(&x, rows, WIDTH), &weight[..], Rows::packed(&dz, after, WIDTH));
        let (shape, operations) = (format!("{rows}x{WIDTH}x5"), (2 * after * 5 * WIDTH * WIDTH) as u64);
        let packed = |isa, transposed: bool| {
            let mut packed = vec![0.0; conv1d::packed_len(geometry, WIDTH, WIDTH)];
            let pack = if transposed { conv1d::pack_transposed } else { conv1d::pack };
            pack(isa, geometry, (WIDTH, WIDTH), weight, &mut packed);
            packed
        };
        let mut contenders = each_level(|isa| {
            let (mut y, packed) = (vec![0.0; after * WIDTH], packed(isa, false));
            let mut scratch = vec![0.0; conv1d::scratch_len(geometry, WIDTH, WIDTH)];
            Box::new(move || {
                conv1d::forward(
                    isa,
                    geometry,
                    x,
                    (Weight::Packed(&packed), None),
                    epilogue,
                    RowsMut::packed(black_box(&mut y), after, WIDTH),
                    &mut scratch,
                );
            })
        });
        let mut y = vec![0.0_f32; after * WIDTH];
        contenders.push((
            "reference",
            Box::new(move || reference::conv1d(geometry, x, weight, None, RowsMut::packed(black_box(&mut y), after, WIDTH))),
        ));
        compare(criterion, "conv1d_forward", &shape, operations, contenders);
        let mut contenders = each_level(|isa| {
            let packed = packed(isa, true);
            let (mut dx, mut scratch) = (vec![0.0; rows * WIDTH], vec![0.0; conv1d::scratch_len(geometry, WIDTH, WIDTH)]);
            Box::new(move || {
                conv1d::backward_input(
                    isa,
                    geometry,
                    dz,
                    Weight::Packed(&packed),
                    RowsMut::packed(black_box(&mut dx), rows, WIDTH),
                    Write::Set,
                    &mut scratch,
                )
            })
        });
        let mut dx = vec![0.0_f32; rows * WIDTH];
        contenders.push((
            "reference",
            Box::new(move || {
                reference::conv1d_backward_input(geometry, dz, weight, RowsMut::packed(black_box(&mut dx), rows, WIDTH))
            }),
        ));
        compare(criterion, "conv1d_backward_input", &shape, operations, contenders);
        let mut contenders = each_level(|isa| {
            let (mut dw, mut scratch) = (vec![0.0; 5 * WIDTH * WIDTH], vec![0.0; conv1d::scratch_len(geometry, WIDTH, WIDTH)]);
            Box::new(move || conv1d::backward_weight(isa, geometry, x, dz, black_box(&mut dw), Write::Set, &mut scratch))
        });
        let mut dw = vec![0.0_f32; 5 * WIDTH * WIDTH];
        contenders.push(("reference", Box::new(move || reference::conv1d_backward_weight(geometry, x, dz, black_box(&mut dw)))));
        compare(criterion, "conv1d_backward_weight", &shape, operations, contenders);
    }
}

fn attention_maps(criterion: &mut Criterion) {
    const WIDTH: usize = 64;
    const HEADS: usize = 4;
    // The stored maps of the reference are timed at the short length only.
    for (rows, with_reference) in [(125, true), (1000, false)] {
        let [q, k, v, d_o] = [1, 2, 3, 4].map(|seed| numbers(seed, rows * WIDTH));
        let [q, k, v, d_o] = [&q, &k, &v, &d_o].map(|x| Rows::packed(x, rows, WIDTH));
        let scratch = || vec![0.0; attention::scratch_len(HEADS, rows, rows, WIDTH / HEADS)];
        for (kind, dropout) in [("", None), ("_dropout", Some(Mask::new(Stream::new(1, 2, 3, 4), 0.2)))] {
            let inputs = Inputs { heads: HEADS, q, k, v, dropout };
            let (shape, operations) = (format!("{rows}x{HEADS}x{}", WIDTH / HEADS), (4 * rows * rows * WIDTH) as u64);
            let mut contenders = each_level(|isa| {
                let (mut o, mut lse, mut scratch) = (vec![0.0; rows * WIDTH], vec![0.0; HEADS * rows], scratch());
                Box::new(move || {
                    let o = RowsMut::packed(black_box(&mut o), rows, WIDTH);
                    attention::forward(isa, inputs, o, &mut lse, &mut scratch);
                })
            });
            if with_reference {
                let (mut o, mut lse) = (vec![0.0_f32; rows * WIDTH], vec![0.0_f32; HEADS * rows]);
                contenders.push((
                    "reference",
                    Box::new(move || {
                        reference::attention(HEADS, q, k, v, dropout, RowsMut::packed(black_box(&mut o), rows, WIDTH), &mut lse);
                    }),
                ));
            }
            compare(criterion, &format!("attention_forward{kind}"), &shape, operations, contenders);
            let (mut o, mut lse) = (vec![0.0_f32; rows * WIDTH], vec![0.0_f32; HEADS * rows]);
            let best = levels()[0];
            attention::forward(best, inputs, RowsMut::packed(&mut o, rows, WIDTH), &mut lse, &mut scratch());
            let (o, lse) = (&o, &lse);
            let mut contenders = each_level(|isa| {
                let mut gradients = [(); 3].map(|()| vec![0.0_f32; rows * WIDTH]);
                let mut scratch = scratch();
                Box::new(move || {
                    let [dq, dk, dv] = black_box(&mut gradients).each_mut().map(|x| RowsMut::packed(x, rows, WIDTH));
                    let gradients = Gradients { dq, dk, dv, write_q: Write::Set, write_k: Write::Set, write_v: Write::Set };
                    attention::backward(isa, inputs, (Rows::packed(o, rows, WIDTH), lse), d_o, gradients, &mut scratch);
                })
            });
            if with_reference {
                let mut gradients = [(); 3].map(|()| vec![0.0_f32; rows * WIDTH]);
                contenders.push((
                    "reference",
                    Box::new(move || {
                        let [dq, dk, dv] = black_box(&mut gradients).each_mut().map(|x| RowsMut::packed(x, rows, WIDTH));
                        reference::attention_backward(inputs, d_o, [dq, dk, dv]);
                    }),
                ));
            }
            compare(criterion, &format!("attention_backward{kind}"), &shape, operations * 5 / 2, contenders);
        }
    }
}

fn pointwise(criterion: &mut Criterion) {
    const ROWS: usize = 1000;
    const WIDTH: usize = 64;
    let (shape, elements) = (format!("{ROWS}x{WIDTH}"), (ROWS * WIDTH) as u64);
    let [x, s, gamma] = [1, 2, 3].map(|seed| numbers(seed, ROWS * WIDTH));
    let [x, s] = [&x, &s].map(|x| Rows::packed(x, ROWS, WIDTH));
    let gamma = &gamma[..WIDTH];
    fn write(y: &mut [f32]) -> RowsMut<'_, f32> {
        RowsMut::packed(black_box(y), ROWS, WIDTH)
    }
    let output = || vec![0.0_f32; ROWS * WIDTH];
    let moments = || [vec![0.0_f32; ROWS], vec![0.0_f32; ROWS]];

    let mut rows = each_level(|isa| {
        let (mut y, [mut mean, mut rstd]) = (output(), moments());
        Box::new(move || layer_norm::forward(isa, x, (gamma, gamma), 1e-5, write(&mut y), (&mut mean, &mut rstd)))
    });
    let (mut y, [mut mean, mut rstd]) = (output(), moments());
    rows.push(("reference", Box::new(move || reference::layer_norm(x, gamma, gamma, 1e-5, write(&mut y), &mut mean, &mut rstd))));
    compare(criterion, "layer_norm", &shape, elements, rows);

    let mut rows = each_level(|isa| {
        let (mut y, mut scratch) = (output(), vec![0.0; moving_average::scratch_len(ROWS, WIDTH)]);
        Box::new(move || moving_average::forward(isa, 25, x, write(&mut y), &mut scratch))
    });
    let mut y = output();
    rows.push(("reference", Box::new(move || reference::moving_average(25, x, write(&mut y)))));
    compare(criterion, "moving_average", &shape, elements, rows);

    let mut rows = each_level(|isa| {
        let mut y = output();
        Box::new(move || activation::forward(isa, Activation::Tanh, x, write(&mut y)))
    });
    let mut y = output();
    rows.push((
        "reference",
        Box::new(move || {
            y.iter_mut()
                .zip((0..ROWS).flat_map(|i| x.row(i)))
                .for_each(|(y, x)| *y = reference::activation(Activation::Tanh, f64::from(*x)) as f32);
        }),
    ));
    compare(criterion, "tanh", &shape, elements, rows);

    let rows = each_level(|isa| {
        let mut y = output();
        Box::new(move || sci::scale(isa, x, s, write(&mut y)))
    });
    compare(criterion, "sci_scale", &shape, elements, rows);

    let rows = each_level(|isa| {
        let (mut y, mask) = (output(), Mask::new(Stream::new(1, 2, 3, 4), 0.2));
        Box::new(move || dropout::forward(isa, mask, x, write(&mut y)))
    });
    compare(criterion, "dropout", &shape, elements, rows);

    let weight = numbers(4, ROWS);
    let weight = &weight[..];
    let rows = each_level(|isa| {
        let (mut y, mut scratch) = (vec![0.0_f32; WIDTH], vec![0.0; temporal::scratch_len(ROWS, 1, WIDTH)]);
        Box::new(move || temporal::forward(isa, x, weight, None, RowsMut::packed(black_box(&mut y), 1, WIDTH), &mut scratch))
    });
    compare(criterion, "temporal", &shape, elements, rows);

    let rows = each_level(|isa| {
        let gradient = numbers(5, ROWS * WIDTH);
        let [mut theta, mut first, mut second] = [output(), output(), output()];
        Box::new(move || {
            adam::step(isa, &adam::Adam::default(), 3, 1.0, &gradient, black_box(&mut theta), (&mut first, &mut second))
        })
    });
    compare(criterion, "adam", &shape, elements, rows);
}

criterion_group! {
    name = kernels;
    // Short: the whole list has to stay within minutes, the naive rows included.
    config = Criterion::default().sample_size(10).warm_up_time(Duration::from_millis(200)).measurement_time(Duration::from_millis(600));
    targets = say_peak, products, convolution, attention_maps, pointwise
}
criterion_main!(kernels);
