//! Counting what the good chunks hold.

use std::collections::BTreeMap;

use mcap::records::Statistics;

use super::cdr::DecodeError;
use super::chunk::{Chunk, Message};
use super::layout;
use super::topic::Topic;
use crate::tick::{TickInput, TickOutput};

/// One tick as it was recorded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordedTick {
    /// Running number in the recording, from 0: a jump means that ticks are lost. (Jumps of the tick number itself
    /// may also be late ticks.)
    pub index: u32,
    /// What the core learned.
    pub input: TickInput,
    /// What the core said.
    pub output: TickOutput,
}

/// Finds the topic of a message.
#[derive(Clone, Debug)]
pub(super) struct Channels(BTreeMap<u16, Topic>);

impl Default for Channels {
    fn default() -> Self {
        Self(Topic::ALL.into_iter().map(|topic| (topic.id(), topic)).collect())
    }
}

impl Channels {
    pub(super) fn topic(&self, message: &Message) -> Option<Topic> {
        self.0.get(&message.channel).copied()
    }

    /// Learns the declarations of a chunk. Ours say what is known anyway; other tools may renumber channels.
    fn learn(&mut self, declared: &[(u16, String)]) {
        for (id, name) in declared {
            match Topic::from_name(name) {
                Some(topic) => self.0.insert(*id, topic),
                None => self.0.remove(id),
            };
        }
    }
}

/// Joins each tick's input to its output: they follow each other in a chunk.
#[derive(Debug, Default)]
pub(super) struct TickJoiner {
    input: Option<(u32, TickInput)>,
}

impl TickJoiner {
    /// Takes a message of topic tick input. What was waiting for its output is forgotten.
    pub(super) fn input(&mut self, message: &Message) -> Result<(), DecodeError> {
        self.input = None;
        self.input = Some((message.sequence, layout::decode_input(&message.data)?));
        Ok(())
    }

    /// Takes a message of topic tick output; `None` if it does not belong to the input before.
    pub(super) fn output(&mut self, message: &Message) -> Result<Option<RecordedTick>, DecodeError> {
        let output = layout::decode_output(&message.data)?;
        let tick = self.input.take().map(|(index, input)| RecordedTick { index, input, output });
        Ok(tick.filter(|tick| tick.index == message.sequence && tick.input.tick == output.tick))
    }
}

/// Messages of one kind, by their running numbers.
#[derive(Debug, Default)]
pub(super) struct Running {
    next: u32,
    pub read: u64,
    pub lost: u64,
}

impl Running {
    /// Counts number `sequence`; returns how many are missing in front of it.
    fn count(&mut self, sequence: u32) -> u64 {
        let ahead = sequence.wrapping_sub(self.next);
        // The upper half means a step back: a file put together by another tool.
        let missing = if ahead <= u32::MAX / 2 { u64::from(ahead) } else { 0 };
        self.next = sequence.wrapping_add(1);
        self.read += 1;
        self.lost += missing;
        missing
    }
}

/// What the good chunks held so far.
#[derive(Debug, Default)]
pub(super) struct Census {
    pub channels: Channels,
    pub ticks: Running,
    pub traffic: Running,
    /// Texts of the header message by name.
    pub header: Option<BTreeMap<String, String>>,
    pub summary: Option<String>,
    /// Version of the first message whose layout is not ours.
    pub other_layout: Option<u8>,
}

impl Census {
    /// Counts the messages of one chunk and returns what is wrong in it. Missing numbers are explained if
    /// `damage_known` lies before the chunk; otherwise they never reached the file.
    pub(super) fn count(&mut self, chunk: &Chunk, damage_known: bool) -> Vec<String> {
        self.channels.learn(&chunk.channels);
        let mut joiner = TickJoiner::default();
        let mut missing = [0; 2];
        let mut unreadable = Unreadable::default();
        for message in &chunk.messages {
            let Some(topic) = self.channels.topic(message) else { continue };
            let result = match topic {
                Topic::TickInput => joiner.input(message),
                Topic::TickOutput => joiner.output(message).map(|tick| match tick {
                    Some(tick) => missing[0] += self.ticks.count(tick.index),
                    None => unreadable.note(topic, "it has no input"),
                }),
                Topic::Traffic => layout::decode_traffic(&message.data)
                    .map(|_| missing[1] += self.traffic.count(message.sequence)),
                Topic::Header => layout::decode_text(&message.data)
                    .map(|text| self.header = serde_json::from_str(text).ok()),
                Topic::Summary => {
                    layout::decode_text(&message.data).map(|text| self.summary = Some(text.to_owned()))
                }
                Topic::Event => layout::decode_text(&message.data).map(|_| ()),
                Topic::Imu => Ok(()),
            };
            if let Err(error) = result {
                if let DecodeError::Layout { got, .. } = error {
                    self.other_layout.get_or_insert(got);
                }
                unreadable.note(topic, &error.to_string());
            }
        }
        let mut problems = Vec::from_iter(unreadable.describe());
        if !damage_known {
            let dropped = |(count, what): (u64, &str)| {
                (count > 0).then(|| format!("{count} {what} before here were dropped while recording"))
            };
            problems.extend(missing.into_iter().zip(["ticks", "pieces of traffic"]).filter_map(dropped));
        }
        problems
    }

    /// Compares with the totals that the finished file states: they count what was in a damaged last chunk.
    pub(super) fn expect_totals(&mut self, statistics: &Statistics) {
        let total = |topic: Topic| statistics.channel_message_counts.get(&topic.id()).copied().unwrap_or(0);
        self.ticks.lost = self.ticks.lost.max(total(Topic::TickOutput).saturating_sub(self.ticks.read));
        self.traffic.lost = self.traffic.lost.max(total(Topic::Traffic).saturating_sub(self.traffic.read));
    }
}

/// Messages whose contents make no sense although their chunk is good: another version wrote them.
#[derive(Default)]
struct Unreadable {
    count: u64,
    first: String,
}

impl Unreadable {
    fn note(&mut self, topic: Topic, why: &str) {
        if self.count == 0 {
            self.first = format!("{}: {why}", topic.name());
        }
        self.count += 1;
    }

    fn describe(self) -> Option<String> {
        (self.count > 0).then(|| format!("{} messages cannot be read, first {}", self.count, self.first))
    }
}
