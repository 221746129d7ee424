//! `viewshed results`: runs every reported experiment and writes every figure that a page shows.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result};

use super::progress::bar;
use super::{print, told};
use crate::results::figures::pages;
use crate::results::figures::parts::{self, KEPT, Measured, PAGE, Pictures, Plan};

/// Exit code where something is not as it was kept.
const DIFFERS: u8 = 1;

/// Runs the reported experiments and writes their figures, wherever pages show them
///
/// The plan is tests/results.toml. What each part prints is kept in tests/results.json, with a check sum of the sources it was
/// measured on, and written to tests/RESULTS.md and between the markers of all pages. Parts whose sources are still the
/// same are not run again, so a run that was ended goes on where it was. All parts take a quarter of an hour together, quick
/// ones seconds. Pictures that pages show are made by the same parts.
///
/// Examples:
///   viewshed results --quick            after a change: what takes seconds
///   viewshed results --only crossings   one of them, however long
///   viewshed results --check            whether quick figures and pages are as they should be; writes nothing
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// Parts of the plan
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    only: Vec<String>,
    /// Quick parts only
    #[arg(long)]
    quick: bool,
    /// Run quick parts and compare them and the pages with what is kept; exit code 1 if something differs
    #[arg(long, conflicts_with_all = ["only", "quick", "again"])]
    check: bool,
    /// Run parts again whose sources are the same
    #[arg(long)]
    again: bool,
    /// The repository
    #[arg(long, value_name = "DIR", default_value = ".")]
    root: PathBuf,
}

/// Runs, keeps and writes.
///
/// # Errors
/// A plan that is none, a command that fails, a file that cannot be written.
pub fn run(args: &Args) -> Result<ExitCode> {
    let root = args.root.as_path();
    let plan = Plan::read(root)?;
    let mut kept = parts::kept(root)?;
    if args.check {
        return check(args, &plan, &kept);
    }
    let sources = parts::sources(root)?;
    let asked = plan.named(&args.only)?;
    let asked = asked.into_iter().filter(|part| part.quick || !args.quick);
    let due: Vec<_> = asked
        .filter(|part| {
            let is_same = |m: &Measured| m.sources == sources && m.run == part.run;
            args.again || !kept.get(&part.name).is_some_and(is_same)
        })
        .collect();
    let running = bar("measuring", due.len() as u64);
    for part in due {
        told(&format!("{}: {}", part.name, part.shows));
        let measured = Measured::by_running(part, root, &sources, Pictures::Made)?;
        print(&format!("{}: {} s\n", part.name, measured.seconds))?;
        kept.insert(part.name.clone(), measured);
        // what was measured is kept at once
        write(root.join(KEPT), &(serde_json::to_string_pretty(&kept)? + "\n"))?;
        running.step();
    }
    drop(running);
    write(root.join(PAGE), &pages::results(&plan, &kept))?;
    for page in pages::all(root, &plan, &kept)? {
        if page.before != page.after {
            write(page.path.clone(), &page.after)?;
            print(&format!("{}: figures written\n", page.path.display()))?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Whether quick parts print what is kept, and pages show it.
fn check(args: &Args, plan: &Plan, kept: &parts::Kept) -> Result<ExitCode> {
    let root = args.root.as_path();
    let mut differs = Vec::new();
    for part in plan.part.iter().filter(|part| part.quick) {
        let measured = Measured::by_running(part, root, "", Pictures::Left)?;
        match kept.get(&part.name) {
            Some(before) if before.printed == measured.printed && before.run == measured.run => {}
            Some(before) => {
                let all = |m: &Measured| m.printed.concat();
                let (before, now) = (all(before), all(&measured));
                let first = now.iter().zip(&before).find(|(a, b)| a != b);
                let first = first.map(|(now, before)| format!(": `{before}` is `{now}`")).unwrap_or_default();
                differs.push(format!("{}{first}", part.name));
            }
            None => differs.push(format!("{}: not measured", part.name)),
        }
    }
    let page = std::fs::read_to_string(root.join(PAGE)).unwrap_or_default();
    if page != pages::results(plan, kept) {
        differs.push(format!("{PAGE} is not what was measured"));
    }
    let pages = pages::all(root, plan, kept)?.into_iter().filter(|page| page.before != page.after);
    differs.extend(pages.map(|page| format!("{} does not show what was measured", page.path.display())));
    if differs.is_empty() {
        print("figures and pages are as they were measured\n")?;
        return Ok(ExitCode::SUCCESS);
    }
    print(&format!("{}\n`viewshed results --quick` brings them up to date\n", differs.join("\n")))?;
    Ok(ExitCode::from(DIFFERS))
}

fn write(path: PathBuf, text: &str) -> Result<()> {
    std::fs::write(&path, text).with_context(|| path.display().to_string())
}
