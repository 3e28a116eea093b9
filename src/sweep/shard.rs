//! A part of a sweep's tasks.

use serde::{Deserialize, Serialize};

/// Largest number of shards.
pub const MAX_SHARDS: usize = 100_000;

/// Shard `index` of `count`: every `count`-th task, so that cheap and dear regions of the space spread evenly.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shard {
    /// From 1.
    pub index: usize,
    /// Number of shards.
    pub count: usize,
}

impl Shard {
    /// All tasks.
    pub const WHOLE: Shard = Shard { index: 1, count: 1 };

    /// Reads `i/n`; `None` unless 1 ≤ i ≤ n ≤ 100 000.
    pub fn parse(text: &str) -> Option<Shard> {
        let (index, count) = text.split_once('/')?;
        let shard = Shard { index: index.trim().parse().ok()?, count: count.trim().parse().ok()? };
        (1 <= shard.index && shard.index <= shard.count && shard.count <= MAX_SHARDS).then_some(shard)
    }

    /// Whether a task belongs to this shard.
    pub fn holds(&self, task: usize) -> bool {
        task % self.count + 1 == self.index
    }

    /// Tasks of this shard among `num_tasks`, ascending.
    pub fn tasks(&self, num_tasks: usize) -> impl Iterator<Item = usize> + use<> {
        (self.index - 1..num_tasks).step_by(self.count)
    }
}

impl std::fmt::Display for Shard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_a_partition() {
        for count in 1..7 {
            let mut all: Vec<usize> = (1..=count).flat_map(|index| Shard { index, count }.tasks(23)).collect();
            all.sort_unstable();
            assert_eq!(all, (0..23).collect::<Vec<_>>());
            for index in 1..=count {
                let shard = Shard { index, count };
                assert!(shard.tasks(23).all(|t| shard.holds(t)));
            }
        }
    }

    #[test]
    fn reads_what_it_writes_and_refuses_the_rest() {
        assert_eq!(Shard::parse("3/4").map(|s| s.to_string()).as_deref(), Some("3/4"));
        for bad in ["0/4", "5/4", "1", "1/0", "a/b", "-1/3", "1/100001", ""] {
            assert_eq!(Shard::parse(bad), None, "{bad}");
        }
    }
}
