//! Pages that show what was measured: between two markers stands what one table came to, and nothing is copied by hand.
//!
//! `<!-- results PART | table 2 | columns A; B | rows X; Y -->` begins such a block and `<!-- end of results -->` ends it;
//! tables are counted through all that the part printed, from 1 on.
//!
//! `<!-- results * | columns A; B | row LABEL = PART X | row ... -->` puts a row of each of several parts together: what its
//! first table with that row says in each column, and as the column `FLAT` what the flat grid has.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};

use super::parts::{Kept, Measured, Plan};
use super::table::{Piece, Table, pieces};

const BEGIN: &str = "<!-- results ";
/// The column of what a flat grid calls visible where it hides as much, or how much less radar-3d does: no column of a table, but a line
/// below.
const FLAT: &str = "flat grid at the same cell FIR";
const END: &str = "<!-- end of results -->";

/// A page and what it is to hold.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Page {
    pub path: PathBuf,
    pub before: String,
    pub after: String,
}

/// Every page of the repository with a marker.
///
/// # Errors
/// A marker that names no part, or something that it did not print, or has no end.
pub fn all(root: &Path, plan: &Plan, kept: &Kept) -> Result<Vec<Page>> {
    let mut pages = Vec::new();
    let mut folders = vec![root.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).with_context(|| folder.display().to_string())? {
            let path = entry?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if path.is_dir() && name != "target" && name != "out" && !name.starts_with('.') {
                folders.push(path);
            } else if name.ends_with(".md") {
                let before = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
                if before.contains(BEGIN) {
                    let after = filled(&before, plan, kept).with_context(|| path.display().to_string())?;
                    pages.push(Page { path, before, after });
                }
            }
        }
    }
    pages.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(pages)
}

/// A page's text with its blocks filled; one of a part that was not measured yet stays as it is.
fn filled(text: &str, plan: &Plan, kept: &Kept) -> Result<String> {
    let mut out = String::new();
    let mut rest = text;
    while let Some((before, begun)) = rest.split_once(BEGIN) {
        let (marker, body) = begun.split_once(" -->").context("a marker without an end")?;
        let (old, after) = body.split_once(END).with_context(|| format!("`{BEGIN}{marker} -->` without `{END}`"))?;
        let awaited = |name: &str| plan.part.iter().any(|part| part.name == name) && !kept.contains_key(name);
        out += &if parts_of(marker).any(awaited) {
            format!("{before}{BEGIN}{marker} -->{old}{END}")
        } else {
            let block = block(marker, kept).with_context(|| format!("`{BEGIN}{marker} -->`"))?;
            format!("{before}{BEGIN}{marker} -->\n\n{block}\n{END}")
        };
        rest = after;
    }
    Ok(out + rest)
}

/// The parts that a marker names.
fn parts_of(marker: &str) -> impl Iterator<Item = &str> {
    let words = marker.split('|').map(str::trim);
    let one = words.clone().next().filter(|name| *name != "*");
    one.into_iter().chain(words.filter_map(part_of_row))
}

fn part_of_row(word: &str) -> Option<&str> {
    word.strip_prefix("row ")?.split_once(" = ")?.1.split_whitespace().next()
}

fn block(marker: &str, kept: &Kept) -> Result<String> {
    let mut words = marker.split('|').map(str::trim);
    let name = words.next().unwrap_or_default();
    if name == "*" {
        return together(&words.collect::<Vec<_>>(), kept);
    }
    let measured = kept.get(name).with_context(|| format!("`viewshed results --only {name}` was not run"))?;
    let (mut number, mut columns, mut rows) = (1, Vec::new(), Vec::new());
    for word in words {
        let (key, value) = word.split_once(' ').unwrap_or((word, ""));
        let list = || value.split(';').map(str::trim).collect();
        match key {
            "table" => number = value.parse().context("table")?,
            "columns" => columns = list(),
            "rows" => rows = list(),
            _ => bail!("`{key}`: table, columns or rows"),
        }
    }
    let table = tables(measured).into_iter().nth(number - 1).with_context(|| format!("there is no table {number}"))?;
    let table = table.of(&columns, &rows).map_err(|error| anyhow!(error))?;
    Ok(table.markdown() + &format!("\n<sub>`viewshed results --only {name}`, sources {}</sub>\n", measured.sources))
}

/// A row of each of several parts.
fn together(words: &[&str], kept: &Kept) -> Result<String> {
    let mut table = Table { columns: vec!["place".to_owned()], rows: Vec::new() };
    let mut from = Vec::new();
    for word in words {
        if let Some(columns) = word.strip_prefix("columns ") {
            table.columns.extend(columns.split(';').map(|column| column.trim().to_owned()));
        } else {
            let row = word.strip_prefix("row ").and_then(|row| row.split_once(" = "));
            let (label, of) = row.with_context(|| format!("`{word}`: columns, or row LABEL = PART ROW"))?;
            let (part, name) = of.trim().split_once(' ').with_context(|| format!("`{word}`: PART and ROW"))?;
            let measured = kept.get(part).with_context(|| format!("`viewshed results --only {part}` was not run"))?;
            let all = tables(measured);
            let cell = |column: &String| match column.as_str() {
                FLAT => flat_grid(measured),
                column => all.iter().find_map(|table| table.of(&[column], &[name]).ok()?.rows.pop()?.pop()),
            };
            let cells = table
                .columns
                .iter()
                .skip(1)
                .map(|column| cell(column).with_context(|| format!("{part} says no `{column}` of `{name}`")));
            let cells = [Ok(label.trim().to_owned())].into_iter().chain(cells).collect::<Result<_>>()?;
            table.rows.push(cells);
            let source = format!("{part} {}", measured.sources);
            if !from.contains(&source) {
                from.push(source);
            }
        }
    }
    Ok(table.markdown() + &format!("\n<sub>`viewshed results`; sources: {}</sub>\n", from.join(", ")))
}

fn flat_grid(measured: &Measured) -> Option<String> {
    let mut lines = measured.printed.iter().flatten().filter(|line| line.starts_with("At equal FIR of cells"));
    let (_, said) = lines.next()?.split_once("radar-2d-first")?;
    let said = said.trim_start_matches([':', ' ']);
    Some(said.split_once(':').map_or(said, |(rate, _)| rate).trim_end_matches('.').to_owned())
}

fn tables(measured: &Measured) -> Vec<Table> {
    let all = measured.printed.iter().flat_map(|lines| pieces(&lines.join("\n")));
    all.filter_map(|piece| if let Piece::Table(table) = piece { Some(table) } else { None }).collect()
}

/// Whether a line beside the tables says what came out: comparisons, and floors and aims with whether they are reached. All lines are in
/// what was kept.
fn is_finding(line: &str) -> bool {
    line.starts_with("At equal FIR") || line.contains("reached")
}

/// The page of all results.
pub fn results(plan: &Plan, kept: &Kept) -> String {
    let total: u64 = plan.part.iter().filter_map(|part| kept.get(&part.name)).map(|m| m.seconds).sum();
    let mut page = format!(
        "# Results\n\nWritten by `viewshed results`, by the plan [results.toml](results.toml); a whole run took {} minutes. All recordings are simulated. \
         Pages show parts of it between markers.\n",
        total.div_ceil(60)
    );
    for part in &plan.part {
        page += &format!("\n## {}\n\n{}\n", part.name, part.shows);
        let Some(measured) = kept.get(&part.name) else {
            page += "\nNot measured yet.\n";
            continue;
        };
        let mut number = 0;
        for (line, printed) in measured.run.iter().zip(&measured.printed) {
            page += &format!("\n    viewshed {line}\n\n");
            let (mut said, mut tables) = (String::new(), String::new());
            let mut lines = pieces(&printed.join("\n")).into_iter().peekable();
            while let Some(piece) = lines.next() {
                match piece {
                    Piece::Table(table) => {
                        number += 1;
                        if part.shows_table(number) {
                            tables += &format!("{}\n", table.markdown());
                        }
                    }
                    Piece::Line(line) if line.is_empty() => {}
                    // the line above a table says what it is of
                    Piece::Line(line) if matches!(lines.peek(), Some(Piece::Table(_))) => {
                        if part.shows_table(number + 1) {
                            tables += &format!("{}\n\n", line.replace('<', "&lt;"));
                        }
                    }
                    Piece::Line(line) if is_finding(&line) => said += &format!("- {}\n", line.replace('<', "&lt;")),
                    Piece::Line(_) => {}
                }
            }
            page += &tables;
            if !said.is_empty() {
                page += &format!("{said}\n");
            }
        }
        page += &format!(
            "\n<sub>{} s on {}, sources {}, version {} of the estimators</sub>\n",
            measured.seconds, measured.machine, measured.sources, measured.estimator_version
        );
    }
    // no two empty lines
    while page.contains("\n\n\n") {
        page = page.replace("\n\n\n", "\n\n");
    }
    page
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kept() -> Kept {
        let printed = "┌──┬──┐\n│ a ┆b │\n╞══╪══╡\n│ x ┆1 │\n│ y ┆2 │\n└──┴──┘\naim: reached\nand what else was said";
        let measured = Measured {
            run: vec!["replay x".into()],
            sources: "12345678".into(),
            estimator_version: 2,
            seconds: 61,
            machine: "1 x none".into(),
            printed: vec![printed.lines().map(str::to_owned).collect()],
        };
        Kept::from([("one".to_owned(), measured)])
    }

    fn plan() -> Plan {
        toml::from_str("[[part]]\nname = \"one\"\nshows = \"It.\"\nrun = [\"replay x\"]\n[[part]]\nname = \"two\"\nshows = \"It.\"\nrun = [\"bus x\"]\n").unwrap()
    }

    #[test]
    fn a_block_of_what_was_not_measured_yet_stays() {
        for marker in ["two | table 1", "* | columns b | row x = one x | row y = two y"] {
            let page = format!("a\n<!-- results {marker} -->\nold\n<!-- end of results -->\nb\n");
            assert_eq!(filled(&page, &plan(), &kept()).unwrap(), page);
        }
    }

    #[test]
    fn a_block_holds_what_was_measured_and_the_text_around_it_stays() {
        let page = "Before.\n\n<!-- results one | columns b; a | rows y -->\nold\n<!-- end of results -->\n\nAfter.\n";
        let filled = filled(page, &plan(), &kept()).unwrap();
        let block =
            "\n\n| b | a |\n|---|---|\n| 2 | y |\n\n<sub>`viewshed results --only one`, sources 12345678</sub>\n\n";
        assert_eq!(filled, page.replace("\nold\n", block));
        assert_eq!(super::filled(&filled, &plan(), &kept()).unwrap(), filled, "again is the same");
    }

    #[test]
    fn rows_of_several_parts_stand_together() {
        let mut kept = kept();
        let mut other = kept["one"].clone();
        other.printed[0].push("At equal FIR of cells (8.4 %): radar-3d has FVR 1 %, the best of radar-2d and radar-2d-first 68.7 %: -5 points".into());
        kept.insert("two".into(), other);
        let page = |columns: &str, rows: &str| {
            filled(&format!("<!-- results * | columns {columns} | {rows} --> <!-- end of results -->"), &plan(), &kept)
        };
        let both = page("b", "row first = one x | row second, and last = two y").unwrap();
        assert!(both.contains("| place | b |\n|---|---|\n| first | 1 |\n| second, and last | 2 |\n"), "{both}");
        assert!(both.contains("sources: one 12345678, two 12345678"), "{both}");
        assert!(page(FLAT, "row second = two y").unwrap().contains("| second | 68.7 % |"));
        assert!(format!("{:#}", page(FLAT, "row first = one y").unwrap_err()).contains("one says no `flat grid at"));
        assert!(page("c", "row first = one x").is_err() && page("b", "row x").is_err());
    }

    #[test]
    fn a_marker_that_names_nothing_is_an_error() {
        let error = |marker: &str| {
            let page = format!("<!-- results {marker} --> <!-- end of results -->");
            format!("{:#}", filled(&page, &plan(), &kept()).unwrap_err())
        };
        assert!(error("three").contains("`viewshed results --only three` was not run"));
        assert!(error("one | table 2").contains("there is no table 2"));
        assert!(error("one | rows z").contains("no row `z`, only x; y"));
        assert!(error("one | color red").contains("table, columns or rows"));
        assert!(filled("<!-- results one -->", &plan(), &kept()).is_err());
    }

    #[test]
    fn the_page_of_results_has_commands_tables_and_what_they_were_measured_on() {
        let page = results(&plan(), &kept());
        for text in [
            "a whole run took 2 minutes",
            "## one\n\nIt.\n\n    viewshed replay x\n",
            "| x | 1 |",
            "\n- aim: reached\n",
            "sources 12345678",
            "## two\n\nIt.\n\nNot measured yet.",
        ] {
            assert!(page.contains(text), "{text}: {page}");
        }
    }
}
