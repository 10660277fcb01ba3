//! From frames to samples: which frames belong together.

/// Frames that may make one sample.
pub(super) const MAX_PARTS: usize = 8;

/// How the parts of a sample find each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rule {
    /// They come one after the other: part 0 first.
    Order,
    /// They carry equal counters.
    EqualCounters,
}

/// What one frame says: gyro x y z, specific force x y z, in SI; 0 on the axes it does not carry.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Part {
    pub(super) values: [f64; 6],
    pub(super) clipped: bool,
    /// The device's clock, µs.
    pub(super) micros: Option<u64>,
    /// What pairs it, under [`Rule::EqualCounters`].
    pub(super) counter: u64,
}

/// Collects the parts of a sample. Fixed size.
#[derive(Clone, Debug)]
pub(super) struct Assembly {
    rule: Rule,
    count: usize,
    waiting: [Option<Part>; MAX_PARTS],
    /// Parts that came without the others of their sample.
    pub(super) lone: u64,
}

impl Assembly {
    /// For samples of `count` parts, at most [`MAX_PARTS`].
    pub(super) fn new(rule: Rule, count: usize) -> Self {
        Self { rule, count: count.min(MAX_PARTS), waiting: [None; MAX_PARTS], lone: 0 }
    }

    /// Takes part number `index`; gives the sample if this completes it.
    ///
    /// In order, a part that is not the next one ends the sample that had begun: its parts are lone. By counters, a
    /// part waits until the next frame of its own message takes its place, so that two samples whose frames are
    /// mixed do not both get lost.
    pub(super) fn take(&mut self, index: usize, part: Part) -> Option<Part> {
        match self.rule {
            Rule::Order => {
                if self.waiting[..self.count].iter().position(Option::is_none) != Some(index) {
                    self.abandon();
                }
                // Now nothing waits, or all parts before this one.
                if index > 0 && self.waiting[index - 1].is_none() {
                    self.lone += 1;
                    return None;
                }
                self.waiting[index] = Some(part);
            }
            Rule::EqualCounters => {
                self.lone += u64::from(self.waiting[index].replace(part).is_some());
            }
        }
        self.complete()
    }

    fn complete(&mut self) -> Option<Part> {
        let counter = self.waiting[0]?.counter;
        let mut sample = Part { counter, ..Part::default() };
        for part in &self.waiting[..self.count] {
            let part = part.as_ref()?;
            if self.rule == Rule::EqualCounters && part.counter != counter {
                return None;
            }
            sample.values.iter_mut().zip(part.values).for_each(|(sum, value)| *sum += value);
            sample.clipped |= part.clipped;
            sample.micros = sample.micros.or(part.micros);
        }
        self.waiting = [None; MAX_PARTS];
        Some(sample)
    }

    /// Gives up the parts that wait.
    pub(super) fn abandon(&mut self) {
        self.lone += self.waiting.iter().flatten().count() as u64;
        self.waiting = [None; MAX_PARTS];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(index: usize, counter: u64) -> Part {
        let mut part = Part { counter, ..Part::default() };
        part.values[index] = 1.0 + counter as f64;
        part
    }

    /// Feeds parts (index, counter); returns the samples' first values and the lone parts.
    fn feed(rule: Rule, count: usize, parts: &[(usize, u64)]) -> (Vec<[f64; 3]>, u64) {
        let mut assembly = Assembly::new(rule, count);
        let mut samples = Vec::new();
        for &(index, counter) in parts {
            samples.extend(
                assembly
                    .take(index, part(index, counter))
                    .map(|sample| [sample.values[0], sample.values[1], sample.values[2]]),
            );
        }
        assembly.abandon();
        (samples, assembly.lone)
    }

    #[test]
    fn in_order_a_frame_out_of_place_is_lone_and_the_next_sample_is_whole() {
        let order = |parts: &[(usize, u64)]| feed(Rule::Order, 2, parts);
        assert_eq!(order(&[(0, 0), (1, 0), (0, 1), (1, 1)]), (vec![[1.0, 1.0, 0.0], [2.0, 2.0, 0.0]], 0));
        assert_eq!(order(&[(0, 0), (0, 1), (1, 1)]), (vec![[2.0, 2.0, 0.0]], 1), "the second half was lost");
        assert_eq!(order(&[(0, 0), (1, 0), (1, 1), (0, 2), (1, 2)]).1, 1, "a first half was lost");
        assert_eq!(order(&[(1, 0), (0, 1)]), (vec![], 2), "joined in the middle, cut in the middle");
        let of_three = feed(Rule::Order, 3, &[(0, 0), (1, 0), (0, 1), (2, 1), (0, 2), (1, 2), (2, 2)]);
        assert_eq!(of_three, (vec![[3.0; 3]], 4));
    }

    #[test]
    fn by_counters_the_order_does_not_matter_but_equality_does() {
        let counters = |parts: &[(usize, u64)]| feed(Rule::EqualCounters, 2, parts);
        assert_eq!(counters(&[(1, 7), (0, 7)]), (vec![[8.0, 8.0, 0.0]], 0));
        assert_eq!(counters(&[(0, 7), (1, 8), (0, 9), (1, 9)]), (vec![[10.0, 10.0, 0.0]], 2));
        assert_eq!(counters(&[(0, 1), (0, 2), (1, 1), (1, 2)]), (vec![[3.0, 3.0, 0.0]], 2), "mixed samples");
    }

    #[test]
    fn a_sample_of_one_frame_needs_nothing() {
        assert_eq!(feed(Rule::Order, 1, &[(0, 3), (0, 4)]), (vec![[4.0, 0.0, 0.0], [5.0, 0.0, 0.0]], 0));
    }
}
