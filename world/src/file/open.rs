//! A file that is open: reading and writing it, and where.

use std::fs::{File, OpenOptions};
use std::io::{Error, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use esl_bytecode::Bytes;
use esl_bytecode::datum::Datum;
use tokio::sync::watch;

use super::{CHUNK, at_once, in_thread};
use crate::arrived::Arrived;
use crate::socket::lock;

/// How a file is reached.
pub(super) enum FileAccess {
    /// When the system says that it is ready.
    #[cfg(unix)]
    Polled(tokio::io::unix::AsyncFd<File>),
    /// By threads; nothing once it is closed.
    Threads(Mutex<Option<File>>),
    /// Opened for each part that is written.
    Parts(PathBuf, Mutex<WrittenAt>),
}

/// Where the next part of a file is written.
#[derive(Clone, Copy)]
pub(super) enum WrittenAt {
    /// Behind what is there.
    End,
    Position(u64),
}

/// A file that is open.
pub(super) struct Open {
    pub(super) access: FileAccess,
    /// The path, if it is read as text, and then closed at its end.
    pub(super) text: Option<PathBuf>,
    pub(super) arrived: Mutex<Arrived>,
    /// Held by the operation that reads or writes.
    pub(super) turn: tokio::sync::Mutex<()>,
    /// Changes when the file is closed.
    pub(super) closing: watch::Sender<bool>,
}

impl Open {
    pub(super) fn new(access: FileAccess, text: Option<PathBuf>) -> Open {
        let (closing, _) = watch::channel(false);
        Open { access, text, arrived: Mutex::default(), turn: tokio::sync::Mutex::new(()), closing }
    }

    /// Returns what a future comes to, unless the file is closed before.
    pub(super) async fn unless_closed<T>(
        &self,
        future: impl Future<Output = Result<T, Error>>,
    ) -> Result<T, Error> {
        let mut closing = self.closing.subscribe();
        tokio::select! {
            biased;
            _ = closing.wait_for(|&is_closed| is_closed) => Err(Error::other("it is closed")),
            result = future => result,
        }
    }

    /// Waits until something has been read, or the end is reached.
    pub(super) async fn fill(self: Arc<Open>) -> Result<(), Error> {
        let _turn = self.turn.lock().await;
        if lock(&self.arrived).is_something() {
            return Ok(());
        }
        match &self.access {
            #[cfg(unix)]
            FileAccess::Polled(file) => {
                let read = |mut file: &File| {
                    let mut bytes = vec![0; CHUNK];
                    let count = file.read(&mut bytes)?;
                    bytes.truncate(count);
                    Ok(bytes)
                };
                let bytes = file.async_io(tokio::io::Interest::READABLE, read).await?;
                lock(&self.arrived).add(&bytes);
                Ok(())
            }
            _ => {
                let open = self.clone();
                in_thread(move || open.fill_now()).await
            }
        }
    }

    /// Reads the next part of a file that threads read, unless another one has.
    pub(super) fn fill_now(&self) -> Result<(), Error> {
        let FileAccess::Threads(file) = &self.access else { return Ok(()) };
        let mut file = lock(file);
        if lock(&self.arrived).is_something() {
            return Ok(());
        }
        let mut bytes = Vec::new();
        let is_ended = match file.as_mut() {
            Some(file) => read_part(file, &mut bytes)?,
            None => true,
        };
        if is_ended && self.text.is_some() {
            *file = None;
        }
        let mut arrived = lock(&self.arrived);
        if !bytes.is_empty() {
            arrived.add(&bytes);
        }
        if is_ended {
            arrived.add(&[]);
        }
        Ok(())
    }

    /// Takes what is there without waiting.
    pub(super) fn take(&self, as_text: bool) -> Datum {
        #[cfg(unix)]
        if let FileAccess::Polled(file) = &self.access
            && !lock(&self.arrived).is_something()
            && self.turn.try_lock().is_ok()
        {
            let mut bytes = vec![0; CHUNK];
            // The end, and what is wrong, is for a call that waits.
            let count = file.get_ref().read(&mut bytes).unwrap_or(0);
            if count > 0 {
                lock(&self.arrived).add(&bytes[..count]);
            }
        }
        let mut arrived = lock(&self.arrived);
        if as_text { arrived.take_text(false) } else { arrived.take_bytes(CHUNK) }
    }

    /// Writes all of the bytes.
    pub(super) async fn write(self: Arc<Open>, bytes: Bytes) -> Result<(), Error> {
        let _turn = self.turn.lock().await;
        #[cfg(unix)]
        if let FileAccess::Polled(file) = &self.access {
            let mut rest = &bytes[..];
            while !rest.is_empty() {
                let write = |mut file: &File| file.write(rest);
                let count = file.async_io(tokio::io::Interest::WRITABLE, write).await?;
                rest = &rest[count..];
            }
            return Ok(());
        }
        let open = self.clone();
        in_thread(move || match &open.access {
            FileAccess::Threads(file) => match lock(file).as_mut() {
                Some(file) => file.write_all(&bytes),
                None => Err(Error::other("it is closed")),
            },
            FileAccess::Parts(path, next) => write_part(path, &mut lock(next), &bytes),
            #[cfg(unix)]
            FileAccess::Polled(_) => Ok(()),
        })
        .await
    }

    /// Goes on at a place of a regular file. Returns whether it does.
    pub(super) fn seek(&self, position: u64) -> Result<bool, Error> {
        let file = match &self.access {
            FileAccess::Threads(file) => file,
            FileAccess::Parts(_, next) => {
                *lock(next) = WrittenAt::Position(position);
                return Ok(true);
            }
            #[cfg(unix)]
            FileAccess::Polled(_) => return Ok(false),
        };
        let mut file = lock(file);
        if let (None, Some(path)) = (&*file, &self.text) {
            *file = Some(at_once(OpenOptions::new().read(true)).open(path)?);
        }
        let Some(file) = file.as_mut() else { return Ok(false) };
        file.seek(SeekFrom::Start(position))?;
        *lock(&self.arrived) = Arrived::from(position);
        Ok(true)
    }

    /// Returns where the next byte is read or written; `None` for behind what is there.
    pub(super) fn position(&self) -> Option<u64> {
        match &self.access {
            FileAccess::Parts(_, next) => match *lock(next) {
                WrittenAt::End => None,
                WrittenAt::Position(position) => Some(position),
            },
            _ => Some(lock(&self.arrived).position()),
        }
    }
}

/// Writes a part of a file, and says where the one after it comes.
fn write_part(path: &Path, next: &mut WrittenAt, bytes: &[u8]) -> Result<(), Error> {
    match next {
        WrittenAt::End => OpenOptions::new().append(true).create(true).open(path)?.write_all(bytes),
        WrittenAt::Position(position) => {
            let mut file = OpenOptions::new().write(true).create(true).truncate(false).open(path)?;
            file.seek(SeekFrom::Start(*position))?;
            file.write_all(bytes)?;
            *position += bytes.len() as u64;
            Ok(())
        }
    }
}

/// Reads a part of a file, and returns whether that was the last.
fn read_part(file: &mut File, bytes: &mut Vec<u8>) -> Result<bool, Error> {
    if file.metadata()?.is_file() {
        let count = file.take(CHUNK as u64).read_to_end(bytes)?;
        return Ok(count < CHUNK);
    }
    bytes.resize(CHUNK, 0);
    let count = loop {
        match file.read(bytes) {
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            result => break result?,
        }
    };
    bytes.truncate(count);
    Ok(count == 0)
}
