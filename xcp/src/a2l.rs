//! The A2L file of an axis, generated from the tables that define its parameters, controls and signals.
//!
//! What is the same for every program stands in `frame.a2l`: the protocol's numbers and their A2ML. Names are those of files
//! with the axis in front, `drive.algorithm.gain_per_s`; what A2L allows in no name becomes `_`.
//!
//! Source: ASAM MCD-2 MC 1.7.1.

use crate::daq::{LISTS, LONGEST_ENTRY};
use crate::image::{
    CHANNEL_STEP, CONTROL, DESCRIPTION, NARROW, PARAMETERS, SIGNAL, TRACE_CHANNELS, TRACE_CYCLES,
    TRACE_STATUS, WIDE,
};
use crate::signals::{Format, SIGNALS};
use crate::slave::{BLOCK_PACKETS, TextLocations};
use crate::trace::{self, CAPACITY, CHANNELS, CONTROLS, Controls, STATUS};
use crate::{EVENT_NAME, identifiers};
use a2lfile::{
    A2lObjectName, AddrType, Characteristic, CharacteristicType, CompuMethod, CompuTabRef, CompuVtab,
    ConversionType, DataType, EcuAddress, FncValues, Group, IndexMode, MatrixDim, Measurement, Module,
    ReadOnly, RecordLayout, RefCharacteristic, RefMeasurement, Root, ValuePairsStruct,
};
use axis_control::program::Variable;
use crc::{CRC_32_ISO_HDLC, Crc};
use nominal::Axis;
use protocol::frames::BIT_RATE_PER_S;
use settings::parameters::Parameter;

/// The controller that an A2L file describes.
pub struct AxisDescription<'a> {
    /// The axis that it controls.
    pub axis: Axis,
    /// Title of its program; quotes and control characters become `'` in the file.
    pub title: &'a str,
    /// Variables of its program, in the program's order.
    pub variables: &'a [Variable],
}

/// Content of the description region of an XCP image.
pub(crate) struct Description {
    pub bytes: Vec<u8>,
    pub texts: TextLocations,
}

/// An A2L file that the library rejects. The tables are ours, so this is a bug; the message holds the library's reason.
#[derive(Debug, thiserror::Error)]
#[error("the A2L file of the {axis} axis cannot be made: {reason}")]
pub struct A2lError {
    axis: &'static str,
    reason: String,
}

/// Identification of axis, program and tables (EPK): an A2L file with another EPK does not fit the controller.
pub(crate) fn epk(described: &AxisDescription<'_>) -> String {
    let crc = Crc::<u32>::new(&CRC_32_ISO_HDLC);
    let mut digest = crc.digest();
    let mut note = |name: &str, parameter: &Parameter| {
        let Parameter { unit, least, most, at_start_only, whole, .. } = parameter;
        digest.update(format!("{name} {unit} {least} {most} {at_start_only} {whole}\n").as_bytes());
    };
    described.variables.iter().for_each(|variable| note(&variable.name, &variable.parameter));
    CONTROLS.iter().for_each(|control| note(&control.name, control));
    SIGNALS.iter().for_each(|signal| note(&signal.about.name, &signal.about));
    let sum = digest.finalize();
    format!("airbench {} {} {sum:08X}", env!("CARGO_PKG_VERSION"), described.axis.name())
}

/// Name of the A2L file in the run's folder.
pub fn file_name(axis: Axis) -> String {
    format!("controller-{}.a2l", axis.name())
}

/// A2L file, its name, EPK and event name in one block of bytes, and where each lies in it.
pub(crate) fn description(described: &AxisDescription<'_>) -> Result<Description, A2lError> {
    let mut bytes = Vec::new();
    let mut place = |text: &str| {
        let at = bytes.len() as u32;
        bytes.extend_from_slice(text.as_bytes());
        (at, text.len() as u32)
    };
    let texts = TextLocations {
        epk: place(&epk(described)),
        event: place(EVENT_NAME),
        file: place(&file_name(described.axis)),
        a2l: place(&text(described)?),
    };
    Ok(Description { bytes, texts })
}

/// The text of the A2L file of an axis.
///
/// # Errors
/// [`A2lError`] when the library rejects what the tables say: a bug.
pub fn text(described: &AxisDescription<'_>) -> Result<String, A2lError> {
    let error = |reason: String| A2lError { axis: described.axis.name(), reason };
    let (mut file, warnings) =
        a2lfile::load_from_string(&frame(described), None, true).map_err(|what| error(what.to_string()))?;
    let module = &mut file.project.module[0];
    let mut builder = A2lBuilder { module, axis: described.axis.name(), parts: Vec::new() };
    builder.record_layouts();
    builder.parameters(described.variables);
    builder.controls();
    builder.signals();
    builder.trace();
    builder.groups();
    if let Some(problem) = warnings.into_iter().chain(file.check()).next() {
        return Err(error(problem.to_string()));
    }
    Ok(file.write_to_string())
}

fn frame(described: &AxisDescription<'_>) -> String {
    let (master, slave) = identifiers(described.axis);
    let hex = |number: u32| format!("{number:#X}").replacen("0X", "0x", 1);
    // A text in quotes may hold anything but a quote and the end of its line.
    let title: String =
        described.title.chars().map(|c| if c == '"' || c.is_control() { '\'' } else { c }).collect();
    [
        ("@AXIS@", described.axis.name().to_owned()),
        ("@TITLE@", title),
        ("@EPK_ADDRESS@", hex(DESCRIPTION)),
        ("@EPK@", epk(described)),
        ("@BLOCK_PACKETS@", BLOCK_PACKETS.to_string()),
        ("@LISTS@", LISTS.to_string()),
        ("@LONGEST_ENTRY@", LONGEST_ENTRY.to_string()),
        ("@EVENT@", EVENT_NAME.to_owned()),
        ("@MASTER@", hex(u32::from(master))),
        ("@SLAVE@", hex(u32::from(slave))),
        ("@BAUDRATE@", BIT_RATE_PER_S.to_string()),
    ]
    .into_iter()
    .fold(include_str!("frame.a2l").to_owned(), |text, (from, to)| text.replace(from, &to))
}

fn data_type(format: Format) -> DataType {
    match format {
        Format::Byte => DataType::Ubyte,
        Format::Long => DataType::Ulong,
        Format::Float => DataType::Float32Ieee,
        Format::Double => DataType::Float64Ieee,
    }
}

fn layout(format: Format) -> &'static str {
    if format == Format::Long { "count" } else { "number" }
}

/// Adds objects to a module, and keeps their names for its groups.
struct A2lBuilder<'a> {
    module: &'a mut Module,
    axis: &'static str,
    /// Names of objects by group: what can be written or only read, and what is measured.
    parts: Vec<(String, Vec<String>, Vec<String>)>,
}

impl A2lBuilder<'_> {
    fn record_layouts(&mut self) {
        for format in [Format::Long, Format::Double] {
            let mut record = RecordLayout::new(layout(format).into());
            record.fnc_values =
                Some(FncValues::new(1, data_type(format), IndexMode::RowDir, AddrType::Direct));
            self.module.record_layout.push(record);
        }
    }

    /// `algorithm.gain_per_s` with the axis in front, in the letters that A2L allows.
    fn name(&self, name: &str) -> String {
        let allowed = |c: char| if c.is_ascii_alphanumeric() || c == '.' || c == '_' { c } else { '_' };
        // A part of a name begins with no digit.
        let part = |part: &str| {
            let part: String = part.chars().map(allowed).collect();
            if part.starts_with(|c: char| c.is_ascii_digit()) { format!("_{part}") } else { part }
        };
        let parts: Vec<String> = name.split('.').map(part).collect();
        format!("{}.{}", self.axis, parts.join("."))
    }

    /// The conversion of numbers in `unit`: none but the unit itself.
    fn unit(&mut self, unit: &str) -> String {
        if unit.is_empty() {
            return "NO_COMPU_METHOD".into();
        }
        let name =
            format!("in_{}", unit.replace('/', "_per_").replace(|c: char| !c.is_ascii_alphanumeric(), "_"));
        if !self.module.compu_method.iter().any(|method| method.get_name() == name) {
            let meaning = format!("in {unit}");
            self.module.compu_method.push(CompuMethod::new(
                name.clone(),
                meaning,
                ConversionType::Identical,
                "%.6".into(),
                unit.into(),
            ));
        }
        name
    }

    /// The conversion of counts to names.
    fn names(&mut self, name: &str, values: &[&str]) -> String {
        let method = format!("names.{name}");
        let table = format!("{method}.table");
        if !self.module.compu_method.iter().any(|known| known.get_name() == method) {
            let mut conversion = CompuMethod::new(
                method.clone(),
                String::new(),
                ConversionType::TabVerb,
                "%.0".into(),
                String::new(),
            );
            conversion.compu_tab_ref = Some(CompuTabRef::new(table.clone()));
            self.module.compu_method.push(conversion);
            let mut value_table = CompuVtab::new(
                table,
                String::new(),
                ConversionType::TabVerb,
                values.len().try_into().unwrap_or(u16::MAX),
            );
            value_table.value_pairs = values
                .iter()
                .zip(0_u32..)
                .map(|(value, at)| ValuePairsStruct::new(f64::from(at), (*value).into()))
                .collect();
            self.module.compu_vtab.push(value_table);
        }
        method
    }

    fn parameters(&mut self, variables: &[Variable]) {
        let mut names = Vec::new();
        for (variable, at) in variables.iter().zip(0_u32..) {
            let conversion = self.unit(&variable.parameter.unit);
            let location =
                ValueLocation { address: PARAMETERS + at * WIDE, format: Format::Double, conversion };
            names.push(self.characteristic(
                &variable.name,
                &variable.parameter,
                location,
                variable.parameter.at_start_only,
            ));
        }
        self.parts.push(("parameters".into(), names, Vec::new()));
    }

    fn controls(&mut self) {
        let signals: Vec<_> = SIGNALS.iter().map(|signal| signal.about.name.as_ref()).collect();
        let mut names = Vec::new();
        for (place, control) in CONTROLS.iter().enumerate() {
            let conversion = match place {
                Controls::source
                | Controls::channel_1
                | Controls::channel_2
                | Controls::channel_3
                | Controls::channel_4 => self.names("signal", &signals),
                Controls::slope => self.names("slope", &["rising", "falling", "either", "at-once"]),
                _ => self.unit(&control.unit),
            };
            let address = CONTROL + place as u32 * WIDE;
            let location = ValueLocation { address, format: trace::control_format(place), conversion };
            names.push(self.characteristic(&control.name, control, location, false));
        }
        self.parts.push(("controls".into(), names, Vec::new()));
    }

    fn characteristic(
        &mut self,
        name: &str,
        about: &Parameter,
        location: ValueLocation,
        read_only: bool,
    ) -> String {
        let name = self.name(name);
        let mut characteristic = Characteristic::new(
            name.clone(),
            about.meaning.to_string(),
            CharacteristicType::Value,
            location.address,
            layout(location.format).into(),
            0.0,
            location.conversion,
            about.least,
            about.most,
        );
        characteristic.read_only = read_only.then(ReadOnly::new);
        self.module.characteristic.push(characteristic);
        name
    }

    fn signals(&mut self) {
        let mut names = Vec::new();
        for (signal, at) in SIGNALS.iter().zip(0_u32..) {
            let about = &signal.about;
            let conversion = if signal.values.is_empty() {
                self.unit(&about.unit)
            } else {
                self.names(&about.name, signal.values)
            };
            let location = ValueLocation { address: SIGNAL + at * NARROW, format: signal.format, conversion };
            names.push(self.measurement(&about.name, &about.meaning, [about.least, about.most], location));
        }
        self.parts.push(("signals".into(), Vec::new(), names));
    }

    fn measurement(&mut self, name: &str, meaning: &str, range: [f64; 2], location: ValueLocation) -> String {
        let name = self.name(name);
        let [least, most] = range;
        let data = data_type(location.format);
        let mut measurement =
            Measurement::new(name.clone(), meaning.into(), data, location.conversion, 0, 0.0, least, most);
        measurement.ecu_address = Some(EcuAddress::new(location.address));
        self.module.measurement.push(measurement);
        name
    }

    fn trace(&mut self) {
        let mut reported = Vec::new();
        for ((name, meaning), at) in STATUS.iter().zip(0_u32..) {
            let conversion = if at == 0 { self.names("trace", trace::STATES) } else { self.unit("") };
            let location =
                ValueLocation { address: TRACE_STATUS + at * NARROW, format: Format::Long, conversion };
            reported.push(self.measurement(name, meaning, [0.0, f64::from(u32::MAX)], location));
        }
        let cycles = Parameter::new(
            ("trace.cycles", "cycles"),
            [0.0, u32::MAX as f64],
            0.0,
            "trigger buffer: the rig's cycle of each sample, the oldest first",
        );
        let mut blocks = vec![self.block(&cycles, TRACE_CYCLES, Format::Long)];
        for (number, at) in (1..=CHANNELS).zip(0_u32..) {
            let about = Parameter {
                name: format!("trace.samples_{number}").into(),
                meaning: format!("trigger buffer: samples of channel {number}, the oldest first").into(),
                ..Parameter::new(("", ""), [-1e12, 1e12], 0.0, "")
            };
            blocks.push(self.block(&about, TRACE_CHANNELS + at * CHANNEL_STEP, Format::Double));
        }
        self.parts.push(("trace".into(), blocks, reported));
    }

    /// Samples as a block of memory, which is only read.
    fn block(&mut self, about: &Parameter, address: u32, format: Format) -> String {
        let conversion = self.unit(&about.unit);
        let name =
            self.characteristic(&about.name, about, ValueLocation { address, format, conversion }, true);
        if let Some(characteristic) =
            self.module.characteristic.iter_mut().find(|known| known.get_name() == name)
        {
            characteristic.characteristic_type = CharacteristicType::ValBlk;
            let mut length = MatrixDim::new();
            length.dim_list = vec![CAPACITY as u16];
            characteristic.matrix_dim = Some(length);
        }
        name
    }

    fn groups(&mut self) {
        for (name, characteristics, measurements) in std::mem::take(&mut self.parts) {
            let mut group = Group::new(format!("{}_{name}", self.axis), String::new());
            group.root = Some(Root::new());
            if !characteristics.is_empty() {
                let mut list = RefCharacteristic::new();
                list.identifier_list = characteristics;
                group.ref_characteristic = Some(list);
            }
            if !measurements.is_empty() {
                let mut list = RefMeasurement::new();
                list.identifier_list = measurements;
                group.ref_measurement = Some(list);
            }
            self.module.group.push(group);
        }
    }
}

struct ValueLocation {
    address: u32,
    format: Format,
    conversion: String,
}

#[cfg(test)]
mod tests;
