//! Nothing: this package has benches only, see its Cargo.toml.
