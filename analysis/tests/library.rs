//! The tables of the library name each cause with which its sources fail.

use std::collections::BTreeSet;
use std::path::Path;

#[test]
fn each_cause_of_the_library_is_known() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the package is in the workspace");
    let known: BTreeSet<String> =
        esl_analysis::causes_of_the_library().map(|cause| cause.to_lowercase()).collect();
    let mut found = BTreeSet::new();
    for entry in root.join("stdlib").read_dir().expect("the library can be listed") {
        let path = entry.expect("the library can be listed").path();
        if path.extension().is_none_or(|extension| extension != "esl") {
            continue;
        }
        let text = std::fs::read_to_string(&path).expect("a source can be read");
        let code: String = text.lines().filter(|line| !line.starts_with(';')).collect::<Vec<_>>().join("\n");
        for call in ["(fail :", "(%fail-for :"] {
            for rest in code.split(call).skip(1) {
                let end = rest.find(|c: char| !c.is_alphanumeric() && c != '-').unwrap_or(rest.len());
                found.insert(rest[..end].to_string());
            }
        }
    }
    assert!(found.len() > 15, "{found:?}");
    let missing: Vec<&String> = found.difference(&known).collect();
    assert!(missing.is_empty(), "the tables of the library lack {missing:?}");
}
