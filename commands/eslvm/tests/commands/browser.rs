//! A browser: Chromium, driven by its own protocol over pipes. It shows the page of the monitor. Without
//! Chromium, the tests are left out.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use esl_conformance::folder::Folder;
use serde_json::{Value, json};

use crate::operate::{Operated, until};
use crate::say_left_out;

/// A browser with one page.
pub(crate) struct Browser {
    child: Child,
    to: ChildStdin,
    from: BufReader<ChildStdout>,
    asked: u64,
    page: String,
    /// Errors and exceptions in the page.
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

    /// Makes the page so many pixels wide.
    fn resize(&mut self, width: u32) {
        let metrics = json!({ "width": width, "height": 900, "deviceScaleFactor": 1, "mobile": false });
        self.ask("Emulation.setDeviceMetricsOverride", metrics);
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
    browser.until("document.title === 'program.esl – ESL monitor'");
    browser.until("document.getElementById('alarm').textContent.startsWith('2 tasks wait for each other')");
    // Tasks that are alike have one row, with a link to a row for each. Links to holders have no address.
    browser.until("last.matching === 4 && last.rows.at(-1).count === 5000");
    browser.value("document.querySelector('#rows a[href]').click(), true");
    browser.until("last.matching === 5000 && document.getElementById('filter').value === 'task IDLER'");
    browser.value("location.hash = address('', true), true");
    browser.until("last.matching === 5003");
    browser.until("document.getElementById('t-failures').textContent.includes(':SLIP')");
    // Names in the program are text, even if they look like HTML.
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
    // Filters are links.
    browser.value("[...document.querySelectorAll('#filters a')].find(a => a.textContent.startsWith('in a circle')).click(), true");
    browser.until("last.matching === 2 && document.getElementById('filter').value === 'cycle'");
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

/// A program with names of all lengths, tasks that are alike, failures that were recovered from, and one that
/// was not.
const MISSION: &str = "
(define-input telecommand :capacity 4)
(defun slew (n) (fail :wheel-stuck n 'left))
(dotimes (i 5) (with-recovery-procedures ((:wheel-stuck (abort nil))) (slew (mod i 2))))
(dotimes (i 200) (spawn (:name 'wheel-watcher :daemon t) (sleep 3000)))
(dotimes (i 60) (spawn (:name (intern (format nil \"SENSOR-~d\" i)) :daemon t) (wait-for-event (make-event))))
(spawn (:name 'charging-of-batteries :daemon t) (loop (sleep 0.05)))
(wait-for-event telecommand)
(slew 9)";

/// Returns whether the heads of columns stand above their cells, and nothing is wider than the page.
const ALIGNED: &str = "(() => {
  const left = node => Math.round(node.getBoundingClientRect().left), shown = node => getComputedStyle(node).display !== 'none';
  const cells = document.querySelector('.row').children, heads = document.querySelector('.head').children;
  const columns = narrow.matches ? [0, 1, 2, 5] : [0, 1, 2, 3, 4, 5, 6];
  return columns.every(i => !shown(heads[i]) || left(heads[i]) === left(cells[i])) && document.documentElement.scrollWidth <= innerWidth;
})()";

#[test]
fn the_page_is_readable_at_any_width_and_keeps_the_end_of_the_run() {
    let folder = Folder::new("monitor_widths");
    let Some(mut browser) = Browser::start(&folder) else {
        return say_left_out("there is no Chromium");
    };
    let mut run = Operated::start(&folder, MISSION, &["--monitor"]);
    let address = run.said("; monitor, to command: ");
    browser.ask("Page.navigate", json!({ "url": address }));
    browser.until("last !== null && last.rows.some(row => row.count === 200)");
    // Recovered failures are not red, and equal failures share one card.
    browser.until("last.failed === 5 && !document.getElementById('f-failed-box').classList.contains('bad')");
    browser.until("document.querySelectorAll('#t-failures .card').length === 1");
    browser.until("document.querySelector('.card').textContent.includes(':WHEEL-STUCK')");
    browser.until("document.querySelector('.card').textContent.includes('5 times since')");
    // The picture of the program has its own style, which the policy of the page permits.
    browser.press("6");
    browser.until(
        "drawing !== null && drawing.querySelector('.source[data-name=slew] .count').textContent === '  ×5'",
    );
    browser.until("drawing.querySelector('.task.lit[data-name=charging-of-batteries]') !== null");
    browser.until("getComputedStyle(drawing.querySelector('.task.lit > rect')).strokeWidth === '2.5px'");
    browser.until("drawing.querySelector('.task.lit[data-name=main]') !== null");
    browser.until("drawing.querySelectorAll('.path.arrow.takes').length === 1 && view.mission === 'live'");
    // The only clause that takes it counts, too.
    browser.until(
        "drawing.querySelector(`[data-line='${drawing.querySelector('.path.arrow.takes').dataset.to}'] .count`).textContent === '  ×5'",
    );
    browser.press("2");
    browser.until("/^[0-9]+ s more$|^[0-9]+:[0-9]+ more$/.test(document.getElementById('row-' + last.rows.find(row => row.count === 200).n).children[3].textContent)");
    for width in [1400, 420] {
        browser.resize(width);
        browser.until(&format!("innerWidth === {width} && document.querySelectorAll('.row').length > 5"));
        // There are more rows than fit, so the table has a scroll bar.
        browser.until(
            "document.getElementById('scroll').scrollHeight > document.getElementById('scroll').clientHeight",
        );
        browser.until(ALIGNED);
        browser.until("[...document.querySelectorAll('.row > :nth-child(2)')].every(name => name.scrollWidth <= name.clientWidth)");
    }
    browser.resize(1400);
    browser.value(
        "$('signal-name').value = 'telecommand', act('signal', { input: 'telecommand', data: '1' }), true",
    );
    browser.until("document.body.classList.contains('ended') && $('pause').disabled");
    browser
        .until("$('alarm').textContent.startsWith('The run has ended with status 1: a failure or an abort')");
    browser.until("$('alarm').textContent.includes('A failure of cause :WHEEL-STUCK with 9, LEFT.')");
    browser.until("$('t-failures').textContent.includes('it has ended the task')");
    browser.press("6");
    browser.until("drawing.querySelectorAll('.path.arrow.ends').length === 1");
    browser.press("2");
    // The calls of the library are shown if they are wanted.
    browser.until("!$('library').checked && !$('t-failures').textContent.includes('ESL::%')");
    browser.value("$('library').focus(), $('library').click(), true");
    browser.until(
        "$('t-failures').textContent.includes('in ESL::%') && document.activeElement.id === 'library'",
    );
    for width in [420, 1400] {
        browser.resize(width);
        browser.until(&format!("innerWidth === {width}"));
        browser.until(ALIGNED);
    }
    assert_eq!(run.end(), Some(1));
    // It stays so when the run cannot be reached any more.
    std::thread::sleep(std::time::Duration::from_millis(300));
    browser.until(
        "$('alarm').textContent.startsWith('The run has ended with status 1') && last.rows.length > 5",
    );
    assert!(browser.complaints.is_empty(), "{:?}", browser.complaints);
}
