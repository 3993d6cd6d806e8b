//! Files that are read and written in parts, of which each makes only the calling task wait.
//!
//! FIFOs, terminals and other devices are read and written when the system says that they are ready; regular
//! files, and devices about which the system says nothing, by threads that may be delayed. What was read is
//! kept here until the program takes it, so nothing is lost when a call is left at the moment at which its
//! data come.
//!
//! A regular file that is written is opened for each part, by the path that was permitted, so that a stream
//! that nobody closes takes no descriptor; one that is read as text is closed at its end.

use std::fs::{File, OpenOptions};
use std::io::{Error, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_vm::embed::{HostFunction, Need};
use esl_vm::host::{FileAnswer, FileRequest, HostError, HostFailure, Right, request_of_files};
use esl_vm::vm::Vm;
use tokio::sync::watch;

use crate::arrived::Arrived;
use crate::data::{CallArguments, Numbered, boolean, bytes_of, failure, handle, integer, nil, text};
use crate::operation::{Completion, define, define_with_end};

/// Most bytes that are read at a time.
const CHUNK: usize = 1 << 15;

/// How a file is reached.
enum FileAccess {
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
enum WrittenAt {
    /// Behind what is there.
    End,
    Position(u64),
}

/// A file that is open.
struct Open {
    access: FileAccess,
    /// The path, if it is read as text, and then closed at its end.
    text: Option<PathBuf>,
    arrived: Mutex<Arrived>,
    /// Held by the one who reads or writes.
    turn: tokio::sync::Mutex<()>,
    /// Changes when the file is closed.
    closing: watch::Sender<bool>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // What it guards is whole at every moment, so a panic elsewhere does not corrupt it.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Open {
    fn new(access: FileAccess, text: Option<PathBuf>) -> Open {
        let (closing, _) = watch::channel(false);
        Open { access, text, arrived: Mutex::default(), turn: tokio::sync::Mutex::new(()), closing }
    }

    /// Returns what a future comes to, unless the file is closed before.
    async fn unless_closed<T>(&self, future: impl Future<Output = Result<T, Error>>) -> Result<T, Error> {
        let mut closing = self.closing.subscribe();
        tokio::select! {
            biased;
            _ = closing.wait_for(|&is_closed| is_closed) => Err(Error::other("it is closed")),
            result = future => result,
        }
    }

    /// Waits until something has been read, or the end is reached.
    async fn fill(self: Arc<Open>) -> Result<(), Error> {
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
    fn fill_now(&self) -> Result<(), Error> {
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
    fn take(&self, as_text: bool) -> Datum {
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
    async fn write(self: Arc<Open>, bytes: Vec<u8>) -> Result<(), Error> {
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
    fn seek(&self, position: u64) -> Result<bool, Error> {
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
    fn position(&self) -> Option<u64> {
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

/// Returns what a function comes to that the system may delay.
async fn in_thread<T: Send + 'static>(
    function: impl FnOnce() -> Result<T, Error> + Send + 'static,
) -> Result<T, Error> {
    tokio::task::spawn_blocking(function).await.map_err(Error::other)?
}

/// The open files of a machine.
#[derive(Clone, Default)]
struct Files(Arc<Mutex<Numbered<Arc<Open>>>>);

impl Files {
    /// Returns the number of a file that is about to be opened.
    fn add(&self) -> i64 {
        let mut files = lock(&self.0);
        files.0 += 1;
        let number = files.0;
        files.1.insert(number, None);
        number
    }

    fn get(&self, number: i64) -> Result<Arc<Open>, HostFailure> {
        let open = lock(&self.0).1.get(&number).cloned().flatten();
        open.ok_or_else(|| failure("SIMPLE-ERROR", "The file is closed."))
    }

    /// Says what a number stands for, unless it has been closed meanwhile.
    fn set(&self, number: i64, open: Open) {
        if let Some(place) = lock(&self.0).1.get_mut(&number) {
            *place = Some(Arc::new(open));
        }
    }

    fn close(&self, number: i64) {
        let open = lock(&self.0).1.remove(&number).flatten();
        if let Some(open) = open {
            // Nobody may wait for it.
            _ = open.closing.send(true);
        }
    }
}

/// Returns the values of an operation on a file: one, or `NIL` and what is wrong.
fn answer(result: Result<Datum, Error>) -> Completion {
    Ok(match result {
        Ok(value) => vec![value],
        Err(error) => vec![nil(), text(&HostError::from(&error).to_string())],
    })
}

/// Gives a machine the operations of file streams.
pub(crate) fn install(machine: &mut Vm) {
    let files = Files::default();
    define_immediate(machine, &files);
    define_requests(machine);
    let known = files.clone();
    let read = [Need { right: Right::Read, argument: 1 }];
    define(machine, "%FILE-OPEN-INPUT", &read, move |arguments| open_input(arguments, known.clone()));
    let known = files.clone();
    let read_module = [Need { right: Right::Module, argument: 1 }];
    define(machine, "%MODULE-OPEN-INPUT", &read_module, move |arguments| {
        open_input(arguments, known.clone())
    });
    let known = files.clone();
    let write = [Need { right: Right::Write, argument: 1 }];
    define(machine, "%FILE-OPEN-OUTPUT", &write, move |arguments| open_output(arguments, known.clone()));
    let known = files.clone();
    define(machine, "%FILE-AWAIT", &[], move |arguments| {
        let open = arguments.number(0).and_then(|number| known.get(number));
        async move {
            let open = open?;
            answer(open.clone().unless_closed(open.fill()).await.map(|()| nil()))
        }
    });
    let known = files.clone();
    define_with_end(machine, "%FILE-WRITE", &[], move |arguments, mut cancelled| {
        let known = known.clone();
        async move {
            let (open, text) = (known.get(arguments.number(0)?)?, arguments.text(1)?);
            let bytes = if arguments.is_true(2) { bytes_of(&text) } else { text.into_bytes() };
            // A disk is waited for: what is left half-written would come later, among other things.
            let is_disk = matches!(open.access, FileAccess::Parts(..));
            let target = open.clone();
            let write = open.unless_closed(target.write(bytes));
            tokio::select! {
                biased;
                () = cancelled.wait(), if !is_disk => Err(failure("CANCELLED", "")),
                result = write => answer(result.map(|()| nil())),
            }
        }
    });
    let known = files.clone();
    define(machine, "%FILE-SEEK", &[], move |arguments| {
        let known = known.clone();
        async move {
            let open = known.get(arguments.number(0)?)?;
            let position = u64::try_from(arguments.integer(1)?).unwrap_or(0);
            let _turn = open.turn.lock().await;
            let seeking = open.clone();
            answer(in_thread(move || seeking.seek(position)).await.map(boolean))
        }
    });
    let read = [Need { right: Right::Read, argument: 0 }];
    define(machine, "%FILE-SIZE", &read, |arguments| async move {
        let path = arguments.text(0)?;
        let size = in_thread(move || std::fs::metadata(path)).await.map(|metadata| metadata.len());
        answer(size.map(|size| integer(i64::try_from(size).unwrap_or(i64::MAX))))
    });
}

/// Gives a machine the operations on files as wholes.
fn define_requests(machine: &mut Vm) {
    let read = [Need { right: Right::Read, argument: 0 }];
    let write = [Need { right: Right::Write, argument: 0 }];
    let both = [write[0], Need { right: Right::Write, argument: 1 }];
    let read_module = [Need { right: Right::Module, argument: 0 }];
    let probes = [("%FILE-PROBE", read), ("%FILE-PROBE-OUTPUT", write), ("%MODULE-PROBE", read_module)];
    for (name, need) in probes {
        define(machine, name, &need, |arguments| async move {
            let path = arguments.text(0)?;
            answer(in_thread(move || Ok(Path::new(&path).is_file())).await.map(boolean))
        });
    }
    define(machine, "%FILE-DELETE", &write, |arguments| async move {
        let path = arguments.text(0)?;
        answer(in_thread(move || std::fs::remove_file(path)).await.map(|()| boolean(true)))
    });
    define(machine, "%FILE-LIST", &read, |arguments| async move {
        let path = arguments.text(0)?;
        requested(move || request_of_files(FileRequest::List(&path))).await
    });
    define(machine, "%FILE-DATE", &read, |arguments| async move {
        let path = arguments.text(0)?;
        requested(move || request_of_files(FileRequest::Date(&path))).await
    });
    define(machine, "%FILE-MAKE-FOLDERS", &write, |arguments| async move {
        let path = arguments.text(0)?;
        requested(move || request_of_files(FileRequest::MakeFolders(&path))).await
    });
    define(machine, "%FILE-RENAME", &both, |arguments| async move {
        let (from, to) = (arguments.text(0)?, arguments.text(1)?);
        requested(move || request_of_files(FileRequest::Rename(&from, &to))).await
    });
}

/// Returns the values of an operation that a thread performs.
async fn requested(request: impl FnOnce() -> Result<FileAnswer, HostError> + Send + 'static) -> Completion {
    let result = in_thread(move || Ok(request())).await.unwrap_or_else(|error| Err(HostError::from(&error)));
    Ok(match result {
        Ok(FileAnswer::Names(names)) => {
            vec![Datum::list(names.iter().map(|name| text(name)).collect::<Vec<_>>(), Span::default())]
        }
        Ok(FileAnswer::Date(seconds)) => vec![integer(seconds)],
        Ok(FileAnswer::Done(is_done)) => vec![boolean(is_done)],
        Err(error) => vec![nil(), text(&error.to_string())],
    })
}

/// Gives a machine the functions that do not wait.
fn define_immediate(machine: &mut Vm, files: &Files) {
    let mut define = |name: &str, function: fn(CallArguments, &Files) -> Result<Datum, HostFailure>| {
        let files = files.clone();
        let function = move |arguments: &[Datum]| function(CallArguments(arguments.to_vec()), &files);
        machine.add_host_function(name, HostFunction::AtOnce(Box::new(function)));
    };
    define("%FILE-NEW", |_, files| {
        let known = files.clone();
        Ok(handle("FILE", files.add(), move |number| known.close(number)))
    });
    define("%FILE-TAKE", |arguments, files| Ok(files.get(arguments.number(0)?)?.take(arguments.is_true(1))));
    define("%FILE-POSITION", |arguments, files| {
        let position = files.get(arguments.number(0)?)?.position();
        Ok(position.map_or_else(nil, |position| integer(i64::try_from(position).unwrap_or(i64::MAX))))
    });
    define("%FILE-CLOSE", |arguments, files| {
        files.close(arguments.number(0)?);
        Ok(nil())
    });
}

/// Returns options that open a file without waiting for anybody, such as the other end of a FIFO.
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
        reason = "what its successor has to be promised, a `File` keeps: one open descriptor"
    )]
    let registered = tokio::io::unix::AsyncFd::with_interest(file.try_clone().ok()?, interest);
    registered.ok().map(FileAccess::Polled)
}

/// `%FILE-OPEN-INPUT`: number, path, whether it is read as text.
async fn open_input(arguments: CallArguments, files: Files) -> Completion {
    let (number, path) = (arguments.number(0)?, arguments.text(1)?);
    let text = if arguments.is_true(2) { Some(PathBuf::from(&path)) } else { None };
    let open = move || {
        let file = at_once(OpenOptions::new().read(true)).open(&path)?;
        if file.metadata()?.is_dir() { Err(Error::other("it is a directory")) } else { Ok(file) }
    };
    let file = match in_thread(open).await {
        Ok(file) => file,
        Err(error) => return answer(Err(error)),
    };
    let is_regular = file.metadata().is_ok_and(|metadata| metadata.is_file());
    #[cfg(unix)]
    let polled = polled(&file, tokio::io::Interest::READABLE);
    #[cfg(not(unix))]
    let polled = None;
    let access = polled.unwrap_or_else(|| FileAccess::Threads(Mutex::new(Some(file))));
    files.set(number, Open::new(access, text));
    if is_regular {
        // What cannot be read fails here, and a short file is there at once.
        return answer(files.get(number)?.fill().await.map(|()| boolean(true)));
    }
    answer(Ok(boolean(false)))
}

/// `%FILE-OPEN-OUTPUT`: number, path, mode: 0 replaces the file, 1 appends to it, 2 fails if there is one, 3
/// writes over it from its beginning.
async fn open_output(arguments: CallArguments, files: Files) -> Completion {
    let (number, path, mode) =
        (arguments.number(0)?, PathBuf::from(arguments.text(1)?), arguments.integer(2)?);
    #[cfg(unix)]
    {
        let looked_at = path.clone();
        let is_device = in_thread(move || Ok(is_device(&looked_at))).await.unwrap_or(false);
        if is_device && mode != 2 {
            return answer(open_device(number, path, &files).await.map(|()| nil()));
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
        return answer(Err(error));
    }
    let next = if mode == 3 { WrittenAt::Position(0) } else { WrittenAt::End };
    files.set(number, Open::new(FileAccess::Parts(path, Mutex::new(next)), None));
    answer(Ok(nil()))
}

#[cfg(unix)]
fn is_device(path: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt;
    std::fs::metadata(path).is_ok_and(|metadata| {
        let kind = metadata.file_type();
        kind.is_fifo() || kind.is_char_device() || kind.is_block_device()
    })
}

/// Opens a FIFO, when somebody reads it, or a device, for output.
#[cfg(unix)]
async fn open_device(number: i64, path: PathBuf, files: &Files) -> Result<(), Error> {
    let mut pause = std::time::Duration::from_millis(1);
    loop {
        let opened = path.clone();
        match in_thread(move || at_once(OpenOptions::new().write(true)).open(opened)).await {
            Ok(file) => {
                let polled = polled(&file, tokio::io::Interest::WRITABLE);
                let access = polled.unwrap_or_else(|| FileAccess::Threads(Mutex::new(Some(file))));
                files.set(number, Open::new(access, None));
                return Ok(());
            }
            // The system tells nobody when a reader comes, so it is asked again.
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
