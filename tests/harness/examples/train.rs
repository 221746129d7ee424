use viewshed::bits::Bits;
use viewshed::wire::code::{
    block::Kind,
    interval::Form,
    ray::{Known, Ray},
};
use viewshed_harness::{
    bus::symbols::{Scan, Symbols},
    estimators, recording,
};
fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let period: usize = args[0].parse().unwrap();
    let mut all_sym = Symbols::new();
    for path in &args[1..] {
        let rec = recording::mcap::read(path.as_ref(), &Default::default()).unwrap();
        let mut all = estimators::all(&rec, &Default::default()).unwrap();
        let e = all.iter_mut().find(|e| e.name() == "radar-3d").unwrap();
        let mut was: Vec<Ray<7>> = vec![];
        let mut tot = vec![(0usize, 0usize); period];
        let mut usual = Known::NONE;
        let mut totl = vec![(0usize, 0usize); period];
        for (k, fr) in rec.frames.iter().enumerate() {
            e.step(fr);
            let p = e.polar().unwrap();
            let now: Vec<Ray<7>> = (0..p.azimuths)
                .map(|a| {
                    let (mut kn, mut vis) = (Bits::<7>::NONE, Bits::<7>::NONE);
                    for r in 0..p.ranges {
                        let c = (p.cell)(a, r).visibility;
                        if c != viewshed::map::Visibility::Unknown {
                            kn.set(r)
                        }
                        if c == viewshed::map::Visibility::Visible {
                            vis.set(r)
                        }
                    }
                    let known = kn.next(0).map_or(Known::NONE, |n| Known::new(n, kn.last().unwrap() + 1));
                    Ray::new(known, vis)
                })
                .collect();
            if k < 15 {
                continue;
            }
            if usual.is_empty() {
                usual = now[60].known;
            }
            let ph = (k - 15) % period;
            let mut kind = Kind::Refresh;
            if ph == 0 {
                was = now.clone();
            } else {
                kind = Kind::Delta { ticks: (ph * 3 + ph / 3) as u8 }
            }
            let w = all_sym.count(&Scan { now: &now, was: &was }, Form::CLASSIC, kind, usual);
            tot[ph].0 += w;
            tot[ph].1 += 1;
            let w = Symbols::new().count(&Scan { now: &now, was: &was }, Form::LONG, kind, usual);
            totl[ph].0 += w;
            totl[ph].1 += 1;
        }
        let sum: usize = tot.iter().map(|t| t.0).sum();
        let n: usize = tot.iter().map(|t| t.1).sum();
        eprintln!(
            "{path}: {:?} avg {:.2} frames; long words {:?}",
            tot.iter().map(|t| (t.0 as f64 / t.1 as f64 * 10.0).round() / 10.0).collect::<Vec<_>>(),
            sum as f64 / n as f64,
            totl.iter().map(|t| (t.0 as f64 / t.1 as f64 * 10.0).round() / 10.0).collect::<Vec<_>>()
        );
    }
    print!("{}", all_sym.model());
}
