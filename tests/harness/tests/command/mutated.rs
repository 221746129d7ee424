//! Files damaged at random: whatever comes of the front and of each format, it is no panic and does not last.
//!
//! A few hundred of each here; `VIEWSHED_MUTATIONS=100000` tries as many.

use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng, SeedableRng};
use viewshed_harness::doctor::examine_source;
use viewshed_harness::recording::can_log::log::{Lines, find};
use viewshed_harness::recording::file::Source;
use viewshed_harness::recording::problems::Problems;
use viewshed_harness::recording::{ReadOptions, ars408, ti};

const LOG: &str = include_str!("../../../recordings/ars408-made-up.log");

/// One of each kind of file.
fn seeds() -> Vec<Vec<u8>> {
    let lines: Vec<&str> = LOG.lines().take(60).collect();
    let log = lines.join("\n");
    let each = |line: &dyn Fn(&str, &str, &[&str]) -> String| -> String {
        let one = |text: &&str| {
            let (time, rest) = text.split_once(") can0 ").unwrap();
            let (id, data) = rest.split_once('#').unwrap();
            let bytes: Vec<&str> = (0..data.len() / 2).map(|k| &data[2 * k..2 * k + 2]).collect();
            line(&time[1..], id, &bytes)
        };
        lines.iter().map(one).collect::<Vec<_>>().join("\n")
    };
    let screen = each(&|time, id, bytes| format!(" ({time})  can0  {id}   [{}]  {}", bytes.len(), bytes.join(" ")));
    let asc = each(&|time, id, bytes| format!("{time} 1 {id} Rx d {} {}", bytes.len(), bytes.join(" ")));
    let flexible = each(&|time, id, bytes| {
        format!("{time} CANFD 1 Rx {id} 1 0 {:x} {} {} 1 2 3000", bytes.len(), bytes.len(), bytes.join(" "))
    });
    let savvy = each(&|time, id, bytes| {
        format!("{},{id},false,Rx,0,{},{}", time.replace('.', ""), bytes.len(), bytes.join(","))
    });
    let python = each(&|time, id, _| format!("{time},0x{id},0,0,0,8,AFFCIoAgAYA="));
    let serial = each(&|time, _, bytes| format!("({time}) ttyS0 {}", bytes.concat()));
    let ti_frame = |number: u32| {
        let mut bytes = vec![2, 1, 4, 3, 6, 5, 8, 7];
        bytes.extend([0x0305_0004, 96, 0xA6843, number, 0, 2, 1, 0, 1, 32].iter().flat_map(|w: &u32| w.to_le_bytes()));
        bytes.extend((0..8).flat_map(|k: u32| (k as f32 + 1.5).to_le_bytes()));
        bytes.resize(96, 0);
        bytes
    };
    vec![
        log.clone().into_bytes(),
        log.encode_utf16().flat_map(u16::to_le_bytes).collect(),
        screen.into_bytes(),
        format!("date x\nbase hex  timestamps absolute\n{asc}").into_bytes(),
        format!("date x\nbase dec  timestamps relative\n{flexible}").into_bytes(),
        format!("Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n{savvy}").into_bytes(),
        format!("timestamp,arbitration_id,extended,remote,error,dlc,data\n{python}").into_bytes(),
        serial.into_bytes(),
        (1..12).flat_map(ti_frame).collect(),
        b"***BUSMASTER Ver 3.2.2***\n10:13:20:0000 Rx 1 0x201 s 8 40 1F\n".to_vec(),
        b"SQLite format 3\0 CREATE TABLE messages(ts REAL)".to_vec(),
    ]
}

fn mutate(random: &mut Pcg64, bytes: &mut Vec<u8>, other: &[u8]) {
    let mut below = |n: usize| if n == 0 { 0 } else { random.next_u32() as usize % n };
    for _ in 0..=below(4) {
        let (at, n) = (below(bytes.len()), below(40));
        let end = (at + n).min(bytes.len());
        match below(10) {
            0 if !bytes.is_empty() => bytes[at] ^= 1 << below(8),
            1 => drop(bytes.drain(at..end)),
            2 => {
                let part = bytes[at..end].to_vec();
                bytes.splice(at..at, part);
            }
            3 => drop(bytes.splice(at..at, vec![0; n])),
            4 => bytes.truncate(at),
            5 => {
                let from = below(other.len());
                bytes.splice(at..end, other[from..(from + n).min(other.len())].iter().copied());
            }
            6 => {
                let mut lines: Vec<&[u8]> = bytes.split(|b| *b == b'\n').collect();
                let (a, b) = (below(lines.len()), below(lines.len()));
                lines.swap(a, b);
                *bytes = lines.join(&b'\n');
            }
            _ if !bytes.is_empty() => bytes[at] = b"-,.;#()x9\n\r\t \xFF\0e"[below(16)],
            _ => {}
        }
    }
}

#[test]
fn no_damage_ends_in_a_panic() {
    let count = std::env::var("VIEWSHED_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(600);
    let seeds = seeds();
    let mut random = Pcg64::seed_from_u64(57);
    let (mut read, mut judged) = (0, 0);
    for k in 0..count {
        let mut bytes = seeds[k % seeds.len()].clone();
        let other = &seeds[random.next_u32() as usize % seeds.len()];
        mutate(&mut random, &mut bytes, other);
        let source = Source::of_bytes(&bytes);
        let to_s = (k % 7 == 0).then_some(0.01);
        let options = ReadOptions { sensor_id: Some(0), to_s, ..ReadOptions::default() };
        if let Some(found) = find(&source).unwrap() {
            let mut problems = Problems::default();
            if let Ok(log) = found.clone().read(None, &mut problems, &mut |_| false) {
                // each bus in the order of time, but where its clock was set
                let mut last = std::collections::BTreeMap::new();
                let set = problems.count("runs backwards") > 0;
                log.each(&mut |line| {
                    assert!(line.time_ns >= 0, "{bytes:?}");
                    let before = last.insert(line.interface.clone(), line.time_ns).unwrap_or(0);
                    assert!(set || line.time_ns >= before, "{}", String::from_utf8_lossy(&bytes));
                });
            }
            read += usize::from(ars408::read("log", &found, &options, None).is_ok());
        } else if ti::is_capture(&bytes) {
            read += usize::from(ti::read("capture".into(), &bytes, &options).is_ok());
        }
        judged += usize::from(examine_source("log".into(), &source, &options).is_ok());
    }
    assert!(10 * read > count && 2 * judged > count, "{read} and {judged} of {count}: most are hardly damaged");
}
