//! What is made of the command line itself: pages for `man`, scripts that complete words in a shell.

use super::arguments::Arguments;
use clap::CommandFactory as _;
use std::path::{Path, PathBuf};

/// A script that a shell reads to complete the command's words.
pub fn completions(shell: clap_complete::Shell) -> String {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Arguments::command(), "contactd", &mut script);
    String::from_utf8_lossy(&script).into_owned()
}

/// Writes the pages, of the command itself and one for each of its commands, into a folder; gives their files, in order.
///
/// # Errors
/// One sentence: what cannot be written, and why.
pub fn write_man(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let failed = |path: &Path| {
        let path = path.display().to_string();
        move |e: std::io::Error| format!("{path}: expected to write, found {e}")
    };
    std::fs::create_dir_all(folder).map_err(failed(folder))?;
    // One that lists itself under each command is no page that anybody looks for.
    let mut command = Arguments::command().disable_help_subcommand(true);
    command.build();
    let mut commands = vec![command];
    let mut files = Vec::new();
    while let Some(command) = commands.pop() {
        commands.extend(command.get_subcommands().cloned());
        let page = clap_mangen::Man::new(command);
        let path = folder.join(page.get_filename());
        let mut text = Vec::new();
        page.render(&mut text).map_err(failed(&path))?;
        std::fs::write(&path, text).map_err(failed(&path))?;
        files.push(path);
    }
    files.sort();
    Ok(files)
}
