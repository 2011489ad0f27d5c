//! The one tolerance type of the project's numeric tests. A level has one meaning everywhere; no bare literals in tests.

/// How far a value may lie from its reference.
///
/// | level | f64 | f32 | for |
/// | --- | --- | --- | --- |
/// | `Exact` | same bits | same bits | permutations, splits, replays |
/// | `Close` | 1e-9 | 1e-5 | the same sum in another order |
/// | `Approximate` | 1e-7 | 1e-4 | central differences, long recurrences |
/// | `Ulp(n)` | n units in the last place | n units | one elementary function |
///
/// `Close` and `Approximate` are relative to the largest magnitude of the reference tensor, never below one unit of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tolerance {
    /// The same bits (zeros of either sign are equal).
    Exact,
    /// Equal up to the order of summation.
    Close,
    /// Equal up to truncation of a numerical scheme.
    Approximate,
    /// At most so many units in the last place, element by element.
    Ulp(u32),
}

impl Tolerance {
    /// The relative bound in f64; zero for `Exact` and `Ulp`.
    pub const fn relative_f64(self) -> f64 {
        match self {
            Self::Exact | Self::Ulp(_) => 0.0,
            Self::Close => 1e-9,
            Self::Approximate => 1e-7,
        }
    }

    /// The relative bound in f32; zero for `Exact` and `Ulp`.
    pub const fn relative_f32(self) -> f64 {
        match self {
            Self::Exact | Self::Ulp(_) => 0.0,
            Self::Close => 1e-5,
            Self::Approximate => 1e-4,
        }
    }
}
