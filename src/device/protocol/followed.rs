//! One stream of samples among several on one line.

/// So many samples in a row of other streams, and the followed one is gone.
const GONE_AFTER: u64 = 400;

/// Chooses one of the streams of samples that a device sends side by side, so that no sample is counted twice.
///
/// The first stream stays until a better one comes, or until 400 samples in a row were of others: a device that was
/// restarted or set up anew may go on with another stream.
#[derive(Clone, Debug)]
pub(super) struct Followed<K> {
    stream: Option<(u8, K)>,
    others_in_row: u64,
    unused: u64,
}

impl<K> Default for Followed<K> {
    fn default() -> Self {
        Self { stream: None, others_in_row: 0, unused: 0 }
    }
}

impl<K: Copy + PartialEq> Followed<K> {
    /// Whether this sample of `stream` is to be used. A higher `quality` is a better stream.
    pub(super) fn takes(&mut self, quality: u8, stream: K) -> bool {
        match self.stream {
            Some((_, followed)) if followed == stream => {}
            Some((best, _)) if quality <= best && self.others_in_row < GONE_AFTER => {
                self.others_in_row += 1;
                self.unused += 1;
                return false;
            }
            _ => self.stream = Some((quality, stream)),
        }
        self.others_in_row = 0;
        true
    }

    /// The stream in use.
    pub(super) fn stream(&self) -> Option<K> {
        self.stream.map(|(_, stream)| stream)
    }

    /// Samples of other streams so far.
    pub(super) fn unused(&self) -> u64 {
        self.unused
    }

    /// Chooses anew; the count stays.
    pub(super) fn restart(&mut self) {
        self.stream = None;
        self.others_in_row = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_stays_until_a_better_one_comes() {
        let mut followed = Followed::default();
        let taken: Vec<bool> =
            [(1, 'a'), (1, 'b'), (0, 'c'), (1, 'a'), (2, 'd'), (1, 'a'), (2, 'd'), (2, 'e')]
                .map(|(quality, stream)| followed.takes(quality, stream))
                .to_vec();
        assert_eq!(taken, [true, false, false, true, true, false, true, false]);
        assert_eq!((followed.stream(), followed.unused()), (Some('d'), 4));
    }

    #[test]
    fn one_that_is_gone_is_replaced() {
        let mut followed = Followed::default();
        assert!(followed.takes(2, 'a'));
        assert!((0..GONE_AFTER).all(|_| !followed.takes(1, 'b')));
        assert!(followed.takes(1, 'b') && followed.takes(1, 'b'));
    }
}
