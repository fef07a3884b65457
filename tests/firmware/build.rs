//! Tells the linker where flash and RAM are; a host knows.

fn main() {
    println!("cargo:rerun-if-changed=memory.x");
    if std::env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "none") {
        let folder = std::env::var("CARGO_MANIFEST_DIR").expect("cargo sets it");
        println!("cargo:rustc-link-arg=-T{folder}/memory.x");
        println!("cargo:rustc-link-arg=--gc-sections");
    }
}
