#!/bin/sh
# Counts the instructions of the pose step (60 correspondences) on a Cortex-M4F, in QEMU:
#
#     tests/firmware/count.sh
#
# It wants the target thumbv7em-none-eabihf and qemu-system-arm. Instructions are not cycles: a Cortex-M4F without wait states
# takes between one and two cycles for most of them.
set -eu
cd "$(dirname "$0")/count"
CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-../../../target}/firmware-count"
export CARGO_TARGET_DIR
target=thumbv7em-none-eabihf
cargo build --release --locked --quiet --target $target
exec qemu-system-arm -machine mps2-an386 -icount shift=0 -nographic -monitor none -serial none \
    -semihosting-config enable=on,target=native -kernel "$CARGO_TARGET_DIR/$target/release/daymark-pose-count"
