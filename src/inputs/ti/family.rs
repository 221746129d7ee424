//! The five kinds of header.

/// A kind of header, by its length.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum TiFamily {
    /// 36 bytes: xWR14xx with SDK 1 or 2.
    Bytes36,
    /// 40 bytes: SDK 2 and 3, Radar Toolbox.
    Bytes40,
    /// 44 bytes: area scanner.
    Bytes44,
    /// 48 bytes: 3D people counting of older toolboxes.
    Bytes48,
    /// 52 bytes: people counting and traffic monitoring of older toolboxes.
    Bytes52,
}

/// What a frame begins with, as the last eight bytes read.
pub(super) const MAGIC: u64 = u64::from_le_bytes([0x02, 0x01, 0x04, 0x03, 0x06, 0x05, 0x08, 0x07]);

/// Bytes of the longest header.
pub(super) const LONGEST: usize = 52;

/// Bytes of the longest frame: points, and heat maps that are stepped over.
const LONGEST_FRAME: u32 = 1 << 19;

/// Most items of a frame.
const MOST_ITEMS: u32 = 64;

/// Bytes of an item's type and length.
pub(super) const ITEM_HEADER: u32 = 8;

/// A frame is filled up to a multiple of this.
pub(super) const PADDING: u32 = 32;

/// What a header says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct FrameHeader {
    /// Bytes of the frame, the header's included.
    pub(super) total: u32,
    pub(super) items: u32,
    pub(super) number: u32,
    /// Points announced, where a header has that.
    pub(super) points: Option<u16>,
    pub(super) sub_frame: u32,
    /// Major number of the SDK's version.
    pub(super) sdk: u8,
}

impl FrameHeader {
    /// Before the first.
    pub(super) const NONE: Self = Self { total: 0, items: 0, number: 0, points: None, sub_frame: 0, sdk: 0 };
}

impl TiFamily {
    /// All families.
    pub const ALL: [Self; 5] = [Self::Bytes36, Self::Bytes40, Self::Bytes44, Self::Bytes48, Self::Bytes52];

    /// Bytes of the header.
    pub const fn header(self) -> u32 {
        match self {
            Self::Bytes36 => 36,
            Self::Bytes40 => 40,
            Self::Bytes44 => 44,
            Self::Bytes48 => 48,
            Self::Bytes52 => 52,
        }
    }

    /// Reads a header; `None` if it cannot be one.
    #[allow(clippy::cast_possible_truncation)] // a byte of a version
    pub(super) fn read(self, bytes: &[u8; LONGEST]) -> Option<FrameHeader> {
        let word = |at: usize| bytes.get(at..).and_then(|b| b.first_chunk::<4>()).map_or(0, |b| u32::from_le_bytes(*b));
        let version = (word(8) >> 24) as u8;
        let header = match self {
            Self::Bytes48 => FrameHeader {
                total: word(12),
                items: word(44) & 0xFFFF,
                number: word(20),
                points: None,
                sub_frame: word(24),
                sdk: version,
            },
            Self::Bytes52 => FrameHeader {
                total: word(20),
                items: word(48) & 0xFFFF,
                number: word(24),
                points: None,
                sub_frame: word(28),
                sdk: version,
            },
            _ => FrameHeader {
                total: word(12),
                items: word(32),
                number: word(20),
                // the area scanner counts static points beside
                points: if self == Self::Bytes44 { None } else { u16::try_from(word(28)).ok() },
                sub_frame: if self == Self::Bytes36 { 0 } else { word(36) },
                sdk: version,
            },
        };
        let fits = header.total >= self.header() && header.total <= LONGEST_FRAME && header.items <= MOST_ITEMS;
        fits.then_some(header)
    }

    /// Bytes of an item's payload by its length field; `None` if it cannot be.
    pub(super) const fn payload(self, length: u32) -> Option<u32> {
        let payload = match self {
            Self::Bytes48 | Self::Bytes52 => length.checked_sub(ITEM_HEADER),
            _ => Some(length),
        };
        match payload {
            Some(bytes) if bytes <= LONGEST_FRAME => Some(bytes),
            _ => None,
        }
    }
}
