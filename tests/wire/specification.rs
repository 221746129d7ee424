//! The specification's tables are the code's, and its example with a key is what the code sends.

use viewshed::wire::code::model::MODEL;
use viewshed::wire::message::Epoch;
#[cfg(feature = "secoc")]
use viewshed::wire::message::{Addresses, Received};

pub const PAGE: &str = include_str!("../../src/wire/SPECIFICATION.md");
pub const EPOCH: Epoch = Epoch::new(5);

/// The lines of a fenced block.
pub fn fenced(kind: &str) -> Vec<&'static str> {
    let begin = format!("```{kind}\n");
    let from = PAGE.find(&begin).unwrap_or_else(|| panic!("no {kind}")) + begin.len();
    PAGE[from..].lines().take_while(|line| !line.starts_with("```")).collect()
}

#[test]
fn the_tables_of_the_page_are_the_codes() {
    let mut all: Vec<Vec<u8>> = Vec::new();
    for line in fenced("tables").into_iter().filter(|line| line.starts_with("  ")) {
        let numbers = line.split('#').next().unwrap_or("").split(',').map(|n| n.trim().parse().unwrap());
        all.push(numbers.collect());
    }
    let mut expected: Vec<Vec<u8>> = Vec::new();
    expected.extend(MODEL.ray.as_flattened().iter().map(|t| t.to_vec()));
    expected.extend(MODEL.first.iter().map(|t| t.to_vec()));
    expected.extend(MODEL.edge.as_flattened().as_flattened().iter().map(|t| t.to_vec()));
    expected.extend(MODEL.end.as_flattened().as_flattened().iter().map(|t| t.to_vec()));
    expected.extend(MODEL.distance.iter().map(|t| t.to_vec()));
    expected.push(MODEL.limit.to_vec());
    expected.extend(MODEL.stop.iter().map(|t| t.to_vec()));
    assert_eq!(all, expected);
}

/// What a sender with a key says first, on CAN FD.
#[cfg(feature = "secoc")]
fn secured() -> Vec<viewshed::wire::frame::CanFrame> {
    use viewshed::fixed::time::Time;
    use viewshed::wire::broadcast::{BroadcastConfig, Broadcaster, Medium};
    let start = Time::from_micros(1000 * 0x0102_0304);
    let medium = Medium::CanFd(Addresses::STANDARD);
    let config = BroadcastConfig { secured: true, ..BroadcastConfig::new(0, medium) };
    let mut sender = Broadcaster::<4, 1>::new(config, super::worked_example::header(), EPOCH, start).unwrap();
    let mut sealer = viewshed::wire::secoc::Sealer::new(KEY, 0x0000_0102_0304_0507);
    let mut next = |ms: u64| sender.next_sealed(Time::from_micros(start.micros() + 1000 * ms), &mut sealer).unwrap();
    [next(0), next(1)].iter().map(|p| p.frame(&Addresses::STANDARD).unwrap()).collect()
}

#[cfg(feature = "secoc")]
const KEY: [u8; 16] = [0x2B, 0x7E, 0x15, 0x16, 0x28, 0xAE, 0xD2, 0xA6, 0xAB, 0xF7, 0x15, 0x88, 0x09, 0xCF, 0x4F, 0x3C];

#[cfg(feature = "secoc")]
#[test]
fn the_authenticated_example_is_what_is_sent_and_opens() {
    let page: Vec<String> =
        fenced("secured").iter().map(|line| line.split_whitespace().next().unwrap().to_owned()).collect();
    let frames = secured();
    let sent: Vec<String> = frames.iter().map(|frame| format!("{frame:?}")).collect();
    assert_eq!(page, sent, "\n{}", sent.join("\n"));
    let key: String = KEY.iter().map(|byte| format!("{byte:02X}")).collect();
    assert!(PAGE.contains(&key));
    let mut opener = viewshed::wire::secoc::Opener::new(KEY);
    for (frame, freshness) in frames.iter().zip([0x0000_0102_0304_0508, 0x0000_0102_0304_0509]) {
        let received = Received::from_frame(frame, &Addresses::STANDARD).unwrap();
        assert!(opener.open(&received).is_ok());
        assert_eq!(opener.freshness(), Some(freshness));
    }
}
