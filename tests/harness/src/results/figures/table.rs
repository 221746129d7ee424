//! Tables that commands print, as tables of Markdown.

/// A table: names of its columns, and rows of cells.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    pub columns: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

/// What a command printed: tables, and lines between them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Piece {
    Line(String),
    Table(Table),
}

/// The pieces of what was printed. Rows without a name below another hold its intervals, and are left out.
pub fn pieces(printed: &str) -> Vec<Piece> {
    let mut pieces = Vec::new();
    let mut lines = printed.lines().peekable();
    while let Some(line) = lines.next() {
        if !line.starts_with('┌') {
            pieces.push(Piece::Line(line.to_owned()));
            continue;
        }
        let mut rows: Vec<Vec<String>> = Vec::new();
        let mut table = Table { columns: Vec::new(), rows: Vec::new() };
        while let Some(line) = lines.next_if(|line| line.starts_with(['│', '╞', '├'])) {
            if line.starts_with('│') {
                rows.push(cells(line));
            } else if line.starts_with('╞') {
                table.columns = joined(&rows);
                rows.clear();
            }
        }
        lines.next_if(|line| line.starts_with('└'));
        table.rows = rows.into_iter().filter(|row| row.first().is_some_and(|name| !name.is_empty())).collect();
        pieces.push(Piece::Table(table));
    }
    pieces
}

fn cells(line: &str) -> Vec<String> {
    line.trim_matches('│').split('┆').map(|cell| cell.trim().to_owned()).collect()
}

/// A heading of several lines in one; a word that was broken at a hyphen is whole again.
fn joined(lines: &[Vec<String>]) -> Vec<String> {
    let columns = lines.iter().map(Vec::len).max().unwrap_or(0);
    let of = |k: usize| {
        lines.iter().filter_map(|line| line.get(k)).filter(|part| !part.is_empty()).fold(String::new(), |all, part| {
            match all.strip_suffix('-') {
                Some(begun) => begun.to_owned() + part,
                None if all.is_empty() => part.clone(),
                None => all + " " + part,
            }
        })
    };
    (0..columns).map(of).collect()
}

impl Table {
    /// The same with these columns and these rows only, in their order; an empty list leaves all.
    ///
    /// # Errors
    /// Names a column or a row that is not there.
    pub fn of(&self, columns: &[&str], rows: &[&str]) -> Result<Self, String> {
        let find = |all: &[String], name: &str, what: &str| {
            let place = all.iter().position(|other| other == name);
            place.ok_or_else(|| format!("no {what} `{name}`, only {}", all.join("; ")))
        };
        let names: Vec<String> = self.rows.iter().filter_map(|row| row.first().cloned()).collect();
        let places = |wanted: &[&str], all: &[String], what: &str| -> Result<Vec<usize>, String> {
            if wanted.is_empty() {
                return Ok((0..all.len()).collect());
            }
            wanted.iter().map(|name| find(all, name, what)).collect()
        };
        let columns = places(columns, &self.columns, "column")?;
        let rows = places(rows, &names, "row")?;
        let pick = |row: &Vec<String>| columns.iter().map(|k| row.get(*k).cloned().unwrap_or_default()).collect();
        Ok(Self { columns: pick(&self.columns), rows: rows.iter().map(|k| pick(&self.rows[*k])).collect() })
    }

    /// As Markdown.
    pub fn markdown(&self) -> String {
        let line = |cells: &[String]| format!("| {} |\n", cells.join(" | ").replace("  ", " "));
        let ruler = format!("|{}\n", "---|".repeat(self.columns.len()));
        self.rows.iter().fold(line(&self.columns) + &ruler, |all, row| all + &line(row))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PRINTED: &str = "shipped, 3 frames
┌────────────┬──────┬────────┐
│ estimator  ┆FVR % ┆ trajec │
│            ┆      ┆ -tories │
╞════════════╪══════╪════════╡
│ radar-2d   ┆ 72.7 ┆      4 │
│            ┆ 1–99 ┆        │
├╌╌╌╌╌╌╌╌╌╌╌╌┼╌╌╌╌╌╌┼╌╌╌╌╌╌╌╌┤
│ radar-3d   ┆ 18.8 ┆      5 │
└────────────┴──────┴────────┘
Problems of the input: none.
";

    #[test]
    fn a_printed_table_becomes_one_of_markdown_and_lines_stay() {
        let pieces = pieces(PRINTED);
        let [Piece::Line(first), Piece::Table(table), Piece::Line(last)] = &pieces[..] else { panic!("{pieces:?}") };
        assert_eq!((first.as_str(), last.as_str()), ("shipped, 3 frames", "Problems of the input: none."));
        assert_eq!(
            table.markdown(),
            "| estimator | FVR % | trajec -tories |\n|---|---|---|\n| radar-2d | 72.7 | 4 |\n| radar-3d | 18.8 | 5 |\n"
        );
        let part = table.of(&["FVR %", "estimator"], &["radar-3d"]).unwrap();
        assert_eq!(part.markdown(), "| FVR % | estimator |\n|---|---|\n| 18.8 | radar-3d |\n");
        assert_eq!(table.of(&["FIR %"], &[]).unwrap_err(), "no column `FIR %`, only estimator; FVR %; trajec -tories");
        assert_eq!(table.of(&[], &["camera"]).unwrap_err(), "no row `camera`, only radar-2d; radar-3d");
    }

    #[test]
    fn a_word_broken_at_a_hyphen_is_whole_again() {
        let lines = [vec!["trajec-".to_owned(), "cell".to_owned()], vec!["tories".to_owned(), "FVR %".to_owned()]];
        assert_eq!(joined(&lines), ["trajectories", "cell FVR %"]);
    }
}
