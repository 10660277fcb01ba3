//! DBC files, as far as decoding needs them.

use can_dbc::{ByteOrder, MessageId, MultiplexIndicator, SignalExtendedValueType, ValueType};

use super::error::CanMapError;
use super::signal::{SignalKind, SignalLayout};

/// The messages of a DBC file.
#[derive(Clone, Debug, PartialEq)]
pub struct Dbc {
    /// In the order of the file.
    pub messages: Vec<DbcMessage>,
}

/// A message (`BO_`) of a DBC file.
#[derive(Clone, Debug, PartialEq)]
pub struct DbcMessage {
    /// Name.
    pub name: String,
    /// Identifier without flag bits.
    pub id: u32,
    /// True for a 29-bit identifier (bit 31 of the number in the file).
    pub extended: bool,
    /// Length of the frame, bytes.
    pub size: u64,
    /// In the order of the file.
    pub signals: Vec<DbcSignal>,
}

/// A signal (`SG_`) of a message.
#[derive(Clone, Debug, PartialEq)]
pub struct DbcSignal {
    /// Name.
    pub name: String,
    /// Which frames of the message hold it.
    pub multiplexing: Multiplexing,
    /// Where it is; `None` if no frame of classic CAN can hold it as the file says.
    pub layout: Option<SignalLayout>,
}

/// Which frames of a message hold a signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Multiplexing {
    /// All of them.
    Always,
    /// All of them, and its value says what the others hold (`M`).
    Switch,
    /// Those whose switch has this raw value (`mN`).
    When(u64),
    /// More than one switch decides (`mNM`, `SG_MUL_VAL_`): not read here.
    Extended,
}

impl Dbc {
    /// Reads a DBC text; `file` only names it in errors.
    ///
    /// A signal that cannot be read is an error only once somebody asks for it: files of whole vehicles hold many.
    ///
    /// # Errors
    /// [`CanMapError::Dbc`] with the place, for text that is not a DBC file.
    pub fn parse(file: &str, text: &str) -> Result<Self, CanMapError> {
        let dbc = can_dbc::Dbc::try_from(text)
            .map_err(|source| CanMapError::Dbc { file: file.to_owned(), what: source.to_string() })?;
        let messages = dbc.messages.iter().map(|message| message_of(&dbc, message)).collect();
        Ok(Self { messages })
    }

    /// The message called `name`, the first if there are more.
    pub fn message(&self, name: &str) -> Option<&DbcMessage> {
        self.messages.iter().find(|message| message.name == name)
    }
}

impl DbcMessage {
    /// The signal called `name`.
    pub fn signal(&self, name: &str) -> Option<&DbcSignal> {
        self.signals.iter().find(|signal| signal.name == name)
    }

    /// Where the value stands that says what a multiplexed frame holds.
    pub fn switch(&self) -> Option<SignalLayout> {
        self.signals.iter().find(|signal| signal.multiplexing == Multiplexing::Switch)?.layout
    }

    /// The value of a signal of this message in a frame, in the unit of the DBC file; `None` if the frame does not
    /// hold it: by its length, by its switch, or because it is not read here.
    pub fn value(&self, signal: &DbcSignal, data: &[u8]) -> Option<f64> {
        let held = match signal.multiplexing {
            Multiplexing::Always | Multiplexing::Switch => true,
            Multiplexing::When(value) => self.switch()?.raw(data)? == value,
            Multiplexing::Extended => false,
        };
        let layout = signal.layout.filter(|_| held)?;
        Some(layout.physical(layout.raw(data)?))
    }
}

fn message_of(dbc: &can_dbc::Dbc, message: &can_dbc::Message) -> DbcMessage {
    let (id, extended) = match message.id {
        MessageId::Standard(id) => (id.into(), false),
        MessageId::Extended(id) => (id, true),
    };
    let signals = message.signals.iter().map(|signal| signal_of(dbc, message.id, signal)).collect();
    DbcMessage { name: message.name.clone(), id, extended, size: message.size, signals }
}

fn signal_of(dbc: &can_dbc::Dbc, id: MessageId, signal: &can_dbc::Signal) -> DbcSignal {
    let value_types = &dbc.signal_extended_value_type_list;
    let float = value_types.iter().find(|entry| entry.message_id == id && entry.signal_name == signal.name);
    let kind = match float.map(|entry| &entry.signal_extended_value_type) {
        Some(SignalExtendedValueType::IEEEfloat32Bit) => SignalKind::Float32,
        Some(SignalExtendedValueType::IEEEdouble64bit) => SignalKind::Float64,
        Some(SignalExtendedValueType::SignedOrUnsignedInteger) | None => match signal.value_type {
            ValueType::Signed => SignalKind::Signed,
            ValueType::Unsigned => SignalKind::Unsigned,
        },
    };
    let more_switches =
        dbc.extended_multiplex.iter().any(|entry| entry.message_id == id && entry.signal_name == signal.name);
    let multiplexing = match signal.multiplexer_indicator {
        _ if more_switches => Multiplexing::Extended,
        MultiplexIndicator::Plain => Multiplexing::Always,
        MultiplexIndicator::Multiplexor => Multiplexing::Switch,
        MultiplexIndicator::MultiplexedSignal(value) => Multiplexing::When(value),
        MultiplexIndicator::MultiplexorAndMultiplexedSignal(_) => Multiplexing::Extended,
    };
    let big_endian = signal.byte_order == ByteOrder::BigEndian;
    let (start, length) = (signal.start_bit, signal.size);
    let layout = SignalLayout::new(start, length, big_endian, kind, signal.factor, signal.offset);
    DbcSignal { name: signal.name.clone(), multiplexing, layout }
}
