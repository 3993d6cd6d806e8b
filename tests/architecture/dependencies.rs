//! The arrows of the map in `ARCHITECTURE.md` are the dependencies between the packages.

use std::collections::{BTreeMap, BTreeSet};

use super::{read, section};

/// A package, and one that it uses.
type Use = (String, String);

/// Returns the uses that the map shows by arrows.
fn arrows_of_the_map() -> BTreeSet<Use> {
    let document = read("ARCHITECTURE.md");
    let text = section(&document, "## 2. Code map").replace('\n', " ");
    let names = |list: &str| list.split(',').map(|name| name.trim().to_owned()).collect::<Vec<_>>();
    let arrows = text.split('`').skip(1).step_by(2).filter_map(|code| code.split_once('←'));
    let pairs = arrows.flat_map(|(used, users)| {
        let used = names(used);
        names(users)
            .into_iter()
            .flat_map(move |user| used.clone().into_iter().map(move |one| (user.clone(), one)))
    });
    pairs.collect()
}

/// Returns the folders of the members of the workspace, without the root package.
pub(super) fn members() -> Vec<String> {
    let text = read("Cargo.toml");
    let list = text.split("members = [").nth(1).and_then(|rest| rest.split(']').next());
    list.expect("the workspace has members").split('"').skip(1).step_by(2).map(str::to_owned).collect()
}

/// Returns the uses that the manifests name, except for tests. `esl` is the root package.
fn dependencies_of_the_manifests() -> BTreeSet<Use> {
    let manifest = |folder: &str| {
        read(&if folder == "esl" { "Cargo.toml".into() } else { format!("{folder}/Cargo.toml") })
    };
    let packages: BTreeMap<String, String> = members()
        .into_iter()
        .chain(["esl".into()])
        .map(|folder| {
            let text = manifest(&folder);
            let name = text.split("\nname = \"").nth(1).and_then(|rest| rest.split('"').next());
            let name = name.expect("a package has a name");
            (if name == "esl-lang" { "esl" } else { name }.to_owned(), folder)
        })
        .collect();
    let of_folder = |folder: &String| {
        let text = manifest(folder);
        let mut is_listed = false;
        let mut used = Vec::new();
        for line in text.lines() {
            if line.starts_with('[') {
                is_listed = matches!(line, "[dependencies]" | "[build-dependencies]");
            } else if is_listed && let Some(end) = line.find(['.', ' ', '=']) {
                used.extend(packages.get(&line[..end]).map(|used| (folder.clone(), used.clone())));
            }
        }
        used
    };
    packages.values().flat_map(of_folder).collect()
}

/// Returns the uses, direct and indirect.
fn closure(uses: &BTreeSet<Use>) -> BTreeSet<Use> {
    let mut all = uses.clone();
    loop {
        let further = all.iter().flat_map(|(user, used)| {
            let below = uses.iter().filter(move |(other, _)| other == used);
            below.map(move |(_, used)| (user.clone(), used.clone()))
        });
        let further: BTreeSet<_> = further.filter(|pair| !all.contains(pair)).collect();
        if further.is_empty() {
            return all;
        }
        all.extend(further);
    }
}

#[test]
fn the_arrows_of_the_map_are_those_of_the_manifests() {
    let (arrows, dependencies) = (arrows_of_the_map(), dependencies_of_the_manifests());
    assert!(dependencies.contains(&("vm".into(), "heap".into())), "{dependencies:?}");
    let (said, true_ones) = (closure(&arrows), closure(&dependencies));
    let wrong: Vec<_> = arrows.difference(&true_ones).collect();
    assert!(wrong.is_empty(), "the first does not use the second: {wrong:?}");
    let missing: Vec<_> = dependencies.difference(&said).collect();
    assert!(missing.is_empty(), "no arrow says that the first uses the second: {missing:?}");
}
