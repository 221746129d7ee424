//! The reference grid: 200 ranges x 120 azimuths x 16 slopes, 256 detections a scan.

/// Detections of a scan that are kept.
pub const DETECTIONS: usize = 256;

pub type Parameters = viewshed::radar_3d::Radar3dParameters<200, 120, 16>;
pub type State = viewshed::radar_3d::Radar3d<200, 120, 16, 7, 64, DETECTIONS>;
pub type Map = viewshed::polar::PolarMap<200, 120>;
pub type Sender = viewshed::wire::broadcast::Broadcaster<120, 7>;
pub type Unit<'a> = viewshed::unit::Unit<'a, 200, 120, 16, 7, 64, DETECTIONS>;
