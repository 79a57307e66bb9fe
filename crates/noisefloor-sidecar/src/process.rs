//! The process of a renderer: started, called with a time-out, and ended whatever it does.

use crate::frame::{self, Frame, FrameError};
use std::collections::VecDeque;
use std::ffi::OsString;
use std::io::{self, BufReader, Read};
use std::path::Path;
use std::process::{Child, ChildStderr, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// How much of standard error is kept, in bytes.
const TAIL: usize = 4096;
/// How long a process that has ended its stream, or was told to quit, may take to be gone.
const GRACE: Duration = Duration::from_secs(2);

/// Why a call gave no frame. The process is of no use any more.
#[derive(Debug)]
pub(crate) enum Failure {
    /// It ended, or closed its stream.
    Ended(Option<ExitStatus>),
    /// It did not answer in time.
    Silent,
    /// What it sent is no frame.
    Garbled(FrameError),
}

/// A request, and the longest payload its reply may have.
struct Order {
    header: Vec<u8>,
    most_payload: usize,
}

/// A running process that answers frames with frames.
#[derive(Debug)]
pub(crate) struct Process {
    child: Child,
    /// Closed before the process is reaped: that ends its standard input.
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
        let (send_child, child) = mpsc::channel();
        // One thread starts the process, writes and reads. Linux ends the process with the thread that started it (host.py asks
        // for that), and neither a full nor an empty pipe can hold up the caller.
        thread::Builder::new()
            .name("sidecar".into())
            .spawn(move || converse(command, &send_child, &receive_orders, &send_replies))?;
        let gone = || io::Error::other("the thread that was to start it ended");
        let mut child: Child = child.recv().map_err(|_| gone())??;
        let tail = child.stderr.take().map(Tail::follow).unwrap_or_default();
        Ok(Self { child, orders: Some(orders), replies, tail, broken: false })
    }

    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Sends a request and waits for its reply.
    pub(crate) fn call(
        &mut self,
        header: Vec<u8>,
        most_payload: usize,
        limit: Duration,
    ) -> Result<Frame, Failure> {
        let sent = self.orders.as_ref().is_some_and(|to| to.send(Order { header, most_payload }).is_ok());
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

    /// The last words on standard error; all of them once the process has ended.
    pub(crate) fn last_words(&mut self) -> String {
        if self.broken {
            self.end();
            self.tail.wait(GRACE);
        }
        self.tail.text()
    }

    /// How it ended, if it does within the time.
    fn wait(&mut self, limit: Duration) -> Option<ExitStatus> {
        let begun = Instant::now();
        loop {
            match self.child.try_wait() {
                Ok(Some(status)) => return Some(status),
                Ok(None) if begun.elapsed() < limit => thread::sleep(Duration::from_millis(5)),
                _ => return None,
            }
        }
    }

    /// Kills and reaps. Of a process that is gone already, both are no-ops.
    fn end(&mut self) {
        self.orders = None;
        // Only a process that is gone, or that the system does not let us kill, fails here.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // A renderer that works is asked, so that it may clean up; one that does not listen is killed.
        if !self.broken && self.call(br#"{"op":"quit"}"#.to_vec(), 0, GRACE).is_ok() {
            self.wait(GRACE);
        }
        self.end();
    }
}

fn converse(
    mut command: Command,
    send_child: &Sender<io::Result<Child>>,
    orders: &Receiver<Order>,
    replies: &Sender<Result<Frame, FrameError>>,
) {
    let mut child = match command.spawn() {
        Ok(child) => child,
        Err(error) => {
            // Nobody waits for it if the caller is gone.
            let _ = send_child.send(Err(error));
            return;
        }
    };
    let pipes = child.stdin.take().zip(child.stdout.take());
    if send_child.send(Ok(child)).is_err() {
        return;
    }
    let Some((mut stdin, stdout)) = pipes else { return };
    let mut stdout = BufReader::new(stdout);
    for Order { header, most_payload } in orders {
        let reply = match frame::write(&mut stdin, &header) {
            Ok(()) => frame::read(&mut stdout, most_payload),
            Err(error) => Err(FrameError::Io(error)),
        };
        if replies.send(reply).is_err() {
            return;
        }
    }
}

/// The end of what a process said on standard error.
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
        // Without a thread there are no last words, and nothing else is missing.
        let started = thread::Builder::new().name("sidecar stderr".into()).spawn(follow);
        Self { bytes, following: started.is_ok().then_some(following) }
    }

    fn wait(&self, limit: Duration) {
        if let Some(following) = &self.following {
            // The sender never sends: this returns at the end of the stream, or when the time is over.
            let _ = following.recv_timeout(limit);
        }
    }

    fn text(&self) -> String {
        let mut bytes = self.bytes.lock().unwrap_or_else(PoisonError::into_inner);
        String::from_utf8_lossy(bytes.make_contiguous()).trim().to_owned()
    }
}
