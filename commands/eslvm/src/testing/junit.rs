//! Reports of tests in JUnit's form, which services for continuous integration read.

use std::sync::PoisonError;

use super::Run;

/// Returns the report, a document of XML.
pub(super) fn report(runs: &[Run<'_>]) -> String {
    let mut cases = String::new();
    let mut failures = 0;
    for run in runs {
        let result = run.result.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(finished) = result.as_ref() else { continue };
        let (name, file) = (escaped(&run.test.name), escaped(&run.file()));
        let time = finished.time.as_secs_f64();
        let head = format!("    <testcase name=\"{name}\" classname=\"{file}\" time=\"{time:.3}\"");
        cases += &match finished.failure() {
            None => format!("{head}/>\n"),
            Some((why, output)) => {
                failures += 1;
                let (why, output) = (escaped(why), escaped(&output));
                format!("{head}>\n      <failure message=\"{why}\">{output}</failure>\n    </testcase>\n")
            }
        };
    }
    let counts = format!("tests=\"{}\" failures=\"{failures}\"", runs.len());
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites {counts}>\n  <testsuite name=\"eslvm test\" \
         {counts}>\n{cases}  </testsuite>\n</testsuites>\n"
    )
}

/// Returns a text as XML has it; characters that XML cannot have become a question mark.
fn escaped(text: &str) -> String {
    let mut escaped = String::new();
    for c in text.chars() {
        match c {
            '&' => escaped += "&amp;",
            '<' => escaped += "&lt;",
            '>' => escaped += "&gt;",
            '"' => escaped += "&quot;",
            '\n' | '\t' => escaped.push(c),
            c if c.is_control() || matches!(c, '\u{FFFE}' | '\u{FFFF}') => escaped.push('?'),
            c => escaped.push(c),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::escaped;

    #[test]
    fn what_xml_cannot_have_is_escaped() {
        assert_eq!(escaped("a<b> & \"c\"\n\u{1b}[1m"), "a&lt;b&gt; &amp; &quot;c&quot;\n?[1m");
    }
}
