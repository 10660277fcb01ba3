//! The claims, figure by figure.
//!
//! Bands that are not the paper's own: ±15 % around the reference for the peaks after 30 rpm for 15 s, and ±40 % around
//! the paper's ranges of the centre of mass, whose axes the paper does not define. A band whose end is another run's
//! value is an ordering.

pub(super) mod motions;
pub(super) mod push;
pub(super) mod spin;
pub(super) mod yaw;
