//! The structure of the source, read from its imports: rooms in one direction, no circles inside them, functions and
//! comments of a size that one can read.
//!
//! Every exception stands in a list below, with its reason; a list may only become shorter.

mod circles;
mod functions;
mod imports;
mod rooms;
mod source;

use std::collections::{BTreeMap, BTreeSet};

/// Circles of files that stay, each with the reason: three files at most that need one name each of one another.
const ARGUED_CIRCLES: [(&[&str], &str); 0] = [];

/// Rooms with circles that are being removed. To be emptied.
const CIRCLES_TO_REMOVE: [&str; 0] = [];

/// Folders and files whose comments are being wrapped. To be emptied.
const COMMENTS_TO_WRAP: [&str; 0] = [];

/// Lines of the longest function.
const MAX_FUNCTION_LINES: usize = 200;

/// Longer functions, as `file: function`.
const LONG_FUNCTIONS: [&str; 0] = [];

/// Most arguments of a function, `self` included.
const MAX_ARGUMENTS: usize = 7;

/// Functions with more arguments, as `file: function`.
const MANY_ARGUMENTS: [&str; 0] = [];

/// Columns at which comment lines end.
const MAX_COMMENT_COLUMNS: usize = 120;

fn report(problems: &[String], advice: &str) {
    assert!(problems.is_empty(), "\n{}\n{advice}\n", problems.join("\n"));
}

#[test]
fn lists_of_rooms_agree() {
    let flow = rooms::of_flow();
    let mut sorted = flow.clone();
    sorted.sort();
    assert_eq!(sorted, rooms::of_folder(), "ARCHITECTURE.md's flow (left) and the folders and files of src (right)");
    assert_eq!(flow, rooms::of_table(), "ARCHITECTURE.md's flow (left) and table (right)");
    assert_eq!(flow, rooms::of_documentation(), "ARCHITECTURE.md's flow (left) and the links in src/lib.rs (right)");
}

#[test]
fn rooms_use_only_those_before_them() {
    let order = rooms::of_flow();
    let place = |room: &str| order.iter().position(|r| r == room);
    let files = source::library();
    let mut problems = Vec::new();
    for import in imports::imports(&files) {
        let (from, to) = (&files[import.from], &files[import.to]);
        let (Some(user), Some(used)) = (from.room(), to.room()) else { continue };
        if place(user) < place(used) {
            problems.push(format!("{}:{}: {user} uses {} of {}", from.path, import.line, import.name, to.path));
        }
    }
    report(&problems, "A room uses only those that stand before it in ARCHITECTURE.md's flow.");
}

#[test]
fn files_of_a_room_do_not_import_each_other() {
    let files = source::library();
    let mut uses: BTreeMap<(usize, usize), Vec<imports::Import>> = BTreeMap::new();
    for import in imports::imports(&files) {
        if files[import.from].room().is_some() && files[import.from].room() == files[import.to].room() {
            uses.entry((import.from, import.to)).or_default().push(import);
        }
    }
    let edges: BTreeSet<(usize, usize)> = uses.keys().copied().collect();
    let mut argued: BTreeSet<Vec<&str>> = ARGUED_CIRCLES.iter().map(|(files, _)| files.to_vec()).collect();
    let mut problems = Vec::new();
    for circle in circles::circles(files.len(), &edges) {
        let mut paths: Vec<&str> = circle.iter().map(|&i| files[i].path.as_str()).collect();
        paths.sort_unstable();
        let room = files[circle[0]].room().expect("a circle lies in a room");
        if argued.remove(&paths) || CIRCLES_TO_REMOVE.contains(&room) {
            continue;
        }
        problems.push(format!("a circle of {} files in {room}:", circle.len()));
        for ((from, to), imports) in &uses {
            if circle.contains(from) && circle.contains(to) {
                let names: BTreeSet<&str> = imports.iter().map(|i| i.name.as_str()).collect();
                let names = names.into_iter().collect::<Vec<_>>().join(", ");
                problems.push(format!("  {}:{}: {names} of {}", files[*from].path, imports[0].line, files[*to].path));
            }
        }
    }
    problems.extend(argued.iter().map(|paths| format!("no circle any more, take it off the list: {paths:?}")));
    report(&problems, "Options, errors and results get files of their own, so that no two files import each other.");
}

#[test]
fn functions_are_short_and_take_few_arguments() {
    let (mut long, mut many) = (Vec::new(), Vec::new());
    for file in source::library() {
        for function in functions::functions(&file.syntax) {
            let key = format!("{}: {}", file.path, function.name);
            let place = format!("{}:{}: {}", file.path, function.line, function.name);
            if function.num_lines > MAX_FUNCTION_LINES {
                long.push((key.clone(), format!("{place} has {} lines", function.num_lines)));
            }
            if function.num_arguments > MAX_ARGUMENTS {
                many.push((key, format!("{place} takes {} arguments", function.num_arguments)));
            }
        }
    }
    let mut problems = beyond(long, &LONG_FUNCTIONS);
    problems.extend(beyond(many, &MANY_ARGUMENTS));
    report(
        &problems,
        &format!(
            "At most {MAX_FUNCTION_LINES} lines and {MAX_ARGUMENTS} arguments; the lists of exceptions only shrink."
        ),
    );
}

/// What is found and not listed, and what is listed and not found; a name may be listed several times.
fn beyond(found: Vec<(String, String)>, listed: &[&str]) -> Vec<String> {
    let mut left: Vec<&str> = listed.to_vec();
    let mut problems = Vec::new();
    for (key, description) in found {
        match left.iter().position(|l| *l == key) {
            Some(at) => {
                left.remove(at);
            }
            None => problems.push(description),
        }
    }
    problems.extend(left.iter().map(|key| format!("no exception any more, take it off the list: {key}")));
    problems
}

#[test]
fn comments_end_at_their_column() {
    let mut problems = Vec::new();
    for path in ["src", "tests", "benches"].into_iter().flat_map(source::rust_files) {
        if COMMENTS_TO_WRAP.iter().any(|room| path.starts_with(room)) {
            continue;
        }
        for (index, line) in source::text_of(&path).lines().enumerate() {
            let columns = line.chars().count();
            if line.trim_start().starts_with("//") && columns > MAX_COMMENT_COLUMNS {
                problems.push(format!("{path}:{}: a comment of {columns} columns", index + 1));
            }
        }
    }
    report(&problems, &format!("Comment lines end at column {MAX_COMMENT_COLUMNS}."));
}
