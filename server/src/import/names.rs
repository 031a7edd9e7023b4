//! The names that formats have: what is misspelled is told, for it says nothing to anybody.
//!
//! Each line of a `.names` file has an element, its attributes, and behind a bar the elements that may be in it (`*`: any); without a bar
//! all that have lines. Elements without lines are not looked into: sensors, plugins, what a viewer draws.
//! Sources: MuJoCo 4.0's own schema (`mj_printSchema`; elements of one name have the attributes of all);
//! wiki.ros.org/urdf/XML; sdformat.org/spec, 1.12; the GDML schema 3.1; OpenMC's description of its geometry.xml, 0.15.

use roxmltree::Node;
use std::collections::{HashMap, HashSet};

/// Names of a file that are told.
const MOST: usize = 100;

/// An element: its attributes, and what may be in it; `None` for all that are known.
#[derive(Default)]
struct Element<'t> {
    attributes: HashSet<&'t str>,
    inside: Option<HashSet<&'t str>>,
}

/// The elements of a format.
pub struct Names<'t>(HashMap<&'t str, Element<'t>>);

impl Names<'static> {
    pub fn of_mjcf() -> Self {
        Self::of(include_str!("robot/mjcf.names"))
    }

    pub fn of_urdf() -> Self {
        Self::of(include_str!("robot/urdf.names"))
    }

    pub fn of_sdf() -> Self {
        Self::of(include_str!("robot/sdf.names"))
    }
}

impl<'t> Names<'t> {
    /// The elements that the text of a `.names` file has.
    pub fn of(text: &'t str) -> Self {
        let mut all: HashMap<&str, Element> = HashMap::new();
        let mut element = "";
        for line in text.lines() {
            let words = match line.split_once(':') {
                Some((name, words)) => {
                    element = name;
                    words
                }
                None => line,
            };
            let own = all.entry(element).or_default();
            for word in words.split_whitespace() {
                match &mut own.inside {
                    _ if word == "|" => own.inside = Some(HashSet::new()),
                    Some(inside) => _ = inside.insert(word),
                    None => _ = own.attributes.insert(word),
                }
            }
        }
        Self(all)
    }

    /// What is in an element, or in what is in it, and has no name of the format: the first node of each name, with what is told of it.
    /// Names with a prefix are of other programs.
    pub fn unknown<'a, 'i>(&self, root: Node<'a, 'i>) -> Vec<(Node<'a, 'i>, String)> {
        let mut found: Vec<(Node<'a, 'i>, String)> = Vec::new();
        let mut told = HashSet::new();
        let mut tell = |node, text: String| {
            // A file of another format has nothing but such names.
            if told.len() < MOST && told.insert(text.clone()) {
                found.push((node, text));
                if told.len() == MOST {
                    found.push((node, "there are more names that the format does not have: they are left out".into()));
                }
            }
        };
        let is_foreign = |node: &Node<'a, 'i>| node.tag_name().namespace().is_some();
        let mut left = vec![root];
        while let Some(node) = left.pop() {
            let name = node.tag_name().name();
            let Some(own) = self.0.get(name) else { continue };
            for attribute in node.attributes().filter(|a| a.namespace().is_none()) {
                if !own.attributes.contains(attribute.name()) {
                    tell(node, format!("<{name}> has no attribute {:?}: it is left out", attribute.name()));
                }
            }
            let mut inside: Vec<_> = node.children().filter(|n| n.is_element() && !is_foreign(n)).collect();
            inside.retain(|child| {
                let child_name = child.tag_name().name();
                let is_known = match &own.inside {
                    Some(names) => names.contains(child_name) || names.contains("*"),
                    None => self.0.contains_key(child_name),
                };
                if !is_known {
                    tell(*child, format!("<{name}> has no element <{child_name}>: it is left out"));
                }
                is_known
            });
            left.extend(inside.into_iter().rev());
        }
        found.sort_by_key(|(node, _)| node.range().start);
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use roxmltree::Document;

    fn told(names: &Names, text: &str) -> Vec<String> {
        let document = Document::parse(text).unwrap();
        names.unknown(document.root_element()).into_iter().map(|(_, text)| text).collect()
    }

    #[test]
    fn what_is_misspelled_is_told_once_and_what_others_add_is_not() {
        let mjcf = "<mujoco><compilr angle='degree'/><worldbody><body poss='0 0 5'><geon size='20'/><geom size='1' zaxisx='1'/></body>\
                    <body poss='1 0 0'><frame euler='0 0 1'><replicate count='2'><geom size='1'/></replicate></frame></body></worldbody>\
                    <default><geom type='box'/></default></mujoco>";
        let expected = [
            "<mujoco> has no element <compilr>: it is left out",
            "<body> has no attribute \"poss\": it is left out",
            "<body> has no element <geon>: it is left out",
            "<geom> has no attribute \"zaxisx\": it is left out",
        ];
        assert_eq!(told(&Names::of_mjcf(), mjcf), expected);
        let urdf = "<robot name='r'><link name='a'><collisions/><collision><origin xyzz='0 0 1'/><geometry><box size='1 1 1'/></geometry>\
                    </collision><visual><anything at='all'/></visual></link><joint name='j' type='fixed'><parent link='a'/><child link='b'/>\
                    </joint><transmission any='thing'><that is='there'/></transmission></robot>";
        let expected = [
            "<link> has no element <collisions>: it is left out",
            "<origin> has no attribute \"xyzz\": it is left out",
        ];
        assert_eq!(told(&Names::of_urdf(), urdf), expected);
        let sdf = "<sdf version='1.9'><world name='w'><gui/><physics type='ode'><x/></physics><model name='m'><link name='l'>\
                   <pose degree='true'>0 0 0 0 0 0</pose><colision name='c'/><collision name='c'><geometry><box><sizes>1 1 1</sizes></box>\
                   </geometry></collision></link><plugin name='p' filename='f'><own/></plugin></model></world></sdf>";
        let expected = [
            "<pose> has no attribute \"degree\": it is left out",
            "<link> has no element <colision>: it is left out",
            "<box> has no element <sizes>: it is left out",
        ];
        assert_eq!(told(&Names::of_sdf(), sdf), expected);
        let gdml = "<gdml xmlns:xsi='s' xsi:noNamespaceSchemaLocation='g.xsd'><define><quantity name='q' value='1' unt='cm'/></define>\
                    <materials><any at='all'/></materials><solids><box name='b' x='1' y='1' z='1' lunt='cm'/><polycone name='p'>\
                    <zplane rmn='1' z='0' rmax='2'/></polycone></solids><structure><volume name='v'><physvol copynumbr='1'/></volume>\
                    </structure></gdml>";
        let expected = [
            "<quantity> has no attribute \"unt\": it is left out",
            "<box> has no attribute \"lunt\": it is left out",
            "<zplane> has no attribute \"rmn\": it is left out",
            "<physvol> has no attribute \"copynumbr\": it is left out",
        ];
        assert_eq!(told(&Names::of(include_str!("gdml/gdml.names")), gdml), expected);
        let openmc = "<geometry><surface id='1' type='sphere' coeffs='0 0 0 1' boundry='vacuum'/><cell id='1'><material>1</material>\
                      <regon>-1</regon></cell><cell id='2' translaton='1 0 0' fill='3'/></geometry>";
        let expected = [
            "<surface> has no attribute \"boundry\": it is left out",
            "<cell> has no element <regon>: it is left out",
            "<cell> has no attribute \"translaton\": it is left out",
        ];
        assert_eq!(told(&Names::of(include_str!("openmc/openmc.names")), openmc), expected);
        let with_prefix = "<robot xmlns:drake='d' name='r'><link name='a'><drake:more of='it'/></link></robot>";
        assert!(told(&Names::of_urdf(), with_prefix).is_empty());
    }
}
