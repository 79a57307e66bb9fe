//! Any program that renders into a file, as a source.

use crate::error::CommandError;
use noisefloor::{
    Batch, ProgressiveSource, Repeats, Request, SourceError, SourceInfo, Tile, Unit, check_image,
};
use noisefloor_image::{LinearImage, Picture, read_picture};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// What may stand in a template.
const PLACEHOLDERS: [&str; 10] = ["scene", "seed", "spp", "x0", "x1", "y0", "y1", "width", "height", "out"];
/// The corners of a tile, which a template has all of or none.
const CORNERS: [&str; 4] = ["x0", "x1", "y0", "y1"];
/// Seeds are positive in 31 bits, which every program reads.
const SEEDS: u64 = 1 << 31;
/// How much of a program's output is kept for messages, in bytes.
const TAIL: u64 = 2048;

/// What a command is given.
#[derive(Clone, Debug)]
pub struct CommandOptions {
    /// The scene, for `{scene}`.
    pub scene: Option<PathBuf>,
    /// Seed of the seeds.
    pub seed: u64,
    /// Width and height of the whole image in pixels; found out by rendering a sample of it if `None`.
    pub size: Option<(usize, usize)>,
    /// Time for one run of the command.
    pub timeout: Duration,
}

/// A program that renders a scene into an EXR or PFM file, run once for each batch.
///
/// The command is a template with placeholders, split into words as a POSIX shell does (quotes and backslashes count, nothing
/// else does; no shell is run):
///
/// | placeholder | is |
/// |---|---|
/// | `{scene}` | the scene |
/// | `{seed}` | a number within 0…2³¹−1, another in every run; required |
/// | `{spp}` | samples per pixel; required |
/// | `{x0}`, `{x1}`, `{y0}`, `{y1}` | the tile: columns x0 to x1, rows y0 to y1, from the top; **x1 and y1 are exclusive** |
/// | `{width}`, `{height}` | of the whole image |
/// | `{out}` | a path without extension in an empty folder, as in `{out}.exr`; required |
///
/// With `{x0}` the command renders tile by tile, and its picture is the tile or the whole image; without, it renders whole images,
/// and single tiles cannot be aimed at. The one file that it leaves beside `{out}` is read as EXR or PFM, whatever its name.
///
/// Each run has to render with other random numbers for another seed; nothing here can check that. Use a filter one pixel wide.
#[derive(Debug)]
pub struct CommandSource {
    template: Vec<String>,
    options: CommandOptions,
    info: SourceInfo,
    /// Runs so far.
    runs: u64,
}

impl CommandSource {
    /// Checks the template, and finds the size out if it is not given.
    ///
    /// # Errors
    /// [`CommandError`] if the template is not a command or lacks a placeholder, or if the run that finds the size out fails.
    pub fn new(template: &str, options: CommandOptions) -> Result<Self, CommandError> {
        let wrong = |why: String| CommandError::Template { template: template.to_owned(), why };
        let words = shlex::split(template).ok_or_else(|| wrong("a quote is not closed".to_owned()))?;
        let Some(program) = words.first() else { return Err(wrong("it is empty".to_owned())) };
        let named: Vec<&str> = words.iter().flat_map(|word| placeholders(word)).collect();
        let has = |name: &str| named.contains(&name);
        if let Some(unknown) = named.iter().find(|name| !PLACEHOLDERS.contains(name)) {
            let known = PLACEHOLDERS.map(|name| format!("{{{name}}}")).join(" ");
            return Err(wrong(format!("{{{unknown}}} is no placeholder; there are {known}")));
        }
        for required in ["seed", "spp", "out"] {
            if !has(required) {
                return Err(wrong(format!("{{{required}}} is missing; every run needs its own")));
            }
        }
        let aims = CORNERS.iter().any(|corner| has(corner));
        if let Some(missing) = CORNERS.iter().find(|corner| aims && !has(corner)) {
            return Err(wrong(format!("{{{missing}}} is missing; name all corners of a tile, or none")));
        }
        if has("scene") != options.scene.is_some() {
            return Err(wrong(if has("scene") {
                "{scene} is in it, and no scene is given".to_owned()
            } else {
                "a scene is given, and {scene} is not in it".to_owned()
            }));
        }
        let stem = Path::new(program).file_stem().unwrap_or_default().to_string_lossy();
        let info = SourceInfo {
            name: format!("command {stem}"),
            width: 0,
            height: 0,
            unit: Unit::SamplesPerPixel,
            aims,
            repeats: Repeats::Nothing,
        };
        let mut source = Self { template: words, options, info, runs: 0 };
        let (width, height) = source.options.size.map_or_else(|| source.find_size(), Ok)?;
        check_image(width, height).map_err(|e| CommandError::Size(e.to_string()))?;
        (source.info.width, source.info.height) = (width, height);
        Ok(source)
    }

    /// The size of what the command renders when asked for one sample, of one pixel if it can aim.
    fn find_size(&mut self) -> Result<(usize, usize), CommandError> {
        if self.template.iter().any(|word| word.contains("{width}") || word.contains("{height}")) {
            return Err(CommandError::Size("the command asks for it".to_owned()));
        }
        let (image, _) = self.run(&Tile { index: 0, x: 0, y: 0, width: 1, height: 1 }, 1)?;
        match (image.width, image.height) {
            (1, 1) if self.info.aims => {
                Err(CommandError::Size("the command renders the tile alone".to_owned()))
            }
            size => Ok(size),
        }
    }

    /// Renders so many samples of a tile, or of the whole image if the command cannot aim; the command as it was run.
    fn run(&mut self, tile: &Tile, samples: u32) -> Result<(LinearImage, String), CommandError> {
        let temporary = std::env::temp_dir();
        let folder = |source| CommandError::Folder { folder: temporary.clone(), source };
        let scratch = TempDir::with_prefix("noisefloor-").map_err(folder)?;
        let pictures = scratch.path().join("out");
        std::fs::create_dir(&pictures).map_err(folder)?;

        let value = |name: &str| match name {
            "scene" => self.options.scene.as_deref().unwrap_or(Path::new("")).display().to_string(),
            "seed" => scatter(self.options.seed, self.runs).to_string(),
            "spp" => samples.to_string(),
            "x0" => tile.x.to_string(),
            "x1" => (tile.x + tile.width).to_string(),
            "y0" => tile.y.to_string(),
            "y1" => (tile.y + tile.height).to_string(),
            "width" => self.info.width.to_string(),
            "height" => self.info.height.to_string(),
            _ => pictures.join("picture").display().to_string(),
        };
        let words: Vec<String> = self.template.iter().map(|word| fill(word, &value)).collect();
        self.runs += 1;
        let command = shlex::try_join(words.iter().map(String::as_str)).unwrap_or_else(|_| words.join(" "));

        // What it says goes to a file: nobody has to listen while it runs.
        let log = scratch.path().join("log");
        let both = File::create(&log).and_then(|file| Ok((file.try_clone()?, file))).map_err(folder)?;
        let said = || tail(&log);
        let started = Command::new(&words[0])
            .args(&words[1..])
            .stdin(Stdio::null())
            .stdout(both.0)
            .stderr(both.1)
            .spawn();
        let mut child =
            started.map_err(|source| CommandError::Start { program: words[0].clone(), source })?;
        let begun = Instant::now();
        let mut pause = Duration::from_millis(1);
        let failed = |how: String| CommandError::Failed { command: command.clone(), how, said: said() };
        let status = loop {
            match child.try_wait().map_err(|e| failed(e.to_string()))? {
                Some(status) => break status,
                None if begun.elapsed() > self.options.timeout => {
                    // Killing fails only where it has ended meanwhile.
                    let _ = child.kill();
                    let _ = child.wait();
                    let seconds = self.options.timeout.as_secs_f64();
                    return Err(failed(format!("no end after {seconds} s; allow more time with --timeout")));
                }
                None => {
                    thread::sleep(pause);
                    pause = (2 * pause).min(Duration::from_millis(50));
                }
            }
        };
        if !status.success() {
            return Err(failed(status.to_string()));
        }

        let files = std::fs::read_dir(&pictures).and_then(|files| files.collect::<Result<Vec<_>, _>>());
        let files = files.map_err(folder)?;
        let [file] = files.as_slice() else {
            let names: Vec<_> = files.iter().map(|f| f.file_name().to_string_lossy().into_owned()).collect();
            let found = if names.is_empty() { "no file".to_owned() } else { names.join(", ") };
            return Err(CommandError::Output { command, found, said: said() });
        };
        match read_picture(file.path())? {
            Picture::Linear(image) => Ok((image, command)),
            Picture::Display(_) => Err(CommandError::Display { command }),
        }
    }

    /// A tile by itself.
    fn aimed(&mut self, request: &Request) -> Result<Batch, CommandError> {
        let Request { tile, samples, .. } = *request;
        let (image, command) = self.run(&tile, samples)?;
        let mean = if (image.width, image.height) == (tile.width, tile.height) {
            image.pixels
        } else {
            self.check_whole(&image, &tile, command)?;
            cut(&image, &tile)
        };
        Ok(Batch { tile, samples, mean })
    }

    /// All tiles out of one picture.
    fn whole(&mut self, requests: &[Request]) -> Result<Vec<Batch>, CommandError> {
        let Some(samples) = requests.iter().map(|r| r.samples).max() else { return Ok(Vec::new()) };
        let SourceInfo { width, height, .. } = self.info;
        let all = Tile { index: 0, x: 0, y: 0, width, height };
        let (image, command) = self.run(&all, samples)?;
        self.check_whole(&image, &all, command)?;
        let batch = |r: &Request| Batch { tile: r.tile, samples, mean: cut(&image, &r.tile) };
        Ok(requests.iter().map(batch).collect())
    }

    fn check_whole(&self, image: &LinearImage, tile: &Tile, command: String) -> Result<(), CommandError> {
        if (image.width, image.height) == (self.info.width, self.info.height) {
            return Ok(());
        }
        Err(CommandError::Picture {
            command,
            width: tile.width,
            height: tile.height,
            got_width: image.width,
            got_height: image.height,
        })
    }
}

impl ProgressiveSource for CommandSource {
    fn info(&self) -> SourceInfo {
        self.info.clone()
    }

    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        let name = self.info.name.clone();
        let failed = |tile, cause: CommandError| {
            let (name, cause) = (name.clone(), Box::new(cause));
            SourceError::Failed { name, tile, cause }
        };
        if !self.info.aims {
            return self.whole(requests).map_err(|cause| failed(None, cause));
        }
        requests.iter().map(|r| self.aimed(r).map_err(|cause| failed(Some(r.tile.index), cause))).collect()
    }
}

/// The pixels of a tile.
fn cut(image: &LinearImage, tile: &Tile) -> Vec<noisefloor::Rgb> {
    tile.rows(image.width).flat_map(|row| image.pixels[row].iter().copied()).collect()
}

/// The names in braces. Other braces, as of JSON, are text.
fn placeholders(word: &str) -> impl Iterator<Item = &str> {
    pieces(word).filter_map(Result::err)
}

/// A word with its placeholders filled in.
fn fill(word: &str, value: &impl Fn(&str) -> String) -> String {
    pieces(word).map(|piece| piece.map_or_else(value, str::to_owned)).collect()
}

/// Text, and as errors the names of placeholders, in order.
fn pieces(word: &str) -> impl Iterator<Item = Result<&str, &str>> {
    let mut rest = word;
    std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let name = |text: &'_ str| {
            let length = text.strip_prefix('{')?.find('}')?;
            let inside = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit();
            (length > 0 && text[1..=length].chars().all(inside)).then_some(length)
        };
        if let Some(length) = name(rest) {
            let piece = &rest[1..=length];
            rest = &rest[length + 2..];
            return Some(Err(piece));
        }
        // Text up to the next brace, at least one character of it
        let first = rest.chars().next().map_or(0, char::len_utf8);
        let end = rest[first..].find('{').map_or(rest.len(), |at| first + at);
        let (text, after) = rest.split_at(end);
        rest = after;
        Some(Ok(text))
    })
}

/// The seed of a run: scattered, since programs derive random numbers of neighbouring seeds from each other; and another in every run, since
/// each step is a bijection of 31 bits.
fn scatter(seed: u64, run: u64) -> u64 {
    const MASK: u64 = SEEDS - 1;
    let key = (seed ^ (seed >> 31) ^ (seed >> 62)) & MASK;
    let mut x = run.wrapping_add(key.wrapping_mul(0x2545_f491)) & MASK;
    for odd in [0x7feb_352d_u64, 0x046c_a68b, 0x3c6e_f363] {
        x ^= x >> 16;
        x = x.wrapping_mul(odd) & MASK;
    }
    x ^ (x >> 15)
}

/// The end of a log, in one line.
fn tail(log: &Path) -> String {
    let mut bytes = Vec::new();
    let mut read = || {
        let mut file = File::open(log)?;
        let length = file.seek(SeekFrom::End(0))?;
        file.seek(SeekFrom::Start(length.saturating_sub(TAIL)))?;
        file.take(TAIL).read_to_end(&mut bytes)
    };
    // A log that cannot be read says nothing.
    let _ = read();
    let text = String::from_utf8_lossy(&bytes);
    let said = text.split_whitespace().collect::<Vec<_>>().join(" ");
    if said.is_empty() { "none".to_owned() } else { said }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn placeholders_are_lower_case_names_in_braces() {
        let value = |name: &str| format!("<{name}>");
        for (word, filled) in [
            ("--crop={x0},{y0}", "--crop=<x0>,<y0>"),
            ("{out}.exr", "<out>.exr"),
            ("{\"spp\": {spp}}", "{\"spp\": <spp>}"),
            ("{}", "{}"),
            ("{é{seed}é}", "{é<seed>é}"),
            ("{{spp}}", "{<spp>}"),
            ("{", "{"),
            ("", ""),
        ] {
            assert_eq!(fill(word, &value), filled, "{word}");
        }
    }

    #[test]
    fn seeds_never_come_twice_and_differ_by_seed() {
        let seeds: HashSet<u64> = (0..100_000).map(|run| scatter(7, run)).collect();
        assert!(seeds.len() == 100_000 && seeds.iter().all(|&seed| seed < SEEDS));
        let same = (0..1000).filter(|&run| scatter(7, run) == scatter(8, run)).count();
        assert_eq!(same, 0);
    }
}
