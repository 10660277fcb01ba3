//! Scales, ticks and the frame of a plot.

use super::paint::{Anchor, Canvas, Pen, Type, Words};
use super::{FRAME, GRID, INK, LABEL};

/// A linear map from data to px.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    /// Data at both ends.
    pub(super) data: (f64, f64),
    /// Px at both ends.
    pub(super) px: (f64, f64),
}

impl Scale {
    pub(super) fn map(&self, value: f64) -> f64 {
        let share = (value - self.data.0) / (self.data.1 - self.data.0);
        self.px.0 + share * (self.px.1 - self.px.0)
    }
}

/// Round values inside a range and how many decimals they need.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Ticks {
    pub(super) values: Vec<f64>,
    pub(super) step: f64,
    decimals: usize,
}

impl Ticks {
    /// At most about `wanted` multiples of 1, 2 or 5 times a power of ten in `low..=high`.
    ///
    /// An empty or non-finite range gives no ticks.
    pub(super) fn new(low: f64, high: f64, wanted: usize) -> Self {
        let raw = (high - low) / wanted.max(1) as f64;
        if !(raw.is_finite() && raw > 0.0) {
            return Self { values: Vec::new(), step: 1.0, decimals: 0 };
        }
        let exponent = libm::floor(libm::log10(raw));
        let power = libm::pow(10.0, exponent);
        let factor = [1.0, 2.0, 5.0, 10.0].into_iter().find(|f| f * power >= raw * 0.999_999).unwrap_or(10.0);
        let step = factor * power;
        let (first, last) = ((low / step - 1e-9).ceil() as i64, (high / step + 1e-9).floor() as i64);
        let decimals = if step < 0.999 { (-exponent) as usize - usize::from(factor == 10.0) } else { 0 };
        Self { values: (first..=last).map(|n| n as f64 * step).collect(), step, decimals }
    }

    pub(super) fn label(&self, value: f64) -> String {
        // A real minus sign, and none for zero.
        format!("{:.*}", self.decimals, value + 0.0).replace('-', "\u{2212}")
    }
}

/// A range that holds `values` and zero, is at least `least` wide, and ends on ticks clear of the data.
pub(super) fn padded_range(values: impl Iterator<Item = f64>, least: f64, wanted: usize) -> (f64, f64) {
    let (low, high) = values
        .filter(|value| value.is_finite())
        .fold((0.0_f64, 0.0_f64), |(low, high), value| (low.min(value), high.max(value)));
    let clear = 0.05 * (high - low);
    let low = if low < 0.0 { low - clear } else { 0.0 };
    let high = if high > 0.0 { high + clear } else { 0.0 }.max(low + least);
    let step = Ticks::new(low, high, wanted).step;
    ((low / step).floor() * step, (high / step).ceil() * step)
}

/// A rectangle with two axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plot {
    pub(super) x: Scale,
    pub(super) y: Scale,
}

impl Plot {
    pub(super) fn point(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (self.x.map(x), self.y.map(y))
    }

    pub(super) fn corner(&self) -> (f64, f64) {
        (self.x.px.0, self.y.px.1)
    }

    pub(super) fn size(&self) -> (f64, f64) {
        (self.x.px.1 - self.x.px.0, self.y.px.0 - self.y.px.1)
    }

    /// Paints inside the plot only.
    pub(super) fn inside(&self, canvas: &mut Canvas, paint: impl FnOnce(&mut Canvas)) {
        canvas.clipped(self.corner(), self.size(), paint);
    }

    /// Horizontal grid lines and the labels of the upright axis.
    pub(super) fn upright_axis(&self, canvas: &mut Canvas, ticks: &Ticks, label: Words) {
        let (left, right) = self.x.px;
        for &value in &ticks.values {
            let y = self.y.map(value);
            canvas.line((left, y), (right, y), Pen::solid(GRID, 0.6));
            canvas.line((left - 4.0, y), (left, y), Pen::solid(FRAME, 0.8));
            let look = Type { anchor: Anchor::End, ..LABEL };
            canvas.text((left - 7.0, y + 3.5), look, &ticks.label(value));
        }
        let middle = 0.5 * (self.y.px.0 + self.y.px.1);
        let look = Type { anchor: Anchor::Middle, colour: INK, ..LABEL };
        canvas.text_upwards((left - 38.0, middle), look, label);
    }

    /// Vertical grid lines and tick marks; with `label`, also the numbers and the axis title.
    pub(super) fn level_axis(&self, canvas: &mut Canvas, ticks: &Ticks, label: Option<&str>) {
        let (bottom, top) = self.y.px;
        for &value in &ticks.values {
            let x = self.x.map(value);
            canvas.line((x, bottom), (x, top), Pen::solid(GRID, 0.6));
            canvas.line((x, bottom), (x, bottom + 4.0), Pen::solid(FRAME, 0.8));
            if label.is_some() {
                let look = Type { anchor: Anchor::Middle, ..LABEL };
                canvas.text((x, bottom + 16.0), look, &ticks.label(value));
            }
        }
        if let Some(label) = label {
            let middle = 0.5 * (self.x.px.0 + self.x.px.1);
            let look = Type { anchor: Anchor::Middle, colour: INK, ..LABEL };
            canvas.text((middle, bottom + 32.0), look, label);
        }
    }

    pub(super) fn frame(&self, canvas: &mut Canvas) {
        canvas.framed_rect(self.corner(), self.size(), Pen::solid(FRAME, 0.9));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(low: f64, high: f64, wanted: usize) -> Vec<String> {
        let ticks = Ticks::new(low, high, wanted);
        ticks.values.iter().map(|&value| ticks.label(value)).collect()
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!(labels(0.0, 43.0, 10), ["0", "5", "10", "15", "20", "25", "30", "35", "40"]);
        assert_eq!(labels(-0.31, 0.3, 4), ["\u{2212}0.2", "0.0", "0.2"]);
        assert_eq!(
            labels(0.0, 1.0, 10),
            ["0.0", "0.1", "0.2", "0.3", "0.4", "0.5", "0.6", "0.7", "0.8", "0.9", "1.0"]
        );
        assert_eq!(labels(0.0, 30.0, 3), ["0", "10", "20", "30"]);
    }

    #[test]
    fn a_range_without_extent_has_no_ticks() {
        assert!(Ticks::new(1.0, 1.0, 5).values.is_empty());
        assert!(Ticks::new(f64::NAN, 1.0, 5).values.is_empty());
    }

    #[test]
    fn ranges_hold_zero_and_the_data_with_room() {
        assert_eq!(padded_range([6.03].into_iter(), 1.0, 4), (0.0, 8.0));
        assert_eq!(padded_range([-11.3, 30.0].into_iter(), 1.0, 4), (-20.0, 40.0));
        assert_eq!(padded_range(std::iter::empty(), 1.0, 4), (0.0, 1.0));
    }
}
