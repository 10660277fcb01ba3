//! A mapping and its DBC file, compiled into what a decoder looks up for each frame.

use super::dbc::{Dbc, DbcMessage, Multiplexing};
use super::error::CanMapError;
use super::mapping::{AxisSource, CanMapping, SignalName};
use super::pairing::{MAX_PARTS, Rule};
use super::signal::{MAX_BYTES, SignalLayout};

/// Everything a decoder needs to know of one message.
#[derive(Clone, Debug)]
pub(super) struct Frame {
    pub(super) name: String,
    pub(super) id: u32,
    pub(super) extended: bool,
    /// Length by the DBC file, bytes.
    pub(super) size: usize,
    /// Where a multiplexed message says what it holds.
    switch: Option<SignalLayout>,
    pub(super) parts: Vec<FramePart>,
    /// The counter of frames, with the switch value of the frames that hold it.
    counter: Option<(Option<u64>, SignalLayout)>,
}

/// What a message, or those of its frames with one switch value, contributes to a sample.
#[derive(Clone, Debug)]
pub(super) struct FramePart {
    /// Place among the parts of a sample.
    pub(super) index: usize,
    /// Raw value of the switch; `None` where all frames of the message have it.
    when: Option<u64>,
    pub(super) axes: Vec<AxisReader>,
    pub(super) time: Option<SignalLayout>,
    /// What pairs it.
    pub(super) pair_by: Option<SignalLayout>,
}

/// One axis in a frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct AxisReader {
    /// Gyro x y z, specific force x y z.
    pub(super) axis: usize,
    pub(super) layout: SignalLayout,
    pub(super) to_si: f64,
    pub(super) full_scale: f64,
}

impl Frame {
    /// The part that this frame holds; `Ok(None)` if it holds none, `Err` if it is too short to tell.
    pub(super) fn part(&self, data: &[u8]) -> Result<Option<&FramePart>, TooShort> {
        let value = match &self.switch {
            Some(switch) if self.parts.iter().any(|part| part.when.is_some()) => {
                Some(switch.raw(data).ok_or(TooShort)?)
            }
            _ => None,
        };
        Ok(self.parts.iter().find(|part| part.when.is_none() || part.when == value))
    }

    /// The counter in this frame; `Ok(None)` if it holds none, `Err` if it is too short.
    pub(super) fn counter(&self, data: &[u8]) -> Result<Option<u64>, TooShort> {
        let Some((when, layout)) = &self.counter else { return Ok(None) };
        if let Some(when) = when
            && self.switch.ok_or(TooShort)?.raw(data).ok_or(TooShort)? != *when
        {
            return Ok(None);
        }
        layout.raw(data).map(Some).ok_or(TooShort)
    }
}

/// A frame has fewer bytes than its signals need.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TooShort;

/// The compiled mapping.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    pub(super) frames: Vec<Frame>,
    pub(super) rule: Rule,
    pub(super) part_count: usize,
}

/// A signal of the mapping, found in the DBC file.
struct Found<'a> {
    message: &'a DbcMessage,
    when: Option<u64>,
    layout: SignalLayout,
}

/// Compiles; holds what every error has to name.
pub(super) struct Compiler<'a> {
    pub(super) file: &'a str,
    pub(super) mapping: &'a CanMapping,
    pub(super) dbc_file: &'a str,
    pub(super) dbc: &'a Dbc,
}

impl Compiler<'_> {
    /// # Errors
    /// A name that the DBC file does not have, a signal that cannot be read, frames without a rule that pairs them.
    pub(super) fn compile(&self) -> Result<Plan, CanMapError> {
        let mut frames = Vec::new();
        for source in self.mapping.sources() {
            let found = self.find(source.axis.key(), source.name)?;
            let AxisSource { axis, to_si, full_scale, .. } = source;
            let reader = AxisReader { axis: axis as usize, layout: found.layout, to_si, full_scale };
            part_of(&mut frames, &found).axes.push(reader);
        }
        if let Some((name, _)) = self.mapping.time() {
            let found = self.find("time.signal", name)?;
            let has_parts = frames.iter().any(|frame: &Frame| frame.name == found.message.name);
            if has_parts && found.when.is_none() {
                let frame = frame_of(&mut frames, found.message);
                frame.parts.iter_mut().for_each(|part| part.time = Some(found.layout));
            } else {
                part_of(&mut frames, &found).time = Some(found.layout);
            }
        }
        let rule = self.pair(&mut frames)?;
        if let Some((name, _)) = self.mapping.counter() {
            let found = self.find("counter.signal", name)?;
            frame_of(&mut frames, found.message).counter = Some((found.when, found.layout));
        }
        let part_count = frames.iter().map(|frame| frame.parts.len()).sum();
        Ok(Plan { frames, rule, part_count })
    }

    fn find(&self, key: &str, name: &SignalName) -> Result<Found<'_>, CanMapError> {
        let missing = |found: String| CanMapError::NotInDbc {
            file: self.file.to_owned(),
            key: key.to_owned(),
            got: name.to_string(),
            found: format!("{} has {found}", self.dbc_file),
        };
        let message = self.dbc.message(&name.message).ok_or_else(|| {
            missing(format!("the messages {}", list(self.dbc.messages.iter().map(|message| &message.name))))
        })?;
        let signal = message.signal(&name.signal).ok_or_else(|| {
            let signals = list(message.signals.iter().map(|signal| &signal.name));
            missing(format!("in {} the signals {signals}", message.name))
        })?;
        let unreadable = |problem: &str, hint| CanMapError::Unreadable {
            file: self.file.to_owned(),
            key: key.to_owned(),
            got: name.to_string(),
            problem: format!("{} {problem}", self.dbc_file),
            hint,
        };
        let layout = signal.layout.ok_or_else(|| {
            unreadable(
                "does not fit a frame of 8 bytes",
                "correct start, length and SIG_VALTYPE_ in the DBC file",
            )
        })?;
        if layout.bytes() as u64 > message.size || message.size > MAX_BYTES as u64 {
            let hint = "correct the length of the message in its BO_ line; CAN FD is not read";
            return Err(unreadable("does not fit its message", hint));
        }
        if !message.extended && message.id > 0x7FF {
            let hint = "29-bit identifiers have bit 31 set in a DBC file: add 2147483648";
            return Err(unreadable("is in a message whose identifier does not fit 11 bits", hint));
        }
        let when = match signal.multiplexing {
            Multiplexing::Always | Multiplexing::Switch => None,
            Multiplexing::When(value) if message.switch().is_some() => Some(value),
            Multiplexing::When(_) => {
                return Err(unreadable(
                    "is multiplexed by a switch that is not there",
                    "mark the switch with M",
                ));
            }
            Multiplexing::Extended => {
                let hint =
                    "extended multiplexing (SG_MUL_VAL_, m0M) is not read: describe the message with one M";
                return Err(unreadable("is multiplexed by more than one switch", hint));
            }
        };
        Ok(Found { message, when, layout })
    }

    /// Finds the rule that joins the parts, and numbers them.
    fn pair(&self, frames: &mut [Frame]) -> Result<Rule, CanMapError> {
        for frame in frames.iter() {
            if frame.parts.len() > 1 && frame.parts.iter().any(|part| part.when.is_none()) {
                return Err(self.pairing_error(
                    format!(
                        "{} holds mapped signals that are multiplexed and others that are not",
                        frame.name
                    ),
                    "map only signals that are marked m0, m1, ... in a multiplexed message".to_owned(),
                ));
            }
        }
        let names: Vec<String> =
            frames.iter().flat_map(|frame| frame.parts.iter().map(|part| part_name(frame, part))).collect();
        let order_hint =
            format!("[pairing] order = [\"{}\"], in the order in which they are sent", names.join("\", \""));
        if names.len() > MAX_PARTS {
            let problem = format!("a sample of {} messages, at most {MAX_PARTS} are joined", names.len());
            return Err(self.pairing_error(problem, "map fewer messages".to_owned()));
        }
        let Some(table) = &self.mapping.pairing else {
            return match names.len() {
                1 => Ok(Rule::Order),
                _ => Err(self.pairing_error(
                    format!("a sample is {} messages and nothing says how they are joined", names.len()),
                    format!(
                        "write {order_hint}; or counters, one signal for each, that are equal in one sample"
                    ),
                )),
            };
        };
        match (&table.order, &table.counters) {
            (Some(order), None) => {
                let (mut given, mut needed) = (order.clone(), names.clone());
                given.sort();
                needed.sort();
                if given != needed {
                    let problem = format!(
                        "pairing.order is {}, the messages of a sample are {}",
                        list(order),
                        list(&names)
                    );
                    return Err(self.pairing_error(problem, format!("write {order_hint}")));
                }
                self.number(frames, order);
                Ok(Rule::Order)
            }
            (None, Some(counters)) => {
                self.number(frames, &names);
                self.pair_by_counters(frames, counters)?;
                Ok(Rule::EqualCounters)
            }
            _ => Err(self.pairing_error(
                "pairing has both order and counters, or neither".to_owned(),
                format!("write one of them, for example {order_hint}"),
            )),
        }
    }

    fn number(&self, frames: &mut [Frame], order: &[String]) {
        for frame in frames {
            let names: Vec<String> = frame.parts.iter().map(|part| part_name(frame, part)).collect();
            for (part, name) in frame.parts.iter_mut().zip(names) {
                part.index = order.iter().position(|other| *other == name).unwrap_or(0);
            }
        }
    }

    fn pair_by_counters(&self, frames: &mut [Frame], counters: &[SignalName]) -> Result<(), CanMapError> {
        for name in counters {
            let found = self.find("pairing.counters", name)?;
            let frame = frames.iter_mut().find(|frame| frame.name == found.message.name);
            for part in frame.into_iter().flat_map(|frame| &mut frame.parts) {
                if found.when.is_none() || found.when == part.when {
                    part.pair_by = Some(found.layout);
                }
            }
        }
        for frame in frames.iter() {
            if let Some(part) = frame.parts.iter().find(|part| part.pair_by.is_none()) {
                return Err(self.pairing_error(
                    format!("pairing.counters has no signal of {}", part_name(frame, part)),
                    "name one for each message of a sample, or use order".to_owned(),
                ));
            }
        }
        Ok(())
    }

    fn pairing_error(&self, problem: String, hint: String) -> CanMapError {
        CanMapError::Pairing { file: self.file.to_owned(), problem, hint }
    }
}

/// Name of a part in `pairing.order`.
fn part_name(frame: &Frame, part: &FramePart) -> String {
    match part.when {
        None => frame.name.clone(),
        Some(value) => format!("{}/m{value}", frame.name),
    }
}

fn frame_of<'a>(frames: &'a mut Vec<Frame>, message: &DbcMessage) -> &'a mut Frame {
    let at = frames.iter().position(|frame| frame.name == message.name).unwrap_or_else(|| {
        frames.push(Frame {
            name: message.name.clone(),
            id: message.id,
            extended: message.extended,
            size: usize::try_from(message.size).unwrap_or(MAX_BYTES),
            switch: message.switch(),
            parts: Vec::new(),
            counter: None,
        });
        frames.len() - 1
    });
    &mut frames[at]
}

fn part_of<'a>(frames: &'a mut Vec<Frame>, found: &Found<'_>) -> &'a mut FramePart {
    let parts = &mut frame_of(frames, found.message).parts;
    let at = parts.iter().position(|part| part.when == found.when).unwrap_or_else(|| {
        parts.push(FramePart { index: 0, when: found.when, axes: Vec::new(), time: None, pair_by: None });
        parts.len() - 1
    });
    &mut parts[at]
}

/// Names for an error text, not more than fit it.
fn list<'a>(names: impl IntoIterator<Item = &'a String>) -> String {
    const SHOWN: usize = 12;
    let names: Vec<&str> = names.into_iter().map(String::as_str).collect();
    match names.len() {
        0 => "none".to_owned(),
        count if count > SHOWN => format!("{} and {} more", names[..SHOWN].join(", "), count - SHOWN),
        _ => names.join(", "),
    }
}
