//! Changes of files that the end of a process has interrupted: they are completed.

use esl_host::{FileAnswer, FileRequest, Host, HostError, WriteMode};

/// Size of a file before it is changed: one more than its length, or 0 if there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FileSize(pub(crate) u64);

/// Returns the size of a file of the system.
pub(crate) fn size_of(path: &str) -> FileSize {
    FileSize(std::fs::metadata(path).map_or(0, |metadata| metadata.len().saturating_add(1)))
}

/// Writes a file, of which a part may have been written already.
pub(crate) fn complete_write(
    host: &mut impl Host,
    path: &str,
    bytes: &[u8],
    mode: WriteMode,
    before: FileSize,
) -> Result<(), HostError> {
    let kept = match mode {
        WriteMode::Replace => return host.write_file(path, bytes, mode),
        WriteMode::Create if before.0 > 0 => return host.write_file(path, bytes, mode),
        WriteMode::Create => 0,
        WriteMode::Append => usize::try_from(before.0.saturating_sub(1)).unwrap_or(usize::MAX),
    };
    let contents = match host.read_file(path) {
        Ok(contents) => contents,
        Err(HostError::NotFound) => return host.write_file(path, bytes, mode),
        Err(error) => return Err(error),
    };
    match contents.get(kept..).and_then(|written| bytes.strip_prefix(written)) {
        Some(rest) => host.write_file(path, rest, WriteMode::Append),
        None => Err(HostError::Other(
            "a restart has interrupted a write to the file, and something else was written to it since"
                .into(),
        )),
    }
}

/// Deletes a file, which may be deleted already.
pub(crate) fn complete_deletion(host: &mut impl Host, path: &str, before: FileSize) -> Result<(), HostError> {
    match host.delete_file(path) {
        Err(HostError::NotFound) if before.0 > 0 => Ok(()),
        answer => answer,
    }
}

/// Carries out a request, which may be carried out already.
pub(crate) fn complete_request(
    host: &mut impl Host,
    request: FileRequest<'_>,
) -> Result<FileAnswer, HostError> {
    match (host.request_of_files(request), request) {
        (Err(HostError::NotFound), FileRequest::Rename(_, to)) if host.file_exists(to) => {
            Ok(FileAnswer::Done(true))
        }
        (answer, _) => answer,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use esl_host::VirtualHost;

    fn completed(contents: &str, before: u64, mode: WriteMode) -> String {
        let mut host = VirtualHost::new().with_file("f", contents);
        match complete_write(&mut host, "f", b"more", mode, FileSize(before)) {
            Ok(()) => String::from_utf8_lossy(&host.read_file("f").expect("it is there")).into_owned(),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn the_rest_of_a_write_is_written_once() {
        let append = |contents| completed(contents, 4, WriteMode::Append);
        assert_eq!(append("old"), "oldmore");
        assert_eq!(append("oldmo"), "oldmore");
        assert_eq!(append("oldmore"), "oldmore");
        assert!(append("oldx").starts_with("a restart has interrupted"));
        assert!(append("ol").starts_with("a restart has interrupted"));
        assert_eq!(completed("mo", 0, WriteMode::Create), "more");
        assert_eq!(completed("mo", 0, WriteMode::Replace), "more");
        assert_eq!(completed("mo", 3, WriteMode::Create), HostError::Exists.to_string());
    }
}
