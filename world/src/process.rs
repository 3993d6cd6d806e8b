//! Other programs: run to their end, or launched and left to themselves.
//!
//! A program that is run is stopped when its call is left: by SIGTERM, and by SIGKILL if it has not ended
//! within [`GRACE`]. The call is over when the program is.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::{ExitStatus, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use esl_bytecode::datum::Datum;
use esl_host::{HostFailure, Right};
use esl_vm::embed::{HostFunction, Need};
use esl_vm::vm::Vm;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWriteExt};
use tokio::process::{Child, Command};
use tokio::sync::{mpsc, watch};

use crate::data::{CallArguments, boolean, failure, integer, nil, text};
use crate::event_loop;
use crate::operation::{Cancelled, Completion, define, define_with_end};
use crate::socket::{Connection, Sockets};

/// Time that a program has between SIGTERM and SIGKILL.
const GRACE: Duration = Duration::from_secs(2);
/// Most bytes of output that are kept of a program that is run.
const MOST_OUTPUT: u64 = 64 << 20;

/// A program that was launched.
#[derive(Clone)]
struct Launched {
    /// Its exit status, when it has ended.
    status: watch::Receiver<Option<i32>>,
    /// Requests to end.
    end: mpsc::UnboundedSender<StopRequest>,
}

/// How a program is asked to end.
enum StopRequest {
    Politely,
    AtOnce,
}

/// The launched programs of a machine, by number.
#[derive(Clone, Default)]
struct Programs(Arc<Mutex<HashMap<i64, Launched>>>);

impl Programs {
    fn lock(&self) -> MutexGuard<'_, HashMap<i64, Launched>> {
        // The table is whole at every moment, so a panic elsewhere does not corrupt it.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn get(&self, number: i64) -> Result<Launched, HostFailure> {
        self.lock().get(&number).cloned().ok_or_else(|| failure("PROCESS-ERROR", "there is no such process"))
    }

    fn add(&self, launched: Launched) -> i64 {
        let mut programs = self.lock();
        let number = programs.len() as i64 + 1;
        programs.insert(number, launched);
        number
    }
}

/// Gives a machine the operations of `:process`.
pub(crate) fn install(machine: &mut Vm, sockets: &Sockets) {
    let needs = [Need { right: Right::Run, argument: 0 }];
    define_with_end(machine, "%PROCESS-RUN", &needs, run);
    let programs = Programs::default();
    let (known, sockets) = (programs.clone(), sockets.clone());
    define(machine, "%PROCESS-LAUNCH", &needs, move |arguments| {
        launch(arguments, known.clone(), sockets.clone())
    });
    let known = programs.clone();
    define(machine, "%PROCESS-WAIT", &[], move |arguments| {
        let launched = arguments.integer(0).and_then(|number| known.get(number));
        async move { Ok(vec![integer(status_of(launched?).await)]) }
    });
    let known = programs.clone();
    define(machine, "%PROCESS-END", &[], move |arguments| {
        let launched = arguments.integer(0).and_then(|number| known.get(number));
        async move { Ok(vec![integer(end(launched?).await)]) }
    });
    let alive = move |arguments: &[Datum]| {
        let launched = programs.get(CallArguments(arguments.to_vec()).integer(0)?)?;
        let is_alive = launched.status.borrow().is_none();
        Ok(boolean(is_alive))
    };
    machine.add_host_function("%PROCESS-ALIVE", HostFunction::AtOnce(Box::new(alive)));
}

/// Returns the path of a program, found as a shell would. The environment that the program is given plays no
/// part, or the right to run one program could be used for another.
fn find_program(name: &str) -> Option<PathBuf> {
    if name.contains('/') {
        return Some(name.into());
    }
    let folders = std::env::var_os("PATH")?;
    std::env::split_paths(&folders)
        .filter(|folder| folder.is_absolute())
        .map(|folder| folder.join(name))
        .find(|path| is_executable(path))
}

#[cfg(unix)]
fn is_executable(path: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt;
    path.metadata().is_ok_and(|metadata| metadata.is_file() && metadata.permissions().mode() & 0o111 != 0)
}

#[cfg(not(unix))]
fn is_executable(path: &Path) -> bool {
    path.is_file()
}

/// Returns the command of a call whose arguments begin with the program and its arguments, and have the
/// folder and the environment from `index` on.
fn command(arguments: &CallArguments, index: usize) -> Result<Command, HostFailure> {
    let name = arguments.text(0)?;
    let unknown = || failure("PROCESS-ERROR", format!("there is no program `{name}`"));
    let mut command = Command::new(find_program(&name).ok_or_else(unknown)?);
    // What is in the arguments is the program's; only its own name tells it under which it was called.
    #[cfg(unix)]
    command.arg0(&name);
    command.args(arguments.texts(1)?).envs(arguments.pairs(index + 1)?);
    if let Some(folder) = arguments.text_if_any(index)? {
        command.current_dir(folder);
    }
    Ok(command)
}

fn start(mut command: Command, name: &str) -> Result<Child, HostFailure> {
    command.spawn().map_err(|error| {
        // The system does not say which of the two is not there.
        let folder = command.as_std().get_current_dir().filter(|folder| !folder.is_dir());
        let place =
            folder.map_or(String::new(), |folder| format!(" in {}, which is no folder", folder.display()));
        failure("PROCESS-ERROR", format!("`{name}` cannot be run{place}: {error}"))
    })
}

fn pipe_if(is_wanted: bool) -> Stdio {
    if is_wanted { Stdio::piped() } else { Stdio::null() }
}

/// Returns the exit status as a shell has it: 128 and the number of the signal that has ended a program.
fn status_number(status: ExitStatus) -> i32 {
    #[cfg(unix)]
    if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
        return 128 + signal;
    }
    status.code().unwrap_or(-1)
}

/// `%PROCESS-RUN`: program, arguments, input, whether output and error output are wanted, folder,
/// environment.
async fn run(arguments: CallArguments, mut cancelled: Cancelled) -> Completion {
    let name = arguments.text(0)?;
    let input = arguments.text_if_any(2)?;
    let mut command = command(&arguments, 5)?;
    command.stdin(pipe_if(input.is_some())).stdout(pipe_if(arguments.is_true(3)));
    command.stderr(pipe_if(arguments.is_true(4)));
    let mut child = start(command, &name)?;
    let (stdin, stdout, stderr) = (child.stdin.take(), child.stdout.take(), child.stderr.take());
    let feed = async move {
        if let (Some(mut stdin), Some(input)) = (stdin, input) {
            // A program may end without reading all of its input.
            drop(stdin.write_all(input.as_bytes()).await);
        }
    };
    let work = async {
        let ((), output, errors) = tokio::join!(feed, text_from(stdout), text_from(stderr));
        let (output, errors) = (output?, errors?);
        let status = child.wait().await.map_err(|error| failure("PROCESS-ERROR", error))?;
        Ok(vec![output, errors, integer(status_number(status))])
    };
    let answer = tokio::select! {
        biased;
        () = cancelled.wait() => Err(failure("CANCELLED", "")),
        answer = work => answer,
    };
    if answer.is_err() {
        stop(&mut child).await;
    }
    answer
}

/// Reads all that a program writes. `NIL` if nobody wants it.
async fn text_from(pipe: Option<impl AsyncRead + Unpin>) -> Result<Datum, HostFailure> {
    let Some(pipe) = pipe else { return Ok(nil()) };
    let mut bytes = Vec::new();
    let read = pipe.take(MOST_OUTPUT + 1).read_to_end(&mut bytes).await;
    read.map_err(|error| failure("PROCESS-ERROR", error))?;
    if bytes.len() as u64 > MOST_OUTPUT {
        let reason = format!("it has written more than {} MiB", MOST_OUTPUT >> 20);
        return Err(failure("OUTPUT-TOO-LONG", reason));
    }
    Ok(text(&String::from_utf8_lossy(&bytes)))
}

/// Ends a program, and waits until it has ended.
async fn stop(child: &mut Child) {
    terminate(child);
    if tokio::time::timeout(GRACE, child.wait()).await.is_err() {
        // It has ended meanwhile, or now does.
        drop(child.start_kill());
        drop(child.wait().await);
    }
}

/// Sends SIGTERM to a program that has not been waited for.
#[cfg(unix)]
fn terminate(child: &mut Child) {
    let number = child.id().and_then(|id| i32::try_from(id).ok());
    if let Some(process) = number.and_then(rustix::process::Pid::from_raw) {
        // It may have ended by itself.
        _ = rustix::process::kill_process(process, rustix::process::Signal::TERM);
    }
}

#[cfg(not(unix))]
fn terminate(child: &mut Child) {
    drop(child.start_kill());
}

/// Where the output of a launched program goes: to the connection of a number, nowhere for `NIL`, and for
/// anything else to where that of this process goes.
fn output_of(arguments: &CallArguments, index: usize) -> (Stdio, Option<i64>) {
    match arguments.number(index) {
        Ok(number) => (Stdio::piped(), Some(number)),
        Err(_) if arguments.is_true(index) => (Stdio::inherit(), None),
        Err(_) => (Stdio::null(), None),
    }
}

/// `%PROCESS-LAUNCH`: program, arguments, the number of a connection for its input or `NIL`, where output and
/// error output go, folder, environment.
async fn launch(arguments: CallArguments, programs: Programs, sockets: Sockets) -> Completion {
    let name = arguments.text(0)?;
    let mut command = command(&arguments, 5)?;
    let input = if arguments.is_true(2) { Some(arguments.number(2)?) } else { None };
    let ((output, output_number), (errors, errors_number)) =
        (output_of(&arguments, 3), output_of(&arguments, 4));
    command.stdin(pipe_if(input.is_some())).stdout(output).stderr(errors);
    let mut child = start(command, &name)?;
    let none = tokio::io::empty;
    // A number may have been closed meanwhile; then the pipe is closed too.
    if let (Some(number), Some(pipe)) = (input, child.stdin.take()) {
        _ = sockets.set(number, Connection::over(none(), pipe), 0, String::new());
    }
    if let (Some(number), Some(pipe)) = (output_number, child.stdout.take()) {
        _ = sockets.set(number, Connection::over(pipe, none()), 0, String::new());
    }
    if let (Some(number), Some(pipe)) = (errors_number, child.stderr.take()) {
        _ = sockets.set(number, Connection::over(pipe, none()), 0, String::new());
    }
    let number = integer(child.id().unwrap_or(0));
    let (status_sender, status) = watch::channel(None);
    let (end, mut ends) = mpsc::unbounded_channel();
    let watch = async move {
        let status = loop {
            tokio::select! {
                status = child.wait() => break status,
                Some(end) = ends.recv() => match end {
                    StopRequest::Politely => terminate(&mut child),
                    StopRequest::AtOnce => drop(child.start_kill()),
                },
            }
        };
        // Nobody may be left who wants to know.
        _ = status_sender.send(Some(status.map_or(-1, status_number)));
    };
    event_loop::spawn(watch).map_err(|reason| failure("PROCESS-ERROR", reason))?;
    Ok(vec![integer(programs.add(Launched { status, end })), number])
}

/// Waits until a launched program has ended, and returns its exit status.
async fn status_of(mut launched: Launched) -> i32 {
    match launched.status.wait_for(Option::is_some).await {
        Ok(status) => status.unwrap_or(-1),
        Err(_) => -1,
    }
}

/// Ends a launched program, and returns its exit status.
async fn end(launched: Launched) -> i32 {
    // One that has ended does not hear it.
    drop(launched.end.send(StopRequest::Politely));
    match tokio::time::timeout(GRACE, status_of(launched.clone())).await {
        Ok(status) => status,
        Err(_) => {
            drop(launched.end.send(StopRequest::AtOnce));
            status_of(launched).await
        }
    }
}
