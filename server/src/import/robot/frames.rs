//! Frames of a model or a world of SDFormat, by name: where each stands, and which link it goes with.
//!
//! Source: sdformat.org/tutorials?tut=pose_frame_semantics. A pose is relative to a frame of its own scope, by name; what it is
//! attached to says with which link a frame moves, and is another thing. Frames of models within are `MODEL::NAME`.

use contactd_proto::Pose;
use std::collections::HashMap;

/// What a frame goes with.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Attached {
    /// A link, by its number.
    Link(usize),
    /// What another frame goes with.
    Frame(String),
    /// The world.
    World,
    /// Nothing: a model without links.
    Nothing,
}

#[derive(Clone, Debug)]
struct Frame {
    pose: Pose,
    /// The frame that the pose is relative to.
    of: String,
    attached: Attached,
}

/// The frames of one scope.
#[derive(Clone, Debug)]
pub(super) struct Frames {
    all: HashMap<String, Frame>,
    /// What the scope's own frame is called: `__model__` or `world`.
    root: &'static str,
    root_goes_with: Attached,
}

/// Why a frame cannot be found: its name, and what is wrong with it.
pub(super) type Lost = (String, &'static str);

impl Frames {
    pub fn new(root: &'static str, root_goes_with: Attached) -> Self {
        Self { all: HashMap::new(), root, root_goes_with }
    }

    /// The name of the scope's own frame.
    pub fn root(&self) -> &'static str {
        self.root
    }

    /// Whether a name is taken.
    pub fn has(&self, name: &str) -> bool {
        name == self.root || self.all.contains_key(name)
    }

    /// The frame that the scope's own goes with.
    pub fn root_frame(&self) -> Option<&str> {
        match &self.root_goes_with {
            Attached::Frame(name) => Some(name),
            Attached::Link(_) | Attached::World | Attached::Nothing => None,
        }
    }

    /// Says what the scope's own frame goes with.
    pub fn set_root(&mut self, with: Attached) {
        self.root_goes_with = with;
    }

    /// Adds a frame; false where the name is taken, and then the first one stays.
    #[must_use]
    pub fn add(&mut self, name: &str, pose: Pose, of: &str, attached: Attached) -> bool {
        let is_new = !self.has(name);
        if is_new {
            self.all.insert(name.to_owned(), Frame { pose, of: of.to_owned(), attached });
        }
        is_new
    }

    /// Adds the frames of a model within, whose own frame is there: as `name::FRAME`, or by their own names where it is merged.
    #[must_use]
    pub fn adopt(&mut self, inner: Self, name: &str, is_merged: bool) -> bool {
        let own = |frame: &str| match (frame == inner.root, is_merged) {
            (true, _) => name.to_owned(),
            (false, true) => frame.to_owned(),
            (false, false) => format!("{name}::{frame}"),
        };
        let mut are_new = true;
        for (frame, f) in &inner.all {
            let attached = match &f.attached {
                Attached::Frame(of) => Attached::Frame(own(of)),
                other => other.clone(),
            };
            are_new &= self.add(&own(frame), f.pose, &own(&f.of), attached);
        }
        are_new
            && (is_merged
                || self.add(&format!("{name}::__model__"), Pose::IDENTITY, name, Attached::Frame(name.into())))
    }

    /// A frame and those that it is relative to, up to the scope's own, which is left out.
    fn chain<'a>(&'a self, name: &'a str) -> Result<Vec<(&'a str, &'a Frame)>, Lost> {
        let (mut at, mut chain) = (name, Vec::new());
        while at != self.root {
            let frame = self.all.get(at).ok_or_else(|| (at.to_owned(), "which is no frame of the scope"))?;
            if chain.len() > self.all.len() {
                return Err((name.to_owned(), "frames that are relative to each other in a circle"));
            }
            chain.push((at, frame));
            at = &frame.of;
        }
        Ok(chain)
    }

    /// The pose of a frame in another one; what both are relative to does not count.
    pub fn pose(&self, name: &str, within: &str) -> Result<Pose, Lost> {
        let (mut up, mut down) = (self.chain(within)?, self.chain(name)?);
        while up.last().map(|f| f.0).is_some_and(|last| down.last().map(|f| f.0) == Some(last)) {
            (_, _) = (up.pop(), down.pop());
        }
        let along = |chain: &[(&str, &Frame)]| {
            let poses = chain.iter().rev().map(|(_, f)| f.pose);
            poses.reduce(|a, b| a.compose(&b)).unwrap_or(Pose::IDENTITY)
        };
        Ok(match up.is_empty() {
            true => along(&down),
            false => along(&up).inverse().compose(&along(&down)),
        })
    }

    /// The link that a frame goes with, and the link's own frame; `None`: the world.
    pub fn link<'a>(&'a self, name: &'a str) -> Result<Option<(usize, &'a str)>, Lost> {
        let mut at = name;
        for _ in 0..=self.all.len() {
            let attached = match at == self.root {
                true => &self.root_goes_with,
                false => &self.all.get(at).ok_or_else(|| (at.to_owned(), "which is no frame of the scope"))?.attached,
            };
            match attached {
                Attached::Link(link) => return Ok(Some((*link, at))),
                Attached::World => return Ok(None),
                Attached::Nothing => return Err((name.to_owned(), "a frame of a model without links")),
                Attached::Frame(of) => at = of,
            }
        }
        Err((name.to_owned(), "frames that are attached to each other in a circle"))
    }
}
