//! The tables of `docs/architecture.md`, held against the text of the sources. Comments and tests are left out.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// One source file without comments and tests.
struct Source {
    /// Path below `src`, with `/`.
    path: String,
    code: String,
}

impl Source {
    /// Top-level module the file belongs to.
    fn module(&self) -> &str {
        self.path.split('/').next().unwrap().trim_end_matches(".rs")
    }

    /// Whether `place`, a module (`device`) or a file (`time.rs`, `runtime/live.rs`), is or holds this file.
    fn is_in(&self, place: &str) -> bool {
        self.path == place || (!place.ends_with(".rs") && self.module() == place)
    }
}

#[test]
fn modules_use_what_the_table_says_and_nothing_else() {
    let sources = sources();
    let rows = table("| module |");
    let order: Vec<String> = rows.iter().map(|row| names(&row[0]).remove(0)).collect();
    let listed: BTreeSet<&str> = order.iter().map(String::as_str).collect();
    let declared = declared_modules();
    assert_eq!(
        listed,
        declared.iter().map(String::as_str).collect(),
        "lib.rs and the table name the same modules"
    );

    let mut used: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
    for source in &sources {
        assert!(
            !source.code.contains("super::super"),
            "{}: name the module instead of super::super",
            source.path
        );
        assert!(
            !source.code.contains("use crate::{"),
            "{}: one `use` per module, for this test",
            source.path
        );
        let uses = used.entry(source.module()).or_default();
        uses.extend(crate_paths(&source.code).filter(|module| module != source.module()));
    }
    for (index, row) in rows.iter().enumerate() {
        let module = order[index].as_str();
        if row[2] == "all" {
            continue;
        }
        let allowed: BTreeSet<String> = names(&row[2]).into_iter().collect();
        let found = used.remove(module).unwrap_or_default();
        assert_eq!(
            found, allowed,
            "`{module}`: found in the sources (left), listed in docs/architecture.md (right)"
        );
        for other in &allowed {
            let above = order.iter().position(|name| name == other);
            assert!(
                above.is_some_and(|above| above < index),
                "`{module}` uses `{other}`, which is not above it"
            );
        }
    }
}

#[test]
fn only_the_listed_places_touch_the_world() {
    let sources = sources();
    for row in table("| effect |") {
        let (signs, places) = (names(&row[1]), names(&row[2]));
        let touching: Vec<&Source> =
            sources.iter().filter(|source| signs.iter().any(|sign| mentions(&source.code, sign))).collect();
        for source in &touching {
            let listed = places.iter().any(|place| source.is_in(place));
            assert!(listed, "{}: {} belongs in {places:?}", source.path, row[0]);
        }
        for place in &places {
            let needed = touching.iter().any(|source| source.is_in(place));
            assert!(needed, "docs/architecture.md lists {place} for {}, but nothing there does it", row[0]);
        }
    }
}

#[test]
fn tests_and_comments_are_cut_out() {
    let text = "use crate::a; // crate::b\n#[cfg(test)]\n#[allow(x)]\nmod tests {\n    use crate::c;\n}\nuse crate::d;\n\
                #[cfg(test)]\nmod helper;\n#[cfg(all(test, unix))]\nmod more {\n    crate::e\n}\n";
    let (code, test_files) = without_tests(text);
    assert_eq!(crate_paths(&code).collect::<Vec<_>>(), ["a", "d"]);
    assert_eq!(test_files, ["helper"]);
    assert!(
        mentions("std::fs::read", "fs::")
            && !mentions("offs::read", "fs::")
            && !mentions("nunsafe", "unsafe")
    );
}

/// Rows of the table of `docs/architecture.md` whose heading line starts with `heading`.
fn table(heading: &str) -> Vec<Vec<String>> {
    let text = fs::read_to_string(format!("{ROOT}/docs/architecture.md")).unwrap();
    let lines = text.lines().skip_while(|line| !line.starts_with(heading)).skip(2);
    let rows: Vec<Vec<String>> = lines
        .take_while(|line| line.starts_with('|'))
        .map(|line| line.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect())
        .collect();
    assert!(rows.len() > 3 && rows.iter().all(|row| row.len() == 3), "table `{heading}` with three columns");
    rows
}

/// What stands between backticks in a cell.
fn names(cell: &str) -> Vec<String> {
    cell.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

fn declared_modules() -> Vec<String> {
    let lib = fs::read_to_string(format!("{ROOT}/src/lib.rs")).unwrap();
    let modules = lib.lines().filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';'));
    modules.map(str::to_owned).collect()
}

/// First names of all `crate::name` paths.
fn crate_paths(code: &str) -> impl Iterator<Item = String> + '_ {
    let word = |rest: &str| rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    code.split("crate::").skip(1).map(word)
}

/// Whether `sign` occurs in the code and is not the end of a longer word.
fn mentions(code: &str, sign: &str) -> bool {
    let starts_word = |at: usize| !code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_');
    code.match_indices(sign).any(|(at, _)| starts_word(at))
}

/// Every file below `src` but the two roots, without comments and tests.
fn sources() -> Vec<Source> {
    let src = Path::new(ROOT).join("src");
    let mut files = Vec::new();
    collect(&src, &mut files);
    let mut test_only: BTreeSet<PathBuf> = BTreeSet::new();
    let mut sources = Vec::new();
    for file in &files {
        let (code, test_files) = without_tests(&fs::read_to_string(file).unwrap());
        let folder = if file.ends_with("mod.rs") {
            file.parent().unwrap().to_owned()
        } else {
            file.with_extension("")
        };
        test_only.extend(test_files.iter().map(|name| folder.join(name)));
        let path = file.strip_prefix(&src).unwrap().to_string_lossy().replace('\\', "/");
        sources.push((file, Source { path, code }));
    }
    let is_test = |file: &Path| file.ancestors().any(|part| test_only.contains(&part.with_extension("")));
    let kept = sources.into_iter().filter(|(file, _)| !is_test(file)).map(|(_, source)| source);
    let kept: Vec<Source> =
        kept.filter(|source| !["lib.rs", "main.rs"].contains(&source.path.as_str())).collect();
    assert!(kept.len() > 50, "only {} sources found", kept.len());
    kept
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
}

/// The code without comments and without top-level test modules, and the names of the test modules in other files.
fn without_tests(text: &str) -> (String, Vec<String>) {
    let (mut code, mut test_files) = (String::new(), Vec::new());
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        if line.starts_with("#[cfg(test)]") || line.starts_with("#[cfg(all(test,") {
            let item = lines.by_ref().find(|line| !line.starts_with("#[")).unwrap();
            if let Some(name) = item.strip_prefix("mod ").and_then(|rest| rest.strip_suffix(';')) {
                test_files.push(name.to_owned());
            } else if item.ends_with('{') {
                lines.by_ref().find(|line| *line == "}").unwrap();
            }
            continue;
        }
        code.push_str(line.split("//").next().unwrap());
        code.push('\n');
    }
    (code, test_files)
}
