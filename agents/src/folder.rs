//! The folder of the agents: one folder for each, and the files beside its journal.
//!
//! ```text
//! DIR/lock, host.socket      of the host
//! DIR/NAME.state/            the durable run of an agent
//!     arguments              arguments of its program, if it has some
//!     stopped                there while it was stopped
//! ```

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::error::AgentError;

const SUFFIX: &str = ".state";

/// Returns the folder of an agent.
///
/// # Errors
/// [`AgentError::Name`].
pub(crate) fn agent_folder(folder: &Path, name: &str) -> Result<PathBuf, AgentError> {
    let is_mark = |c: char| matches!(c, '-' | '_' | '.');
    let is_name = !name.is_empty()
        && name.len() <= 200
        && !name.starts_with('.')
        && name.chars().all(|c| c.is_alphanumeric() || is_mark(c));
    if is_name { Ok(folder.join(format!("{name}{SUFFIX}"))) } else { Err(AgentError::Name(name.into())) }
}

/// Returns the names of the agents in a folder.
pub(crate) fn agent_names(folder: &Path) -> io::Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in fs::read_dir(folder)? {
        let name = entry?.file_name();
        if let Some(name) = name.to_str().and_then(|name| name.strip_suffix(SUFFIX))
            && agent_folder(folder, name).is_ok()
        {
            names.push(name.into());
        }
    }
    Ok(names)
}

/// Returns the place at which the host of a folder listens.
pub(crate) fn socket_path(folder: &Path) -> PathBuf {
    folder.join("host.socket")
}

/// Returns a path by which a socket can be bound or reached, also if its own is too long for the system, as
/// long as the second value is there.
#[cfg(target_os = "linux")]
pub(crate) fn reachable(socket: &Path) -> io::Result<(PathBuf, Option<fs::File>)> {
    use std::os::fd::AsRawFd;

    /// Most bytes of the path of a socket.
    const SOCKET_PATH: usize = 100;
    let (Some(folder), Some(name)) = (socket.parent(), socket.file_name()) else {
        return Ok((socket.into(), None));
    };
    if socket.as_os_str().len() <= SOCKET_PATH {
        return Ok((socket.into(), None));
    }
    let folder = fs::File::open(folder)?;
    let path = Path::new("/proc/self/fd").join(folder.as_raw_fd().to_string()).join(name);
    Ok((path, Some(folder)))
}

/// Returns the path of a socket, which other systems have no way around.
#[cfg(not(target_os = "linux"))]
pub(crate) fn reachable(socket: &Path) -> io::Result<(PathBuf, Option<fs::File>)> {
    Ok((socket.into(), None))
}

/// Returns the arguments of the program of an agent.
pub(crate) fn read_arguments(agent: &Path) -> Vec<String> {
    let text = fs::read_to_string(agent.join("arguments")).unwrap_or_default();
    serde_json::from_str(&text).unwrap_or_default()
}

/// Notes the arguments of the program of an agent.
pub(crate) fn write_arguments(agent: &Path, arguments: &[String]) -> io::Result<()> {
    if arguments.is_empty() {
        return Ok(());
    }
    fs::write(agent.join("arguments"), serde_json::Value::from(arguments.to_vec()).to_string())
}

fn stopped_file(agent: &Path) -> PathBuf {
    agent.join("stopped")
}

/// Returns whether an agent was stopped.
pub(crate) fn is_stopped(agent: &Path) -> bool {
    stopped_file(agent).exists()
}

/// Notes that an agent is stopped, or is not.
pub(crate) fn note_stopped(agent: &Path, is_stopped: bool) -> Result<(), AgentError> {
    let file = stopped_file(agent);
    let noted = match is_stopped {
        true => fs::write(&file, ""),
        false => fs::remove_file(&file).or_else(|error| match error.kind() {
            io::ErrorKind::NotFound => Ok(()),
            _ => Err(error),
        }),
    };
    noted.map_err(|error| AgentError::Folder(file, error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn a_socket_in_a_deep_folder_can_be_reached() {
        let folder =
            std::env::temp_dir().join(format!("esl-deep-{}-{}", std::process::id(), "x".repeat(150)));
        fs::create_dir(&folder).expect("it is new");
        let socket = socket_path(&folder);
        let bound =
            reachable(&socket).and_then(|(path, _folder)| std::os::unix::net::UnixListener::bind(path));
        let listener = bound.expect("it can be bound");
        assert!(socket.exists());
        let reached =
            reachable(&socket).and_then(|(path, _folder)| std::os::unix::net::UnixStream::connect(path));
        assert!(reached.is_ok() && listener.accept().is_ok());
        fs::remove_dir_all(&folder).expect("it can be removed");
    }

    #[test]
    fn a_name_stays_in_the_folder() {
        let folder = Path::new("/agents");
        for name in ["rover", "rover-7.2", "käfer_1"] {
            let path = agent_folder(folder, name).expect("it is a name");
            assert_eq!(path.parent(), Some(folder));
        }
        for name in ["", ".", "..", "../x", "a/b", ".hidden", "a b", "a\0", &"x".repeat(201)] {
            assert!(agent_folder(folder, name).is_err(), "{name}");
        }
    }
}
