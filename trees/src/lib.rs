//! Behaviour trees for programs in ESL: reading the XML of BehaviorTree.CPP, writing a program for a tree,
//! and the module `bt`, which ticks a tree as it is.
//!
//! ```
//! use esl_trees::{TreeSource, import};
//!
//! let text = r#"<root BTCPP_format="4"><BehaviorTree ID="Cross"><Sequence><OpenDoor/><PassDoor/></Sequence>
//!     </BehaviorTree></root>"#;
//! let source = TreeSource { name: "cross.xml".into(), text: text.into() };
//! let program = import(&[source], None, &|_| false).map_err(|faults| faults[0].clone())?;
//! assert!(program.contains("(open-door)\n(pass-door))"));
//! # Ok::<(), esl_trees::TreeFault>(())
//! ```
#![forbid(unsafe_code)]

mod catalogue;
mod emit;
mod fault;
mod model;
mod number;
mod ros;
mod rows;
mod script;
mod xml;

use esl_host::{HostModule, HostRows, Inbox};

pub use fault::{FilePlace, TreeFault};
pub use model::{Include, TreeSource, includes};

/// Returns the program for the trees of some files, the main one first, not yet formatted. `main` names the
/// tree that is executed, if the file does not; `is_reserved` tells the names of the language, which the
/// functions of the program cannot have.
///
/// # Errors
/// All faults of the files.
pub fn import(
    sources: &[TreeSource],
    main: Option<&str>,
    is_reserved: &dyn Fn(&str) -> bool,
) -> Result<String, Vec<TreeFault>> {
    let model = model::Model::read(sources, main)?;
    let title = sources.first().map(|source| source.name.rsplit('/').next().unwrap_or_default().to_owned());
    emit::program(&model, &title.unwrap_or_default(), is_reserved).map_err(|fault| vec![fault])
}

/// Functions of a module that has none of its own.
fn none(inbox: &Inbox) -> HostRows {
    HostRows::new(inbox)
}

/// The modules. Those whose names begin with `bt-` are parts of `bt`, which requires them.
pub const MODULES: &[HostModule] = &[
    HostModule { name: "bt", text: include_str!("../modules/bt.esl"), rows: rows::rows },
    HostModule { name: "bt-control", text: include_str!("../modules/bt-control.esl"), rows: none },
    HostModule { name: "bt-custom", text: include_str!("../modules/bt-custom.esl"), rows: none },
    HostModule { name: "bt-decorators", text: include_str!("../modules/bt-decorators.esl"), rows: none },
    HostModule { name: "bt-nav2", text: include_str!("../modules/bt-nav2.esl"), rows: none },
    HostModule { name: "bt-trees", text: include_str!("../modules/bt-trees.esl"), rows: none },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_function_of_the_host_is_called_by_a_module() {
        for HostModule { name, text, rows } in MODULES {
            let rows = rows(&Inbox::new());
            let defines = text.contains(&format!("(esl::%define-host-functions \"{name}\")"));
            assert_eq!(defines, rows.iter().next().is_some(), "{name}");
            for row in rows.iter() {
                let call = row.name.to_lowercase();
                assert!(MODULES.iter().any(|module| module.text.contains(&call)), "{}", row.name);
                assert!(row.documentation.ends_with('.'), "{}", row.name);
            }
        }
    }
}
