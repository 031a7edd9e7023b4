//! The tree behind solids and outlines: calls of OpenSCAD's language with what stands inside of them, and how it is printed.

use glam::DAffine3;
use std::fmt::Write;
use std::sync::Arc;

/// Levels of nesting that are printed: as many as the server reads by its default.
const DEEPEST: u32 = 1_000;

/// What made no sense in a solid that was built. `Debug` prints the sentence, too: it is what a `main` that returns one ends with.
#[derive(Clone, PartialEq, Eq)]
pub struct BuildError {
    what: &'static str,
    expected: String,
    found: String,
}

impl BuildError {
    pub(super) fn new(what: &'static str, expected: String, found: String) -> Self {
        Self { what, expected, found }
    }
}

impl std::fmt::Display for BuildError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { what, expected, found } = self;
        write!(f, "{what}: expected {expected}, found {found}")
    }
}

impl std::fmt::Debug for BuildError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        std::fmt::Display::fmt(self, f)
    }
}

impl std::error::Error for BuildError {}

/// A call and what is inside of it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tree {
    node: Arc<Node>,
    /// Levels, this one included.
    depth: u32,
}

#[derive(Debug, PartialEq)]
enum Node {
    Call {
        /// Name and arguments, without the closing parenthesis.
        call: String,
        /// Curves may be cut into pieces in it.
        curved: bool,
        /// `$fn`.
        pieces: Option<u32>,
        children: Vec<Tree>,
    },
    Wrong(BuildError),
}

impl From<BuildError> for Tree {
    fn from(wrong: BuildError) -> Self {
        Self { node: Arc::new(Node::Wrong(wrong)), depth: 1 }
    }
}

impl Tree {
    /// A call with nothing inside.
    pub fn leaf(call: String, curved: bool) -> Self {
        Self::around(call, curved, Vec::new())
    }

    /// A call around others.
    pub fn around(call: String, curved: bool, children: Vec<Tree>) -> Self {
        Self::call(call, curved, None, children)
    }

    fn call(call: String, curved: bool, pieces: Option<u32>, children: Vec<Tree>) -> Self {
        let depth = 1 + children.iter().map(|c| c.depth).max().unwrap_or(0);
        if depth > DEEPEST {
            // What is inside goes: a deeper tree would not be dropped without a deep stack either.
            let found = "one more".into();
            return BuildError::new("solid", format!("at most {DEEPEST} levels of nesting"), found).into();
        }
        Self { node: Arc::new(Node::Call { call, curved, pieces, children }), depth }
    }

    /// A union, difference, intersection, hull or sum; where the first operand is one, too, it takes the others in, as far as
    /// that says the same.
    pub fn join(name: &'static str, of: impl IntoIterator<Item = Tree>) -> Self {
        let mut children: Vec<Tree> = of.into_iter().collect();
        if children.is_empty() {
            return BuildError::new(name, "one operand or more".into(), "none".into()).into();
        }
        let head = format!("{name}(");
        if let Node::Call { call, children: first, .. } = &*children[0].node
            && *call == head
            && name != "minkowski"
        {
            let first = first.clone();
            children.splice(..1, first);
        }
        if children.len() == 1 && name != "hull" {
            return children.remove(0);
        }
        Self::around(head, false, children)
    }

    /// The same under an affine map.
    pub fn transformed(&self, map: &DAffine3) -> Self {
        let (m, t) = (map.matrix3, map.translation);
        let row = |k: usize| list(&[m.x_axis[k], m.y_axis[k], m.z_axis[k], t[k]]);
        let call = format!("multmatrix([{}, {}, {}, [0, 0, 0, 1]]", row(0), row(1), row(2));
        Self::around(call, false, vec![self.clone()])
    }

    /// The same with `$fn` wherever there are curves.
    pub fn with_pieces(&self, n: u32) -> Self {
        if n < 9 {
            let expected = "9 pieces of a curve or more (fewer are a polygon's sides)".into();
            return BuildError::new("pieces", expected, n.to_string()).into();
        }
        match &*self.node {
            Node::Wrong(_) => self.clone(),
            Node::Call { call, curved, pieces, children } => {
                let pieces = if *curved { Some(n) } else { *pieces };
                let children = children.iter().map(|c| c.with_pieces(n)).collect();
                Self::call(call.clone(), *curved, pieces, children)
            }
        }
    }

    pub fn check(&self) -> Result<(), BuildError> {
        match &*self.node {
            Node::Wrong(wrong) => Err(wrong.clone()),
            Node::Call { children, .. } => children.iter().try_for_each(Tree::check),
        }
    }

    pub fn text(&self) -> Result<String, BuildError> {
        let mut out = String::new();
        self.print(0, &mut out)?;
        Ok(out)
    }

    fn print(&self, level: usize, out: &mut String) -> Result<(), BuildError> {
        let (call, pieces, children) = match &*self.node {
            Node::Wrong(wrong) => return Err(wrong.clone()),
            Node::Call { call, pieces, children, .. } => (call, pieces, children),
        };
        let indent = |out: &mut String| out.extend(std::iter::repeat_n('\t', level));
        indent(out);
        out.push_str(call);
        if let Some(n) = pieces {
            let _ = write!(out, ", $fn = {n}");
        }
        if children.is_empty() {
            out.push_str(");\n");
            return Ok(());
        }
        out.push_str(") {\n");
        children.iter().try_for_each(|c| c.print(level + 1, out))?;
        indent(out);
        out.push_str("}\n");
        Ok(())
    }
}

/// A number as OpenSCAD reads it, with as many digits as tell it apart from all others.
pub(super) fn number(x: f64) -> String {
    if x == 0.0 || (1e-5..1e15).contains(&x.abs()) || !x.is_finite() { format!("{x}") } else { format!("{x:e}") }
}

/// A list of numbers.
pub(super) fn list(of: &[f64]) -> String {
    format!("[{}]", of.iter().map(|x| number(*x)).collect::<Vec<_>>().join(", "))
}

/// A length that may be one.
pub(super) fn positive(name: &'static str, what: &str, length: f64) -> Result<(), BuildError> {
    if length > 0.0 && length.is_finite() {
        return Ok(());
    }
    Err(BuildError::new(name, format!("a positive finite {what}"), number(length)))
}
