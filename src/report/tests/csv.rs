//! The data behind a figure.

use nalgebra::Vector2;

use super::{input, output, upright};
use crate::report::csv::{Curve, write};
use crate::report::{Character, Trace};
use crate::tick::{CharacterOutput, Posture};

#[test]
fn rows_are_10_ms_apart_and_empty_where_there_is_nothing() {
    let mut trace = Trace::new();
    for tick in 0..=20 {
        let mut green = CharacterOutput {
            com_sway: 0.5_f64.to_radians(),
            foot_tilt: 0.25_f64.to_radians(),
            cop_platform: (tick < 10).then(|| Vector2::new(0.0125, -1e-9)),
            posture: if tick >= 15 { Posture::Fallen } else { Posture::Standing },
            ..upright()
        };
        green.perception.omega_head.z = -1.25;
        let chair = (tick != 10).then_some(0.5);
        trace.push(&input(tick, chair), &output(tick, green, upright()));
    }
    let mut out = Vec::new();
    let curve = |character| Curve { run: "30 rpm, 15 s", trace: &trace, character };
    write(&mut out, [curve(Character::Green), curve(Character::Blue)]).unwrap();
    let expected = "\
run,character,time_s,com_sway_deg,gravity_tilt_deg,foot_tilt_deg,com_x_m,com_y_m,cop_x_m,cop_y_m,omega_hat_z_rad_s,chair_rate_rad_s,down
\"30 rpm, 15 s\",green,0.000,0.5000,0.0000,0.2500,0.000000,0.000000,0.012500,0.000000,-1.250000,0.500000,0
\"30 rpm, 15 s\",green,0.010,0.5000,0.0000,0.2500,0.000000,0.000000,,,-1.250000,,0
\"30 rpm, 15 s\",green,0.020,0.5000,0.0000,0.2500,0.000000,0.000000,,,-1.250000,0.500000,1
\"30 rpm, 15 s\",blue,0.000,0.0000,0.0000,0.0000,0.000000,0.000000,0.000000,0.000000,0.000000,0.500000,0
\"30 rpm, 15 s\",blue,0.010,0.0000,0.0000,0.0000,0.000000,0.000000,0.000000,0.000000,0.000000,,0
\"30 rpm, 15 s\",blue,0.020,0.0000,0.0000,0.0000,0.000000,0.000000,0.000000,0.000000,0.000000,0.500000,0
";
    assert_eq!(String::from_utf8(out).unwrap(), expected);
}
