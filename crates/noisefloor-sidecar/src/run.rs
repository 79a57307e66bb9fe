//! Short runs of a program for its output.

use noisefloor::text::printable;
use std::io::{self, BufRead, BufReader, Read};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread;
use std::time::{Duration, Instant};

/// Longest line in bytes; a longer one is cut into several.
const LINE: u64 = 4096;
/// How often a silent program is checked.
const LOOK: Duration = Duration::from_millis(20);
/// How long the streams of a program that has ended may stay open.
const GRACE: Duration = Duration::from_secs(2);

/// Runs a program to its end and passes on its output, line by line and safe to print, both streams together.
///
/// # Errors
/// If it cannot be started, or takes longer than the limit; it is then killed.
pub(crate) fn run(
    mut command: Command,
    limit: Duration,
    mut on_line: impl FnMut(&str),
) -> io::Result<ExitStatus> {
    let mut child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn()?;
    let (sender, lines) = mpsc::channel();
    if let Some(stdout) = child.stdout.take() {
        forward(stdout, sender.clone());
    }
    if let Some(stderr) = child.stderr.take() {
        forward(stderr, sender);
    }
    let begun = Instant::now();
    loop {
        // Its output is in the channel, or about to be. A grandchild may keep the streams open for ever
        let ended = child.try_wait()?;
        let silence = if ended.is_some() { GRACE } else { LOOK };
        let over = || begun.elapsed() > limit;
        let closed = loop {
            match lines.recv_timeout(silence) {
                Ok(line) => on_line(&line),
                Err(error) => break error == RecvTimeoutError::Disconnected,
            }
            if over() {
                break false;
            }
        };
        if let Some(status) = ended {
            return Ok(status);
        }
        if closed {
            thread::sleep(LOOK);
        }
        if over() {
            child.kill()?;
            child.wait()?;
            let what = format!("not finished after {} s", limit.as_secs());
            return Err(io::Error::new(io::ErrorKind::TimedOut, what));
        }
    }
}

fn forward(stream: impl Read + Send + 'static, to: Sender<String>) {
    thread::spawn(move || {
        let mut stream = BufReader::new(stream);
        let mut line = Vec::new();
        while stream.by_ref().take(LINE).read_until(b'\n', &mut line).is_ok_and(|n| n > 0) {
            let text = printable(String::from_utf8_lossy(&line).trim_end()).into_owned();
            if to.send(text).is_err() {
                return;
            }
            line.clear();
        }
    });
}
