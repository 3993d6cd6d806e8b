//! A browser: Chromium, driven by its own protocol over pipes. It shows the page of the monitor. Without
//! Chromium, the tests are left out.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use serde_json::{Value, json};

use crate::folder::Folder;
use crate::operate::{Operated, until};
use crate::say_left_out;

/// A browser with one page.
pub(crate) struct Browser {
    child: Child,
    to: ChildStdin,
    from: BufReader<ChildStdout>,
    asked: u64,
    page: String,
    /// What went wrong in the page.
    pub(crate) complaints: Vec<Value>,
}

impl Drop for Browser {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

impl Browser {
    /// Starts the browser; `None` if there is none.
    pub(crate) fn start(folder: &Folder) -> Option<Browser> {
        Command::new("chromium")
            .arg("--version")
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status()
            .ok()?;
        let profile = format!("--user-data-dir={}", folder.join("profile"));
        // The protocol is read from descriptor 3 and written to descriptor 4.
        let mut child = Command::new("sh")
            .args(["-c", "exec \"$0\" \"$@\" 3<&0 4>&1 0</dev/null 1>/dev/null", "chromium", "--headless"])
            .args(["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"])
            .args([
                "--disable-background-networking",
                "--disable-component-update",
                "--disable-dev-shm-usage",
            ])
            .args(["--window-size=1300,800", "--remote-debugging-pipe", &profile, "about:blank"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        let (to, from) = (child.stdin.take()?, BufReader::new(child.stdout.take()?));
        let mut browser = Browser { child, to, from, asked: 0, page: String::new(), complaints: Vec::new() };
        let target = browser.ask("Target.createTarget", json!({ "url": "about:blank" }));
        let session =
            browser.ask("Target.attachToTarget", json!({ "targetId": target["targetId"], "flatten": true }));
        browser.page = session["sessionId"].as_str().expect("the page is attached to").into();
        browser.ask("Runtime.enable", json!({}));
        browser.ask("Log.enable", json!({}));
        Some(browser)
    }

    /// Asks the page something, or the browser while there is no page.
    pub(crate) fn ask(&mut self, method: &str, parameters: Value) -> Value {
        self.asked += 1;
        let mut question = json!({ "id": self.asked, "method": method, "params": parameters });
        if !self.page.is_empty() {
            question["sessionId"] = self.page.clone().into();
        }
        self.to.write_all(format!("{question}\0").as_bytes()).expect("the browser listens");
        loop {
            let mut bytes = Vec::new();
            self.from.read_until(0, &mut bytes).expect("the browser answers");
            assert_eq!(bytes.pop(), Some(0), "the browser has ended");
            let answer: Value = serde_json::from_slice(&bytes).expect("it is JSON");
            if answer["id"] == self.asked {
                assert!(answer["error"].is_null(), "{method}: {answer}");
                return answer["result"].clone();
            }
            if answer["method"] == "Runtime.exceptionThrown" {
                self.complaints.push(answer["params"].clone());
            }
        }
    }

    /// Returns the value of a script in the page.
    pub(crate) fn value(&mut self, script: &str) -> Value {
        let parameters = json!({ "expression": script, "returnByValue": true });
        self.ask("Runtime.evaluate", parameters)["result"]["value"].clone()
    }

    /// Waits until a script has the value true.
    pub(crate) fn until(&mut self, script: &str) {
        until(script, || self.value(script) == true);
    }

    fn press(&mut self, key: &str) {
        self.value(&format!("dispatchEvent(new KeyboardEvent('keydown', {{ key: '{key}' }})), true"));
    }
}

#[test]
fn the_page_shows_a_run_and_commands_it() {
    let folder = Folder::new("monitor_browser");
    let Some(mut browser) = Browser::start(&folder) else {
        return say_left_out("there is no Chromium");
    };
    let program =
        "(define-resource arm) (define-resource leg) (define-property mode ()) (assert '(mode calm))
        (assert '(note \"Ridge\" 1))
        (spawn (:name 'left :daemon t) (with-resource (arm) (sleep 0.1) (with-resource (leg) nil)))
        (spawn (:name 'right :daemon t) (with-resource (leg) (sleep 0.1) (with-resource (arm) nil)))
        (spawn (:name '|<img src=x onerror=alert(1)>| :daemon t) (fail :slip \"<b>\"))
        (dotimes (i 5000) (spawn (:name 'idler :daemon t) (wait-for-event (make-event))))
        (read-line *standard-input* nil)";
    let mut run = Operated::start(&folder, program, &["--monitor"]);
    let address = run.said("; monitor, to command: ");
    browser.ask("Page.navigate", json!({ "url": address }));
    browser.until(
        "last !== null && last.total === 5003 && document.querySelectorAll('.row.cycle').length === 2",
    );
    browser.until("document.getElementById('alarm').textContent.startsWith('2 tasks wait for each other')");
    browser.until("document.getElementById('t-failures').textContent.includes(':SLIP')");
    // What the program calls itself is text.
    browser.until("document.querySelectorAll('img, b b').length === 0 && document.querySelectorAll('.row').length < 130");
    browser.value("document.getElementById('scroll').scrollTop = 1e9, true");
    browser.until("last.from > 4800 && last.rows.at(-1).name === 'task IDLER'");
    // By keys: filter, choose, and abort.
    browser.press("/");
    browser.until("document.activeElement.id === 'filter'");
    browser.value("filter = document.getElementById('filter'), filter.value = 'task left', filter.blur(), filtered(), true");
    browser.until("last.matching === 2 && last.from === 0");
    browser.press("ArrowDown");
    browser.until("document.getElementById('t-task').textContent.includes('waits for resource LEG')");
    // Where it waits for another, that one is a key away, and back.
    browser.press("h");
    browser.until("document.getElementById('t-task').textContent.includes('waits for resource ARM')");
    browser.press("h");
    browser.until("document.getElementById('t-task').textContent.includes('waits for resource LEG')");
    browser.press("a");
    browser.until("document.getElementById('abort').textContent === 'Really abort it'");
    browser.press("a");
    browser
        .until("last.cycle === 0 && document.getElementById('t-task').textContent.includes('It has ended')");
    // Facts are shown as they are, at a click on their relation.
    browser.value("[...document.querySelectorAll('#t-data a')].find(a => a.textContent.startsWith('note/')).click(), true");
    browser.until("document.getElementById('t-data').textContent.includes('(NOTE \"Ridge\" 1)')");
    assert!(browser.complaints.is_empty(), "{:?}", browser.complaints);
    assert_eq!(run.end(), Some(0));
    browser.until("document.getElementById('alarm').textContent.startsWith('The run has ended')");
}
