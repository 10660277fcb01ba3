//! Does the core still say, bit for bit, what it said when it was recorded?

use super::layout::{self, FieldSink};
use super::{DamageReport, RecordError, Recording};
use crate::tick::{TickInput, TickOutput};
use crate::time::Tick;

/// The first field of the first tick that came out differently.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Difference {
    /// Number of the tick.
    pub tick: u64,
    /// Path of the field in [`TickOutput`].
    pub field: String,
    /// Its bits as recorded.
    pub recorded_bits: u64,
    /// Its bits as computed again.
    pub computed_bits: u64,
}

/// Outcome of [`verify`].
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct VerifyReport {
    /// Ticks computed again and compared.
    pub ticks_compared: u64,
    /// Readable ticks behind the first gap: without what is lost, nobody knows the state the core was in.
    pub ticks_not_compared: u64,
    /// Compared ticks with any difference.
    pub differing_ticks: u64,
    /// The first difference.
    pub first_difference: Option<Difference>,
    /// The state of the recording.
    pub damage: DamageReport,
}

impl VerifyReport {
    /// True when every tick of a whole recording was compared and none differs.
    pub fn is_bit_identical(&self) -> bool {
        self.differing_ticks == 0 && self.ticks_not_compared == 0 && self.damage.complete
    }
}

/// Runs `core`, which must be in the state in which the recording began, over the recorded inputs and compares bits.
///
/// Late ticks are no gap: the core never saw them.
///
/// # Errors
/// As the items of [`Recording::ticks`].
pub fn verify(
    recording: &Recording,
    mut core: impl FnMut(&TickInput) -> TickOutput,
) -> Result<VerifyReport, RecordError> {
    let mut report = VerifyReport {
        ticks_compared: 0,
        ticks_not_compared: 0,
        differing_ticks: 0,
        first_difference: None,
        damage: recording.damage().clone(),
    };
    let (mut recorded, mut computed) = (Vec::new(), Vec::new());
    for tick in recording.ticks()? {
        let tick = tick?;
        let gapless = u64::from(tick.index) == report.ticks_compared && report.ticks_not_compared == 0;
        if !gapless {
            report.ticks_not_compared += 1;
            continue;
        }
        let output = core(&tick.input);
        report.ticks_compared += 1;
        layout::encode_output(&mut recorded, &tick.output);
        layout::encode_output(&mut computed, &output);
        if recorded != computed {
            report.differing_ticks += 1;
            report.first_difference =
                report.first_difference.or_else(|| difference(tick.input.tick, &tick.output, &output));
        }
    }
    Ok(report)
}

fn difference(tick: Tick, recorded: &TickOutput, computed: &TickOutput) -> Option<Difference> {
    let pairs = FieldList::of(recorded).fields.into_iter().zip(FieldList::of(computed).fields);
    let mut differing = pairs.filter(|((_, recorded), (_, computed))| recorded != computed);
    differing.next().map(|((field, recorded_bits), (_, computed_bits))| Difference {
        tick: tick.0,
        field,
        recorded_bits,
        computed_bits,
    })
}

/// The fields of a tick output: path and bits.
#[derive(Default)]
struct FieldList {
    scope: Vec<&'static str>,
    fields: Vec<(String, u64)>,
}

impl FieldList {
    fn of(output: &TickOutput) -> Self {
        let mut list = Self::default();
        layout::output_fields(output, &mut list);
        list
    }
}

impl FieldSink for FieldList {
    fn u8(&mut self, name: &'static str, value: u8) {
        self.u64(name, u64::from(value));
    }

    fn u64(&mut self, name: &'static str, value: u64) {
        self.enter(name);
        self.fields.push((self.scope.join("."), value));
        self.leave();
    }

    fn f64(&mut self, name: &'static str, value: f64) {
        self.u64(name, value.to_bits());
    }

    fn enter(&mut self, name: &'static str) {
        self.scope.push(name);
    }

    fn leave(&mut self) {
        self.scope.pop();
    }
}
