//! Detections or boxes in, messages out.

use core::slice::Chunks;

use super::message::{Header, NativeEntry, NativeMedium, NativeMessage};
use crate::camera::boxes::ImageBox;
use crate::fixed::time::Time;
use crate::frame::detection::Detection;
use crate::wire::e2e::Profile;

/// Numbers the scans and messages of one sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NativeSender {
    sensor: u8,
    scan: u8,
    counter: u8,
}

impl NativeSender {
    /// Before the first scan.
    pub const fn new(sensor: u8) -> Self {
        Self { sensor, scan: 0, counter: 0 }
    }

    /// The messages of a scan. They are numbered as they are taken: all of them are to be sent, in order.
    pub fn scan<'a>(
        &'a mut self,
        time: Time,
        fault: bool,
        detections: &'a [Detection],
        medium: NativeMedium,
    ) -> Parts<'a> {
        self.parts(time, fault, detections, medium)
    }

    /// The same of the boxes of a camera's picture.
    pub fn boxes<'a>(
        &'a mut self,
        time: Time,
        fault: bool,
        boxes: &'a [ImageBox],
        medium: NativeMedium,
    ) -> Parts<'a, ImageBox> {
        self.parts(time, fault, boxes, medium)
    }

    #[allow(clippy::cast_possible_truncation)] // at most 255
    fn parts<'a, T: NativeEntry>(
        &'a mut self,
        time: Time,
        fault: bool,
        detections: &'a [T],
        medium: NativeMedium,
    ) -> Parts<'a, T> {
        let most = medium.detections() * usize::from(u8::MAX);
        let sent = detections.get(..most).unwrap_or(detections);
        let parts = sent.len().div_ceil(medium.detections()).max(1) as u8;
        let header = Header { sensor: self.sensor, fault, scan: self.scan, part: 0, parts, time, medium };
        self.scan = self.scan.wrapping_add(1);
        Parts { counter: &mut self.counter, header, detections: sent.chunks(medium.detections()) }
    }
}

/// The messages of a scan.
#[derive(Debug)]
pub struct Parts<'a, T = Detection> {
    counter: &'a mut u8,
    header: Header,
    detections: Chunks<'a, T>,
}

impl<T: NativeEntry> Iterator for Parts<'_, T> {
    type Item = NativeMessage;

    fn next(&mut self) -> Option<NativeMessage> {
        if self.header.part >= self.header.parts {
            return None;
        }
        let detections = self.detections.next().unwrap_or(&[]);
        let message = NativeMessage::new(&self.header, detections, *self.counter);
        *self.counter = Profile::P05.next(*self.counter);
        self.header.part += 1;
        Some(message)
    }
}
