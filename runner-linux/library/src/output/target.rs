//! Where records go: standard output, a file, a serial line or UDP, each written by a thread of its own.
//!
//! A slow or broken target never holds up the run: a bounded queue lies between, and what does not fit is lost and counted.
//! Only a run over files waits for its targets, because there is no hurry, and nothing may be missing.

use std::fmt;
use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::net::{SocketAddr, ToSocketAddrs, UdpSocket};
use std::os::unix::fs::OpenOptionsExt;
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::termios::{OptionalActions, isatty, tcgetattr, tcsetattr};

/// Chunks that wait for a target.
const QUEUE: usize = 256;
/// Bit rate of NMEA 0183.
const BAUD: u32 = 4_800;
/// Between two attempts to open a broken target again.
const AGAIN: Duration = Duration::from_secs(1);
/// What a target gets at the end to take what is left.
const LAST_WAIT: Duration = Duration::from_secs(2);

/// Where records go.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Target {
    /// Standard output.
    Stdout,
    /// A file, which is appended to, or a serial line with its bit rate.
    Path(PathBuf, u32),
    /// A host and port.
    Udp(String),
}

impl FromStr for Target {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "-" {
            return Ok(Self::Stdout);
        }
        if let Some(address) = text.strip_prefix("udp://") {
            let port = address.rsplit_once(':').and_then(|(_, port)| port.parse::<u16>().ok());
            return match port {
                Some(_) => Ok(Self::Udp(address.to_owned())),
                None => Err(format!("{text:?} has no port; write udp://HOST:PORT, as in udp://127.0.0.1:10110")),
            };
        }
        if text.is_empty() {
            return Err("name a target: -, a file, a serial line, or udp://HOST:PORT".to_owned());
        }
        match text.rsplit_once('@').map(|(path, baud)| (path, baud.parse::<u32>())) {
            Some((path, Ok(baud))) if baud > 0 => Ok(Self::Path(path.into(), baud)),
            _ => Ok(Self::Path(text.into(), BAUD)),
        }
    }
}

impl fmt::Display for Target {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stdout => out.write_str("-"),
            Self::Path(path, _) => write!(out, "{}", path.display()),
            Self::Udp(address) => write!(out, "udp://{address}"),
        }
    }
}

/// An opened target.
enum Open {
    Stdout,
    File(File),
    Serial(File),
    Udp(UdpSocket, SocketAddr),
}

impl Target {
    fn open(&self) -> io::Result<Open> {
        match self {
            Self::Stdout => Ok(Open::Stdout),
            Self::Udp(address) => {
                let to = address.to_socket_addrs()?.next().ok_or(ErrorKind::AddrNotAvailable)?;
                let socket = UdpSocket::bind(if to.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" })?;
                socket.set_nonblocking(true)?;
                Ok(Open::Udp(socket, to))
            }
            Self::Path(path, baud) => {
                let flags = rustix::fs::OFlags::NOCTTY | rustix::fs::OFlags::NONBLOCK;
                let flags = i32::try_from(flags.bits()).unwrap_or_default();
                let file = OpenOptions::new().append(true).create(true).custom_flags(flags).open(path)?;
                if !isatty(&file) {
                    return Ok(Open::File(file));
                }
                let mut settings = tcgetattr(&file)?;
                settings.make_raw();
                settings.set_speed(*baud)?;
                tcsetattr(&file, OptionalActions::Now, &settings)?;
                Ok(Open::Serial(file))
            }
        }
    }
}

impl Open {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self {
            Self::Stdout => {
                let mut out = io::stdout().lock();
                out.write_all(bytes)?;
                out.flush()
            }
            Self::File(file) => file.write_all(bytes),
            Self::Serial(file) => write_slowly(file, bytes),
            // A sentence a datagram, as receivers expect.
            Self::Udp(socket, to) => {
                bytes.split_inclusive(|byte| *byte == b'\n').try_for_each(|line| socket.send_to(line, *to).map(|_| ()))
            }
        }
    }
}

/// Writes to a line that does not block, with a bound on the wait.
fn write_slowly(mut file: &File, mut bytes: &[u8]) -> io::Result<()> {
    while !bytes.is_empty() {
        let second = Timespec { tv_sec: 1, tv_nsec: 0 };
        if poll(&mut [PollFd::new(file, PollFlags::OUT)], Some(&second))? == 0 {
            return Err(ErrorKind::TimedOut.into());
        }
        match file.write(bytes) {
            Ok(count) => bytes = bytes.get(count..).unwrap_or_default(),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// A target with its thread.
#[derive(Debug)]
pub struct Sink {
    name: String,
    chunks: Option<SyncSender<Vec<u8>>>,
    ended: Receiver<()>,
    shared: Arc<Shared>,
    patient: bool,
}

#[derive(Debug, Default)]
struct Shared {
    lost: AtomicU64,
    closed: AtomicBool,
}

impl Sink {
    /// Opens a target and starts its thread. A patient one waits for room instead of losing records.
    ///
    /// # Errors
    /// Why it cannot be opened, with what to do.
    pub fn start(target: Target, patient: bool) -> Result<Self, String> {
        let name = target.to_string();
        let open = target.open().map_err(|error| format!("cannot write to {name}: {error}; see --output"))?;
        let (chunks, to_write) = sync_channel(QUEUE);
        let (end, ended) = sync_channel(1);
        let shared = Arc::new(Shared::default());
        let own = Arc::clone(&shared);
        let body = move || {
            write_all(&target, open, &to_write, &own);
            // Nobody may be waiting any more.
            let _ = end.try_send(());
        };
        let thread = std::thread::Builder::new().name("output".to_owned()).spawn(body);
        thread.map_err(|error| format!("cannot start a thread for {name}: {error}"))?;
        Ok(Self { name, chunks: Some(chunks), ended, shared, patient })
    }

    /// The target's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Hands over bytes to be written.
    pub fn write(&self, bytes: Vec<u8>) {
        let Some(chunks) = &self.chunks else { return };
        let mut bytes = bytes;
        loop {
            match chunks.try_send(bytes) {
                Ok(()) => return,
                Err(TrySendError::Full(back)) if self.patient && !self.is_closed() => {
                    bytes = back;
                    std::thread::sleep(Duration::from_millis(2));
                }
                Err(_) => {
                    self.shared.lost.fetch_add(1, Ordering::Relaxed);
                    return;
                }
            }
        }
    }

    /// Chunks that were lost so far.
    pub fn lost(&self) -> u64 {
        self.shared.lost.load(Ordering::Relaxed)
    }

    /// Whether whoever read it has gone: the end of a pipe.
    pub fn is_closed(&self) -> bool {
        self.shared.closed.load(Ordering::Relaxed)
    }

    /// Gives the target a last moment to take what is left; false if that was not enough.
    pub fn finish(mut self) -> bool {
        self.chunks = None;
        let patience = if self.patient { Duration::from_secs(60) } else { LAST_WAIT };
        self.ended.recv_timeout(patience).is_ok()
    }
}

fn write_all(target: &Target, open: Open, chunks: &Receiver<Vec<u8>>, shared: &Shared) {
    let mut open = Some(open);
    let mut failed_at = None::<Instant>;
    for bytes in chunks {
        if open.is_none() && failed_at.is_none_or(|at| at.elapsed() >= AGAIN) {
            failed_at = Some(Instant::now());
            open = target.open().ok();
        }
        let written = match &mut open {
            Some(open) => open.write(&bytes),
            None => Err(ErrorKind::NotConnected.into()),
        };
        let Err(error) = written else { continue };
        shared.lost.fetch_add(1, Ordering::Relaxed);
        match target {
            // Nobody listens on that port yet, or the network is away: the next datagram may arrive.
            Target::Udp(_) => {}
            Target::Stdout if error.kind() == ErrorKind::BrokenPipe => {
                shared.closed.store(true, Ordering::Relaxed);
                return;
            }
            _ => {
                if open.take().is_some() {
                    tracing::warn!(target = %target, %error, "an output failed; it will be opened again");
                    failed_at = Some(Instant::now());
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_are_written_as_they_are_read() {
        let target = |text: &str| text.parse::<Target>();
        assert_eq!(target("-"), Ok(Target::Stdout));
        assert_eq!(target("udp://127.0.0.1:10110"), Ok(Target::Udp("127.0.0.1:10110".to_owned())));
        assert!(target("udp://127.0.0.1").is_err_and(|why| why.contains("port")));
        assert_eq!(target("/dev/ttyUSB0@38400"), Ok(Target::Path("/dev/ttyUSB0".into(), 38_400)));
        assert_eq!(target("me@home"), Ok(Target::Path("me@home".into(), BAUD)));
        assert!(target("").is_err());
    }

    #[test]
    fn a_target_that_takes_nothing_loses_records_and_holds_up_nobody() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("pipe");
        rustix::fs::mknodat(rustix::fs::CWD, &path, rustix::fs::FileType::Fifo, 0o600.into(), 0).expect("a pipe");
        // A reader that never reads.
        let _reader = OpenOptions::new().read(true).custom_flags(0o4000).open(&path).expect("a reader");
        let sink = Sink::start(Target::Path(path, BAUD), false).expect("a sink");
        let begin = Instant::now();
        (0..2_000).for_each(|_| sink.write(vec![b'x'; 1_000]));
        assert!(begin.elapsed() < Duration::from_secs(1));
        assert!(sink.finish(), "the pipe does not block");
    }
}
