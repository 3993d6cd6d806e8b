//! Folders and names of files of the operating system.

use std::time::{Duration, UNIX_EPOCH};

use super::{FileAnswer, FileRequest, HostError};

/// Returns the names of what is in a folder, in order; those of folders end in `/`.
fn names_in(folder: &str) -> std::io::Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let mut name = entry.file_name().to_string_lossy().into_owned();
        // A link counts as what it leads to.
        if entry.path().is_dir() {
            name.push('/');
        }
        names.push(name);
    }
    names.sort();
    Ok(names)
}

/// Does something with files of the system, which may take its time.
///
/// # Errors
/// [`HostError`].
pub fn request_of_files(request: FileRequest<'_>) -> Result<FileAnswer, HostError> {
    let answer = match request {
        FileRequest::List(folder) => names_in(folder).map(FileAnswer::Names),
        FileRequest::Rename(from, to) => std::fs::rename(from, to).map(|()| FileAnswer::Done(true)),
        FileRequest::Date(path) => {
            std::fs::metadata(path).and_then(|metadata| metadata.modified()).map(|time| {
                let seconds = |duration: Duration| i64::try_from(duration.as_secs()).unwrap_or(i64::MAX);
                let since = time.duration_since(UNIX_EPOCH);
                FileAnswer::Date(since.map_or_else(|before| -seconds(before.duration()), seconds))
            })
        }
        FileRequest::TrueName(path) => true_name(path).map(|name| FileAnswer::Names(vec![name])),
        FileRequest::MakeFolders(path) => {
            let is_there = std::path::Path::new(path).is_dir();
            std::fs::create_dir_all(path).map(|()| FileAnswer::Done(!is_there))
        }
    };
    answer.map_err(|error| HostError::from(&error))
}

fn true_name(path: &str) -> std::io::Result<String> {
    use std::io::{Error, ErrorKind};
    let found = std::fs::canonicalize(path).map_err(|error| match error.kind() {
        // A part of the path is a file.
        ErrorKind::NotADirectory => ErrorKind::NotFound.into(),
        _ => error,
    })?;
    let is_folder = found.is_dir();
    let name = found.into_os_string().into_string();
    let mut name = name.map_err(|_| Error::other("its name is not text"))?;
    if is_folder && !name.ends_with('/') {
        name.push('/');
    }
    Ok(name)
}
