//! How long a binary frame is and where its fields stand: all of it follows from its masks.

/// Sync byte of a binary frame.
pub(super) const SYNC: u8 = 0xFA;
/// Bit of the group byte that announces a second group byte.
const MORE_GROUPS: u8 = 0x80;
const GROUPS: usize = 7;

/// Bytes of each field of groups 1 to 7, lowest bit of the mask first; 0 where the size is unknown or depends on the
/// content (satellite lists and raw GNSS measurements, bits 14 and 15 of groups 4 and 7). From the field tables of
/// the VN-100, VN-200 and VN-300 manuals; the reserved bits of groups 3, 5 and 6 from the vendor's own library.
const SIZES: [[u8; 16]; GROUPS] = [
    [8, 8, 8, 12, 16, 12, 24, 12, 12, 24, 20, 28, 2, 4, 8, 0],
    [8, 8, 8, 2, 8, 8, 8, 4, 4, 1, 0, 0, 0, 0, 0, 0],
    [2, 12, 12, 12, 4, 4, 16, 12, 12, 12, 12, 2, 40, 0, 0, 0],
    [8, 8, 2, 1, 1, 24, 24, 12, 12, 12, 4, 4, 2, 28, 0, 0],
    [2, 12, 16, 36, 12, 12, 12, 12, 12, 12, 28, 24, 12, 0, 0, 0],
    [2, 24, 24, 12, 12, 12, 12, 12, 12, 4, 4, 68, 64, 0, 0, 0],
    [8, 8, 2, 1, 1, 24, 24, 12, 12, 12, 4, 4, 2, 28, 0, 0],
];

/// Longest frame there is: every field of known size.
pub(super) const LONGEST: usize = longest();

const fn longest() -> usize {
    let (mut bytes, mut field) = (2 + 2 * GROUPS + 2, 0);
    while field < 16 * GROUPS {
        bytes += SIZES[field / 16][field % 16] as usize;
        field += 1;
    }
    bytes
}

/// A field: group, counted from 0, and bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Field(usize, usize);

pub(super) const COMMON_TIME_STARTUP: Field = Field(0, 0);
pub(super) const COMMON_ANGULAR_RATE: Field = Field(0, 5);
pub(super) const COMMON_ACCEL: Field = Field(0, 8);
/// Uncompensated acceleration, then uncompensated angular rate.
pub(super) const COMMON_IMU: Field = Field(0, 9);
pub(super) const TIME_TIME_STARTUP: Field = Field(1, 0);
pub(super) const IMU_UNCOMP_ACCEL: Field = Field(2, 2);
pub(super) const IMU_UNCOMP_GYRO: Field = Field(2, 3);
pub(super) const IMU_ACCEL: Field = Field(2, 9);
pub(super) const IMU_ANGULAR_RATE: Field = Field(2, 10);
/// Saturated axes: magnetometer bits 0..2, accelerometer 3..5, gyroscope 6..8, pressure 9.
pub(super) const IMU_SENS_SAT: Field = Field(2, 11);

/// What the head of a frame says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Head {
    /// The masks are not all there yet.
    Incomplete,
    /// No frame begins so.
    NoFrame,
    /// A field of unknown size is announced: the length cannot be known.
    UnknownSize,
    /// All masks.
    Complete(Layout),
}

/// Fields of one kind of frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    masks: [u16; GROUPS],
    header_bytes: usize,
    /// Sync byte to checksum.
    pub(super) frame_bytes: usize,
}

impl Layout {
    /// Reads the head of a frame, which begins with the sync byte.
    pub(super) fn read(bytes: &[u8]) -> Head {
        let Some(&groups) = bytes.get(1) else { return Head::Incomplete };
        if groups == 0 {
            return Head::NoFrame;
        }
        if groups & MORE_GROUPS != 0 {
            return Head::UnknownSize;
        }
        let mut layout = Self { masks: [0; GROUPS], header_bytes: 2, frame_bytes: 0 };
        let mut payload = 0;
        for group in (0..GROUPS).filter(|group| groups >> group & 1 != 0) {
            let Some(&[low, high]) = bytes.get(layout.header_bytes..layout.header_bytes + 2) else {
                return Head::Incomplete;
            };
            let mask = u16::from_le_bytes([low, high]);
            if mask == 0 {
                return Head::NoFrame;
            }
            for bit in (0..16).filter(|bit| mask >> bit & 1 != 0) {
                match SIZES[group][bit] {
                    0 => return Head::UnknownSize,
                    size => payload += usize::from(size),
                }
            }
            layout.masks[group] = mask;
            layout.header_bytes += 2;
        }
        layout.frame_bytes = layout.header_bytes + payload + 2;
        Head::Complete(layout)
    }

    /// Sync byte, groups and masks: the same for all frames of one output.
    pub(super) fn header<'a>(&self, frame: &'a [u8]) -> &'a [u8] {
        frame.get(..self.header_bytes).unwrap_or(frame)
    }

    pub(super) fn has(&self, Field(group, bit): Field) -> bool {
        self.masks[group] >> bit & 1 != 0
    }

    /// The bytes of `field` in a frame of this layout; `None` if its mask does not hold it.
    pub(super) fn field<'a>(&self, frame: &'a [u8], field: Field) -> Option<&'a [u8]> {
        if !self.has(field) {
            return None;
        }
        let Field(group, bit) = field;
        let before = |group: usize, mask: u16| -> usize {
            (0..16).filter(|bit| mask >> bit & 1 != 0).map(|bit| usize::from(SIZES[group][bit])).sum()
        };
        let in_groups: usize = (0..group).map(|group| before(group, self.masks[group])).sum();
        let in_group = before(group, self.masks[group] & ((1 << bit) - 1));
        let start = self.header_bytes + in_groups + in_group;
        frame.get(start..start + usize::from(SIZES[group][bit]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_length_follows_from_any_mask_of_known_fields() {
        for (group, sizes) in SIZES.iter().enumerate() {
            for (bit, &size) in sizes.iter().enumerate() {
                let mask = (1u16 << bit).to_le_bytes();
                let head = Layout::read(&[SYNC, 1 << group, mask[0], mask[1]]);
                match size {
                    0 => assert_eq!(head, Head::UnknownSize),
                    size => {
                        let Head::Complete(layout) = head else { panic!("{head:?}") };
                        assert_eq!(layout.frame_bytes, 6 + usize::from(size));
                    }
                }
            }
        }
    }

    #[test]
    fn a_field_stands_behind_all_lower_ones() {
        // TimeStartup; TimeStatus; UncompGyro and Accel.
        let head = Layout::read(&[SYNC, 0x07, 0x01, 0, 0, 0x02, 0x08, 0x02]);
        let Head::Complete(layout) = head else { panic!("{head:?}") };
        assert_eq!(layout.frame_bytes, 8 + 8 + 1 + 24 + 2);
        let frame: Vec<u8> = (0..layout.frame_bytes as u8).collect();
        let at = |field| layout.field(&frame, field).map(|bytes| (bytes[0], bytes.len()));
        assert_eq!(at(COMMON_TIME_STARTUP), Some((8, 8)));
        assert_eq!(at(IMU_UNCOMP_GYRO), Some((17, 12)));
        assert_eq!(at(IMU_ACCEL), Some((29, 12)));
        assert_eq!((at(COMMON_ACCEL), at(IMU_ANGULAR_RATE)), (None, None));
    }

    #[test]
    fn heads_that_are_none() {
        assert_eq!(Layout::read(&[SYNC]), Head::Incomplete);
        assert_eq!(Layout::read(&[SYNC, 0x05, 0x01, 0x00, 0x00]), Head::Incomplete);
        assert_eq!(Layout::read(&[SYNC, 0]), Head::NoFrame);
        assert_eq!(Layout::read(&[SYNC, 0x01, 0, 0]), Head::NoFrame);
        assert_eq!(Layout::read(&[SYNC, 0x81]), Head::UnknownSize);
    }
}
