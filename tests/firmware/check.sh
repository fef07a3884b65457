#!/bin/sh
# Proves that daymark-core has no panic path: a device's program links, for a microcontroller and for this host, with a
# panic handler that calls a function nobody has. Prints what it takes of flash and RAM, and runs it on the host.
#
#     tests/firmware/check.sh
#
# Ends with 1 if a panic path is left, if the program does not recognize what it enrolled, or if it needs more stack
# than it has. Without the bare-metal target of the toolchain it says so and proves the rest.
set -eu
cd "$(dirname "$0")"
CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-../../target}/firmware"
export CARGO_TARGET_DIR
bare=thumbv7em-none-eabihf
host=$(rustc -vV | sed -n 's/^host: //p')

loudly() {
    printf '\n**** %s ****\n\n' "$*" >&2
}

# build OPT TARGET [more arguments of cargo]
build() {
    opt=$1 target=$2
    shift 2
    case $opt in s) opt='"s"' ;; esac
    cargo build --release --locked --target "$target" --config "profile.release.opt-level=$opt" "$@"
}

# Which functions have a panic path: links nevertheless, and asks the disassembler who calls the machinery of panics.
locate() {
    build "$1" "$2" --features locate --config 'profile.release.debug="line-tables-only"' || return 0
    program=$CARGO_TARGET_DIR/$2/release/firmware
    disassembler=$(command -v llvm-objdump || command -v objdump || true)
    symbolizer=$(command -v llvm-symbolizer || true)
    if [ -z "$disassembler" ] || [ -z "$symbolizer" ]; then
        echo "With llvm-objdump and llvm-symbolizer this would say where."
        return 0
    fi
    "$disassembler" -d --no-show-raw-insn "$program" |
        grep -E '<[^>]*(panicking|slice.*index|unwrap_failed|expect_failed|_fail)[^>+]*>' | grep -v '>:$' |
        sed 's/^ *\([0-9a-f]*\):.*/0x\1/' | sort -u |
        while read -r address; do
            "$symbolizer" --inlines --demangle --obj="$program" "$address" | grep -v '^$' | head -8
            echo
        done
}

prove() {
    if output=$(build "$1" "$2" 2>&1); then
        echo "no panic path: $2, opt-level $1"
    else
        echo "$output" >&2
        if echo "$output" | grep -q a_panic_path_is_left; then
            loudly "A PANIC PATH IS LEFT in daymark-core ($2, opt-level $1)"
            locate "$1" "$2" >&2
        fi
        exit 1
    fi
}

# Sizes of the sections whose names follow the program, added up.
sections() {
    program=$1
    shift
    size -A "$program" | awk -v names=" $* " 'index(names, " " $1 " ") { sum += $2 } END { print sum + 0 }'
}

# The bytes of each part as this target's compiler lays them out.
memory() {
    place=$(readelf -SW "$1" | sed -n 's/.*\.memory_table *PROGBITS *[0-9a-f]* *\([0-9a-f]*\) .*/\1/p')
    od -An -v -tu4 -w28 -j "$((0x$place))" -N 28 "$1" | awk '{
        first = $1 + $2 + $3; second = $4 + $5 + $6 + $3
        printf "  memory: features %d; first step: levels %d, extractor %d, in all %d", $3, $1, $2, first
        printf "; second step: distances %d, record %d, recognizer %d, in all %d\n", $4, $5, $6, second
        printf "  matching by nested hulls: %d, with the features %d\n", $7, $7 + $3
        printf "  peak of the memory: %d of 65536 bytes\n", (first > second ? first : second)
    }'
}

if [ ! -d "$(rustc --print sysroot)/lib/rustlib/$bare" ] && ! rustup target add "$bare"; then
    loudly "THE TARGET $bare CANNOT BE INSTALLED: nothing is proved for it, the host alone follows"
    bare=
fi

for opt in 3 s; do
    if [ -n "$bare" ]; then
        prove $opt "$bare"
        program=$CARGO_TARGET_DIR/$bare/release/firmware
        echo "  flash $(sections "$program" .vectors .text .rodata .memory_table .data) bytes;" \
            "RAM: stack $(sections "$program" .stack), static $(sections "$program" .data .bss)," \
            "frame $(sections "$program" .camera), table $(sections "$program" .table)"
        memory "$program"
    fi
    prove $opt "$host"
    program=$CARGO_TARGET_DIR/$host/release/firmware
    echo "  code and constants $(sections "$program" .text .rodata) bytes"
    memory "$program"
    if ! "$program"; then
        loudly "THE PROGRAM FAILED: it did not recognize what it enrolled, or its stack is beyond 65536 bytes"
        exit 1
    fi
done

# The proof proves something: the same program with one assertion does not link.
if output=$(build 3 "$host" --features control 2>&1); then
    loudly "THE PROOF IS WORTHLESS: a program with a panic path links"
    exit 1
elif ! echo "$output" | grep -q a_panic_path_is_left; then
    echo "$output" >&2
    exit 1
fi
echo "the control with a panic path does not link, as it should"
