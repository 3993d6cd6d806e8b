//! The figures of a file: its channels and figures, as data and as the text that `mcap info` prints.

use std::fmt;
use std::sync::Arc;

use super::bag::McapBag;
use super::index::{ChunkSizes, FileIndex, McapChannel, NamedRecord};

/// Nanoseconds of a second.
const SECOND: u64 = 1_000_000_000;

/// Seconds from which on a time is a date.
const DATED: u64 = 365 * 24 * 3600;

/// The figures of a file.
#[derive(Clone, Copy)]
pub struct FileInfo<'a>(pub(super) &'a FileIndex);

impl<'a> FileInfo<'a> {
    /// Returns the name of the library that has written it.
    pub fn library(self) -> &'a str {
        &self.0.library
    }

    /// Returns the name of the conventions that it follows, such as `ros2`.
    pub fn profile(self) -> &'a str {
        &self.0.profile
    }

    /// Returns the channels, each with the number of its messages.
    pub fn channels(self) -> impl Iterator<Item = (&'a Arc<McapChannel>, u64)> {
        let count = |id: &u16| self.0.counts.get(id).copied().unwrap_or(0);
        self.0.channels.iter().map(move |(id, channel)| (channel, count(id)))
    }

    /// Returns the number of messages.
    pub fn messages(self) -> u64 {
        self.0.counts.values().fold(0, |sum, count| sum.saturating_add(*count))
    }

    /// Returns the compressions, with the sizes of their chunks.
    pub fn compressions(self) -> impl Iterator<Item = (&'a str, ChunkSizes)> {
        self.0.chunks.iter().map(|(name, sizes)| (name.as_str(), *sizes))
    }

    /// Returns the attachments.
    pub fn attachments(self) -> &'a [NamedRecord] {
        &self.0.attachments
    }

    /// Returns the records of metadata.
    pub fn metadata(self) -> &'a [NamedRecord] {
        &self.0.metadata
    }

    /// Returns the earliest and the latest time of a message, in nanoseconds since 1970.
    pub fn times(self) -> Option<(u64, u64)> {
        self.0.times
    }

    /// Returns whether it has a summary.
    pub fn is_indexed(self) -> bool {
        self.0.is_indexed
    }
}

/// The figures, as `mcap info` prints them.
impl fmt::Display for McapBag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (number, info) in self.info().into_iter().enumerate() {
            if self.paths().len() > 1 {
                let gap = if number > 0 { "\n" } else { "" };
                writeln!(f, "{gap}{}:", self.paths()[number].display())?;
            }
            write_info(info, f)?;
            for damage in &info.0.damage {
                writeln!(f, "damaged:     {damage}")?;
            }
        }
        Ok(())
    }
}

fn write_info(info: FileInfo<'_>, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    writeln!(f, "library:     {}", info.library())?;
    writeln!(f, "profile:     {}", info.profile())?;
    writeln!(f, "messages:    {}", info.messages())?;
    let duration = info.times().map_or(0, |(first, last)| last.saturating_sub(first));
    if let Some((first, last)) = info.times() {
        writeln!(f, "duration:    {}", seconds(duration))?;
        writeln!(f, "start:       {}", moment(first))?;
        writeln!(f, "end:         {}", moment(last))?;
    }
    let mut compressions = info.compressions().peekable();
    if compressions.peek().is_some() {
        writeln!(f, "compression:")?;
    }
    let all: u64 = info.compressions().map(|(_, sizes)| sizes.chunks).sum();
    for (name, ChunkSizes { chunks, compressed, uncompressed }) in compressions {
        let name = if name.is_empty() { "none" } else { name };
        let part = 100.0 * compressed as f64 / uncompressed.max(1) as f64;
        let (from, to) = (size(uncompressed), size(compressed));
        write!(f, "    {name}: [{chunks}/{all} chunks] [{from}/{to} ({part:.2}%)]")?;
        if duration > 0 {
            write!(f, " [{}/sec]", size((compressed as f64 / (duration as f64 / 1e9)) as u64))?;
        }
        writeln!(f)?;
    }
    write_channels(info, duration, f)?;
    writeln!(f, "attachments: {}", info.attachments().len())?;
    writeln!(f, "metadata:    {}", info.metadata().len())
}

fn write_channels(info: FileInfo<'_>, duration: u64, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    writeln!(f, "channels:")?;
    let id = |channel: &McapChannel| format!("({})", channel.id);
    let ids = info.channels().map(|(channel, _)| id(channel).len()).max().unwrap_or(0);
    let topics = info.channels().map(|(channel, _)| channel.topic.chars().count()).max().unwrap_or(0);
    let counts = info.channels().map(|(_, count)| count.to_string().len()).max().unwrap_or(0);
    for (channel, count) in info.channels() {
        let (id, topic) = (id(channel), &channel.topic);
        let rate = match count {
            2.. if duration > 0 => format!(" ({:.2}Hz)", (count - 1) as f64 / (duration as f64 / 1e9)),
            _ => String::new(),
        };
        let schema = channel.schema.as_ref().map_or_else(
            || format!("no schema [{}]", channel.encoding),
            |schema| format!("{} [{}]", schema.name, schema.encoding),
        );
        writeln!(f, "    {id:<ids$} {topic:<topics$}  {count:>counts$} msgs{rate:<12} : {schema}")?;
    }
    Ok(())
}

/// Returns nanoseconds in seconds.
fn seconds(nanoseconds: u64) -> String {
    format!("{}.{:09}s", nanoseconds / SECOND, nanoseconds % SECOND)
}

/// Returns a number of bytes in a unit of its size.
fn size(bytes: u64) -> String {
    let mut amount = bytes as f64;
    for unit in ["B", "KiB", "MiB"] {
        if amount < 1024.0 {
            return if unit == "B" { format!("{bytes} B") } else { format!("{amount:.2} {unit}") };
        }
        amount /= 1024.0;
    }
    format!("{amount:.2} GiB")
}

/// Returns a time as a date in UTC, and as seconds; early times, as runs in virtual time have them, as
/// seconds.
fn moment(nanoseconds: u64) -> String {
    let (whole, rest) = (nanoseconds / SECOND, nanoseconds % SECOND);
    if whole < DATED {
        return format!("{whole}.{rest:09}");
    }
    let (year, month, day) = date(whole / 86_400);
    let (hour, minute, second) = (whole / 3600 % 24, whole / 60 % 60, whole % 60);
    format!("{year}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{rest:09}Z ({whole}.{rest:09})")
}

/// Returns year, month and day of a number of days since 1970, in the Gregorian calendar.
fn date(days: u64) -> (u64, u64, u64) {
    // Of years that begin in March, those of 400 years at a time, as Howard Hinnant has it.
    let shifted = days + 719_468;
    let (era, of_era) = (shifted / 146_097, shifted % 146_097);
    let year = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153;
    let day = of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    (year + era * 400 + u64::from(month <= 2), month, day)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_dates_and_sizes_have_units() {
        assert_eq!(
            moment(1_490_149_580_103_843_113),
            "2017-03-22T02:26:20.103843113Z (1490149580.103843113)"
        );
        assert_eq!(moment(951_782_400 * SECOND), "2000-02-29T00:00:00.000000000Z (951782400.000000000)");
        assert_eq!(moment(1_500_000_000), "1.500000000");
        assert_eq!(
            (size(1023), size(1536), size(3 << 30)),
            ("1023 B".into(), "1.50 KiB".into(), "3.00 GiB".into())
        );
    }
}
