//! The lists of rooms: in the documents, and as the folders have them.

use super::source::{project, text_of};

/// The rooms of the flow at the beginning of ARCHITECTURE.md, each before those that may use it.
pub fn of_flow() -> Vec<String> {
    let text = text_of("ARCHITECTURE.md");
    let block = text.split("```").nth(1).expect("ARCHITECTURE.md begins with the flow of data");
    block
        .split(['►', ',', '\n'])
        .map(|w| w.trim_matches([' ', '─']))
        .filter(|w| !w.is_empty())
        .map(String::from)
        .collect()
}

/// The rooms of ARCHITECTURE.md's table.
pub fn of_table() -> Vec<String> {
    let text = text_of("ARCHITECTURE.md");
    let rows = text.lines().filter_map(|line| line.strip_prefix("| `")?.split_once('`'));
    rows.map(|(room, _)| room.to_string()).collect()
}

/// The rooms that the documentation of the library links, in its order.
pub fn of_documentation() -> Vec<String> {
    let text = text_of("src/lib.rs");
    let lines: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("//!")).collect();
    let links = lines.join("\n");
    links.split("[`").skip(1).filter_map(|rest| rest.split_once("`]")).map(|(room, _)| room.to_string()).collect()
}

/// The folders and files of `src`, without the roots of the library and of the program, sorted.
pub fn of_folder() -> Vec<String> {
    let entries = std::fs::read_dir(project().join("src")).expect("the source");
    let mut rooms: Vec<String> = entries
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.is_dir() || path.extension().is_some_and(|e| e == "rs"))
        .map(|path| path.file_stem().expect("a name").to_string_lossy().into_owned())
        .filter(|name| name != "lib" && name != "main")
        .collect();
    rooms.sort();
    // A room's file may have a folder beside it.
    rooms.dedup();
    rooms
}
