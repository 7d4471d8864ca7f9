//! The layout of the sources: no two files of a crate import from each other.
//!
//! A circle of imports means that none of its files can be read, tested or changed alone. Modules
//! that only declare and re-export are looked through: an import counts for the file that defines
//! what is imported.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{read_dir, read_to_string};
use std::path::Path;

use syn::visit::Visit;

/// Names from the crate's root: `["cuda", "solver"]`. A module's path, or an item's.
type Names = Vec<String>;

/// What one file imports, re-exports and defines.
#[derive(Default)]
struct File {
    module: Names,
    children: BTreeSet<String>,
    uses: Vec<Names>,
    /// Re-exported names and where they come from; "*" for all of a module.
    exports: Vec<(String, Names)>,
    defines: BTreeSet<String>,
}

impl File {
    /// A path as the file writes it, from the crate's root. `None` if it leads out of the crate.
    fn absolute(&self, path: &[String]) -> Option<Names> {
        let supers = path.iter().take_while(|name| *name == "super").count();
        let (base, rest) = match path.first()?.as_str() {
            "crate" => (&[][..], &path[1..]),
            "self" => (&self.module[..], &path[1..]),
            "super" => {
                let depth = self.module.len().checked_sub(supers)?;
                (&self.module[..depth], &path[supers..])
            }
            child if self.children.contains(child) => (&self.module[..], path),
            _ => return None,
        };
        Some(base.iter().chain(rest).cloned().collect())
    }

    fn add_use(&mut self, tree: &syn::UseTree, prefix: &mut Names, public: bool) {
        let mut add = |name: String, last: &str| {
            let mut path = prefix.clone();
            if last != "self" {
                path.push(last.to_owned());
            }
            match self.absolute(&path) {
                Some(path) if public => self.exports.push((name, path)),
                Some(path) => self.uses.push(path),
                None => {}
            }
        };
        match tree {
            syn::UseTree::Path(path) => {
                prefix.push(path.ident.to_string());
                self.add_use(&path.tree, prefix, public);
                prefix.pop();
            }
            syn::UseTree::Name(name) => add(name.ident.to_string(), &name.ident.to_string()),
            syn::UseTree::Rename(rename) => {
                add(rename.rename.to_string(), &rename.ident.to_string());
            }
            syn::UseTree::Glob(_) => add("*".to_owned(), "*"),
            syn::UseTree::Group(group) => {
                for tree in &group.items {
                    self.add_use(tree, prefix, public);
                }
            }
        }
    }

    fn add_item(&mut self, item: &syn::Item) {
        use syn::Item;
        let name = match item {
            Item::Const(item) => &item.ident,
            Item::Enum(item) => &item.ident,
            Item::Fn(item) => &item.sig.ident,
            Item::Static(item) => &item.ident,
            Item::Struct(item) => &item.ident,
            Item::Trait(item) => &item.ident,
            Item::Type(item) => &item.ident,
            Item::Union(item) => &item.ident,
            Item::Mod(item) => {
                if item.content.is_none() {
                    self.children.insert(item.ident.to_string());
                }
                return;
            }
            _ => return,
        };
        self.defines.insert(name.to_string());
    }
}

/// Paths in expressions, types and patterns.
impl<'ast> Visit<'ast> for File {
    fn visit_item(&mut self, item: &'ast syn::Item) {
        match item {
            syn::Item::Use(item) => {
                let public = !matches!(item.vis, syn::Visibility::Inherited);
                self.add_use(&item.tree, &mut Names::new(), public);
            }
            // Unit tests see more than the code beside them needs.
            syn::Item::Mod(item) if item.content.is_some() && item.ident == "tests" => {}
            _ => syn::visit::visit_item(self, item),
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let names: Names = path.segments.iter().map(|s| s.ident.to_string()).collect();
        if names.len() > 1
            && let Some(path) = self.absolute(&names)
        {
            self.uses.push(path);
        }
        syn::visit::visit_path(self, path);
    }
}

/// All modules below a crate's root, by their names.
fn modules(folder: &Path, module: &[String], found: &mut BTreeMap<Names, File>) {
    for entry in read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let stem = entry.file_stem().unwrap().to_str().unwrap().to_owned();
        if entry.is_dir() {
            let inner: Names = module.iter().cloned().chain([stem]).collect();
            modules(&entry, &inner, found);
        } else if entry.extension().is_some_and(|ending| ending == "rs") && stem != "main" {
            let own = if stem == "mod" || stem == "lib" { None } else { Some(stem) };
            let module: Names = module.iter().cloned().chain(own).collect();
            let source = syn::parse_file(&read_to_string(&entry).unwrap())
                .unwrap_or_else(|error| panic!("{}: {error}", entry.display()));
            let mut file = File { module: module.clone(), ..File::default() };
            source.items.iter().for_each(|item| file.add_item(item));
            file.visit_file(&source);
            found.insert(module, file);
        }
    }
}

/// The module that defines what `path` names.
fn owner(files: &BTreeMap<Names, File>, path: &[String], depth: usize) -> Option<Names> {
    let length = (0..=path.len()).rev().find(|&length| files.contains_key(&path[..length]))?;
    let (module, rest) = path.split_at(length);
    let file = &files[module];
    if let Some(item) = rest.first()
        && !file.defines.contains(item)
        && depth < 16
    {
        for (name, target) in &file.exports {
            let target: Names = if name == item {
                target.iter().chain(&rest[1..]).cloned().collect()
            } else if name == "*" {
                target[..target.len() - 1].iter().chain(rest).cloned().collect()
            } else {
                continue;
            };
            let owner = owner(files, &target, depth + 1)?;
            if name == item || files[&owner].defines.contains(item) {
                return Some(owner);
            }
        }
    }
    Some(module.to_vec())
}

/// Modules that can be reached from `start` along imports.
fn reached<'a>(
    imports: &'a BTreeMap<Names, BTreeSet<Names>>,
    start: &'a Names,
) -> BTreeSet<&'a Names> {
    let mut reached = BTreeSet::new();
    let mut ahead: Vec<&Names> = imports[start].iter().collect();
    while let Some(module) = ahead.pop() {
        if reached.insert(module) {
            ahead.extend(&imports[module]);
        }
    }
    reached
}

/// Files of a crate that import, over others or directly, from a file that imports from them.
fn circles(source: &Path) -> Vec<String> {
    let mut files = BTreeMap::new();
    modules(source, &[], &mut files);
    let imports: BTreeMap<Names, BTreeSet<Names>> = files
        .iter()
        .map(|(module, file)| {
            let owners = file.uses.iter().filter_map(|path| owner(&files, path, 0));
            (module.clone(), owners.filter(|owner| owner != module).collect())
        })
        .collect();
    let name = |names: &Names| if names.is_empty() { "lib".into() } else { names.join("::") };
    imports
        .iter()
        .filter(|(module, _)| reached(&imports, module).contains(module))
        .map(|(module, direct)| {
            let back = direct.iter().filter(|other| reached(&imports, other).contains(module));
            format!("{} -> {}", name(module), back.map(name).collect::<Vec<_>>().join(", "))
        })
        .collect()
}

#[test]
fn no_two_files_of_a_crate_import_from_each_other() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = Vec::new();
    for folder in read_dir(root).unwrap().map(|entry| entry.unwrap().path()) {
        if folder.join("Cargo.toml").exists() && folder.join("src").exists() {
            let name = folder.file_name().unwrap().to_string_lossy().into_owned();
            let circles = circles(&folder.join("src"));
            found.extend(circles.into_iter().map(|circle| format!("{name}: {circle}")));
        }
    }
    assert!(found.is_empty(), "files in a circle of imports:\n{}", found.join("\n"));
}

#[test]
fn a_circle_over_a_re_export_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("lib.rs", "mod a; mod b; mod c; pub use a::A; pub use b::B;");
    write("a.rs", "use crate::B; pub struct A(B);");
    write("b.rs", "pub struct B; impl B { fn of(a: &super::a::A) {} }");
    write("c.rs", "use crate::{A, B};");
    assert_eq!(circles(folder.path()), ["a -> b", "b -> a"]);
    write("b.rs", "pub struct B; #[cfg(test)] mod tests { use crate::A; }");
    assert!(circles(folder.path()).is_empty());
}
