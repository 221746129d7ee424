//! Hands the linker this board's regions and the project's memory.x, which includes them.

use std::path::PathBuf;
use std::{env, fs};

fn main() {
    let board = PathBuf::from(env::var("CARGO_MANIFEST_DIR").unwrap());
    let out = PathBuf::from(env::var("OUT_DIR").unwrap());
    // not called board.x here: the linker would find that one first
    fs::copy(board.join("regions.x"), out.join("board.x")).unwrap();
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rustc-link-search={}", board.join("../..").display());
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rustc-link-arg-bins=-Tdefmt.x");
    println!("cargo:rustc-link-arg-bins=--nmagic");
    println!("cargo:rustc-link-arg-bins=-Map={}", out.join("link.map").display());
    for file in ["regions.x", "build.rs", "../../memory.x"] {
        println!("cargo:rerun-if-changed={file}");
    }
}
