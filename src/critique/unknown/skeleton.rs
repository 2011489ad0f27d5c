//! The shape of a dependence: which simple term of the formula grammar comes nearest to it.
//!
//! A term to start from, to be calibrated and judged like any other effect. Nothing here decides whether there is a dependence.

use super::table::ResidualTable;
use crate::flight::{Channel, Column};
use crate::formula::Formula;
use nalgebra::{Matrix4, Vector4};
use serde::Serialize;
use std::f64::consts::{PI, TAU};
use std::ops::Range;

/// Points into which a half is averaged over a variable.
const POINTS: usize = 200;
/// What a shape has to gain in R² for each number that it carries.
const PRICE: f64 = 0.01;
/// Places, widths and wave numbers that are tried before the best is refined.
const PLACES: usize = 40;
const WIDTHS: [f64; 6] = [0.03, 0.05, 0.08, 0.12, 0.2, 0.3];
const WAVES: usize = 300;
/// Most periods within the range of the variable: the points show no more.
const MOST_PERIODS: f64 = 20.0;

/// A term of one channel that comes near an unexplained dependence, ready for an `[[effect]]` of kind `formula`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SuggestedFormula {
    /// Channel it acts on.
    pub channel: &'static str,
    /// The regressor, in the project's formula grammar.
    pub formula: String,
    /// Value to start the coefficient from, m/s² or rad/s² per unit of the formula.
    pub coefficient: f64,
    /// Share of the residual variance that the term explains on blocks to which it was not fitted.
    pub r2: f64,
}

/// A family of terms of one variable x and its numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    /// x.
    Linear,
    /// x².
    Square,
    /// x |x|.
    Odd,
    /// sin(k x + phase), the phase by least squares.
    Wave(f64),
    /// max(x − c, 0).
    Above(f64),
    /// max(c − x, 0).
    Below(f64),
    /// max(|x| − c, 0).
    Outside(f64),
    /// sign(x) max(|x| − c, 0).
    OddOutside(f64),
    /// exp(−((x − c) / s)²).
    Bell(f64, f64),
}

impl Shape {
    /// Two regressors; the second is zero except for waves.
    fn at(self, x: f64) -> [f64; 2] {
        match self {
            Self::Linear => [x, 0.0],
            Self::Square => [x * x, 0.0],
            Self::Odd => [x * x.abs(), 0.0],
            Self::Wave(k) => [(k * x).sin(), (k * x).cos()],
            Self::Above(c) => [(x - c).max(0.0), 0.0],
            Self::Below(c) => [(c - x).max(0.0), 0.0],
            Self::Outside(c) => [(x.abs() - c).max(0.0), 0.0],
            Self::OddOutside(c) => [x.signum() * (x.abs() - c).max(0.0), 0.0],
            Self::Bell(c, s) => [(-((x - c) / s).powi(2)).exp(), 0.0],
        }
    }

    /// Numbers it carries, besides its coefficient.
    const fn numbers(self) -> f64 {
        match self {
            Self::Linear | Self::Square | Self::Odd => 0.0,
            Self::Above(_) | Self::Below(_) | Self::Outside(_) | Self::OddOutside(_) => 1.0,
            Self::Wave(_) | Self::Bell(..) => 2.0,
        }
    }

    /// The shape with its numbers moved by some steps of their scale.
    fn moved(self, by: [f64; 2]) -> Self {
        match self {
            Self::Linear | Self::Square | Self::Odd => self,
            Self::Wave(k) => Self::Wave(k + by[0]),
            Self::Above(c) => Self::Above(c + by[0]),
            Self::Below(c) => Self::Below(c + by[0]),
            Self::Outside(c) => Self::Outside((c + by[0]).max(0.0)),
            Self::OddOutside(c) => Self::OddOutside((c + by[0]).max(0.0)),
            Self::Bell(c, s) => Self::Bell(c + by[0], (s + by[1]).max(0.2 * s)),
        }
    }
}

/// Residual against a variable, averaged over runs of neighbouring values.
struct Points {
    /// Value, mean residual, rows.
    points: Vec<[f64; 3]>,
    low: f64,
    high: f64,
}

impl Points {
    fn new(rows: &[usize], x: &[f64], y: &[f64]) -> Option<Self> {
        let mut pairs: Vec<[f64; 2]> = rows.iter().filter_map(|row| Some([*x.get(*row)?, *y.get(*row)?])).collect();
        pairs.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let points: Vec<[f64; 3]> = pairs
            .chunks(pairs.len().div_ceil(POINTS).max(1))
            .map(|chunk| {
                let count = chunk.len() as f64;
                let [x, y] = chunk.iter().fold([0.0; 2], |sum, pair| [sum[0] + pair[0], sum[1] + pair[1]]);
                [x / count, y / count, count]
            })
            .collect();
        let (low, high) = (points.first()?[0], points.last()?[0]);
        (high > low).then_some(Self { points, low, high })
    }

    /// Offset, two factors of the shape and a slope by least squares, and the weighted squares that they leave. The slope stands for
    /// linear terms that calibration fits anew beside the new one.
    fn fit(&self, shape: Shape, slope: bool) -> ([f64; 4], f64) {
        let (mut gram, mut right, mut squares) = (Matrix4::zeros(), Vector4::zeros(), 0.0);
        for [x, y, count] in &self.points {
            let row = self.row(shape, slope, *x);
            gram += row * row.transpose() * *count;
            right += row * (y * count);
            squares += count * y * y;
        }
        // A regressor that is not there leaves a zero row; the ridge makes it solvable.
        for index in 0..4 {
            let ridge = 1e-9 * gram[(index, index)];
            gram[(index, index)] += if ridge > 0.0 { ridge } else { 1.0 };
        }
        let Some(factors) = gram.cholesky().map(|factor| factor.solve(&right)) else { return ([0.0; 4], squares) };
        (factors.into(), self.left(shape, slope, factors.into()))
    }

    fn row(&self, shape: Shape, slope: bool, x: f64) -> Vector4<f64> {
        let [first, second] = shape.at(x);
        let slope = if slope && shape != Shape::Linear { (x - self.low) / (self.high - self.low) } else { 0.0 };
        Vector4::new(1.0, first, second, slope)
    }

    /// Weighted squares left by given factors.
    fn left(&self, shape: Shape, slope: bool, factors: [f64; 4]) -> f64 {
        let factors = Vector4::from(factors);
        self.points.iter().map(|[x, y, count]| count * (y - self.row(shape, slope, *x).dot(&factors)).powi(2)).sum()
    }

    /// The best of a family: the grid, then steps of half the size until they no longer matter.
    fn best(&self, family: &[Shape], slope: bool) -> Option<Shape> {
        let left = |shape: &Shape| self.fit(*shape, slope).1;
        let mut found = *family.iter().min_by(|a, b| left(a).total_cmp(&left(b)))?;
        let mut least = left(&found);
        let range = self.high - self.low;
        let mut step = match found {
            Shape::Wave(_) => [TAU * MOST_PERIODS / (WAVES as f64 * range), 0.0],
            _ => [range / PLACES as f64, 0.02 * range],
        };
        for _ in 0..8 {
            for by in [[step[0], 0.0], [-step[0], 0.0], [0.0, step[1]], [0.0, -step[1]]] {
                let tried = found.moved(by);
                let error = left(&tried);
                if error < least {
                    (found, least) = (tried, error);
                }
            }
            step = step.map(|step| 0.5 * step);
        }
        Some(found)
    }

    fn families(&self, angle: bool) -> Vec<Vec<Shape>> {
        if angle {
            return vec![vec![Shape::Wave(1.0)], vec![Shape::Wave(2.0)]];
        }
        let range = self.high - self.low;
        let place = |index: usize| self.low + range * (index as f64 + 0.5) / PLACES as f64;
        let places = || (0..PLACES).map(place);
        let mut families = vec![vec![Shape::Linear], vec![Shape::Square], vec![Shape::Odd]];
        families.push(places().map(Shape::Above).collect());
        families.push(places().map(Shape::Below).collect());
        if self.low < 0.0 && self.high > 0.0 {
            let distances = || places().filter(|place| *place > 0.0);
            families.push(distances().map(Shape::Outside).collect());
            families.push(distances().map(Shape::OddOutside).collect());
        }
        families.push(places().flat_map(|c| WIDTHS.map(|width| Shape::Bell(c, width * range))).collect());
        // At least one whole period, below which a wave is a bend like others.
        let waves = (1..=WAVES).map(|index| MOST_PERIODS * index as f64 / WAVES as f64).filter(|periods| *periods >= 1.0);
        families.push(waves.map(|periods| Shape::Wave(TAU * periods / range)).collect());
        families
    }
}

/// A term and how well it does on rows to which it was not fitted.
struct Candidate {
    text: String,
    words: String,
    coefficient: f64,
    r2: f64,
    /// R² less the price of its numbers.
    worth: f64,
}

/// The best term of the features `first` of one variable, or of a product with one of `second`; and its shape in words.
/// `residual` is that of the channel, less straight lines in other variables.
pub(super) fn suggest(
    table: &ResidualTable,
    channel: Channel,
    residual: &[f64],
    first: &[usize],
    second: &[usize],
    halves: &[Vec<Range<usize>>; 2],
) -> (Option<SuggestedFormula>, String) {
    let rows = halves.each_ref().map(|half| half.iter().cloned().flatten().collect::<Vec<usize>>());
    let y = residual;
    let mut found: Vec<Candidate> = Vec::new();
    for (feature, label, values) in variables(table, first) {
        found.extend(single(&rows, &label, &values, y));
        for (other, other_label, others) in variables(table, second) {
            if feature != other {
                found.extend(product(&rows, [&label, &other_label], [&values, &others], y));
            }
        }
    }
    let best = found.into_iter().max_by(|a, b| a.worth.total_cmp(&b.worth));
    let Some(best) = best.filter(|best| best.r2 > 0.0) else { return (None, "no simple shape".into()) };
    let formula = Formula::parse(&best.text).map(|formula| formula.to_string());
    let usable = formula.ok().filter(|_| !best.text.contains("time_in_flight"));
    let suggested =
        usable.map(|formula| SuggestedFormula { channel: channel.name(), formula, coefficient: best.coefficient, r2: best.r2 });
    (suggested, best.words)
}

/// Features by number, name and values; the sine and cosine of yaw as one angle.
fn variables(table: &ResidualTable, features: &[usize]) -> Vec<(usize, String, Vec<f64>)> {
    let column = |index: usize| Some((table.names.get(index)?.as_str(), table.features.get(index)?));
    let known: Vec<_> = features.iter().filter_map(|index| column(*index).map(|(name, values)| (*index, name, values))).collect();
    if let [(index, "sin(yaw)", sine), (_, "cos(yaw)", cosine)] = known.as_slice() {
        let angle = sine.iter().zip(cosine.iter()).map(|(sine, cosine)| sine.atan2(*cosine)).collect();
        return vec![(*index, "yaw".into(), angle)];
    }
    known.into_iter().map(|(index, name, values)| (index, name.to_owned(), values.clone())).collect()
}

fn variation(rows: &[usize], y: &[f64]) -> f64 {
    let mean = rows.iter().map(|row| y[*row]).sum::<f64>() / rows.len().max(1) as f64;
    rows.iter().map(|row| (y[*row] - mean).powi(2)).sum()
}

fn single(rows: &[Vec<usize>; 2], label: &str, x: &[f64], y: &[f64]) -> Option<Candidate> {
    let [a, b] = rows.each_ref().map(|rows| Points::new(rows, x, y));
    let halves = [a?, b?];
    let all: Vec<usize> = rows.concat();
    let whole = Points::new(&all, x, y)?;
    let angle = label == "yaw";
    // The baseline's own linear terms are fitted anew when a term is added.
    let slope = Column::from_name(label).is_some() && !angle;
    let candidate = |family: Vec<Shape>| {
        let mut r2 = 0.0;
        for (half, points) in halves.iter().enumerate() {
            let shape = if angle { *family.first()? } else { points.best(&family, slope)? };
            let factors = Vector4::from(points.fit(shape, slope).0);
            let judged = &rows[1 - half];
            let left: f64 = judged.iter().map(|row| (y[*row] - points.row(shape, slope, x[*row]).dot(&factors)).powi(2)).sum();
            r2 += 0.5 * (1.0 - left / variation(judged, y).max(f64::MIN_POSITIVE));
        }
        let shape = if angle { *family.first()? } else { whole.best(&family, slope)? };
        let [_, first, second, beside] = whole.fit(shape, slope).0;
        // A bend upwards and a bend downwards differ by a straight line: the one that needs no line is the better name.
        let at = |point: &[f64; 3]| first * shape.at(point[0])[0];
        let values = whole.points.iter().map(at).fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| [l.min(v), h.max(v)]);
        let leans = if beside.abs() > 0.5 * (values[1] - values[0]) { PRICE } else { 0.0 };
        let (text, words, coefficient) = print(shape, label, first, second);
        // Prices count against the share that is there to be explained.
        Some(Candidate { text, words, coefficient, r2, worth: r2 * (1.0 - PRICE * shape.numbers() - leans) })
    };
    whole.families(angle).into_iter().filter_map(candidate).max_by(|a, b| a.worth.total_cmp(&b.worth))
}

/// x z beside x and z.
fn product(rows: &[Vec<usize>; 2], labels: [&str; 2], [x, z]: [&[f64]; 2], y: &[f64]) -> Option<Candidate> {
    let row = |row: usize| Vector4::new(1.0, x[row], z[row], x[row] * z[row]);
    let fit = |rows: &[usize]| {
        let (mut gram, mut right) = (Matrix4::zeros(), Vector4::zeros());
        for index in rows {
            let row = row(*index);
            gram += row * row.transpose();
            right += row * y[*index];
        }
        (0..4).for_each(|index| gram[(index, index)] *= 1.0 + 1e-9);
        gram.cholesky().map(|factor| factor.solve(&right))
    };
    let mut r2 = 0.0;
    for half in 0..2 {
        let (factors, judged) = (fit(&rows[half])?, &rows[1 - half]);
        let left: f64 = judged.iter().map(|index| (y[*index] - row(*index).dot(&factors)).powi(2)).sum();
        r2 += 0.5 * (1.0 - left / variation(judged, y).max(f64::MIN_POSITIVE));
    }
    let coefficient = fit(&rows.concat())?[3];
    let [x, z] = labels;
    // Two further factors beside it.
    Some(Candidate {
        text: format!("{x} * {z}"),
        words: format!("the product of {x} and {z}"),
        coefficient,
        r2,
        worth: r2 * (1.0 - 2.0 * PRICE),
    })
}

/// The term of a shape, the shape in words, and its coefficient.
fn print(shape: Shape, x: &str, first: f64, second: f64) -> (String, String, f64) {
    let number = |value: f64| rounded(value);
    let from = |c: f64| if c < 0.0 { format!("{x} + {}", number(-c)) } else { format!("{x} - {}", number(c)) };
    let same = |text: String, words: String| (text, words, first);
    match shape {
        Shape::Linear => same(x.to_owned(), format!("linear in {x}")),
        Shape::Square => same(format!("{x}^2"), format!("quadratic in {x}")),
        Shape::Odd => same(format!("{x} * abs({x})"), format!("odd and quadratic in {x}")),
        Shape::Above(c) => same(format!("max({}, 0)", from(c)), format!("sets in above {x} = {}", number(c))),
        Shape::Below(c) => same(format!("max({} - {x}, 0)", number(c)), format!("sets in below {x} = {}", number(c))),
        Shape::Outside(c) => {
            same(format!("max(abs({x}) - {}, 0)", number(c)), format!("sets in beyond |{x}| = {}, alike on both sides", number(c)))
        }
        Shape::OddOutside(c) => same(
            format!("sign({x}) * max(abs({x}) - {}, 0)", number(c)),
            format!("sets in beyond |{x}| = {}, opposite on the two sides", number(c)),
        ),
        Shape::Bell(c, s) => same(format!("exp(-(({}) / {})^2)", from(c), number(s)), format!("a bump at {x} = {}", number(c))),
        Shape::Wave(k) => {
            // a sin(kx) + b cos(kx) = A sin(kx + phase), phase within a quarter turn and the sign in A.
            let (mut amplitude, mut phase) = (first.hypot(second), second.atan2(first));
            if phase.abs() > 0.5 * PI {
                (amplitude, phase) = (-amplitude, phase - PI * phase.signum());
            }
            let wave = if k == 1.0 { x.to_owned() } else { format!("{} * {x}", number(k)) };
            let phase = number(phase);
            let shift = match phase.strip_prefix('-') {
                Some(phase) => format!(" - {phase}"),
                None if phase == "0" => String::new(),
                None => format!(" + {phase}"),
            };
            let period = number(TAU / k);
            (format!("sin({wave}{shift})"), format!("periodic in {x}, period {period}"), amplitude)
        }
    }
}

/// Three significant digits, as a number of the grammar.
fn rounded(value: f64) -> String {
    let value = format!("{value:.2e}").parse::<f64>().unwrap_or(value);
    if value == 0.0 { "0".into() } else { format!("{value}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn terms_print_in_the_grammar() {
        let shapes = [
            Shape::Linear,
            Shape::Square,
            Shape::Odd,
            Shape::Wave(2.004),
            Shape::Wave(1.0),
            Shape::Above(-1.25),
            Shape::Below(1e-7),
            Shape::Outside(2.0),
            Shape::OddOutside(123_456.0),
            Shape::Bell(-3.0, 0.5),
        ];
        for shape in shapes {
            let (text, words, coefficient) = print(shape, "vx", -1.0, 0.4);
            assert!(Formula::parse(&text).is_ok_and(|formula| formula.names().iter().all(|name| *name == "vx")), "{text}");
            assert!(words.contains("vx") && coefficient.abs() >= 1.0);
        }
        assert_eq!(print(Shape::Wave(2.0), "height", 1.0, 0.0).0, "sin(2 * height)");
        assert_eq!(print(Shape::Bell(-3.0, 0.5), "vx", 1.0, 0.0).0, "exp(-((vx + 3) / 0.5)^2)");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn a_printed_term_is_the_shape(k in 0.3..9.0_f64, sine in -2.0..2.0_f64, cosine in -2.0..2.0_f64, x in -5.0..5.0_f64) {
            prop_assume!(sine.hypot(cosine) > 0.1);
            let (text, _, coefficient) = print(Shape::Wave(k), "height", sine, cosine);
            let formula = Formula::parse(&text).map_err(|error| TestCaseError::fail(error.to_string()))?;
            let values = vec![x];
            let found = formula.evaluate(1, 0.01, &|_| Some(values.clone().into()));
            let found = found.map_err(|error| TestCaseError::fail(error.to_string()))?[0] * coefficient;
            let expected = sine * (k * x).sin() + cosine * (k * x).cos();
            // Three digits of k and phase at |k x| up to 45 rad.
            prop_assert!((found - expected).abs() < 0.25 * sine.hypot(cosine), "{text}: {found} instead of {expected}");
        }
    }
}
