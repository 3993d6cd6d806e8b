//! The playground: what it says of programs, and its page in a browser. The page is left out without Chromium
//! or without the module for it, which this command builds:
//! `cargo build -p esl-playground --target wasm32-unknown-unknown --target-dir target/playground`.

use std::io::{BufRead, BufReader, Write};
use std::net::TcpListener;
use std::path::Path;

use esl_conformance::folder::Folder;
use esl_playground::{EXAMPLES, Playground};
use serde_json::{Value, json};

use crate::browser::Browser;
use crate::say_left_out;

/// Runs a program to its end. Returns what it prints, and how it ends.
fn run(playground: &mut Playground) -> (String, String) {
    let mut printed = String::new();
    loop {
        let step = playground.step(1_000_000);
        for piece in step["pieces"].as_array().expect("a list") {
            printed.push_str(piece["text"].as_str().expect("a text"));
        }
        if let Some(ended) = step["ended"].as_str() {
            return (printed, ended.into());
        }
    }
}

#[test]
fn the_examples_of_the_playground_do_what_they_say() {
    let mut playground = Playground::default();
    for (title, text) in EXAMPLES {
        let begun = playground.begin(text, 0, &[]);
        assert_eq!((&begun["runs"], &begun["diagnostics"]), (&json!(true), &json!([])), "{title}");
        if title == "Without an end" {
            assert_eq!(playground.step(100_000)["ended"], Value::Null);
            playground.stop();
        }
        let (printed, ended) = run(&mut playground);
        let (words, how) = match title {
            "A deadlock" => ("waits for resource CAMERA, held by task FILM", "Deadlocked"),
            "Failure and recovery" => ("Failure :VALVE-STUCK, no recovery available.", "Failed."),
            "A race of two tasks" => (":PICTURE-TAKEN", "Ended."),
            "Without an end" => ("stopped after ", "Stopped."),
            _ => ("", "Ended."),
        };
        assert!(printed.contains(words) && ended.starts_with(how), "{title}: {printed}\n{ended}");
        assert!(playground.timeline().ends_with("</svg>\n"), "{title}");
    }
}

#[test]
fn the_playground_counts_places_as_a_page_does() {
    let found = Playground::default().check("(print \"\u{1f680}\u{e9}\")\n(print (drvie))");
    let found = &found["diagnostics"][0];
    assert_eq!(found["code"], "undefined-function");
    let place = ["start", "end", "line", "column"].map(|key| found[key].as_u64());
    assert_eq!(place, [Some(22), Some(27), Some(2), Some(9)]);
    // Macros that do not come to an end are given up, and so is a program that prints for ever.
    let endless = Playground::default().check("(defmacro endless () (loop)) (endless)");
    assert!(
        endless["diagnostics"][0]["message"].as_str().is_some_and(|text| text.contains("macros")),
        "{endless}"
    );
    let mut playground = Playground::default();
    playground.begin("(loop (princ \"0123456789\"))", 0, &[]);
    assert!(run(&mut playground).1.starts_with("More than 1024 KiB were printed"));
}

/// Serves the page of a site to a browser, at an address that is returned, until the tests end.
fn serve(module: Vec<u8>) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("there are ports");
    let address = listener.local_addr().expect("it has one");
    let site = esl_conformance::root().join("docs/site");
    let page = "<!doctype html><meta charset=\"utf-8\"><link rel=\"stylesheet\" href=\"site.css\">
        <div id=\"esl-playground\"></div><script src=\"playground.js\"></script><script src=\"highlight-esl.js\"></script>";
    std::thread::spawn(move || {
        for connection in listener.incoming() {
            let Ok(mut connection) = connection else { return };
            let mut lines = BufReader::new(&connection).lines().map_while(Result::ok);
            let request = lines.next().unwrap_or_default();
            lines.take_while(|line| !line.is_empty()).for_each(drop);
            let name = request.split(' ').nth(1).unwrap_or_default().trim_start_matches('/').to_owned();
            let (kind, body) = match &*name {
                "" => ("text/html", page.into()),
                "esl-playground.wasm" => ("application/wasm", module.clone()),
                _ if name.ends_with(".css") => {
                    ("text/css", std::fs::read(site.join(name)).unwrap_or_default())
                }
                _ => ("text/javascript", std::fs::read(site.join(name)).unwrap_or_default()),
            };
            let length = body.len();
            let head = format!(
                "HTTP/1.1 200 OK\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n"
            );
            // A browser that goes away in the middle asks again.
            drop(connection.write_all(head.as_bytes()).and_then(|()| connection.write_all(&body)));
        }
    });
    format!("http://{address}/")
}

#[test]
fn the_page_runs_programs_and_stops_them() {
    let target = Path::new(crate::ESLVM).ancestors().nth(2).expect("the target folder");
    let module = target.join("playground/wasm32-unknown-unknown/debug/esl_playground.wasm");
    let Ok(module) = std::fs::read(module) else {
        return say_left_out("the module of the playground is not built");
    };
    let folder = Folder::new("playground");
    let Some(mut browser) = Browser::start(&folder) else {
        return say_left_out("there is no Chromium");
    };
    browser.ask("Page.navigate", json!({ "url": serve(module) }));
    browser.until("document.getElementById('pg-status')?.textContent === 'Ready.'");
    let status = "document.getElementById('pg-status').textContent";
    let output = "document.getElementById('pg-output').textContent";
    fn type_text(browser: &mut Browser, text: &str) {
        browser.value(&format!(
            "text = document.getElementById('pg-text'), text.value = {}, text.dispatchEvent(new Event('input')), true",
            json!(text)
        ));
    }
    let press = |browser: &mut Browser, button: &str| {
        browser.value(&format!("document.getElementById('pg-{button}').click(), true"));
    };

    press(&mut browser, "run");
    browser.until(&format!("{status}.startsWith('Ended. 1 task')"));
    browser.until(&format!("{output}.startsWith('Hello, world!')"));
    browser.until("document.querySelector('#pg-timeline img')?.naturalWidth === 1200");

    // Faults are underlined during typing, and reported again by a run.
    type_text(&mut browser, "(print (drvie))\n");
    browser.until("document.querySelector('.mark-error, .mark-warning')?.textContent === 'drvie'");
    browser.until("document.querySelector('#pg-diagnostics li button')?.textContent === '1:9'");

    // A run without an end stops, and cleans up.
    type_text(&mut browser, "(unwind-protect (loop) (princ \"cleaned up <b>\"))");
    press(&mut browser, "run");
    browser.until(&format!("/Running … [\\d,]+ ticks/.test({status})"));
    press(&mut browser, "stop");
    browser.until(&format!("{status}.startsWith('Stopped.')"));
    browser.until(&format!("{output} === 'cleaned up <b>'"));

    // So does compiling, and the page goes on.
    type_text(&mut browser, "(defmacro endless () (loop)) (endless)");
    press(&mut browser, "run");
    browser.value("setTimeout(() => document.getElementById('pg-stop').click(), 100), true");
    browser
        .until("document.getElementById('pg-stop').disabled && !document.getElementById('pg-run').disabled");
    type_text(&mut browser, "(print (+ 1 2))");
    press(&mut browser, "run");
    browser.until(&format!("{status}.startsWith('Ended.') && {output}.trim() === '3'"));
    assert!(browser.complaints.is_empty(), "{:?}", browser.complaints);
}
