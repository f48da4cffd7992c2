//! What the generated lists of `payloads.rs` and `messages.rs` expand to: an enum for each value table, a struct for each
//! payload, and [`Frame`](super::Frame).
//!
//! Each signal knows its place in the message as a constant, so encode and decode are straight lines without a loop.

use super::{DecodeError, EncodeError, MessageSpec};

/// The Rust type of one signal; `index` is the signal's place in the message.
pub(super) trait Field: Copy {
    /// Its bits in the data word.
    fn put(self, message: &'static MessageSpec, index: usize) -> Result<u64, EncodeError>;
    fn take(message: &'static MessageSpec, index: usize, word: u64) -> Result<Self, DecodeError>;
    fn to_f64(self) -> f64;
    /// `None` when the type does not hold the value.
    fn from_f64(value: f64) -> Option<Self>;
}

impl Field for f64 {
    fn put(self, message: &'static MessageSpec, index: usize) -> Result<u64, EncodeError> {
        let signal = &message.signals[index];
        if !self.is_finite() {
            return Err(EncodeError::NotFinite { message, signal, value: self });
        }
        // Far below half a step, so a value that passes rounds into the range; the same figure as in cantools.
        let tolerance = signal.factor * 1e-6;
        if self < signal.min - tolerance || self > signal.max + tolerance {
            return Err(EncodeError::OutOfRange { message, signal, value: self });
        }
        let raw = ((self - signal.offset) / signal.factor).round_ties_even() as i64;
        Ok(signal.place(raw))
    }

    fn take(message: &'static MessageSpec, index: usize, word: u64) -> Result<Self, DecodeError> {
        Ok(message.signals[index].physical(counts(message, index, word)?))
    }

    fn to_f64(self) -> f64 {
        self
    }

    fn from_f64(value: f64) -> Option<Self> {
        Some(value)
    }
}

impl Field for bool {
    fn put(self, message: &'static MessageSpec, index: usize) -> Result<u64, EncodeError> {
        put_counts(message, index, i64::from(self))
    }

    fn take(message: &'static MessageSpec, index: usize, word: u64) -> Result<Self, DecodeError> {
        Ok(counts(message, index, word)? != 0)
    }

    fn to_f64(self) -> f64 {
        f64::from(self)
    }

    fn from_f64(value: f64) -> Option<Self> {
        exact::<u8>(value).filter(|bit| *bit < 2).map(|bit| bit != 0)
    }
}

macro_rules! integer_fields {
    ($($kind:ident)*) => {$(
        impl Field for $kind {
            fn put(self, message: &'static MessageSpec, index: usize) -> Result<u64, EncodeError> {
                put_counts(message, index, i64::from(self))
            }

            fn take(message: &'static MessageSpec, index: usize, word: u64) -> Result<Self, DecodeError> {
                Ok(counts(message, index, word)? as $kind)
            }

            fn to_f64(self) -> f64 {
                f64::from(self)
            }

            fn from_f64(value: f64) -> Option<Self> {
                exact(value)
            }
        }
    )*};
}
integer_fields!(u8 u16 u32 i8 i16 i32);

/// `raw` in its bits, after its range was checked.
pub(super) fn put_counts(message: &'static MessageSpec, index: usize, raw: i64) -> Result<u64, EncodeError> {
    let signal = &message.signals[index];
    if !signal.allows(raw) {
        return Err(EncodeError::OutOfRange { message, signal, value: raw as f64 });
    }
    Ok(signal.place(raw))
}

fn counts(message: &'static MessageSpec, index: usize, word: u64) -> Result<i64, DecodeError> {
    let signal = &message.signals[index];
    let raw = signal.raw(word);
    if signal.allows(raw) {
        return Ok(raw);
    }
    let (min, max) = (signal.raw_min, signal.raw_max);
    Err(DecodeError::RawOutOfRange { message: message.name, signal: signal.name, raw, min, max })
}

/// `value` as an integer, when it is one and fits.
pub(super) fn exact<T: TryFrom<i64>>(value: f64) -> Option<T> {
    let integer = value as i64;
    (integer as f64 == value).then(|| T::try_from(integer).ok()).flatten()
}

/// The enum of a value table, from `raw Variant "name in the table"`.
macro_rules! value_table {
    ($name:ident { 0 $zero:ident $zero_text:literal, $($raw:literal $variant:ident $text:literal,)* }) => {
        #[doc = concat!("Value table `", stringify!($name), "` of `rig.dbc`.")]
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
        #[repr(u8)]
        pub enum $name {
            #[doc = concat!("0: ", $zero_text, ".")]
            #[default]
            $zero = 0,
            $(#[doc = concat!($raw, ": ", $text, ".")] $variant = $raw,)*
        }

        impl $name {
            /// The value that crosses the wire as `raw`; `None` when the table does not hold it.
            #[must_use]
            pub const fn from_raw(raw: u8) -> Option<Self> {
                match raw {
                    0 => Some(Self::$zero),
                    $($raw => Some(Self::$variant),)*
                    _ => None,
                }
            }

            /// The counts that cross the wire.
            #[must_use]
            pub const fn raw(self) -> u8 {
                self as u8
            }

            /// The name in the value table.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    Self::$zero => $zero_text,
                    $(Self::$variant => $text,)*
                }
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(self.name())
            }
        }

        impl Field for $name {
            fn put(self, message: &'static MessageSpec, index: usize) -> Result<u64, EncodeError> {
                put_counts(message, index, i64::from(self.raw()))
            }

            fn take(message: &'static MessageSpec, index: usize, word: u64) -> Result<Self, DecodeError> {
                let signal = &message.signals[index];
                let raw = signal.raw(word);
                Self::from_raw(raw as u8).ok_or(DecodeError::NotInValueTable {
                    message: message.name,
                    signal: signal.name,
                    raw,
                    max: signal.raw_max,
                })
            }

            fn to_f64(self) -> f64 {
                f64::from(self.raw())
            }

            fn from_f64(value: f64) -> Option<Self> {
                Self::from_raw(exact(value)?)
            }
        }
    };
}
pub(super) use value_table;

/// The struct of a payload, from `index field: type { rest of its SignalSpec }` for each signal.
macro_rules! payload {
    ($(#[$doc:meta])* $name:ident { $(
        $(#[$field_doc:meta])* $index:literal $field:ident: $kind:ty { $($spec:tt)* },
    )* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        pub struct $name {
            $($(#[$field_doc])* pub $field: $kind,)*
        }

        impl $name {
            /// The signals of a message that carries it, given who listens to each.
            pub(super) const fn signals(
                receivers: [&'static [&'static str]; [$($index),*].len()],
            ) -> [SignalSpec; [$($index),*].len()] {
                [$(SignalSpec { field: stringify!($field), receivers: receivers[$index], $($spec)* },)*]
            }

            pub(super) fn pack(&self, message: &'static MessageSpec) -> Result<u64, EncodeError> {
                let mut word = 0;
                $(word |= self.$field.put(message, $index)?;)*
                Ok(word)
            }

            pub(super) fn unpack(message: &'static MessageSpec, word: u64) -> Result<Self, DecodeError> {
                Ok(Self { $($field: Field::take(message, $index, word)?,)* })
            }

            pub(super) fn visit(&self, message: &'static MessageSpec, visit: &mut impl FnMut(&'static SignalSpec, f64)) {
                $(visit(&message.signals[$index], self.$field.to_f64());)*
            }

            pub(super) fn from_values(values: &[f64]) -> Option<Self> {
                let &[$($field,)*] = values else { return None };
                Some(Self { $($field: Field::from_f64($field)?,)* })
            }
        }
    };
}
pub(super) use payload;

/// The bytes of a payload that is nothing else.
macro_rules! plain_bytes {
    ($name:ident: $count:literal, $($byte:ident)*) => {
        impl $name {
            /// The payload from its bytes in the order of the wire.
            #[must_use]
            pub const fn from_bytes(bytes: [u8; $count]) -> Self {
                let [$($byte,)*] = bytes;
                Self { $($byte,)* }
            }

            /// The bytes in the order of the wire.
            #[must_use]
            pub const fn to_bytes(self) -> [u8; $count] {
                [$(self.$byte,)*]
            }
        }
    };
}
pub(super) use plain_bytes;

/// `Frame`, `MESSAGES` and their constants: `identifier Variant(Payload) CONSTANT { rest of its MessageSpec }` for each message.
macro_rules! frames {
    (
        $(#[$doc:meta])*
        pub enum Frame {
            $($(#[$message_doc:meta])* $id:literal $name:ident($payload:ident) $message:ident { $($spec:tt)* },)*
        }
    ) => {
        $($(#[$message_doc])*
        pub const $message: &MessageSpec = &MessageSpec { name: stringify!($name), id: $id, $($spec)* };)*

        /// Every message of `rig.dbc`, by identifier.
        pub const MESSAGES: &[&MessageSpec] = &[$($message,)*];

        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum Frame {
            $($(#[$message_doc])* $name($payload),)*
        }

        impl Frame {
            /// The message's entry in [`MESSAGES`].
            #[must_use]
            pub const fn spec(&self) -> &'static MessageSpec {
                match self {
                    $(Self::$name(_) => $message,)*
                }
            }

            pub(super) fn pack(&self) -> Result<u64, EncodeError> {
                match self {
                    $(Self::$name(payload) => payload.pack($message),)*
                }
            }

            /// The frame that `frame` carries.
            ///
            /// # Errors
            /// [`DecodeError`] names message, signal and raw value of the first thing that `rig.dbc` does not allow.
            pub fn decode(frame: &CanFrame) -> Result<Self, DecodeError> {
                let id = frame.standard_id().ok_or(DecodeError::NotPlainData { raw_id: frame.raw_id() })?;
                Ok(match id {
                    $($id => Self::$name($payload::unpack($message, open($message, frame)?)?),)*
                    _ => return Err(DecodeError::UnknownIdentifier { id }),
                })
            }

            /// Calls `visit` with each signal and its value, in the order of [`MessageSpec::signals`]; flags are 0 and 1,
            /// values of a table their counts.
            pub fn for_each_signal(&self, mut visit: impl FnMut(&'static SignalSpec, f64)) {
                match self {
                    $(Self::$name(payload) => payload.visit($message, &mut visit),)*
                }
            }

            /// The frame with identifier `id` and one value for each signal, in the order of [`MessageSpec::signals`].
            ///
            /// `None` when there is no such message, the number of values differs, or a value does not fit the Rust type of its
            /// field (which for integers may be wider than the signal: [`Frame::encode`] checks the range).
            #[must_use]
            pub fn from_values(id: u16, values: &[f64]) -> Option<Self> {
                match id {
                    $($id => Some(Self::$name($payload::from_values(values)?)),)*
                    _ => None,
                }
            }
        }
    };
}
pub(super) use frames;
