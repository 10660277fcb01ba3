//! A line along the lower edge of a cloud of delays.

/// Width of a bin, ns: one minimum is kept of each.
const BIN_NS: i64 = 500_000_000;
/// Bins kept: 60 s.
const BINS: usize = 120;
/// A line needs minima this far apart, ns; before that the smallest delay seen is used.
const LINE_FROM_NS: i64 = 3_000_000_000;
/// A whole bin later than the line by more than this is out of step, ns.
const LEFT_BEHIND_NS: i64 = 100_000_000;
/// So many bins out of step in a row, and the line belongs to the past.
const LEFT_BEHIND_BINS: u32 = 4;

/// The smallest delay of one bin and when it occurred, ns.
#[derive(Clone, Copy, Debug, Default)]
struct Minimum {
    at_ns: i64,
    delay_ns: i64,
}

/// `delay(t) = reference + offset + drift (t - reference time)`.
#[derive(Clone, Copy, Debug)]
struct Line {
    reference: Minimum,
    offset_ns: f64,
    drift: f64,
}

impl Line {
    fn delay_ns(&self, at_ns: i64) -> i64 {
        let correction = self.offset_ns + self.drift * (at_ns - self.reference.at_ns) as f64;
        self.reference.delay_ns.saturating_add(correction.round() as i64)
    }
}

/// Lower edge of delays over time: minima of 0.5 s bins over 60 s, a least-squares line through them, and once more
/// through those that lie in the lower half of the residuals. Fixed size.
#[derive(Clone, Debug)]
pub(super) struct Envelope {
    /// Closed bins, a ring.
    minima: [Minimum; BINS],
    /// Closed bins ever; the ring holds the last [`BINS`].
    closed: usize,
    open: Option<Minimum>,
    /// Smallest delay of all, until there is a line.
    smallest_ns: i64,
    line: Option<Line>,
    bins_behind: u32,
}

impl Default for Envelope {
    fn default() -> Self {
        Self {
            minima: [Minimum::default(); BINS],
            closed: 0,
            open: None,
            smallest_ns: i64::MAX,
            line: None,
            bins_behind: 0,
        }
    }
}

impl Envelope {
    /// Takes in the delay of a sample. Times may repeat; bins follow the order of arrival.
    pub(super) fn push(&mut self, at_ns: i64, delay_ns: i64) {
        self.smallest_ns = self.smallest_ns.min(delay_ns);
        let sample = Minimum { at_ns, delay_ns };
        match &mut self.open {
            Some(open) if at_ns.div_euclid(BIN_NS) <= open.at_ns.div_euclid(BIN_NS) => {
                if delay_ns < open.delay_ns {
                    *open = sample;
                }
            }
            Some(open) => {
                let finished = std::mem::replace(open, sample);
                self.close(finished);
            }
            None => self.open = Some(sample),
        }
    }

    /// Lower edge of the delay at a time, ns. `i64::MAX` before the first sample.
    pub(super) fn delay_ns(&self, at_ns: i64) -> i64 {
        self.line.map_or(self.smallest_ns, |line| line.delay_ns(at_ns))
    }

    /// Slope of the line; zero as long as there is none.
    pub(super) fn drift(&self) -> f64 {
        self.line.map_or(0.0, |line| line.drift)
    }

    /// True when for 2 s no sample came near the line: the source clock stood still, or counted samples were lost.
    pub(super) fn is_left_behind(&self) -> bool {
        self.bins_behind >= LEFT_BEHIND_BINS
    }

    fn close(&mut self, finished: Minimum) {
        let late =
            self.line.is_some_and(|line| finished.delay_ns - line.delay_ns(finished.at_ns) > LEFT_BEHIND_NS);
        self.bins_behind = if late { self.bins_behind + 1 } else { 0 };
        self.minima[self.closed % BINS] = finished;
        self.closed += 1;
        if let Some(line) = self.fit(finished) {
            self.line = Some(line);
        }
    }

    /// Line through the lower half of the minima of the last 60 s; `None` while they span less than 3 s.
    fn fit(&self, newest: Minimum) -> Option<Line> {
        let oldest_ns = newest.at_ns - BINS as i64 * BIN_NS;
        let recent = || {
            let kept = &self.minima[..self.closed.min(BINS)];
            kept.iter().filter(move |minimum| minimum.at_ns >= oldest_ns)
        };
        let first_ns = recent().map(|minimum| minimum.at_ns).min()?;
        // The last bin reaches half a second beyond its minimum.
        if newest.at_ns - first_ns < LINE_FROM_NS - BIN_NS {
            return None;
        }
        let line = least_squares(newest, recent())?;
        let mut residuals = [0.0; BINS];
        let mut count = 0;
        for (residual, minimum) in residuals.iter_mut().zip(recent()) {
            *residual = residual_ns(&line, minimum);
            count += 1;
        }
        let (_, &mut median, _) = residuals[..count].select_nth_unstable_by((count - 1) / 2, f64::total_cmp);
        least_squares(newest, recent().filter(|minimum| residual_ns(&line, minimum) <= median)).or(Some(line))
    }
}

fn residual_ns(line: &Line, minimum: &Minimum) -> f64 {
    // From the differences, not from the rounded line: equal delays must give equal residuals.
    let line_ns = line.offset_ns + line.drift * (minimum.at_ns - line.reference.at_ns) as f64;
    (minimum.delay_ns - line.reference.delay_ns) as f64 - line_ns
}

/// Least-squares line, relative to `reference` so that equal delays give exactly zero; `None` for a single time.
fn least_squares<'a>(reference: Minimum, minima: impl Iterator<Item = &'a Minimum> + Clone) -> Option<Line> {
    let point = |minimum: &Minimum| {
        ((minimum.at_ns - reference.at_ns) as f64, (minimum.delay_ns - reference.delay_ns) as f64)
    };
    let (mut count, mut mean_t, mut mean_d) = (0.0, 0.0, 0.0);
    for (t, d) in minima.clone().map(point) {
        count += 1.0;
        mean_t += t;
        mean_d += d;
    }
    mean_t /= count;
    mean_d /= count;
    let (mut square, mut product) = (0.0, 0.0);
    for (t, d) in minima.map(point) {
        square += (t - mean_t) * (t - mean_t);
        product += (t - mean_t) * (d - mean_d);
    }
    let drift = product / square;
    (square > 0.0).then_some(Line { reference, offset_ns: mean_d - drift * mean_t, drift })
}
