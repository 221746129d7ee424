//! Pictures of a camera beside the radar, as they lie in the recording.

use std::path::Path;

use serde::Deserialize;

use crate::recording::file;
use crate::recording::ros::{self, Header};

/// Schema of the messages that hold pictures.
const COMPRESSED: &str = "sensor_msgs/msg/CompressedImage";

#[derive(Deserialize)]
#[cfg_attr(test, derive(serde::Serialize))]
struct CompressedImage {
    header: Header,
    #[allow(dead_code, reason = "it stands between the others")]
    format: String,
    data: Vec<u8>,
}

/// Time, kind and bytes of a picture.
type Image = (i64, &'static str, Vec<u8>);

/// Pictures in the order of time.
pub struct Images(Vec<Image>);

/// Farthest from a radar frame a picture may be taken for it, nanoseconds.
const NEAR_NS: i64 = 500_000_000;

impl Images {
    /// Those of a recording; none of one that has no camera, or is no MCAP.
    pub fn of(path: &Path) -> Self {
        Self(file::bytes(path).map(|bytes| sorted(read(&bytes))).unwrap_or_default())
    }

    /// No pictures at all.
    pub fn none() -> Self {
        Self(Vec::new())
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The last picture that is not later than a time, with its kind.
    pub fn at(&self, time_ns: i64) -> Option<(&'static str, Vec<u8>)> {
        let next = self.0.partition_point(|(time, ..)| *time <= time_ns);
        let (time, kind, bytes) = self.0.get(next.checked_sub(1)?)?;
        (time_ns - *time <= NEAR_NS).then(|| (*kind, bytes.clone()))
    }
}

fn sorted(mut images: Vec<Image>) -> Vec<Image> {
    images.sort_by_key(|(time_ns, ..)| *time_ns);
    images
}

fn read(bytes: &[u8]) -> Vec<Image> {
    let Ok(messages) = mcap::MessageStream::new_with_options(bytes, mcap::read::Options::IgnoreEndMagic.into()) else {
        return Vec::new();
    };
    let pictures = messages.map_while(Result::ok);
    let pictures = pictures.filter(|m| m.channel.schema.as_ref().is_some_and(|schema| schema.name == COMPRESSED));
    pictures.filter_map(|m| picture(&m.data)).collect()
}

/// A message's picture, if browsers know its kind.
fn picture(data: &[u8]) -> Option<Image> {
    let image: CompressedImage = ros::decode(data).ok()?;
    let kind = match image.data.get(..4)? {
        [0xFF, 0xD8, 0xFF, _] => "image/jpeg",
        [0x89, b'P', b'N', b'G'] => "image/png",
        _ => return None,
    };
    Some((image.header.stamp.nanoseconds(), kind, image.data))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::io::{Cursor, Write};

    use flate2::Compression;
    use flate2::write::GzEncoder;

    use super::*;
    use crate::recording::ros::Stamp;

    const JPEG: [u8; 6] = [0xFF, 0xD8, 0xFF, 0xE0, 1, 2];

    #[test]
    fn the_last_picture_before_a_frame_is_its_own() {
        let mut writer = ::mcap::Writer::new(Cursor::new(Vec::new())).unwrap();
        let schema = writer.add_schema(COMPRESSED, "ros2msg", b"").unwrap();
        let channel = writer.add_channel(schema, "/camera/image/compressed", "cdr", &BTreeMap::new()).unwrap();
        for (sequence, (time_ns, data)) in
            [(2_000_000_000, &JPEG[..]), (1_000_000_000, &JPEG[..5]), (3_000_000_000, b"text")].into_iter().enumerate()
        {
            let header = Header { stamp: Stamp::from_nanoseconds(time_ns), frame_id: "camera".into() };
            let image = CompressedImage { header, format: "jpeg".into(), data: data.to_vec() };
            let header = ::mcap::records::MessageHeader {
                channel_id: channel,
                sequence: sequence as u32,
                log_time: time_ns as u64,
                publish_time: time_ns as u64,
            };
            writer.write_to_known_channel(&header, &ros::encode(&image).unwrap()).unwrap();
        }
        writer.finish().unwrap();
        // a packed recording has its pictures, too
        let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
        packed.write_all(&writer.into_inner().into_inner()).unwrap();
        let path = std::env::temp_dir().join(format!("viewshed-pictures-{}.mcap.gz", std::process::id()));
        std::fs::write(&path, packed.finish().unwrap()).unwrap();
        let images = Images::of(&path);
        std::fs::remove_file(path).unwrap();
        let at = |time_s: f64| images.at((time_s * 1e9) as i64).map(|(kind, bytes)| (kind, bytes.len()));
        assert_eq!(
            (at(1.1), at(2.0), at(2.4)),
            (Some(("image/jpeg", 5)), Some(("image/jpeg", 6)), Some(("image/jpeg", 6)))
        );
        assert_eq!((at(0.9), at(1.6), at(9.0)), (None, None, None), "no picture is near, or none a browser knows");
    }
}
