//! The decoder's bits and scales are those of the description in `tests/dbc/ars408.dbc`.

use can_dbc::{ByteOrder, Dbc, Message as Described, ValueType};
use viewshed::inputs::ars408::configuration::field as set;
use viewshed::inputs::ars408::filter::field as filter;
use viewshed::inputs::ars408::message::Message;
use viewshed::inputs::ars408::motion;
use viewshed::inputs::ars408::profile::{Ars408Profile, General};
use viewshed::inputs::ars408::quality::{cluster, object};
use viewshed::inputs::ars408::receiver::{cluster_status, object_status};
use viewshed::inputs::ars408::state::{field as state, version};
use viewshed::inputs::signal::Signal;

fn described() -> Vec<Described> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/dbc/ars408.dbc");
    Dbc::try_from(std::fs::read_to_string(path).unwrap().as_str()).unwrap().messages
}

/// Every field the library names, by its message and its name in the description.
fn fields(message: Message) -> Vec<(&'static str, Signal)> {
    match message {
        Message::RadarConfiguration => vec![
            ("MaxDistance_valid", set::MAX_DISTANCE_VALID),
            ("SensorID_valid", set::SENSOR_ID_VALID),
            ("RadarPower_valid", set::POWER_VALID),
            ("OutputType_valid", set::OUTPUT_VALID),
            ("SendQuality_valid", set::QUALITY_VALID),
            ("SendExtInfo_valid", set::EXTENDED_VALID),
            ("SortIndex_valid", set::ORDER_VALID),
            ("StoreInNVM_valid", set::STORE_VALID),
            ("MaxDistance", set::MAX_DISTANCE),
            ("SensorID", set::SENSOR_ID),
            ("OutputType", set::OUTPUT),
            ("RadarPower", set::POWER),
            ("CtrlRelay_valid", set::RELAY_VALID),
            ("CtrlRelay", set::RELAY),
            ("SendQuality", set::QUALITY),
            ("SendExtInfo", set::EXTENDED),
            ("SortIndex", set::ORDER),
            ("StoreInNVM", set::STORE),
            ("RCS_Threshold_valid", set::THRESHOLD_VALID),
            ("RCS_Threshold", set::THRESHOLD),
        ],
        Message::RadarState => vec![
            ("NVMReadStatus", state::STORED_READ),
            ("NVMwriteStatus", state::STORED_WRITTEN),
            ("MaxDistanceCfg", state::MAX_DISTANCE),
            ("Voltage_Error", state::VOLTAGE),
            ("Temporary_Error", state::TEMPORARY),
            ("Temperature_Error", state::TEMPERATURE),
            ("Interference", state::INTERFERENCE),
            ("Persistent_Error", state::PERSISTENT),
            ("RadarPowerCfg", state::POWER),
            ("SensorID", state::SENSOR_ID),
            ("SortIndex", state::ORDER),
            ("CtrlRelayCfg", state::RELAY),
            ("OutputTypeCfg", state::OUTPUT),
            ("SendQualityCfg", state::QUALITY),
            ("SendExtInfoCfg", state::EXTENDED),
            ("MotionRxState", state::MOTION),
            ("RCS_Threshold", state::THRESHOLD),
        ],
        Message::FilterConfiguration => vec![
            ("Valid", filter::VALID),
            ("Active", filter::ACTIVE),
            ("Index", filter::INDEX),
            ("Type", filter::OBJECTS),
            ("Min_Distance", filter::MIN),
            ("Max_Distance", filter::MAX),
            ("Min_X", filter::FRONT_MIN),
            ("Max_X", filter::FRONT_MAX),
        ],
        Message::Speed => vec![("Speed", motion::SPEED), ("SpeedDirection", motion::DIRECTION)],
        Message::YawRate => vec![("YawRate", motion::YAW_RATE)],
        Message::ClusterStatus => vec![
            ("NofClustersNear", cluster_status::NEAR),
            ("NofClustersFar", cluster_status::FAR),
            ("MeasCounter", cluster_status::COUNTER),
            ("InterfaceVersion", cluster_status::VERSION),
        ],
        Message::ObjectStatus => vec![
            ("NofObjects", object_status::NUMBER),
            ("MeasCounter", object_status::COUNTER),
            ("InterfaceVersion", object_status::VERSION),
        ],
        Message::ObjectGeneral => general(&Ars408Profile::ARS408.object),
        Message::ClusterGeneral => general(&Ars408Profile::ARS408.cluster),
        Message::ObjectQuality => vec![
            ("ID", object::NUMBER),
            ("DistLong_rms", object::FRONT_RMS),
            ("DistLat_rms", object::LEFT_RMS),
            ("VrelLong_rms", object::FRONT_SPEED_RMS),
            ("VrelLat_rms", object::LEFT_SPEED_RMS),
            ("ArelLong_rms", object::FRONT_ACCELERATION_RMS),
            ("ArelLat_rms", object::LEFT_ACCELERATION_RMS),
            ("Orientation_rms", object::ORIENTATION_RMS),
            ("MeasState", object::MEASURED),
            ("ProbOfExist", object::EXISTENCE),
        ],
        Message::ClusterQuality => vec![
            ("ID", cluster::NUMBER),
            ("DistLong_rms", cluster::FRONT_RMS),
            ("DistLat_rms", cluster::LEFT_RMS),
            ("VrelLong_rms", cluster::FRONT_SPEED_RMS),
            ("VrelLat_rms", cluster::LEFT_SPEED_RMS),
            ("PdH0", cluster::FALSE_ALARM),
            ("InvalidState", cluster::INVALID),
            ("AmbigState", cluster::AMBIGUITY),
        ],
        Message::Version => vec![
            ("MajorRelease", version::MAJOR),
            ("MinorRelease", version::MINOR),
            ("PatchLevel", version::PATCH),
            ("CountryCode", version::COUNTRY),
            ("ExtendedRange", version::EXTENDED_RANGE),
        ],
        // nothing of it is used
        Message::ObjectExtended => Vec::new(),
    }
}

fn general(general: &General) -> Vec<(&'static str, Signal)> {
    vec![
        ("ID", general.number),
        ("DistLong", general.front_cm.signal),
        ("DistLat", general.left_cm.signal),
        ("VrelLong", general.front_cm_s.signal),
        ("VrelLat", general.left_cm_s.unwrap().signal),
        ("DynProp", general.dynamics),
        ("RCS", general.rcs_half_dbsm.signal),
    ]
}

#[test]
fn every_message_has_the_identifier_and_length_described() {
    let messages = described();
    assert_eq!(messages.len(), Message::ALL.len());
    for message in Message::ALL {
        let found = messages.iter().find(|m| m.name == message.name()).unwrap_or_else(|| panic!("{message:?}"));
        assert_eq!(found.id.raw(), u32::from(message.base()), "{message:?}");
        assert_eq!(found.size, message.length() as u64, "{message:?}");
    }
}

#[test]
fn every_field_has_the_bits_described() {
    for found in described() {
        let message = Message::ALL.into_iter().find(|m| m.name() == found.name).unwrap();
        let named = fields(message);
        for (name, signal) in &named {
            let s = found.signals.iter().find(|s| s.name == *name).unwrap_or_else(|| panic!("{message:?} {name}"));
            assert_eq!((s.start_bit, s.size), (signal.start().into(), signal.length().into()), "{message:?} {name}");
            assert_eq!((s.byte_order, s.value_type), (ByteOrder::BigEndian, ValueType::Unsigned));
        }
        // multiplexed limits share their places
        if !matches!(message, Message::ObjectExtended | Message::FilterConfiguration) {
            assert_eq!(named.len(), found.signals.len(), "{message:?}");
        }
    }
}

#[test]
fn every_quantity_has_the_scale_described() {
    for (profile, name) in
        [(&Ars408Profile::ARS408.cluster, "Cluster_1_General"), (&Ars408Profile::ARS408.object, "Obj_1_General")]
    {
        let message = described().into_iter().find(|m| m.name == name).unwrap();
        let quantities = [
            ("DistLong", profile.front_cm, 100.0),
            ("DistLat", profile.left_cm, 100.0),
            ("VrelLong", profile.front_cm_s, 100.0),
            ("VrelLat", profile.left_cm_s.unwrap(), 100.0),
            ("RCS", profile.rcs_half_dbsm, 2.0),
        ];
        for (name, quantity, per_unit) in quantities {
            let s = message.signals.iter().find(|s| s.name == name).unwrap();
            assert!((s.factor * per_unit - f64::from(quantity.lsb)).abs() < 1e-9, "{name}");
            assert!((s.offset * per_unit - f64::from(quantity.offset)).abs() < 1e-9, "{name}");
        }
    }
}
