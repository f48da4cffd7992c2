//! The memory that an XCP client sees: values under virtual addresses, in regions; no memory of the process.
//!
//! ```text
//!   0x0001_0000  description: the A2L file, then the identification     bytes          read
//!   0x1000_0000  parameters of the axis's program                       double each    read, write
//!   0x2000_0000  controls: trigger buffer, parameter set                8 bytes each   read, write
//!   0x3000_0000  signals of the newest cycle                            4 bytes each   read, DAQ
//!   0x4000_0000  state of the trigger buffer                            4 bytes each   read, DAQ
//!   0x5000_0000  trigger buffer: cycles of the samples                  4 bytes each   read
//!   0x51…, 52…, 53…, 54…_0000  its channels                             double each    read
//! ```
//!
//! A transfer stays within a region. A value is written whole or not at all: the bytes of a packet that ends within a value are
//! kept until the next packet completes it, and any other write discards them. All values of a block are checked before the
//! first is stored. A change acts from the next cycle on. Reading and writing allocate nothing.

use crate::packet::Refusal;
use crate::signals::{COUNT, Format, SIGNALS};
use crate::trace::{self, CAPACITY, CHANNELS, CONTROLS, ControlValues, Controls, STATUS, Trace};
use axis_control::program::Variable;

/// First addresses of the regions.
pub(crate) const DESCRIPTION: u32 = 0x0001_0000;
pub(crate) const PARAMETERS: u32 = 0x1000_0000;
pub(crate) const CONTROL: u32 = 0x2000_0000;
pub(crate) const SIGNAL: u32 = 0x3000_0000;
pub(crate) const TRACE_STATUS: u32 = 0x4000_0000;
pub(crate) const TRACE_CYCLES: u32 = 0x5000_0000;
/// First address of the first channel; the others follow [`CHANNEL_STEP`] apart.
pub(crate) const TRACE_CHANNELS: u32 = 0x5100_0000;
pub(crate) const CHANNEL_STEP: u32 = 0x0100_0000;

/// Bytes from parameter to parameter, and from control to control.
pub(crate) const WIDE: u32 = 8;
/// Bytes from signal to signal.
pub(crate) const NARROW: u32 = 4;

/// Effects of a client's writes on the controller.
pub trait ParameterActions {
    /// Sets the parameter at `place` in the list of variables to `value`, which is within its range.
    fn set(&mut self, place: usize, value: f64);

    /// Begins to store the parameter set, `values` in the order of the variables; false when that is not possible now.
    fn store(&mut self, values: &[f64]) -> bool;

    /// Begins to load the stored parameter set; false when that is not possible now.
    fn load(&mut self) -> bool;
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Region {
    Description,
    Parameters,
    Controls,
    Signals,
    TraceStatus,
    TraceCycles,
    TraceChannel(usize),
}

/// The first bytes of a value that a later packet completes.
#[derive(Clone, Copy)]
struct PartialValue {
    next: u32,
    bytes: [u8; 8],
    count: usize,
}

/// Description, parameters, controls, signals and trigger buffer of an axis under their addresses.
#[derive(Clone)]
pub struct Image {
    pub(crate) description: Vec<u8>,
    variables: Vec<Variable>,
    parameters: Vec<f64>,
    controls: ControlValues,
    signals: [f64; COUNT],
    pub(crate) trace: Trace,
    partial: Option<PartialValue>,
}

impl Image {
    /// A memory for a program with these variables and values, before its first cycle.
    pub(crate) fn new(description: Vec<u8>, variables: Vec<Variable>, values: &[f64]) -> Self {
        Self {
            description,
            variables,
            parameters: values.to_vec(),
            controls: std::array::from_fn(|place| CONTROLS[place].default),
            signals: [0.0; COUNT],
            trace: Trace::default(),
            partial: None,
        }
    }

    /// Takes the signals of a cycle, and the parameters, which other clients may have changed.
    pub(crate) fn refresh(&mut self, cycle: u64, signals: &[f64; COUNT], parameters: &[f64]) {
        self.signals = *signals;
        self.parameters.copy_from_slice(parameters);
        self.trace.take(cycle, signals);
    }

    /// Values of the parameters, in the order of the variables.
    pub fn parameters(&self) -> &[f64] {
        &self.parameters
    }

    /// Discards the first bytes of a value that is not complete.
    pub(crate) fn forget(&mut self) {
        self.partial = None;
    }

    /// Reads the bytes from `address` on.
    ///
    /// # Errors
    /// [`Refusal::AccessDenied`] outside the regions, or beyond the end of one.
    pub(crate) fn read(&self, address: u32, into: &mut [u8]) -> Result<(), Refusal> {
        let (region, mut offset) = self.reach(address, into.len() as u32)?;
        if region == Region::Description {
            let from = offset as usize;
            into.copy_from_slice(&self.description[from..from + into.len()]);
            return Ok(());
        }
        let (_, width) = self.extent(region);
        let mut rest = into;
        while !rest.is_empty() {
            let bytes = self.value(region, (offset / width) as usize);
            let from = (offset % width) as usize;
            let count = rest.len().min(width as usize - from);
            let (now, later) = rest.split_at_mut(count);
            now.copy_from_slice(&bytes[from..from + count]);
            (rest, offset) = (later, offset + count as u32);
        }
        Ok(())
    }

    pub(crate) fn check_readable(&self, address: u32, count: u32) -> Result<(), Refusal> {
        self.reach(address, count).map(|_| ())
    }

    fn reach(&self, address: u32, count: u32) -> Result<(Region, u32), Refusal> {
        let (region, first) = region(address).ok_or(Refusal::AccessDenied)?;
        let offset = address - first;
        let end = offset.checked_add(count).ok_or(Refusal::AccessDenied)?;
        let (count, width) = self.extent(region);
        if end <= count * width { Ok((region, offset)) } else { Err(Refusal::AccessDenied) }
    }

    /// Number of values of a region, and bytes of each.
    fn extent(&self, region: Region) -> (u32, u32) {
        match region {
            Region::Description => (self.description.len() as u32, 1),
            Region::Parameters => (self.parameters.len() as u32, WIDE),
            Region::Controls => (CONTROLS.len() as u32, WIDE),
            Region::Signals => (COUNT as u32, NARROW),
            Region::TraceStatus => (STATUS.len() as u32, NARROW),
            Region::TraceCycles => (CAPACITY as u32, NARROW),
            Region::TraceChannel(_) => (CAPACITY as u32, WIDE),
        }
    }

    /// A value of a region as it lies in memory.
    fn value(&self, region: Region, place: usize) -> [u8; 8] {
        let long = |count: u32| Format::Long.encode(f64::from(count));
        match region {
            Region::Description => [0; 8],
            Region::Parameters => Format::Double.encode(self.parameters[place]),
            Region::Controls if place == Controls::arm => long(u32::from(self.trace.runs())),
            Region::Controls => trace::control_format(place).encode(self.controls[place]),
            Region::Signals => SIGNALS[place].format.encode(self.signals[place]),
            Region::TraceStatus => long(self.trace.reported()[place]),
            Region::TraceCycles => long(self.trace.cycle(place)),
            Region::TraceChannel(channel) => Format::Double.encode(self.trace.value(channel, place)),
        }
    }

    /// Writes the bytes from `address` on; `actions` gets every value that changed.
    ///
    /// # Errors
    /// [`Refusal::AccessDenied`] outside the regions; [`Refusal::WriteProtected`] for a region that is only read, and for a
    /// parameter that is fixed at the start; [`Refusal::OutOfRange`] for a value outside its parameter's range;
    /// [`Refusal::Sequence`] for the rest of a value without its first bytes, and for arming with a pre-trigger as long as the
    /// buffer. No value of the block is stored then.
    pub(crate) fn write(
        &mut self,
        address: u32,
        bytes: &[u8],
        actions: &mut dyn ParameterActions,
    ) -> Result<(), Refusal> {
        let partial = self.partial.take().filter(|partial| partial.next == address);
        let (region, offset) = self.reach(address, bytes.len() as u32)?;
        if !matches!(region, Region::Parameters | Region::Controls) {
            return Err(Refusal::WriteProtected);
        }
        if !offset.is_multiple_of(WIDE) && partial.is_none() {
            return Err(Refusal::Sequence);
        }
        let mut controls = self.controls;
        // First pass: check all; second pass: store all.
        let mut rest = None;
        for take in [false, true] {
            // A load may find its queue full, so that it comes before anything is stored.
            if take && controls[Controls::load_set] != 0.0 && !actions.load() {
                return Err(Refusal::Busy);
            }
            let mut value = partial.unwrap_or(PartialValue { next: address, bytes: [0; 8], count: 0 });
            for (byte, at) in bytes.iter().zip(offset..) {
                value.bytes[value.count] = *byte;
                value.count += 1;
                value.next += 1;
                let place = (at / WIDE) as usize;
                // A count has the first four bytes of its place; the other four are padding.
                if value.count == self.value_bytes(region, place) {
                    if take {
                        self.take(region, place, value.bytes, actions)?;
                    } else {
                        self.check(region, place, value.bytes, &mut controls)?;
                    }
                }
                if value.count == WIDE as usize {
                    value = PartialValue { bytes: [0; 8], count: 0, ..value };
                }
            }
            rest = Some(value).filter(|value| value.count > 0);
        }
        self.partial = rest;
        Ok(())
    }

    /// Bytes of a place without padding.
    fn value_bytes(&self, region: Region, place: usize) -> usize {
        match region {
            Region::Controls => trace::control_format(place).bytes(),
            _ => WIDE as usize,
        }
    }

    fn check(
        &self,
        region: Region,
        place: usize,
        bytes: [u8; 8],
        controls: &mut ControlValues,
    ) -> Result<(), Refusal> {
        let (parameter, format) = match region {
            Region::Parameters => (&self.variables[place].parameter, Format::Double),
            _ => (&CONTROLS[place], trace::control_format(place)),
        };
        let value = format.decode(bytes);
        if parameter.at_start_only && region == Region::Parameters && value != self.parameters[place] {
            return Err(Refusal::WriteProtected);
        }
        if !parameter.allows(value) {
            return Err(Refusal::OutOfRange);
        }
        if region == Region::Controls {
            controls[place] = value;
            if place == Controls::arm && value != 0.0 && !Trace::can_arm(&Controls::of(controls)) {
                return Err(Refusal::Sequence);
            }
        }
        Ok(())
    }

    fn take(
        &mut self,
        region: Region,
        place: usize,
        bytes: [u8; 8],
        actions: &mut dyn ParameterActions,
    ) -> Result<(), Refusal> {
        if region == Region::Parameters {
            let value = Format::Double.decode(bytes);
            // An equal value is no change, and is not passed on.
            if value.to_bits() != self.parameters[place].to_bits() {
                self.parameters[place] = value;
                actions.set(place, value);
            }
            return Ok(());
        }
        let value = trace::control_format(place).decode(bytes);
        match place {
            Controls::arm if value == 0.0 => self.trace.disarm(),
            Controls::arm => self.trace.arm(&Controls::of(&self.controls)),
            Controls::load_set => {}
            _ => self.controls[place] = value,
        }
        Ok(())
    }
}

/// The region that an address lies in, and where it begins.
fn region(address: u32) -> Option<(Region, u32)> {
    let channel = |channel: usize| TRACE_CHANNELS + CHANNEL_STEP * channel as u32;
    match address >> 24 {
        0x00 if address >= DESCRIPTION => Some((Region::Description, DESCRIPTION)),
        0x10 => Some((Region::Parameters, PARAMETERS)),
        0x20 => Some((Region::Controls, CONTROL)),
        0x30 => Some((Region::Signals, SIGNAL)),
        0x40 => Some((Region::TraceStatus, TRACE_STATUS)),
        0x50 => Some((Region::TraceCycles, TRACE_CYCLES)),
        high => {
            let number = (high as usize).checked_sub(0x51).filter(|number| *number < CHANNELS)?;
            Some((Region::TraceChannel(number), channel(number)))
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use settings::parameters::{Parameter, declare};

    #[derive(Default)]
    pub(crate) struct ActionLog {
        pub(crate) set: Vec<(usize, f64)>,
        pub(crate) stored: Vec<Vec<f64>>,
        pub(crate) loads: usize,
        pub(crate) is_busy: bool,
    }

    impl ParameterActions for ActionLog {
        fn set(&mut self, place: usize, value: f64) {
            self.set.push((place, value));
        }

        fn store(&mut self, values: &[f64]) -> bool {
            self.stored.push(values.to_vec());
            self.stored.len() == 1
        }

        fn load(&mut self) -> bool {
            self.loads += usize::from(!self.is_busy);
            !self.is_busy
        }
    }

    pub(crate) fn image() -> Image {
        let variable = |name: &'static str, parameter: Parameter| Variable { name: name.into(), parameter };
        let gain = Parameter::new(("gain_per_s", "1/s"), [0.0, 200.0], 25.0, "gain");
        let every = Parameter::new(("every_cycles", "cycles"), [1.0, 1000.0], 1.0, "multiple").whole();
        let timeout =
            Parameter::declared("timeout_s", declare("s", [0.1, 60.0], 15.0, "how long").at_start_only());
        let variables = vec![
            variable("a.gain_per_s", gain),
            variable("a.every_cycles", every),
            variable("b.timeout_s", timeout),
        ];
        Image::new(b"description".to_vec(), variables, &[25.0, 1.0, 15.0])
    }

    fn read<const N: usize>(image: &Image, address: u32) -> [u8; N] {
        let mut bytes = [0; N];
        image.read(address, &mut bytes).unwrap();
        bytes
    }

    #[test]
    fn a_value_is_read_as_it_is_in_pieces_of_any_size() {
        let image = image();
        let whole: [u8; 24] = read(&image, PARAMETERS);
        assert_eq!(whole[..8], 25.0_f64.to_le_bytes());
        for from in 0..24 {
            for to in from..24 {
                let mut piece = vec![0; to - from];
                image.read(PARAMETERS + from as u32, &mut piece).unwrap();
                assert_eq!(piece, whole[from..to], "{from} to {to}");
            }
        }
        assert_eq!(read::<4>(&image, DESCRIPTION + 2), *b"scri");
    }

    #[test]
    fn nothing_is_read_beyond_a_region_nor_where_none_is() {
        let image = image();
        for (address, count) in [
            (0, 1),
            (DESCRIPTION - 1, 1),
            (DESCRIPTION + 8, 4),
            (PARAMETERS + 20, 5),
            (CONTROL + CONTROLS.len() as u32 * 8, 1),
            (SIGNAL + COUNT as u32 * 4 - 1, 2),
            (TRACE_CYCLES + CAPACITY as u32 * 4, 1),
            (TRACE_CHANNELS + 4 * CHANNEL_STEP, 1),
            (u32::MAX, 1),
            (PARAMETERS - 1, 2),
        ] {
            let mut bytes = vec![0; count];
            assert_eq!(image.read(address, &mut bytes), Err(Refusal::AccessDenied), "{address:#x} + {count}");
        }
    }

    #[test]
    fn a_value_is_taken_when_its_last_byte_is_there() {
        let value = 30.5_f64.to_le_bytes();
        for cut in 1..=8 {
            let (mut image, mut log) = (image(), ActionLog::default());
            image.write(PARAMETERS, &value[..cut], &mut log).unwrap();
            if cut < 8 {
                assert!(log.set.is_empty(), "{cut} bytes are no value");
                assert_eq!(read::<8>(&image, PARAMETERS), 25.0_f64.to_le_bytes());
                image.write(PARAMETERS + cut as u32, &value[cut..], &mut log).unwrap();
            }
            assert_eq!(log.set, [(0, 30.5)], "cut at {cut}");
            assert_eq!(read::<8>(&image, PARAMETERS), value);
        }
    }

    #[test]
    fn a_block_whose_load_finds_a_full_queue_changes_nothing() {
        let (mut image, mut log) = (image(), ActionLog { is_busy: true, ..ActionLog::default() });
        let channel_4 = CONTROL + WIDE * Controls::channel_4 as u32;
        let block: Vec<u8> = [3_u64, 0, 1].iter().flat_map(|value| value.to_le_bytes()).collect();
        assert_eq!(image.write(channel_4, &block, &mut log), Err(Refusal::Busy));
        assert_eq!(read::<4>(&image, channel_4), 17_u32.to_le_bytes());
        log.is_busy = false;
        image.write(channel_4, &block, &mut log).unwrap();
        assert_eq!((read::<4>(&image, channel_4), log.loads), (3_u32.to_le_bytes(), 1));
    }

    #[test]
    fn the_rest_of_a_value_that_nobody_began_is_refused() {
        let (mut image, mut log) = (image(), ActionLog::default());
        assert_eq!(image.write(PARAMETERS + 4, &[0; 4], &mut log), Err(Refusal::Sequence));
        image.write(PARAMETERS, &[0; 6], &mut log).unwrap();
        image.write(PARAMETERS + 8, &[0; 4], &mut log).unwrap();
        assert_eq!(image.write(PARAMETERS + 6, &[0; 2], &mut log), Err(Refusal::Sequence));
        assert!(log.set.is_empty());
    }

    #[test]
    fn every_value_of_a_block_is_checked_before_the_first_is_taken() {
        let bytes = |values: [f64; 3]| values.map(f64::to_le_bytes).concat();
        for (values, refusal) in [
            ([200.1, 2.0, 15.0], Refusal::OutOfRange),
            ([30.0, 2.5, 15.0], Refusal::OutOfRange),
            ([f64::NAN, 2.0, 15.0], Refusal::OutOfRange),
            ([30.0, f64::INFINITY, 15.0], Refusal::OutOfRange),
            ([30.0, 2.0, 16.0], Refusal::WriteProtected),
        ] {
            let (mut image, mut log) = (image(), ActionLog::default());
            assert_eq!(image.write(PARAMETERS, &bytes(values), &mut log), Err(refusal), "{values:?}");
            assert!(log.set.is_empty(), "{values:?}");
            assert_eq!(image.parameters(), [25.0, 1.0, 15.0]);
        }
        let (mut image, mut log) = (image(), ActionLog::default());
        image.write(PARAMETERS, &bytes([30.0, 2.0, 15.0]), &mut log).unwrap();
        assert_eq!(log.set, [(0, 30.0), (1, 2.0)], "what stays the same is no change");
    }

    #[test]
    fn signals_and_the_description_cannot_be_written() {
        let (mut image, mut log) = (image(), ActionLog::default());
        for address in [DESCRIPTION, SIGNAL, TRACE_STATUS, TRACE_CYCLES, TRACE_CHANNELS] {
            assert_eq!(image.write(address, &[1], &mut log), Err(Refusal::WriteProtected), "{address:#x}");
        }
        assert_eq!(image.write(0x6000_0000, &[1], &mut log), Err(Refusal::AccessDenied));
    }

    #[test]
    fn the_trigger_buffer_is_armed_with_what_was_written() {
        let (mut image, mut log) = (image(), ActionLog::default());
        let mut put = |image: &mut Image, place: usize, value: u32| {
            image.write(CONTROL + place as u32 * WIDE, &value.to_le_bytes(), &mut log)
        };
        put(&mut image, Controls::length_samples, 4).unwrap();
        put(&mut image, Controls::pre_trigger_samples, 4).unwrap();
        assert_eq!(put(&mut image, Controls::arm, 1), Err(Refusal::Sequence), "no room for the trigger");
        put(&mut image, Controls::pre_trigger_samples, 1).unwrap();
        put(&mut image, Controls::slope, 3).unwrap();
        put(&mut image, Controls::arm, 1).unwrap();
        assert_eq!(read::<4>(&image, CONTROL + Controls::arm as u32 * WIDE), 1_u32.to_le_bytes());
        for cycle in 100..110 {
            image.refresh(cycle, &[cycle as f64; COUNT], &[25.0, 1.0, 15.0]);
        }
        assert_eq!(read::<4>(&image, CONTROL + Controls::arm as u32 * WIDE), 0_u32.to_le_bytes());
        assert_eq!(read::<8>(&image, TRACE_STATUS), [4, 0, 0, 0, 4, 0, 0, 0]);
        assert_eq!(read::<4>(&image, TRACE_CYCLES + 8), 102_u32.to_le_bytes());
        assert_eq!(read::<8>(&image, TRACE_CHANNELS + CHANNEL_STEP + 16), 102.0_f64.to_le_bytes());
    }
}
