//! How many connections the system's limit on open files leaves room for.

use super::log;

/// Files that the service opens beside its connections: the database and its readers, uploads that come in, the files
/// of recordings that are read, its own libraries.
const OTHER_FILES: usize = 128;

/// The limit on open files in a text as in `/proc/self/limits`; none where it is not there, or unlimited.
fn limit_in(text: &str) -> Option<usize> {
    let line = text.lines().find_map(|line| line.strip_prefix("Max open files"))?;
    line.split_whitespace().next()?.parse().ok()
}

/// Connections in all and of one address, where the system lets a process open `open_files` files: what is left beside
/// the service's own files, and of that the same part for one address; at least one.
fn within(wanted: [usize; 2], open_files: Option<usize>) -> [usize; 2] {
    let Some(open_files) = open_files else { return wanted };
    // Where even its own files do not fit, half of the few there are.
    let room = open_files.saturating_sub(OTHER_FILES).max(open_files / 2).max(1);
    if room >= wanted[0] {
        return wanted;
    }
    [room, (wanted[1] * room / wanted[0]).max(1)]
}

/// As many of the `wanted` connections, in all and of one address, as this process may open files for. A connection for
/// which there is no file cannot be taken, and would keep others waiting.
pub fn connections(wanted: [usize; 2]) -> [usize; 2] {
    let limit = std::fs::read_to_string("/proc/self/limits").ok().and_then(|text| limit_in(&text));
    let found = within(wanted, limit);
    if found != wanted {
        let fields = serde_json::json!({
            "connections": found[0], "of_one_address": found[1], "open_files": limit,
            "remedy": "raise the limit on open files (ulimit -n) for more",
        });
        log::info("connections", &fields);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn connections_keep_the_limit_on_open_files() {
        let text = "Limit                     Soft Limit           Hard Limit           Units     \n\
                    Max processes             95797                95797                processes \n\
                    Max open files            1024                 1048576              files     \n";
        assert_eq!(limit_in(text), Some(1024));
        assert_eq!(limit_in(&text.replace("1024  ", "unlimited")), None);
        assert_eq!(limit_in(""), None);
        assert_eq!(within([4096, 2048], None), [4096, 2048]);
        assert_eq!(within([4096, 2048], Some(100_000)), [4096, 2048]);
        assert_eq!(within([4096, 2048], Some(1024)), [896, 448]);
        assert_eq!(within([4096, 2048], Some(100)), [50, 25]);
        assert_eq!(within([4096, 2048], Some(0)), [1, 1]);
    }
}
