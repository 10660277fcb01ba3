//! The core under inputs no chair should give: it falls, stands up again, and never stops giving numbers.

use nalgebra::Vector3;
use otolith::character::CharacterModel;
use otolith::imu::LinkHealth;
use otolith::runtime::{Core, CoreSettings, Push};
use otolith::tick::{CharacterOutput, Posture, TickInput, TickOutput};
use otolith::time::Tick;
use otolith::vestibular::HeadMotion;

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

fn core(settings: CoreSettings) -> Core {
    Core::new(settings, CharacterModel::standing().unwrap()).unwrap()
}

fn input(tick: u64, chair: Option<HeadMotion>) -> TickInput {
    TickInput { tick: Tick(tick), chair, link: LinkHealth::Live, respawn: false }
}

fn turning(rate: f64) -> Option<HeadMotion> {
    Some(HeadMotion { omega_head: Vector3::new(0.0, 0.0, rate), gif_head: GRAVITY })
}

fn is_finite(out: &CharacterOutput) -> bool {
    let numbers = [out.gravity_tilt, out.com_sway, out.foot_tilt, out.constraint_residual];
    let p = &out.perception;
    let vectors = [p.omega_head, p.gravity_head, p.accel_head, out.gravity_platform, out.com_platform];
    numbers.iter().chain(vectors.iter().flat_map(|v| v.iter())).all(|x| x.is_finite())
        && out.cop_platform.is_none_or(|cop| cop.iter().all(|x| x.is_finite()))
}

fn check(output: &TickOutput) {
    assert!(is_finite(&output.green) && is_finite(&output.blue), "{output:?}");
    assert!(output.platform.rate.is_finite() && output.platform.angle.is_finite(), "{:?}", output.platform);
}

/// A push that throws anybody down at 1 s.
fn thrown() -> CoreSettings {
    let push = Push { start_s: 1.0, duration_s: 0.2, force: [600.0, 0.0] };
    CoreSettings { push: Some(push), ..CoreSettings::default() }
}

#[test]
fn a_fallen_character_stands_up_again_after_the_set_time_and_keeps_standing() {
    let settings = CoreSettings { respawn_after_s: Some(1.5), ..thrown() };
    let mut core = core(settings);
    let (mut fell, mut stood) = (None, None);
    for k in 0..12_000 {
        let output = core.step(&input(k, turning(0.0)));
        check(&output);
        match (output.green.posture, fell, stood) {
            (Posture::Fallen, None, _) => fell = Some(k),
            (Posture::Standing, Some(_), None) => stood = Some(k),
            (posture, _, Some(at)) => assert_eq!(posture, Posture::Standing, "fell again after {at} ms"),
            _ => {}
        }
        if k == 11_999 {
            assert!(output.green.com_sway < 0.02, "{output:?}");
        }
    }
    let (fell, stood) = (fell.unwrap(), stood.unwrap());
    assert!((1000..4000).contains(&fell));
    assert!((1499..=1501).contains(&(stood - fell)), "{fell} {stood}");
}

#[test]
fn without_a_set_time_it_lies_until_asked() {
    let mut core = core(thrown());
    for k in 0..5000 {
        let output = core.step(&input(k, turning(0.0)));
        check(&output);
        assert!(k < 4000 || output.green.posture == Posture::Fallen);
    }
    let output = core.step(&TickInput { respawn: true, ..input(5000, turning(0.0)) });
    assert_eq!((output.green.posture, output.blue.posture), (Posture::Standing, Posture::Standing));
    for k in 5001..8000 {
        let output = core.step(&input(k, turning(0.0)));
        check(&output);
        assert_eq!(output.green.posture, Posture::Standing);
    }
}

#[test]
fn a_chair_that_is_lost_for_a_while_throws_nobody_down() {
    let mut core = core(CoreSettings::default());
    for k in 0..14_000 {
        let chair = if (3000..6000).contains(&k) || k < 200 { None } else { turning(1.0) };
        let output = core.step(&input(k, chair));
        check(&output);
        assert_eq!(output.green.posture, Posture::Standing, "tick {k}");
        assert_eq!(output.blue.posture, Posture::Standing, "tick {k}");
        if k == 5999 {
            assert!(output.platform.rate.abs() < 0.05, "braked: {}", output.platform.rate);
        }
    }
}

/// A number of any size, now and then none at all.
fn garbage(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    let bits = *seed >> 11;
    let size = [1.0, 1.0, 10.0, 1e3, 1e9, 1e300, f64::INFINITY, f64::NAN][(bits % 8) as usize];
    size * ((bits >> 3) as f64 / (1u64 << 49) as f64 - 1.0)
}

#[test]
fn garbage_for_a_minute_leaves_every_number_finite_and_the_core_usable() {
    let mut core = core(CoreSettings { respawn_after_s: Some(0.5), ..CoreSettings::default() });
    let mut seed = 3;
    let (mut chair, mut stood) = (None, 0);
    for k in 0..60_000 {
        // Garbage is held for a while, so that the turntable has time to follow it.
        if k % 37 == 0 {
            let omega_head = Vector3::from_fn(|_, _| garbage(&mut seed));
            let gif_head = Vector3::from_fn(|_, _| garbage(&mut seed));
            chair = (k % 5 != 0).then_some(HeadMotion { omega_head, gif_head });
        }
        let output = core.step(&input(k, chair));
        check(&output);
        stood += u32::from(output.blue.posture == Posture::Standing);
    }
    assert!(stood > 100, "stood up {stood} ticks");
    // A quiet chair afterwards: both stand as on the first day.
    for k in 60_000..75_000 {
        let respawn = k == 60_000 || k == 70_000;
        let output = core.step(&TickInput { respawn, ..input(k, turning(0.0)) });
        check(&output);
        if k == 74_999 {
            assert_eq!(output.green.posture, Posture::Standing, "{output:?}");
            assert!(output.blue.com_sway < 0.02 && output.platform.rate.abs() < 1e-3, "{output:?}");
        }
    }
}
