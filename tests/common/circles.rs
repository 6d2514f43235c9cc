//! Circles of files inside a crate: sets of files in which each depends, directly or through others, on every other.
//!
//! A file refers to another one by a path: in a `use`, in an expression or in the body of a macro. A path that a module
//! re-exports leads to the file that has the item. `mod` does not count as a reference, and tests may refer to the tested items.

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

#[derive(Default)]
struct Module {
    file: usize,
    parent: Option<usize>,
    inner: BTreeMap<String, usize>,
    items: BTreeSet<String>,
    imports: BTreeMap<String, Vec<String>>,
    globs: Vec<Vec<String>>,
    paths: Vec<Vec<String>>,
}

/// The modules of a crate; the first is its root.
struct Modules {
    files: Vec<PathBuf>,
    all: Vec<Module>,
}

/// The circles of a crate, the files of each in order, from `lib.rs` (or `main.rs`) in its folder `src`.
pub(crate) fn circles(src: &Path, root: &str) -> Vec<Vec<String>> {
    let mut modules = Modules { files: Vec::new(), all: Vec::new() };
    modules.file(&src.join(root), None, src);
    let known = modules.known();
    let beyond: Vec<BTreeSet<usize>> = (0..known.len()).map(|file| reached(&known, file)).collect();
    let mut circles = BTreeSet::new();
    for (file, far) in beyond.iter().enumerate().filter(|(file, far)| far.contains(file)) {
        circles.insert(far.iter().copied().filter(|&other| beyond[other].contains(&file)).collect::<Vec<_>>());
    }
    let name = |&file: &usize| modules.files[file].strip_prefix(src).unwrap().to_str().unwrap().to_owned();
    circles.iter().map(|circle| circle.iter().map(name).collect()).map(sorted).collect()
}

fn sorted(mut names: Vec<String>) -> Vec<String> {
    names.sort();
    names
}

/// The files reachable from one; itself only through a circle.
fn reached(known: &[BTreeSet<usize>], from: usize) -> BTreeSet<usize> {
    let (mut found, mut open) = (BTreeSet::new(), vec![from]);
    while let Some(file) = open.pop() {
        open.extend(known[file].iter().filter(|&&next| found.insert(next)));
    }
    found
}

fn is(token: Option<&TokenTree>, wanted: char) -> bool {
    matches!(token, Some(TokenTree::Punct(p)) if p.as_char() == wanted)
}

fn word(token: Option<&TokenTree>) -> Option<String> {
    match token {
        Some(TokenTree::Ident(ident)) => Some(ident.to_string()),
        _ => None,
    }
}

fn is_colons(tokens: &[TokenTree], at: usize) -> bool {
    is(tokens.get(at), ':') && is(tokens.get(at + 1), ':')
}

fn group(token: Option<&TokenTree>, delimiter: Delimiter) -> Option<TokenStream> {
    match token {
        Some(TokenTree::Group(group)) if group.delimiter() == delimiter => Some(group.stream()),
        _ => None,
    }
}

impl Modules {
    fn file(&mut self, path: &Path, parent: Option<usize>, folder: &Path) -> usize {
        let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        self.files.push(path.to_owned());
        self.module(text.parse().unwrap(), self.files.len() - 1, parent, folder)
    }

    fn module(&mut self, tokens: TokenStream, file: usize, parent: Option<usize>, folder: &Path) -> usize {
        let module = self.all.len();
        self.all.push(Module { file, parent, ..Module::default() });
        self.tokens(tokens, module, folder, true);
        module
    }

    /// Reads the tokens of a module, or of a `block` in one.
    fn tokens(&mut self, tokens: TokenStream, module: usize, folder: &Path, is_module: bool) {
        let tokens: Vec<TokenTree> = tokens.into_iter().collect();
        let (mut at, mut named_path) = (0, None);
        while at < tokens.len() {
            let bang = usize::from(is(tokens.get(at + 1), '!'));
            if is(tokens.get(at), '#') && group(tokens.get(at + 1 + bang), Delimiter::Bracket).is_some() {
                let attribute = tokens[at + 1 + bang].to_string().replace(' ', "");
                at += 2 + bang;
                if attribute == "[cfg(test)]" {
                    let ends =
                        |token: &TokenTree| is(Some(token), ';') || group(Some(token), Delimiter::Brace).is_some();
                    at += tokens[at..].iter().position(ends).map_or(tokens.len(), |end| end + 1);
                }
                named_path = attribute.strip_prefix("[path=\"").map(|rest| rest.trim_end_matches("\"]").to_owned());
                continue;
            }
            if let TokenTree::Group(group) = &tokens[at] {
                self.tokens(group.stream(), module, folder, false);
            }
            let Some(first) = word(tokens.get(at)) else {
                at += 1;
                continue;
            };
            let next = word(tokens.get(at + 1));
            match (first.as_str(), next) {
                // `pub(in crate::abi)` restricts who may name an item.
                ("pub", _) => at += 1 + usize::from(group(tokens.get(at + 1), Delimiter::Parenthesis).is_some()),
                ("use", _) => at = self.tree(&tokens, at + 1, &[], module),
                ("mod", Some(name)) => {
                    let below = folder.join(&name);
                    let inner = if let Some(body) = group(tokens.get(at + 2), Delimiter::Brace) {
                        self.module(body, self.all[module].file, Some(module), &below)
                    } else {
                        let beside =
                            named_path.take().map(|path| self.files[self.all[module].file].with_file_name(path));
                        let usual = [folder.join(format!("{name}.rs")), below.join("mod.rs")];
                        let path = beside.into_iter().chain(usual).find(|path| path.is_file());
                        self.file(
                            &path.unwrap_or_else(|| panic!("{name} in {}", folder.display())),
                            Some(module),
                            &below,
                        )
                    };
                    self.all[module].inner.insert(name, inner);
                    at += 3;
                }
                ("struct" | "enum" | "trait" | "type" | "union" | "fn" | "const" | "static", Some(name))
                    if is_module =>
                {
                    self.all[module].items.insert(name);
                    at += 2;
                }
                ("macro_rules", _) if is_module => {
                    self.all[module].items.extend(word(tokens.get(at + 2)));
                    at += 3;
                }
                _ => at = self.path(&tokens, at, module),
            }
        }
    }

    /// A path of at least two words: a single word is a variable or an import.
    fn path(&mut self, tokens: &[TokenTree], mut at: usize, module: usize) -> usize {
        let is_within = at > 0 && [':', '.', '\''].iter().any(|&before| is(tokens.get(at - 1), before));
        let is_rest = is_within && !(is(tokens.get(at - 1), ':') && !(at > 1 && is(tokens.get(at - 2), ':')));
        let mut path: Vec<String> = word(tokens.get(at)).into_iter().collect();
        at += 1;
        while is_colons(tokens, at) && word(tokens.get(at + 2)).is_some() {
            path.extend(word(tokens.get(at + 2)));
            at += 3;
        }
        if path.len() > 1 && !is_rest {
            self.all[module].paths.push(path);
        }
        at
    }

    /// A tree of a `use`, which begins with `path`.
    fn tree(&mut self, tokens: &[TokenTree], mut at: usize, path: &[String], module: usize) -> usize {
        let mut path = path.to_owned();
        loop {
            if is_colons(tokens, at) {
                at += 2;
            } else if let Some(branches) = group(tokens.get(at), Delimiter::Brace) {
                let branches: Vec<TokenTree> = branches.into_iter().collect();
                let mut branch = 0;
                while branch < branches.len() {
                    branch = self.tree(&branches, branch, &path, module) + 1;
                }
                return at + 1;
            } else if is(tokens.get(at), '*') {
                self.all[module].globs.push(path);
                return at + 1;
            } else {
                // Not a word: the lifetimes of `impl Trait + use<'a>`.
                let Some(name) = word(tokens.get(at)) else { return at + 1 };
                at += 1;
                if name != "self" || path.is_empty() {
                    path.push(name);
                }
                if is_colons(tokens, at) {
                    continue;
                }
                let mut name = path.last().unwrap().clone();
                if word(tokens.get(at)).is_some_and(|word| word == "as") {
                    name = word(tokens.get(at + 1)).unwrap();
                    at += 2;
                }
                self.all[module].imports.insert(name, path.clone());
                self.all[module].paths.push(path);
                return at;
            }
        }
    }

    /// The module in which a path begins, and the remainder of the path.
    fn begin<'a>(&self, module: usize, path: &'a [String]) -> Option<(usize, &'a [String])> {
        let first = path[0].as_str();
        let this = &self.all[module];
        match first {
            "crate" => Some((0, &path[1..])),
            "self" => Some((module, &path[1..])),
            "super" => {
                let ups = path.iter().take_while(|word| *word == "super").count();
                let up = |module: usize, _| self.all[module].parent.unwrap();
                Some(((0..ups).fold(module, up), &path[ups..]))
            }
            _ if this.inner.contains_key(first) || this.items.contains(first) => Some((module, path)),
            _ => None,
        }
    }

    /// The file of the item that a path in a module names, if it is in this crate.
    fn resolve(&self, module: usize, path: &[String], depth: usize) -> Option<usize> {
        if depth > 16 {
            return None;
        }
        let Some((mut module, mut rest)) = self.begin(module, path) else {
            let this = &self.all[module];
            if let Some(import) = this.imports.get(&path[0]).filter(|import| *import != path) {
                return self.resolve(module, &[import, &path[1..]].concat(), depth + 1);
            }
            return this.globs.iter().find_map(|glob| self.through(module, glob, path, depth));
        };
        while let Some(name) = rest.first() {
            let this = &self.all[module];
            if let Some(&inner) = this.inner.get(name) {
                (module, rest) = (inner, &rest[1..]);
                continue;
            }
            if !this.items.contains(name) {
                let import = this.imports.get(name).map(|import| [import, &rest[1..]].concat());
                let found = match import {
                    Some(import) => self.resolve(module, &import, depth + 1),
                    None => this.globs.iter().find_map(|glob| self.through(module, glob, rest, depth)),
                };
                return found.or(Some(this.file));
            }
            break;
        }
        Some(self.all[module].file)
    }

    /// The file of a path that a glob of a module brings in.
    fn through(&self, module: usize, glob: &[String], path: &[String], depth: usize) -> Option<usize> {
        let of = self.named(module, glob)?;
        let name = &path[0];
        let Module { inner, items, imports, .. } = &self.all[of];
        let has = of != module && (inner.contains_key(name) || items.contains(name) || imports.contains_key(name));
        has.then(|| self.resolve(of, &[&["self".to_owned()], path].concat(), depth + 1)).flatten()
    }

    /// The module that a path names.
    fn named(&self, module: usize, path: &[String]) -> Option<usize> {
        let (module, rest) = self.begin(module, path)?;
        rest.iter().try_fold(module, |module, name| self.all[module].inner.get(name).copied())
    }

    /// Each file with the others that it names.
    fn known(&self) -> Vec<BTreeSet<usize>> {
        let mut known = vec![BTreeSet::new(); self.files.len()];
        for (module, this) in self.all.iter().enumerate() {
            let globs = this.globs.iter().filter_map(|glob| self.named(module, glob)).map(|of| self.all[of].file);
            let paths = this.paths.iter().filter_map(|path| self.resolve(module, path, 0));
            known[this.file].extend(globs.chain(paths).filter(|&file| file != this.file));
        }
        known
    }
}
