//! The command line: arguments in, text out, exit status 0 done, 1 a recording is not repeated, 2 bad
//! input, 3 some pair undecided.
//!
//! It is a function of the library, so that a program of another language is the same command (the Python package's is).
//!
//! Floor 13: may import everything else.

mod arguments;
mod joints;
mod live;
mod overlaps;
mod pages;
mod recorded;
#[cfg(test)]
mod reference;

use self::arguments::{
    Arguments, CheckArguments, Command, RecordArguments, ReplayArguments, ServeArguments, SessionsCommand,
    ViewArguments,
};
use self::joints::{JointArguments, is_scene, read_scene, without_touching};
use crate::cache::{self, Cache, Prepared};
use crate::check::Check;
use crate::contact::Status;
use crate::demo::Program;
use crate::import::{Access, Facets, Limits, ModelBytes, Note, Openscad, Scene};
use crate::inspect;
use crate::ipc::{CacheFolder, Level, ServerConfig};
use crate::octree::Model;
use crate::operator;
use crate::picture::{
    self,
    drawing::Drawing,
    scene::{Actor, Meeting},
};
use crate::report::{self, Answer, PairReport, TableStyle};
use crate::terminal::{Paint, clean};
use crate::view::show::Show;
use crate::world::{PairOutcome, StepOutcome};
use clap::Parser as _;
use contactd_proto::names::{Address, PROTOCOL_VERSION};
use contactd_proto::{Detect, ErrorCode};
use std::error::Error;
use std::ffi::OsString;
use std::io::{IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// What reading a file may reach beside it.
#[derive(clap::Args)]
struct AccessArguments {
    /// The folder, with all below it, that OpenSCAD texts may import files from; else each text's own, or the scene's import_root.
    #[arg(long, value_name = "DIR")]
    import_root: Option<PathBuf>,
    /// The OpenSCAD that flattens .scad files; else the environment's CONTACTD_OPENSCAD, or openscad.
    #[arg(long, value_name = "PROGRAM")]
    openscad: Option<PathBuf>,
    /// How long that may take for one file.
    #[arg(long, value_name = "SECONDS", default_value = "120", value_parser = seconds)]
    openscad_timeout: Duration,
}

impl AccessArguments {
    /// What they say, the rest as `scene` has it.
    fn with(&self, scene: Access) -> Result<Access, String> {
        let root = self.import_root.clone().or(scene.root);
        if let Some(root) = root.as_ref().filter(|r| !r.is_dir()) {
            return Err(format!("expected a folder as import root, found {}", root.display()));
        }
        let program = self.openscad.as_ref().map_or(scene.openscad.program, |p| p.clone().into_os_string());
        Ok(Access { root, packages: scene.packages, openscad: Openscad { program, time: self.openscad_timeout } })
    }
}

#[derive(clap::Args)]
struct CacheArguments {
    /// Folder in which preprocessed models are kept between runs, made if need be; or off, which is the default.
    #[arg(long, value_name = "DIR|off")]
    cache: Option<CacheFolder>,
}

impl CacheArguments {
    /// The cache, where one is asked for and can be used.
    fn open(&self) -> Option<Cache> {
        let folder = self.cache.as_ref().and_then(CacheFolder::folder)?;
        Cache::open(folder, cache::DEFAULT_BYTES).map_err(|e| warn(&e)).ok()
    }
}

/// What the process ends with.
enum Done {
    /// Everything answered.
    Well,
    /// The work limit ran out for some pair.
    Undecided,
    /// A recording was not repeated to the bit.
    Differs,
    /// Links clash, or are nearer than was asked.
    Clashes,
}

/// The command `contactd`, whole: what it prints goes to standard output and standard error. `arguments` begin with the program's own
/// name; `program` is how this program is started again, which the demo does for its server.
///
/// Gives the exit status: 0 done, 1 a recording is not repeated, 2 bad input, 3 some pair undecided.
pub fn run(arguments: impl IntoIterator<Item = OsString>, program: &Program) -> u8 {
    let Arguments { color, command } = match Arguments::try_parse_from(arguments) {
        Ok(arguments) => arguments,
        // Help and version are such errors, too, of status 0.
        Err(e) => {
            let written = written(e.print().and_then(|()| std::io::stdout().flush()));
            let status = u8::try_from(e.exit_code()).unwrap_or(BAD_INPUT);
            return match written {
                Ok(()) => status,
                // What is wrong goes to standard error, where nobody can be told that it cannot be written.
                Err(_) if e.use_stderr() => status,
                Err(sentence) => {
                    say(&sentence);
                    BAD_INPUT
                }
            };
        }
    };
    let environment = |name: &str| std::env::var_os(name);
    let paint = color.paint(
        std::io::stdout().is_terminal(),
        environment("NO_COLOR").as_deref(),
        environment("TERM").as_deref(),
    );
    if let Err(sentence) = crate::ipc::ready_threads() {
        say(&format!("contactd: expected to start threads, found: {sentence}"));
        return BAD_INPUT;
    }
    let done = match command {
        Command::Check(arguments) => check_scene(&arguments, paint),
        Command::Demo { scene_of: Some(step), into, .. } => demo_scene(step, &into),
        Command::Demo { embedded, csv, cache, wide, .. } => {
            let server = (!embedded).then_some(program);
            run_demo(server, csv.as_deref(), cache, TableStyle { wide, paint, ..TableStyle::default() })
        }
        Command::Inspect { file, facets, picture, camera, joints, access, cache } => {
            inspect_file(&file, facets, (picture.as_deref(), camera), (&joints, &access), &cache)
        }
        Command::Clearance(arguments) => joints::clearance(&arguments),
        Command::Overlaps(arguments) => overlaps::overlaps(&arguments),
        Command::View(arguments) => view_scene(&arguments),
        Command::Serve(arguments) => serve(arguments),
        Command::Record(arguments) => record(&arguments),
        Command::Replay(arguments) => replay(&arguments),
        Command::Status { name, json } => status(name.as_deref(), json, paint),
        Command::Sessions { what: SessionsCommand::End { session, name } } => end_session(session, &name),
        Command::Completions { shell } => completions(shell),
        Command::Man { folder } => man(&folder),
    };
    let status = match done {
        Ok(Done::Well) => 0,
        Ok(Done::Undecided) => 3,
        Ok(Done::Differs | Done::Clashes) => 1,
        Err(sentence) => {
            say(&sentence.to_string());
            BAD_INPUT
        }
    };
    // Where another program's runtime ends the process nobody else does.
    let _ = std::io::stdout().flush();
    status
}

const BAD_INPUT: u8 = 2;

fn completions(shell: clap_complete::Shell) -> Result<Done, Box<dyn Error>> {
    print(&pages::completions(shell))?;
    Ok(Done::Well)
}

fn man(folder: &Path) -> Result<Done, Box<dyn Error>> {
    for path in pages::write_man(folder)? {
        print(&format!("{}\n", path.display()))?;
    }
    Ok(Done::Well)
}

fn serve(arguments: ServeArguments) -> Result<Done, Box<dyn Error>> {
    let ServeArguments { name, config, deadline, import_root, record, metrics, verbose, quiet, cache } = arguments;
    let mut config = config.as_deref().map_or_else(|| Ok(ServerConfig::default()), ServerConfig::read)?;
    // The command line stands before the file, `off` too.
    config.cache = cache.cache.unwrap_or(config.cache);
    config.deadline_ms = deadline.unwrap_or(config.deadline_ms);
    if let Some(root) = import_root.as_ref().filter(|r| !r.is_dir()) {
        return Err(format!("expected a folder as import root, found {}", root.display()).into());
    }
    config.import_root = import_root.or(config.import_root);
    if let Some(folder) = record.as_ref().filter(|r| !r.is_dir()) {
        return Err(format!("expected a folder for recordings, found {}", folder.display()).into());
    }
    config.record = record.or(config.record);
    config.metrics = metrics.or(config.metrics);
    config.log = match (verbose, quiet) {
        (true, _) => Level::Debug,
        (_, true) => Level::Warn,
        _ => log_of_environment()?.unwrap_or(config.log),
    };
    let ready = |server: &crate::ipc::Server| {
        let pid = std::process::id();
        let mut text = format!("contactd serve: \"{name}\" is ready (protocol {PROTOCOL_VERSION}, process {pid})\n");
        if let Some(at) = server.metrics() {
            text.push_str(&format!("contactd serve: metrics at http://{at}/metrics\n"));
        }
        // A reader that has gone away does not stop a server.
        let _ = print(&text);
    };
    crate::ipc::serve(&Address::of(&name)?, config, ready)?;
    Ok(Done::Well)
}

/// What the environment says of the log; an empty word says nothing.
fn log_of_environment() -> Result<Option<Level>, String> {
    let Some(word) = std::env::var_os(LOG).filter(|word| !word.is_empty()) else { return Ok(None) };
    Level::of_name(&word.to_string_lossy()).map(Some).map_err(|e| format!("{LOG}: {e}"))
}

/// The variable of the environment that says how much a server tells.
const LOG: &str = "CONTACTD_LOG";

fn status(name: Option<&str>, json: bool, paint: Paint) -> Result<Done, Box<dyn Error>> {
    let servers = operator::servers(name)?;
    print(&if json { servers.json()? + "\n" } else { servers.text(paint) })?;
    Ok(Done::Well)
}

fn end_session(session: u64, name: &str) -> Result<Done, Box<dyn Error>> {
    match operator::end_session(name, session) {
        Ok(()) => print(&format!("session {session} of \"{name}\" is ended\n"))?,
        Err(e) if e.code() == Some(ErrorCode::SessionGone) => {
            let asked = format!("contactd status --name {name}");
            return Err(
                format!("there is no session {session} on \"{name}\": `{asked}` lists those that are open").into()
            );
        }
        Err(e) => return Err(e.into()),
    }
    Ok(Done::Well)
}

fn record(arguments: &RecordArguments) -> Result<Done, Box<dyn Error>> {
    let RecordArguments { name, output, session, seconds } = arguments;
    let recording = operator::Recording::start(name, output, *session)?;
    print(&format!("{}: the steps of \"{name}\" are recorded until SIGINT\n", output.display()))?;
    print(&recording.run(*seconds)?)?;
    Ok(Done::Well)
}

fn replay(arguments: &ReplayArguments) -> Result<Done, Box<dyn Error>> {
    if let (Some(step), Some(folder)) = (arguments.step, &arguments.scene) {
        crate::replay::scene_of(&arguments.file, step)?.write(folder)?;
        print(&format!("{}\n", folder.join("scene.toml").display()))?;
        return Ok(Done::Well);
    }
    let replayed = crate::replay::replay(&arguments.file, |_| {})?;
    print(&replayed.text())?;
    Ok(match () {
        () if replayed.difference.is_some() => Done::Differs,
        // Nobody knows what those that were left out had been answered.
        () if replayed.dropped > 0 || replayed.steps == 0 => Done::Undecided,
        () => Done::Well,
    })
}

fn run_demo(
    server: Option<&Program>,
    csv: Option<&Path>,
    cache: CacheArguments,
    style: TableStyle,
) -> Result<Done, Box<dyn Error>> {
    let (text, run) = crate::demo::run(server, csv, &cache.cache.unwrap_or_default(), &style)?;
    print(&text)?;
    Ok(if run.undecided > 0 { Done::Undecided } else { Done::Well })
}

fn demo_scene(step: usize, into: &Path) -> Result<Done, Box<dyn Error>> {
    let path = crate::demo::scene::write(step, into)?;
    print(&format!("{}\n", path.display()))?;
    Ok(Done::Well)
}

fn facets(word: &str) -> Result<Facets, String> {
    Facets::of_name(word).ok_or_else(|| format!("expected {}", Facets::NAMES.join(", ")))
}

fn length(word: &str) -> Result<f64, String> {
    let positive = word.parse::<f64>().ok().filter(|x| *x > 0.0 && x.is_finite());
    positive.ok_or_else(|| "expected a positive finite length".into())
}

fn direction(word: &str) -> Result<glam::DVec3, String> {
    let numbers: Result<Vec<f64>, _> = word.split(',').map(|w| w.trim().parse::<f64>()).collect();
    let direction = numbers.ok().and_then(|n| <[f64; 3]>::try_from(n).ok()).map(glam::DVec3::from_array);
    // Straight up or down there is no right and left.
    let aside = |d: &glam::DVec3| d.is_finite() && d.truncate().length() > 1e-3 * d.length();
    direction.filter(aside).ok_or_else(|| "expected three numbers, as in 1,-2,1, not straight up or down".into())
}

fn seconds(word: &str) -> Result<Duration, String> {
    let positive = word.parse::<f64>().ok().filter(|x| *x > 0.0);
    positive
        .and_then(|x| Duration::try_from_secs_f64(x).ok())
        .ok_or_else(|| "expected a positive number of seconds".into())
}

/// The scene of a file, or of models as they stand.
fn scene_of(files: &[PathBuf], access: &AccessArguments, joints: &JointArguments) -> Result<Scene, Box<dyn Error>> {
    files.iter().try_for_each(|file| no_geometry(file))?;
    let scene = match files {
        [file] if is_scene(file) => read_scene(file, joints)?,
        files => match files.iter().find(|f| is_scene(f)) {
            Some(scene) => {
                return Err(format!("expected one scene, or models, found {} among them", scene.display()).into());
            }
            None => {
                joints.none(&files[0])?;
                Scene::of_models(files)
            }
        },
    };
    Ok(Scene { access: access.with(scene.access.clone())?, ..scene })
}

fn view_scene(arguments: &ViewArguments) -> Result<Done, Box<dyn Error>> {
    if let Some(name) = &arguments.server {
        live::view(name, arguments.port, &arguments.cache)?;
        return Ok(Done::Well);
    }
    let show = if arguments.demo {
        crate::demo::show(arguments.cache.open().as_ref())?
    } else if let Some(file) = arguments.files.iter().find(|f| recorded::is_recording(f)) {
        arguments.joints.none(file)?;
        if arguments.files.len() > 1 {
            return Err(format!("expected one recording alone, found {} among others", file.display()).into());
        }
        recorded::show(file, arguments.cache.open().as_ref())?
    } else {
        let scene = scene_of(&arguments.files, &arguments.access, &arguments.joints)?;
        let prepared = prepare_scene(&scene, arguments.facets, &arguments.cache)?;
        let names = arguments.files.iter().map(|f| f.file_name().unwrap_or_default().to_string_lossy());
        let title = names.collect::<Vec<_>>().join(", ");
        let models = models_of(&prepared);
        Show::of_scene(title, without_touching(scene, &models, &arguments.joints)?, &models)?
    };
    if let Some(to) = &arguments.gltf {
        let bytes = crate::view::gltf::glb(&show)?;
        std::fs::write(to, bytes).map_err(|e| format!("{}: expected to write, found {e}", to.display()))?;
        return Ok(Done::Well);
    }
    show.buffers.notes().for_each(warn);
    let ready = |address: &str| {
        // A reader that has gone away does not stop it.
        let _ = print(&format!("contactd view: open {address} in a browser; Ctrl+C ends it\n"));
    };
    crate::view::serve(show, arguments.port, ready)?;
    Ok(Done::Well)
}

fn check_scene(arguments: &CheckArguments, paint: Paint) -> Result<Done, Box<dyn Error>> {
    let scene = scene_of(&arguments.files, &arguments.access, &arguments.joints)?;
    let prepared = prepare_scene(&scene, arguments.facets, &arguments.cache)?;
    if scene.file.is_empty() {
        for (source, p) in scene.models.iter().zip(&prepared) {
            inspect::grouped(&p.notes).iter().for_each(|n| warn(&format!("{}:{n}", source.text_name())));
        }
    }
    let models = models_of(&prepared);
    let scene = without_touching(scene, &models, &arguments.joints)?;
    let mut check = Check::new(&scene, &models, arguments.resolution)?;
    let outcome = check.step(arguments.first)?.clone();
    if let Some(to) = &arguments.certificate {
        let (text, without) = check.certificates(&outcome);
        std::fs::write(to, text).map_err(|e| format!("{}: {e}", to.display()))?;
        if without > 0 {
            eprintln!("{}: {without} pairs have no certificate", to.display());
        }
    }
    let undecided = outcome.undecided || outcome.pairs.iter().any(|p| p.outcome.status() == Status::Undecided);
    let files: Vec<String> = scene.models.iter().map(|m| m.text_name()).collect();
    let pairs = pairs_of(&scene, &files, &check, &outcome);
    // Over all pairs, also those that --first does not show.
    let answer = Answer { safe_time: outcome.safe_time, ..Answer::of_pairs(&pairs) };
    let style = TableStyle { all: arguments.all, wide: arguments.wide, paint };
    let mut text = if arguments.json { answer.json()? + "\n" } else { answer.table(&style) };
    let is_static = check.world.bodies().iter().filter(|body| body.is_static).count();
    if !arguments.json && outcome.pairs.is_empty() && is_static > 1 {
        text += "static objects are not asked about with each other: see `contactd overlaps`\n";
    }
    if arguments.explain {
        // Beside JSON it goes to standard error, which may be a file.
        let style = if arguments.json { TableStyle { paint: Paint::default(), ..style } } else { style };
        let work = report::work_table(&pairs, &check.clocks(&outcome), &style)
            + &report::effects_line(&outcome.effect_counters);
        if arguments.json {
            eprint!("{work}");
        } else {
            text.push_str(&work);
        }
    }
    print(&text)?;
    Ok(if undecided { Done::Undecided } else { Done::Well })
}

/// The answers of a step with what it takes to tell them; `files` are those of the scene's models.
fn pairs_of<'a>(scene: &Scene, files: &'a [String], check: &'a Check, outcome: &'a StepOutcome) -> Vec<PairReport<'a>> {
    let bodies = check.world.bodies();
    let pair = |p: &'a PairOutcome| {
        let [a, b] = [p.a, p.b].map(|id| &bodies[id as usize]);
        PairReport {
            names: [&a.name, &b.name],
            solids: [&a.part.model.solid, &b.part.model.solid],
            files: [p.a, p.b].map(|id| files[scene.objects[id as usize].model].as_str()),
            outcome: &p.outcome,
            report: p.plan.report,
            regions: outcome.regions_of(p),
            regions_complete: p.regions_complete,
            clearance: outcome.clearance_of(p),
            discrete: p.plan.detect == Detect::Discrete,
        }
    };
    outcome.pairs.iter().map(pair).collect()
}

/// Lines about what a model has lost.
const MOST_LOSSES: usize = 3;

/// The models of a scene, with a word on standard error where the cache is in trouble, and of what is left out.
fn prepare_scene(scene: &Scene, facets: Facets, cache: &CacheArguments) -> Result<Vec<Prepared>, Box<dyn Error>> {
    let prepared = prepare_parts(scene, facets, cache)?;
    tell_empty(scene, &prepared);
    // Of texts alone `check` tells every note.
    for (source, p) in scene.models.iter().zip(&prepared).filter(|_| !scene.file.is_empty()) {
        let lost: Vec<Note> = p.notes.iter().filter(|n| n.is_loss()).cloned().collect();
        let lines = inspect::grouped(&lost);
        lines.iter().take(MOST_LOSSES).for_each(|n| warn(&format!("{}:{n}", source.text_name())));
        if lines.len() > MOST_LOSSES {
            let more = lines.len() - MOST_LOSSES;
            warn(&format!("{}: {more} more like these: `contactd inspect` tells all", source.text_name()));
        }
    }
    Ok(prepared)
}

/// A word on standard error about models without a point.
fn tell_empty(scene: &Scene, prepared: &[Prepared]) {
    for (source, _) in scene.models.iter().zip(prepared).filter(|(_, p)| p.model.solid.is_empty()) {
        let at = if scene.file.is_empty() { String::new() } else { format!("{}:{}: ", scene.file, source.at) };
        warn(&format!("{at}the model \"{}\" is empty: nothing can touch it", source.name));
    }
}

/// The same of models that may well be empty.
fn prepare_parts(scene: &Scene, facets: Facets, cache: &CacheArguments) -> Result<Vec<Prepared>, Box<dyn Error>> {
    let prepared = cache::prepare_scene(cache.open().as_ref(), scene, facets, &Limits::default())?;
    prepared.iter().filter_map(|p| p.trouble.as_deref()).for_each(warn);
    scene.notes.iter().for_each(|n| warn(&format!("{}:{}", scene.file, clean(&n.to_string()))));
    Ok(prepared)
}

fn models_of(prepared: &[Prepared]) -> Vec<Arc<Model>> {
    prepared.iter().map(|p| p.model.clone()).collect()
}

fn warn(sentence: &str) {
    say(&format!("contactd: {sentence}"));
}

/// A line on standard error, if anybody reads it.
fn say(sentence: &str) {
    // What a file calls itself or its objects may stand in it.
    let lines: Vec<String> =
        sentence.split('\n').map(|line| line.split('\t').map(clean).collect::<Vec<_>>().join("\t")).collect();
    let _ = writeln!(std::io::stderr(), "{}", lines.join("\n"));
}

/// Refuses a geometry of volumes or cells where they are no scene.
fn no_geometry(file: &Path) -> Result<(), String> {
    let kind = match () {
        () if overlaps::is_gdml(file) => "a GDML",
        () if overlaps::is_openmc(file) => "an OpenMC",
        () => return Ok(()),
    };
    let file = file.display();
    Err(format!("{file}: expected a scene, a robot or a model, found {kind} geometry, which contactd overlaps takes"))
}

fn inspect_file(
    file: &Path,
    facets: Facets,
    (picture, camera): (Option<&Path>, Option<glam::DVec3>),
    (joints, access): (&JointArguments, &AccessArguments),
    cache: &CacheArguments,
) -> Result<Done, Box<dyn Error>> {
    if camera.is_some() && !is_scene(file) {
        return Err(
            format!("expected a scene beside --camera, found {}: a model's picture has none", file.display()).into()
        );
    }
    no_geometry(file)?;
    let text = if is_scene(file) {
        let scene = read_scene(file, joints)?;
        let scene = Scene { access: access.with(scene.access.clone())?, ..scene };
        let models = prepare_scene(&scene, facets, cache)?;
        let scene = without_touching(scene, &models_of(&models), joints)?;
        let mut text = joints::told(file, joints)? + &inspect::scene(&scene) + &inspect::effects(&scene);
        for (source, p) in scene.models.iter().zip(&models) {
            text.push_str(&inspect::model(&source.path.display().to_string(), &p.model, &p.notes));
        }
        if let Some(to) = picture {
            write_picture(to, &scene_picture(&scene, &models_of(&models), camera)?)?;
        }
        text
    } else {
        joints.none(file)?;
        let (limits, name) = (Limits::default(), file.display().to_string());
        let read = ModelBytes::read(file, &access.with(Access::default())?, &limits)?;
        let prepared = cache::prepare(cache.open().as_ref(), &read.source(), facets, &limits)?;
        prepared.trouble.as_deref().into_iter().for_each(warn);
        let text = inspect::model(&name, &prepared.model, &prepared.notes);
        if let Some(to) = picture {
            let name = file.file_stem().unwrap_or_default().to_string_lossy();
            write_picture(to, &picture::model(&name, &prepared.model))?;
        }
        text
    };
    print(&text)?;
    Ok(Done::Well)
}

/// The scene at its contacts, solved as `check` does.
fn scene_picture(scene: &Scene, models: &[Arc<Model>], from: Option<glam::DVec3>) -> Result<Drawing, Box<dyn Error>> {
    let mut check = Check::new(scene, models, None)?;
    let outcome = check.step(false)?.clone();
    let bodies = check.world.bodies();
    let actors: Vec<Actor<'_>> = bodies
        .iter()
        .zip(&scene.objects)
        .map(|(body, object)| Actor {
            name: &object.name,
            solid: &body.part.model.solid,
            model: object.model,
            place: object.place,
            motion: object.motion,
        })
        .collect();
    let meetings: Vec<Meeting<'_>> =
        outcome.pairs.iter().map(|p| Meeting { pair: [p.a as usize, p.b as usize], outcome: &p.outcome }).collect();
    let lengths = if scene.unit.is_empty() { String::new() } else { format!(" Lengths are in {}.", scene.unit) };
    let note = format!("Each object stands where it first meets another one; t is a fraction of the step.{lengths}");
    let quality = picture::scene::Quality { from, ..picture::scene::FINE };
    Ok(picture::scene::scene("", &note, &actors, &meetings, quality))
}

/// Writes a drawing in the format that the file's name tells.
fn write_picture(to: &Path, drawing: &Drawing) -> Result<(), String> {
    let bytes = drawing.encode_for(to)?;
    std::fs::write(to, bytes).map_err(|e| format!("{}: expected to write, found {e}", to.display()))
}

/// Writes to standard output; a reader that has gone away is no error.
///
/// # Errors
/// One sentence.
fn print(text: &str) -> Result<(), String> {
    let mut out = std::io::stdout();
    written(out.write_all(text.as_bytes()).and_then(|()| out.flush()))
}

/// What became of something that was written to standard output.
fn written(done: std::io::Result<()>) -> Result<(), String> {
    match done {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(format!("standard output: expected to write, found: {e}"))
        }
        _ => Ok(()),
    }
}
