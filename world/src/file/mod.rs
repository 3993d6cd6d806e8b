//! Files that are read and written in parts, of which each makes only the calling task wait.
//!
//! FIFOs, terminals and other devices are read and written when the system says that they are ready; regular
//! files, and devices about which the system says nothing, by threads that may be delayed. Input is buffered
//! here until the program takes it, so nothing is lost when a call is left at the moment at which its data
//! come.
//!
//! A regular file that is written is opened for each part, by the path that was permitted, so that a stream
//! left open takes no descriptor; one that is read as text is closed at its end.

use std::fs::{File, OpenOptions};
use std::io::Error;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use esl_host::{
    FileAnswer, FileRequest, HostError, HostFailure, HostHandle, HostObject, HostRows, Inbox, IntoDatum,
    Payload, Right, Values, request_of_files,
};

use crate::operation::{Cancelled, spawned, to_its_end};
use crate::slot::OpenSlot;

mod open;

use open::{FileAccess, Open, WrittenAt};

/// Most bytes that are read at a time.
const CHUNK: usize = 1 << 15;

/// Returns what a function comes to that the system may delay.
async fn in_thread<T: Send + 'static>(
    function: impl FnOnce() -> Result<T, Error> + Send + 'static,
) -> Result<T, Error> {
    tokio::task::spawn_blocking(function).await.map_err(Error::other)?
}

/// A file of the program's.
#[derive(Default)]
struct FileSlot(OpenSlot<Open>);

impl HostObject for FileSlot {
    const KIND: &'static str = "FILE";
}

impl FileSlot {
    fn get(&self) -> Result<Arc<Open>, HostFailure> {
        self.0.get().ok_or_else(|| HostFailure::new("SIMPLE-ERROR", "The file is closed."))
    }

    fn close(&self) {
        if let Some(open) = self.0.close() {
            // No operation may wait for it.
            _ = open.closing.send(true);
        }
    }
}

impl Drop for FileSlot {
    fn drop(&mut self) {
        self.close();
    }
}

/// Values of an operation on a file: one, or `NIL` and what is wrong.
type FileValues = Result<Values, HostFailure>;

fn answer<T: IntoDatum>(result: Result<T, Error>) -> FileValues {
    Ok(match result {
        Ok(value) => Values(vec![value.into_datum()]),
        Err(error) => wrong(&HostError::from(&error)),
    })
}

fn wrong(error: &HostError) -> Values {
    Values(vec![().into_datum(), error.to_string().into_datum()])
}

/// Returns the functions of file streams, which the library calls by their names.
pub(crate) fn rows(inbox: &Inbox) -> HostRows {
    let mut rows = HostRows::new(inbox);
    add_immediate(&mut rows);
    add_requests(&mut rows);
    rows.operation(
        spawned,
        "%FILE-OPEN-INPUT",
        ["file", "path", "as-text"],
        "Opens the file PATH for reading as FILE. Returns whether it is a regular file.",
        open_input,
    )
    .needs(Right::Read, "path");
    rows.operation(
        spawned,
        "%MODULE-OPEN-INPUT",
        ["file", "path", "as-text"],
        "As %FILE-OPEN-INPUT, of a module.",
        open_input,
    )
    .needs(Right::Module, "path");
    rows.operation(
        spawned,
        "%FILE-OPEN-OUTPUT",
        ["file", "path", "mode"],
        "Opens the file PATH for writing as FILE: MODE 0 replaces it, 1 appends to it, 2 fails if there is one, 3 \
         writes over it from its beginning.",
        open_output,
    )
    .needs(Right::Write, "path");
    rows.operation(
        spawned,
        "%FILE-AWAIT",
        ["file"],
        "Waits until something can be taken.",
        |file: HostHandle<FileSlot>| async move {
            let open = file.get()?;
            answer(open.clone().unless_closed(open.fill()).await)
        },
    );
    rows.operation(
        to_its_end,
        "%FILE-WRITE",
        ["file", "contents"],
        "Writes CONTENTS, a text or bytes.",
        |mut cancelled: Cancelled, file: HostHandle<FileSlot>, Payload(bytes): Payload| async move {
            let open = file.get()?;
            // A disk is waited for: what is left half-written would come later, among other things.
            let is_disk = matches!(open.access, FileAccess::Parts(..));
            let target = open.clone();
            let write = open.unless_closed(target.write(bytes));
            tokio::select! {
                biased;
                () = cancelled.wait(), if !is_disk => Err(HostFailure::new("CANCELLED", "")),
                result = write => answer(result),
            }
        },
    );
    rows.operation(
        spawned,
        "%FILE-SEEK",
        ["file", "position"],
        "Goes on at POSITION. Returns whether FILE is one that can.",
        |file: HostHandle<FileSlot>, position: u64| async move {
            let open = file.get()?;
            let _turn = open.turn.lock().await;
            let seeking = open.clone();
            answer(in_thread(move || seeking.seek(position)).await)
        },
    );
    rows.operation(
        spawned,
        "%FILE-SIZE",
        ["path"],
        "Returns the number of bytes of the file PATH.",
        |path: String| async move {
            let size = in_thread(move || std::fs::metadata(path)).await.map(|metadata| metadata.len());
            answer(size.map(|size| i64::try_from(size).unwrap_or(i64::MAX)))
        },
    )
    .idempotent()
    .needs(Right::Read, "path");
    rows
}

/// Adds the operations on files as wholes.
fn add_requests(rows: &mut HostRows) {
    let probe = |path: String| async move { answer(in_thread(move || Ok(Path::new(&path).is_file())).await) };
    let is_file = "Returns whether there is a file PATH.";
    rows.operation(spawned, "%FILE-PROBE", ["path"], is_file, probe).idempotent().needs(Right::Read, "path");
    rows.operation(spawned, "%FILE-PROBE-OUTPUT", ["path"], is_file, probe)
        .idempotent()
        .needs(Right::Write, "path");
    rows.operation(spawned, "%MODULE-PROBE", ["path"], is_file, probe)
        .idempotent()
        .needs(Right::Module, "path");
    rows.operation(spawned, "%FILE-DELETE", ["path"], "Deletes the file PATH.", |path: String| async move {
        answer(in_thread(move || std::fs::remove_file(path)).await.map(|()| true))
    })
    .needs(Right::Write, "path");
    rows.operation(
        spawned,
        "%FILE-LIST",
        ["path"],
        "Returns the names of the entries of the folder PATH.",
        |path: String| async move { requested(move || request_of_files(FileRequest::List(&path))).await },
    )
    .idempotent()
    .needs(Right::Read, "path");
    rows.operation(
        spawned,
        "%FILE-TRUE-NAME",
        ["path"],
        "Returns the name of PATH after all links; NIL if nothing is there.",
        |path: String| async move {
            let request = move || Ok(request_of_files(FileRequest::TrueName(&path)));
            let result = in_thread(request).await.unwrap_or_else(|error| Err(HostError::from(&error)));
            Ok(match result {
                Ok(FileAnswer::Names(names)) => Values(vec![names.into_iter().next().into_datum()]),
                Ok(_) | Err(HostError::NotFound) => Values(vec![().into_datum()]),
                Err(error) => wrong(&error),
            })
        },
    )
    .idempotent()
    .needs(Right::Read, "path");
    rows.operation(
        spawned,
        "%FILE-DATE",
        ["path"],
        "Returns the time at which the file PATH was changed.",
        |path: String| async move { requested(move || request_of_files(FileRequest::Date(&path))).await },
    )
    .idempotent()
    .needs(Right::Read, "path");
    rows.operation(
        spawned,
        "%FILE-MAKE-FOLDERS",
        ["path"],
        "Makes the folders that PATH needs.",
        |path: String| async move {
            requested(move || request_of_files(FileRequest::MakeFolders(&path))).await
        },
    )
    .needs(Right::Write, "path");
    rows.operation(
        spawned,
        "%FILE-RENAME",
        ["from", "to"],
        "Renames the file FROM.",
        |from: String, to: String| async move {
            requested(move || request_of_files(FileRequest::Rename(&from, &to))).await
        },
    )
    .needs(Right::Write, "from")
    .needs(Right::Write, "to");
}

/// Returns the values of an operation that a thread performs.
async fn requested(request: impl FnOnce() -> Result<FileAnswer, HostError> + Send + 'static) -> FileValues {
    let result = in_thread(move || Ok(request())).await.unwrap_or_else(|error| Err(HostError::from(&error)));
    Ok(match result {
        Ok(FileAnswer::Names(names)) => Values(vec![names.into_datum()]),
        Ok(FileAnswer::Date(seconds)) => Values(vec![seconds.into_datum()]),
        Ok(FileAnswer::Done(is_done)) => Values(vec![is_done.into_datum()]),
        Err(error) => wrong(&error),
    })
}

/// Adds the functions that do not wait.
fn add_immediate(rows: &mut HostRows) {
    rows.constructor::<FileSlot>("%FILE-NEW", "Returns a file that is not open.");
    rows.at_once(
        "%FILE-TAKE",
        ["file", "as-text"],
        "Takes the buffered input, a text or bytes; NIL at the end.",
        |file: HostHandle<FileSlot>, as_text: bool| Ok(file.get()?.take(as_text)),
    )
    .local();
    rows.at_once(
        "%FILE-POSITION",
        ["file"],
        "Returns where the next byte is read or written; NIL for the end.",
        |file: HostHandle<FileSlot>| {
            Ok(file.get()?.position().map(|position| i64::try_from(position).unwrap_or(i64::MAX)))
        },
    )
    .local();
    rows.at_once("%FILE-CLOSE", ["file"], "Closes FILE.", |file: HostHandle<FileSlot>| {
        file.close();
        Ok(())
    })
    .closes();
}

/// Returns options that open a file without waiting, such as for the other end of a FIFO.
fn at_once(options: &mut OpenOptions) -> &mut OpenOptions {
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt;
        let flags = rustix::fs::OFlags::NONBLOCK | rustix::fs::OFlags::NOCTTY;
        options.custom_flags(flags.bits().cast_signed());
    }
    options
}

/// Returns how a file that is open is reached: `None` stands for by threads.
#[cfg(unix)]
fn polled(file: &File, interest: tokio::io::Interest) -> Option<FileAccess> {
    if file.metadata().is_ok_and(|metadata| metadata.is_file()) {
        return None;
    }
    // The system refuses what is always ready.
    #[allow(
        deprecated,
        reason = "the successor needs the promise of one open descriptor, which a `File` keeps"
    )]
    let registered = tokio::io::unix::AsyncFd::with_interest(file.try_clone().ok()?, interest);
    registered.ok().map(FileAccess::Polled)
}

/// Opens a file to be read.
async fn open_input(file: HostHandle<FileSlot>, path: String, as_text: bool) -> FileValues {
    let slot = file;
    let text = as_text.then(|| PathBuf::from(&path));
    let open = move || {
        let file = at_once(OpenOptions::new().read(true)).open(&path)?;
        if file.metadata()?.is_dir() { Err(Error::other("it is a directory")) } else { Ok(file) }
    };
    let file = match in_thread(open).await {
        Ok(file) => file,
        Err(error) => return answer::<()>(Err(error)),
    };
    let is_regular = file.metadata().is_ok_and(|metadata| metadata.is_file());
    #[cfg(unix)]
    let polled = polled(&file, tokio::io::Interest::READABLE);
    #[cfg(not(unix))]
    let polled = None;
    let access = polled.unwrap_or_else(|| FileAccess::Threads(Mutex::new(Some(file))));
    _ = slot.0.open(Open::new(access, text));
    if is_regular {
        // An unreadable file fails here, and a short one is read at once.
        return answer(slot.get()?.fill().await.map(|()| true));
    }
    answer(Ok(false))
}

/// Opens a file to be written.
async fn open_output(file: HostHandle<FileSlot>, path: String, mode: i64) -> FileValues {
    let path = PathBuf::from(path);
    #[cfg(unix)]
    {
        let looked_at = path.clone();
        let is_device = in_thread(move || Ok(is_device(&looked_at))).await.unwrap_or(false);
        if is_device && mode != 2 {
            return answer(open_device(&file, path).await);
        }
    }
    let made = path.clone();
    let make = move || {
        let mut options = OpenOptions::new();
        match mode {
            0 => options.write(true).create(true).truncate(true),
            1 => options.append(true).create(true),
            3 => options.write(true).create(true).truncate(false),
            _ => options.write(true).create_new(true),
        };
        options.open(made).map(drop)
    };
    if let Err(error) = in_thread(make).await {
        return answer::<()>(Err(error));
    }
    let next = if mode == 3 { WrittenAt::Position(0) } else { WrittenAt::End };
    _ = file.0.open(Open::new(FileAccess::Parts(path, Mutex::new(next)), None));
    answer(Ok(()))
}

#[cfg(unix)]
fn is_device(path: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt;
    std::fs::metadata(path).is_ok_and(|metadata| {
        let kind = metadata.file_type();
        kind.is_fifo() || kind.is_char_device() || kind.is_block_device()
    })
}

/// Opens a FIFO, once it has a reader, or a device, for output.
#[cfg(unix)]
async fn open_device(slot: &FileSlot, path: PathBuf) -> Result<(), Error> {
    let mut pause = std::time::Duration::from_millis(1);
    loop {
        let opened = path.clone();
        match in_thread(move || at_once(OpenOptions::new().write(true)).open(opened)).await {
            Ok(file) => {
                let polled = polled(&file, tokio::io::Interest::WRITABLE);
                let access = polled.unwrap_or_else(|| FileAccess::Threads(Mutex::new(Some(file))));
                _ = slot.0.open(Open::new(access, None));
                return Ok(());
            }
            // The system does not report the arrival of a reader, so it is asked again.
            Err(error)
                if error.raw_os_error() == Some(rustix::io::Errno::NXIO.raw_os_error()) && is_fifo(&path) =>
            {
                tokio::time::sleep(pause).await;
                pause = (pause * 2).min(std::time::Duration::from_millis(50));
            }
            Err(error) => return Err(error),
        }
    }
}

#[cfg(unix)]
fn is_fifo(path: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt;
    std::fs::metadata(path).is_ok_and(|metadata| metadata.file_type().is_fifo())
}
