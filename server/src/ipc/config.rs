//! What a server is told at its start: limits and waiting. Every field has a default that suits a workstation.

use super::log::Level;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// The part of a deadline that is left to the reply.
const REPLY_PART: u32 = 10;

/// Settings of a server, as a TOML file may give them.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ServerConfig {
    /// Sessions at a time.
    pub sessions: usize,
    /// Objects of a session.
    pub objects: usize,
    /// Records of a batch.
    pub batch: usize,
    /// Records of a reply; more are cut off, the latest first, and the reply says so.
    pub records: usize,
    /// Bytes of a model's text.
    pub text: usize,
    /// Megabytes of a session's models together: their texts, and 200 bytes a face.
    pub models_mb: u64,
    /// Nodes of a model's tree.
    pub nodes: usize,
    /// Depth of a model's tree; trees are walked by recursion, so this may be lowered alone.
    pub depth: usize,
    /// Faces of a model.
    pub faces: usize,
    /// Microseconds for which server and clients poll before they block; 0: never. Polling halves the round trip many
    /// times over while both sides have a core, and costs a core while it lasts.
    pub spin_us: u64,
    /// Seconds after which a session ends whose client cannot be watched (another pid namespace) and asks nothing.
    pub idle_s: u64,
    /// Milliseconds within which a step is answered; what is not known by then is undecided. 0: work alone limits a step, and
    /// its answer does not depend on time.
    pub deadline_ms: u64,
    /// Folder for preprocessed models, or `"off"`.
    pub cache: CacheFolder,
    /// Megabytes that the files in it may take; those used longest ago go first.
    pub cache_mb: u64,
    /// A folder of this machine: texts that clients send may import files of it and below, by names relative to it. None: a text
    /// that is sent names no files.
    pub import_root: Option<PathBuf>,
    /// A folder in which each start of the server records all of its steps, into a file of its own (docs/record.md). None: nothing is
    /// recorded unless somebody asks for it.
    pub record: Option<PathBuf>,
    /// A port of 127.0.0.1 on which OpenMetrics are told ([`crate::metrics`]); 0: any that is free. None: none are.
    pub metrics: Option<u16>,
    /// How much a server tells on standard error.
    pub log: Level,
}

/// Where preprocessed models are kept between runs, if anywhere.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(from = "PathBuf")]
pub struct CacheFolder(Option<PathBuf>);

impl CacheFolder {
    /// The folder; `None`: they are not kept.
    pub fn folder(&self) -> Option<&Path> {
        self.0.as_deref()
    }
}

impl From<PathBuf> for CacheFolder {
    /// The word `off` is none; a folder of that name is `./off`.
    fn from(path: PathBuf) -> Self {
        Self((path != Path::new("off")).then_some(path))
    }
}

impl From<OsString> for CacheFolder {
    fn from(path: OsString) -> Self {
        PathBuf::from(path).into()
    }
}

impl Default for ServerConfig {
    fn default() -> Self {
        let limits = crate::import::Limits::default();
        Self {
            sessions: 32,
            objects: 1 << 20,
            batch: 1 << 20,
            records: 1 << 20,
            text: limits.bytes,
            models_mb: 256,
            nodes: limits.nodes,
            depth: limits.depth,
            faces: limits.faces,
            spin_us: 30,
            idle_s: 300,
            deadline_ms: 0,
            cache: CacheFolder::default(),
            cache_mb: crate::cache::DEFAULT_BYTES >> 20,
            import_root: None,
            record: None,
            metrics: None,
            log: Level::default(),
        }
    }
}

impl ServerConfig {
    /// When a step that begins now must have been searched; `None` where work alone limits it.
    pub(super) fn deadline(&self) -> Option<Instant> {
        let whole = Duration::from_millis(self.deadline_ms);
        (self.deadline_ms > 0).then(|| Instant::now() + (whole - whole / REPLY_PART))
    }

    /// Reads a TOML file.
    ///
    /// # Errors
    /// One sentence with file, line and column.
    pub fn read(path: &Path) -> Result<Self, String> {
        let text = std::fs::read_to_string(path)
            .map_err(|e| format!("{}: expected a readable file, found {e}", path.display()))?;
        Self::parse(&path.display().to_string(), &text)
    }

    /// Reads TOML text that stands in `file`.
    ///
    /// # Errors
    /// One sentence with file, line and column.
    pub fn parse(file: &str, text: &str) -> Result<Self, String> {
        let config: Self = toml::from_str(text).map_err(|e| {
            let at = crate::import::Place::of_offset(text, e.span().map_or(0, |s| s.start));
            format!("{file}:{at}: {}", e.message())
        })?;
        // The values' places; what could be read once can be read again.
        let places: BTreeMap<String, toml::Spanned<toml::Value>> = toml::from_str(text).unwrap_or_default();
        if let Some(root) = config.import_root.as_ref().filter(|root| !root.is_dir()) {
            let start = places.get("import_root").map_or(0, |v| v.span().start);
            let at = crate::import::Place::of_offset(text, start);
            return Err(format!("{file}:{at}: import_root = {root:?}: expected a folder"));
        }
        for (name, value, least, most) in config.bounded() {
            if !(least..=most).contains(&value) {
                let start = places.get(name).map_or(0, |v| v.span().start);
                let at = crate::import::Place::of_offset(text, start);
                return Err(format!("{file}:{at}: {name} = {value}: expected {least} to {most}"));
            }
        }
        Ok(config)
    }

    /// Its numbers that have bounds: key, value, the least and the most that it may be.
    pub fn bounded(&self) -> [(&'static str, u64, u64, u64); 13] {
        let limits = crate::import::Limits::default();
        let longest = contactd_proto::control::DECODE_LIMIT - (1 << 20);
        [
            ("sessions", self.sessions as u64, 1, 200),
            ("objects", self.objects as u64, 1, 1 << 24),
            ("batch", self.batch as u64, 1, 1 << 24),
            ("records", self.records as u64, 1, 1 << 24),
            ("text", self.text as u64, 1, longest as u64),
            ("nodes", self.nodes as u64, 1, 1 << 30),
            ("depth", self.depth as u64, 1, limits.depth as u64),
            ("faces", self.faces as u64, 1, 1 << 30),
            ("idle_s", self.idle_s, 1, 1 << 31),
            ("models_mb", self.models_mb, 1, 1 << 20),
            ("cache_mb", self.cache_mb, 1, 1 << 20),
            ("spin_us", self.spin_us, 0, 1_000_000),
            ("deadline_ms", self.deadline_ms, 0, 1 << 31),
        ]
    }

    /// What an import may use.
    pub(super) fn import_limits(&self) -> crate::import::Limits {
        let default = crate::import::Limits::default();
        crate::import::Limits { bytes: self.text, nodes: self.nodes, depth: self.depth, faces: self.faces, ..default }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_read_and_mistakes_named() {
        let config = ServerConfig::parse("c.toml", "sessions = 3\nspin_us = 0").unwrap();
        assert_eq!(config, ServerConfig { sessions: 3, spin_us: 0, ..ServerConfig::default() });
        let kept = ServerConfig::parse("c.toml", "cache = \"kept\"\ncache_mb = 5").unwrap();
        assert_eq!((kept.cache.folder(), kept.cache_mb), (Some(Path::new("kept")), 5));
        assert_eq!(ServerConfig::parse("c.toml", "cache = \"off\"").unwrap(), ServerConfig::default());
        for (text, what) in [
            ("sessions = 3\nsesions = 4", "c.toml:2:1: unknown field"),
            ("sessions = \"x\"", "c.toml:1:12: invalid type"),
            ("sessions = 0", "c.toml:1:12: sessions = 0: expected 1 to 200"),
            ("sessions = 2\nidle_s = 0", "c.toml:2:10: idle_s = 0: expected 1 to 2147483648"),
            ("nodes = 0", "c.toml:1:9: nodes = 0: expected 1 to 1073741824"),
            ("faces = 0", "c.toml:1:9: faces = 0: expected 1 to 1073741824"),
            ("depth = 1001", "c.toml:1:9: depth = 1001: expected 1 to 1000"),
            ("spin_us = 1000001", "c.toml:1:11: spin_us = 1000001: expected 0 to 1000000"),
            ("sessions = ", "c.toml:1:"),
            ("cache_mb = 0", "cache_mb = 0: expected 1 to 1048576"),
            ("cache = 1", "c.toml:1:9: invalid type"),
            ("metrics = 65536", "c.toml:1:11: invalid value"),
            ("log = \"loud\"", "c.toml:1:7: unknown variant `loud`, expected one of `warn`, `info`, `debug`"),
        ] {
            let sentence = ServerConfig::parse("c.toml", text).unwrap_err();
            assert!(sentence.contains(what), "{sentence}");
        }
    }
}
