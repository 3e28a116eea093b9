//! The program's own source: the files that are compiled without their tests, parsed.

use std::path::{Path, PathBuf};

/// A file of `src` that is compiled into the library.
pub struct SourceFile {
    /// Path from the project's folder, with forward slashes.
    pub path: String,
    /// Path of its module: `["mesh", "build"]`; empty for `lib.rs`.
    pub module: Vec<String>,
    /// What it holds.
    pub syntax: syn::File,
}

impl SourceFile {
    /// The room that it lies in; none for `lib.rs`.
    pub fn room(&self) -> Option<&str> {
        self.module.first().map(String::as_str)
    }
}

/// The project's folder.
pub fn project() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The text of a file of the project.
pub fn text_of(path: &str) -> String {
    std::fs::read_to_string(project().join(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// All files of the library, found as the compiler finds them: from `lib.rs` along its `mod` items, test modules left
/// out.
pub fn library() -> Vec<SourceFile> {
    let mut files = Vec::new();
    read(PathBuf::from("src/lib.rs"), Vec::new(), &mut files);
    files
}

/// All files that end in `.rs` below a folder of the project, tests included, sorted.
pub fn rust_files(folder: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut folders = vec![PathBuf::from(folder)];
    while let Some(folder) = folders.pop() {
        let entries =
            std::fs::read_dir(project().join(&folder)).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
        for entry in entries {
            let entry = entry.expect("an entry of a folder");
            let path = folder.join(entry.file_name());
            if entry.file_type().expect("its kind").is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                found.push(with_slashes(&path));
            }
        }
    }
    found.sort();
    found
}

/// Whether an item is compiled for tests only.
pub fn is_test(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|a| match &a.meta {
        syn::Meta::List(list) if list.path.is_ident("cfg") => {
            let condition = list.tokens.to_string();
            condition == "test" || condition.starts_with("all (test")
        }
        meta => meta.path().is_ident("test"),
    })
}

/// The attributes of an item.
pub fn attributes_of(item: &syn::Item) -> &[syn::Attribute] {
    use syn::Item;
    match item {
        Item::Const(i) => &i.attrs,
        Item::Enum(i) => &i.attrs,
        Item::Fn(i) => &i.attrs,
        Item::Impl(i) => &i.attrs,
        Item::Macro(i) => &i.attrs,
        Item::Mod(i) => &i.attrs,
        Item::Static(i) => &i.attrs,
        Item::Struct(i) => &i.attrs,
        Item::Trait(i) => &i.attrs,
        Item::Type(i) => &i.attrs,
        Item::Use(i) => &i.attrs,
        _ => &[],
    }
}

fn with_slashes(path: &Path) -> String {
    path.to_string_lossy().replace('\\', "/")
}

fn read(path: PathBuf, module: Vec<String>, files: &mut Vec<SourceFile>) {
    let name = with_slashes(&path);
    let syntax = syn::parse_file(&text_of(&name)).unwrap_or_else(|e| panic!("{name}:{}: {e}", e.span().start().line));
    let is_root = path.ends_with("lib.rs") || path.ends_with("mod.rs");
    let below = if is_root { path.parent().expect("a folder").into() } else { path.with_extension("") };
    let declared: Vec<(String, PathBuf)> = syntax
        .items
        .iter()
        .filter_map(|item| match item {
            syn::Item::Mod(m) if m.content.is_none() && !is_test(&m.attrs) => {
                let child = m.ident.to_string();
                let place = place_of(&path, &below, &child, &m.attrs);
                Some((child, place))
            }
            _ => None,
        })
        .collect();
    files.push(SourceFile { path: name, module: module.clone(), syntax });
    for (child, place) in declared {
        let module = module.iter().cloned().chain([child]).collect();
        read(place, module, files);
    }
}

/// Where the file of the module `child` lies, declared in `path`, whose modules lie in `below`.
fn place_of(path: &Path, below: &Path, child: &str, attributes: &[syn::Attribute]) -> PathBuf {
    for attribute in attributes {
        if let syn::Meta::NameValue(value) = &attribute.meta
            && value.path.is_ident("path")
            && let syn::Expr::Lit(syn::ExprLit { lit: syn::Lit::Str(file), .. }) = &value.value
        {
            return path.parent().expect("a folder").join(file.value());
        }
    }
    let file = below.join(format!("{child}.rs"));
    if project().join(&file).is_file() { file } else { below.join(child).join("mod.rs") }
}
