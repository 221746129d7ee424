//! A CAN or CAN FD frame, whatever driver it comes from.

/// Most data bytes of a frame.
pub const MOST_BYTES: usize = 64;

/// An identifier of 11 or 29 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CanId {
    /// 11 bits.
    Standard(u16),
    /// 29 bits.
    Extended(u32),
}

impl CanId {
    /// An 11-bit identifier; `None` above 0x7FF.
    pub const fn standard(raw: u16) -> Option<Self> {
        if raw <= 0x7FF { Some(Self::Standard(raw)) } else { None }
    }

    /// A 29-bit identifier; `None` above 0x1FFF_FFFF.
    pub const fn extended(raw: u32) -> Option<Self> {
        if raw <= 0x1FFF_FFFF { Some(Self::Extended(raw)) } else { None }
    }

    /// The identifier's number.
    pub const fn raw(self) -> u32 {
        match self {
            Self::Standard(raw) => raw as u32,
            Self::Extended(raw) => raw,
        }
    }
}

/// A data frame of at most 64 bytes.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct CanFrame {
    /// Identifier.
    pub id: CanId,
    /// Whether it is a CAN FD frame.
    pub fd: bool,
    length: u8,
    data: [u8; MOST_BYTES],
}

impl CanFrame {
    /// A classic frame; `None` if there are more than 8 bytes.
    pub fn classic(id: CanId, bytes: &[u8]) -> Option<Self> {
        if bytes.len() > 8 { None } else { Self::filled(id, false, bytes, bytes.len()) }
    }

    /// A CAN FD frame, zeros appended up to the next length a frame can have; `None` beyond 64 bytes.
    pub fn fd(id: CanId, bytes: &[u8]) -> Option<Self> {
        Self::filled(id, true, bytes, fd_length(bytes.len())?)
    }

    #[allow(clippy::cast_possible_truncation)] // at most 64
    fn filled(id: CanId, fd: bool, bytes: &[u8], length: usize) -> Option<Self> {
        let mut data = [0; MOST_BYTES];
        data.get_mut(..bytes.len())?.copy_from_slice(bytes);
        Some(Self { id, fd, length: length as u8, data })
    }

    /// The data.
    pub fn data(&self) -> &[u8] {
        self.data.get(..usize::from(self.length)).unwrap_or(&[])
    }

    /// From a driver's frame; `None` for remote frames, which carry no data. More than 8 bytes make
    /// it a CAN FD frame.
    pub fn from_embedded(frame: &impl embedded_can::Frame) -> Option<Self> {
        if frame.is_remote_frame() {
            return None;
        }
        let id = match frame.id() {
            embedded_can::Id::Standard(id) => CanId::Standard(id.as_raw()),
            embedded_can::Id::Extended(id) => CanId::Extended(id.as_raw()),
        };
        let bytes = frame.data();
        if bytes.len() > 8 { Self::fd(id, bytes) } else { Self::classic(id, bytes) }
    }

    /// As a driver's frame; `None` if that cannot hold the data, as classic ones cannot hold CAN FD's.
    pub fn to_embedded<F: embedded_can::Frame>(&self) -> Option<F> {
        let id: embedded_can::Id = match self.id {
            CanId::Standard(raw) => embedded_can::StandardId::new(raw)?.into(),
            CanId::Extended(raw) => embedded_can::ExtendedId::new(raw)?.into(),
        };
        F::new(id, self.data())
    }
}

impl core::fmt::Debug for CanFrame {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:03X}{}", self.id.raw(), if self.fd { "##" } else { "#" })?;
        self.data().iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for CanFrame {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{:03X}#{=[u8]:02X}", self.id.raw(), self.data());
    }
}

/// The shortest length a CAN FD frame can have for this many bytes.
pub fn fd_length(bytes: usize) -> Option<usize> {
    [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64].into_iter().find(|length| *length >= bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_can::Frame as _;
    use std::format;
    use std::vec::Vec;

    /// A driver's classic frame.
    #[derive(Debug, PartialEq)]
    struct Driver {
        id: embedded_can::Id,
        data: Option<Vec<u8>>,
    }

    impl embedded_can::Frame for Driver {
        fn new(id: impl Into<embedded_can::Id>, data: &[u8]) -> Option<Self> {
            (data.len() <= 8).then(|| Self { id: id.into(), data: Some(data.to_vec()) })
        }
        fn new_remote(id: impl Into<embedded_can::Id>, _: usize) -> Option<Self> {
            Some(Self { id: id.into(), data: None })
        }
        fn is_extended(&self) -> bool {
            matches!(self.id, embedded_can::Id::Extended(_))
        }
        fn is_remote_frame(&self) -> bool {
            self.data.is_none()
        }
        fn id(&self) -> embedded_can::Id {
            self.id
        }
        fn dlc(&self) -> usize {
            self.data().len()
        }
        fn data(&self) -> &[u8] {
            self.data.as_deref().unwrap_or(&[])
        }
    }

    #[test]
    fn a_drivers_frame_goes_both_ways() {
        for id in [CanId::standard(0x701).unwrap(), CanId::extended(0x18DA_F110).unwrap()] {
            let frame = CanFrame::classic(id, &[1, 2, 3]).unwrap();
            let driver: Driver = frame.to_embedded().unwrap();
            assert_eq!(CanFrame::from_embedded(&driver), Some(frame));
        }
        let remote = Driver::new_remote(embedded_can::StandardId::new(1).unwrap(), 8).unwrap();
        assert_eq!(CanFrame::from_embedded(&remote), None);
        let long = CanFrame::fd(CanId::Standard(1), &[0; 20]).unwrap();
        assert_eq!(long.to_embedded::<Driver>(), None);
    }

    #[test]
    fn lengths_are_those_a_frame_can_have() {
        let id = CanId::Standard(5);
        assert_eq!(CanFrame::fd(id, &[7; 9]).unwrap().data(), [7, 7, 7, 7, 7, 7, 7, 7, 7, 0, 0, 0]);
        assert_eq!(CanFrame::fd(id, &[7; 64]).unwrap().data().len(), 64);
        assert!(CanFrame::fd(id, &[7; 65]).is_none() && CanFrame::classic(id, &[0; 9]).is_none());
        assert!(CanId::standard(0x800).is_none() && CanId::extended(1 << 29).is_none());
        assert_eq!(format!("{:?}", CanFrame::classic(id, &[1, 0xAB]).unwrap()), "005#01AB");
    }
}
