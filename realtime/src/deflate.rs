//! Histograms in encoding V2, deflated, with memory that is taken once.
//!
//! The serializer of the crate `hdrhistogram` makes a new compressor for each histogram, 350 kB every time: with twenty tags a
//! second, and lines that stay between them, the heap of a process whose memory is locked grew by megabytes, a stall at a time.
//!
//! ```text
//!   cookie (4 bytes) | length of what follows (4 bytes) | zlib stream of the V2 encoding
//! ```
//! # Source
//! `encodeIntoCompressedByteBuffer` of HdrHistogram's `AbstractHistogram.java`, encoding V2; numbers are big-endian.

use std::fmt;
use std::io::{self, Write};

use flate2::{Compress, Compression, FlushCompress, Status};
use hdrhistogram::{Counter, Histogram};

use hdrhistogram::serialization::{Serializer, V2Serializer};

use crate::histogram::{BOUND_NS, Recorder};

/// What a deflated histogram of encoding V2 begins with.
const COOKIE: u32 = 0x1c84_9304 | 0x10;
/// Bytes before the zlib stream.
const HEAD: usize = 8;
/// Bytes of an encoded histogram that nothing has to be taken for.
const ROOM: usize = 64 * 1024;

/// Encodes one histogram after the other.
pub(crate) struct DeflateSerializer {
    plain: V2Serializer,
    plain_bytes: Vec<u8>,
    compress: Compress,
    bytes: Vec<u8>,
}

impl DeflateSerializer {
    /// A serializer whose memory is taken: room for a recorder's largest value, and for more bins than a second can fill.
    pub(crate) fn new() -> Self {
        let mut serializer = Self {
            plain: V2Serializer::new(),
            plain_bytes: Vec::with_capacity(ROOM),
            compress: Compress::new(Compression::default(), true),
            bytes: Vec::with_capacity(ROOM),
        };
        let mut largest = Recorder::new();
        largest.record(BOUND_NS);
        // Into the sink goes everything; a histogram that cannot be encoded is reported when it is one of the run.
        let _ = serializer.serialize(largest.histogram(), &mut io::sink());
        serializer
    }
}

impl Serializer for DeflateSerializer {
    type SerializeError = io::Error;

    fn serialize<T: Counter, W: Write>(
        &mut self,
        histogram: &Histogram<T>,
        out: &mut W,
    ) -> io::Result<usize> {
        self.plain_bytes.clear();
        self.plain.serialize(histogram, &mut self.plain_bytes).map_err(io::Error::other)?;
        self.compress.reset();
        self.bytes.clear();
        self.bytes.extend([0; HEAD]);
        // Incompressible bytes grow by less than this [zlib's compressBound]: one call is enough.
        self.bytes.reserve(self.plain_bytes.len() + self.plain_bytes.len() / 1000 + 64);
        let status = self.compress.compress_vec(&self.plain_bytes, &mut self.bytes, FlushCompress::Finish)?;
        if status != Status::StreamEnd {
            return Err(io::Error::other("the compressor did not come to an end"));
        }
        let length = u32::try_from(self.bytes.len() - HEAD).map_err(io::Error::other)?;
        self.bytes[..4].copy_from_slice(&COOKIE.to_be_bytes());
        self.bytes[4..HEAD].copy_from_slice(&length.to_be_bytes());
        out.write_all(&self.bytes)?;
        Ok(self.bytes.len())
    }
}

impl fmt::Debug for DeflateSerializer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("DeflateSerializer").finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hdrhistogram::serialization::{Deserializer, V2DeflateSerializer};

    fn samples(seed: u64, count: u64) -> Recorder {
        let mut recorder = Recorder::new();
        let spread = |n: u64| (n.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(seed)) >> 34;
        (0..count).for_each(|n| recorder.record(spread(n)));
        recorder
    }

    #[test]
    fn one_after_the_other_they_are_read_by_the_crate_and_are_its_bytes() {
        let mut largest = Recorder::new();
        largest.record(BOUND_NS);
        let mut ours = DeflateSerializer::new();
        for recorder in [samples(1, 1000), samples(2, 0), samples(3, 100_000), largest, samples(4, 10)] {
            let (mut bytes, mut expected) = (Vec::new(), Vec::new());
            let length = ours.serialize(recorder.histogram(), &mut bytes).expect("encoded");
            V2DeflateSerializer::new().serialize(recorder.histogram(), &mut expected).expect("encoded");
            assert_eq!((length, &bytes), (bytes.len(), &expected));
            let read: Histogram<u64> =
                Deserializer::new().deserialize(&mut bytes.as_slice()).expect("decoded");
            assert_eq!(&read, recorder.histogram());
        }
    }

    #[test]
    fn no_second_makes_it_take_more_memory() {
        let mut largest = Recorder::new();
        largest.record(BOUND_NS);
        let mut ours = DeflateSerializer::new();
        let room = (ours.plain_bytes.capacity(), ours.bytes.capacity());
        for recorder in [samples(5, 10_000), largest] {
            ours.serialize(recorder.histogram(), &mut io::sink()).expect("encoded");
        }
        assert_eq!((ours.plain_bytes.capacity(), ours.bytes.capacity()), room);
    }
}
