//! A part of a picture in the middle of a network's input, scaled alike in both directions.

use image::RgbImage;
use image::imageops::{FilterType, crop_imm, resize};

use crate::tiles::Part;

/// Grey around the picture, the value networks are trained with.
const PADDING: u8 = 114;

/// Where a part of a picture lies in an input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Letterbox {
    part: Part,
    /// Pixels of the input in one of the picture, in both directions: rounding to whole pixels parts them a little.
    scale: [f64; 2],
    /// Of the part's corner in the input.
    offset: [u32; 2],
    inner: [u32; 2],
}

impl Letterbox {
    /// The largest that fits into an input of width and height.
    pub fn new(part: Part, input: [u32; 2]) -> Self {
        let sides = [part[2] - part[0], part[3] - part[1]];
        let scale = (f64::from(input[0]) / f64::from(sides[0])).min(f64::from(input[1]) / f64::from(sides[1]));
        let inner = [0, 1].map(|k| ((f64::from(sides[k]) * scale).round() as u32).clamp(1, input[k]));
        Self {
            part,
            scale: [0, 1].map(|k| f64::from(inner[k]) / f64::from(sides[k])),
            offset: [0, 1].map(|k| (input[k] - inner[k]) / 2),
            inner,
        }
    }

    /// The input: three planes of width x height, red, green and blue from 0 to 255.
    pub fn planes(&self, picture: &RgbImage, input: [u32; 2]) -> Vec<f32> {
        let [l, t, r, b] = self.part;
        let part = crop_imm(picture, l, t, r - l, b - t).to_image();
        // a triangle as wide as a pixel of the input: nothing between two samples is skipped
        let inner = resize(&part, self.inner[0], self.inner[1], FilterType::Triangle);
        let plane = (input[0] * input[1]) as usize;
        let mut planes = vec![f32::from(PADDING); 3 * plane];
        for (x, y, pixel) in inner.enumerate_pixels() {
            let at = ((y + self.offset[1]) * input[0] + x + self.offset[0]) as usize;
            for (channel, value) in pixel.0.into_iter().enumerate() {
                planes[channel * plane + at] = f32::from(value);
            }
        }
        planes
    }

    /// Edges in the input as edges in the picture.
    pub fn edges(&self, edges: [f64; 4]) -> [f64; 4] {
        [0, 1, 2, 3].map(|k| {
            let axis = k % 2;
            (edges[k] - f64::from(self.offset[axis])) / self.scale[axis] + f64::from(self.part[axis])
        })
    }

    /// How many pixels of the picture one of the input is.
    pub fn pixel(&self) -> f64 {
        1.0 / self.scale[0]
    }
}

#[cfg(test)]
mod tests {
    use image::Rgb;

    use super::*;

    #[test]
    fn a_part_is_scaled_alike_and_centred() {
        let b = Letterbox::new([0, 0, 1920, 1080], [512, 512]);
        assert_eq!((b.inner, b.offset), ([512, 288], [0, 112]));
        assert_eq!(b.edges([0.0, 112.0, 512.0, 400.0]), [0.0, 0.0, 1920.0, 1080.0]);
        let upright = Letterbox::new([100, 200, 400, 800], [512, 512]);
        assert_eq!((upright.inner, upright.offset), ([256, 512], [128, 0]));
        assert_eq!(upright.edges([128.0, 0.0, 256.0, 256.0]), [100.0, 200.0, 250.0, 500.0]);
    }

    #[test]
    fn a_mark_is_found_where_it_was() {
        let mut picture = RgbImage::from_pixel(192, 108, Rgb([10, 20, 30]));
        for (x, y) in (100..110).flat_map(|x| (50..60).map(move |y| (x, y))) {
            picture.put_pixel(x, y, Rgb([200, 150, 100]));
        }
        let b = Letterbox::new([20, 10, 180, 100], [64, 64]);
        let planes = b.planes(&picture, [64, 64]);
        let at = |channel: usize, x: usize, y: usize| planes[channel * 4096 + y * 64 + x];
        // 160 x 90 become 64 x 36, from row 14 on; the mark's middle, 85 right of and 45 below the corner, lies at 34, 32
        assert_eq!([0, 1, 2].map(|c| at(c, 34, 32)), [200.0, 150.0, 100.0]);
        assert_eq!([0, 1, 2].map(|c| at(c, 5, 20)), [10.0, 20.0, 30.0]);
        assert_eq!((at(0, 5, 13), at(2, 5, 50)), (114.0, 114.0));
        let [x, y, ..] = b.edges([34.0, 32.0, 34.0, 32.0]);
        assert!((x - 105.0).abs() < 1e-9 && (y - 55.0).abs() < 1e-9, "{x} {y}");
    }
}
