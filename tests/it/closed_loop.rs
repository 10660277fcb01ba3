//! Observer, controller and dynamics together against the verdicts of the reference in another engine
//! (`spec/balance.md` section 4, `spec/contact-closed-loop.md`).

use nalgebra::Vector3;
use otolith::character::CharacterModel;
use otolith::imu::LinkHealth;
use otolith::runtime::{Core, CoreSettings, Push};
use otolith::tick::{CharacterOutput, Posture, TickInput};
use otolith::time::Tick;
use otolith::units::{DEG_PER_RAD, RAD_S_PER_RPM};
use otolith::vestibular::HeadMotion;

const REST_S: f64 = 2.0;
const RAMP_S: f64 = 1.0;

/// An ideal chair: level, on the axis, no noise.
#[derive(Clone, Copy)]
struct Chair {
    rate_rpm: f64,
    spin_s: f64,
    after_s: f64,
}

impl Chair {
    fn rate(&self, t: f64) -> f64 {
        let plateau = self.rate_rpm * RAD_S_PER_RPM;
        let up = ((t - REST_S) / RAMP_S).clamp(0.0, 1.0);
        let down = ((t - REST_S - self.spin_s) / RAMP_S).clamp(0.0, 1.0);
        plateau * (up - down)
    }

    fn stopped_s(&self) -> f64 {
        REST_S + self.spin_s + RAMP_S
    }
}

/// What one character did.
#[derive(Debug, Default)]
struct Outcome {
    fell_at_s: Option<f64>,
    tilt_in_spin: f64,
    peak_tilt: f64,
    peak_sway: f64,
    range: [f64; 2],
    cop_within_5mm: f64,
    last_hash: u64,
}

struct Watch {
    outcome: Outcome,
    low: [f64; 2],
    high: [f64; 2],
    within: u64,
    after: u64,
}

impl Watch {
    fn new() -> Self {
        let (low, high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        Self { outcome: Outcome::default(), low, high, within: 0, after: 0 }
    }

    fn see(&mut self, t: f64, from_s: f64, spin: Option<(f64, f64)>, out: &CharacterOutput) {
        let o = &mut self.outcome;
        o.last_hash = out.state_hash;
        if out.posture == Posture::Fallen {
            o.fell_at_s.get_or_insert(t);
            return;
        }
        if spin.is_some_and(|(start, end)| t >= start && t < end) {
            o.tilt_in_spin = o.tilt_in_spin.max(out.gravity_tilt * DEG_PER_RAD);
        }
        if t >= from_s {
            o.peak_tilt = o.peak_tilt.max(out.gravity_tilt * DEG_PER_RAD);
            o.peak_sway = o.peak_sway.max(out.com_sway * DEG_PER_RAD);
            for axis in 0..2 {
                self.low[axis] = self.low[axis].min(out.com_platform[axis]);
                self.high[axis] = self.high[axis].max(out.com_platform[axis]);
                o.range[axis] = self.high[axis] - self.low[axis];
            }
            self.after += 1;
            self.within += u64::from(out.cop_platform.is_some_and(|cop| cop.norm() < 0.005));
            o.cop_within_5mm = self.within as f64 / self.after as f64;
        }
    }
}

fn run(settings: CoreSettings, chair: Option<Chair>, duration_s: f64, from_s: f64) -> (Outcome, Outcome) {
    let mut core = Core::new(settings, CharacterModel::standing().unwrap()).unwrap();
    let (mut green, mut blue) = (Watch::new(), Watch::new());
    let spin = chair.map(|c| (REST_S, c.stopped_s() - RAMP_S));
    for k in 0..(duration_s * 1000.0) as u64 {
        let tick = Tick(k);
        let rate = chair.map_or(0.0, |c| c.rate(tick.time_s()));
        let motion =
            HeadMotion { omega_head: Vector3::new(0.0, 0.0, rate), gif_head: Vector3::new(0.0, 0.0, -9.81) };
        let input = TickInput { tick, chair: Some(motion), link: LinkHealth::Live, respawn: false };
        let output = core.step(&input);
        green.see(tick.time_s(), from_s, spin, &output.green);
        blue.see(tick.time_s(), from_s, spin, &output.blue);
    }
    (green.outcome, blue.outcome)
}

fn spin(rate_rpm: f64, spin_s: f64, settings: CoreSettings) -> (Outcome, Outcome) {
    let chair = Chair { rate_rpm, spin_s, after_s: 25.0 };
    let (green, blue) = run(settings, Some(chair), chair.stopped_s() + chair.after_s, chair.stopped_s());
    println!("{rate_rpm} rpm {spin_s} s: green {green:?}\n    blue {blue:?}");
    (green, blue)
}

#[test]
fn after_15_s_at_30_rpm_green_sways_and_recovers_and_blue_stands() {
    let (green, blue) = spin(30.0, 15.0, CoreSettings::default());
    assert_eq!(green.fell_at_s, None);
    // The reference: 4.31 and 6.03 deg; its own choice of engine and least force moves them by a few percent.
    assert!((green.peak_tilt - 4.31).abs() < 0.15 * 4.31, "{green:?}");
    assert!((green.peak_sway - 6.03).abs() < 0.15 * 6.03, "{green:?}");
    assert!(green.peak_sway > green.peak_tilt && green.tilt_in_spin < 0.5 * green.peak_tilt);
    assert!(green.cop_within_5mm < 0.05);
    assert_eq!(blue.fell_at_s, None);
    assert!(blue.peak_sway < 0.3 && blue.cop_within_5mm > 0.99, "{blue:?}");
}

#[test]
fn faster_and_longer_spins_are_worse_and_20_s_at_30_rpm_is_a_fall() {
    let settings = CoreSettings::default;
    let (at_10, _) = spin(10.0, 15.0, settings());
    let (at_20, _) = spin(20.0, 15.0, settings());
    let (for_10_s, _) = spin(30.0, 10.0, settings());
    let (for_15_s, _) = spin(30.0, 15.0, settings());
    let (for_20_s, blue) = spin(30.0, 20.0, settings());
    assert!(at_10.peak_sway < at_20.peak_sway && at_20.peak_sway < for_15_s.peak_sway);
    assert!(for_10_s.peak_sway < for_15_s.peak_sway);
    assert!(for_20_s.fell_at_s.is_some_and(|t| t > 23.0), "{for_20_s:?}");
    assert_eq!(blue.fell_at_s, None);
}

#[test]
fn a_shorter_canal_time_constant_is_worse() {
    let with_tau = |tau: f64| {
        let mut settings = CoreSettings::default();
        settings.observer.dominant_time_constant_s = tau;
        settings.observer.internal_dominant_time_constant_s = tau;
        spin(30.0, 17.0, settings).0
    };
    let (short, middle, long) = (with_tau(2.85), with_tau(5.7), with_tau(11.4));
    assert!(short.fell_at_s.is_some());
    assert_eq!(middle.fell_at_s, None);
    assert!(long.fell_at_s.is_none() && long.peak_sway < middle.peak_sway);
}

#[test]
fn a_push_of_4_newton_seconds_sways_green_more_than_blue() {
    let push = Push { start_s: 2.0, duration_s: 0.1, force: [40.0, 0.0] };
    let settings = CoreSettings { push: Some(push), ..CoreSettings::default() };
    let (green, blue) = run(settings, None, 16.0, 2.1);
    println!("push: {green:?} {blue:?}");
    // The reference: 0.51 against 0.33 deg.
    assert!(green.peak_sway > blue.peak_sway, "{green:?} {blue:?}");
    assert!((green.peak_sway - 0.51).abs() < 0.1 && (blue.peak_sway - 0.33).abs() < 0.07);
}

#[test]
fn the_same_inputs_give_the_same_bits() {
    let chair = Chair { rate_rpm: 30.0, spin_s: 4.0, after_s: 4.0 };
    let once = run(CoreSettings::default(), Some(chair), 11.0, chair.stopped_s());
    let again = move || run(CoreSettings::default(), Some(chair), 11.0, chair.stopped_s());
    let again = std::thread::spawn(again).join().unwrap();
    assert_eq!(once.0.last_hash, again.0.last_hash);
    assert_eq!(once.1.last_hash, again.1.last_hash);
    assert_ne!(once.0.last_hash, once.1.last_hash);
}
