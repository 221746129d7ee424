//! Frames as the radars would send them.

use viewshed::inputs::ti::TiFamily;

pub const MAGIC: [u8; 8] = [2, 1, 4, 3, 6, 5, 8, 7];

/// A frame to be written.
#[derive(Debug, Clone)]
pub struct Frame {
    pub family: TiFamily,
    /// Version of the SDK, major number on top.
    pub version: u32,
    pub number: u32,
    pub sub_frame: u32,
    pub points: u32,
    pub items: Vec<(u32, Vec<u8>)>,
}

impl Frame {
    pub fn new(family: TiFamily, number: u32) -> Self {
        let version = if family == TiFamily::Bytes36 { 0x0101_0000 } else { 0x0305_0004 };
        Self { family, version, number, sub_frame: 0, points: 0, items: Vec::new() }
    }

    /// Adds an item of so many points.
    pub fn item(mut self, kind: u32, points: usize, payload: Vec<u8>) -> Self {
        self.points += points as u32;
        self.items.push((kind, payload));
        self
    }

    /// Points of SDK 3: x, y, z, velocity.
    pub fn cartesian(self, points: &[[f32; 4]]) -> Self {
        self.item(1, points.len(), floats(points))
    }

    pub fn bytes(&self) -> Vec<u8> {
        let own = if matches!(self.family, TiFamily::Bytes48 | TiFamily::Bytes52) { 8 } else { 0 };
        let items: Vec<u8> = self
            .items
            .iter()
            .flat_map(|(kind, payload)| [words(&[*kind, payload.len() as u32 + own]), payload.clone()].concat())
            .collect();
        let length = self.family.header() as usize + items.len();
        let total = length.next_multiple_of(32);
        let header = match self.family {
            TiFamily::Bytes48 => [
                words(&[self.version, total as u32, 0xA6843, self.number, self.sub_frame, 0, 0, 0, 0]),
                (self.items.len() as u16).to_le_bytes().to_vec(),
                vec![0xAB, 0xCD],
            ]
            .concat(),
            TiFamily::Bytes52 => [
                words(&[self.version, 0xA6843, 0, total as u32, self.number, self.sub_frame, 0, 0, 0, 0]),
                (self.items.len() as u16).to_le_bytes().to_vec(),
                vec![0, 0],
            ]
            .concat(),
            family => {
                let all = [
                    self.version,
                    total as u32,
                    0xA6843,
                    self.number,
                    123_456,
                    self.points,
                    self.items.len() as u32,
                    self.sub_frame,
                    0,
                ];
                words(&all[..(family.header() as usize - 8) / 4])
            }
        };
        [MAGIC.to_vec(), header, items, vec![0; total - length]].concat()
    }
}

pub fn words(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|w| w.to_le_bytes()).collect()
}

pub fn floats<const N: usize>(rows: &[[f32; N]]) -> Vec<u8> {
    rows.iter().flatten().flat_map(|v| v.to_le_bytes()).collect()
}

pub fn shorts(values: &[i16]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}
