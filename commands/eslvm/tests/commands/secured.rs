//! Runs that other machines may reach: over TLS, and not otherwise.

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::eslvm;
use crate::lines::make_certificates;
use crate::operate::{Operated, request};

const PROGRAM: &str = "(defvar *speed* 3) (read-line *standard-input* nil)";

/// Asks for the figures over HTTP with TLS.
const ASK: &str = "
(require :http)
(handler-case
    (multiple-value-bind (body status)
        (http:get (format nil \"https://localhost:~a/~a\" (first (command-line-arguments))
                                                        (second (command-line-arguments)))
                  :ca-file \"ca.pem\")
      (print (list status (not (null (or (search \"esl_ticks_total\" body) (search \"<title>\" body)))))))
  (error (e) (print (failure-cause e))))";

#[test]
fn what_other_machines_reach_asks_for_a_certificate() {
    let folder = Folder::new("secured-refusals");
    let program = folder.file("program.esl", PROGRAM);
    for option in [&["--metrics", "0.0.0.0:0"][..], &["--monitor=0.0.0.0:0"], &["--listen", "0.0.0.0:0"]] {
        let refused = process::run(&mut eslvm(&[&["run"], option, &[&program]].concat()), "");
        assert_eq!(refused.status, Some(2), "{option:?}");
        let expected = "eslvm: others could read the traffic at 0.0.0.0:0: use --certificate FILE --key FILE, \
                        or a port of 127.0.0.1, which others reach by ssh -L\n";
        assert_eq!(refused.errors, expected, "{option:?}");
    }
    let none = folder.join("none.pem");
    for (options, reason) in [
        (&["--metrics", "0", "--certificate", &none][..], "--key <FILE>"),
        (&["--metrics", "0", "--certificate", &none, "--key", &none], "none.pem`: "),
        (&["--metrics", "0", "--certificate", &program, "--key", &program], "there is no certificate in it"),
    ] {
        let refused = process::run(&mut eslvm(&[&["run"], options, &[&program]].concat()), "");
        assert_eq!(refused.status, Some(2), "{options:?}");
        assert!(refused.errors.contains(reason), "{}", refused.errors);
    }
}

#[test]
fn operators_and_figures_are_reached_over_tls() {
    let folder = Folder::new("secured");
    if !make_certificates(&folder) {
        crate::say_left_out("it needs `openssl`");
        return;
    }
    let secret = "patch-0123456789";
    let secrets = folder.file("secrets", format!("patch {secret}\n"));
    use std::os::unix::fs::PermissionsExt;
    std::fs::set_permissions(&secrets, std::fs::Permissions::from_mode(0o600)).expect("it can be set");
    let [certificate, key, authority] = ["server.pem", "server.key", "ca.pem"].map(|name| folder.join(name));
    let options = ["--metrics", "0.0.0.0:0", "--monitor=0.0.0.0:0", "--listen", "0.0.0.0:0"];
    let options =
        [&options[..], &["--secrets", &secrets, "--certificate", &certificate, "--key", &key]].concat();
    let mut run = Operated::start(&folder, PROGRAM, &options);
    let port_of =
        |address: &str| address.split(['/', '#']).next().unwrap_or_default().replace("0.0.0.0:", "");
    let metrics = port_of(&run.said("; metrics at https://"));
    let monitor = port_of(&run.said("; monitor at https://"));
    let listener = port_of(&run.said("; operators attach with eslvm attach --tls "));
    let address = format!("localhost:{listener}");
    let attach = |options: &[&str]| {
        let mut command = eslvm(&[&["attach"], options, &[&address]].concat());
        process::run(command.env("ESL_SECRET", secret), "(list *speed* (+ 1 2))\n:data\n")
    };
    let attached = attach(&["--ca-file", &authority]);
    assert_eq!(
        (attached.output.as_str(), attached.status),
        ("(3 3)\nNo relations, locks or inputs.\n", Some(0)),
        "{}",
        attached.errors
    );
    // The system does not trust this authority, and the run does not answer plain text.
    let refused = attach(&["--tls"]);
    assert_eq!((refused.status, &*refused.output), (Some(2), ""), "{}", refused.errors);
    let plain = attach(&[]);
    assert_ne!(plain.status, Some(0));
    assert_eq!(plain.output, "");
    // So do the servers of HTTP, to which any name may lead now.
    folder.file("ask.esl", ASK);
    for (port, path, expected) in [(&metrics, "metrics", "(200 T)"), (&monitor, "", "(200 T)")] {
        let local = format!("127.0.0.1:{port}");
        assert!(!request(&local, "GET", &format!("/{path}"), "", "").contains("200 OK"));
        let mut ask = eslvm(&["run", "--allow-net=localhost", "ask.esl", port, path]);
        let asked = process::run(ask.current_dir(folder.path()), "");
        assert_eq!(asked.output.trim(), expected, "{}", asked.errors);
    }
    assert_eq!(run.end(), Some(0));
}
