//! The files of a model in MJCF: what is included stands where it is included, in any section.

use super::super::problem::Problem;
use super::super::{Limits, Place, read_bytes, xml};
use super::kinematics::Robot;
use super::urdf::{Result, needed};
use roxmltree::{Document, Node};
use std::path::{Path, PathBuf};

/// Files that include each other.
const DEEPEST: usize = 16;

/// A file that is included.
pub(super) struct Included {
    path: PathBuf,
    pub text: String,
    /// Where the first file includes it, or what includes it.
    at: Place,
}

/// The texts that are included, each once. Names are relative to the first file's folder.
pub(super) fn included(root: Node<'_, '_>, folder: &Path) -> Result<Vec<Included>> {
    let mut texts = Vec::new();
    add(root, folder, &mut texts, (0, None))?;
    Ok(texts)
}

fn add(
    node: Node<'_, '_>,
    folder: &Path,
    texts: &mut Vec<Included>,
    (depth, within): (usize, Option<Place>),
) -> Result<()> {
    for include in node.descendants().filter(|n| n.is_element() && n.tag_name().name() == "include") {
        let at = within.unwrap_or_else(|| xml::place(include));
        let path = file_of(folder, needed(include, "file").map_err(|(_, e)| (at, e))?);
        let wrong = |e: String| (at, Problem::syntax(format!("the included file {}", path.display()), e));
        if texts.iter().any(|known| known.path == path) {
            return Err(wrong("a file that is included twice".into()));
        }
        if depth > DEEPEST {
            return Err(wrong("files that include each other".into()));
        }
        let bytes = read_bytes(&path, &Limits::default()).map_err(|e| wrong(e.to_string()))?;
        let text = String::from_utf8(xml::mended(bytes)).map_err(|_| wrong("text that is not UTF-8".into()))?;
        texts.push(Included { path: path.clone(), text: text.clone(), at });
        let file = path.display().to_string();
        let document = xml::parse(text.as_bytes())
            .map_err(|(inner, e)| (at, Problem::Named { file, at: inner, problem: Box::new(e) }))?;
        add(document.root_element(), folder, texts, (depth + 1, Some(at)))?;
    }
    Ok(())
}

/// The file of a name in which, as MuJoCo has it, folders may be told apart by backslashes.
fn file_of(folder: &Path, name: &str) -> PathBuf {
    folder.join(name.replace('\\', "/"))
}

/// What a flag may be: MuJoCo takes these words as they are.
pub(super) const FLAG: [&str; 2] = ["true", "false"];

/// A flag that an attribute gives; `None` where it is not there.
pub(super) fn flag(node: Node<'_, '_>, name: &str) -> Result<Option<bool>> {
    node.attribute(name).map(|word| xml::either(node, word, name, FLAG)).transpose()
}

/// All files of a model.
pub(super) struct Files<'a, 'i> {
    main: Node<'a, 'i>,
    folder: &'a Path,
    /// The others, with their root elements.
    others: Vec<(&'a Included, Node<'a, 'i>)>,
}

impl<'a, 'i> Files<'a, 'i> {
    /// `documents` are those of `texts`, in order.
    pub fn new(main: Node<'a, 'i>, folder: &'a Path, texts: &'a [Included], documents: &'a [Document<'i>]) -> Self {
        Self { main, folder, others: texts.iter().zip(documents.iter().map(Document::root_element)).collect() }
    }

    /// The root elements of all files, the first one's first.
    pub fn roots(&self) -> impl Iterator<Item = Node<'a, 'i>> {
        std::iter::once(self.main).chain(self.others.iter().map(|(_, root)| *root))
    }

    /// The elements inside of a node, those of included files where these are included.
    pub fn children(&self, node: Node<'a, 'i>) -> Vec<Node<'a, 'i>> {
        let mut all = Vec::new();
        for child in node.children().filter(Node::is_element) {
            if child.tag_name().name() != "include" {
                all.push(child);
                continue;
            }
            let path = file_of(self.folder, child.attribute("file").unwrap_or_default());
            let root = self.others.iter().find(|(file, _)| file.path == path);
            all.extend(root.into_iter().flat_map(|(_, root)| self.children(*root)));
        }
        all
    }

    /// Those of a name.
    pub fn inside(&self, node: Node<'a, 'i>, name: &str) -> Vec<Node<'a, 'i>> {
        self.children(node).into_iter().filter(|n| n.tag_name().name() == name).collect()
    }

    /// The sections of a name.
    pub fn sections(&self, name: &str) -> Vec<Node<'a, 'i>> {
        self.inside(self.main, name)
    }

    /// What stands in all sections of a name.
    pub fn within(&self, section: &str) -> Vec<Node<'a, 'i>> {
        self.sections(section).into_iter().flat_map(|section| self.children(section)).collect()
    }

    /// The file that a node is of, where that is not the first one.
    fn other(&self, node: Node<'_, '_>) -> Option<&'a Included> {
        let is_of = |root: &Node<'_, '_>| std::ptr::eq(root.document().input_text(), node.document().input_text());
        self.others.iter().find(|(_, root)| is_of(root)).map(|(file, _)| *file)
    }

    /// Where a node stands in the first file; of an included one where that is included.
    pub fn place(&self, node: Node<'_, '_>) -> Place {
        self.other(node).map_or_else(|| xml::place(node), |file| file.at)
    }

    /// A sentence about a node or what is in it, told of the file that it stands in.
    pub fn told(&self, node: Node<'_, '_>, (at, problem): (Place, Problem)) -> (Place, Problem) {
        match self.other(node) {
            Some(file) if !matches!(problem, Problem::Named { .. }) => {
                let name = file.path.display().to_string();
                (file.at, Problem::Named { file: name, at, problem: Box::new(problem) })
            }
            _ => (at, problem),
        }
    }

    /// What was left out, as a note; of an included file with its name.
    pub fn note(&self, robot: &mut Robot, node: Node<'_, '_>, text: &str) {
        let text = match self.other(node) {
            None => text.to_owned(),
            Some(file) => format!("{}:{}: {text}", file.path.display(), xml::place(node)),
        };
        robot.note(self.place(node), text);
    }
}
