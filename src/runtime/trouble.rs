//! Names for what goes wrong on the way from the device, with a beginning and an end.

use std::time::Duration;

use crate::device::LinkStatus;
use crate::device::can::bus::BusState;
use crate::device::protocol::DecodeCounters;
use crate::imu::ImuCounters;
use crate::time::HostTime;

/// A trouble is over when it has not shown for this long.
pub const QUIET: Duration = Duration::from_millis(250);

/// What can go wrong between a device and its samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Trouble {
    /// The port or interface is gone.
    ConnectionLost,
    /// The CAN interface is down.
    InterfaceDown,
    /// The controller has switched itself off the CAN bus.
    BusOff,
    /// Samples had begun to come and stopped before the alignment was over. Later it is the age of the newest sample that
    /// tells: [`crate::imu::LinkHealth`].
    NoSamples,
    /// The controller or the interface reports errors.
    BusErrors,
    /// Packets with a wrong checksum or broken framing.
    DamagedPackets,
    /// Bytes that belong to no packet.
    StrayBytes,
    /// Frames the kernel dropped because they were not taken in time.
    Overflow,
    /// Packets that were sent and did not come.
    MissingPackets,
    /// Packets or samples that came twice, or after a newer one.
    RepeatedPackets,
    /// Gyroscope or accelerometer without the other.
    LoneHalves,
    /// Errors the device itself reports.
    DeviceErrors,
    /// Samples the device dropped before sending.
    DroppedByDevice,
    /// At least one sample is not there, by the time between its neighbours.
    Gap,
    /// The device's clock stepped.
    ClockStep,
    /// The device changed its sample rate.
    RateChange,
    /// An axis stands at the end of its range.
    Clipping,
    /// Values that are no numbers.
    NotFinite,
}

/// Every trouble, gravest first.
pub const TROUBLES: [Trouble; 18] = [
    Trouble::ConnectionLost,
    Trouble::InterfaceDown,
    Trouble::BusOff,
    Trouble::NoSamples,
    Trouble::BusErrors,
    Trouble::DamagedPackets,
    Trouble::StrayBytes,
    Trouble::Overflow,
    Trouble::MissingPackets,
    Trouble::RepeatedPackets,
    Trouble::LoneHalves,
    Trouble::DeviceErrors,
    Trouble::DroppedByDevice,
    Trouble::Gap,
    Trouble::ClockStep,
    Trouble::RateChange,
    Trouble::Clipping,
    Trouble::NotFinite,
];

impl Trouble {
    /// Name for people.
    pub fn name(self) -> &'static str {
        match self {
            Trouble::ConnectionLost => "connection lost",
            Trouble::InterfaceDown => "interface down",
            Trouble::BusOff => "bus off",
            Trouble::NoSamples => "no samples",
            Trouble::BusErrors => "bus errors",
            Trouble::DamagedPackets => "damaged packets",
            Trouble::StrayBytes => "bytes of no packet",
            Trouble::Overflow => "frames dropped by the kernel",
            Trouble::MissingPackets => "missing packets",
            Trouble::RepeatedPackets => "repeated or late packets",
            Trouble::LoneHalves => "half samples",
            Trouble::DeviceErrors => "errors reported by the device",
            Trouble::DroppedByDevice => "samples dropped by the device",
            Trouble::Gap => "gaps between samples",
            Trouble::ClockStep => "step of the device clock",
            Trouble::RateChange => "changed sample rate",
            Trouble::Clipping => "clipped samples",
            Trouble::NotFinite => "values that are no numbers",
        }
    }

    /// Whether it goes on although nothing more is counted.
    fn lasts(self, counts: &Counts) -> bool {
        match self {
            Trouble::ConnectionLost => counts.link.down,
            Trouble::InterfaceDown => counts.link.bus_state == BusState::InterfaceDown,
            Trouble::BusOff => counts.link.bus_state == BusState::BusOff,
            Trouble::NoSamples => counts.silence.lasts,
            _ => false,
        }
    }

    /// How often it has shown.
    fn count(self, counts: &Counts) -> u64 {
        let Counts { decode, link, imu, silence } = counts;
        match self {
            Trouble::ConnectionLost => link.losses,
            Trouble::InterfaceDown => u64::from(link.bus_state == BusState::InterfaceDown),
            Trouble::BusOff => link.bus_off,
            Trouble::NoSamples => silence.count,
            Trouble::BusErrors => link.bus_errors,
            Trouble::DamagedPackets => decode.bad_checksum,
            Trouble::StrayBytes => decode.bytes_skipped + link.bytes_skipped,
            Trouble::Overflow => link.overflowed,
            Trouble::MissingPackets => decode.missing,
            Trouble::RepeatedPackets => decode.repeated + imu.repeated + imu.out_of_order,
            Trouble::LoneHalves => decode.lone_halves,
            Trouble::DeviceErrors => decode.device_errors,
            Trouble::DroppedByDevice => decode.device_dropped,
            Trouble::Gap => imu.time_gaps,
            Trouble::ClockStep => imu.clock_resets,
            Trouble::RateChange => imu.rate_changes,
            Trouble::Clipping => imu.clipped,
            Trouble::NotFinite => imu.non_finite,
        }
    }
}

/// A set of troubles, one bit each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Troubles(u32);

impl Troubles {
    /// The set as a number, for [`Troubles::from_bits`].
    pub(super) fn bits(self) -> u32 {
        self.0
    }

    /// The set with these [`Troubles::bits`].
    pub(super) fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    /// Whether `trouble` is among them.
    pub fn contains(self, trouble: Trouble) -> bool {
        self.0 & (1 << trouble as u32) != 0
    }

    /// The members, gravest first.
    pub fn iter(self) -> impl Iterator<Item = Trouble> {
        TROUBLES.into_iter().filter(move |trouble| self.contains(*trouble))
    }
}

impl FromIterator<Trouble> for Troubles {
    fn from_iter<I: IntoIterator<Item = Trouble>>(troubles: I) -> Self {
        Self(troubles.into_iter().fold(0, |bits, trouble| bits | 1 << trouble as u32))
    }
}

/// Everything that is counted on the way to head samples.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counts {
    /// By the decoder.
    pub decode: DecodeCounters,
    /// By the link.
    pub link: LinkStatus,
    /// By the IMU path.
    pub imu: ImuCounters,
    /// Silences during the alignment.
    pub silence: Silence,
}

/// Samples that stopped coming before the alignment was over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Silence {
    /// How often they did.
    pub count: u64,
    /// Whether none come now.
    pub lasts: bool,
}

/// A change to note.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// It has begun.
    Begun(Trouble),
    /// It is over; with how often it showed.
    Over(Trouble, u64),
}

/// One trouble through time.
#[derive(Clone, Copy, Debug, Default)]
struct Episode {
    /// Count when it was last looked at.
    seen: u64,
    /// While it lasts: the count before it began, and when it last showed.
    present: Option<(u64, HostTime)>,
}

/// Finds beginnings and ends of troubles in what a source has counted. Fixed size.
///
/// A trouble begins when its count rises and is over when the count has stood still for [`QUIET`] and samples come
/// again; a lost connection, a bus that is off or down and silence also only once they are over themselves.
#[derive(Clone, Debug, Default)]
pub struct TroubleWatch {
    episodes: [Episode; TROUBLES.len()],
    readings: u64,
    /// Those that are not looked for.
    blind: Troubles,
}

impl TroubleWatch {
    /// A watch that does not see some troubles: the negative control of its tests.
    pub fn blind_to(troubles: impl IntoIterator<Item = Trouble>) -> Self {
        Self { blind: troubles.into_iter().collect(), ..Self::default() }
    }

    /// Looks at what has been counted up to `now` and calls `on_change` for what has begun or is over.
    pub fn look(&mut self, now: HostTime, counts: &Counts, mut on_change: impl FnMut(Change)) {
        let samples_come = counts.imu.readings > self.readings;
        self.readings = counts.imu.readings;
        for (trouble, episode) in TROUBLES.into_iter().zip(&mut self.episodes) {
            if self.blind.contains(trouble) {
                continue;
            }
            let count = trouble.count(counts);
            // A late packet takes back a loss: that is no new trouble.
            let rose = count > episode.seen;
            let lasts = trouble.lasts(counts);
            match &mut episode.present {
                None if rose => {
                    episode.present = Some((episode.seen, now));
                    on_change(Change::Begun(trouble));
                }
                Some((_, last)) if rose || lasts => *last = now,
                Some((before, last)) if samples_come && now.saturating_since(*last) >= QUIET => {
                    on_change(Change::Over(trouble, count.saturating_sub(*before)));
                    episode.present = None;
                }
                _ => {}
            }
            episode.seen = count;
        }
    }

    /// The troubles present now, gravest first.
    pub fn present(&self) -> impl Iterator<Item = Trouble> {
        let both = TROUBLES.into_iter().zip(&self.episodes);
        both.filter(|(_, episode)| episode.present.is_some()).map(|(trouble, _)| trouble)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(samples: u64, bad_checksum: u64, link: LinkStatus) -> Counts {
        Counts {
            decode: DecodeCounters { bad_checksum, ..DecodeCounters::default() },
            imu: ImuCounters { readings: samples, ..ImuCounters::default() },
            link,
            ..Counts::default()
        }
    }

    fn ms(ms: u64) -> HostTime {
        HostTime(ms * 1_000_000)
    }

    #[test]
    fn a_burst_is_one_trouble_with_a_beginning_and_an_end() {
        let mut watch = TroubleWatch::default();
        let mut changes = Vec::new();
        for k in 0..100_u64 {
            // Two damaged packets at 200 ms, one more at 300 ms.
            let bad = [0, 2, 3][usize::from(k >= 20) + usize::from(k >= 30)];
            watch.look(ms(10 * k), &counts(k, bad, LinkStatus::default()), |change| {
                changes.push((10 * k, change))
            });
            assert_eq!(watch.present().count(), usize::from((20..55).contains(&k)), "{k}");
        }
        let damaged = Trouble::DamagedPackets;
        assert_eq!(changes, [(200, Change::Begun(damaged)), (550, Change::Over(damaged, 3))]);
    }

    #[test]
    fn a_lost_connection_lasts_until_it_is_back_and_gives_samples() {
        let mut watch = TroubleWatch::default();
        let down = LinkStatus { down: true, losses: 1, ..LinkStatus::default() };
        let back = LinkStatus { down: false, losses: 1, reconnects: 1, ..LinkStatus::default() };
        let mut over = Vec::new();
        let mut look = |at, samples, link| {
            watch.look(ms(at), &counts(samples, 0, link), |change| over.push((at, change)));
        };
        look(0, 1, LinkStatus::default());
        look(10, 1, down);
        look(5000, 1, down);
        look(5600, 1, back);
        look(6000, 2, back);
        let lost = Trouble::ConnectionLost;
        assert_eq!(over, [(10, Change::Begun(lost)), (6000, Change::Over(lost, 1))]);
    }

    #[test]
    fn a_blind_watch_is_blind_to_nothing_else() {
        let mut watch = TroubleWatch::blind_to([Trouble::DamagedPackets]);
        let status = LinkStatus { bus_off: 1, ..LinkStatus::default() };
        watch.look(ms(0), &counts(1, 1, status), |_| {});
        assert!(watch.present().eq([Trouble::BusOff]));
    }
}
