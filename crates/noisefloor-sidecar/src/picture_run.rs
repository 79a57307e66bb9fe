//! One run of a program that writes a picture.

use crate::error::{CommandError, RunFault};
use crate::group::Group;
use crate::scratch::Scratch;
use noisefloor::text::printable;
use noisefloor_image::{LinearImage, Picture, read_picture};
use std::ffi::OsString;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

/// How much of a program's output is kept for messages, in bytes.
const TAIL: u64 = 2048;

/// A scratch folder with room for one picture and what the program prints.
pub(crate) struct PictureRun {
    scratch: Scratch,
    pictures: PathBuf,
}

impl PictureRun {
    pub(crate) fn new() -> Result<Self, CommandError> {
        let scratch = Scratch::new().map_err(folder)?;
        let pictures = scratch.path().join("out");
        std::fs::create_dir(&pictures).map_err(folder)?;
        Ok(Self { scratch, pictures })
    }

    /// Where the program is to write, without extension: the only file of its folder.
    pub(crate) fn out(&self) -> PathBuf {
        self.pictures.join("picture")
    }

    /// Where a picture for the program to read can be put.
    pub(crate) fn input(&self) -> PathBuf {
        self.scratch.path().join("in.exr")
    }

    /// Runs a command to its end; the picture that it wrote, and the command as one could type it. What it
    /// leaves running is killed.
    pub(crate) fn finish(
        self,
        words: &[OsString],
        timeout: Duration,
    ) -> Result<(LinearImage, String), CommandError> {
        let lossy: Vec<_> = words.iter().map(|word| word.to_string_lossy()).collect();
        let command = shlex::try_join(lossy.iter().map(AsRef::as_ref)).unwrap_or_else(|_| lossy.join(" "));
        let command = printable(&command).into_owned();

        // Its output goes to a file: nobody has to read while it runs
        let log = self.scratch.path().join("log");
        let both = File::create(&log).and_then(|file| Ok((file.try_clone()?, file))).map_err(folder)?;
        let mut program = Command::new(&words[0]);
        program.args(&words[1..]).stdin(Stdio::null()).stdout(both.0).stderr(both.1);
        let started = Group::spawn(&mut program);
        let mut group =
            started.map_err(|source| CommandError::Start { program: lossy[0].to_string(), source })?;
        if let Err(how) = wait(&mut group, timeout) {
            return Err(RunFault::Failed { how, said: tail(&log) }.of(command));
        }
        drop(group);

        let files = std::fs::read_dir(&self.pictures).and_then(|files| files.collect::<Result<Vec<_>, _>>());
        let files = files.map_err(folder)?;
        let [file] = files.as_slice() else {
            let names: Vec<_> = files.iter().map(|f| f.file_name().to_string_lossy().into_owned()).collect();
            let found = if names.is_empty() { "no file".to_owned() } else { names.join(", ") };
            let found = printable(&found).into_owned();
            return Err(RunFault::Output { found, said: tail(&log) }.of(command));
        };
        match read_picture(file.path())? {
            Picture::Linear(image) => Ok((image, command)),
            Picture::Display(_) => Err(RunFault::Display.of(command)),
        }
    }
}

fn folder(source: io::Error) -> CommandError {
    CommandError::Folder { folder: std::env::temp_dir(), source }
}

/// Waits for the program to end well; how it ended otherwise.
fn wait(group: &mut Group, limit: Duration) -> Result<(), String> {
    let begun = Instant::now();
    let mut pause = Duration::from_millis(1);
    loop {
        match group.ended().map_err(|error| error.to_string())? {
            Some(status) if status.success() => return Ok(()),
            Some(status) => return Err(status.to_string()),
            None if begun.elapsed() > limit => {
                let seconds = limit.as_secs_f64();
                return Err(format!("not finished after {seconds} s; allow more time with --timeout"));
            }
            None => {
                thread::sleep(pause);
                pause = (2 * pause).min(Duration::from_millis(50));
            }
        }
    }
}

/// The end of a log, in one line that is safe to print.
fn tail(log: &Path) -> String {
    let mut bytes = Vec::new();
    let mut read = || {
        let mut file = File::open(log)?;
        let length = file.seek(SeekFrom::End(0))?;
        file.seek(SeekFrom::Start(length.saturating_sub(TAIL)))?;
        file.take(TAIL).read_to_end(&mut bytes)
    };
    // A log that cannot be read is empty
    let _ = read();
    let text = String::from_utf8_lossy(&bytes);
    let said = text.split_whitespace().collect::<Vec<_>>().join(" ");
    if said.is_empty() { "none".to_owned() } else { printable(&said).into_owned() }
}
