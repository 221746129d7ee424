//! Batch mode of a camera: the estimator over the boxes of every picture of a job file.
#![no_std]
#![no_main]

use emulated::viewshed::camera::boxes::ImageBox;
use emulated::viewshed::unit::profile::camera;

emulated::batch!([camera], camera::SHAPE, ImageBox, zcu102_r5::Core);

#[unsafe(no_mangle)]
extern "C" fn main() -> ! {
    batch()
}
