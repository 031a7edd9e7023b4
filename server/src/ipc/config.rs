//! What a server is told at its start: limits and waiting. Every field has a default that suits a workstation.

use serde::Deserialize;
use std::path::Path;

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
        for (text, what) in [
            ("sessions = 3\nsesions = 4", "c.toml:2:1: unknown field"),
            ("sessions = \"x\"", "c.toml:1:12: invalid type"),
            ("sessions = 0", "sessions = 0: expected 1 to 200"),
            ("sessions = ", "c.toml:1:"),
        ] {
            let sentence = ServerConfig::parse("c.toml", text).unwrap_err();
            assert!(sentence.contains(what), "{sentence}");
        }
    }
}
