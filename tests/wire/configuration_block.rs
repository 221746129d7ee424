//! The configuration block as the specification describes it, byte by byte, is the one the code reads and checks.

use super::specification::{PAGE, fenced};
use crc::{CRC_32_ISO_HDLC, Crc};
use viewshed::radar_3d::Radar3dParameters;
use viewshed::sensor::Sensor;
use viewshed::sensor::config::{ConfigError, Problem};
use viewshed::sensor::field_of_view::FieldOfView;
use viewshed::sensor::mount::Mount;
use viewshed::sensor::noise::NoiseConfig;
use viewshed::sensor::site::{LaneList, Points};
use viewshed::unit::settings::{BLOCK_LEN, BlockError, MOST_BLOCK_LEN, Settings, heights_block, lanes_block};

const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

fn settings() -> Settings {
    Settings::of(Sensor {
        mount: Mount { x_m: 1.0, y_m: -2.0, height_m: 6.0, yaw_deg: 3.0, pitch_deg: 4.0, roll_deg: -5.0 },
        field_of_view: FieldOfView {
            azimuth_min_deg: -60.0,
            azimuth_max_deg: 50.0,
            elevation_min_deg: -16.0,
            elevation_max_deg: 12.0,
            range_min_m: 3.0,
            range_max_m: 200.0,
        },
        noise: NoiseConfig::default(),
    })
}

/// A block that holds, with some bytes in another way.
fn changed(at: usize, bytes: &[u8]) -> [u8; BLOCK_LEN] {
    let mut block = settings().to_block(7);
    block[at..at + bytes.len()].copy_from_slice(bytes);
    let sum = CRC.checksum(&block[..156]);
    block[156..].copy_from_slice(&sum.to_le_bytes());
    block
}

fn check(settings: &Settings) -> Result<(), ConfigError> {
    Radar3dParameters::<50, 40, 8>::new(&settings.sensor, &settings.radar_3d())?;
    settings.radar_bus.check("radar_bus")?;
    settings.broadcast_bus.check("broadcast_bus")?;
    settings.unit.check()
}

struct Row {
    at: usize,
    name: &'static str,
    least: f32,
    most: f32,
}

fn rows() -> Vec<Row> {
    let row = |line: &'static str| {
        let [at, name, _, least, most] = line.split(' ').collect::<Vec<_>>()[..] else { panic!("{line}") };
        Row { at: at.parse().unwrap(), name, least: least.parse().unwrap(), most: most.parse().unwrap() }
    };
    fenced("block").into_iter().map(row).collect()
}

/// A row's bytes with a value.
fn bytes(row: &Row, value: f32) -> Vec<u8> {
    match row.name.split_once('.').unwrap().1 {
        "bit_rate" => (value as u32).to_le_bytes().to_vec(),
        "serial_baud" => (value as u32).to_le_bytes().to_vec(),
        "sample_point_permille" | "listen_first" | "max_delay_ms" => (value as u16).to_le_bytes().to_vec(),
        "sensor" | "radar_id" | "configure_radar" | "supervise" => vec![value as u8],
        _ => value.to_le_bytes().to_vec(),
    }
}

#[test]
fn every_parameter_lies_where_the_page_says_and_has_its_limits() {
    assert_eq!(check(&settings()), Ok(()));
    let rows = rows();
    let mut next = 12;
    for row in &rows {
        assert_eq!(row.at, next, "{}", row.name);
        next += bytes(row, 0.0).len();
        let read = |value| Settings::from_block(&changed(row.at, &bytes(row, value))).unwrap().1;
        if row.name.ends_with("listen_first") {
            let bus = |settings: Settings| if row.at < 136 { settings.radar_bus } else { settings.broadcast_bus };
            assert_eq!((bus(read(0.0)).listen_first, bus(read(1.0)).listen_first), (false, true));
            continue;
        }
        // numbers without a sign that begin at 0 have an upper limit only
        let outside = if row.name.starts_with("unit.") && row.least == 0.0 { row.most + 1.0 } else { -1e9 };
        let refused = match Settings::from_block(&changed(row.at, &bytes(row, outside))) {
            Ok((_, settings)) => check(&settings).unwrap_err(),
            Err(BlockError::Parameter(error)) => error,
            Err(error) => panic!("{error}"),
        };
        assert_eq!(refused.parameter, row.name);
        assert_eq!(refused.problem, Problem::OutOfLimits { min: row.least, max: row.most }, "{}", row.name);
    }
    assert_eq!((next, rows.len(), BLOCK_LEN), (154, 29 + 6 + 6, 160));
}

#[test]
fn where_the_far_road_lies_is_in_two_bytes_and_has_the_limits_of_the_field_of_view() {
    let read = |bytes: [u8; 2]| Settings::from_block(&changed(154, &bytes)).map(|(_, settings)| settings);
    let far_road = |bytes| read(bytes).unwrap().visibility.far_road_deg;
    assert_eq!((far_road([0, 0]), far_road([1, 0]), far_road([1, 0xF4])), (None, Some(0), Some(-12)));
    assert_eq!(settings().to_block(7)[154..156], [0, 0]);
    let mut said = settings();
    said.visibility.far_road_deg = Some(-12);
    assert_eq!(said.to_block(7)[154..156], [1, 0xF4]);
    // the view reaches from -60 to 50 degrees
    assert_eq!((check(&read([1, 196]).unwrap()), check(&read([1, 50]).unwrap())), (Ok(()), Ok(())));
    let outside = check(&read([1, 51]).unwrap()).unwrap_err();
    assert_eq!(outside.parameter, "visibility.far_road_deg");
    assert_eq!(outside.problem, Problem::OutOfLimits { min: -60.0, max: 50.0 });
    let Err(BlockError::Parameter(neither)) = read([4, 0]) else { panic!("a flag that nothing knows") };
    assert_eq!((neither.parameter, neither.value), ("unit.flags", 4.0));
    // and the fingerprint goes on with it, as on the page
    let mut with = [0; 12];
    with[..4].copy_from_slice(&settings().fingerprint().to_le_bytes());
    with[4..8].copy_from_slice(&(1_u32 << 20).to_le_bytes());
    with[8..].copy_from_slice(&(-12_i32).to_le_bytes());
    assert_eq!(said.fingerprint(), CRC.checksum(&with));
}

#[test]
fn whether_lanes_are_learnt_is_a_flag_beside_the_far_road() {
    let read = |flags: u8| Settings::from_block(&changed(154, &[flags, 7])).unwrap().1;
    let told = |flags| (read(flags).unit.learn_lanes, read(flags).visibility.far_road_deg);
    assert_eq!([1, 2, 3].map(told), [(false, Some(7)), (true, None), (true, Some(7))]);
    let mut learns = settings();
    learns.unit.learn_lanes = true;
    assert_eq!((learns.to_block(7)[154..156].to_vec(), check(&learns)), (vec![2, 0], Ok(())));
    assert_eq!((settings().radar_3d().obstacles.lane_vehicles, learns.radar_3d().obstacles.lane_vehicles), (0.0, 3.0));
    // and the fingerprint goes on with it, as on the page
    let mut with = [0; 12];
    with[..4].copy_from_slice(&settings().fingerprint().to_le_bytes());
    with[4..8].copy_from_slice(&(1_u32 << 21).to_le_bytes());
    assert_eq!(learns.fingerprint(), CRC.checksum(&with));
}

#[test]
fn the_rest_of_the_block_is_as_on_the_page() {
    let block = settings().to_block(0x0102_0304);
    assert_eq!(block[..12], [0x56, 0x53, 0x43, 0x42, 2, 0, 160, 0, 4, 3, 2, 1]);
    assert_eq!(block[156..], CRC.checksum(&block[..156]).to_le_bytes());
    assert_eq!(CRC.algorithm.poly, 0x04C1_1DB7);
    // layout 1, made from the page: without the unit's own figures
    let mut old = settings().to_block(0)[..148].to_vec();
    (old[4], old[6]) = (1, 148);
    let sum = CRC.checksum(&old[..144]);
    old[144..].copy_from_slice(&sum.to_le_bytes());
    assert_eq!(Settings::from_block(&old), Ok((0, settings())));
    assert_eq!(settings().fingerprint(), sum);
    assert!(PAGE.contains("the check sum of the block in layout 1 with sequence 0"));
    // no row is left for the order of the limits, which has its own reason
    let reversed = changed(36, &60.0_f32.to_le_bytes());
    let refused = check(&Settings::from_block(&reversed).unwrap().1).unwrap_err();
    assert_eq!(
        (refused.parameter, refused.problem),
        ("field_of_view.azimuth_max_deg", Problem::NotAscending { lower: 60.0 })
    );
}

/// Blocks of a place as on the page: heights and a lane that bends, and the fingerprint with both.
#[test]
fn blocks_of_a_place_are_these_bytes_and_the_fingerprint_goes_on_with_them() {
    const HEIGHTS: [[f32; 2]; 3] = [[-200.0, 100.0], [0.0, 103.5], [150.0, 101.25]];
    const LANE: &[[f32; 2]] = &[[-50.0, -1.75], [20.05, -1.75], [30.0, 8.2]];
    let hex = |bytes: &[u8]| bytes.iter().map(|b| format!("{b:02X}")).collect::<String>();
    let mut here = String::new();
    let mut block = [0; MOST_BLOCK_LEN];
    let length = heights_block(Points::Metres(&HEIGHTS), &mut block).unwrap();
    here += &(hex(&block[..length]) + "\n");
    // from the page: 12 + 2 + 2 + 3 x 8 + 4 bytes
    assert_eq!((length, &block[6..8], &block[12..20]), (44, &[44, 0][..], &[3, 0, 0, 0, 0, 0, 0x48, 0xC3][..]));
    assert_eq!(block[40..44], CRC.checksum(&block[..40]).to_le_bytes());
    let length = lanes_block(LaneList::Metres(&[LANE]), &mut block).unwrap();
    here += &(hex(&block[..length]) + "\n");
    // 12 + 2 + 2 + 1 + 6 + 2 x 4, filled up to 32, + 4 bytes
    assert_eq!((length, &block[12..17], &block[31..32]), (36, &[1, 0, 15, 0, 3][..], &[0][..]));
    assert_eq!(
        block[17..27],
        [0x78, 0xEC, 0xFF, 0x51, 0xFF, 0xFF, 0x5D, 0x1B, 0, 0],
        "-5000, -175; 7005 on, 0 to the left"
    );

    let settings = Settings { lanes: &[LANE], ground: &HEIGHTS, ..settings() };
    let goes_on =
        |sum: u32, a: u32, b: u32| CRC.checksum(&[sum.to_le_bytes(), a.to_le_bytes(), b.to_le_bytes()].concat());
    let points =
        |sum, points: &[[f32; 2]]| points.iter().fold(sum, |sum, [x, y]| goes_on(sum, x.to_bits(), y.to_bits()));
    let plain = Settings { lanes: &[], ground: &[], ..settings }.fingerprint();
    let with_lane = points(goes_on(plain, 1, 0), LANE);
    let expected = points(goes_on(with_lane, 1 << 19, 0), &HEIGHTS);
    assert_eq!(settings.fingerprint(), expected);
    here += &format!("{plain:08X} {expected:08X}\n");
    assert_eq!(fenced("place"), here.lines().collect::<Vec<_>>(), "the page's example is now:\n{here}");
}
