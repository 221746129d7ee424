//! All stages in order: a picture in, boxes of vehicles out.

use anyhow::Result;
use image::RgbImage;
use rayon::prelude::*;
use viewshed_harness::recording::camera::Box2d;

use crate::classes::Classes;
use crate::letterbox::Letterbox;
use crate::network::Network;
use crate::suppression::suppress;
use crate::tiles::{Part, is_cut, tiles};

/// How boxes are found beside the network itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Least score.
    pub score: f64,
    /// Overlap (intersection over union) from which two boxes are of one vehicle.
    pub same: f64,
    /// Rows of tiles; with 2 or more the picture is looked at in tiles beside as a whole.
    pub rows: u32,
    /// Overlap of tiles, share of their side.
    pub overlap: f64,
    /// How far below the box that is found a vehicle ends, share of the box's height.
    pub bottom_offset: f64,
}

/// A network with how its boxes are made use of.
pub struct Detector {
    pub network: Network,
    pub classes: Classes,
    pub settings: Settings,
}

/// Pixels of the input within which a box ends where its tile does.
const AT_BORDER: f64 = 3.0;

/// Least side of a box, pixels.
const SMALLEST_PX: f64 = 4.0;

impl Detector {
    /// The boxes of a picture, the surest first.
    ///
    /// # Errors
    /// The network's own.
    pub fn boxes(&self, picture: &RgbImage) -> Result<Vec<Box2d>> {
        let size = [picture.width(), picture.height()];
        let whole = [0, 0, size[0], size[1]];
        let parts = [vec![whole], tiles(size, self.settings.rows, self.settings.overlap)].concat();
        let found = parts.par_iter().map(|part| self.part(picture, *part)).collect::<Result<Vec<_>>>()?;
        let boxes = suppress(found.concat(), self.settings.same);
        Ok(boxes.into_iter().map(|b| self.at_the_road(b, size)).collect())
    }

    fn part(&self, picture: &RgbImage, part: Part) -> Result<Vec<Box2d>> {
        let size = [picture.width(), picture.height()];
        let letterbox = Letterbox::new(part, self.network.input);
        let planes = letterbox.planes(picture, self.network.input);
        let raw = self.network.boxes(&planes, self.settings.score)?;
        let boxes = raw.into_iter().filter_map(|raw| {
            let class = self.classes.name(raw.class)?.to_owned();
            let edges = letterbox.edges(raw.edges);
            if is_cut(edges, part, size, AT_BORDER * letterbox.pixel()) {
                return None;
            }
            let edges = [0, 1, 2, 3].map(|k| edges[k].clamp(0.0, f64::from(size[k % 2])));
            let large = edges[2] - edges[0] >= SMALLEST_PX && edges[3] - edges[1] >= SMALLEST_PX;
            large.then_some(Box2d { class, score: raw.score, edges })
        });
        Ok(boxes.collect())
    }

    /// Moves the bottom edge to where the wheels stand, as this detector draws it too high; one that lies at the
    /// picture's border stays there.
    fn at_the_road(&self, mut own: Box2d, [_, height]: [u32; 2]) -> Box2d {
        let [_, top, _, bottom] = own.edges;
        own.edges[3] = (bottom + self.settings.bottom_offset * (bottom - top)).min(f64::from(height));
        own
    }
}
