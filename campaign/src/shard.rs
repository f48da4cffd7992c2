//! The share of a campaign that one start makes: `--shard i/n`, or the index that a batch system provides.

use std::fmt;
use std::str::FromStr;

/// One of several starts that share a campaign.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Shard {
    pub index: u32,
    pub count: u32,
}

#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(crate) enum ShardError {
    #[error(
        "shard '{0}': write INDEX/COUNT with INDEX from 0 and below COUNT, as 0/4, or COUNT alone where a batch system gives the index"
    )]
    Form(String),
    #[error(
        "--shard {count}: which one? write INDEX/{count}, or start it as an array of Slurm or an indexed job of Kubernetes ({names})"
    )]
    NoIndex {
        count: u32,
        /// Environment variables that may hold the index.
        names: String,
    },
    #[error(
        "{name}={value}: allowed is 0 to {most} with --shard {count}; an array of Slurm begins at 0 with --array=0-{most}"
    )]
    Index { name: &'static str, value: String, count: u32, most: u32 },
}

/// Environment variables with the index: arrays of Slurm, indexed jobs of Kubernetes.
pub(crate) const INDEX_VARIABLES: [&str; 2] = ["SLURM_ARRAY_TASK_ID", "JOB_COMPLETION_INDEX"];

/// Value of `--shard`; without an index that of the batch system is used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ShardArgument {
    index: Option<u32>,
    count: u32,
}

impl Shard {
    pub(crate) const WHOLE: Shard = Shard { index: 0, count: 1 };

    /// Whether the part of this number belongs to this shard.
    pub(crate) fn holds(self, part: u64) -> bool {
        part % u64::from(self.count) == u64::from(self.index)
    }
}

impl ShardArgument {
    /// The shard, with the index of the batch system where none was given; `variable` reads an environment variable.
    pub(crate) fn shard(self, variable: impl Fn(&str) -> Option<String>) -> Result<Shard, ShardError> {
        let count = self.count;
        if let Some(index) = self.index {
            return Ok(Shard { index, count });
        }
        let reported = INDEX_VARIABLES.into_iter().find_map(|name| Some((name, variable(name)?)));
        let (name, value) =
            reported.ok_or_else(|| ShardError::NoIndex { count, names: INDEX_VARIABLES.join(", ") })?;
        match value.parse() {
            Ok(index) if index < count => Ok(Shard { index, count }),
            _ => Err(ShardError::Index { name, value, count, most: count - 1 }),
        }
    }
}

impl FromStr for ShardArgument {
    type Err = ShardError;

    fn from_str(text: &str) -> Result<Self, ShardError> {
        let bad = || ShardError::Form(text.to_owned());
        let (index, count) = match text.split_once('/') {
            Some((index, count)) => (Some(index.parse().map_err(|_| bad())?), count),
            None => (None, text),
        };
        let count = count.parse().map_err(|_| bad())?;
        if count == 0 || index.is_some_and(|index| index >= count) {
            Err(bad())
        } else {
            Ok(ShardArgument { index, count })
        }
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}/{}", self.index, self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shard(text: &str, variable: Option<(&str, &str)>) -> Result<Shard, ShardError> {
        let reported =
            |name: &str| variable.filter(|(key, _)| *key == name).map(|(_, value)| value.to_owned());
        text.parse::<ShardArgument>()?.shard(reported)
    }

    #[test]
    fn every_part_is_of_exactly_one_shard() {
        for count in 1..8 {
            for part in 0..100 {
                let holders = (0..count).filter(|index| Shard { index: *index, count }.holds(part)).count();
                assert_eq!(holders, 1, "part {part} of {count} shards");
            }
        }
    }

    #[test]
    fn the_index_is_written_or_given_by_the_batch_system() {
        let third = Ok(Shard { index: 2, count: 5 });
        assert_eq!(shard("2/5", None), third);
        assert_eq!(shard("5", Some(("SLURM_ARRAY_TASK_ID", "2"))), third);
        assert_eq!(shard("5", Some(("JOB_COMPLETION_INDEX", "2"))), third);
        assert_eq!(shard("2/5", Some(("SLURM_ARRAY_TASK_ID", "4"))), third, "what is written counts");
    }

    #[test]
    fn a_bad_shard_is_refused_with_what_would_be_one() {
        for bad in ["", "5/5", "-1/2", "0/0", "0", "a/b", "1/2/3"] {
            assert!(shard(bad, None).unwrap_err().to_string().contains("INDEX/COUNT"), "{bad}");
        }
        assert!(shard("4", None).unwrap_err().to_string().contains("SLURM_ARRAY_TASK_ID"));
        let beyond = shard("4", Some(("SLURM_ARRAY_TASK_ID", "4"))).unwrap_err().to_string();
        assert!(beyond.contains("0 to 3"), "{beyond}");
    }
}
