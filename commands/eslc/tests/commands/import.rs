//! `eslc import`: programs for behaviour trees, and the faults of their files.

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::{eslc, eslvm};

/// Returns the text of the first block of this language after a mark.
fn block<'a>(page: &'a str, mark: &str, language: &str) -> &'a str {
    let rest = page.split_once(mark).expect("the page has the mark").1;
    let rest = rest.split_once(&format!("```{language}\n")).expect("a block follows").1;
    rest.split("```").next().unwrap_or_default()
}

/// A tree with a node of each kind that needs no leaves of Nav2.
const ALL: &str = r#"<root BTCPP_format="4" main_tree_to_execute="Main">
<BehaviorTree ID="Main"><Sequence name="all of them">
  <Script code="count := 1; mode := 'slow' .. 1; far = count > 2 ? true : false"/>
  <SetBlackboard value="{count}" output_key="goal"/> <UnsetBlackboard key="mode"/>
  <Parallel success_count="1" failure_count="1"><Go to="{goal}"/><Look/></Parallel>
  <Parallel success_count="2" failure_count="2"><Go/><Look/><Wave/></Parallel>
  <ParallelAll max_failures="2"><Go/><Look/></ParallelAll>
  <SequenceWithMemory><Go/><Look/></SequenceWithMemory>
  <ReactiveFallback><IsDone/><Repeat num_cycles="3"><Go/></Repeat></ReactiveFallback>
  <ReactiveSequence><Go/><Look/></ReactiveSequence>
  <IfThenElse><IsDone/><Go/><Look/></IfThenElse>
  <WhileDoElse><IsDone/><Go/><Look/></WhileDoElse>
  <Switch2 variable="{mode}" case_1="slow1" case_2="7"><Go/><Look/><Wave/></Switch2>
  <TryCatch><Go/><Look/></TryCatch>
  <Inverter><Go/></Inverter> <ForceSuccess><Go/></ForceSuccess> <Fallback><ForceFailure><Go/></ForceFailure><Look/></Fallback>
  <Timeout msec="1500"><Go/></Timeout> <Delay delay_msec="{count}"><Go/></Delay> <Sleep msec="10"/>
  <RunOnce><Go/></RunOnce> <Precondition if="count == 1" else="SKIPPED"><Go/></Precondition>
  <LoopInt queue="1;2;3" value="{count}"><Go to="{count}"/></LoopInt>
  <Go _skipIf="far" _onSuccess="count += 1" /> <Go _while="!far" /> <Go _failureIf="count &lt; 0" _onFailure="far := true"/>
  <PipelineSequence><RateController hz="2"><Plan path="{path}"/></RateController><Follow path="{path}"/></PipelineSequence>
  <RecoveryNode number_of_retries="2"><Go/><RoundRobin><Look/><Wave/></RoundRobin></RecoveryNode>
  <SubTree ID="Move" to="{goal}" result="{far}"/> <SubTree ID="Move" to="3" result="{done}"/>
  <KeepRunningUntilFailure><Go/></KeepRunningUntilFailure>
</Sequence></BehaviorTree>
<BehaviorTree ID="Move"><Sequence><Go to="{to}"/><Script code="result := true"/></Sequence></BehaviorTree>
</root>"#;

#[test]
fn the_page_for_users_of_trees_shows_the_program_of_its_tree() {
    let page = std::fs::read_to_string(esl_conformance::root().join("docs/coming-from/behaviour-trees.md"));
    let page = page.expect("the page can be read");
    let tree = block(&page, "From this tree", "xml");
    let folder = Folder::with("import-page", &[("cross-door.xml", tree)]);
    let done = process::run(&mut eslc(&["import", &folder.join("cross-door.xml")]), "");
    assert_eq!(done.quiet_output().as_deref(), Ok(block(&page, "it makes this program", "text")));
}

#[test]
fn a_program_for_all_nodes_is_formatted_and_has_no_warnings() {
    let folder = Folder::with("import-all", &[("all.xml", ALL)]);
    let (tree, program) = (folder.join("all.xml"), folder.join("all.esl"));
    let done = process::run(&mut eslc(&["import", &tree, "-o", &program]), "");
    assert_eq!(done.quiet_output().as_deref(), Ok(""));
    for arguments in [["check", "--quiet", &*program], ["format", "--check", &*program]] {
        let done = process::run(&mut eslc(&arguments), "");
        assert_eq!(done.quiet_output().as_deref(), Ok(""), "{arguments:?}");
    }
    // A source is not overwritten.
    let done = process::run(&mut eslc(&["import", &tree, "-o", &program]), "");
    assert!(done.quiet_output().is_err());
}

#[test]
fn an_imported_program_runs_in_a_world_of_scripts() {
    let page = std::fs::read_to_string(esl_conformance::root().join("docs/coming-from/behaviour-trees.md"));
    let page = page.expect("the page can be read");
    let program = block(&page, "it makes this program", "text").replace("\n(cross-door)\n", "");
    let test = "(define-fluent battery 5)
(define-cause :stuck ())
(defun is-door-open () nil)
(defun is-battery-ok () (> battery 2))
(with-world ((:answer (push-door) :after 1 :failing (:stuck))
             (:answer (pick-lock) :after 2 :failing (:stuck) :times 3)
             (:answer (pick-lock) :after 2)
             (:answer (pass-door :speed *) :after 60)
             (:at 20 (setf battery 1)))
  (print (handler-case (cross-door) (failure (failure) (failure-cause failure))))
  (print (list (length (world-calls 'pick-lock)) (now))))";
    let done = process::run(&mut eslvm(&["run", "--clock", "virtual", "-"]), format!("{program}{test}"));
    assert_eq!(done.output.replace([' ', '\n'], ""), ":IS-BATTERY-OK(420.0)", "{done:?}");
}

#[test]
fn faults_have_places_and_a_status_of_their_own() {
    let tree = "<root BTCPP_format='4'>\n<BehaviorTree ID='A'>\n <Sequence><Timeout><Go/></Timeout><Sequnce><Go/>\
                </Sequnce></Sequence></BehaviorTree></root>";
    let folder =
        Folder::with("import-faults", &[("a.xml", tree), ("b.xml", "<root><include path='c.xml'/></root>")]);
    let done = process::run(&mut eslc(&["import", &folder.join("a.xml")]), "");
    assert_eq!(done.status, Some(3), "{done:?}");
    assert!(
        done.errors.contains("a.xml:3:12: `Timeout` needs the port `msec`: write `<Timeout msec="),
        "{done:?}"
    );
    assert!(done.errors.contains("a.xml:3:36: `<Sequnce>` is not a known node"), "{done:?}");
    let done = process::run(&mut eslc(&["import", &folder.join("b.xml")]), "");
    assert_eq!(done.status, Some(2), "{done:?}");
    assert!(done.errors.contains("b.xml:1:7: `c.xml` is included here"), "{done:?}");
}
