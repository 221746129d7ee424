//! `viewshed completions`: what a shell needs to complete commands and options.

use std::process::ExitCode;

use anyhow::Result;
use clap::CommandFactory;
use clap_complete::{Shell, generate};

use super::{Cli, print};

/// Print a shell's completions of commands, options and their values
///
/// bash: viewshed completions bash > ~/.local/share/bash-completion/completions/viewshed
/// zsh:  viewshed completions zsh > "${fpath[1]}/_viewshed"
/// fish: viewshed completions fish > ~/.config/fish/completions/viewshed.fish
#[derive(Debug, clap::Args)]
#[allow(rustdoc::broken_intra_doc_links)] // the brackets are of zsh
#[command(verbatim_doc_comment)]
pub struct Args {
    /// The shell
    shell: Shell,
}

/// Prints them.
///
/// # Errors
/// Standard output that cannot be written.
pub fn run(args: &Args) -> Result<ExitCode> {
    print(&script(args.shell))?;
    Ok(ExitCode::SUCCESS)
}

fn script(shell: Shell) -> String {
    let mut script = Vec::new();
    generate(shell, &mut Cli::command(), "viewshed", &mut script);
    String::from_utf8_lossy(&script).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shell_completes_commands_options_and_values() {
        for shell in [Shell::Bash, Shell::Zsh, Shell::Fish] {
            let script = script(shell);
            for word in ["replay", "doctor", "velocity-sign", "approaching"] {
                assert!(script.contains(word), "{shell}: {word}");
            }
        }
    }
}
