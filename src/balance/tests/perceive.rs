//! Support polygon, projection and extrapolated centre of mass.

use nalgebra::{Vector2, Vector3};
use proptest::prelude::*;

use super::super::{BalanceController, BalanceSettings, MomentumController, SupportPolygon, perceive};
use super::{Random, standing};
use crate::character::CONTACTS;
use crate::dynamics::{Dynamics, GroundSurface, Simulator};

fn polygon(points: [(f64, f64); CONTACTS]) -> SupportPolygon {
    SupportPolygon::of_points(&points.map(|(x, y)| Vector3::new(x, y, 0.0)))
}

#[test]
fn the_hull_of_a_square_with_points_inside_and_on_its_edge() {
    let square = polygon([(0., 0.), (2., 0.), (2., 2.), (0., 2.), (1., 1.), (1., 0.), (2., 1.), (0.5, 0.2)]);
    let corners: Vec<(f64, f64)> = square.corners().iter().map(|c| (c.x, c.y)).collect();
    assert_eq!(corners, [(0., 0.), (2., 0.), (2., 2.), (0., 2.)]);
    for (point, margin) in [
        ((1.0, 1.0), 1.0),
        ((0.25, 1.0), 0.25),
        ((-0.5, 1.0), -0.5),
        ((3.0, 3.0), -libm::sqrt(2.0)),
        ((2.0, 1.0), 0.0),
    ] {
        let got = square.margin(&Vector2::new(point.0, point.1));
        assert!((got - margin).abs() < 1e-12, "{point:?}: {got}");
    }
}

#[test]
fn points_on_a_line_or_on_one_spot_have_no_inside() {
    let line = polygon(std::array::from_fn(|i| (i as f64, 2.0 * i as f64)));
    assert_eq!(line.corners().len(), 2);
    assert!(line.margin(&Vector2::new(2.0, 4.0)) <= 0.0);
    assert!((line.margin(&Vector2::new(-1.0, -2.0)) + libm::sqrt(5.0)).abs() < 1e-12);
    let spot = polygon([(1.0, 1.0); CONTACTS]);
    assert_eq!(spot.margin(&Vector2::new(1.0, 4.0)), -3.0);
}

proptest! {
    #[test]
    fn every_point_lies_in_the_convex_hull(
        points in prop::array::uniform8((-1.0..1.0f64, -1.0..1.0f64)),
    ) {
        let hull = polygon(points);
        let corners = hull.corners();
        for (i, a) in corners.iter().enumerate() {
            let (b, c) = (corners[(i + 1) % corners.len()], corners[(i + 2) % corners.len()]);
            prop_assert!((b - a).perp(&(c - b)) > 0.0, "not convex");
        }
        for (x, y) in points {
            prop_assert!(hull.margin(&Vector2::new(x, y)) > -1e-12);
            let out = 3.0 * Vector2::new(x, y).try_normalize(1e-9).unwrap_or_else(Vector2::x);
            prop_assert!(hull.margin(&out) < 0.0);
        }
    }
}

#[test]
fn at_rest_with_true_gravity_everything_is_the_geometry_of_the_pose() {
    let body = standing();
    let gravity = body.model().gravity;
    let perceived = perceive(&body, &GroundSurface::level(1.0), &gravity);
    assert!((perceived.com_projected_world.xy() - perceived.com_world.xy()).norm() < 1e-12);
    assert!(perceived.com_projected_world.z.abs() < 1e-12);
    assert!((perceived.xcom_world - perceived.com_world.xy()).norm() < 1e-12);
    assert!((perceived.com_world.x - perceived.support.centroid_world.x + 0.01).abs() < 1e-6);
    // 0.258 m long soles, the centre of mass 10 mm behind their middle.
    assert!((perceived.margin - (0.129 - 0.010)).abs() < 1e-3, "{}", perceived.margin);
    assert_eq!(perceived.linear_momentum, Vector3::zeros());
}

#[test]
fn a_tilted_belief_moves_the_projection_and_a_velocity_the_xcom() {
    let mut body = standing();
    let tilt = 0.1;
    let gravity = 9.81 * Vector3::new(libm::sin(tilt), 0.0, -libm::cos(tilt));
    let ground = GroundSurface::level(1.0);
    let perceived = perceive(&body, &ground, &gravity);
    let shift = perceived.com_projected_world - perceived.com_world;
    assert!((shift.x - perceived.com_world.z * libm::tan(tilt)).abs() < 1e-12);

    let mut state = *body.state();
    state.velocity[1] = 0.2;
    body.set_state(state);
    let perceived = perceive(&body, &ground, &body.model().gravity);
    let omega0 = libm::sqrt(9.81 / perceived.com_world.z);
    let lean = perceived.xcom_world - perceived.com_world.xy();
    assert!((lean - Vector2::new(0.0, 0.2 / omega0)).norm() < 1e-12);
}

#[test]
fn a_belief_upside_down_sideways_or_gone_stays_finite() {
    let mut random = Random(4);
    let ground = GroundSurface::turntable(0.3, 2.0, 0.5, 1.0);
    let beliefs = [
        Vector3::zeros(),
        Vector3::new(0.0, 0.0, 9.81),
        Vector3::new(9.81, 0.0, 0.0),
        Vector3::new(-9.81, 0.0, 1e-12),
        Vector3::new(0.0, 1e-300, 0.0),
        Vector3::new(1e6, 0.0, -1e6),
    ];
    for gravity in beliefs {
        let body = random.swaying(0.2);
        let perceived = perceive(&body, &ground, &gravity);
        let finite = perceived.com_projected_world.iter().chain(perceived.xcom_world.iter());
        assert!(finite.chain([&perceived.margin]).all(|x| x.is_finite()), "{gravity}: {perceived:?}");
        let settings = BalanceSettings::default();
        let control = MomentumController::new(settings, &body).control(&body, &ground, &perceived);
        assert!(control.torques.iter().all(|t| t.abs() <= settings.torque_limit), "{gravity}: {control:?}");
        assert!(control.report.constraint_residual.is_finite(), "{gravity}");
    }
}
