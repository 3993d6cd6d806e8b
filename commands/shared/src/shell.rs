//! Completions for shells and pages for `man`, made from the definitions of the commands' arguments.

use std::path::Path;

use clap::Command;
use clap_complete::Shell;

use super::{SUCCESS, USAGE, complain};

/// Prints the completions of a command for a shell. Returns the exit status.
pub fn print_completions(shell: Shell, mut command: Command) -> u8 {
    let mut script = Vec::new();
    let name = command.get_name().to_owned();
    clap_complete::generate(shell, &mut command, name, &mut script);
    print_all(&script)
}

/// Writes the manual pages of a command, one for each subcommand, to a folder; without one, prints the page
/// of the command itself. Returns the exit status.
pub fn write_man_pages(command: Command, folder: Option<&Path>) -> u8 {
    let Some(folder) = folder else {
        let mut page = Vec::new();
        return match clap_mangen::Man::new(command).render(&mut page) {
            Ok(()) => print_all(&page),
            Err(error) => {
                complain(error);
                USAGE
            }
        };
    };
    let result = std::fs::create_dir_all(folder).and_then(|()| clap_mangen::generate_to(command, folder));
    match result {
        Ok(()) => SUCCESS,
        Err(error) => {
            complain(format_args!("{} cannot be written: {error}", folder.display()));
            USAGE
        }
    }
}

/// Prints to standard output. A reader that has gone away is not an error.
fn print_all(bytes: &[u8]) -> u8 {
    use std::io::Write;
    match std::io::stdout().write_all(bytes) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            complain(format_args!("standard output cannot be written: {error}"));
            USAGE
        }
        _ => SUCCESS,
    }
}
