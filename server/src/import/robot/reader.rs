//! What is asked of a robot's file, and where the files are that it names.

use super::super::{Place, xml};
use super::kinematics::{Robot, Values};
use roxmltree::Node;
use std::cell::RefCell;
use std::path::{Path, PathBuf};

/// What is asked of a robot's file.
#[derive(Clone, Debug, Default)]
pub struct Ask {
    /// Joint values at the start of the step; of others what the file says, else 0, or the nearest that their limits have.
    pub from: Values,
    /// Joint values at its end; of others those of the start.
    pub to: Values,
    /// Meshes are taken as their convex hulls, as MuJoCo does anyway.
    pub hulls: bool,
    /// Folders in which packages are looked for (`package://NAME/…`, `model://NAME/…`), before the file's own and those above it.
    pub packages: Vec<PathBuf>,
    /// The keyframe that joints begin at, of MJCF.
    pub key: Option<String>,
    /// An SRDF file with pairs that are not to be tested.
    pub srdf: Option<PathBuf>,
}

/// What a reader knows beside the text.
pub(super) struct Reader<'a> {
    /// The file.
    pub path: &'a Path,
    /// Its folder, as the first file's texts name it: relative to that one's folder, or from the machine's root.
    pub base: PathBuf,
    /// What includes it: the place in the first file.
    pub within: Option<Place>,
    pub ask: &'a Ask,
    /// The folder of the first file.
    pub main: &'a Path,
    /// The packages that were found elsewhere than in the first file's folder.
    pub packages: &'a RefCell<Vec<PathBuf>>,
}

impl Reader<'_> {
    /// The folder that the file is in.
    pub fn folder(&self) -> &Path {
        folder_of(self.path)
    }

    /// The file that a mesh's name means: of `package://NAME/PATH`, `model://NAME/PATH` the folder NAME among the packages, or beside
    /// or above the text; of `file://PATH` the path; else relative to the text, and of what is not there as of `model://`.
    pub fn file(&self, uri: &str) -> String {
        let named = uri.strip_prefix("package://").or_else(|| uri.strip_prefix("model://"));
        if let Some(path) = named {
            let found = self.package(path).map(|(package, file)| {
                let own = self.main.canonicalize().unwrap_or_else(|_| self.main.to_owned());
                let mut packages = self.packages.borrow_mut();
                if !package.starts_with(&own) && !packages.contains(&package) {
                    packages.push(package);
                }
                file
            });
            return found.unwrap_or_else(|| path.trim_start_matches('/').into()).display().to_string();
        }
        match uri.strip_prefix("file://") {
            Some(path) => path.to_owned(),
            // What is not there may be a model's name alone.
            None if !self.folder().join(uri).exists() && self.package(uri).is_some() => {
                self.file(&format!("model://{uri}"))
            }
            None => self.base.join(uri).display().to_string(),
        }
    }

    /// A package's folder and a file in it, by `NAME/PATH`; links in the package count as what they lead to.
    fn package(&self, path: &str) -> Option<(PathBuf, PathBuf)> {
        let (name, rest) = path.split_once('/').unwrap_or((path, ""));
        if name.is_empty() || name == "." || rest.starts_with('/') || path.split('/').any(|part| part == "..") {
            return None;
        }
        let own = std::path::absolute(self.folder()).unwrap_or_else(|_| self.folder().to_owned());
        // What lies in the machine's root is no package.
        let above = own.ancestors().filter(|folder| folder.parent().is_some()).map(Path::to_owned);
        self.ask.packages.iter().cloned().chain(above).find_map(|folder| {
            let is_package = folder.file_name().is_some_and(|own| own == name);
            let package = if is_package { folder } else { folder.join(name) };
            let file = package.join(rest).canonicalize().ok()?;
            Some((package.canonicalize().ok()?, file))
        })
    }

    /// The folder of the first file, which texts are relative to.
    pub fn main_folder(&self) -> &Path {
        self.main
    }

    /// Where a node stands; of an included file where that is included.
    pub fn place(&self, node: Node<'_, '_>) -> Place {
        self.within.unwrap_or_else(|| xml::place(node))
    }

    /// What was left out, as a note; of an included file with its name.
    pub fn note(&self, robot: &mut Robot, node: Node<'_, '_>, text: String) {
        let text = match self.within {
            None => text,
            Some(_) => format!("{}:{}: {text}", self.path.display(), xml::place(node)),
        };
        robot.note(self.place(node), text);
    }
}

/// The folder that a file is in.
pub(super) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}
