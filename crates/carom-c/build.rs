//! Names the shared library in its file, so that programs find it by its name and the part of the version that breaks.

fn main() {
    let version = |part: &str| std::env::var(format!("CARGO_PKG_VERSION_{part}")).unwrap_or_default();
    let (major, minor) = (version("MAJOR"), version("MINOR"));
    match std::env::var("CARGO_CFG_TARGET_OS").as_deref() {
        Ok("linux") => println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,libcarom_c.so.{major}.{minor}"),
        Ok("macos") => {
            println!("cargo:rustc-cdylib-link-arg=-Wl,-install_name,@rpath/libcarom_c.{major}.{minor}.dylib")
        }
        _ => {}
    }
    println!("cargo:rerun-if-changed=build.rs");
}
