//! `weave TREE FAULTS`: puts many deliberate faults into one build. The folder FAULTS holds one folder for each fault, named by
//! its number; in it lie the files that the fault changes, as they are with it, by their paths in TREE. The files of TREE are
//! rewritten: a function that some faults change becomes a choice among its body and theirs, by the environment variable
//! `CONTACTD_FAULT`. A constant that a fault changes is declared anew at the head of each body that names it.
//!
//! Writes a line for each fault: its number and `woven`, or why it must be built alone.

use proc_macro2::{TokenStream, TokenTree};
use std::collections::{BTreeMap, BTreeSet};
use std::error::Error;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use syn::spanned::Spanned;
use syn::visit::Visit;

/// What is said of a fault that cannot be woven.
type Reason = String;

/// A function that stands in no other one, nor in a macro.
struct Function {
    /// Where its block stands in the text, braces and all.
    body: Range<usize>,
    /// Whether its body may choose at run time, and all bodies have one type.
    chooses: bool,
}

/// A constant of a module.
struct Constant {
    name: String,
    /// Where its value stands in the text.
    value: Range<usize>,
    /// Where its declaration stands, from `const` to the semicolon.
    declaration: Range<usize>,
    private: bool,
}

/// A file: its text, its functions and constants in the order of the text.
struct Source {
    text: String,
    functions: Vec<Function>,
    constants: Vec<Constant>,
}

impl Source {
    fn read(path: &Path) -> Result<Self, Reason> {
        let of_file = |e: String| format!("{}: {e}", path.display());
        let text = fs::read_to_string(path).map_err(|e| of_file(e.to_string()))?;
        Self::parse(text).map_err(of_file)
    }

    fn parse(text: String) -> Result<Self, Reason> {
        let file = syn::parse_file(&text).map_err(|e| e.to_string())?;
        let mut source = Self { text, functions: Vec::new(), constants: Vec::new() };
        source.visit_file(&file);
        Ok(source)
    }

    fn function(&mut self, signature: &syn::Signature, block: &syn::Block) {
        let opaque = match &signature.output {
            syn::ReturnType::Default => false,
            syn::ReturnType::Type(_, ty) => self.text[ty.span().byte_range()].contains("impl "),
        };
        let chooses = signature.constness.is_none() && !opaque;
        self.functions.push(Function { body: block.span().byte_range(), chooses });
    }

    /// What stands outside of all bodies and of all constants' values, token by token.
    fn frame(&self) -> Result<String, Reason> {
        let mut holes: Vec<_> = self.functions.iter().map(|f| (&f.body, "{}")).collect();
        holes.extend(self.constants.iter().map(|c| (&c.value, "0")));
        holes.sort_by_key(|(hole, _)| hole.start);
        let (mut frame, mut at) = (String::new(), 0);
        for (hole, instead) in holes {
            frame.push_str(&self.text[at..hole.start]);
            frame.push_str(instead);
            at = hole.end;
        }
        frame.push_str(&self.text[at..]);
        Ok(stream(&frame)?.to_string())
    }

    /// The text in which functions choose among their own bodies and those of faults, each with its fault's number.
    fn with(&self, bodies: &BTreeMap<usize, Vec<(usize, String)>>) -> String {
        let mut text = self.text.clone();
        // From behind: what stands before keeps its place.
        for (i, faulty) in bodies.iter().rev() {
            let body = self.functions[*i].body.clone();
            text.replace_range(body.clone(), &choice(&self.text[body], faulty));
        }
        text
    }
}

impl<'a> Visit<'a> for Source {
    fn visit_item_fn(&mut self, item: &'a syn::ItemFn) {
        self.function(&item.sig, &item.block);
    }

    fn visit_impl_item_fn(&mut self, item: &'a syn::ImplItemFn) {
        self.function(&item.sig, &item.block);
    }

    fn visit_trait_item_fn(&mut self, item: &'a syn::TraitItemFn) {
        if let Some(block) = &item.default {
            self.function(&item.sig, block);
        }
    }

    fn visit_item_const(&mut self, item: &'a syn::ItemConst) {
        self.constants.push(Constant {
            name: item.ident.to_string(),
            value: item.expr.span().byte_range(),
            declaration: item.const_token.span.byte_range().start..item.semi_token.span().byte_range().end,
            private: matches!(item.vis, syn::Visibility::Inherited),
        });
    }

    fn visit_item_macro(&mut self, _: &'a syn::ItemMacro) {}
}

fn stream(text: &str) -> Result<TokenStream, Reason> {
    text.parse().map_err(|e| format!("it is not Rust: {e}"))
}

/// Whether a name stands in a text.
fn names(stream: &TokenStream, name: &str) -> bool {
    stream.clone().into_iter().any(|tree| match tree {
        TokenTree::Group(group) => names(&group.stream(), name),
        TokenTree::Ident(ident) => ident == name,
        _ => false,
    })
}

/// Whether a name stands in a text with a path before it, so that a declaration nearby does not change what it means.
fn names_by_path(stream: &TokenStream, name: &str) -> bool {
    let trees: Vec<_> = stream.clone().into_iter().collect();
    trees.iter().enumerate().any(|(i, tree)| match tree {
        TokenTree::Group(group) => names_by_path(&group.stream(), name),
        TokenTree::Ident(ident) => {
            ident == name && i > 0 && matches!(&trees[i - 1], TokenTree::Punct(p) if p.as_char() == ':')
        }
        _ => false,
    })
}

/// The bodies of the functions that a fault changes, by their places in the file.
fn changes(own: &Source, faulty: &Source, path: &Path, tree: &Path) -> Result<BTreeMap<usize, String>, Reason> {
    if own.functions.len() != faulty.functions.len()
        || own.constants.len() != faulty.constants.len()
        || own.frame()? != faulty.frame()?
    {
        return Err(format!("{} differs outside of its functions", path.display()));
    }
    let mut declared = Vec::new();
    for (constant, changed) in own.constants.iter().zip(&faulty.constants) {
        if own.text[constant.value.clone()] != faulty.text[changed.value.clone()] {
            lonely(constant, own, path, tree)?;
            declared.push((&constant.name, &faulty.text[changed.declaration.clone()]));
        }
    }
    let mut bodies = BTreeMap::new();
    for (i, (function, changed)) in own.functions.iter().zip(&faulty.functions).enumerate() {
        let body = &faulty.text[changed.body.clone()];
        let tokens = stream(body)?;
        let mut woven = body.to_owned();
        for (name, declaration) in &declared {
            if names_by_path(&tokens, name) {
                return Err(format!("{} names {name} by its path", path.display()));
            }
            if names(&tokens, name) {
                woven = format!("{{ {declaration} {woven} }}");
            }
        }
        if own.text[function.body.clone()] != woven {
            if !function.chooses {
                return Err(format!("a function of {} is const, or returns a type without a name", path.display()));
            }
            bodies.insert(i, woven);
        }
    }
    Ok(bodies)
}

/// An error where a constant is named outside of its file's functions.
fn lonely(constant: &Constant, own: &Source, path: &Path, tree: &Path) -> Result<(), Reason> {
    let frame = own.frame()?;
    let elsewhere =
        own.constants.iter().any(|c| c.name != constant.name && own.text[c.value.clone()].contains(&constant.name));
    if elsewhere || frame.matches(&constant.name).count() != 1 {
        return Err(format!("{} of {} is named outside of functions", constant.name, path.display()));
    }
    // What is private is seen by the modules below alone, what is not by all of them.
    let below = if constant.private { tree.join(path.parent().unwrap_or(Path::new(""))) } else { tree.to_owned() };
    for file in files(&below) {
        if file != tree.join(path) && fs::read_to_string(&file).is_ok_and(|text| text.contains(&constant.name)) {
            return Err(format!("{} is named in {}", constant.name, file.display()));
        }
    }
    Ok(())
}

/// The Rust files below a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() && !path.ends_with("target") {
            found.extend(files(&path));
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// A body that chooses.
fn choice(own: &str, faulty: &[(usize, String)]) -> String {
    let mut text = String::from(
        "{ match { static FAULT: ::std::sync::OnceLock<u32> = ::std::sync::OnceLock::new(); *FAULT.get_or_init(|| \
         ::std::env::var(\"CONTACTD_FAULT\").ok().and_then(|n| n.parse().ok()).unwrap_or(0)) } { ",
    );
    for (number, body) in faulty {
        text.push_str(&format!("{number} => {body} "));
    }
    text.push_str(&format!("_ => {own} }} }}"));
    text
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [tree, faults] = &arguments[..] else { return Err("usage: weave TREE FAULTS".into()) };
    let mut numbers = BTreeSet::new();
    for entry in fs::read_dir(faults)? {
        numbers.insert(entry?.file_name().to_string_lossy().parse::<usize>()?);
    }
    let mut woven: BTreeMap<PathBuf, BTreeMap<usize, Vec<(usize, String)>>> = BTreeMap::new();
    for number in numbers {
        let folder = faults.join(number.to_string());
        let of_fault = || -> Result<_, Reason> {
            let mut all = Vec::new();
            for file in files(&folder) {
                let path = file.strip_prefix(&folder).expect("below its folder").to_owned();
                let own = Source::read(&tree.join(&path))?;
                let faulty = Source::read(&file)?;
                let bodies = changes(&own, &faulty, &path, tree)?;
                all.push((path, bodies));
            }
            if all.iter().all(|(_, bodies)| bodies.is_empty()) {
                return Err("it changes no function".into());
            }
            Ok(all)
        };
        match of_fault() {
            Ok(all) => {
                println!("{number} woven");
                for (path, bodies) in all {
                    for (i, body) in bodies {
                        woven.entry(path.clone()).or_default().entry(i).or_default().push((number, body));
                    }
                }
            }
            Err(reason) => println!("{number} alone: {reason}"),
        }
    }
    for (path, bodies) in woven {
        let text = Source::read(&tree.join(&path))?.with(&bodies);
        fs::write(tree.join(&path), text)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn woven(own: &str, faulty: &str) -> Result<String, Reason> {
        let [own, faulty] = [own, faulty].map(|text| Source::parse(text.to_owned()).expect("Rust"));
        let bodies = changes(&own, &faulty, Path::new("a.rs"), Path::new("no such folder"))?;
        Ok(own.with(&bodies.into_iter().map(|(i, body)| (i, vec![(7, body)])).collect()))
    }

    #[test]
    fn a_body_that_differs_is_chosen_by_the_faults_number() {
        let text = woven("fn f() -> u8 { 1 }\nfn g() {}", "fn f() -> u8 { 2 }\nfn g() {}").expect("woven");
        assert!(text.contains("7 => { 2 } _ => { 1 }") && text.ends_with("}\nfn g() {}"), "{text}");
    }

    #[test]
    fn a_constant_is_declared_anew_where_it_is_named() {
        let own = "const A: u8 = 1;\nfn f() -> u8 { A }\nfn g() {}";
        let text = woven(own, &own.replace('1', "2")).expect("woven");
        assert!(text.contains("7 => { const A: u8 = 2; { A } } _ => { A }"), "{text}");
        assert!(text.starts_with("const A: u8 = 1;") && text.ends_with("fn g() {}"), "{text}");
    }

    #[test]
    fn what_a_choice_cannot_be_among_is_built_alone() {
        for own in [
            "const fn f() -> u8 { 1 }",
            "fn f() -> impl Copy { 1 }",
            "static A: u8 = 1;\nfn f() -> u8 { A }",
            "const A: u8 = 1;\nfn f() -> u8 { self::A }",
            "const A: u8 = 1;\nstatic B: u8 = A;\nfn f() -> u8 { A }",
            "const A: u8 = 1;\nconst B: u8 = A;\nfn f() -> u8 { A }",
            "macro_rules! f { () => { fn f() -> u8 { 1 } } }",
            "#[repr(align(1))]\nstruct A;\nfn f() {}",
        ] {
            let reason = woven(own, &own.replacen('1', "2", 1));
            assert!(reason.is_err(), "{own}: {reason:?}");
        }
    }
}
