//! The kernel sets of x86-64.

use daymark_core::feature::Signature;
use daymark_core::kernel::{self, BoxSums, Kernels, LookAlikes, Nearest, Patch, Search, Seed, VoteColumns};

/// Implements [`Kernels`] for `$name` by calling core's loops in functions with `$features`.
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
                unsafe { super::by_hand::$by_hand::tensor_row(gradients, out) }
            }

            fn marks_at_most(&self, values: &[u8], limit: u8, marks: &mut [u64]) {
                // SAFETY: as above.
                unsafe { super::by_hand::$by_hand::marks_at_most(values, limit, marks) }
            }
        }
    };
}

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

all_kernels!(
    /// Kernels for AVX2.
    Avx2,
    "avx2,popcnt,bmi1,bmi2,lzcnt",
    ["avx2", "popcnt", "bmi1", "bmi2", "lzcnt"],
    avx2
);
all_kernels!(
    /// Kernels for AVX-512 with a vector population count.
    Avx512,
    "avx2,popcnt,bmi1,bmi2,lzcnt,avx512f,avx512bw,avx512dq,avx512vl,avx512vpopcntdq",
    ["avx2", "popcnt", "bmi1", "bmi2", "lzcnt", "avx512f", "avx512bw", "avx512dq", "avx512vl", "avx512vpopcntdq"],
    avx512
);
