//! Reading what the user names: scenarios, maps, and the files named inside them.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Read;
use std::ops::Range;
use std::path::{Path, PathBuf};

use bikebot_planner::{End, PlanError};
use bikebot_sim::record::SourceFile;
use bikebot_sim::scenario::MAX_SCENARIO_BYTES;
use bikebot_sim::{Override, ScenarioError, ScenarioFile, Setup, SetupError};
use bikebot_world::formats::{MapError, MapProblem};

use crate::args::Changes;
use crate::diag::Diagnostic;
use crate::exit::{Failure, plain};
use crate::terminal::Terminal;

/// Largest map, image or path file that is read, bytes.
const MAX_FILE_BYTES: u64 = 256 << 20;

/// Reads a file named on the command line; pipes will do, folders will not.
///
/// # Errors
///
/// [`Failure::Io`] when it cannot be read, [`Failure::Usage`] beyond `limit` bytes.
pub fn read(path: &Path, limit: u64) -> Result<Vec<u8>, Failure> {
    let unreadable = |error| Failure::file("read", path, &error);
    if path.is_dir() {
        return Err(Failure::io(Diagnostic::error(format!(
            "cannot read {}: it is a folder",
            path.display()
        ))));
    }
    let mut bytes = Vec::new();
    let count = File::open(path)
        .and_then(|file| file.take(limit + 1).read_to_end(&mut bytes))
        .map_err(unreadable)?;
    if count as u64 > limit {
        return Err(Failure::usage(
            Diagnostic::error(format!("{} has more than {limit} bytes", path.display()))
                .help("is this the right file?"),
        ));
    }
    Ok(bytes)
}

/// Reads a map or path file.
pub fn read_map(path: &Path) -> Result<Vec<u8>, Failure> {
    read(path, MAX_FILE_BYTES)
}

/// Reads a file named inside another one. Only regular files: a scenario from
/// elsewhere must not make us wait on a device or a pipe.
pub fn read_inner(path: &Path) -> Result<Vec<u8>, String> {
    let facts = fs::metadata(path).map_err(|error| plain(&error))?;
    if facts.is_dir() {
        return Err("it is a folder".into());
    }
    if !facts.is_file() {
        return Err("it is not a regular file".into());
    }
    if facts.len() > MAX_FILE_BYTES {
        return Err(format!(
            "it has {} bytes, more than the {MAX_FILE_BYTES} that are read",
            facts.len()
        ));
    }
    fs::read(path).map_err(|error| plain(&error))
}

/// What a file seems to be, by its extension.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A map of any format.
    Map,
    /// A recording, whole or not.
    Recording,
    /// A scenario, as far as can be told.
    Other,
}

impl Kind {
    /// Judges `path`.
    pub fn of(path: &Path) -> Self {
        let extension = path.extension().and_then(|extension| extension.to_str());
        match extension.unwrap_or_default().to_ascii_lowercase().as_str() {
            "yaml" | "yml" | "png" | "pgm" | "bmp" | "map" | "json" | "txt" => Self::Map,
            "mcap" | "part" => Self::Recording,
            _ => Self::Other,
        }
    }

    /// Refuses to read as a scenario what is something else.
    fn refuse_as_scenario(self, path: &Path) -> Result<(), Failure> {
        let path = path.display();
        let (is, help) = match self {
            Self::Map => (
                "a map",
                format!("`bikebot map info {path}` and `bikebot plan {path}` read maps"),
            ),
            Self::Recording => (
                "a recording",
                format!("`bikebot run --from {path}` runs it again"),
            ),
            Self::Other => return Ok(()),
        };
        Err(Failure::usage(
            Diagnostic::error(format!("{path} is {is}, not a scenario")).help(help),
        ))
    }
}

/// Where the files come from that a scenario names.
#[derive(Debug)]
enum Files {
    /// From the folder of the scenario.
    Beside(PathBuf),
    /// From a recording.
    Attached(BTreeMap<String, Vec<u8>>),
}

/// A change made on the command line: the key it sets, and how it was typed.
#[derive(Debug, Clone)]
pub struct Given {
    /// The override it amounts to.
    pub change: Override,
    /// What the user typed, for messages.
    pub typed: String,
}

/// A scenario that was read and parsed, with what is needed to speak about it.
#[derive(Debug)]
pub struct Loaded {
    name: String,
    text: String,
    file: ScenarioFile,
    files: Files,
    given: Vec<Given>,
    is_bare_map: bool,
}

impl Loaded {
    /// Reads the scenario `path` (`-` is standard input) with `changes`.
    pub fn read(path: &Path, changes: &Changes) -> Result<Self, Failure> {
        Self::read_with(path, changes, Vec::new())
    }

    /// As [`Loaded::read`], with the changes that a verb's own flags amount to.
    /// `--set` comes last and wins.
    pub fn read_with(path: &Path, changes: &Changes, flags: Vec<Given>) -> Result<Self, Failure> {
        let is_stdin = path.as_os_str() == "-";
        if path.is_file() {
            Kind::of(path).refuse_as_scenario(path)?;
        }
        let limit = MAX_SCENARIO_BYTES as u64;
        let (name, bytes) = if is_stdin {
            ("<stdin>".to_owned(), read(Path::new("/dev/stdin"), limit)?)
        } else {
            (path.display().to_string(), read(path, limit)?)
        };
        let folder = match path.parent() {
            Some(folder) if !is_stdin => folder.to_owned(),
            _ => PathBuf::new(),
        };
        let text = String::from_utf8(bytes).map_err(|error| {
            let at = error.utf8_error().valid_up_to();
            let line = error.as_bytes()[..at]
                .iter()
                .filter(|b| **b == b'\n')
                .count()
                + 1;
            Failure::usage(
                Diagnostic::error("the scenario is not text: a byte is not UTF-8")
                    .at_line(&name, Some(line))
                    .help("save it as UTF-8; is this the right file?"),
            )
        })?;
        Self::parse(
            name,
            text,
            Files::Beside(folder),
            given(changes, flags)?,
            false,
        )
    }

    /// A scenario that only says: this map. The footprint defaults to a point.
    pub fn bare_map(path: &Path, changes: &Changes, flags: Vec<Given>) -> Result<Self, Failure> {
        // Read now, so that a name mistyped on the command line is told as such.
        read_map(path)?;
        let (Some(file), Some(stem)) = (
            path.file_name().and_then(|name| name.to_str()),
            path.file_stem().and_then(|stem| stem.to_str()),
        ) else {
            return Err(Failure::usage(Diagnostic::error(format!(
                "the name of the map {} is not UTF-8",
                path.display()
            ))));
        };
        let mut map = toml::Table::new();
        map.insert("file".into(), file.into());
        let mut planner = toml::Table::new();
        planner.insert("footprint".into(), "point".into());
        let mut scenario = toml::Table::new();
        scenario.insert("format".into(), 1.into());
        scenario.insert(
            "name".into(),
            stem.chars().take(80).collect::<String>().into(),
        );
        scenario.insert("map".into(), map.into());
        scenario.insert("planner".into(), planner.into());
        let folder = path.parent().map(Path::to_owned).unwrap_or_default();
        Self::parse(
            path.display().to_string(),
            scenario.to_string(),
            Files::Beside(folder),
            given(changes, flags)?,
            true,
        )
    }

    /// A scenario that comes with the program, with the files it names.
    pub fn built_in(
        text: &str,
        files: &[(&str, &[u8])],
        changes: &Changes,
    ) -> Result<Self, Failure> {
        let files = files
            .iter()
            .map(|&(name, bytes)| (name.to_owned(), bytes.to_owned()))
            .collect();
        Self::parse(
            "<built-in>".to_owned(),
            text.to_owned(),
            Files::Attached(files),
            given(changes, Vec::new())?,
            false,
        )
    }

    /// The scenario a recording carries.
    pub fn recorded(
        recording: &Path,
        text: String,
        files: Vec<SourceFile>,
        changes: &Changes,
    ) -> Result<Self, Failure> {
        let files = files
            .into_iter()
            .map(|file| (file.name, file.data))
            .collect();
        Self::parse(
            format!("{}#scenario.toml", recording.display()),
            text,
            Files::Attached(files),
            given(changes, Vec::new())?,
            false,
        )
    }

    fn parse(
        name: String,
        text: String,
        files: Files,
        given: Vec<Given>,
        is_bare_map: bool,
    ) -> Result<Self, Failure> {
        tracing::debug!(
            "scenario {name}, {} bytes, {} changes",
            text.len(),
            given.len()
        );
        let changes: Vec<Override> = given.iter().map(|given| given.change.clone()).collect();
        match ScenarioFile::parse(&text, &changes) {
            Ok(file) => Ok(Self {
                name,
                text,
                file,
                files,
                given,
                is_bare_map,
            }),
            Err(error) => {
                let source = (!is_bare_map).then_some(text.as_str());
                Err(Failure::usage(tell(&error, &name, source, &given)))
            }
        }
    }

    /// The file's name, for messages.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The map file the scenario names, as a user finds it.
    pub fn map_name(&self) -> Option<String> {
        let map = self.file.scenario.map.as_ref()?;
        map.file.as_ref().map(|name| self.shown(name))
    }

    /// The scenario.
    pub fn file(&self) -> &ScenarioFile {
        &self.file
    }

    /// The changes made on the command line.
    pub fn changes(&self) -> Vec<Override> {
        self.given
            .iter()
            .map(|given| given.change.clone())
            .collect()
    }

    /// Resolves it, reading the files it names, and shows the warnings.
    pub fn setup(&self, terminal: &Terminal) -> Result<Setup, Failure> {
        let mut seen = BTreeMap::new();
        let resolved = Setup::resolve(&self.file, &mut |inner| {
            let bytes = self.read_file(inner)?;
            seen.insert(inner.to_owned(), bytes.clone());
            Ok(bytes)
        });
        let setup = resolved.map_err(|error| self.tell_setup(error, &seen))?;
        for warning in &setup.warnings {
            terminal.warn(&Diagnostic::warning(warning.clone()));
        }
        Ok(setup)
    }

    /// A diagnostic for a scenario that cannot be resolved; `seen` are the files
    /// that were read, to show lines of.
    pub fn tell_setup(&self, error: SetupError, seen: &BTreeMap<String, Vec<u8>>) -> Failure {
        Failure::usage(match error {
            SetupError::Scenario(error) => self.tell(&error),
            SetupError::Map { error, .. } => {
                let named = self
                    .file
                    .scenario
                    .map
                    .as_ref()
                    .and_then(|map| map.file.clone());
                let name = named.unwrap_or_default();
                let bytes = seen.get(&name).map(Vec::as_slice);
                let cell_size = if self.is_bare_map {
                    "give it by --set map.meters_per_cell=M"
                } else {
                    "add `meters_per_cell = …` to [map]"
                };
                tell_map(&error, &self.shown(&name), &name, bytes, cell_size)
            }
        })
    }

    /// Reads a file by the name it has in the scenario.
    pub fn read_file(&self, inner: &str) -> Result<Vec<u8>, String> {
        tracing::info!("reading {}", self.shown(inner));
        match &self.files {
            Files::Beside(folder) => read_inner(&folder.join(inner)),
            Files::Attached(files) => files
                .get(inner)
                .cloned()
                .ok_or_else(|| "the recording does not carry it".into()),
        }
    }

    /// The name under which a user finds a file that the scenario names.
    fn shown(&self, inner: &str) -> String {
        match &self.files {
            Files::Beside(folder) => folder.join(inner).display().to_string(),
            Files::Attached(_) => inner.to_owned(),
        }
    }

    /// Whether start and goal can be planned between.
    pub fn check_ends(&self, setup: &Setup) -> Result<(), Failure> {
        match setup.problem() {
            Some(problem) => problem
                .check(setup.planner.margin)
                .map_err(|error| Failure::usage(self.tell_plan(&error))),
            None => Ok(()),
        }
    }

    /// A diagnostic for a problem that cannot be planned.
    pub fn tell_plan(&self, error: &PlanError) -> Diagnostic {
        let (key, help) = match error {
            PlanError::StartInObstacle { .. } => (
                "start.x_m",
                "move the start, or give a smaller planner.footprint or margin",
            ),
            PlanError::GoalInObstacle { .. } => (
                "goal.x_m",
                "move the goal, or give a smaller planner.footprint or margin",
            ),
            PlanError::OutsideMap { which, .. } => (
                match which {
                    End::Start => "start.x_m",
                    End::Goal => "goal.x_m",
                },
                "`bikebot map info` tells where the map lies",
            ),
            _ => ("planner", "see `bikebot explain`"),
        };
        self.tell(&self.file.error_at(key, error.to_string(), help))
    }

    /// A diagnostic for an error of this scenario.
    pub fn tell(&self, error: &ScenarioError) -> Diagnostic {
        if self.is_bare_map {
            // There is no scenario to point into, and no section to add: there are flags.
            return match error.key.as_deref() {
                Some(end @ ("start" | "goal")) => {
                    Diagnostic::error(format!("{} does not name a {end}", self.name))
                        .help(format!("give it by --{end} X,Y or --{end} X,Y,DEG"))
                }
                _ => tell(error, &self.name, None, &self.given),
            };
        }
        tell(error, &self.name, Some(&self.text), &self.given)
    }
}

/// The changes in the order they apply: the flags of the verb, the seed, `--set`.
fn given(changes: &Changes, mut flags: Vec<Given>) -> Result<Vec<Given>, Failure> {
    if let Some(seed) = changes.seed {
        flags.push(Given {
            change: Override::new("run.seed", seed),
            typed: format!("--seed {seed}"),
        });
    }
    for typed in &changes.set {
        let change = typed.parse().map_err(|reason: String| {
            Failure::usage(Diagnostic::error(format!("invalid --set: {reason}")))
        })?;
        flags.push(Given {
            change,
            typed: format!("--set {typed}"),
        });
    }
    Ok(flags)
}

/// A diagnostic for an error in the scenario `name`, whose `text` is shown if given.
fn tell(error: &ScenarioError, name: &str, text: Option<&str>, given: &[Given]) -> Diagnostic {
    let mut diagnostic = Diagnostic::error(error.message.clone()).maybe_help(error.help.clone());
    if let Some(key) = &error.from_override {
        let key = key.strip_prefix("--set ").unwrap_or(key);
        let by = given.iter().rev().find(|given| given.change.key == key);
        let typed = by.map_or_else(|| format!("--set {key}"), |given| given.typed.clone());
        return diagnostic.note(format!("given by {typed}"));
    }
    // An unknown section that only the command line names.
    if let (None, Some(key)) = (&error.span, &error.key)
        && let Some(given) = given
            .iter()
            .find(|given| given.change.key.starts_with(&format!("{key}.")))
    {
        return diagnostic.note(format!("given by {}", given.typed));
    }
    if let Some(text) = text {
        diagnostic = match &error.span {
            Some(span) => diagnostic.at_span(name, text, span.clone()),
            None => diagnostic.at_line(name, None),
        };
    }
    diagnostic
}

/// A diagnostic for a map that cannot be read. `outer` is the map as the user finds it, `name` as
/// it was given to the reader, `bytes` its content, `cell_size` how to say what a format leaves out.
pub fn tell_map(
    error: &MapError,
    outer: &str,
    name: &str,
    bytes: Option<&[u8]>,
    cell_size: &str,
) -> Diagnostic {
    if matches!(error.problem, MapProblem::MissingCellSize) {
        return Diagnostic::error("the format does not say how large a cell is")
            .at_line(outer, None)
            .help(format!("{cell_size}: metres per cell"));
    }
    let is_outer = error.file == name;
    let path = if is_outer {
        outer.to_owned()
    } else {
        // A file named inside the map is found beside it.
        Path::new(outer)
            .with_file_name(&error.file)
            .display()
            .to_string()
    };
    let message = match &error.key {
        Some(key) => format!("`{key}`: {}", error.problem),
        None => error.problem.to_string(),
    };
    let diagnostic = Diagnostic::error(message);
    let text = bytes
        .filter(|_| is_outer)
        .and_then(|bytes| std::str::from_utf8(bytes).ok());
    match (error.line, text) {
        (Some(line), Some(text)) => match span_of_line(text, line) {
            Some(span) => diagnostic.at_span(&path, text, span),
            None => diagnostic.at_line(&path, Some(line)),
        },
        (line, _) => diagnostic.at_line(&path, line),
    }
}

/// The bytes of a line, counted from 1, without its end.
pub fn span_of_line(text: &str, line: usize) -> Option<Range<usize>> {
    let mut start = 0;
    for (index, content) in text.split_inclusive('\n').enumerate() {
        if index + 1 == line {
            return Some(start..start + content.trim_end().len());
        }
        start += content.len();
    }
    None
}
