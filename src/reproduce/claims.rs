//! The claims, figure by figure.
//!
//! Bands that are not the paper's own: ±15 % around the reference for the peaks after 30 rpm for 15 s, and ±40 % around
//! the paper's ranges of the centre of mass, whose axes the paper does not define. Where the paper has only words ("almost
//! static", "foot tilt", "noticeable", "falls quickly") the number is ours and an assumption; those of Figure 6 lie around
//! the model's closed form. A band whose end is another run's value is an ordering.

pub(super) mod motions;
pub(super) mod push;
pub(super) mod spin;
pub(super) mod yaw;
