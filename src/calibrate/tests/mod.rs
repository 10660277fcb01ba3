//! The calibration against a simulated sensor whose truth is known.

mod bench;
mod coverage;
mod partial;
mod poses;
