//! No folder of the library or the harness uses, on any way, one that uses it; nor do the files within a folder.
//!
//! In each folder the files and folders directly in it are compared. One uses another where code in it has a
//! path, `crate::` or `super::`, into the other; unit tests at the end of a file do not count.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use crate::files::below;

/// A module's path below the crate.
type Module = Vec<String>;

#[test]
fn nothing_in_the_library_is_used_in_a_circle() {
    judge("src", 200);
}

#[test]
fn nothing_in_the_harness_is_used_in_a_circle() {
    judge("tests/harness/src", 200);
}

#[test]
fn nothing_on_a_board_is_used_in_a_circle() {
    for (board, least) in [("linux", 20), ("stm32", 2), ("mps2-an386", 1), ("zcu102-r5", 1)] {
        judge(&format!("boards/{board}/src"), least);
    }
}

/// Fails where something is used in a circle; of fewer uses than these the folder is the wrong one.
fn judge(root: &str, least: usize) {
    let edges = Edges::of(&sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join(root)));
    assert!(edges.0.len() >= least, "{} uses were found in {root}: is this the right folder?", edges.0.len());
    let circles = edges.circles(root);
    for c in &circles {
        println!("{}: {:?} use one another:\n{}", c.folder, c.names, c.edges);
    }
    assert!(circles.is_empty(), "{} circles", circles.len());
}

/// Every source with the module it is.
fn sources(src: &Path) -> BTreeMap<Module, String> {
    let source = |path: PathBuf| {
        let mut module: Module = path
            .strip_prefix(src)
            .unwrap()
            .with_extension("")
            .iter()
            .map(|part| part.to_str().unwrap().to_owned())
            .collect();
        module.pop_if(|last| matches!(last.as_str(), "mod" | "lib"));
        (module, fs::read_to_string(path).unwrap())
    };
    below(src, &[".rs"], &|_| false).into_iter().map(source).collect()
}

/// Which module uses which.
struct Edges(BTreeSet<(Module, Module)>);

/// Names in a folder that use one another, and by which modules.
struct Circle {
    folder: String,
    names: BTreeSet<String>,
    edges: String,
}

impl Edges {
    fn of(sources: &BTreeMap<Module, String>) -> Self {
        let mut edges = BTreeSet::new();
        for (module, text) in sources {
            for path in paths(&code(text)) {
                let Some(used) = resolved(module, &path, sources) else { continue };
                // the longest part that is a module; what is left names something in it
                let used = (0..=used.len()).rev().map(|n| used[..n].to_vec()).find(|m| sources.contains_key(m));
                edges.extend(used.filter(|used| used != module).map(|used| (module.clone(), used)));
            }
        }
        Self(edges)
    }

    fn circles(&self, root: &str) -> Vec<Circle> {
        let modules = self.0.iter().flat_map(|(a, b)| [a, b]);
        let folders: BTreeSet<&[String]> = modules.flat_map(|m| (0..m.len()).map(|n| &m[..n])).collect();
        folders.into_iter().flat_map(|folder| self.circles_in(root, folder)).collect()
    }

    fn circles_in(&self, root: &str, folder: &[String]) -> Vec<Circle> {
        let name = |m: &Module| m.strip_prefix(folder).and_then(|rest| rest.first().cloned());
        let mut uses: BTreeMap<(String, String), (&Module, &Module)> = BTreeMap::new();
        for (a, b) in &self.0 {
            if let (Some(from), Some(to)) = (name(a), name(b)) {
                uses.entry((from, to)).or_insert((a, b));
            }
        }
        let reached = |from: &str| {
            let (mut reached, mut next) = (BTreeSet::new(), vec![from.to_owned()]);
            while let Some(at) = next.pop() {
                next.extend(uses.keys().filter(|(a, b)| *a == at && reached.insert(b.clone())).map(|(_, b)| b.clone()));
            }
            reached
        };
        let names: BTreeSet<&String> = uses.keys().flat_map(|(a, b)| [a, b]).collect();
        let reaches: BTreeMap<&String, BTreeSet<String>> = names.iter().map(|name| (*name, reached(name))).collect();
        let both = |a: &String, b: &String| a == b || (reaches[a].contains(b) && reaches[b].contains(a));
        let mut groups: BTreeSet<BTreeSet<String>> = BTreeSet::new();
        for &name in &names {
            groups.insert(names.iter().filter(|other| both(name, other)).map(|other| (*other).clone()).collect());
        }
        let folder = [&[root.to_owned()][..], folder].concat().join("/");
        let circle = |names: BTreeSet<String>| {
            let inside = uses.iter().filter(|((a, b), _)| a != b && names.contains(a) && names.contains(b));
            let edges =
                inside.map(|(_, (a, b))| format!("  {folder}: {} uses {}\n", a.join("::"), b.join("::"))).collect();
            Circle { folder: folder.clone(), names, edges }
        };
        groups.into_iter().filter(|group| group.len() > 1).map(circle).collect()
    }
}

/// A text without comments and without the unit tests at its end.
fn code(text: &str) -> String {
    let text = text.split("#[cfg(test)]\nmod ").next().unwrap_or_default();
    text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

/// Every path that is imported, and every one in code that begins with `crate` or `super`.
fn paths(code: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    let words = |path: &str| path.split("::").map(|word| word.trim().to_owned()).collect::<Vec<_>>();
    for (at, _) in code.match_indices("use ") {
        let is_word = code[..at].chars().next_back().is_none_or(|c| c.is_whitespace() || c == ')');
        if let (true, Some(end)) = (is_word, code[at..].find(';')) {
            found.extend(spread(&code[at + 4..at + end]).iter().map(|path| words(path)));
        }
    }
    for root in ["crate::", "super::"] {
        for (at, _) in code.match_indices(root) {
            let path: String = code[at..].chars().take_while(|c| c.is_alphanumeric() || "_:".contains(*c)).collect();
            found.push(words(&path));
        }
    }
    found
}

/// `a::{b, c::d}` as `a::b` and `a::c::d`.
fn spread(tree: &str) -> Vec<String> {
    let tree = tree.trim();
    let Some((head, rest)) = tree.split_once('{') else {
        return vec![tree.split(" as ").next().unwrap_or_default().to_owned()];
    };
    let (mut parts, mut part, mut depth) = (Vec::new(), String::new(), 0);
    for c in rest.strip_suffix('}').unwrap_or(rest).chars() {
        depth += i32::from(c == '{') - i32::from(c == '}');
        if c == ',' && depth == 0 {
            parts.push(std::mem::take(&mut part));
        } else {
            part.push(c);
        }
    }
    parts.push(part);
    let filled = parts.iter().filter(|part| !part.trim().is_empty());
    filled.flat_map(|part| spread(part)).map(|part| format!("{head}{part}")).collect()
}

/// A path seen from the crate; `None` for other crates'.
fn resolved(module: &Module, path: &[String], sources: &BTreeMap<Module, String>) -> Option<Module> {
    let (first, rest) = path.split_first()?;
    match first.as_str() {
        "crate" => Some(rest.to_vec()),
        "self" => Some([module, rest].concat()),
        "super" => {
            let above = module.split_last()?.1.to_vec();
            if rest.first().is_some_and(|word| word == "super") {
                return resolved(&above, rest, sources);
            }
            Some([&above, rest].concat())
        }
        child => {
            let child = [&module[..], &[child.to_owned()]].concat();
            sources.contains_key(&child).then(|| [&child[..], rest].concat())
        }
    }
}

#[test]
fn a_circle_is_found_and_its_edges_are_named() {
    let module = |path: &str| path.split('/').map(str::to_owned).collect::<Module>();
    let sources: BTreeMap<Module, String> = [
        ("a/one", "use crate::{b::{self, Two as Other}, c};\n"),
        ("b", "pub mod two;\n"),
        ("b/two", "fn f() { crate::d::g() } // crate::a\n"),
        ("c", "pub use super::d::Four;\n"),
        ("d", "use std::fmt;\n#[cfg(test)]\nmod tests { use crate::c; }\n"),
    ]
    .map(|(path, text)| (module(path), text.to_owned()))
    .into();
    assert!(Edges::of(&sources).circles("src").is_empty());
    let mut round = sources.clone();
    round.insert(module("d"), "use crate::a::one::One;\n".to_owned());
    let circles = Edges::of(&round).circles("src");
    assert_eq!(circles.len(), 1);
    assert_eq!(circles[0].names.iter().collect::<Vec<_>>(), ["a", "b", "c", "d"]);
    assert!(circles[0].edges.contains("src: d uses a::one") && circles[0].edges.contains("src: b::two uses d"));
    // also among the files of one folder
    let mut within = sources;
    within.insert(module("a/six"), "use super::one::One;\n".to_owned());
    within.insert(module("a/one"), "use super::six;\n".to_owned());
    let circles = Edges::of(&within).circles("src");
    assert_eq!((circles.len(), circles[0].folder.as_str()), (1, "src/a"));
}
