//! Distributions of all segments: the histograms of their `.hlog` files added up by tag, so that percentiles of the soak are
//! those of all samples.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use hdrhistogram::Histogram;
use hdrhistogram::serialization::interval_log::{IntervalLogIterator, LogEntry};
use hdrhistogram::serialization::{Deserializer, Serializer, V2DeflateSerializer};
use latency::hlog::decode;
use realtime::{Recorder, write_hlog};
use runlog::process::Process;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::path::Path;
use std::time::Duration;

#[derive(Clone, Default)]
pub(super) struct MergedHistograms(BTreeMap<String, Histogram<u64>>);

/// A distribution in `soak.json`: percentiles, and the histogram from which a later start goes on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct StoredDistribution {
    /// Median, ns.
    pub p50_ns: u64,
    pub p90_ns: u64,
    pub p99_ns: u64,
    pub p999_ns: u64,
    pub p9999_ns: u64,
    pub max_ns: u64,
    pub count: u64,
    /// The histogram: HdrHistogram V2, deflated, in base64.
    pub hdr_v2_base64: String,
}

impl MergedHistograms {
    /// Adds the histograms of a segment's folder; returns the files that cannot be read.
    pub(super) fn add_segment(&mut self, folder: &Path) -> Vec<String> {
        let mut unread = Vec::new();
        let logs = Process::ALL.map(|process| folder.join(process.hlog()));
        for path in logs.into_iter().filter(|path| path.exists()) {
            if let Err(error) = self.add_log(&path) {
                unread.push(format!("{}: {error}", path.display()));
            }
        }
        unread
    }

    fn add_log(&mut self, path: &Path) -> io::Result<()> {
        let mut deserializer = Deserializer::new();
        let mut reader = BufReader::new(File::open(path)?);
        let mut line = Vec::new();
        // A killed process may leave an incomplete last line; the others are valid.
        while reader.read_until(b'\n', &mut line)? > 0 && line.ends_with(b"\n") {
            for entry in IntervalLogIterator::new(&line) {
                if let Ok(LogEntry::Interval(interval)) = entry {
                    let tag = interval.tag().map_or("", |tag| tag.as_str());
                    let histogram = decode(interval.encoded_histogram(), &mut deserializer);
                    self.add(tag, &histogram.map_err(io::Error::other)?)?;
                }
            }
            line.clear();
        }
        Ok(())
    }

    fn add(&mut self, tag: &str, more: &Histogram<u64>) -> io::Result<()> {
        let merged = self.0.entry(tag.to_owned()).or_insert_with(|| Recorder::new().histogram().clone());
        merged.add(more).map_err(io::Error::other)
    }

    /// Restores the distributions of an earlier start.
    pub(super) fn from_kept(kept: &BTreeMap<String, StoredDistribution>) -> io::Result<Self> {
        let mut merged = Self::default();
        for (tag, kept) in kept {
            let histogram = decode(&kept.hdr_v2_base64, &mut Deserializer::new());
            merged.add(tag, &histogram.map_err(io::Error::other)?)?;
        }
        Ok(merged)
    }

    /// The distributions for `soak.json`.
    ///
    /// # Errors
    /// A histogram that cannot be serialised; counts of ours never cause it.
    pub(super) fn keep(&self) -> io::Result<BTreeMap<String, StoredDistribution>> {
        self.0.iter().map(|(tag, histogram)| Ok((tag.clone(), kept(histogram)?))).collect()
    }

    /// Writes all distributions as one interval, to a temporary file that is renamed.
    pub(super) fn write(&self, path: &Path, started_unix_s: f64, length: Duration) -> io::Result<()> {
        let tagged = self.0.iter().filter(|(tag, _)| !tag.is_empty());
        let parts: Vec<_> = tagged.map(|(tag, histogram)| (tag.as_str(), histogram)).collect();
        let temporary = path.with_extension("hlog.part");
        write_hlog(&temporary, &parts, started_unix_s, length)?;
        std::fs::rename(&temporary, path)
    }
}

fn kept(histogram: &Histogram<u64>) -> io::Result<StoredDistribution> {
    let mut bytes = Vec::new();
    V2DeflateSerializer::new().serialize(histogram, &mut bytes).map_err(io::Error::other)?;
    Ok(StoredDistribution {
        p50_ns: histogram.value_at_quantile(0.5),
        p90_ns: histogram.value_at_quantile(0.9),
        p99_ns: histogram.value_at_quantile(0.99),
        p999_ns: histogram.value_at_quantile(0.999),
        p9999_ns: histogram.value_at_quantile(0.9999),
        max_ns: histogram.max(),
        count: histogram.len(),
        hdr_v2_base64: STANDARD.encode(bytes),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment(values_ns: &[u64]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let mut recorder = Recorder::new();
        values_ns.iter().for_each(|ns| recorder.record(*ns));
        let parts = [("emulator-wakeup", recorder.histogram())];
        write_hlog(&folder.path().join("emulator.hlog"), &parts, 1e9, Duration::from_secs(1)).unwrap();
        folder
    }

    #[test]
    fn segments_add_up_also_across_a_restart() {
        let (one, other) = (segment(&[1000; 98]), segment(&[5000, 70_000_000]));
        let mut merged = MergedHistograms::default();
        assert!(merged.add_segment(one.path()).is_empty());
        let mut merged = MergedHistograms::from_kept(&merged.keep().unwrap()).unwrap();
        assert!(merged.add_segment(other.path()).is_empty());
        let kept = &merged.keep().unwrap()["emulator-wakeup"];
        assert_eq!((kept.count, kept.p50_ns), (100, 1000));
        assert!((4995..=5005).contains(&kept.p99_ns) && kept.max_ns >= 70_000_000, "{kept:?}");
        let path = one.path().join("soak.hlog");
        merged.write(&path, 1e9, Duration::from_secs(2)).unwrap();
        let mut read = MergedHistograms::default();
        read.add_log(&path).unwrap();
        assert_eq!(read.keep().unwrap(), merged.keep().unwrap());
    }

    #[test]
    fn a_half_line_is_left_out_and_a_damaged_one_reported() {
        let folder = segment(&[1000]);
        let path = folder.path().join("emulator.hlog");
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, format!("{text}Tag=half,0.000,1.0")).unwrap();
        let mut merged = MergedHistograms::default();
        assert!(merged.add_segment(folder.path()).is_empty());
        assert_eq!(merged.keep().unwrap().len(), 1);
        std::fs::write(&path, text.replace("HIST", "hist")).unwrap();
        assert_eq!(merged.add_segment(folder.path()).len(), 1);
    }
}
