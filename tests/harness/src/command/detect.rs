//! `viewshed detect`: pictures in, boxes out, by a program of its own.

use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context, Result, bail};

use super::BAD_INPUT;

/// The program, and what builds it, of the source tree.
const PROGRAM: &str = "viewshed-detect";
const INSTALL: &str = "cargo install --locked --path tests/harness/detector";
const BUILD: &str = "cargo build --release --locked -p viewshed-detector";

/// Find vehicles in pictures with a neural network (a program of its own, viewshed-detect)
///
/// Everything after `detect` is handed to viewshed-detect, which lies beside this program or in a folder of PATH once
/// cargo install --locked --path tests/harness/detector has put it there. It is apart because a runtime for networks takes
/// minutes to build. `viewshed-detect --help` lists its options.
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
    hand_over(&own, &std::env::var_os("PATH").unwrap_or_default(), &args.arguments)
}

/// The program: beside this one, or else in a folder of PATH.
fn found(own: &Path, path: &OsStr) -> Option<PathBuf> {
    let name = format!("{PROGRAM}{}", std::env::consts::EXE_SUFFIX);
    let beside = own.with_file_name(&name);
    // an empty entry is the working folder, where a program hardly is meant
    let folders = std::env::split_paths(path).filter(|folder| !folder.as_os_str().is_empty());
    [beside].into_iter().chain(folders.map(|folder| folder.join(&name))).find(|program| program.is_file())
}

fn hand_over(own: &Path, path: &OsStr, arguments: &[OsString]) -> Result<ExitCode> {
    let Some(program) = found(own, path) else {
        let beside = own.parent().unwrap_or(own).display();
        bail!(
            "there is no {PROGRAM} in {beside}, where this program lies, nor in a folder of PATH. In the source tree `{INSTALL}` installs it as `viewshed` is, and `{BUILD}` puts it beside target/release/viewshed"
        );
    };
    let status = Command::new(&program).args(arguments).status();
    let status = status.with_context(|| format!("cannot run {}", program.display()))?;
    let code = status.code().and_then(|code| u8::try_from(code).ok());
    Ok(ExitCode::from(code.unwrap_or(BAD_INPUT)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_that_is_not_there_is_named_with_where_it_was_looked_for_and_what_installs_it() {
        let own = std::env::temp_dir().join("no-such-folder/viewshed");
        let error = format!("{:#}", hand_over(&own, OsStr::new("/no-such-bin"), &[]).unwrap_err());
        let install = "cargo install --locked --path tests/harness/detector";
        assert!(
            error.contains("no-such-folder, where") && error.contains("PATH") && error.contains(install),
            "{error}"
        );
    }

    #[cfg(unix)]
    #[test]
    fn arguments_and_exit_code_go_through_wherever_the_program_lies() {
        use std::os::unix::fs::PermissionsExt;
        let folder = std::env::temp_dir().join(format!("viewshed-detect-{}", std::process::id()));
        let write = |folder: &Path, code: u8| {
            std::fs::create_dir_all(folder).unwrap();
            let program = folder.join(PROGRAM);
            std::fs::write(&program, format!("#!/bin/sh\n[ \"$1 $2\" = 'a b --help' ] && exit {code}\n")).unwrap();
            std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
        };
        let (bin, own) = (folder.join("bin"), folder.join("own/viewshed"));
        let path = std::env::join_paths(["/no-such-bin".as_ref(), bin.as_path()]).unwrap();
        let run = || {
            let code = hand_over(&own, &path, &["a b", "--help"].map(OsString::from)).unwrap();
            format!("{code:?}")
        };
        write(&bin, 7);
        assert_eq!(run(), format!("{:?}", ExitCode::from(7)));
        write(&folder.join("own"), 9);
        assert_eq!(run(), format!("{:?}", ExitCode::from(9)), "that beside it goes first");
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
