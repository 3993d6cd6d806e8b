//! Profiles as files: flame graphs, data for speedscope, and a line for each stack.

use std::io;
use std::path::Path;

use inferno::flamegraph;
use serde_json::{Value, json};

use super::{Profile, ProfileUnit, ProfiledFrame, UsedResources};

impl ProfileUnit {
    fn of(self, used: UsedResources) -> u64 {
        match self {
            ProfileUnit::Ticks => used.ticks,
            ProfileUnit::Time => used.nanoseconds,
        }
    }
}

impl Profile {
    /// Writes the profile to a file: a flame graph of this unit if its name ends in `.svg`, for speedscope,
    /// of both units, if it ends in `.json`, else one line for each stack, with its ticks or nanoseconds.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path, unit: ProfileUnit) -> io::Result<()> {
        match path.extension().and_then(|extension| extension.to_str()) {
            Some("svg") => std::fs::write(path, self.flame_graph(unit)?),
            Some("json") => std::fs::write(path, self.speedscope()),
            _ => std::fs::write(path, self.lines(unit).concat()),
        }
    }

    /// Returns one line for each stack: its frames, and what it has used.
    fn lines(&self, unit: ProfileUnit) -> Vec<String> {
        // The separators of frames and stacks cannot be part of a name.
        let plain = |text: String| text.replace([';', '\n', '\r'], " ");
        let name = |&number: &usize| plain(self.frames[number].name());
        let line = |(stack, &used): (&Vec<usize>, &UsedResources)| {
            let count = unit.of(used);
            let names = stack.iter().map(name).collect::<Vec<_>>().join(";");
            (count > 0).then(|| format!("{names} {count}\n"))
        };
        let mut lines: Vec<String> = self.stacks.iter().filter_map(line).collect();
        lines.sort_unstable();
        lines
    }

    fn flame_graph(&self, unit: ProfileUnit) -> io::Result<Vec<u8>> {
        let mut options = flamegraph::Options::default();
        // The beginning of a name tells more than its end.
        options.text_truncate_direction = flamegraph::TextTruncateDirection::Right;
        options.image_width = Some(1380);
        (options.title, options.count_name) = match unit {
            ProfileUnit::Ticks => ("Ticks of the run".into(), "ticks".into()),
            ProfileUnit::Time => ("Time of the run".into(), "ns".into()),
        };
        let lines = self.lines(unit);
        let mut drawing = Vec::new();
        if lines.is_empty() {
            // The drawing of nothing is an error there.
            return Ok(b"<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"1\" height=\"1\"/>\n".to_vec());
        }
        flamegraph::from_lines(&mut options, lines.iter().map(String::as_str), &mut drawing)?;
        Ok(drawing)
    }

    fn speedscope(&self) -> String {
        let frame = |frame: &ProfiledFrame| match frame {
            ProfiledFrame::Line(file, line) => json!({ "name": frame.name(), "file": file, "line": line }),
            _ => json!({ "name": frame.name() }),
        };
        let mut stacks: Vec<(&Vec<usize>, UsedResources)> =
            self.stacks.iter().map(|(stack, used)| (stack, *used)).collect();
        stacks.sort_unstable_by_key(|(stack, _)| *stack);
        let profiles = [("ticks", "none", ProfileUnit::Ticks), ("time", "nanoseconds", ProfileUnit::Time)];
        let profiles = profiles.map(|profile| sampled(&stacks, profile));
        let file = json!({
            "$schema": "https://www.speedscope.app/file-format-schema.json",
            "shared": { "frames": self.frames.iter().map(frame).collect::<Vec<_>>() },
            "profiles": profiles,
            "exporter": "eslvm",
        });
        file.to_string() + "\n"
    }
}

/// Returns a profile of speedscope: its name, its unit there, and what is counted.
fn sampled(
    stacks: &[(&Vec<usize>, UsedResources)],
    (name, unit, counted): (&str, &str, ProfileUnit),
) -> Value {
    let samples: Vec<&Vec<usize>> = stacks.iter().map(|(stack, _)| *stack).collect();
    let weights: Vec<u64> = stacks.iter().map(|(_, used)| counted.of(*used)).collect();
    let total: u64 = weights.iter().sum();
    json!({
        "type": "sampled", "name": name, "unit": unit, "startValue": 0, "endValue": total,
        "samples": samples, "weights": weights,
    })
}
