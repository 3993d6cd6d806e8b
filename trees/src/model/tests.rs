//! Faults of trees, with their places.

use super::*;

fn faults(text: &str) -> String {
    let source = TreeSource { name: "t.xml".into(), text: text.into() };
    match Model::read(&[source], None) {
        Ok(model) => format!("{} nodes", model.nodes.len()),
        Err(faults) => faults.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"),
    }
}

/// Returns the faults of a tree whose root is this.
fn of_root(root: &str) -> String {
    faults(&format!("<root BTCPP_format='4'><BehaviorTree ID='A'>\n{root}</BehaviorTree></root>"))
}

#[test]
fn sound_trees_have_nodes() {
    assert_eq!(of_root("<Sequence><Open/><Inverter><IsShut door='{d}'/></Inverter></Sequence>"), "4 nodes");
    assert_eq!(of_root("<Action ID='Open' speed='1'/>"), "1 nodes");
    assert_eq!(of_root("<Switch2 variable='{x}' case_1='1' case_2='2'><A/><B/><C/></Switch2>"), "4 nodes");
}

#[test]
fn unknown_nodes_and_wrong_numbers_of_children_are_faults() {
    assert!(
        of_root("<Sequnce><A/></Sequnce>")
            .starts_with("t.xml:2:1: `<Sequnce>` is not a known node: expected")
    );
    assert_eq!(
        of_root("<Inverter><A/><B/></Inverter>"),
        "t.xml:2:1: `Inverter` has 2 children: expected exactly one; put them into a `<Sequence>`"
    );
    assert_eq!(of_root("<Sequence/>"), "t.xml:2:1: `Sequence` has 0 children: expected 1 or more");
    assert_eq!(
        of_root("<IfThenElse><A/></IfThenElse>"),
        "t.xml:2:1: `IfThenElse` has 1 child: expected 2 to 3"
    );
    assert_eq!(
        of_root("<Action/>"),
        "t.xml:2:1: `<Action>` has no type: expected the attribute `ID`, as `<Action ID=\"…\">`"
    );
}

#[test]
fn ports_are_checked() {
    assert_eq!(
        of_root("<Timeout><A/></Timeout>"),
        "t.xml:2:1: `Timeout` needs the port `msec`: write `<Timeout msec=\"…\">`"
    );
    assert_eq!(
        of_root("<Timeout msec='soon'><A/></Timeout>"),
        "t.xml:2:10: the port `msec` of `Timeout` is `soon`: expected a whole number, or an entry of the blackboard \
         such as `{count}`"
    );
    assert_eq!(
        of_root("<Repeat num_cycles='2' times='3'><A/></Repeat>"),
        "t.xml:2:24: `Repeat` does not have a port `times`: expected one of `num_cycles`"
    );
    assert!(
        of_root("<A _skipif='x'/>")
            .contains("the attribute `_skipif` is not known: expected one of `_failureIf`")
    );
    assert_eq!(
        of_root("<A _skipIf='x ='/>"),
        "t.xml:2:4: the script `x =` cannot be read: expected a value, found the end of the script"
    );
}

#[test]
fn trees_are_found_and_do_not_contain_themselves() {
    assert_eq!(faults("<root/>"), "t.xml:1:1: the file has no trees: expected a `<BehaviorTree>`");
    assert!(faults("<tree/>").contains("`<tree>` is not a tree: expected `<root"));
    let two = "<root BTCPP_format='4'><BehaviorTree ID='A'><X/></BehaviorTree><BehaviorTree ID='B'><SubTree \
               ID='C'/></BehaviorTree></root>";
    let told = faults(two);
    assert!(told.contains("the main tree is not named: expected one of `A`, `B`"), "{told}");
    assert!(told.contains("no tree is called `C`: expected one of `A`, `B`"), "{told}");
    let cycle = "<root BTCPP_format='4' main_tree_to_execute='A'>\n<BehaviorTree ID='A'><SubTree ID='B'/>\
                 </BehaviorTree>\n<BehaviorTree ID='B'><SubTree ID='A'/></BehaviorTree></root>";
    assert_eq!(
        faults(cycle),
        "t.xml:3:22: the tree `A` contains itself here: repeat it by `<Repeat>` or `<RetryUntilSuccessful>` instead"
    );
}

#[test]
fn subtrees_need_the_ports_of_their_models() {
    let tree = |attributes: &str| {
        faults(&format!(
            "<root BTCPP_format='4' main_tree_to_execute='A'><BehaviorTree ID='A'>\n<SubTree ID='B'{attributes}/>\
             </BehaviorTree><BehaviorTree ID='B'><X/></BehaviorTree><TreeNodesModel><SubTree ID='B'>\
             <input_port name='goal'/><input_port name='speed' default='1'/></SubTree></TreeNodesModel></root>"
        ))
    };
    assert_eq!(tree(" goal='{g}'"), "2 nodes");
    assert_eq!(tree(" _autoremap='true'"), "2 nodes");
    assert_eq!(
        tree(""),
        "t.xml:2:1: the subtree `B` needs the port `goal`: write `<SubTree ID=\"B\" goal=\"{…}\">`"
    );
}

#[test]
fn includes_are_listed() {
    let source = |text: &str| TreeSource { name: "t.xml".into(), text: text.into() };
    let found = includes(&source("<root><include path='a.xml'/><include ros_pkg='p' path='b.xml'/></root>"));
    let found = found.expect("well-formed");
    assert_eq!((&*found[0].path, &found[1].ros_package), ("a.xml", &Some("p".into())));
    let fault = includes(&source("<root><include/></root>")).expect_err("a path is missing");
    assert_eq!(fault.to_string(), "t.xml:1:7: `<include>` names no file: expected the attribute `path`");
}
