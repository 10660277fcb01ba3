//! Spatial (6-D) vectors and inertias in world axes about one common reference point.
//!
//! With all quantities in the same axes about the same point no transform stands between bodies. The point is the
//! root's origin, so precision does not suffer far from the world's origin. Notation after Featherstone, *Rigid Body
//! Dynamics Algorithms*: motion vectors (angular, linear), force vectors (moment, force).

use nalgebra::{Matrix3, Vector3};

/// A motion vector: angular velocity and the velocity of the body point at the reference point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Angular part, rad/s (or rad/s²).
    pub angular: Vector3<f64>,
    /// Linear part at the reference point, m/s (or m/s²).
    pub linear: Vector3<f64>,
}

/// A force vector: moment about the reference point and force.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    /// Moment about the reference point, N m.
    pub moment: Vector3<f64>,
    /// Force, N.
    pub force: Vector3<f64>,
}

/// Inertia of a rigid body (or of several rigidly joined) about the reference point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpatialInertia {
    /// Mass, kg.
    pub mass: f64,
    /// Mass times centre of mass, kg m.
    pub first_moment: Vector3<f64>,
    /// Rotational inertia about the reference point, kg m².
    pub rotational: Matrix3<f64>,
}

impl Motion {
    /// `self + scale * other`.
    #[inline]
    pub fn plus_scaled(&self, scale: f64, other: &Motion) -> Motion {
        Motion { angular: self.angular + scale * other.angular, linear: self.linear + scale * other.linear }
    }

    /// Cross product of motions: the rate of change of `other` when it is fixed in a body moving with `self`.
    #[inline]
    pub fn cross(&self, other: &Motion) -> Motion {
        Motion {
            angular: self.angular.cross(&other.angular),
            linear: self.angular.cross(&other.linear) + self.linear.cross(&other.angular),
        }
    }

    /// Cross product of a motion with a force: the rate of change of `wrench` when it is fixed in the moving body.
    #[inline]
    pub fn cross_wrench(&self, wrench: &Wrench) -> Wrench {
        Wrench {
            moment: self.angular.cross(&wrench.moment) + self.linear.cross(&wrench.force),
            force: self.angular.cross(&wrench.force),
        }
    }

    /// Power of `wrench` along this motion.
    #[inline]
    pub fn dot(&self, wrench: &Wrench) -> f64 {
        self.angular.dot(&wrench.moment) + self.linear.dot(&wrench.force)
    }

    /// Velocity of the body point at `offset` from the reference point.
    #[inline]
    pub fn at(&self, offset: &Vector3<f64>) -> Vector3<f64> {
        self.linear + self.angular.cross(offset)
    }
}

impl std::ops::AddAssign for Wrench {
    #[inline]
    fn add_assign(&mut self, rhs: Wrench) {
        self.moment += rhs.moment;
        self.force += rhs.force;
    }
}

impl SpatialInertia {
    /// Inertia of one body: mass, centre of mass relative to the reference point, inertia about the centre of mass,
    /// all in world axes.
    #[inline]
    pub fn of_body(mass: f64, com: &Vector3<f64>, about_com: &Matrix3<f64>) -> Self {
        let mc = mass * com;
        // Parallel axes: I + m (|c|² 1 - c cᵀ).
        let shift = Matrix3::from_diagonal_element(mc.dot(com)) - mc * com.transpose();
        Self { mass, first_moment: mc, rotational: about_com + shift }
    }

    /// Momentum of a body with this inertia moving with `motion`.
    #[inline]
    pub fn apply(&self, motion: &Motion) -> Wrench {
        Wrench {
            moment: self.rotational * motion.angular + self.first_moment.cross(&motion.linear),
            force: self.mass * motion.linear - self.first_moment.cross(&motion.angular),
        }
    }
}

impl std::ops::AddAssign for SpatialInertia {
    #[inline]
    fn add_assign(&mut self, rhs: SpatialInertia) {
        self.mass += rhs.mass;
        self.first_moment += rhs.first_moment;
        self.rotational += rhs.rotational;
    }
}
