//! What the controller believes about its balance: the only place with the projected centre of mass, the XCoM and
//! the margin of stability.

use nalgebra::{Vector2, Vector3};

use crate::character::CONTACTS;
use crate::dynamics::{Dynamics, GroundSurface};

/// The believed vertical must not lie flatter than this against the ground (cosine), or its projection runs away.
const LEAST_UPRIGHTNESS: f64 = 0.1;

/// Everything the controller believes about its balance. World axes; lengths from the world's origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PerceivedBalance {
    /// Believed gravity ĝ, m/s².
    pub gravity_world: Vector3<f64>,
    /// Centre of mass c, m.
    pub com_world: Vector3<f64>,
    /// Its velocity ċ, m/s: inertial, also on a turning platform.
    pub com_velocity_world: Vector3<f64>,
    /// Centre of mass projected along ĝ onto the ground (Eq. 20), m.
    pub com_projected_world: Vector3<f64>,
    /// Contact points and their hull.
    pub support: SupportPolygon,
    /// Extrapolated centre of mass ξ = c_proj + (ċ - v_ground)/ω0 (Hof 2008), m.
    pub xcom_world: Vector2<f64>,
    /// Distance of ξ to the edge of the support, m; negative outside.
    pub margin: f64,
    /// Linear momentum, N s.
    pub linear_momentum: Vector3<f64>,
    /// Angular momentum about the centre of mass, N m s.
    pub angular_momentum: Vector3<f64>,
}

/// Convex hull of the contact points on the ground, and their centroid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SupportPolygon {
    /// Mean of the contact points, on the ground, m.
    pub centroid_world: Vector3<f64>,
    corners: [Vector2<f64>; CONTACTS],
    count: usize,
}

impl SupportPolygon {
    /// Hull of eight points of the ground (Andrew's monotone chain), and their mean.
    pub fn of_points(points: &[Vector3<f64>; CONTACTS]) -> Self {
        let centroid_world = points.iter().sum::<Vector3<f64>>() / CONTACTS as f64;
        let mut sorted: [Vector2<f64>; CONTACTS] = std::array::from_fn(|i| points[i].xy());
        sorted.sort_unstable_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
        // One more than the points: the walk back ends on the first corner, which is then dropped.
        let mut hull = [Vector2::zeros(); 2 * CONTACTS];
        let mut count = 0;
        let forward = sorted.iter();
        let back = sorted.iter().rev().skip(1);
        let mut lower = 1;
        for (step, point) in forward.chain(back).enumerate() {
            if step == CONTACTS {
                lower = count;
            }
            while count > lower && turn(&hull[count - 2], &hull[count - 1], point) <= 0.0 {
                count -= 1;
            }
            hull[count] = *point;
            count += 1;
        }
        count = (count - 1).clamp(1, CONTACTS);
        Self { centroid_world, corners: std::array::from_fn(|i| hull[i]), count }
    }

    /// Corners counter-clockwise, seen from above.
    pub fn corners(&self) -> &[Vector2<f64>] {
        &self.corners[..self.count]
    }

    /// Distance of `point` to the nearest edge, m; negative outside. A hull of fewer than three corners has no inside.
    pub fn margin(&self, point: &Vector2<f64>) -> f64 {
        let corners = self.corners();
        let mut nearest = f64::INFINITY;
        let mut inside = corners.len() >= 3;
        for (i, a) in corners.iter().enumerate() {
            let b = &corners[(i + 1) % corners.len()];
            inside &= turn(a, b, point) >= 0.0;
            nearest = nearest.min(distance_to_edge(a, b, point));
        }
        if inside { nearest } else { -nearest }
    }
}

/// Twice the area of the triangle; positive for a left turn.
fn turn(a: &Vector2<f64>, b: &Vector2<f64>, c: &Vector2<f64>) -> f64 {
    (b - a).perp(&(c - a))
}

fn distance_to_edge(a: &Vector2<f64>, b: &Vector2<f64>, point: &Vector2<f64>) -> f64 {
    let edge = b - a;
    let length_squared = edge.norm_squared();
    let share =
        if length_squared > 0.0 { ((point - a).dot(&edge) / length_squared).clamp(0.0, 1.0) } else { 0.0 };
    (point - (a + share * edge)).norm()
}

/// Fills [`PerceivedBalance`] for the present state and the believed gravity.
///
/// A believed gravity that points up or nearly along the ground is projected as if it stood a tenth (cosine)
/// upright: by then the character has fallen, and the numbers must stay finite.
#[inline(never)] // a stage of its own in a profile
pub fn perceive<D: Dynamics>(
    body: &D,
    ground: &GroundSurface,
    gravity_world: &Vector3<f64>,
) -> PerceivedBalance {
    let com = body.com();
    let (linear_momentum, angular_momentum) = body.momentum();
    let com_velocity = linear_momentum / body.inertias().composite[0].mass;
    let points: [Vector3<f64>; CONTACTS] = std::array::from_fn(|i| {
        let point = body.kinematics().contact_position(body.model(), i);
        point - ground.height(&point) * ground.normal
    });
    let support = SupportPolygon::of_points(&points);

    let height = ground.height(&com);
    let strength = gravity_world.norm();
    let downward = (-gravity_world.dot(&ground.normal)).max(LEAST_UPRIGHTNESS * strength);
    let projected = if downward > 0.0 { com + (height / downward) * gravity_world } else { com };
    let relative = com_velocity - ground.velocity_at(&com);
    let omega0 = (downward / height.max(0.1)).sqrt();
    let lean = if omega0 > 0.0 { relative.xy() / omega0 } else { Vector2::zeros() };
    let xcom_world = projected.xy() + lean;
    PerceivedBalance {
        gravity_world: *gravity_world,
        com_world: com,
        com_velocity_world: com_velocity,
        com_projected_world: projected,
        support,
        xcom_world,
        margin: support.margin(&xcom_world),
        linear_momentum,
        angular_momentum,
    }
}
