//! One character of one run, as a figure shows it.

use super::paint::Pen;
use super::series::{self, Pieces};
use crate::report::Analysis;
use crate::report::trace::{Character, CharacterRow, Row, Trace};

/// An angle of a character, rad.
pub(super) type Angle = fn(&CharacterRow) -> f32;
/// A position on the turntable, (x, y) in m, of what a map is about.
pub(super) type Position = fn(&CharacterRow) -> [f32; 2];

/// One character of one run and the ink it is drawn in.
#[derive(Clone, Copy)]
pub(super) struct Subject<'a> {
    pub(super) trace: &'a Trace,
    pub(super) analysis: &'a Analysis,
    pub(super) character: Character,
    pub(super) pen: Pen,
}

/// The end of a curve.
#[derive(Clone, Copy)]
pub(super) struct Fall<'a> {
    pub(super) time_s: f64,
    pub(super) row: &'a CharacterRow,
}

impl<'a> Subject<'a> {
    /// `angle` in deg over time in s.
    pub(super) fn angle_over_time(&self, angle: Angle) -> Pieces {
        series::over_time(self.trace, |row| standing(row, self.character, angle).map(f64::to_degrees))
    }

    /// The path of `position` after the stop, drawn where `at` puts (x, y) in m.
    pub(super) fn path_after_stop(&self, position: Position, at: &dyn Fn([f64; 2]) -> (f64, f64)) -> Pieces {
        let shown = |row: &Row| self.is_after_stop(row) && row.of(self.character).counts();
        series::path(self.trace, shown, |row| self.place(row, position).map(at))
    }

    /// Where `position` last was before a fall after the stop, (x, y) in m.
    pub(super) fn fell_after_stop_at(&self, position: Position) -> Option<[f64; 2]> {
        let fell_at = self.trace.fell_at(self.character)?;
        let before = self.trace.rows().iter().rev().filter(|row| row.tick <= fell_at);
        before.take_while(|row| self.is_after_stop(row)).find_map(|row| self.place(row, position))
    }

    fn is_after_stop(&self, row: &Row) -> bool {
        self.analysis.windows.after_stop.is_some_and(|window| window.contains(row.tick.time_s()))
    }

    fn place(&self, row: &Row, position: Position) -> Option<[f64; 2]> {
        let place = position(row.of(self.character)).map(f64::from);
        place.iter().all(|along| along.is_finite()).then_some(place)
    }

    /// The first fall, if its tick or a later one was kept.
    pub(super) fn fall(&self) -> Option<Fall<'a>> {
        let fell_at = self.trace.fell_at(self.character)?;
        let row = self.trace.rows().iter().find(|row| row.tick >= fell_at)?;
        Some(Fall { time_s: fell_at.time_s(), row: row.of(self.character) })
    }
}

/// `value` of a character up to and including the tick of its fall.
pub(super) fn standing(row: &Row, character: Character, value: fn(&CharacterRow) -> f32) -> Option<f64> {
    let row = row.of(character);
    (!row.down).then(|| f64::from(value(row)))
}
