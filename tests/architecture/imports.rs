//! Which file uses names of which other file.

use super::source::{SourceFile, attributes_of, is_test};
use proc_macro2::{TokenStream, TokenTree};
use std::collections::{BTreeMap, BTreeSet};
use syn::spanned::Spanned;
use syn::visit::{self, Visit};

/// A file's use of a name of another file.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Import {
    /// Index of the file that uses it.
    pub from: usize,
    /// Index of the file that defines it.
    pub to: usize,
    /// The name; empty where a whole module is imported.
    pub name: String,
    /// Line of the use, from 1.
    pub line: usize,
}

/// A path as it stands in a file.
struct Mention {
    module: Vec<String>,
    path: Vec<String>,
    line: usize,
    /// Whether it stands in a `use` item.
    is_use: bool,
}

/// The names and modules of the whole library.
struct Names {
    /// File of each module; a module written inside a file has that file.
    files: BTreeMap<Vec<String>, usize>,
    /// What `use` items bring into a module: the name there, and the path it stands for.
    aliases: BTreeMap<(Vec<String>, String), Vec<String>>,
}

/// All imports between different files: names that a `use` item brings in, and paths that begin with `crate`, `super`
/// or `self`. A name that a `mod.rs` re-exports belongs to the file that defines it, and handing it on is no import of
/// the `mod.rs`, unless that uses the name itself. Nor is a call into a file of its own folder by that file's name
/// (`v5::read`): to choose among the files that it declares is what a `mod.rs` is for.
pub fn imports(files: &[SourceFile]) -> Vec<Import> {
    let mut names = Names { files: BTreeMap::new(), aliases: BTreeMap::new() };
    let mut mentions = Vec::new();
    for (index, file) in files.iter().enumerate() {
        let mut reader = Reader::of(file);
        reader.visit_file(&file.syntax);
        for module in reader.modules {
            names.files.insert(module, index);
        }
        names.aliases.extend(reader.aliases);
        mentions.extend(reader.mentions.into_iter().map(|m| (index, m)));
    }
    let mut found = BTreeSet::new();
    for (from, mention) in mentions {
        let is_import = mention.is_use || names.is_import(&mention);
        if let Some((to, name)) = names.resolve(&mention.module, &mention.path, 0)
            && is_import
            && to != from
        {
            found.insert(Import { from, to, name, line: mention.line });
        }
    }
    found.into_iter().collect()
}

impl Names {
    /// Whether a path outside `use` items says itself where its name comes from, or repeats a name of a `use` item.
    fn is_import(&self, mention: &Mention) -> bool {
        let first = &mention.path[0];
        ["crate", "super", "self"].contains(&first.as_str())
            || self.aliases.contains_key(&(mention.module.clone(), first.clone()))
    }

    /// The file that defines what `path` names in `module`, and its name there; none for what lies outside the library.
    fn resolve(&self, module: &[String], path: &[String], depth: usize) -> Option<(usize, String)> {
        // Deeper than any chain of re-exports: a name that stands for itself ends here.
        if depth > 16 {
            return None;
        }
        let (mut base, mut rest) = match path.first()?.as_str() {
            "crate" => (Vec::new(), &path[1..]),
            "self" => (module.to_vec(), &path[1..]),
            "super" => {
                let ups = path.iter().take_while(|p| *p == "super").count();
                (module[..module.len().checked_sub(ups)?].to_vec(), &path[ups..])
            }
            first if path.len() > 1 && self.files.contains_key(&child(module, first)) => (module.to_vec(), path),
            first => {
                let path_of_alias = self.aliases.get(&(module.to_vec(), first.into()))?;
                let longer: Vec<String> = path_of_alias.iter().chain(&path[1..]).cloned().collect();
                return self.resolve(module, &longer, depth + 1);
            }
        };
        while let Some((first, others)) = rest.split_first() {
            let below = child(&base, first);
            if !self.files.contains_key(&below) {
                break;
            }
            (base, rest) = (below, others);
        }
        if let Some(first) = rest.first()
            && let Some(stands_for) = self.aliases.get(&(base.clone(), first.clone()))
        {
            let longer: Vec<String> = stands_for.iter().chain(&rest[1..]).cloned().collect();
            // A name of another crate that is handed on belongs to the file that does so.
            if let Some(found) = self.resolve(&base, &longer, depth + 1) {
                return Some(found);
            }
        }
        Some((*self.files.get(&base)?, rest.first().cloned().unwrap_or_default()))
    }
}

fn child(module: &[String], name: &str) -> Vec<String> {
    module.iter().cloned().chain([name.to_string()]).collect()
}

/// Collects what a file mentions.
struct Reader {
    module: Vec<String>,
    modules: Vec<Vec<String>>,
    aliases: BTreeMap<(Vec<String>, String), Vec<String>>,
    mentions: Vec<Mention>,
}

impl Reader {
    fn of(file: &SourceFile) -> Reader {
        let module = file.module.clone();
        Reader { modules: vec![module.clone()], module, aliases: BTreeMap::new(), mentions: Vec::new() }
    }

    fn mention(&mut self, path: Vec<String>, line: usize, is_use: bool) {
        self.mentions.push(Mention { module: self.module.clone(), path, line, is_use });
    }

    /// The leaves of a `use` tree: each path with the name it gets.
    fn leaves(tree: &syn::UseTree, before: &[String], leaves: &mut Vec<(Vec<String>, String, usize)>) {
        match tree {
            syn::UseTree::Path(p) => Self::leaves(&p.tree, &child(before, &p.ident.to_string()), leaves),
            syn::UseTree::Group(group) => {
                for tree in &group.items {
                    Self::leaves(tree, before, leaves);
                }
            }
            syn::UseTree::Name(n) if n.ident == "self" => {
                let name = before.last().cloned().unwrap_or_default();
                leaves.push((before.to_vec(), name, n.span().start().line));
            }
            syn::UseTree::Name(n) => {
                let name = n.ident.to_string();
                leaves.push((child(before, &name), name, n.span().start().line));
            }
            syn::UseTree::Rename(r) => {
                let path = if r.ident == "self" { before.to_vec() } else { child(before, &r.ident.to_string()) };
                leaves.push((path, r.rename.to_string(), r.span().start().line));
            }
            syn::UseTree::Glob(g) => leaves.push((before.to_vec(), "*".into(), g.span().start().line)),
        }
    }

    /// Paths among the tokens of a macro's call, which are no syntax tree.
    fn read_tokens(&mut self, tokens: TokenStream) {
        let mut path: Vec<String> = Vec::new();
        let (mut colons, mut line) = (0, 0);
        for token in tokens {
            match token {
                TokenTree::Ident(word) if !path.is_empty() && colons == 2 => {
                    path.push(word.to_string());
                    colons = 0;
                }
                TokenTree::Punct(p) if p.as_char() == ':' && !path.is_empty() && colons < 2 => colons += 1,
                other => {
                    self.end_path(&mut path, line);
                    colons = 0;
                    match other {
                        TokenTree::Ident(word) => {
                            line = word.span().start().line;
                            path.push(word.to_string());
                        }
                        TokenTree::Group(group) => self.read_tokens(group.stream()),
                        _ => {}
                    }
                }
            }
        }
        self.end_path(&mut path, line);
    }

    fn end_path(&mut self, path: &mut Vec<String>, line: usize) {
        if path.len() > 1 {
            self.mention(std::mem::take(path), line, false);
        }
        path.clear();
    }
}

impl<'a> Visit<'a> for Reader {
    fn visit_item(&mut self, item: &'a syn::Item) {
        if !is_test(attributes_of(item)) {
            visit::visit_item(self, item);
        }
    }

    fn visit_impl_item_fn(&mut self, function: &'a syn::ImplItemFn) {
        if !is_test(&function.attrs) {
            visit::visit_impl_item_fn(self, function);
        }
    }

    fn visit_item_mod(&mut self, item: &'a syn::ItemMod) {
        if item.content.is_some() {
            self.module.push(item.ident.to_string());
            self.modules.push(self.module.clone());
            visit::visit_item_mod(self, item);
            self.module.pop();
        }
    }

    fn visit_item_use(&mut self, item: &'a syn::ItemUse) {
        let mut leaves = Vec::new();
        Self::leaves(&item.tree, &[], &mut leaves);
        for (path, name, line) in leaves {
            if matches!(item.vis, syn::Visibility::Inherited) {
                self.mention(path.clone(), line, true);
            }
            self.aliases.insert((self.module.clone(), name), path);
        }
    }

    fn visit_path(&mut self, path: &'a syn::Path) {
        let segments = path.segments.iter().map(|s| s.ident.to_string()).collect();
        self.mention(segments, path.span().start().line, false);
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, call: &'a syn::Macro) {
        self.read_tokens(call.tokens.clone());
        visit::visit_macro(self, call);
    }

    fn visit_visibility(&mut self, _: &'a syn::Visibility) {
        // `pub(super)` and `pub(in crate::x)` say who may use an item, not what it uses.
    }
}
