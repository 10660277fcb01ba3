//! The observer against the continuous-time reference: every golden case, at 1 ms and at 10 ms.

use std::fmt::Write as _;

use nalgebra::Vector3;
use otolith::cli::perceive::{PerceiveArgs, run};
use otolith::units::DEG_PER_RAD;
use otolith::vestibular::{
    HeadMotionRow, IdealObserver, NewmanObserver, ObserverParameters, OrientationObserver, Perceiver,
    PerceptRow, angle_between,
};

use super::observer_cases::{Case, GoldenRow, all};

/// Largest errors of one run.
#[derive(Default)]
struct Worst {
    omega_rad_s: f64,
    gravity_deg: f64,
    accel_m_s2: f64,
    tilt_deg: f64,
}

impl Worst {
    fn add(
        &mut self,
        golden: &GoldenRow,
        omega: Vector3<f64>,
        gravity: Vector3<f64>,
        accel: Vector3<f64>,
        tilt: f64,
    ) {
        let golden_tilt = angle_between(&golden.gravity_hat, &golden.truth.gravity);
        self.omega_rad_s = self.omega_rad_s.max((omega - golden.omega_hat).amax());
        self.gravity_deg = self.gravity_deg.max(angle_between(&gravity, &golden.gravity_hat) * DEG_PER_RAD);
        self.accel_m_s2 = self.accel_m_s2.max((accel - golden.accel_hat).amax());
        self.tilt_deg = self.tilt_deg.max((tilt - golden_tilt).abs() * DEG_PER_RAD);
    }

    /// Against the tolerances of the golden README. Believed acceleration is 0.8 of a difference to believed gravity:
    /// it gets that tolerance as an angle of 1 g.
    fn check(&self, case: &Case, rate_hz: u32) {
        let (omega, gravity) = tolerance(case, rate_hz);
        println!(
            "{:32} {rate_hz:4} Hz  omega {:.1e} rad/s  gravity {:.1e} deg  accel {:.1e} m/s2  tilt {:.1e} deg",
            case.file, self.omega_rad_s, self.gravity_deg, self.accel_m_s2, self.tilt_deg
        );
        assert!(self.omega_rad_s <= omega, "{} at {rate_hz} Hz: {:e} rad/s", case.file, self.omega_rad_s);
        assert!(self.gravity_deg <= gravity, "{} at {rate_hz} Hz: {:e} deg", case.file, self.gravity_deg);
        assert!(self.tilt_deg <= gravity, "{} at {rate_hz} Hz: tilt {:e} deg", case.file, self.tilt_deg);
        let accel = gravity / DEG_PER_RAD * 9.80665;
        assert!(self.accel_m_s2 <= accel, "{} at {rate_hz} Hz: {:e} m/s2", case.file, self.accel_m_s2);
    }
}

/// Largest error allowed, (rad/s, degrees).
fn tolerance(case: &Case, rate_hz: u32) -> (f64, f64) {
    let low_pass = case.preset == "newman-lpf";
    match rate_hz {
        1000 if case.file == "i_centrifuge30" => (1e-5, 1e-3),
        1000 if low_pass => (5e-6, 1e-4),
        1000 => (1e-6, 1e-4),
        100 if low_pass => (5e-4, 1e-2),
        100 => (1e-4, 1e-2),
        other => panic!("no tolerance at {other} Hz"),
    }
}

fn row_at(case: &Case, t_s: f64) -> HeadMotionRow {
    HeadMotionRow { t_s, motion: case.truth(t_s).motion() }
}

/// Sample times of a whole case.
fn times(case: &Case, rate_hz: u32) -> impl Iterator<Item = f64> {
    let last = (case.duration_s * f64::from(rate_hz)).round() as u32;
    (0..=last).map(move |sample| f64::from(sample) / f64::from(rate_hz))
}

/// Runs `observer` over a case sampled at `times` and hands out the percepts at the times of its golden rows.
fn run_case<O: OrientationObserver>(
    case: &Case,
    observer: O,
    mut times: impl Iterator<Item = f64>,
    mut compare: impl FnMut(&GoldenRow, &PerceptRow),
) {
    let first = row_at(case, times.next().unwrap());
    let (mut perceiver, mut percept) = Perceiver::start(observer, &first, case.gravity_hat);
    for golden in &case.rows {
        while percept.t_s < golden.t_s - 1e-9 {
            percept = perceiver.step(&row_at(case, times.next().unwrap()));
        }
        assert!((golden.t_s - percept.t_s).abs() < 1e-9);
        compare(golden, &percept);
    }
    assert_eq!(times.next(), None);
}

fn worst_errors(case: &Case, times: impl Iterator<Item = f64>) -> Worst {
    let parameters = ObserverParameters::preset(&case.preset).unwrap();
    let mut worst = Worst::default();
    run_case(case, NewmanObserver::new(parameters).unwrap(), times, |golden, percept| {
        let believed = &percept.perception;
        worst.add(
            golden,
            believed.omega_head,
            believed.gravity_head,
            believed.accel_head,
            percept.gravity_tilt,
        );
    });
    worst
}

#[test]
fn our_stimuli_are_the_golden_ones() {
    let cases = all();
    assert_eq!(cases.len(), 28);
    for case in &cases {
        assert_eq!(case.rows.len(), times(case, 2).count(), "{}", case.file);
        for row in &case.rows {
            let (ours, golden) = (case.truth(row.t_s), &row.truth);
            let error = [ours.omega - golden.omega, ours.accel - golden.accel, ours.gravity - golden.gravity];
            let error = error.map(|difference| difference.amax()).into_iter().fold(0.0, f64::max);
            assert!(error < 2e-8, "{} at {} s: {error:e}", case.file, row.t_s);
        }
    }
}

#[test]
fn every_case_at_1_ms() {
    for case in all() {
        worst_errors(&case, times(&case, 1000)).check(&case, 1000);
    }
}

#[test]
fn every_case_at_10_ms() {
    for case in all() {
        worst_errors(&case, times(&case, 100)).check(&case, 100);
    }
}

/// One step per interval with its real length: a jittery clock costs nothing.
#[test]
fn every_case_at_irregular_times() {
    // 20 ms in five uneven intervals; 25 of them end on a golden row.
    const OFFSETS_S: [f64; 5] = [0.0, 0.002, 0.009, 0.0105, 0.016];
    for case in all() {
        let blocks = (case.duration_s * 50.0).round() as u32;
        let irregular = (0..blocks)
            .flat_map(|block| OFFSETS_S.map(|offset| f64::from(block) * 0.02 + offset))
            .chain([case.duration_s]);
        worst_errors(&case, irregular).check(&case, 100);
    }
}

#[test]
fn the_ideal_observer_perceives_the_truth() {
    for case in all().into_iter().filter(|case| case.gravity_hat.is_none()) {
        let start = case.truth(0.0);
        let ideal = IdealObserver::new(start.gravity, &start.motion());
        run_case(&case, ideal, times(&case, 100), |golden, percept| {
            let believed = &percept.perception;
            let off = angle_between(&believed.gravity_head, &golden.truth.gravity) * DEG_PER_RAD;
            assert!(off < 1e-2, "{} at {} s: {off:e} deg", case.file, golden.t_s);
            assert!((believed.omega_head - golden.truth.omega).amax() < 1e-8);
            assert!((believed.accel_head - golden.truth.accel).amax() < 2e-3, "{}", case.file);
            assert_eq!(percept.gravity_tilt, 0.0);
        });
    }
}

/// The whole command, file to file, on every stimulus.
#[test]
fn perceive_matches_on_every_stimulus() {
    let folder = tempfile::tempdir().unwrap();
    for case in all() {
        let args = PerceiveArgs {
            input: folder.path().join("in.csv"),
            out: folder.path().join("out.csv"),
            preset: case.preset.clone(),
            initial_gravity_hat: case.gravity_hat,
            force: true,
        };
        std::fs::write(&args.input, head_motion_csv(&case, 100)).unwrap();
        let summary = run(&args).unwrap();
        assert_eq!(summary.rows, times(&case, 100).count() as u64);

        check_percepts(&case, &std::fs::read_to_string(&args.out).unwrap(), 100);
    }
}

/// Holds the output of `otolith perceive` on a case's stimulus, sampled at `rate_hz`, against its golden rows.
pub(crate) fn check_percepts(case: &Case, out: &str, rate_hz: u32) {
    let per_golden_row = rate_hz as usize / 2;
    assert_eq!(out.lines().count(), (case.rows.len() - 1) * per_golden_row + 2);
    let mut worst = Worst::default();
    for (line, golden) in out.lines().skip(1).step_by(per_golden_row).zip(&case.rows) {
        let values: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        let vector = |first: usize| Vector3::from_column_slice(&values[first..first + 3]);
        assert!((values[0] - golden.t_s).abs() < 1e-9);
        worst.add(golden, vector(1), vector(4), vector(7), values[10] / DEG_PER_RAD);
    }
    worst.check(case, rate_hz);
}

/// A case's stimulus as the input of `otolith perceive`.
pub(crate) fn head_motion_csv(case: &Case, rate_hz: u32) -> String {
    let mut text = "t_s,omega_x_rad_s,omega_y_rad_s,omega_z_rad_s,\
                    specific_force_x_m_s2,specific_force_y_m_s2,specific_force_z_m_s2\n"
        .to_owned();
    for t_s in times(case, rate_hz) {
        let motion = case.truth(t_s).motion();
        let (omega, force) = (motion.omega_head, -motion.gif_head);
        let numbers = [t_s, omega.x, omega.y, omega.z, force.x, force.y, force.z];
        writeln!(text, "{}", numbers.map(|number| number.to_string()).join(",")).unwrap();
    }
    text
}
