//! One claim of the paper and what became of it.

use serde::Serialize;

use crate::report::summary::rounded;

/// What an ordering asks for beyond equality: the last decimal that is kept.
const ORDERED: f64 = 1e-6;

/// A claim with the number that decides it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Claim {
    /// Its name in the JSON report.
    pub id: &'static str,
    /// What is claimed.
    pub claim: &'static str,
    /// What the paper says, or the reference where the paper gives no number.
    pub paper: &'static str,
    /// The number found; `None` when there is none, for example the recovery time of a character that fell.
    pub value: Option<f64>,
    /// Its unit; empty for a ratio.
    pub unit: &'static str,
    /// Least and largest value with which the claim holds; `None` is no bound.
    pub band: [Option<f64>; 2],
    /// Whether the reproduction fails without it.
    pub required: bool,
    /// Whether the number lies in the band. A claim without a number does not hold.
    pub holds: bool,
}

impl Claim {
    /// A required claim without bounds yet.
    pub(super) fn new(id: &'static str, claim: &'static str, paper: &'static str) -> Self {
        Self { id, claim, paper, value: None, unit: "", band: [None; 2], required: true, holds: false }
    }

    /// The number found, to six decimals.
    pub(super) fn is(self, value: Option<f64>, unit: &'static str) -> Self {
        Self { value: value.map(rounded), unit, ..self }.judged()
    }

    /// Least and largest number with which the claim holds.
    pub(super) fn within(self, least: f64, largest: f64) -> Self {
        Self { band: [Some(rounded(least)), Some(rounded(largest))], ..self }.judged()
    }

    /// More than `other`, which another run has given: an ordering. Where that run gave nothing there is nothing to
    /// compare, and the claim has no value.
    pub(super) fn above(self, other: Option<f64>) -> Self {
        let value = self.value.filter(|_| other.is_some());
        Self { band: [other.map(|other| rounded(other) + ORDERED), self.band[1]], value, ..self }.judged()
    }

    /// Less than `other`, likewise.
    pub(super) fn below(self, other: Option<f64>) -> Self {
        let value = self.value.filter(|_| other.is_some());
        Self { band: [self.band[0], other.map(|other| rounded(other) - ORDERED)], value, ..self }.judged()
    }

    /// At least `least`.
    pub(super) fn at_least(self, least: f64) -> Self {
        Self { band: [Some(rounded(least)), self.band[1]], ..self }.judged()
    }

    /// The reproduction does not fail without it.
    pub(super) fn optional(self) -> Self {
        Self { required: false, ..self }
    }

    fn judged(self) -> Self {
        let [least, largest] = self.band;
        let holds = self.value.is_some_and(|value| {
            least.is_none_or(|least| value >= least) && largest.is_none_or(|largest| value <= largest)
        });
        Self { holds, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn claim() -> Claim {
        Claim::new("id", "claim", "paper")
    }

    #[test]
    fn a_claim_holds_within_its_band_and_at_its_ends() {
        assert!(claim().is(Some(2.0), "deg").within(2.0, 3.0).holds);
        assert!(claim().within(2.0, 3.0).is(Some(3.0), "deg").holds);
        assert!(!claim().is(Some(3.1), "deg").within(2.0, 3.0).holds);
        assert!(!claim().is(Some(1.0), "deg").at_least(1.1).holds);
        assert!(claim().is(Some(1.1), "deg").at_least(1.1).holds);
    }

    #[test]
    fn what_is_not_known_does_not_hold() {
        assert!(!claim().is(None, "s").holds);
        assert!(!claim().is(None, "s").at_least(0.0).holds);
        assert!(!claim().is(Some(f64::NAN), "s").within(0.0, 1.0).holds);
        for unknown in [claim().is(Some(1e9), "s").above(None), claim().is(Some(-1e9), "s").below(None)] {
            assert_eq!((unknown.holds, unknown.value, unknown.band), (false, None, [None; 2]));
        }
    }

    #[test]
    fn an_ordering_of_equals_does_not_hold() {
        assert!(claim().is(Some(2.0), "deg").above(Some(1.9)).holds);
        assert!(!claim().is(Some(2.0), "deg").above(Some(2.0)).holds);
        assert!(claim().is(Some(1.9), "deg").below(Some(2.0)).holds);
        assert!(!claim().is(Some(2.0), "deg").below(Some(2.0)).holds);
    }
}
