//! The commands and what is said to each of them: the help text is made of what stands here.

use super::joints::{ClearanceArguments, JointArguments};
use super::overlaps::OverlapsArguments;
use super::{AccessArguments, CacheArguments, direction, facets, length, seconds};
use crate::import::Facets;
use crate::terminal::Colour;
use clap::{Parser, Subcommand};
use std::path::PathBuf;
use std::time::Duration;

/// Certified earliest contact of solids modelled by constructive solid geometry.
#[derive(Parser)]
#[command(name = "contactd", bin_name = "contactd", version, about)]
pub(super) struct Arguments {
    /// Colour in what is printed: auto is where it goes to a terminal, unless NO_COLOR is set.
    #[arg(long, global = true, value_name = "WHEN", default_value = "auto", hide_possible_values = true)]
    pub color: Colour,
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Subcommand)]
pub(super) enum Command {
    /// One step of a scene in this process, without a server: the earliest contact of every pair. Of models: whether they overlap.
    Check(CheckArguments),
    /// The least clearance of a robot over ranges of its joints, proven, or a clash: exit status 1 where there is one.
    Clearance(ClearanceArguments),
    /// What is in each other of a geometry (GDML) or a scene, each pair proven: exit status 1 where something is.
    Overlaps(OverlapsArguments),
    /// The server, until SIGINT or SIGTERM; prints one line when ready.
    Serve(ServeArguments),
    /// The servers of this user: their sessions, steps a second, how long steps took in the last minute, memory.
    Status {
        /// Only the server of this name.
        #[arg(long)]
        name: Option<String>,
        /// One JSON object instead of text.
        #[arg(long)]
        json: bool,
    },
    /// What can be done to a server's sessions; `contactd status` lists them.
    Sessions {
        #[command(subcommand)]
        what: SessionsCommand,
    },
    /// Records the steps of a running server into a file, until SIGINT or SIGTERM.
    Record(RecordArguments),
    /// Repeats a recording and compares every bit; the exit status is 1 where an answer differs, 3 where steps were left out or
    /// the file has none.
    Replay(ReplayArguments),
    /// A server process and a client process on real parts: steps, earliest contacts, latencies.
    Demo {
        /// The engine in this process instead of a server.
        #[arg(long)]
        embedded: bool,
        /// Also write every contact, numbers exact, into a file.
        #[arg(long, value_name = "FILE")]
        csv: Option<PathBuf>,
        /// One line for each contact of the table, however long, with its point and normal; else it has 80 columns.
        #[arg(long)]
        wide: bool,
        /// Write the scene of one step instead, for `contactd check`.
        #[arg(long, value_name = "STEP", conflicts_with_all = ["embedded", "csv", "cache", "wide"])]
        scene_of: Option<usize>,
        /// Where that scene and its models go.
        #[arg(long, value_name = "FOLDER", default_value = ".", requires = "scene_of")]
        into: PathBuf,
        #[command(flatten)]
        cache: CacheArguments,
    },
    /// A scene in a browser: a page on this machine alone, until it is ended by SIGINT; prints the page's address.
    View(ViewArguments),
    /// What is in a model or scene file, and how it was imported.
    Inspect {
        /// A model (.scad, .csg or a mesh), a scene (.toml) or a robot (.urdf, .sdf, MJCF's .xml).
        file: PathBuf,
        /// How curved primitives are taken: exact, auto (prisms below $fn = 9) or as-written.
        #[arg(long, default_value = "auto", value_parser = facets)]
        facets: Facets,
        /// Also draw it, into an .svg or .png file: a model's tree with its bounds and its octree, a scene's contacts.
        #[arg(long, value_name = "FILE")]
        picture: Option<PathBuf>,
        /// Where the camera of a scene's picture stands, seen from the scene; else where it sees the contacts.
        #[arg(long, value_name = "X,Y,Z", requires = "picture", value_parser = direction, allow_hyphen_values = true)]
        camera: Option<glam::DVec3>,
        #[command(flatten)]
        joints: JointArguments,
        #[command(flatten)]
        access: AccessArguments,
        #[command(flatten)]
        cache: CacheArguments,
    },
    /// A script for a shell that completes these commands and their options: bash, elvish, fish, powershell or zsh.
    Completions {
        /// The shell.
        #[arg(hide_possible_values = true)]
        shell: clap_complete::Shell,
    },
    /// This program's pages for `man`, one for each command.
    Man {
        /// The folder that they go to, made if need be.
        #[arg(value_name = "FOLDER")]
        folder: PathBuf,
    },
}

#[derive(Subcommand)]
pub(super) enum SessionsCommand {
    /// Ends a session; its client is told, and others go on.
    End {
        /// Its number, as `contactd status` tells it.
        #[arg(value_name = "N")]
        session: u64,
        /// The server.
        #[arg(long, default_value = contactd_proto::names::DEFAULT_NAME)]
        name: String,
    },
}

#[derive(clap::Args)]
pub(super) struct RecordArguments {
    /// The server.
    #[arg(default_value = contactd_proto::names::DEFAULT_NAME)]
    pub name: String,
    /// The file; it does not exist before.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// One session, as `contactd status` numbers them; else all, those to come too.
    #[arg(long, value_name = "N")]
    pub session: Option<u64>,
    /// Ends after this time.
    #[arg(long, value_parser = seconds)]
    pub seconds: Option<Duration>,
}

#[derive(clap::Args)]
pub(super) struct ReplayArguments {
    /// The recording.
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// One step, by its number in the recording, from 1: written as a scene, and not repeated.
    #[arg(long, value_name = "N", requires = "scene")]
    pub step: Option<u64>,
    /// The folder for that scene; it does not exist before.
    #[arg(long, value_name = "DIR", requires = "step")]
    pub scene: Option<PathBuf>,
}

#[derive(clap::Args)]
pub(super) struct ServeArguments {
    /// Its name: clients connect to it by this.
    #[arg(long, default_value = contactd_proto::names::DEFAULT_NAME)]
    pub name: String,
    /// A TOML file of limits and waiting times.
    #[arg(long)]
    pub config: Option<PathBuf>,
    /// Milliseconds within which a step is answered, undecided where it is not known by then; 0: no such limit.
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u64).range(..=1 << 31))]
    pub deadline: Option<u64>,
    /// A folder of this machine: texts that clients send may import files of it and below. Else they import none.
    #[arg(long, value_name = "DIR")]
    pub import_root: Option<PathBuf>,
    /// A folder in which this start of the server records all of its steps, into a new file.
    #[arg(long, value_name = "DIR")]
    pub record: Option<PathBuf>,
    /// A port of 127.0.0.1 on which OpenMetrics are told; 0: any that is free. Else none are.
    #[arg(long, value_name = "PORT")]
    pub metrics: Option<u16>,
    /// Tells models and refused commands too, on standard error; else as CONTACTD_LOG says (warn, info, debug), or sessions alone.
    #[arg(short, long, conflicts_with = "quiet")]
    pub verbose: bool,
    /// Tells only what is wrong.
    #[arg(short, long)]
    pub quiet: bool,
    #[command(flatten)]
    pub cache: CacheArguments,
}

#[derive(clap::Args)]
pub(super) struct CheckArguments {
    /// The scene's .toml file, or a robot's (.urdf, .sdf, MJCF's .xml); or models, which are taken as they stand.
    #[arg(required = true)]
    pub files: Vec<PathBuf>,
    /// One JSON object instead of a table: every pair, every digit.
    #[arg(long)]
    pub json: bool,
    /// Clear pairs in the table, too: else those alone that touch or come within their margin.
    #[arg(long)]
    pub all: bool,
    /// One line for each pair, however long, and nine digits; else the table has 80 columns.
    #[arg(long)]
    pub wide: bool,
    /// Resolution for every pair, in the models' unit.
    #[arg(long, value_parser = length)]
    pub resolution: Option<f64>,
    /// Only the pairs that meet first.
    #[arg(long)]
    pub first: bool,
    /// Also write the proof of every answer, for another program to check (docs/certificate.md).
    #[arg(long, value_name = "FILE")]
    pub certificate: Option<PathBuf>,
    /// What each answer cost: by which stage it was told, counts of work, the time of each stage (beside --json: on
    /// standard error).
    #[arg(long)]
    pub explain: bool,
    /// How curved primitives are taken: exact, auto (prisms below $fn = 9) or as-written.
    #[arg(long, default_value = "auto", value_parser = facets)]
    pub facets: Facets,
    #[command(flatten)]
    pub joints: JointArguments,
    #[command(flatten)]
    pub access: AccessArguments,
    #[command(flatten)]
    pub cache: CacheArguments,
}

#[derive(clap::Args)]
pub(super) struct ViewArguments {
    /// The scene's .toml file, a robot's (.urdf, .sdf, MJCF's .xml), a recording (.mcap); or models, which are taken as they stand.
    #[arg(required_unless_present_any = ["demo", "server"])]
    pub files: Vec<PathBuf>,
    /// The acts of the demo instead.
    #[arg(long, conflicts_with = "files")]
    pub demo: bool,
    /// The steps of the running server of this name instead, as they are taken.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["files", "demo", "gltf"])]
    pub server: Option<String>,
    /// The port of 127.0.0.1; 0: any that is free.
    #[arg(long, default_value = "0")]
    pub port: u16,
    /// Writes it as one binary glTF file, moving objects and contacts as an animation, and serves no page.
    #[arg(long, value_name = "FILE.glb", conflicts_with = "port")]
    pub gltf: Option<PathBuf>,
    /// How curved primitives are taken: exact, auto (prisms below $fn = 9) or as-written.
    #[arg(long, default_value = "auto", value_parser = facets)]
    pub facets: Facets,
    #[command(flatten)]
    pub joints: JointArguments,
    #[command(flatten)]
    pub access: AccessArguments,
    #[command(flatten)]
    pub cache: CacheArguments,
}
