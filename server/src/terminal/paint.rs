//! Colour, where somebody looks at it.

use anstyle::{AnsiColor, Style};
use std::ffi::OsStr;

/// When text is coloured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Colour {
    /// Where standard output is a terminal, unless NO_COLOR is set in the environment.
    #[default]
    Auto,
    /// Always.
    Always,
    /// Never.
    Never,
}

impl Colour {
    /// The paint for an output: `is_terminal`, with what the environment says in NO_COLOR (<https://no-color.org>) and TERM.
    pub fn paint(self, is_terminal: bool, no_color: Option<&OsStr>, term: Option<&OsStr>) -> Paint {
        let is_wanted = no_color.is_none_or(OsStr::is_empty) && term.is_none_or(|t| t != "dumb");
        let on = match self {
            Self::Auto => is_terminal && is_wanted,
            Self::Always => true,
            Self::Never => false,
        };
        Paint { on }
    }
}

/// What a piece of text is, by which it is coloured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// A heading.
    Heading,
    /// A contact.
    Contact,
    /// An overlap: most likely a fault of the scene.
    Overlap,
    /// Nothing meets.
    Clear,
    /// Not known.
    Undecided,
    /// Of less weight than what stands about it.
    Faint,
}

/// Colours text, or leaves it as it is, which is the default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Paint {
    on: bool,
}

impl Paint {
    /// The text in the colour of its role.
    pub fn mark(self, role: Role, text: &str) -> String {
        let style = match role {
            Role::Heading => Style::new().bold(),
            Role::Contact => AnsiColor::Yellow.on_default().bold(),
            Role::Overlap => AnsiColor::Red.on_default().bold(),
            Role::Clear => AnsiColor::Green.on_default(),
            Role::Undecided => AnsiColor::Magenta.on_default().bold(),
            Role::Faint => Style::new().dimmed(),
        };
        if self.on && !text.is_empty() { format!("{style}{text}{style:#}") } else { text.to_owned() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colour_is_where_somebody_looks_and_wants_it() {
        let one = Some(OsStr::new("1"));
        let on = |colour: Colour, terminal, no_color, term| colour.paint(terminal, no_color, term).on;
        assert!(on(Colour::Auto, true, None, Some(OsStr::new("xterm"))));
        assert!(on(Colour::Auto, true, Some(OsStr::new("")), None), "an empty NO_COLOR says nothing");
        assert!(!on(Colour::Auto, true, one, None) && !on(Colour::Auto, false, None, None));
        assert!(!on(Colour::Auto, true, None, Some(OsStr::new("dumb"))));
        assert!(on(Colour::Always, false, one, None) && !on(Colour::Never, true, None, None));
    }

    #[test]
    fn a_mark_ends_where_its_text_ends() {
        let text = Colour::Always.paint(false, None, None).mark(Role::Contact, "contact");
        assert!(text.starts_with("\u{1b}[") && text.ends_with("contact\u{1b}[0m"), "{text:?}");
        assert_eq!(Paint::default().mark(Role::Contact, "contact"), "contact");
    }
}
