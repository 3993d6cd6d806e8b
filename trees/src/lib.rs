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

use esl_host::{HostModule, HostRows};

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

/// The modules. Those whose names begin with `bt-` are parts of `bt`, which requires them.
pub const MODULES: &[HostModule] = &[
    HostModule { name: "bt", text: include_str!("../modules/bt.esl"), rows: rows::rows },
    HostModule { name: "bt-control", text: include_str!("../modules/bt-control.esl"), rows: HostRows::new },
    HostModule { name: "bt-custom", text: include_str!("../modules/bt-custom.esl"), rows: HostRows::new },
    HostModule {
        name: "bt-decorators",
        text: include_str!("../modules/bt-decorators.esl"),
        rows: HostRows::new,
    },
    HostModule { name: "bt-nav2", text: include_str!("../modules/bt-nav2.esl"), rows: HostRows::new },
    HostModule { name: "bt-trees", text: include_str!("../modules/bt-trees.esl"), rows: HostRows::new },
];

#[cfg(test)]
mod tests {
    use esl_host::unused_functions;

    use super::*;

    #[test]
    fn every_function_of_the_host_is_called_by_a_module() {
        assert_eq!(unused_functions(MODULES), [""; 0]);
    }
}
