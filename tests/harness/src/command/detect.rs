//! `viewshed detect`: pictures in, boxes out, by a program of its own.

use std::ffi::OsString;
use std::path::Path;
use std::process::{Command, ExitCode};

use anyhow::{Context, Result, bail};

use super::BAD_INPUT;

/// The program, and what builds it.
const PROGRAM: &str = "viewshed-detect";
const BUILD: &str = "cargo build --release -p viewshed-detector";

/// Find vehicles in pictures with a neural network (a program of its own, viewshed-detect)
///
/// Everything after `detect` is handed to viewshed-detect, which lies beside this program once it is built:
/// cargo build --release -p viewshed-detector. It is apart because a runtime for networks takes minutes to build.
/// `viewshed-detect --help` lists its options.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Pictures, a folder and options of viewshed-detect
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARGUMENT")]
    arguments: Vec<OsString>,
}

/// Runs the program and answers with its exit code.
///
/// # Errors
/// It is not built, or cannot be run.
pub fn run(args: &Args) -> Result<ExitCode> {
    let own = std::env::current_exe().context("cannot tell where this program lies")?;
    hand_over(&own, &args.arguments)
}

fn hand_over(own: &Path, arguments: &[OsString]) -> Result<ExitCode> {
    let program = own.with_file_name(format!("{PROGRAM}{}", std::env::consts::EXE_SUFFIX));
    if !program.is_file() {
        bail!("there is no {} yet; build it with: {BUILD}", program.display());
    }
    let status = Command::new(&program).args(arguments).status();
    let status = status.with_context(|| format!("cannot run {}", program.display()))?;
    let code = status.code().and_then(|code| u8::try_from(code).ok());
    Ok(ExitCode::from(code.unwrap_or(BAD_INPUT)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_that_is_not_built_is_named_with_what_builds_it() {
        let own = std::env::temp_dir().join("no-such-folder/viewshed");
        let error = format!("{:#}", hand_over(&own, &[]).unwrap_err());
        assert!(error.contains("no-such-folder") && error.contains("-p viewshed-detector"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn arguments_and_exit_code_go_through() {
        use std::os::unix::fs::PermissionsExt;
        let folder = std::env::temp_dir().join(format!("viewshed-detect-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let program = folder.join(PROGRAM);
        std::fs::write(&program, "#!/bin/sh\n[ \"$1 $2\" = 'a b --help' ] && exit 7\n").unwrap();
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
        let arguments = ["a b", "--help"].map(OsString::from);
        let code = hand_over(&folder.join("viewshed"), &arguments).unwrap();
        assert_eq!(format!("{code:?}"), format!("{:?}", ExitCode::from(7)));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
