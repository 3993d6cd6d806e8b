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
use std::io::Error;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_host::{FileAnswer, FileRequest, HostError, HostFailure, Right, request_of_files};
use esl_vm::embed::{HostFunction, Need};
use esl_vm::vm::Vm;

use crate::data::{CallArguments, Numbered, boolean, failure, handle, integer, nil, text};
use crate::operation::{Completion, define, define_with_end};

mod open;

use open::{FileAccess, Open, WrittenAt};

/// Most bytes that are read at a time.
const CHUNK: usize = 1 << 15;

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // What it guards is whole at every moment, so a panic elsewhere does not corrupt it.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
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
            let (open, bytes) = (known.get(arguments.number(0)?)?, arguments.bytes_or_text(1, 2)?);
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
    define(machine, "%FILE-TRUE-NAME", &read, |arguments| async move {
        let path = arguments.text(0)?;
        let request = move || Ok(request_of_files(FileRequest::TrueName(&path)));
        let result = in_thread(request).await.unwrap_or_else(|error| Err(HostError::from(&error)));
        Ok(match result {
            Ok(FileAnswer::Names(names)) => vec![names.first().map_or_else(nil, |name| text(name))],
            Ok(_) | Err(HostError::NotFound) => vec![nil()],
            Err(error) => vec![nil(), text(&error.to_string())],
        })
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
