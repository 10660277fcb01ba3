//! Where both bodies were, ten times a second: for figures of stills.

use nalgebra::Vector3;

use crate::dynamics::{GroundSurface, Kinematics};
use crate::report::svg::stills::Still;
use crate::runtime::{Core, Figure};
use crate::tick::{CharacterOutput, TickOutput};
use crate::units::DEG_PER_RAD;

/// Ticks from one kept moment to the next.
const EVERY: u64 = 100;
/// Middle of the head above its joint, m: about half the height from chin to vertex.
const HEAD_MIDDLE: f64 = 0.1;

/// One moment.
#[derive(Clone, Debug)]
pub struct Moment {
    /// Tick time, s.
    pub time_s: f64,
    /// The character that trusts its vestibular model.
    pub green: Still,
    /// The character that perceives perfectly.
    pub blue: Still,
}

/// The moments of a run.
#[derive(Clone, Debug, Default)]
pub struct Stills(Vec<Moment>);

impl Stills {
    /// Takes note of a tick.
    pub(super) fn see(&mut self, core: &Core, output: &TickOutput) {
        if output.tick.0.is_multiple_of(EVERY) {
            let time_s = output.tick.time_s();
            let still = |figure, character| still(figure, character, output.platform.angle, time_s);
            let (green, blue) = (still(core.green(), &output.green), still(core.blue(), &output.blue));
            self.0.push(Moment { time_s, green, blue });
        }
    }

    /// The moment nearest to `time_s`; `None` of an empty run.
    pub fn at(&self, time_s: f64) -> Option<&Moment> {
        let off = |moment: &&Moment| (moment.time_s - time_s).abs();
        self.0.iter().min_by(|one, other| off(one).total_cmp(&off(other)))
    }
}

/// A body in axes that turn with the platform.
fn still(figure: &Figure, output: &CharacterOutput, platform_angle: f64, time_s: f64) -> Still {
    let model = figure.model();
    let mut kinematics = Kinematics::default();
    kinematics.update(model, figure.state());
    let to_platform =
        GroundSurface::turntable(platform_angle, 0.0, 0.0, model.friction).rot_world_surface.transpose();
    let place = |offset: Vector3<f64>| <[f64; 3]>::from(to_platform * (kinematics.origin + offset));
    let joined = model.bodies.iter().enumerate().skip(1);
    let bones = joined
        .map(|(body, link)| [place(kinematics.position[link.parent]), place(kinematics.position[body])]);
    let limbs = model.contacts.iter().enumerate().map(|(point, contact)| {
        [place(kinematics.position[contact.body]), place(kinematics.contact_offset(model, point))]
    });
    let head = kinematics.rot_world_body[model.head] * Vector3::new(0.0, 0.0, HEAD_MIDDLE);
    Still {
        label: format!("{time_s:.1} s"),
        bones: bones.chain(limbs).collect(),
        head: place(kinematics.position[model.head] + head),
        com: place(kinematics.com(model) - kinematics.origin),
        support: (0..model.contacts.len())
            .map(|point| place(kinematics.contact_offset(model, point)))
            .collect(),
        gravity_hat: output.gravity_platform.into(),
        com_sway_deg: output.com_sway * DEG_PER_RAD,
    }
}
