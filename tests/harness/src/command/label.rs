//! `viewshed label`: draw labels in a browser.

use std::net::IpAddr;
use std::path::PathBuf;
use std::process::{Command, ExitCode, Stdio};

use anyhow::{Context, Result, bail};

use super::print;
use crate::command::options::ReadingArgs;
use crate::estimators;
use crate::pages::label::Labelling;
use crate::pages::server::{LOOPBACK, Server};
use crate::recording::{self, beside};
use crate::results::files::OutputArgs;

/// Draw labels over a recording, in a browser on this machine
///
/// Serves a page at an address that is printed, and opens it. It shows every detection over time, along and across the
/// road, and from above. Vehicles are streaks: the page offers a track for each, which is accepted, mended or rejected
/// with a key, and lines can be drawn by hand. `?` in the page lists all keys.
///
/// What you draw is the face of the vehicle that the radar sees; boxes follow from class and heading. Every change is
/// saved at once, to NAME.labels.csv beside the recording, which `viewshed replay NAME.mcap` then takes for the truth:
///
///   viewshed label site.mcap
///   viewshed replay site.mcap
///
/// Ctrl-C ends the server. Only this machine can reach it, with the secret in its address.
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// The recording: MCAP, a CAN log, or a capture of a TI radar or the native format
    #[arg(value_name = "RECORDING")]
    recording: PathBuf,
    /// Print the address and open no browser
    #[arg(long, help_heading = "Page")]
    no_open: bool,
    /// Port of the page; 0 is any that is free
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Page")]
    port: u16,
    /// Address of this machine to serve the page at
    ///
    /// Anything but the default lets others reach the page who know its address, over a connection that others can
    /// read; prefer `ssh -L`.
    #[arg(long, value_name = "ADDRESS", default_value_t = LOOPBACK, help_heading = "Page")]
    bind: IpAddr,
    #[command(flatten)]
    reading: ReadingArgs,
}

/// Serves the page until the program is ended.
///
/// # Errors
/// A recording that cannot be read, labels that are broken, a port that is taken.
pub fn run(args: &Args) -> Result<ExitCode> {
    let path = &args.recording;
    let [labels, _] = beside::files(path);
    let folder = labels.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(".".as_ref());
    let Some(name) = labels.file_name() else { bail!("{} is no file", path.display()) };
    let target = OutputArgs::default().beside([path.clone()]).folder("labels", folder)?.file(name)?;
    let recording = recording::read(path, &args.reading.options()).with_context(|| path.display().to_string())?;
    let options = estimators::Options::default();
    estimators::usable::check(&recording, &options)?;
    let server = Server::bind(args.bind, args.port)?;
    let frames = recording.frames.len();
    let own = recording.truth.as_ref().and_then(|truth| match &truth.beside {
        Some(beside) => beside.left_out,
        None => Some(truth.tracks.len()),
    });
    let labelling = Labelling::new(path, recording, target, options)?;
    print(&format!(
        "{frames} radar frames; labels go to {}\n{}\nCtrl-C ends the server.\n",
        labels.display(),
        server.url()
    ))?;
    if let Some(objects) = own.filter(|objects| *objects > 0) {
        print(&format!(
            "The recording has labels of its own, of {objects} objects. What you draw takes their place; `viewshed replay --labels recording` judges by them.\n"
        ))?;
    }
    if !args.no_open && !open(&server.url()) {
        print("No browser was found: open the address above.\n")?;
    }
    let routes = labelling.routes(&server);
    server.serve(routes).context("the server")?;
    Ok(ExitCode::SUCCESS)
}

/// Opens an address in the user's browser; whether there is a program for that.
pub fn open(url: &str) -> bool {
    let (program, arguments): (&str, &[&str]) = match std::env::consts::OS {
        "macos" => ("open", &[]),
        "windows" => ("rundll32", &["url.dll,FileProtocolHandler"]),
        _ => ("xdg-open", &[]),
    };
    let quiet = Command::new(program).args(arguments).arg(url).stdout(Stdio::null()).stderr(Stdio::null()).spawn();
    quiet.is_ok()
}
