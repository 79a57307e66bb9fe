//! The process of a renderer: started, called with a time limit, and ended whatever it does.

use crate::frame::{self, Frame, FrameError};
use crate::group::Group;
use noisefloor::printable;
use std::collections::VecDeque;
use std::ffi::OsString;
use std::io::{self, BufReader, Read};
use std::path::Path;
use std::process::{ChildStderr, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// How much of standard error is kept, in bytes.
const TAIL: usize = 4096;
/// How long a process that has closed its stream, or was told to quit, may take to exit.
const GRACE: Duration = Duration::from_secs(2);

/// Why a call returned no frame. The process is of no further use.
#[derive(Debug)]
pub(crate) enum Failure {
    /// It ended, or closed its stream.
    Ended(Option<ExitStatus>),
    /// It did not answer in time.
    Silent,
    /// What it sent is not a frame.
    Garbled(FrameError),
}

/// A request, and the longest payload its reply may have.
struct Order {
    header: Vec<u8>,
    payload: Vec<u8>,
    most_payload: usize,
}

/// A running process that answers frames with frames.
#[derive(Debug)]
pub(crate) struct Process {
    group: Group,
    /// Closed before the process is reaped, which closes its standard input.
    orders: Option<Sender<Order>>,
    replies: Receiver<Result<Frame, FrameError>>,
    tail: Tail,
    broken: bool,
}

impl Process {
    /// Starts `python -I -u script`: isolated from the user's own packages and variables, and unbuffered.
    pub(crate) fn start(python: &Path, script: &Path, env: &[(String, OsString)]) -> io::Result<Self> {
        let mut command = Command::new(python);
        command.args(["-I", "-u"]).arg(script);
        command.envs(env.iter().map(|(name, value)| (name, value)));
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let (orders, receive_orders) = mpsc::channel();
        let (send_replies, replies) = mpsc::channel();
        let (send_group, group) = mpsc::channel();
        // One thread starts the process, writes and reads. Linux ends the process with the thread that
        // started it, and neither a full nor an empty pipe can block the caller.
        thread::Builder::new()
            .name("sidecar".into())
            .spawn(move || converse(command, &send_group, &receive_orders, &send_replies))?;
        let gone = || io::Error::other("the thread that was to start it ended");
        let mut group: Group = group.recv().map_err(|_| gone())??;
        let tail = group.child().stderr.take().map(Tail::follow).unwrap_or_default();
        Ok(Self { group, orders: Some(orders), replies, tail, broken: false })
    }

    pub(crate) fn id(&self) -> u32 {
        self.group.id()
    }

    /// Sends a request and waits for its reply.
    pub(crate) fn call(
        &mut self,
        header: Vec<u8>,
        payload: Vec<u8>,
        most_payload: usize,
        limit: Duration,
    ) -> Result<Frame, Failure> {
        let order = Order { header, payload, most_payload };
        let sent = self.orders.as_ref().is_some_and(|to| to.send(order).is_ok());
        let reply = if sent { self.replies.recv_timeout(limit) } else { Err(RecvTimeoutError::Disconnected) };
        let failure = match reply {
            Ok(Ok(frame)) => return Ok(frame),
            Ok(Err(FrameError::End | FrameError::Io(_))) | Err(RecvTimeoutError::Disconnected) => {
                Failure::Ended(self.wait(GRACE))
            }
            Ok(Err(error)) => Failure::Garbled(error),
            Err(RecvTimeoutError::Timeout) => Failure::Silent,
        };
        self.broken = true;
        Err(failure)
    }

    /// Its last output on standard error, safe to print; complete once the process has ended.
    pub(crate) fn last_words(&mut self) -> String {
        if self.broken {
            self.end();
            self.tail.wait(GRACE);
        }
        self.tail.text()
    }

    /// How it ended, if it does so in time.
    fn wait(&mut self, limit: Duration) -> Option<ExitStatus> {
        let begun = Instant::now();
        loop {
            match self.group.ended() {
                Ok(Some(status)) => return Some(status),
                Ok(None) if begun.elapsed() < limit => thread::sleep(Duration::from_millis(5)),
                _ => return None,
            }
        }
    }

    /// Kills it, and all that it has started.
    fn end(&mut self) {
        self.orders = None;
        self.group.end();
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // A renderer that works is asked to quit, so that it can clean up; one that does not respond is
        // killed
        if !self.broken && self.call(br#"{"op":"quit"}"#.to_vec(), Vec::new(), 0, GRACE).is_ok() {
            self.wait(GRACE);
        }
        self.end();
    }
}

fn converse(
    mut command: Command,
    send_group: &Sender<io::Result<Group>>,
    orders: &Receiver<Order>,
    replies: &Sender<Result<Frame, FrameError>>,
) {
    let mut group = match Group::spawn(&mut command) {
        Ok(group) => group,
        Err(error) => {
            // If the caller is gone, nobody waits for it
            let _ = send_group.send(Err(error));
            return;
        }
    };
    let pipes = group.child().stdin.take().zip(group.child().stdout.take());
    if send_group.send(Ok(group)).is_err() {
        return;
    }
    let Some((mut stdin, stdout)) = pipes else { return };
    let mut stdout = BufReader::new(stdout);
    for Order { header, payload, most_payload } in orders {
        let reply = match frame::write(&mut stdin, &header, &payload) {
            Ok(()) => frame::read(&mut stdout, most_payload),
            Err(error) => Err(FrameError::Io(error)),
        };
        if replies.send(reply).is_err() {
            return;
        }
    }
}

/// The end of a process's output on standard error.
#[derive(Debug, Default)]
struct Tail {
    bytes: Arc<Mutex<VecDeque<u8>>>,
    /// Disconnected at the end of the stream.
    following: Option<Receiver<()>>,
}

impl Tail {
    fn follow(mut stderr: ChildStderr) -> Self {
        let bytes = Arc::new(Mutex::new(VecDeque::new()));
        let (sender, following) = mpsc::channel();
        let kept = Arc::clone(&bytes);
        let follow = move || {
            let _until_the_end: Sender<()> = sender;
            let mut buffer = [0; TAIL];
            loop {
                let n = match stderr.read(&mut buffer) {
                    Ok(n @ 1..) => n,
                    Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                    Ok(0) | Err(_) => break,
                };
                let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
                kept.extend(&buffer[..n]);
                let old = kept.len().saturating_sub(TAIL);
                kept.drain(..old);
            }
        };
        // Without a thread there are no last words; nothing else is lost
        let started = thread::Builder::new().name("sidecar stderr".into()).spawn(follow);
        Self { bytes, following: started.is_ok().then_some(following) }
    }

    fn wait(&self, limit: Duration) {
        if let Some(following) = &self.following {
            // The sender never sends: this returns at the end of the stream, or when time is up
            let _ = following.recv_timeout(limit);
        }
    }

    fn text(&self) -> String {
        let mut bytes = self.bytes.lock().unwrap_or_else(PoisonError::into_inner);
        printable(String::from_utf8_lossy(bytes.make_contiguous()).trim()).into_owned()
    }
}
