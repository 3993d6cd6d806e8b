//! Other programs: run to their end, or launched and left to themselves.
//!
//! A program that is run is stopped when its call is left: by SIGTERM, and by SIGKILL if it has not ended
//! within [`GRACE`]. The call is over when the program is.
//!
//! Each program is the leader of a process group of its own, and signals go to the group: the programs that
//! it has started end with it, unless they have left the group.

use std::path::{Path, PathBuf};
use std::process::{ExitStatus, Stdio};
use std::sync::Mutex;
use std::time::Duration;

use esl_bytecode::datum::{Datum, DatumKind};
use esl_host::{FromArgument, HostFailure, HostHandle, HostObject, HostRows, Inbox, IntoDatum, Right};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWriteExt};
use tokio::process::{Child, Command};
use tokio::sync::{mpsc, watch};

use crate::event_loop;
use crate::operation::{Cancelled, spawned, to_its_end};
use crate::socket::{Connection, Socket, lock};

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

/// A program of the program's; nothing before it is launched.
#[derive(Default)]
struct ChildProcess(Mutex<Option<Launched>>);

impl HostObject for ChildProcess {
    const KIND: &'static str = "PROCESS";
}

impl ChildProcess {
    fn get(&self) -> Result<Launched, HostFailure> {
        lock(&self.0).clone().ok_or_else(|| process_failure("there is no such process"))
    }
}

fn process_failure(reason: impl ToString) -> HostFailure {
    HostFailure::new("PROCESS-ERROR", reason)
}

/// The destination of a launched program's output: a socket's connection; nothing, for `NIL`; for anything
/// else, the destination of this process's output.
enum OutputTarget {
    Nowhere,
    Inherited,
    Socket(HostHandle<Socket>),
}

impl FromArgument for OutputTarget {
    const TYPE: &'static str = "T";

    fn from_argument(datum: &Datum) -> Result<OutputTarget, HostFailure> {
        match datum.kind() {
            DatumKind::Nil => Ok(OutputTarget::Nowhere),
            DatumKind::Opaque(_) => HostHandle::from_argument(datum).map(OutputTarget::Socket),
            _ => Ok(OutputTarget::Inherited),
        }
    }
}

impl OutputTarget {
    fn stdio(&self) -> Stdio {
        match self {
            OutputTarget::Nowhere => Stdio::null(),
            OutputTarget::Inherited => Stdio::inherit(),
            OutputTarget::Socket(_) => Stdio::piped(),
        }
    }

    /// Has the socket be what comes out of a pipe. If it was closed meanwhile, the pipe is closed too.
    fn take(self, pipe: Option<impl AsyncRead + Send + Unpin + 'static>) {
        if let (OutputTarget::Socket(socket), Some(pipe)) = (self, pipe) {
            _ = socket.set((Connection::over(pipe, tokio::io::empty()), 0, String::new()));
        }
    }
}

/// Returns the functions of `:process`.
pub(crate) fn rows(inbox: &Inbox) -> HostRows {
    let mut rows = HostRows::new(inbox);
    rows.operation(
        to_its_end,
        "%PROCESS-RUN",
        ["program", "arguments", "input", "output", "error-output", "directory", "environment"],
        "Runs a program to its end. Returns its output and its error output, if they are wanted, and its exit status.",
        |cancelled: Cancelled,
         program: String,
         arguments: Vec<String>,
         input: Option<String>,
         output: bool,
         errors: bool,
         directory: Option<String>,
         environment: Vec<(String, String)>| {
            async move {
                let command = command(&program, &arguments, directory, environment)?;
                run(cancelled, program, command, input, output, errors).await
            }
        },
    )
    .needs(Right::Run, "program");
    rows.constructor::<ChildProcess>("%PROCESS-NEW", "Returns a process that is not launched.");
    rows.operation(
        spawned,
        "%PROCESS-LAUNCH",
        ["program", "arguments", "process", "input", "output", "error-output", "directory", "environment"],
        "Launches a program as PROCESS, with sockets for its streams. Returns the number that the system has for it.",
        |name: String,
         arguments: Vec<String>,
         program: HostHandle<ChildProcess>,
         input: Option<HostHandle<Socket>>,
         output: OutputTarget,
         errors: OutputTarget,
         directory: Option<String>,
         environment: Vec<(String, String)>| {
            async move {
                let command = command(&name, &arguments, directory, environment)?;
                launch(name, command, program, input, output, errors)
            }
        },
    )
    .needs(Right::Run, "program");
    rows.operation(
        spawned,
        "%PROCESS-WAIT",
        ["process"],
        "Waits until PROCESS has ended. Returns its exit status.",
        |program: HostHandle<ChildProcess>| async move { Ok(status_of(program.get()?).await) },
    );
    rows.operation(
        spawned,
        "%PROCESS-END",
        ["process"],
        "Ends PROCESS. Returns its exit status.",
        |program: HostHandle<ChildProcess>| async move { Ok(end(program.get()?).await) },
    );
    rows.at_once(
        "%PROCESS-ALIVE",
        ["process"],
        "Returns whether PROCESS has not ended.",
        |program: HostHandle<ChildProcess>| Ok(program.get()?.status.borrow().is_none()),
    )
    .local();
    rows
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

/// Returns the command that runs a program.
fn command(
    name: &str,
    arguments: &[String],
    directory: Option<String>,
    environment: Vec<(String, String)>,
) -> Result<Command, HostFailure> {
    let unknown = || process_failure(format!("there is no program `{name}`"));
    // The system would take another name for it, and nothing behind the character 0.
    let is_variable = |name: &str| !name.is_empty() && !name.contains(['=', '\0']);
    if let Some((name, _)) = environment.iter().find(|(name, _)| !is_variable(name)) {
        return Err(process_failure(format!("`{}` cannot be the name of a variable", name.escape_debug())));
    }
    let mut command = Command::new(find_program(name).ok_or_else(unknown)?);
    // The program sees the name under which it was called as argument 0, not the path that was found.
    #[cfg(unix)]
    command.arg0(name).process_group(0);
    command.args(arguments).envs(environment);
    if let Some(directory) = directory {
        command.current_dir(directory);
    }
    Ok(command)
}

fn start(mut command: Command, name: &str) -> Result<Child, HostFailure> {
    command.spawn().map_err(|error| {
        // The system does not say which of the two is not there.
        let folder = command.as_std().get_current_dir().filter(|folder| !folder.is_dir());
        let place =
            folder.map_or(String::new(), |folder| format!(" in {}, which is not a folder", folder.display()));
        process_failure(format!("`{name}` cannot be run{place}: {error}"))
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

/// Runs a program to its end.
async fn run(
    mut cancelled: Cancelled,
    name: String,
    mut command: Command,
    input: Option<String>,
    wants_output: bool,
    wants_errors: bool,
) -> Result<(Datum, Datum, i32), HostFailure> {
    command.stdin(pipe_if(input.is_some())).stdout(pipe_if(wants_output)).stderr(pipe_if(wants_errors));
    let mut child = start(command, &name)?;
    let group = ProcessGroup::of(&child);
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
        let status = child.wait().await.map_err(process_failure)?;
        Ok((output, errors, status_number(status)))
    };
    let answer = tokio::select! {
        biased;
        () = cancelled.wait() => Err(HostFailure::new("CANCELLED", "")),
        answer = work => answer,
    };
    if answer.is_err() {
        stop(&mut child, group).await;
    }
    answer
}

/// Reads all output of a program. `NIL` if its output is not captured.
async fn text_from(pipe: Option<impl AsyncRead + Unpin>) -> Result<Datum, HostFailure> {
    let Some(pipe) = pipe else { return Ok(().into_datum()) };
    let mut bytes = Vec::new();
    let read = pipe.take(MOST_OUTPUT + 1).read_to_end(&mut bytes).await;
    read.map_err(process_failure)?;
    if bytes.len() as u64 > MOST_OUTPUT {
        let reason = format!("it has written more than {} MiB", MOST_OUTPUT >> 20);
        return Err(HostFailure::new("OUTPUT-TOO-LONG", reason));
    }
    Ok(String::from_utf8_lossy(&bytes).as_ref().into_datum())
}

/// Ends a program and those that it has started, and waits until they have ended.
async fn stop(child: &mut Child, group: ProcessGroup) {
    group.ask_to_end(child);
    let end = async {
        drop(child.wait().await);
        group.wait().await;
    };
    if tokio::time::timeout(GRACE, end).await.is_err() {
        group.kill(child);
        drop(child.wait().await);
        group.wait_after_kill().await;
    }
}

/// The process group of a program.
#[derive(Clone, Copy)]
struct ProcessGroup {
    #[cfg(unix)]
    leader: Option<rustix::process::Pid>,
}

#[cfg(unix)]
impl ProcessGroup {
    fn of(child: &Child) -> ProcessGroup {
        let number = child.id().and_then(|id| i32::try_from(id).ok());
        ProcessGroup { leader: number.and_then(rustix::process::Pid::from_raw) }
    }

    /// Sends SIGTERM. A program that has ended does not hear it.
    fn ask_to_end(self, _: &mut Child) {
        self.send(rustix::process::Signal::TERM);
    }

    /// Sends SIGKILL.
    fn kill(self, _: &mut Child) {
        self.send(rustix::process::Signal::KILL);
    }

    fn send(self, signal: rustix::process::Signal) {
        if let Some(leader) = self.leader {
            _ = rustix::process::kill_process_group(leader, signal);
        }
    }

    /// Waits until no process is left. The system does not report that, so it is asked again.
    async fn wait(self) {
        let mut pause = Duration::from_millis(1);
        while self.leader.is_some_and(|leader| rustix::process::test_kill_process_group(leader).is_ok()) {
            tokio::time::sleep(pause).await;
            pause = (pause * 2).min(Duration::from_millis(50));
        }
    }
}

impl ProcessGroup {
    /// Waits until the processes have gone that were killed. A system whose first process does not take note
    /// of their end keeps their numbers.
    async fn wait_after_kill(self) {
        drop(tokio::time::timeout(GRACE / 10, self.wait()).await);
    }
}

#[cfg(not(unix))]
impl ProcessGroup {
    fn of(_: &Child) -> ProcessGroup {
        ProcessGroup {}
    }

    fn ask_to_end(self, child: &mut Child) {
        drop(child.start_kill());
    }

    fn kill(self, child: &mut Child) {
        drop(child.start_kill());
    }

    async fn wait(self) {}
}

/// Launches a program. Returns the number that the system has for it.
fn launch(
    name: String,
    mut command: Command,
    program: HostHandle<ChildProcess>,
    input: Option<HostHandle<Socket>>,
    output: OutputTarget,
    errors: OutputTarget,
) -> Result<u32, HostFailure> {
    command.stdin(pipe_if(input.is_some())).stdout(output.stdio()).stderr(errors.stdio());
    let mut child = start(command, &name)?;
    // If the socket was closed meanwhile, the pipe is closed too.
    if let (Some(socket), Some(pipe)) = (input, child.stdin.take()) {
        _ = socket.set((Connection::over(tokio::io::empty(), pipe), 0, String::new()));
    }
    output.take(child.stdout.take());
    errors.take(child.stderr.take());
    let number = child.id().unwrap_or(0);
    let group = ProcessGroup::of(&child);
    let (status_sender, status) = watch::channel(None);
    let (end, mut ends) = mpsc::unbounded_channel();
    let watch = async move {
        let mut is_asked = false;
        let status = loop {
            tokio::select! {
                status = child.wait() => break status,
                Some(end) = ends.recv() => match end {
                    StopRequest::Politely => {
                        is_asked = true;
                        group.ask_to_end(&mut child);
                    }
                    StopRequest::AtOnce => group.kill(&mut child),
                },
            }
        };
        if is_asked && tokio::time::timeout(GRACE, group.wait()).await.is_err() {
            group.kill(&mut child);
            group.wait_after_kill().await;
        }
        // The receivers may be gone.
        _ = status_sender.send(Some(status.map_or(-1, status_number)));
    };
    event_loop::spawn(watch).map_err(process_failure)?;
    *lock(&program.0) = Some(Launched { status, end });
    Ok(number)
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
