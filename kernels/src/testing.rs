//! What the kernels' tests share: numbers, matrices with gaps, comparison at a stated tolerance. Compiled for tests only.

use crate::random::Stream;
use crate::{Real, Rows, RowsMut, Tolerance, Write};

/// Both ways to store a gradient.
pub(crate) const WRITES: [Write; 2] = [Write::Set, Write::Add];

/// Numbers in [−1, 1), the same for the same seed.
pub(crate) fn numbers<T: Real>(seed: u64, len: usize) -> Vec<T> {
    let stream = Stream::new(seed, 0, 0, 0);
    (0..len as u64).map(|i| T::of(2.0 * stream.uniform(i) - 1.0)).collect()
}

/// A matrix that starts somewhere in its buffer and has gaps between its rows. The gaps hold NaN: a kernel that reads them
/// shows it in its result, one that writes them is caught by [`Matrix::check_gaps`].
#[derive(Clone, Debug)]
pub(crate) struct Matrix<T> {
    data: Vec<T>,
    offset: usize,
    shape: (usize, usize),
    stride: usize,
}

impl<T: Real> Matrix<T> {
    pub(crate) fn filled(shape: (usize, usize), offset: usize, gap: usize, value: impl Fn(usize, usize) -> T) -> Self {
        let stride = shape.1 + gap;
        let mut matrix = Self { data: vec![T::NAN; offset + shape.0 * stride], offset, shape, stride };
        for i in 0..shape.0 {
            for j in 0..shape.1 {
                matrix.data[offset + i * stride + j] = value(i, j);
            }
        }
        matrix
    }

    /// Random numbers; offset and gap follow from the seed, so that unaligned starts and strides occur.
    pub(crate) fn random(seed: u64, shape: (usize, usize)) -> Self {
        let values = numbers::<T>(seed, shape.0 * shape.1);
        Self::filled(shape, (seed % 5) as usize, (seed % 3) as usize, |i, j| values[i * shape.1 + j])
    }

    /// NaN everywhere: what an uninitialised gradient may hold.
    pub(crate) fn poisoned(seed: u64, shape: (usize, usize)) -> Self {
        Self::filled(shape, (seed % 4) as usize, (seed % 7) as usize, |_, _| T::NAN)
    }

    pub(crate) fn view(&self) -> Rows<'_, T> {
        Rows::new(&self.data[self.offset..], self.shape.0, self.shape.1, self.stride)
    }

    pub(crate) fn view_mut(&mut self) -> RowsMut<'_, T> {
        RowsMut::new(&mut self.data[self.offset..], self.shape.0, self.shape.1, self.stride)
    }

    pub(crate) fn to_vec(&self) -> Vec<T> {
        (0..self.shape.0).flat_map(|i| self.view().row(i).to_vec()).collect()
    }

    pub(crate) fn check_gaps(&self) {
        let inside = |k: usize| k >= self.offset && (k - self.offset) % self.stride.max(1) < self.shape.1;
        assert!(self.data.iter().enumerate().all(|(k, x)| inside(k) || !x.is_finite()), "a gap between rows was written");
    }
}

/// Runs a kernel that stores a gradient both ways: Set on poison, Add on random numbers; compares both with `expected`.
pub(crate) fn check_writes<T: Real>(
    what: &str,
    expected: &Matrix<T>,
    tolerance: Tolerance,
    mut kernel: impl FnMut(RowsMut<'_, T>, Write),
) {
    let shape = expected.shape;
    for write in WRITES {
        let mut found = match write {
            Write::Set => Matrix::poisoned(shape.0 as u64, shape),
            Write::Add => Matrix::random(7, shape),
        };
        let before = found.to_vec();
        kernel(found.view_mut(), write);
        found.check_gaps();
        let expected: Vec<T> = match write {
            Write::Set => expected.to_vec(),
            Write::Add => expected.to_vec().iter().zip(&before).map(|(e, b)| *e + *b).collect(),
        };
        assert_near(&format!("{what}, {write:?}"), &found.to_vec(), &expected, tolerance);
    }
}

/// Panics unless every number lies within the tolerance of its reference.
pub(crate) fn assert_near<T: Real>(what: &str, found: &[T], expected: &[T], tolerance: Tolerance) {
    assert_eq!(found.len(), expected.len(), "{what}: lengths");
    let relative = if size_of::<T>() == 4 { tolerance.relative_f32() } else { tolerance.relative_f64() };
    let largest = expected.iter().map(|e| e.abs().f64()).fold(1.0, f64::max);
    for (i, (f, e)) in found.iter().zip(expected).enumerate() {
        let distance = (f.f64() - e.f64()).abs();
        assert!(distance <= relative * largest, "{what}: element {i} is {f}, expected {e}; scale {largest}, {tolerance:?}");
    }
}

/// The numbers as bits (of their exact widening), for comparisons that tell −0 from 0.
pub(crate) fn bits<T: Real>(numbers: &[T]) -> Vec<u64> {
    numbers.iter().map(|number| number.f64().to_bits()).collect()
}

/// Σ x∘y in f64, to compare both sides of <A x, y> = <x, Aᵀ y>.
pub(crate) fn inner<T: Real>(x: &[T], y: &[T]) -> f64 {
    assert_eq!(x.len(), y.len());
    x.iter().zip(y).map(|(x, y)| x.f64() * y.f64()).sum()
}
