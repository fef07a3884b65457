//! The inner loops of core, compiled again for the vector instructions that this processor turns out to have.
//!
//! Each function of `x86` *is* the loop of [`daymark_core::kernel`], inlined into a function with a target feature; only
//! the two of `by_hand` are written again. A test compares all of them with the portable ones, bit for bit.

#![allow(unsafe_code, reason = "calling a function with a target feature, after asking the processor for it")]

#[cfg(target_arch = "x86_64")]
mod by_hand;
#[cfg(target_arch = "x86_64")]
mod x86;

use daymark_core::kernel::{Kernels, Portable};

#[cfg(target_arch = "x86_64")]
pub use x86::{Avx2, Avx512};

/// The kernels of one processor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Processor {
    /// Any processor.
    Portable,
    /// x86-64 with AVX2.
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
    /// x86-64 with AVX-512 (F, BW, DQ, VL, VPOPCNTDQ).
    #[cfg(target_arch = "x86_64")]
    Avx512(Avx512),
}

impl Processor {
    /// The fastest kernels that run here. `DAYMARK_KERNELS=portable` or `avx2` asks for less, to compare.
    pub fn detect() -> Self {
        let wanted = std::env::var("DAYMARK_KERNELS").unwrap_or_default();
        Self::available()
            .into_iter()
            .rev()
            .find(|kernels| wanted.is_empty() || wanted == kernels.name())
            .unwrap_or(Self::Portable)
    }

    /// All kernels that run here, the fastest last.
    pub fn available() -> Vec<Self> {
        #[allow(unused_mut, reason = "other processors have the portable kernels only")]
        let mut available = vec![Self::Portable];
        #[cfg(target_arch = "x86_64")]
        {
            available.extend(Avx2::detect().map(Self::Avx2));
            available.extend(Avx512::detect().map(Self::Avx512));
        }
        available
    }

    /// Its kernels. A call by the table of methods costs nothing beside a row of pixels or a list of distances, and the
    /// loops around the kernels are compiled once.
    pub fn kernels(&self) -> &dyn Kernels {
        match self {
            Self::Portable => &Portable,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(kernels) => kernels,
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(kernels) => kernels,
        }
    }

    /// A short name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => "avx2",
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => "avx512",
        }
    }
}
