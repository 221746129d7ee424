//! The slots of stored blocks in a flash memory.
//!
//! All are read at the start; what the rest of the library sees is that copy. A write erases the slot
//! it goes to and no other, so that a loss of power leaves the other one of its kind.
//!
//! # Limits
//! A slot begins where a page begins and takes as many pages as a block needs, which is one on every
//! part so far. Some parts raise an exception at a read where power failed while writing, as the check
//! bits do not hold: their boards remember which slots they were reading then, and do not read them again
//! ([`FaultySlots`](crate::unit::roadside::FaultySlots)).

use embedded_storage::nor_flash::NorFlash;

use super::kind::word;
use super::{ALL_SLOTS_LEN, BlockKind, MOST_BLOCK_LEN, SettingsSlots, in_copy};

/// The longest block up to the next whole word.
const MOST_STORED_LEN: usize = word(MOST_BLOCK_LEN);

/// Slots at so many places of a memory, two for each kind of block, settings first.
#[derive(Debug)]
pub struct FlashSlots<F, const N: usize> {
    flash: F,
    places: [u32; N],
    copies: [u8; ALL_SLOTS_LEN],
}

impl<F: NorFlash, const N: usize> FlashSlots<F, N> {
    /// Reads all slots, if the board lets it read them; one that cannot be read holds nothing.
    pub fn new(flash: F, places: [u32; N], mut readable: impl FnMut(usize) -> bool) -> Self {
        let mut slots = Self { flash, places, copies: [0; ALL_SLOTS_LEN] };
        for slot in 0..N {
            if readable(slot) {
                slots.read(slot);
            }
        }
        slots
    }

    /// Gives the memory back.
    pub fn free(self) -> F {
        self.flash
    }

    fn read(&mut self, slot: usize) {
        let Some((place, copy)) = self.places.get(slot).zip(self.copies.get_mut(in_copy(slot))) else { return };
        if self.flash.read(*place, copy).is_err() {
            copy.fill(0);
        }
    }
}

impl<F: NorFlash, const N: usize> SettingsSlots for FlashSlots<F, N> {
    fn slot(&self, slot: usize) -> &[u8] {
        let length = BlockKind::of_slot(slot).map_or(0, BlockKind::most_len);
        let copy = self.copies.get(in_copy(slot)).filter(|_| slot < N);
        copy.and_then(|copy| copy.get(..length)).unwrap_or(&[])
    }

    fn write(&mut self, slot: usize, block: &[u8]) {
        let Some(place) = self.places.get(slot).copied() else { return };
        let mut stored = [0xFF; MOST_STORED_LEN];
        stored.iter_mut().zip(block).for_each(|(to, from)| *to = *from);
        let page = u32::try_from(F::ERASE_SIZE).unwrap_or(u32::MAX);
        let needed = u32::try_from(in_copy(slot).len()).unwrap_or(u32::MAX).next_multiple_of(page.max(1));
        let words = block.len().next_multiple_of(F::WRITE_SIZE.max(1));
        // what failed shows when the slot is read back
        if flash_erase(&mut self.flash, place, needed)
            && let Some(words) = stored.get(..words)
        {
            let _ = self.flash.write(place, words);
        }
        self.read(slot);
    }
}

fn flash_erase<F: NorFlash>(flash: &mut F, place: u32, length: u32) -> bool {
    flash.erase(place, place.saturating_add(length)).is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::unit::settings::{BLOCK_LEN, Settings};
    use embedded_storage::nor_flash::{ErrorType, NorFlashError, NorFlashErrorKind, ReadNorFlash};
    use std::vec;
    use std::vec::Vec;

    /// A memory that refuses what real ones refuse, and may lose power after so many words.
    struct Memory<const WORD: usize, const PAGE: usize> {
        bytes: Vec<u8>,
        words_left: usize,
    }

    #[derive(Debug)]
    struct Refused;

    impl NorFlashError for Refused {
        fn kind(&self) -> NorFlashErrorKind {
            NorFlashErrorKind::Other
        }
    }

    impl<const WORD: usize, const PAGE: usize> ErrorType for Memory<WORD, PAGE> {
        type Error = Refused;
    }

    impl<const WORD: usize, const PAGE: usize> ReadNorFlash for Memory<WORD, PAGE> {
        const READ_SIZE: usize = 1;

        fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Refused> {
            let from = offset as usize;
            bytes.copy_from_slice(self.bytes.get(from..from + bytes.len()).ok_or(Refused)?);
            Ok(())
        }

        fn capacity(&self) -> usize {
            self.bytes.len()
        }
    }

    impl<const WORD: usize, const PAGE: usize> NorFlash for Memory<WORD, PAGE> {
        const WRITE_SIZE: usize = WORD;
        const ERASE_SIZE: usize = PAGE;

        fn erase(&mut self, from: u32, to: u32) -> Result<(), Refused> {
            let (from, to) = (from as usize, to as usize);
            assert!(from % PAGE == 0 && to % PAGE == 0, "{from} {to}");
            self.bytes[from..to].fill(0xFF);
            Ok(())
        }

        fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Refused> {
            let offset = offset as usize;
            assert!(offset.is_multiple_of(WORD) && bytes.len().is_multiple_of(WORD));
            for (k, word) in bytes.chunks(WORD).enumerate() {
                self.words_left = self.words_left.checked_sub(1).ok_or(Refused)?;
                let place = &mut self.bytes[offset + k * WORD..][..WORD];
                assert!(place.iter().all(|b| *b == 0xFF), "written twice without erasing");
                place.copy_from_slice(word);
            }
            Ok(())
        }
    }

    fn settings(max_detections: u16) -> Settings {
        let sensor = crate::sensor::Sensor {
            mount: crate::sensor::mount::Mount {
                x_m: 0.0,
                y_m: 0.0,
                height_m: 6.0,
                yaw_deg: 0.0,
                pitch_deg: 4.0,
                roll_deg: 0.0,
            },
            field_of_view: crate::sensor::field_of_view::tests::VIEW,
            noise: crate::sensor::noise::NoiseConfig::default(),
        };
        let mut settings = Settings::of(sensor);
        settings.gate.max_detections = max_detections;
        settings
    }

    fn newest(slots: &impl SettingsSlots) -> Option<u16> {
        Settings::newest([slots.slot(0), slots.slot(1)], |_| Ok(())).ok().map(|n| n.settings.gate.max_detections)
    }

    const STORED_LEN: usize = word(BLOCK_LEN);

    fn works_on<const WORD: usize, const PAGE: usize>() {
        let length = STORED_LEN.next_multiple_of(PAGE);
        let memory = Memory::<WORD, PAGE> { bytes: vec![0xFF; 4 * length], words_left: usize::MAX };
        let places = [length as u32, 2 * length as u32];
        let mut slots = FlashSlots::new(memory, places, |_| true);
        assert_eq!(newest(&slots), None, "erased");
        for (number, detections) in [100, 101, 102, 103].into_iter().enumerate() {
            slots.write(number % 2, &settings(detections).to_block(number as u32));
            assert_eq!(newest(&slots), Some(detections));
            slots = FlashSlots::new(slots.free(), places, |_| true);
            assert_eq!(newest(&slots), Some(detections), "after a restart");
        }
        // power fails after two words of the next one
        let mut memory = slots.free();
        assert!(memory.bytes[..length].iter().chain(&memory.bytes[3 * length..]).all(|b| *b == 0xFF), "its pages only");
        memory.words_left = 2;
        let mut slots = FlashSlots::new(memory, places, |_| true);
        slots.write(0, &settings(104).to_block(4));
        assert_eq!(newest(&slots), Some(103));
        assert_eq!(newest(&FlashSlots::new(slots.free(), places, |_| true)), Some(103));
    }

    #[test]
    fn blocks_last_and_a_loss_of_power_leaves_the_other_slot() {
        works_on::<8, 2048>();
        works_on::<32, 131_072>();
        works_on::<4, 128>();
    }

    #[test]
    fn a_slot_that_must_not_be_read_is_empty_and_written_next() {
        let places = [0, 2048];
        let memory = Memory::<8, 2048> { bytes: vec![0xFF; 4096], words_left: usize::MAX };
        let mut slots = FlashSlots::new(memory, places, |_| true);
        slots.write(0, &settings(100).to_block(1));
        slots.write(1, &settings(101).to_block(2));
        let slots = FlashSlots::new(slots.free(), places, |slot| slot != 1);
        assert_eq!(newest(&slots), Some(100));
        assert_eq!(Settings::newest([slots.slot(0), slots.slot(1)], |_| Ok(())).unwrap().next_slot, 1);
    }

    #[test]
    fn a_slot_outside_the_memory_holds_nothing() {
        let memory = Memory::<8, 2048> { bytes: vec![0xFF; 2048], words_left: usize::MAX };
        let slots = FlashSlots::new(memory, [0, 4096], |_| true);
        assert_eq!((slots.slot(1), slots.slot(2)), (&[0; BLOCK_LEN][..], &[][..]));
    }
}
