//! Raw V4L2 bindings, generated beforehand; see the README.
#![allow(clippy::all, clippy::pedantic)]
#![allow(missing_docs, missing_debug_implementations, unreachable_pub)]
#![allow(non_camel_case_types, non_snake_case, non_upper_case_globals, dead_code)]

include!("bindings.rs");

#[cfg(target_pointer_width = "64")]
mod layout;
