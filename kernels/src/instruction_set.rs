//! The instruction-set level a kernel runs at, chosen at run time.
//!
//! A kernel is one generic body in plain Rust (`Kernel::run`); it is compiled once a level, each time inside a function that
//! has that level's instructions enabled, so that the compiler turns the same loops into wider registers. This file is the only
//! place that calls such a function, and so the only place where the choice has to be argued to be safe.
//!
//! Without the feature `std` nobody can ask the processor: the levels are those that the whole program was compiled for.
//!
//! Not here: any arithmetic.

use alloc::borrow::ToOwned;
use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;
use core::marker::PhantomData;

use crate::Real;
use crate::maths::MUL_ADD_IS_INLINE;
use crate::vector::Vector;

/// Environment variable that forces a level: `plain`, `avx2`, `avx512` or `neon`.
pub const ENVIRONMENT_VARIABLE: &str = "PHYTURE_ISA";

/// A level this processor is known to have. Values other than [`InstructionSet::PLAIN`] exist only after the processor was asked, or where the program
/// was compiled for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InstructionSet(Kind);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Plain,
    Avx2,
    Avx512,
    Neon,
}

const NAMES: [(&str, Kind); 4] = [("plain", Kind::Plain), ("avx2", Kind::Avx2), ("avx512", Kind::Avx512), ("neon", Kind::Neon)];

/// A level was asked for that cannot be had.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum InstructionSetError {
    /// The name is none of the known ones.
    Unknown(String),
    /// The processor, or the architecture this was compiled for, does not have it.
    Unavailable(&'static str),
}

impl fmt::Display for InstructionSetError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let available: Vec<_> = InstructionSet::available().iter().map(|isa| isa.name()).collect();
        let available = available.join(", ");
        match self {
            Self::Unknown(name) => {
                write!(f, "{ENVIRONMENT_VARIABLE}: no instruction-set level is named '{name}'; here one of: {available}")
            }
            Self::Unavailable(name) => {
                write!(
                    f,
                    "{ENVIRONMENT_VARIABLE}: this processor does not have the level '{name}'; use one of: {available}, or unset it"
                )
            }
        }
    }
}

impl core::error::Error for InstructionSetError {}

impl InstructionSet {
    /// What every processor of the architecture has.
    pub const PLAIN: Self = Self(Kind::Plain);

    /// The level named in `PHYTURE_ISA`, otherwise the best one of this processor. Decided once a process. Without the feature `std` no
    /// environment is read: the best one that the program was compiled for.
    ///
    /// # Errors
    /// If `PHYTURE_ISA` names a level that is unknown or not available; nothing else is silently used in its place.
    pub fn detect() -> Result<Self, InstructionSetError> {
        #[cfg(feature = "std")]
        {
            static CHOSEN: std::sync::OnceLock<Result<InstructionSet, InstructionSetError>> = std::sync::OnceLock::new();
            CHOSEN
                .get_or_init(|| match std::env::var_os(ENVIRONMENT_VARIABLE) {
                    Some(name) if !name.is_empty() => Self::named(&name.to_string_lossy()),
                    _ => Ok(Self::best()),
                })
                .clone()
        }
        #[cfg(not(feature = "std"))]
        Ok(Self::best())
    }

    fn best() -> Self {
        Self::available().last().copied().unwrap_or(Self::PLAIN)
    }

    /// The level of this name.
    ///
    /// # Errors
    /// If the name is unknown or this processor does not have the level.
    pub fn named(name: &str) -> Result<Self, InstructionSetError> {
        let (name, kind) =
            *NAMES.iter().find(|(known, _)| *known == name).ok_or_else(|| InstructionSetError::Unknown(name.to_owned()))?;
        if kind.is_available() { Ok(Self(kind)) } else { Err(InstructionSetError::Unavailable(name)) }
    }

    /// All levels of this processor, slowest first.
    pub fn available() -> Vec<Self> {
        NAMES.iter().filter(|(_, kind)| kind.is_available()).map(|&(_, kind)| Self(kind)).collect()
    }

    /// `plain`, `avx2`, `avx512` or `neon`.
    pub fn name(self) -> &'static str {
        NAMES.iter().find(|(_, kind)| *kind == self.0).map_or("plain", |(name, _)| name)
    }

    /// Runs a kernel compiled for this level.
    #[inline]
    pub(crate) fn run<K: Kernel>(self, kernel: K) {
        match self.0 {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: an InstructionSet of this kind is made only by `named` and `available`, after `has` said that there are avx2 and fma.
            Kind::Avx2 => unsafe { avx2(kernel) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above, for avx512f, avx512bw, avx512dq, avx512vl, avx2 and fma.
            Kind::Avx512 => unsafe { avx512(kernel) },
            #[cfg(target_arch = "aarch64")]
            // SAFETY: as above, for neon.
            Kind::Neon => unsafe { neon(kernel) },
            _ => kernel.run::<Plain>(),
        }
    }

    /// Runs a kernel written for a tile of accumulators.
    #[inline]
    pub(crate) fn run_tiled<T: Real, K: Tiled<T>>(self, kernel: K) {
        self.run(WithTile { kernel, number: PhantomData });
    }
}

impl fmt::Display for InstructionSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Whether there are these kinds of instructions: what the processor says or, without the feature `std`, what the program was compiled for.
#[cfg(all(feature = "std", target_arch = "x86_64"))]
macro_rules! has {
    ($($feature:tt),*) => {
        $(std::arch::is_x86_feature_detected!($feature))&&*
    };
}
#[cfg(all(feature = "std", target_arch = "aarch64"))]
macro_rules! has {
    ($($feature:tt),*) => {
        $(std::arch::is_aarch64_feature_detected!($feature))&&*
    };
}
#[cfg(all(not(feature = "std"), any(target_arch = "x86_64", target_arch = "aarch64")))]
macro_rules! has {
    ($($feature:tt),*) => {
        cfg!(all($(target_feature = $feature),*))
    };
}

impl Kind {
    fn is_available(self) -> bool {
        match self {
            Self::Plain => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => has!("avx2", "fma"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => has!("avx512f", "avx512bw", "avx512dq", "avx512vl", "avx2", "fma"),
            #[cfg(target_arch = "aarch64")]
            Self::Neon => has!("neon"),
            _ => false,
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn avx2<K: Kernel>(kernel: K) {
    kernel.run::<Avx2>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma")]
fn avx512<K: Kernel>(kernel: K) {
    kernel.run::<Avx512>()
}

#[cfg(target_arch = "aarch64")]
#[target_feature(enable = "neon")]
fn neon<K: Kernel>(kernel: K) {
    kernel.run::<Neon>()
}

/// A kernel with its operands, ready to run. Implementations mark `run` and all they call `#[inline(always)]`: only then is the
/// body compiled with the level's instructions.
pub(crate) trait Kernel {
    /// The one body.
    fn run<I: Isa>(self);
}

/// A kernel whose body is written for a tile of MR x NR accumulators; see [`Isa::tiled`].
pub(crate) trait Tiled<T> {
    /// The one body.
    fn run<I: Isa, const MR: usize, const NR: usize>(self);
}

/// A tiled kernel as one that takes its tile from the level.
struct WithTile<T, K> {
    kernel: K,
    number: PhantomData<T>,
}

impl<T: Real, K: Tiled<T>> Kernel for WithTile<T, K> {
    #[inline(always)]
    fn run<I: Isa>(self) {
        I::tiled::<T, K>(self.kernel);
    }
}

/// What a body may know about the level it is compiled for.
pub(crate) trait Isa {
    /// Multiply-add is one instruction; where it is not, `mul_add` would be a call of the maths library.
    const FMA: bool;

    /// One register of numbers.
    type Vector<T: Real>: Vector<T>;

    /// Runs a body with the accumulator tile that fills this level's registers: two registers wide, as tall as leaves room for
    /// two of the right operand and one of the left.
    fn tiled<T: Real, K: Tiled<T>>(kernel: K);

    /// The same with a tile of one register's width and twice the rows: for results no wider than that.
    fn tall<T: Real, K: Tiled<T>>(kernel: K);

    /// a·b + c, rounded once where the level can.
    #[inline(always)]
    fn mul_add<T: Real>(a: T, b: T, c: T) -> T {
        if Self::FMA && MUL_ADD_IS_INLINE { a.mul_add(b, c) } else { a * b + c }
    }
}

pub(crate) struct Plain;
impl Isa for Plain {
    const FMA: bool = false;
    type Vector<T: Real> = T::Plain;
    #[inline(always)]
    fn tiled<T: Real, K: Tiled<T>>(kernel: K) {
        T::plain_tile(kernel);
    }
    #[inline(always)]
    fn tall<T: Real, K: Tiled<T>>(kernel: K) {
        T::plain_tall_tile(kernel);
    }
}

#[cfg(target_arch = "x86_64")]
pub(crate) struct Avx2;
#[cfg(target_arch = "x86_64")]
impl Isa for Avx2 {
    const FMA: bool = true;
    type Vector<T: Real> = T::Avx2;
    #[inline(always)]
    fn tiled<T: Real, K: Tiled<T>>(kernel: K) {
        T::avx2_tile(kernel);
    }
    #[inline(always)]
    fn tall<T: Real, K: Tiled<T>>(kernel: K) {
        T::avx2_tall_tile(kernel);
    }
}

#[cfg(target_arch = "x86_64")]
pub(crate) struct Avx512;
#[cfg(target_arch = "x86_64")]
impl Isa for Avx512 {
    const FMA: bool = true;
    type Vector<T: Real> = T::Avx512;
    #[inline(always)]
    fn tiled<T: Real, K: Tiled<T>>(kernel: K) {
        T::avx512_tile(kernel);
    }
    #[inline(always)]
    fn tall<T: Real, K: Tiled<T>>(kernel: K) {
        T::avx512_tall_tile(kernel);
    }
}

#[cfg(target_arch = "aarch64")]
pub(crate) struct Neon;
#[cfg(target_arch = "aarch64")]
impl Isa for Neon {
    const FMA: bool = true;
    type Vector<T: Real> = T::Neon;
    #[inline(always)]
    fn tiled<T: Real, K: Tiled<T>>(kernel: K) {
        T::neon_tile(kernel);
    }
    #[inline(always)]
    fn tall<T: Real, K: Tiled<T>>(kernel: K) {
        T::neon_tall_tile(kernel);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_is_always_there_and_names_round_trip() {
        let available = InstructionSet::available();
        assert_eq!(available.first(), Some(&InstructionSet::PLAIN));
        for isa in available {
            assert_eq!(InstructionSet::named(isa.name()), Ok(isa));
        }
    }

    #[test]
    fn a_wrong_name_is_refused_and_told_what_there_is() {
        let error = InstructionSet::named("sse9").unwrap_err();
        assert_eq!(error, InstructionSetError::Unknown("sse9".to_owned()));
        assert!(error.to_string().contains("plain"));
        let missing = NAMES.iter().find(|(_, kind)| !kind.is_available()).map(|(name, _)| *name);
        let missing = missing.expect("no processor has both avx512 and neon");
        assert_eq!(InstructionSet::named(missing), Err(InstructionSetError::Unavailable(missing)));
    }

    #[cfg(feature = "std")]
    #[test]
    fn the_environment_variable_decides() {
        let expected = match std::env::var(ENVIRONMENT_VARIABLE) {
            Ok(name) if !name.is_empty() => InstructionSet::named(&name),
            _ => Ok(*InstructionSet::available().last().expect("plain is always there")),
        };
        assert_eq!(InstructionSet::detect(), expected);
    }
}
