//! The memory of the handheld profile, part by part.

use daymark_core::capacity::HandheldMemory;

#[test]
fn a_handheld_device_needs_at_most_64_kilobytes_beside_the_frame() {
    let memory = HandheldMemory::of_frame(320, 240);
    println!("handheld profile, frame of 320 x 240 px, 300 corners, {}-bit pointers", usize::BITS);
    for (part, bytes) in [
        ("level scratch", memory.levels),
        ("extractor", memory.extractor),
        ("features", memory.features),
        ("extracting", memory.extracting()),
        ("distances", memory.distances),
        ("one record", memory.record),
        ("recognizer", memory.recognizer),
        ("features", memory.features),
        ("recognizing", memory.recognizing()),
        ("peak", memory.peak()),
    ] {
        println!("{part:>14} {bytes:>6} bytes");
    }
    assert!(memory.peak() <= 64 * 1_024);
    assert!(memory.distances + memory.record <= memory.levels, "the levels can be lent again");
}
