//! The course of a run, kept small enough for a run of any length.

use crate::tick::{CharacterOutput, Posture, TickInput, TickOutput};
use crate::time::{TICK_NS, Tick};

/// Rows kept at most: 17 minutes at 1 kHz, about 90 MB.
const MAX_ROWS: usize = 1 << 20;
/// Ticks after a respawn that no metric counts: the standing pose starts 10 mm off balance by construction.
const SETTLE_TICKS: u64 = 2_000_000_000 / TICK_NS;

/// One character in one kept tick. `f32` because its 1e-7 is far below anything that is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CharacterRow {
    /// Angle between believed and true gravity, rad.
    pub gravity_tilt: f32,
    /// CoM sway angle, rad.
    pub com_sway: f32,
    /// Larger angle of a sole against the ground, rad.
    pub foot_tilt: f32,
    /// Believed yaw rate, rad/s, head z.
    pub omega_hat_z: f32,
    /// Centre of mass minus support centroid, turntable axes x and y, m.
    pub com: [f32; 2],
    /// Centre of pressure minus support centroid, turntable axes x and y, m; NaN without contact.
    pub cop: [f32; 2],
    /// Lying on the ground; the tick of the fall itself still counts as standing.
    pub down: bool,
    /// Stood up again less than 2 s ago.
    pub settling: bool,
}

impl CharacterRow {
    /// Whether peaks and ranges may use this row: up to and including the tick of a fall, and not while settling.
    pub fn counts(&self) -> bool {
        !self.down && !self.settling
    }
}

/// Which of the two characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Character {
    /// The one that trusts its vestibular model.
    Green,
    /// The one that perceives perfectly.
    Blue,
}

/// One kept tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Number of the tick: the time axis.
    pub tick: Tick,
    /// Measured yaw rate of the chair, rad/s; NaN when there was no measurement.
    pub chair_rate: f32,
    /// The character that trusts its vestibular model.
    pub green: CharacterRow,
    /// The character that perceives perfectly.
    pub blue: CharacterRow,
}

impl Row {
    /// The row's part about `character`.
    pub fn of(&self, character: Character) -> &CharacterRow {
        match character {
            Character::Green => &self.green,
            Character::Blue => &self.blue,
        }
    }
}

/// What is remembered of one character beyond its rows.
#[derive(Clone, Copy, Debug, Default)]
struct Fate {
    fell_at: Option<Tick>,
    fallen: bool,
    settling_until: Option<Tick>,
}

impl Fate {
    fn follow(&mut self, tick: Tick, respawn: bool, out: &CharacterOutput) -> CharacterRow {
        let fallen = out.posture == Posture::Fallen;
        // Stood up by a key, or by itself some time after a fall.
        if respawn || (self.fallen && !fallen) {
            self.settling_until = Some(Tick(tick.0 + SETTLE_TICKS));
        }
        let down = fallen && self.fallen && !respawn;
        if fallen && self.fell_at.is_none() {
            self.fell_at = Some(tick);
        }
        self.fallen = fallen;
        let cop = out.cop_platform.map_or([f32::NAN; 2], |cop| [cop.x as f32, cop.y as f32]);
        CharacterRow {
            gravity_tilt: out.gravity_tilt as f32,
            com_sway: out.com_sway as f32,
            foot_tilt: out.foot_tilt as f32,
            omega_hat_z: out.perception.omega_head.z as f32,
            com: [out.com_platform.x as f32, out.com_platform.y as f32],
            cop,
            down,
            settling: self.settling_until.is_some_and(|until| tick < until),
        }
    }
}

/// Collects what the metrics and the figure need from the stream of ticks.
///
/// Every tick is kept until [`Trace::push`] has filled the memory set aside (17 minutes at 1 kHz); then every second
/// row is dropped and every second tick kept from there on, and so again. What must be exact at any length, the
/// turned angle and the ticks of the falls, is summed on the way.
///
/// Pushing may allocate: collect on the recorder's thread, not on the control thread.
#[derive(Clone, Debug)]
pub struct Trace {
    rows: Vec<Row>,
    max_rows: usize,
    /// Ticks per kept row.
    stride: u64,
    pushed: u64,
    last: Option<(Tick, Option<f64>)>,
    turned: f64,
    green: Fate,
    blue: Fate,
}

impl Default for Trace {
    fn default() -> Self {
        Self::new()
    }
}

impl Trace {
    /// An empty trace.
    pub fn new() -> Self {
        Self::with_max_rows(MAX_ROWS)
    }

    pub(super) fn with_max_rows(max_rows: usize) -> Self {
        assert!(max_rows >= 2, "a trace needs room for two rows");
        Self {
            rows: Vec::new(),
            max_rows,
            stride: 1,
            pushed: 0,
            last: None,
            turned: 0.0,
            green: Fate::default(),
            blue: Fate::default(),
        }
    }

    /// Adds one tick. Ticks come in order; some may be missing.
    pub fn push(&mut self, input: &TickInput, output: &TickOutput) {
        let tick = input.tick;
        debug_assert_eq!(tick, output.tick, "input and output belong to the same tick");
        let rate = input.chair.map(|chair| chair.omega_head.z);
        if let (Some((before, Some(old))), Some(new)) = (self.last, rate) {
            self.turned += 0.5 * (old + new) * (tick.time_s() - before.time_s());
        }
        self.last = Some((tick, rate));
        let green = self.green.follow(tick, input.respawn, &output.green);
        let blue = self.blue.follow(tick, input.respawn, &output.blue);
        if self.pushed.is_multiple_of(self.stride) {
            if self.rows.len() == self.max_rows {
                self.halve();
            }
            let chair_rate = rate.map_or(f32::NAN, |rate| rate as f32);
            self.rows.push(Row { tick, chair_rate, green, blue });
        }
        self.pushed += 1;
    }

    /// Drops every second row. With an even limit the row about to be pushed is on the new, coarser grid.
    fn halve(&mut self) {
        let mut index = 0;
        self.rows.retain(|_| {
            index += 1;
            index % 2 == 1
        });
        self.stride *= 2;
    }

    /// The kept ticks, in order.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// Angle the chair turned about the vertical while it was measured, rad, left positive.
    ///
    /// Trapezoids over every tick pushed; the time between a lost and a returned measurement adds nothing.
    pub fn turned(&self) -> f64 {
        self.turned
    }

    /// Times of the first kept and the last pushed tick, s; `None` for an empty trace.
    pub fn span_s(&self) -> Option<(f64, f64)> {
        Some((self.rows.first()?.tick.time_s(), self.last?.0.time_s()))
    }

    /// First tick in which `character` was fallen.
    pub fn fell_at(&self, character: Character) -> Option<Tick> {
        match character {
            Character::Green => self.green.fell_at,
            Character::Blue => self.blue.fell_at,
        }
    }

    /// Measured yaw rates of the chair as (time in s, rate in rad/s), ticks without a measurement left out.
    pub fn chair_rates(&self) -> impl Iterator<Item = (f64, f64)> {
        let measured = self.rows.iter().filter(|row| !row.chair_rate.is_nan());
        measured.map(|row| (row.tick.time_s(), f64::from(row.chair_rate)))
    }
}
