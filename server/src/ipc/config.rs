//! What a server is told at its start: limits and waiting. Every field has a default that suits a workstation.

use serde::Deserialize;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

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
    /// Nodes of a model's tree.
    pub nodes: usize,
    /// Depth of a model's tree.
    pub depth: usize,
    /// Faces of a model.
    pub faces: usize,
    /// Microseconds for which server and clients poll before they block; 0: never. Polling halves the round trip many
    /// times over while both sides have a core, and costs a core while it lasts.
    pub spin_us: u64,
    /// Seconds after which a session ends whose client cannot be watched (another pid namespace) and asks nothing.
    pub idle_s: u64,
    /// Folder for preprocessed models, or `"off"`.
    pub cache: CacheFolder,
    /// Megabytes that the files in it may take; those used longest ago go first.
    pub cache_mb: u64,
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
            text: limits.text,
            nodes: limits.nodes,
            depth: limits.depth,
            faces: limits.faces,
            spin_us: 30,
            idle_s: 300,
            cache: CacheFolder::default(),
            cache_mb: crate::cache::DEFAULT_BYTES >> 20,
        }
    }
}

impl ServerConfig {
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
        let bounded = [
            ("sessions", config.sessions, 200),
            ("objects", config.objects, 1 << 24),
            ("batch", config.batch, 1 << 24),
            ("records", config.records, 1 << 24),
            ("text", config.text, contactd_proto::control::DECODE_LIMIT - (1 << 20)),
            ("cache_mb", config.cache_mb as usize, 1 << 20),
        ];
        for (name, value, most) in bounded {
            if value == 0 || value > most {
                return Err(format!("{file}: {name} = {value}: expected 1 to {most}"));
            }
        }
        Ok(config)
    }

    /// What an import may use.
    pub(super) fn import_limits(&self) -> crate::import::Limits {
        let default = crate::import::Limits::default();
        crate::import::Limits { text: self.text, nodes: self.nodes, depth: self.depth, faces: self.faces, ..default }
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
            ("sessions = 0", "sessions = 0: expected 1 to 200"),
            ("sessions = ", "c.toml:1:"),
            ("cache_mb = 0", "cache_mb = 0: expected 1 to 1048576"),
            ("cache = 1", "c.toml:1:9: invalid type"),
        ] {
            let sentence = ServerConfig::parse("c.toml", text).unwrap_err();
            assert!(sentence.contains(what), "{sentence}");
        }
    }
}
