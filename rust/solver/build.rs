//! Leaves the lanes of AVX-512 out of builds for development, where they are a fifth of what is
//! compiled: rovers then go four to a register. Builds that check arithmetic have them.

fn main() {
    println!("cargo::rustc-check-cfg=cfg(eight_lanes)");
    let set = |name: &str| std::env::var(name).unwrap_or_default();
    let is_optimised = !["0", "1"].contains(&set("OPT_LEVEL").as_str());
    if is_optimised || std::env::var_os("CARGO_CFG_DEBUG_ASSERTIONS").is_some() {
        println!("cargo::rustc-cfg=eight_lanes");
    }
    println!("cargo::rerun-if-changed=build.rs");
}
