//! Any words as a block: the end comes, rays keep within their limits, and what is read can be resumed.

use viewshed::fixed::bits::Bits;
use viewshed::wire::code::block::{Basis, Context};
use viewshed::wire::code::interval::Form;
use viewshed::wire::code::ray::{Known, Ray};
use viewshed::wire::code::reading::{Ending, Reader, Resume, decode};

const AZIMUTHS: usize = 128;
const RANGES: usize = 224;

struct Rays {
    was: Ray<7>,
    taken: Vec<Option<Ray<7>>>,
}

impl Reader<7> for Rays {
    fn was(&self, azimuth: usize) -> Option<Ray<7>> {
        (azimuth % 50 != 49).then_some(self.was)
    }
    fn take(&mut self, azimuth: usize, ray: &Ray<7>) {
        assert!(azimuth < AZIMUTHS && ray.known.end() <= RANGES);
        assert_eq!(Ray::new(ray.known, *ray.bits()), *ray, "bits outside");
        self.taken[azimuth] = Some(*ray);
    }
    fn taken(&self, azimuth: usize) -> Option<Ray<7>> {
        self.taken[azimuth]
    }
}

/// One input.
pub fn run(bytes: &[u8]) {
    let [flags, start, near, last, pattern, words @ ..] = bytes else { return };
    let form = if flags & 1 == 0 { Form::CLASSIC } else { Form::LONG };
    let kind = if flags & 2 == 0 { Basis::Refresh } else { Basis::Delta { ticks: 3 } };
    let words: Vec<u64> = words
        .chunks_exact(5)
        .take(form.most)
        .map(|w| {
            (u64::from(w[0] & 1) << 32 | u64::from(u32::from_be_bytes([w[1], w[2], w[3], w[4]])))
                & ((1 << form.bits) - 1)
        })
        .collect();
    let usual = Known::new(usize::from(*near), usize::from(*last) + 1);
    let usual = if usual.end() > RANGES { Known::NONE } else { usual };
    let context = Context { form, usual, azimuths: AZIMUTHS, ranges: RANGES };
    let was = Ray::new(usual, Bits::from_words([u32::from(*pattern) * 0x0101_0101; 7]));
    let start = usize::from(*start) % AZIMUTHS;
    let rays = || Rays { was, taken: vec![None; AZIMUTHS] };
    let (mut at_once, mut step_by_step) = (rays(), rays());
    let ending = decode(&words, &context, kind, start, &mut { Resume::START }, &mut at_once);
    let mut place = Resume::START;
    for n in 1..=words.len() {
        let ended = decode(&words[..n], &context, kind, start, &mut place, &mut step_by_step);
        if ended != Ending::OutOfWords {
            assert_eq!(ended, ending);
            break;
        }
    }
    assert_eq!(at_once.taken, step_by_step.taken);
}
