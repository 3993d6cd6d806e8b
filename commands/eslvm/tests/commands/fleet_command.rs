//! Agents whose name and connections the command line says: `--agent`, `--zenoh` and `--allow-fleet`.
#![cfg(unix)]

use std::process::Command;

use esl_conformance::folder::Folder;
use esl_conformance::process;

use crate::eslvm;
use crate::examples::free_port;
use crate::lines::make_certificates;
use crate::robots::Running;

/// An agent that works for others until it is ended.
const ROVER: &str = "(require :fleet)
(defun say (value) (format t \"~s~%\" value) (finish-output))
(fleet:join ()
  (fleet:offer (add a b) (+ a b))
  (say (fleet:name))
  (sleep 1000))";

/// An agent that asks another one. Each line of its input asks again.
const BASE: &str = "(require :fleet)
(defun say (value) (format t \"~s~%\" value) (finish-output))
(say (handler-case (fleet:join (:timeout 20)
                     (fleet:wait-for-agent 'rover-1 :timeout 20)
                     (list (fleet:name) (fleet:request 'rover-1 (add 3 4))))
       (failure (f) (cons (failure-cause f) (failure-arguments f)))))";

/// Starts a program with options of `eslvm run`.
fn start(folder: &Folder, text: &str, options: &[&str]) -> Running {
    folder.file("main.esl", text);
    Running::start(eslvm(&[&["run"], options, &["main.esl"]].concat()).current_dir(folder.path()))
}

#[test]
fn the_command_names_an_agent_and_its_connections() {
    let folders = [Folder::new("fleet-named"), Folder::new("fleet-asking")];
    let port = free_port();
    let file =
        format!("// The base.\n{{ mode: 'router', listen: {{ endpoints: ['tcp/127.0.0.1:{port}'] }} }}");
    folders[0].file("zenoh.json5", file);
    let rover = start(&folders[0], ROVER, &["--agent", "rover-1", "--zenoh", "zenoh.json5", "--allow-fleet"]);
    assert_eq!(rover.line(), "ROVER-1");
    let endpoint = format!("tcp/127.0.0.1:{port}");
    let ask = |options: &[&str]| {
        let options = [&["--agent", "base", "--zenoh", &endpoint], options].concat();
        start(&folders[1], BASE, &options).line()
    };
    assert_eq!(ask(&["--allow-fleet=esl,other"]), "(BASE 7)");
    // The right to a fleet is not one to the network, nor the other way round.
    let denied = "(:PERMISSION-DENIED :FLEET \"esl\" \"--allow-fleet=esl\")";
    assert_eq!(ask(&["--allow-fleet=other"]), denied);
    assert_eq!(ask(&["--allow-net"]), denied);
    let elsewhere = BASE.replace("(:timeout 20)", "('base :connect \"tcp/127.0.0.1:1\")");
    let refused = start(&folders[1], &elsewhere, &["--zenoh", &endpoint, "--allow-fleet"]).line();
    assert_eq!(refused, "(:PERMISSION-DENIED :NET \"127.0.0.1:1\" \"--allow-net=127.0.0.1:1\")");
}

#[test]
fn an_agent_without_a_name_or_a_valid_configuration_is_refused() {
    let folder = Folder::new("fleet-refused");
    let run = |options: &[&str]| {
        folder.file("main.esl", BASE);
        let mut command = eslvm(&[&["run"], options, &["main.esl"]].concat());
        process::run(command.current_dir(folder.path()), "")
    };
    let nameless = run(&["--zenoh", "tcp/127.0.0.1:1", "--allow-fleet"]);
    assert!(nameless.output.contains("this agent has no name"), "{}{}", nameless.output, nameless.errors);
    for (file, part) in [
        ("{ lissten: {} }", "unknown field `lissten`"),
        ("{ listen: { endpoints: ['ws/a:1'] } }", "unknown protocol `ws`: expected one of tcp, tls, udp"),
        (
            "{ transport: { auth: { usrpwd: { user: 'a', password: 'b' } } } }",
            "`transport/auth/usrpwd` has no",
        ),
        ("{ mode: 'peer'", "zenoh.json5: invalid configuration"),
    ] {
        folder.file("zenoh.json5", file);
        let refused = run(&["--agent", "a", "--zenoh", "zenoh.json5"]);
        assert_eq!(refused.status, Some(2), "{}", refused.errors);
        assert!(refused.errors.contains(part), "{}", refused.errors);
    }
    for (options, part) in [
        (["--agent", "a/b"], "`a/b` is not the name of an agent"),
        (["--zenoh", "none.json5"], "none.json5 cannot be read"),
    ] {
        let refused = run(&options);
        assert_eq!(refused.status, Some(2));
        assert!(refused.errors.contains(part), "{}", refused.errors);
    }
}

/// Returns a configuration by which an agent speaks TLS, and shows the certificate of this name.
fn tls(endpoints: &str, certificate: &str) -> String {
    format!(
        "{{ {endpoints}, transport: {{ link: {{ tls: {{ enable_mtls: true, root_ca_certificate: 'ca.pem',
             listen_certificate: '{certificate}.pem', listen_private_key: '{certificate}.key',
             connect_certificate: '{certificate}.pem', connect_private_key: '{certificate}.key' }} }} }} }}"
    )
}

/// Makes an authority and its certificates of a server and of an agent `rover-1`, and the certificate of
/// `other`, which it has not signed. Returns false, after saying so, if there is nothing to make them with.
fn make_all_certificates(folder: &Folder) -> bool {
    let openssl = |arguments: &str| {
        let arguments = arguments.split_whitespace();
        let made = Command::new("openssl").args(arguments).current_dir(folder.path()).output();
        made.is_ok_and(|made| made.status.success())
    };
    let key = "-newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes";
    let are_made = make_certificates(folder)
        && openssl(&format!("req {key} -x509 -days 3 -subj /CN=other -keyout other.key -out other.pem"))
        && openssl(&format!("req {key} -subj /CN=rover-1 -keyout rover-1.key -out rover-1.csr"))
        && openssl(
            "x509 -req -in rover-1.csr -CA ca.pem -CAkey ca.key -set_serial 3 -days 3 -extfile names -out rover-1.pem",
        );
    if !are_made {
        crate::say_left_out("it needs `openssl`");
    }
    are_made
}

#[test]
fn agents_prove_by_certificates_who_they_are() {
    let folder = Folder::new("fleet-tls");
    if !make_all_certificates(&folder) {
        return;
    }
    let port = free_port();
    let listen = format!("mode: 'router', listen: {{ endpoints: ['tls/127.0.0.1:{port}'] }}");
    let connect = format!("connect: {{ endpoints: ['tls/127.0.0.1:{port}'] }}");
    folder.file("rover.json5", tls(&listen, "server"));
    folder.file("base.json5", tls(&connect, "server"));
    folder.file("stranger.json5", tls(&connect, "other"));
    let options = ["--allow-fleet", "--agent"];
    let rover = start(&folder, ROVER, &[&options[..], &["rover-1", "--zenoh", "rover.json5"]].concat());
    assert_eq!(rover.line(), "ROVER-1");
    let text = BASE.replace("(:timeout 20)", "()");
    let ask = |configuration: &str| {
        start(&folder, &text, &[&options[..], &["base", "--zenoh", configuration]].concat()).line()
    };
    assert_eq!(ask("base.json5"), "(BASE 7)");
    // The authority did not sign this certificate; a session without TLS shows none.
    let strangers = [ask("stranger.json5"), ask(&format!("tcp/127.0.0.1:{port}"))];
    assert!(strangers[0].contains("each side has to accept the certificate"), "{}", strangers[0]);
    assert!(strangers.iter().all(|line| line.starts_with("(:CONNECTION-REFUSED ")), "{strangers:?}");
    // A program that names the configuration needs the rights to its places.
    let named = BASE.replace("(:timeout 20)", "('base :config \"base.json5\")");
    let denied = start(&folder, &named, &["--allow-fleet"]).line();
    let address = format!("127.0.0.1:{port}");
    assert_eq!(denied, format!("(:PERMISSION-DENIED :NET \"{address}\" \"--allow-net={address}\")"));
    assert_eq!(start(&folder, &named, &["--allow-net=127.0.0.1"]).line(), "(BASE 7)");
    let elsewhere = std::fs::read_to_string(folder.path().join("base.json5")).expect("it is there");
    folder.file("base.json5", elsewhere.replace("'ca.pem'", "'/etc/ssl/none.pem'"));
    let denied = start(&folder, &named, &["--allow-net=127.0.0.1"]).line();
    assert!(denied.starts_with("(:PERMISSION-DENIED :READ \"/etc/ssl/none.pem\""), "{denied}");
}

/// An agent that says who is there to it.
const WITNESS: &str = "(require :fleet)
(fleet:join ()
  (fleet:offer (who) (fleet:agents))
  (format t \"~s~%\" (fleet:name))
  (finish-output)
  (sleep 1000))";

/// An agent that asks the other one, and goes on.
const ASKING: &str = "(require :fleet)
(fleet:join ()
  (fleet:wait-for-agent 'base :timeout 20)
  (format t \"~s~%\" (handler-case (fleet:request 'base (who) :timeout 2 :cancel-timeout 0)
                     (failure (f) (failure-cause f))))
  (finish-output)
  (sleep 1000))";

/// The access control of the manual: an agent whose certificate has another name is not heard.
#[test]
fn a_router_lets_an_agent_speak_in_its_own_name_only() {
    let folder = Folder::new("fleet-access");
    if !make_all_certificates(&folder) {
        return;
    }
    let chapter = esl_conformance::root().join("docs/manual/fleets.md");
    let chapter = std::fs::read_to_string(chapter).expect("the chapter is there");
    let start_of = chapter.find("  access_control: {").expect("the chapter has the example");
    let control = chapter[start_of..].split("```").next().expect("the example ends").trim_end();
    let port = free_port();
    let listen = format!("mode: 'router', listen: {{ endpoints: ['tls/127.0.0.1:{port}'] }}");
    folder.file("base.json5", tls(&format!("{}, {listen}", control.trim_end_matches(',')), "server"));
    let connect = format!("connect: {{ endpoints: ['tls/127.0.0.1:{port}'] }}");
    folder.file("rover.json5", tls(&connect, "rover-1"));
    let join = |text: &str, name: &str, configuration: &str| {
        start(&folder, text, &["--allow-fleet", "--agent", name, "--zenoh", configuration])
    };
    let base = join(WITNESS, "base", "base.json5");
    assert_eq!(base.line(), "BASE");
    let impostor = join(ASKING, "rover-2", "rover.json5");
    assert_eq!(impostor.line(), ":TIMEOUT");
    let rover = join(ASKING, "rover-1", "rover.json5");
    assert_eq!(rover.line(), "(ROVER-1)");
}
