//! Hands the linker this board's regions and the project's memory.x, which includes them.

use std::path::PathBuf;
use std::{env, fs};

fn main() {
    let board = PathBuf::from(env::var("CARGO_MANIFEST_DIR").unwrap());
    let out = PathBuf::from(env::var("OUT_DIR").unwrap());
    let small = env::var_os("CARGO_FEATURE_SMALL").is_some();
    // not called board.x here: the linker would find that one first, whatever the features
    let regions = board.join(if small { "small.x" } else { "reference.x" });
    fs::copy(&regions, out.join("board.x")).unwrap();
    // the interrupts are in src/interrupts.rs; none has a handler of its own
    fs::write(out.join("device.x"), "").unwrap();
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rustc-link-search={}", board.join("../..").display());
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rustc-link-arg-bins=--nmagic");
    println!("cargo:rustc-link-arg-bins=-Map={}", out.join("link.map").display());
    for file in ["reference.x", "small.x", "build.rs", "../../memory.x"] {
        println!("cargo:rerun-if-changed={file}");
    }
}
