//! Channels of an EXR whose values need not be in memory: a large picture is written block by block.

use exr::block::lines::LineRefMut;
use exr::block::{BlockIndex, UncompressedBlock};
use exr::image::write::channels::{ChannelsWriter, WritableChannels};
use exr::math::RoundingMode;
use exr::meta::attribute::{ChannelDescription, ChannelList, LevelMode, SampleType};
use exr::meta::header::Header;
use std::fmt;

/// A value for each pixel, row-major.
#[derive(Clone, Copy)]
pub enum Plane<'a, T> {
    /// They are there already.
    Values(&'a [T]),
    /// They are computed from the index of the pixel when they are written.
    Computed(&'a (dyn Fn(usize) -> T + Sync)),
}

impl<T> fmt::Debug for Plane<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Values(values) => write!(f, "{} values", values.len()),
            Self::Computed(_) => f.write_str("computed values"),
        }
    }
}

impl<'a, T> From<&'a [T]> for Plane<'a, T> {
    fn from(values: &'a [T]) -> Self {
        Self::Values(values)
    }
}

impl<T: Copy> Plane<'_, T> {
    /// Values that are there; none if they are computed.
    pub(crate) fn len(self) -> Option<usize> {
        match self {
            Self::Values(values) => Some(values.len()),
            Self::Computed(_) => None,
        }
    }

    pub(crate) fn at(self, pixel: usize) -> T {
        match self {
            Self::Values(values) => values[pixel],
            Self::Computed(value) => value(pixel),
        }
    }
}

/// A channel: its name, and its values by pixel.
pub(crate) struct Channel<'a> {
    name: &'static str,
    values: Values<'a>,
}

enum Values<'a> {
    Floats(Box<dyn Fn(usize) -> f32 + Sync + 'a>),
    Counts(Box<dyn Fn(usize) -> u32 + Sync + 'a>),
}

impl<'a> Channel<'a> {
    pub(crate) fn new(name: &'static str, value: impl Fn(usize) -> f32 + Sync + 'a) -> Self {
        Self { name, values: Values::Floats(Box::new(value)) }
    }

    pub(crate) fn counts(name: &'static str, value: impl Fn(usize) -> u32 + Sync + 'a) -> Self {
        Self { name, values: Values::Counts(Box::new(value)) }
    }

    fn write(&self, width: usize, line: LineRefMut<'_>) {
        let start = line.location.position.1 * width + line.location.position.0;
        let written = match &self.values {
            Values::Floats(value) => line.write_samples(|x| value(start + x)),
            Values::Counts(value) => line.write_samples(|x| value(start + x)),
        };
        debug_assert!(written.is_ok(), "a line in memory has room for its samples");
    }
}

/// The channels of a picture, sorted by name as the format wants them.
pub(crate) struct Channels<'a> {
    width: usize,
    channels: Vec<Channel<'a>>,
}

impl<'a> Channels<'a> {
    pub(crate) fn new(width: usize, mut channels: Vec<Channel<'a>>) -> Self {
        channels.sort_by_key(|channel| channel.name);
        Self { width, channels }
    }
}

impl<'slf, 'a: 'slf> WritableChannels<'slf> for Channels<'a> {
    fn infer_channel_list(&self) -> ChannelList {
        let describe = |channel: &Channel<'_>| {
            let sample_type = match channel.values {
                Values::Floats(_) => SampleType::F32,
                Values::Counts(_) => SampleType::U32,
            };
            ChannelDescription::named(channel.name, sample_type)
        };
        ChannelList::new(self.channels.iter().map(describe).collect())
    }

    fn infer_level_modes(&self) -> (LevelMode, RoundingMode) {
        (LevelMode::Singular, RoundingMode::Down)
    }

    type Writer = &'slf Self;

    fn create_writer(&'slf self, _: &Header) -> Self::Writer {
        self
    }
}

impl ChannelsWriter for &Channels<'_> {
    fn extract_uncompressed_block(&self, header: &Header, block: BlockIndex) -> Vec<u8> {
        UncompressedBlock::collect_block_data_from_lines(&header.channels, block, |line| {
            self.channels[line.location.channel].write(self.width, line);
        })
    }
}
