//! Our half of the comparison of trajectories with another engine. Settings are TOML of the core, one key an argument.
//!
//! `cross_engine run SPIN_S LEAD_S DEAF_S KEY=VALUE...`: the green character with an ideal chair (2 s of rest, 30 rpm for
//! SPIN_S with ramps of 1 s, 25 s after the stop; a fall ends it); CSV on standard output at 50 Hz. The chair is LEAD_S
//! ahead of the clock and not heard for the first DEAF_S.
//!
//! `cross_engine serve KEY=VALUE...`: our observer and controller for a body that another engine moves. Little-endian
//! doubles; each request is 42 configuration numbers, 41 velocities, platform angle, rate, acceleration, head angular
//! velocity (3) and specific force (3) in head axes, step of the observer in s, gravity to act on (3, world axes; NaN:
//! the observer's). Each answer is 35 torques, believed gravity (3, world axes), believed angular velocity (3, head).

#![allow(missing_docs, clippy::unwrap_used)] // a benchmark may stop on bad input

use std::io::{Read, Write};
use std::sync::Arc;

use nalgebra::Vector3;
use otolith::balance::{BalanceController, MomentumController, perceive};
use otolith::character::{CONTACTS, CharacterModel, CharacterState, DOF, GenVec};
use otolith::dynamics::{Dynamics, Engine, GroundSurface, Simulator, standing_pose};
use otolith::hil::{ChairResidual, Turntable};
use otolith::runtime::{CoreSettings, Figure, Vestibular};
use otolith::tick::Posture;
use otolith::time::TICK_S;
use otolith::units::{DEG_PER_RAD, RAD_S_PER_RPM};
use otolith::vestibular::{HeadMotion, NewmanObserver, OrientationObserver};

const START_S: f64 = 2.0;
const AFTER_SPIN_S: f64 = 26.0;
const EVERY: u64 = 20;
const REQUEST: usize = DOF + 1 + DOF + 3 + 6 + 1 + 3;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let settings = |from: usize| toml::from_str(&arguments[from..].join("\n")).unwrap();
    match arguments.first().map(String::as_str) {
        Some("run") => {
            let [spin_s, lead_s, deaf_s] = [1, 2, 3].map(|i| arguments[i].parse().unwrap());
            run(spin_s, lead_s, deaf_s, settings(4));
        }
        Some("serve") => serve(&settings(1)),
        _ => {} // `cargo bench` without arguments
    }
}

fn run(spin_s: f64, lead_s: f64, deaf_s: f64, settings: CoreSettings) {
    let model = Arc::new(CharacterModel::standing().unwrap());
    let standing = standing_pose(&model, &settings.pose).unwrap();
    let observer = NewmanObserver::new(settings.observer).unwrap();
    let mut turntable = Turntable::turning(settings.turntable, 0.0);
    let settings = Arc::new(settings);
    let mut figure = Figure::new(Vestibular::Trusted, settings.clone(), model.clone(), standing, observer);
    println!("t,cx,cy,cz,zx,zy,gx,gy,gz,thc,thg,omega,wx,wy,wz,px,py,lift");
    let ticks = ((START_S + spin_s + AFTER_SPIN_S) / TICK_S).round() as u64;
    for k in 0..ticks {
        let t = k as f64 * TICK_S;
        let at = t + lead_s;
        let share = (at - START_S).clamp(0.0, 1.0) - (at - START_S - spin_s).clamp(0.0, 1.0);
        let omega_head = Vector3::new(0.0, 0.0, 30.0 * RAD_S_PER_RPM * share);
        let chair = (t >= deaf_s).then_some(HeadMotion { omega_head, gif_head: model.gravity });
        let platform = turntable.follow(chair.map(|chair| chair.omega_head.z), TICK_S);
        let residual = ChairResidual::of(chair.as_ref(), &platform, &model.gravity);
        let state = *figure.state();
        let out = figure.step(&platform, &residual, None);
        turntable.advance(&platform, TICK_S);
        if out.posture == Posture::Fallen {
            break;
        }
        if k % EVERY == 0 {
            let ground = GroundSurface::turntable(platform.angle, 0.0, 0.0, model.friction);
            let engine = Engine::new(model.clone(), settings.contact, state);
            let centroid = perceive(&engine, &ground, &model.gravity).support.centroid_world;
            let support = ground.rot_world_surface.transpose() * centroid;
            let lowest =
                |i: usize| engine.kinematics().contact_position(&model, i).z - model.contacts[i].radius;
            let lift = (0..CONTACTS).map(lowest).fold(f64::NEG_INFINITY, f64::max);
            let (c, g, w) = (out.com_platform, out.gravity_platform, out.perception.omega_head);
            let z = out.cop_platform.map_or([f64::NAN; 2], |z| [z.x, z.y]);
            let (sway, tilt) = (out.com_sway * DEG_PER_RAD, out.gravity_tilt * DEG_PER_RAD);
            let body = [t, c.x, c.y, c.z, z[0], z[1]];
            let belief = [g.x, g.y, g.z, sway, tilt, platform.rate, w.x, w.y, w.z];
            let row = body.iter().chain(&belief).chain([&support.x, &support.y, &lift]);
            let text: Vec<String> = row.map(|number| format!("{number:.9}")).collect();
            println!("{}", text.join(","));
        }
    }
}

fn serve(settings: &CoreSettings) {
    let model = Arc::new(CharacterModel::standing().unwrap());
    let standing = standing_pose(&model, &settings.pose).unwrap();
    let mut engine = Engine::new(model.clone(), settings.contact, standing);
    let mut controller = MomentumController::new(settings.balance, &engine);
    let mut observer = NewmanObserver::new(settings.observer).unwrap();
    let mut started = false;
    let (mut input, mut output) = (std::io::stdin().lock(), std::io::stdout().lock());
    let mut bytes = [0; 8 * REQUEST];
    while input.read_exact(&mut bytes).is_ok() {
        let x: Vec<f64> =
            bytes.chunks_exact(8).map(|eight| f64::from_le_bytes(eight.try_into().unwrap())).collect();
        let (configuration, rest) = x.split_at(DOF + 1);
        let (velocity, rest) = rest.split_at(DOF);
        let mut state = CharacterState::from_qpos(configuration.try_into().unwrap());
        state.velocity = GenVec::from_column_slice(velocity);
        engine.set_state(state);
        let ground = GroundSurface::turntable(rest[0], rest[1], rest[2], model.friction);
        let motion = HeadMotion {
            omega_head: Vector3::from_column_slice(&rest[3..6]),
            gif_head: -Vector3::from_column_slice(&rest[6..9]),
        };
        if started {
            observer.step(&motion, rest[9]);
        } else {
            observer.reset(motion.gif_head, &motion);
            started = true;
        }
        let believed = observer.perception();
        let rot_world_head = engine.kinematics().rot_world_body[model.head];
        let gravity = rot_world_head * believed.gravity_head;
        let asked = Vector3::from_column_slice(&rest[10..13]);
        let trusted = if asked.x.is_nan() { gravity } else { asked };
        let control = controller.control(&engine, &ground, &perceive(&engine, &ground, &trusted));
        let answer = control.torques.iter().chain(gravity.iter()).chain(believed.omega_head.iter());
        let answer: Vec<u8> = answer.flat_map(|number| number.to_le_bytes()).collect();
        output.write_all(&answer).and_then(|()| output.flush()).unwrap();
    }
}
