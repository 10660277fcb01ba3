//! When a motion begins, and where it is.

use std::sync::Arc;

use super::trajectory::Trajectory;
use crate::balance::Reference;
use crate::character::CharacterState;
use crate::time::TICK_S;

/// Rate above which the turntable turns, rad/s: 2 rpm, 40 times the noise of a poor gyroscope.
const TURNS: f64 = 0.2;
/// Rate below which it rests, rad/s: 10 times that noise.
const RESTS: f64 = 0.05;
/// Angle through which it must turn without a rest for a spin, rad: a person shifting on a chair turns it less than
/// that.
const ONE_TURN: f64 = std::f64::consts::TAU;
/// How long it must rest after a spin, ticks.
const REST_TICKS: u32 = 250;

/// Plays a motion once after each time its character was stood up.
///
/// It begins a quarter of a second after the turntable has come to rest from a spin of at least one turn, or at a fixed
/// time. After its end the last pose is held, whatever the turntable does.
#[derive(Clone, Debug)]
pub struct Player {
    trajectory: Arc<Trajectory>,
    start_s: Option<f64>,
    /// Ticks since the character was stood up.
    ticks: u64,
    /// `ticks` when the motion began.
    began: Option<u64>,
    spin: SpinWatch,
}

impl Player {
    /// Plays `trajectory` after a spin, or `start_s` after the character was stood up.
    pub fn new(trajectory: Arc<Trajectory>, start_s: Option<f64>) -> Self {
        Self { trajectory, start_s, ticks: 0, began: None, spin: SpinWatch::default() }
    }

    /// Back to the first pose, because the character is stood up again.
    pub fn rewind(&mut self) {
        *self = Self::new(self.trajectory.clone(), self.start_s);
    }

    /// The pose to stand in before the motion.
    pub fn first_pose(&self) -> &CharacterState {
        self.trajectory.first_pose()
    }

    /// Whether the motion has been played to its end.
    pub fn has_finished(&self) -> bool {
        let since = self.began.map(|began| (self.ticks - began) as f64 * TICK_S);
        since.is_some_and(|since| since >= self.trajectory.duration_s())
    }

    /// The reference for the coming tick on a turntable that turns with `platform_rate` rad/s.
    pub fn next_reference(&mut self, platform_rate: f64) -> Reference {
        let stopped = self.spin.has_ended(platform_rate);
        let begins = self.start_s.map_or(stopped, |start| self.ticks as f64 * TICK_S >= start);
        if begins && self.began.is_none() {
            self.began = Some(self.ticks);
        }
        let since = self.began.map_or(0, |began| self.ticks - began);
        self.ticks += 1;
        self.trajectory.at(since as f64 * TICK_S)
    }
}

/// Waits for a spin and the rest after it.
#[derive(Clone, Copy, Debug, Default)]
struct SpinWatch {
    /// Angle turned since the last rest, rad.
    turned: f64,
    resting: u32,
}

impl SpinWatch {
    /// Sees the rate of one more tick; true once a spin has ended.
    fn has_ended(&mut self, rate: f64) -> bool {
        self.resting = if rate.abs() < RESTS { self.resting.saturating_add(1) } else { 0 };
        if rate.abs() > TURNS {
            self.turned += rate * TICK_S;
        }
        let rested = self.resting >= REST_TICKS;
        let spun = self.turned.abs() >= ONE_TURN;
        if rested && !spun {
            self.turned = 0.0;
        }
        rested && spun
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ticks until the watch sees the end of a spin.
    fn ended(rates: impl IntoIterator<Item = f64>) -> Option<usize> {
        let mut watch = SpinWatch::default();
        rates.into_iter().position(|rate| watch.has_ended(rate))
    }

    /// Noise of 0.005 rad/s rms, at most three times that.
    fn noise(k: usize) -> f64 {
        let unit = |n: usize| ((n * 2_654_435_761) % 65_536) as f64 / 32_768.0 - 1.0;
        0.005 * (unit(k) + unit(k + 77) + unit(k + 1234))
    }

    fn plateau(rate: f64, ticks: usize) -> impl Iterator<Item = f64> {
        (0..ticks).map(move |k| rate + noise(k))
    }

    #[test]
    fn a_spin_has_ended_a_quarter_of_a_second_after_it_stops() {
        let spin = || plateau(0.0, 2000).chain(plateau(-3.0, 5000));
        assert_eq!(ended(spin().chain(plateau(0.0, 2000))), Some(7249));
        assert_eq!(ended(spin()), None);
        assert_eq!(ended(spin().chain(plateau(0.1, 2000))), None, "it still turns slowly");
    }

    #[test]
    fn rest_drift_and_shifting_on_the_chair_are_no_spin() {
        assert_eq!(ended(plateau(0.0, 100_000)), None);
        assert_eq!(ended(plateau(0.1, 200_000).chain(plateau(0.0, 1000))), None, "slower than a spin");
        let shift = || plateau(1.5, 600).chain(plateau(0.0, 400));
        assert_eq!(ended((0..20).flat_map(|_| shift())), None, "a rest between any two");
        let to_and_fro = || plateau(1.5, 600).chain(plateau(-1.5, 600));
        assert_eq!(ended((0..20).flat_map(|_| to_and_fro()).chain(plateau(0.0, 1000))), None);
    }
}
