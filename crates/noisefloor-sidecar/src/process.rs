//! The process of a renderer: started, called with a time limit, and ended whatever it does.

use crate::frame::{self, Frame, FrameError};
use crate::group::Group;
use noisefloor::text::printable;
use std::collections::VecDeque;
use std::ffi::OsString;
use std::io::{self, BufReader, Read};
use std::path::Path;
use std::process::{ChildStderr, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// How much of standard error is kept, in bytes.
const TAIL: usize = 4096;
/// How long a process that has closed its stream, or was told to quit, may take to exit.
const GRACE: Duration = Duration::from_secs(2);
/// How often a caller that may give up looks whether it does.
const LOOK: Duration = Duration::from_millis(50);

/// Why a call returned no frame. The process is of no further use.
#[derive(Debug)]
pub(crate) enum Failure {
    /// It ended, or closed its stream.
    Ended(Option<ExitStatus>),
    /// It did not answer in time.
    Silent,
    /// The caller gave up.
    GivenUp,
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
    /// Once it is set, no reply is waited for.
    give_up: Option<Arc<AtomicBool>>,
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
        Ok(Self { group, orders: Some(orders), replies, tail, broken: false, give_up: None })
    }

    /// Waits for replies only until the flag is set.
    pub(crate) fn give_up_when(&mut self, flag: Option<Arc<AtomicBool>>) {
        self.give_up = flag;
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
        let reply = if sent { self.wait_for_reply(limit) } else { Err(RecvTimeoutError::Disconnected) };
        let failure = match reply {
            Err(RecvTimeoutError::Timeout) if self.is_given_up() => Failure::GivenUp,
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

    /// The reply, if it comes in time and before the caller gives up.
    fn wait_for_reply(&self, limit: Duration) -> Result<Result<Frame, FrameError>, RecvTimeoutError> {
        if self.give_up.is_none() {
            return self.replies.recv_timeout(limit);
        }
        let begun = Instant::now();
        loop {
            let left = limit.saturating_sub(begun.elapsed());
            match self.replies.recv_timeout(left.min(LOOK)) {
                Err(RecvTimeoutError::Timeout) if left > LOOK && !self.is_given_up() => {}
                outcome => return outcome,
            }
        }
    }

    fn is_given_up(&self) -> bool {
        self.give_up.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed))
    }

    /// Its last output on standard error, safe to print; complete once the process has ended.
    pub(crate) fn last_words(&mut self) -> String {
        if self.broken {
            self.end();
            self.tail.wait(GRACE);
        }
        self.tail.text()
    }

    /// Waits for what it wrote on standard error before it refused: that takes another way than its reply.
    pub(crate) fn hear_out(&self) {
        self.tail.wait_for_mark(GRACE);
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
        self.give_up = None;
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

/// What a host writes on standard error before it sends a refusal.
const MARK: u8 = 0;

/// The end of a process's output on standard error.
#[derive(Debug, Default)]
struct Tail {
    heard: Arc<Heard>,
}

#[derive(Debug, Default)]
struct Heard {
    words: Mutex<Words>,
    more: Condvar,
}

#[derive(Debug, Default)]
struct Words {
    bytes: VecDeque<u8>,
    /// Whether a mark has come that nobody has waited for.
    marked: bool,
    /// Whether more may come.
    open: bool,
}

impl Words {
    fn add(&mut self, bytes: &[u8]) {
        self.marked |= bytes.contains(&MARK);
        self.bytes.extend(bytes.iter().filter(|byte| **byte != MARK));
        let old = self.bytes.len().saturating_sub(TAIL);
        self.bytes.drain(..old);
    }
}

impl Heard {
    fn change(&self, change: impl FnOnce(&mut Words)) {
        change(&mut self.words.lock().unwrap_or_else(PoisonError::into_inner));
        self.more.notify_all();
    }
}

impl Tail {
    fn follow(mut stderr: ChildStderr) -> Self {
        let heard = Arc::new(Heard::default());
        let hearing = Arc::clone(&heard);
        let follow = move || {
            let mut buffer = [0; TAIL];
            loop {
                match stderr.read(&mut buffer) {
                    Ok(n @ 1..) => hearing.change(|words| words.add(&buffer[..n])),
                    Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                    Ok(0) | Err(_) => break,
                }
            }
            hearing.change(|words| words.open = false);
        };
        heard.change(|words| words.open = true);
        // Without a thread there are no last words; nothing else is lost
        if thread::Builder::new().name("sidecar stderr".into()).spawn(follow).is_err() {
            heard.change(|words| words.open = false);
        }
        Self { heard }
    }

    fn wait(&self, limit: Duration) {
        self.wait_while(limit, |words| words.open);
    }

    fn wait_for_mark(&self, limit: Duration) {
        self.wait_while(limit, |words| words.open && !words.marked);
        self.heard.change(|words| words.marked = false);
    }

    fn wait_while(&self, limit: Duration, go_on: impl Fn(&Words) -> bool) {
        let words = self.heard.words.lock().unwrap_or_else(PoisonError::into_inner);
        drop(self.heard.more.wait_timeout_while(words, limit, |words| go_on(words)));
    }

    fn text(&self) -> String {
        let mut words = self.heard.words.lock().unwrap_or_else(PoisonError::into_inner);
        printable(String::from_utf8_lossy(words.bytes.make_contiguous()).trim()).into_owned()
    }
}
