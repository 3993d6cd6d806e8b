//! Packs the definitions of messages, services and actions that come with ESL into one text.
//!
//! They are those that `hiroz-codegen` brings: of Jazzy, and those that only Lyrical has.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::{env, fs};

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=interfaces");
    let mut definitions = BTreeMap::new();
    // The first that has a name wins.
    collect(Path::new("interfaces"), &mut definitions)?;
    for distribution in ["jazzy", "lyrical"] {
        collect(&hiroz_codegen::bundled_assets_dir_for(distribution), &mut definitions)?;
    }
    let mut text = String::new();
    for (name, path) in definitions {
        let definition = fs::read_to_string(&path)?;
        text.push_str(&format!("=== {name}\n"));
        definition.lines().for_each(|line| text.push_str(&format!("{}\n", line.trim_end())));
    }
    fs::write(PathBuf::from(env::var("OUT_DIR")?).join("definitions.txt"), text)?;
    Ok(())
}

/// Adds the definitions below `folder/PACKAGE/KIND/`, by their names.
fn collect(folder: &Path, definitions: &mut BTreeMap<String, PathBuf>) -> Result<(), Box<dyn Error>> {
    for kind in ["msg", "srv", "action"] {
        for package in fs::read_dir(folder).into_iter().flatten() {
            let package = package?;
            let package_name = package.file_name().to_string_lossy().into_owned();
            // A fixture of the crate's own tests.
            if package_name == "test_interface_files" {
                continue;
            }
            for file in fs::read_dir(package.path().join(kind)).into_iter().flatten() {
                let path = file?.path();
                let base = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                if path.extension().is_some_and(|extension| extension == kind) {
                    definitions.entry(format!("{package_name}/{kind}/{base}")).or_insert(path);
                }
            }
        }
    }
    Ok(())
}
