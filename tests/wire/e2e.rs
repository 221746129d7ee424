//! What the protection's check sums find: every pattern of few errors, and how much of chance passes.
//!
//! The long searches are ignored by default:
//! `cargo test --release --test wire e2e -- --include-ignored`.

use crate::shadows::Random;
use viewshed::wire::e2e::Profile;
use viewshed::wire::message::{Message, NotAMessage, Received};

/// A check sum is linear: whether an error passes does not depend on the message, only the syndrome of
/// each flipped bit counts.
fn syndromes(profile: Profile, bytes: usize) -> Vec<u16> {
    let sum = |message: &[u8]| match profile {
        Profile::P11 => u16::from(message[0]),
        Profile::P05 => u16::from_le_bytes([message[0], message[1]]),
    };
    // the sum of a message that is otherwise empty
    let computed = |mut message: Vec<u8>| {
        let counter = match profile {
            Profile::P11 => message[1] & 0x0F,
            Profile::P05 => message[2],
        };
        profile.protect(&mut message, 0x1234, counter);
        sum(&message)
    };
    let empty = computed(vec![0; bytes]);
    (0..8 * bytes)
        .map(|bit| {
            let mut flipped = vec![0; bytes];
            // in the order bits are sent: the highest of a byte first
            flipped[bit / 8] = 0x80 >> (bit % 8);
            let in_sum = sum(&flipped);
            computed(flipped) ^ empty ^ in_sum
        })
        .collect()
}

/// Profile 11 knows no counter of 15, so some patterns are found by that; here only the sum counts.
#[test]
fn profile_11_passes_198_of_the_patterns_of_three_bits_and_none_of_fewer() {
    let s = syndromes(Profile::P11, 8);
    assert!(s.iter().all(|a| *a != 0), "one bit");
    let (mut patterns, mut passed) = (0, 0);
    for a in 0..64 {
        for b in 0..a {
            assert_ne!(s[a], s[b], "two bits");
            for c in 0..b {
                patterns += 1;
                passed += u32::from(s[a] ^ s[b] ^ s[c] == 0);
            }
        }
    }
    assert_eq!((passed, patterns), (198, 41_664));
}

#[test]
fn profile_11_finds_all_bursts_up_to_7_bits() {
    bursts(Profile::P11, 8, 7);
}

#[test]
fn profile_05_finds_all_bursts_up_to_13_bits() {
    bursts(Profile::P05, 64, 13);
}

/// All patterns within so many bits, at every place.
fn bursts(profile: Profile, bytes: usize, most: usize) {
    let s = syndromes(profile, bytes);
    for window in s.windows(most) {
        for pattern in 1..1_u32 << most {
            let sum = window.iter().enumerate().filter(|(i, _)| pattern >> i & 1 == 1).fold(0, |x, (_, s)| x ^ s);
            assert_ne!(sum, 0);
        }
    }
}

#[test]
fn profile_05_finds_all_errors_of_up_to_three_bits_in_64_bytes() {
    let s = syndromes(Profile::P05, 64);
    let mut single = vec![false; 1 << 16];
    for a in &s {
        assert!(*a != 0 && !single[usize::from(*a)], "one bit, two bits");
        single[usize::from(*a)] = true;
    }
    for a in 0..s.len() {
        for b in 0..a {
            // three: a third bit with the sum of two
            assert!(!single[usize::from(s[a] ^ s[b])]);
        }
    }
}

#[test]
fn the_syndromes_say_what_the_check_says() {
    let mut random = Random::new(7);
    for (profile, bytes) in [(Profile::P11, 8), (Profile::P05, 64)] {
        let s = syndromes(profile, bytes);
        for _ in 0..3000 {
            let mut message: Vec<u8> = (0..bytes).map(|_| random.next() as u8).collect();
            profile.protect(&mut message, 0x8042, (random.next() % 15) as u8);
            let flips = 1 + random.below(4);
            let mut sum = 0;
            for _ in 0..flips {
                let bit = random.below(8 * bytes as u64) as usize;
                message[bit / 8] ^= 0x80 >> (bit % 8);
                sum ^= s[bit];
            }
            let counter_15 = profile == Profile::P11 && message[1] & 15 == 15;
            assert_eq!(profile.check(&message, 0x8042).is_ok(), sum == 0 && !counter_15);
        }
    }
}

/// Accepted of so many messages of random content, by the sum alone.
fn accepted(profile: Profile, bytes: usize, messages: u64) -> u64 {
    let mut random = Random::new(1);
    let mut message = vec![0; bytes];
    let mut accepted = 0;
    for _ in 0..messages {
        for chunk in message.chunks_mut(4) {
            chunk.copy_from_slice(&random.next().to_le_bytes()[..chunk.len()]);
        }
        // profile 11 knows no counter of 15; by the sum alone it would be as good as any
        if profile == Profile::P11 && message[1] & 15 == 15 {
            message[1] ^= 1;
        }
        let (counter, bytes) = if profile == Profile::P11 { (message[1] & 15, 1) } else { (message[2], 2) };
        let mut right = message.clone();
        profile.protect(&mut right, 0x8042, counter);
        accepted += u64::from(message[..bytes] == right[..bytes]);
    }
    accepted
}

#[test]
fn of_random_content_profile_11_accepts_one_in_256() {
    // 2^-8, and three standard deviations of 10^5 trials
    let n = accepted(Profile::P11, 8, 100_000);
    assert!((331..=450).contains(&n), "{n}");
}

#[test]
#[ignore = "ten million messages; a hundredth of them always runs"]
fn of_ten_million_messages_profile_11_accepts_at_most_39_660_and_profile_05_190() {
    let (p11, p05) = (accepted(Profile::P11, 8, 10_000_000), accepted(Profile::P05, 64, 10_000_000));
    println!("accepted of 10^7 random messages: profile 11 {p11}, profile 05 {p05}");
    assert!(p11 <= 39_660 && p05 <= 190, "{p11}, {p05}");
}

#[test]
fn another_implementation_of_the_standard_takes_our_messages_and_we_take_its() {
    use autosar_e2e::profile5::{Profile5, Profile5Config};
    use autosar_e2e::profile11::{Profile11, Profile11Config, Profile11IdMode};
    use autosar_e2e::{E2EProfile, E2EStatus};
    let mut random = Random::new(3);
    for _ in 0..100 {
        let data_id = 0x8000 | random.next() as u16;
        let mut message: Vec<u8> = (0..8).map(|_| random.next() as u8).collect();
        let config = Profile11Config { mode: Profile11IdMode::Both, data_id, data_length: 64, ..Default::default() };
        Profile::P11.protect(&mut message, data_id, 0);
        assert_eq!(Profile11::new(config.clone()).unwrap().check(&message).unwrap(), E2EStatus::Ok);
        Profile11::new(config).unwrap().protect(&mut message).unwrap();
        assert_eq!(Profile::P11.check(&message, data_id), Ok(0));

        let mut message: Vec<u8> = (0..64).map(|_| random.next() as u8).collect();
        let config = Profile5Config { data_length: 512, data_id, ..Default::default() };
        Profile::P05.protect(&mut message, data_id, 0);
        assert_eq!(Profile5::new(config.clone()).unwrap().check(&message).unwrap(), E2EStatus::Ok);
        Profile5::new(config).unwrap().protect(&mut message).unwrap();
        assert_eq!(Profile::P05.check(&message, data_id), Ok(0));
    }
}

#[test]
fn an_intact_message_of_more_than_64_bytes_is_none() {
    for length in [6, 64, 65, 240] {
        let mut bytes = vec![0; length];
        (bytes[3], bytes[5]) = (1, 5);
        Profile::P05.protect(&mut bytes, 0x8001, 3);
        let received = Received::from_bytes(&bytes).map(|received| received.message);
        let expected = if length > 64 { Err(NotAMessage::TooLong { length }) } else { Ok(Message::Header) };
        assert_eq!(received, expected);
    }
}
