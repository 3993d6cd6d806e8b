//! The rules on entries of the control stack, landings and the value list: V9 to V11.

use super::*;

#[test]
fn v9_entries_are_popped_in_order_and_by_their_own() {
    let found = |expected, found| Err(Fault::Entry { expected, found });
    let scoped = |code: &str| format!("load-nil r0.. 2 \n push-scope r2.. \n {code} \n return r0");
    check(&scoped("pop-control 1"), Ok(()));
    check(&scoped("pop-control 2"), Err(Fault::PopCount(2)));
    check(&scoped(""), Err(Fault::StandingEntry(VerifiedEntry::Scope)));
    check(&scoped("tail-call-global r3.. 0 k0"), Err(Fault::StandingEntry(VerifiedEntry::Scope)));
    check(&scoped("return-values r0 0"), Err(Fault::StandingEntry(VerifiedEntry::Scope)));
    check(&scoped("set-values r0.. 1 \n return-all"), Err(Fault::StandingEntry(VerifiedEntry::Scope)));
    check(&scoped("bind-list r0 r1 \n pop-control 1"), Ok(()));
    check(&scoped("push-mask r2.. r0 \n bind-list r0 r1"), found("a scope", Some(VerifiedEntry::Mask)));
    check("load-nil r0.. 2 \n bind-list r0 r1 \n return r0", found("a scope", None));
    check(&scoped("enter-cleanup"), found("a cleanup", Some(VerifiedEntry::Scope)));
    check(&scoped("end-cleanup"), found("a running cleanup", Some(VerifiedEntry::Scope)));
    check(&scoped("push-handlers r2.. r0 \n pop-control 2"), Ok(()));
    check(&scoped("jump-if-nil r0 L1 \n pop-control 1 \n L1:"), Err(Fault::PathsDisagree));
    check(&scoped("L1: push-scope r2.. \n loop L1"), Err(Fault::PathsDisagree));
    check(&"push-scope r0.. \n".repeat(MAX_CONTROL + 1), Err(Fault::ControlDepth));
    let full = "push-scope r0.. \n".repeat(MAX_CONTROL);
    check(&format!("{full} pop-control {MAX_CONTROL} \n return-values r0 0"), Ok(()));
}

#[test]
fn v9_bindings_are_undone_by_the_frame_that_made_them() {
    let bound = |code: &str| format!("load-nil r0.. 2 \n bind r0 k0 \n {code} \n return r0");
    check(&bound("unbind 1"), Ok(()));
    check(&bound("unbind 2"), Err(Fault::UnbindCount(2)));
    check(&bound(""), Err(Fault::StandingBindings(1)));
    check(&bound("tail-call-global r3.. 0 k0"), Err(Fault::StandingBindings(1)));
    check(&bound("jump-if-nil r0 L1 \n unbind 1 \n L1:"), Err(Fault::PathsDisagree));
    // Popping undoes what was bound since the push, no more and no less.
    check(&bound("push-scope r2.. \n bind r0 k0 \n pop-control 1 \n unbind 1"), Ok(()));
    check(&bound("push-scope r2.. \n unbind 1"), Err(Fault::UnbindCount(1)));
    check(&bound("push-scope r2.. \n pop-control 1 \n unbind 2"), Err(Fault::UnbindCount(2)));
    // The end of a scope undoes the bindings of a list.
    let list = |code: &str| bound(&format!("push-scope r2.. \n bind r0 k0 \n bind-list r0 r1 \n {code}"));
    check(&list("bind r0 k0 \n unbind 1 \n pop-control 1 \n unbind 1"), Ok(()));
    check(&list("unbind 1"), Err(Fault::UnbindCount(1)));
}

#[test]
fn v9_cleanups_run() {
    let found = |expected, found| Err(Fault::Entry { expected, found });
    let cleanup = |code: &str| format!("load-nil r0.. 2 \n push-cleanup r2.. L1 \n {code} \n return r0");
    check(&cleanup("enter-cleanup \n L1: end-cleanup"), Ok(()));
    check(&cleanup("bind r0 k0 \n unbind 1 \n enter-cleanup \n L1: end-cleanup"), Ok(()));
    let popped = found("an entry that may be popped", Some(VerifiedEntry::Cleanup));
    check(&cleanup("pop-control 1 \n L1: end-cleanup"), popped);
    let popped = found("an entry that may be popped", Some(VerifiedEntry::RunningCleanup));
    check(&cleanup("enter-cleanup \n L1: pop-control 1"), popped);
    check(
        &cleanup("enter-cleanup \n L1: return r0"),
        Err(Fault::StandingEntry(VerifiedEntry::RunningCleanup)),
    );
    check(&cleanup("L1: return r0"), Err(Fault::PathsDisagree));
    check(&cleanup("bind r0 k0 \n enter-cleanup \n L1: end-cleanup"), Err(Fault::StandingBindings(1)));
    check(&cleanup("enter-cleanup \n L1: bind r0 k0 \n end-cleanup"), Err(Fault::StandingBindings(1)));
    check(
        &cleanup("enter-cleanup \n L1: enter-cleanup"),
        found("a cleanup", Some(VerifiedEntry::RunningCleanup)),
    );
    // Code for unwinding only does not go on after its end; code for the normal way does.
    let apart = "enter-cleanup \n end-cleanup \n return r0 \n L1: end-cleanup";
    check(&cleanup(apart), Ok(()));
}

#[test]
fn v9_registers_survive_a_cleanup_entered_in_the_normal_way() {
    let cleanup = |cleanup: &str| {
        format!("push-cleanup r4.. L1 \n load-nil r0.. 6 \n enter-cleanup \n L1: {cleanup} \n end-cleanup \n")
    };
    // The cleanup itself may have been reached before the register was written.
    check(&format!("{} return r0", cleanup("move r1 r0")), Err(Fault::Unassigned(0)));
    check(&format!("{} return r0", cleanup("")), Ok(()));
    check(&format!("{} return r5", cleanup("")), Ok(()));
    check(&format!("{} return r5", cleanup("call-global r4.. 0 want 1 k0")), Err(Fault::Unassigned(5)));
    check(&format!("{} return r3", cleanup("call-global r4.. 0 want 1 k0")), Ok(()));
    check(&format!("{} return r3", cleanup("call-global r3.. 0 want 1 k0")), Err(window(3, 4)));
    check(&format!("{} return r0", cleanup("load-true r2 \n make-box r0 r2")), Err(Fault::Box(0)));
    // A register that one of two paths through the cleanup destroys is unassigned afterwards.
    let branch = cleanup("load-true r3 \n jump-if-nil r3 L2 \n call-global r4.. 0 want 1 k0 \n L2:");
    check(&format!("{branch} return r5"), Err(Fault::Unassigned(5)));
    check(&format!("{branch} return r2"), Ok(()));
}

fn window(window: u8, entry: u8) -> Fault {
    Fault::WindowBelowEntry { window, entry }
}

#[test]
fn v10_landings_find_what_was_there_at_the_push() {
    // `r0` and `r1` are assigned before, `r3` and up while the entry stands.
    let caught = |code: &str| {
        format!(
            "load-nil r0.. 2 \n push-catch r3.. r0 want 2 L1 \n load-nil r2.. 8 \n {code} \n \
             pop-control 1 \n return r0 \n"
        )
    };
    let check_after =
        |code: &str, after: &str, expected| check(&format!("{} L1: {after}", caught(code)), expected);
    check_after("", "return-values r3.. 2", Ok(()));
    check_after("", "return r1", Ok(()));
    check_after("", "return r2", Err(Fault::Unassigned(2)));
    check_after("", "return r5", Err(Fault::Unassigned(5)));
    check_after("call-global r3.. 0 want 1 k0", "return r1", Ok(()));
    check_after("call-global r2.. 0 want 1 k0", "return r1", Err(window(2, 3)));
    check_after("push-scope r2.. \n pop-control 1", "return r1", Err(window(2, 3)));
    check_after("push-scope r6.. \n call-global r5.. 0 want 1 k0", "return r1", Err(window(5, 6)));
    check_after("bind r0 k0", "return r1", Ok(()));
    check_after("", "unbind 1", Err(Fault::UnbindCount(1)));
    check_after("", "pop-control 1", Err(Fault::PopCount(1)));
    // The register may have become a box when control lands, or not.
    check_after("make-box r1 r0", "return r1", Err(Fault::Unassigned(1)));
    check_after("make-box r1 r0 \n load-true r1", "return r1", Err(Fault::Unassigned(1)));
    check_after("push-scope r3.. \n make-box r1 r0 \n pop-control 1", "return r1", Err(Fault::Unassigned(1)));
    check_after("move r1 r0", "return r1", Ok(()));
}

#[test]
fn v10_handler_cases_land_with_case_and_condition() {
    let handled = |after: &str| {
        format!(
            "load-nil r0.. 9 \n push-handler-case r3.. k4 L1 \n pop-control 1 \n return r0 \n L1: {after}"
        )
    };
    check(&handled("return-values r3.. 2"), Ok(()));
    check(&handled("return r2"), Ok(()));
    check(&handled("return r5"), Err(Fault::Unassigned(5)));
    check(&handled("return-all"), Err(Fault::ValueList));
}

#[test]
fn v10_inner_landings_keep_outer_entries() {
    let nested = |after: &str| {
        format!(
            "load-true r0 \n push-scope r2.. \n push-catch r4.. r0 want 1 L1 \n pop-control 2 \n return r0 \n \
             L1: {after}"
        )
    };
    check(&nested("pop-control 1 \n return r4"), Ok(()));
    check(&nested("return r4"), Err(Fault::StandingEntry(VerifiedEntry::Scope)));
}

#[test]
fn v11_the_value_list_is_read_just_after_it_is_set() {
    let after = |code: &str, read: &str| format!("load-nil r0.. 4 \n {code} \n {read} \n return r0");
    for read in ["return-all", "get-values r0.. 2", "values-to-list r0", "throw r0 0"] {
        check(&after("", read), Err(Fault::ValueList));
        check(&after("set-values r0.. 3", read), Ok(()));
        check(&after("list-to-values r0", read), Ok(()));
        check(&after("call-global r4.. 0 want all k0", read), Ok(()));
        check(&after("call-global r4.. 0 want 1 k0", read), Err(Fault::ValueList));
        check(&after("set-values r0.. 1 \n call-global r4.. 0 want 2 k0", read), Err(Fault::ValueList));
        check(&after("set-values r0.. 1 \n move r1 r0", read), Ok(()));
        check(&after("set-values r0.. 1 \n add r1 r0 r0", read), Err(Fault::ValueList));
        check(&after("set-values r0.. 1 \n L1: loop-if-nil r0 L1", read), Err(Fault::ValueList));
        check(&after("jump-if-nil r0 L1 \n set-values r0.. 1 \n L1:", read), Err(Fault::ValueList));
        let cleanup =
            "push-cleanup r4.. L1 \n set-values r0.. 1 \n enter-cleanup \n L1: add r1 r0 r0 \n end-cleanup";
        check(&after(cleanup, read), Ok(()));
        let unset = "push-cleanup r4.. L1 \n enter-cleanup \n L1: set-values r0.. 1 \n end-cleanup";
        check(&after(unset, read), Err(Fault::ValueList));
    }
    let catch = |want: &str| {
        format!(
            "load-true r0 \n push-catch r1.. r0 want {want} L1 \n pop-control 1 \n return r0 \n \
             L1: return-all"
        )
    };
    check(&catch("all"), Ok(()));
    check(&catch("1"), Err(Fault::ValueList));
}
