//! The inner loops of core, compiled again for the vector instructions that this processor turns out to have.
//!
//! Each function below *is* the loop of [`daymark_core::kernel`], inlined into a function with a target feature; only
//! the two of `by_hand` are written again. A test compares all of them with the portable ones, bit for bit.

#![allow(unsafe_code, reason = "calling a function with a target feature, after asking the processor for it")]

#[cfg(target_arch = "x86_64")]
mod by_hand;

use daymark_core::feature::Signature;
use daymark_core::kernel::{self, BoxSums, Kernels, LookAlikes, Nearest, Patch, Portable, Search, Seed, VoteColumns};

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

/// Implements [`Kernels`] for `$name` by calling core's loops in functions with `$features`.
#[cfg(target_arch = "x86_64")]
macro_rules! kernels {
    ($(#[$doc:meta])* $name:ident, $features:literal, [$($feature:tt),+], $by_hand:ident; $($function:ident($($argument:ident: $kind:ty),*) $(-> $result:ty)?;)+) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub struct $name(());

        impl $name {
            /// The kernels, if this processor has what they need.
            pub fn detect() -> Option<Self> {
                ($(std::is_x86_feature_detected!($feature))&&+).then_some(Self(()))
            }
        }

        impl Kernels for $name {
            $(
                fn $function(&self, $($argument: $kind),*) $(-> $result)? {
                    #[target_feature(enable = $features)]
                    fn widened($($argument: $kind),*) $(-> $result)? {
                        kernel::$function($($argument),*)
                    }
                    // SAFETY: a value of this type exists only if `detect` found all of these features.
                    unsafe { widened($($argument),*) }
                }
            )+

            fn tensor_row(&self, gradients: [&[i16]; 2], out: [&mut [i32]; 3]) {
                // SAFETY: as above.
                unsafe { by_hand::$by_hand::tensor_row(gradients, out) }
            }

            fn marks_at_most(&self, values: &[u8], limit: u8, marks: &mut [u64]) {
                // SAFETY: as above.
                unsafe { by_hand::$by_hand::marks_at_most(values, limit, marks) }
            }
        }
    };
}

#[cfg(target_arch = "x86_64")]
macro_rules! all_kernels {
    ($(#[$doc:meta])* $name:ident, $features:literal, $list:tt, $by_hand:ident) => {
        kernels! {
            $(#[$doc])* $name, $features, $list, $by_hand;
            shrink_seven_to_five(rows: [&[u8]; 3], weights: [u16; 3], out: &mut [u8]);
            halve(upper: &[u8], lower: &[u8], out: &mut [u8]);
            tone_row(row: &[u8], out: &mut [u8]);
            gradient_row(rows: [&[u8]; 3], out: [&mut [i16]; 2]);
            response_row(rows: [[&[i32]; 3]; 5], out: &mut [f32]);
            peak_flags(rows: [&[f32]; 3], least: f32, flags: &mut [u8]);
            box_sums(patch: &Patch, sums: &mut BoxSums);
            distances(signature: Signature, others: &[Signature], out: &mut [u8]);
            count_below(values: &[u8], limit: u8) -> u32;
            closest(blocks: &[LookAlikes], search: Search) -> i32;
            nearest_three(row: &[u8], limit: u8) -> Nearest;
            votes(seed: Seed, columns: VoteColumns<'_>, agrees: &mut [u8]) -> i32;
        }
    };
}

#[cfg(target_arch = "x86_64")]
all_kernels!(
    /// Kernels for AVX2.
    Avx2,
    "avx2,popcnt,bmi1,bmi2,lzcnt",
    ["avx2", "popcnt", "bmi1", "bmi2", "lzcnt"],
    avx2
);
#[cfg(target_arch = "x86_64")]
all_kernels!(
    /// Kernels for AVX-512 with a vector population count.
    Avx512,
    "avx2,popcnt,bmi1,bmi2,lzcnt,avx512f,avx512bw,avx512dq,avx512vl,avx512vpopcntdq",
    ["avx2", "popcnt", "bmi1", "bmi2", "lzcnt", "avx512f", "avx512bw", "avx512dq", "avx512vl", "avx512vpopcntdq"],
    avx512
);
