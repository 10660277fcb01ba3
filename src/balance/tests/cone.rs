//! The exact force distribution against a slow first-order method and its own optimality conditions.

use std::ops::AddAssign;

use nalgebra::{SMatrix, SVector, Vector3};

use super::super::ForceDistribution;
use super::Random;
use crate::character::CONTACTS;

const SOFTNESS: f64 = 1e-4;
const FRICTION: f64 = 0.707;

type Points = [Vector3<f64>; CONTACTS];
type Wrench = SVector<f64, 6>;

/// The soles of a standing character, about a point at pelvis height.
fn soles() -> Points {
    std::array::from_fn(|i| {
        let forward = if i % 4 < 2 { 0.19 } else { -0.07 };
        let outward = if i % 2 == 0 { 0.047 } else { -0.047 };
        let foot = if i < 4 { 0.083 } else { -0.083 };
        Vector3::new(forward - 0.06, foot + outward, -0.9)
    })
}

fn wrench_of(points: &Points, force: &[Vector3<f64>; CONTACTS]) -> Wrench {
    let mut total = Wrench::zeros();
    for (p, f) in points.iter().zip(force) {
        let moment = p.cross(f);
        total += Wrench::new(f.x, f.y, f.z, moment.x, moment.y, moment.z);
    }
    total
}

fn inside(force: &Vector3<f64>, least: f64) -> bool {
    libm::hypot(force.x, force.y) <= FRICTION * (force.z - least) + 1e-9 && force.z >= least - 1e-9
}

fn project(v: &Vector3<f64>) -> Vector3<f64> {
    let (length, mu) = (libm::hypot(v.x, v.y), FRICTION);
    if length <= mu * v.z {
        *v
    } else if mu * length <= -v.z {
        Vector3::zeros()
    } else {
        let s = (v.z + mu * length) / (1.0 + mu * mu);
        Vector3::new(v.x * mu * s / length, v.y * mu * s / length, s)
    }
}

/// `min ½ Σ|F|² + |A F - w|² / (2 δ)` by accelerated projected gradient for a strongly convex function.
fn slow(points: &Points, wrench: &Wrench) -> [Vector3<f64>; CONTACTS] {
    let mut map = SMatrix::<f64, 6, 24>::zeros();
    for (i, p) in points.iter().enumerate() {
        map.fixed_view_mut::<3, 3>(0, 3 * i).fill_with_identity();
        map.fixed_view_mut::<3, 3>(3, 3 * i).copy_from(&p.cross_matrix());
    }
    let steepest = 1.0 + (map * map.transpose()).norm() / SOFTNESS;
    let momentum = (steepest.sqrt() - 1.0) / (steepest.sqrt() + 1.0);
    let mut force = SVector::<f64, 24>::zeros();
    let mut ahead = force;
    for _ in 0..30_000 {
        let gradient = ahead + map.transpose() * (map * ahead - wrench) / SOFTNESS;
        let trial = ahead - gradient / steepest;
        let mut next = trial;
        for i in 0..CONTACTS {
            let f = project(&trial.fixed_rows::<3>(3 * i).into_owned());
            next.fixed_rows_mut::<3>(3 * i).copy_from(&f);
        }
        ahead = next + momentum * (next - force);
        force = next;
    }
    std::array::from_fn(|i| force.fixed_rows::<3>(3 * i).into_owned())
}

#[test]
fn a_wrench_the_ground_can_supply_is_supplied() {
    let mut random = Random(1);
    for _ in 0..200 {
        let points = soles();
        let least = 2.0;
        let inner: [Vector3<f64>; CONTACTS] = std::array::from_fn(|_| {
            let normal = 40.0 + 40.0 * random.unit();
            let t = 0.7 * FRICTION * normal * random.vector();
            Vector3::new(t.x, t.y, normal + least)
        });
        let wrench = wrench_of(&points, &inner);
        let shared = ForceDistribution::default().share(&points, &Vector3::z(), &wrench, FRICTION, least);
        assert!(shared.force.iter().all(|f| inside(f, least)));
        assert!((wrench_of(&points, &shared.force) + shared.unsupplied - wrench).norm() < 1e-9);
        // The softness leaves δ y; y grows beyond the points' forces when several stand on their cones.
        assert!(shared.unsupplied.norm() < 1e-3 * wrench.norm(), "{}", shared.unsupplied.norm());
        // Least norm among all that supply it.
        let norm = |forces: &[Vector3<f64>; CONTACTS]| {
            forces.iter().map(|f| (f.z - least) * (f.z - least) + f.xy().norm_squared()).sum::<f64>()
        };
        assert!(norm(&shared.force) <= norm(&inner) * (1.0 + 1e-6));
    }
}

#[test]
fn equals_the_slow_method_also_when_the_wrench_cannot_be_supplied() {
    let mut random = Random(2);
    let mut limited = 0;
    for case in 0..20 {
        let points = soles();
        // The weight at a place that may lie beyond the soles, with a sideways force.
        let place = Vector3::new(0.25 * random.unit(), 0.25 * random.unit(), -0.9);
        let force = Vector3::new(300.0 * random.unit(), 300.0 * random.unit(), 600.0);
        let moment = place.cross(&force);
        let wrench = Wrench::new(force.x, force.y, force.z, moment.x, moment.y, moment.z);
        let fast = ForceDistribution::default().share(&points, &Vector3::z(), &wrench, FRICTION, 0.0);
        limited += u32::from(fast.unsupplied.norm() > 1.0);
        let slow = slow(&points, &wrench);
        for (f, s) in fast.force.iter().zip(&slow) {
            assert!((f - s).norm() < 1e-4 * 600.0, "case {case}: {f} {s}");
        }
    }
    assert!(limited >= 5, "{limited}");
}

#[test]
fn the_answer_satisfies_the_optimality_conditions_and_does_not_depend_on_the_start() {
    let mut random = Random(3);
    let mut warm = ForceDistribution::default();
    for _ in 0..300 {
        let points = soles().map(|p| p + 0.01 * random.vector());
        let mut wrench = Wrench::from_fn(|i, _| [150.0, 150.0, 300.0, 60.0, 60.0, 20.0][i] * random.unit());
        wrench.z += 500.0;
        let place = Vector3::new(0.0, 0.0, -0.9);
        let moment = place.cross(&wrench.fixed_rows::<3>(0).into_owned());
        wrench.fixed_rows_mut::<3>(3).add_assign(&moment);
        let from_warm = warm.share(&points, &Vector3::z(), &wrench, FRICTION, 0.0);
        let from_cold = ForceDistribution::default().share(&points, &Vector3::z(), &wrench, FRICTION, 0.0);
        // unsupplied = δ y, and each force is the projection of what y asks of its point.
        let y = from_warm.unsupplied / SOFTNESS;
        for (i, p) in points.iter().enumerate() {
            let asked = y.fixed_rows::<3>(0) + y.fixed_rows::<3>(3).cross(p);
            let error = (from_warm.force[i] - project(&asked)).norm();
            assert!(error < 1e-3, "{error}");
            let difference = (from_warm.force[i] - from_cold.force[i]).norm();
            assert!(difference < 1e-3, "{difference}");
        }
    }
}

#[test]
fn wild_wrenches_give_forces_of_their_own_size() {
    let mut random = Random(5);
    let mut warm = ForceDistribution::default();
    for _ in 0..1000 {
        let points = soles().map(|p| p + 0.1 * random.vector());
        let wrench = Wrench::from_fn(|_, _| 1000.0 * random.unit());
        let shared = warm.share(&points, &Vector3::z(), &wrench, FRICTION, 0.0);
        assert!(shared.force.iter().all(|f| inside(f, 0.0) && f.norm() < 20.0 * wrench.norm()), "{shared:?}");
    }
}

#[test]
fn a_pull_gets_nothing_and_bad_numbers_do_not_stay() {
    let points = soles();
    let mut distribution = ForceDistribution::default();
    let pull = Wrench::new(0.0, 0.0, -500.0, 0.0, 0.0, 0.0);
    let shared = distribution.share(&points, &Vector3::z(), &pull, FRICTION, 0.0);
    assert!(shared.force.iter().all(|f| f.norm() < 1e-9));
    distribution.share(&points, &Vector3::z(), &Wrench::repeat(f64::NAN), FRICTION, 0.0);
    distribution.share(&points, &Vector3::z(), &Wrench::repeat(1e300), FRICTION, 0.0);
    let weight = wrench_of(&points, &[Vector3::new(0.0, 0.0, 80.0); CONTACTS]);
    let shared = distribution.share(&points, &Vector3::z(), &weight, FRICTION, 0.0);
    assert!(shared.force.iter().all(|f| (f.z - 80.0).abs() < 0.1 && f.xy().norm() < 0.1), "{shared:?}");
}
