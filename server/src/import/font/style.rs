//! What a text asks for: fontconfig's pattern `Family:style=Bold`.

/// A font that is asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern {
    /// As the text has it.
    pub written: String,
    /// Its family; OpenSCAD's own where the text names none.
    pub family: String,
    /// Its style, in lower case; may be empty.
    pub style: String,
}

/// OpenSCAD's own font.
const OWN: &str = "Liberation Sans";

/// Families that fontconfig takes for one another: metrics agree.
const ALIKE: [(&str, &[&str]); 3] = [
    ("liberation sans", &["arial", "helvetica", "arimo", "sans", "sans-serif", "helvetica neue", "nimbus sans"]),
    ("liberation serif", &["times", "times new roman", "tinos", "serif", "nimbus roman"]),
    ("liberation mono", &["courier", "courier new", "cousine", "mono", "monospace", "nimbus mono"]),
];

/// What stands in for what: sans, serif, mono.
const SUBSTITUTES: [&[&str]; 3] = [
    &["liberation sans", "arimo", "arial", "helvetica", "dejavu sans", "noto sans", "open sans"],
    &["liberation serif", "tinos", "times new roman", "dejavu serif", "noto serif"],
    &["liberation mono", "cousine", "courier new", "dejavu sans mono", "noto sans mono"],
];

impl Pattern {
    /// The name under which the font that it asks for is attached to a text.
    pub fn attachment(&self) -> String {
        format!("font:{}", self.written)
    }

    /// Reads what a text says; anything behind the family but the style is let be.
    pub fn new(written: &str) -> Self {
        let mut parts = written.split(':');
        let family = parts.next().unwrap_or_default().trim();
        // A size may follow: "Arial-12".
        let family = match family.rsplit_once('-') {
            Some((name, size)) if size.parse::<f64>().is_ok() => name,
            _ => family,
        };
        let style = parts.find_map(|p| p.trim().strip_prefix("style=")).unwrap_or_default().trim().to_lowercase();
        let family = if family.is_empty() { OWN } else { family };
        Self { written: written.to_owned(), family: family.to_owned(), style }
    }

    /// True where it asks for a style of no family: which font that is in OpenSCAD, its system's settings say.
    pub fn is_style_alone(&self) -> bool {
        self.written.trim_start().starts_with(':')
    }

    /// True where its characters are equally wide.
    pub fn is_mono(&self) -> bool {
        self.kind() == 2
    }

    fn kind(&self) -> usize {
        let family = self.family.to_lowercase();
        if ["mono", "courier", "consol", "typewriter", "code", "fixed", "hack"].iter().any(|w| family.contains(w)) {
            2
        } else if ["times", "serif", "roman", "georgia", "garamond"].iter().any(|w| family.contains(w))
            && !family.contains("sans")
        {
            1
        } else {
            0
        }
    }

    /// How well a font of that family and style does, the least is best: itself, one alike, what stands in; `None` for another.
    pub fn rank(&self, family: &str, style: &str) -> Option<(usize, usize)> {
        let (wanted, family) = (self.family.to_lowercase(), family.to_lowercase());
        let group = |name: &str| ALIKE.iter().position(|(own, others)| *own == name || others.contains(&name));
        let of_family = if family == wanted {
            0
        } else if group(&wanted).is_some() && group(&family) == group(&wanted) {
            1
        } else {
            2 + SUBSTITUTES[self.kind()].iter().position(|s| *s == family)?
        };
        Some((of_family, self.off_style(&style.to_lowercase())))
    }

    /// True for a font of the family that is asked for, or one with its metrics.
    pub fn is_met(&self, family: &str) -> bool {
        self.rank(family, "").is_some_and(|(r, _)| r <= 1)
    }

    fn off_style(&self, style: &str) -> usize {
        let has = |s: &str, words: &[&str]| words.iter().any(|w| s.contains(w));
        let traits = |s: &str| {
            [
                has(s, &["bold", "black", "heavy"]),
                has(s, &["italic", "oblique"]),
                has(s, &["condensed", "narrow"]),
                has(s, &["light", "thin"]),
            ]
        };
        let (a, b) = (traits(&self.style), traits(style));
        let wrong: usize = (0..4).filter(|i| a[*i] != b[*i]).map(|i| [8, 4, 2, 2][i]).sum();
        let plain = ["", "regular", "book", "roman", "normal"];
        let same = self.style == style || plain.contains(&self.style.as_str()) && plain.contains(&style);
        wrong + usize::from(!same)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_means_its_own_family_then_one_alike_then_what_stands_in() {
        let p = Pattern::new("Arial:style=Bold");
        assert_eq!((p.family.as_str(), p.style.as_str()), ("Arial", "bold"));
        let fonts = [
            ("Arial", "Bold"),
            ("Arial", "Bold Italic"),
            ("Arial", "Regular"),
            ("Liberation Sans", "Bold"),
            ("DejaVu Sans", "Bold"),
            ("DejaVu Sans", "Book"),
        ];
        let ranks: Vec<_> = fonts.iter().map(|(f, s)| p.rank(f, s).expect("a rank")).collect();
        assert!(ranks.is_sorted(), "{ranks:?}");
        assert!(p.rank("Comic Sans", "Bold").is_none() && p.is_met("Liberation Sans") && !p.is_met("DejaVu Sans"));
        assert_eq!(Pattern::new("").family, "Liberation Sans");
        assert_eq!(Pattern::new("Arial-12:fontfeatures=+liga").family, "Arial");
        assert!(Pattern::new("DejaVu Sans Mono").is_mono() && !Pattern::new("DejaVu Serif").is_mono());
        assert!(Pattern::new("Times").rank("DejaVu Serif", "Book").is_some());
    }
}
