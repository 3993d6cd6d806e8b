//! Requests to a host: a line of JSON for each, and for each answer.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::Path;

use esl_bytecode::datum::Datum;
use esl_compiler::reader::{BareEnvironment, read_datum};
use serde_json::{Value, json};

use super::error::AgentError;

/// Longest request in bytes.
pub(crate) const LONGEST_REQUEST: u64 = 16 << 20;

/// A request to a host.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum HostRequest {
    /// Signals an input of an agent. Answered when the signal is in the agent's journal.
    Send {
        /// Name of the agent.
        agent: String,
        /// Name of the input, in any case.
        input: String,
        /// Arguments of the signal, as programs write data.
        data: String,
    },
    /// Starts an agent that is new, was stopped, or has failed.
    Start(String),
    /// Stops an agent, until it is started.
    Stop(String),
    /// Ends the run of an agent, with its cleanups.
    End(String),
    /// Lists all agents, or one.
    List(Option<String>),
}

impl HostRequest {
    /// Returns the line that asks for it.
    fn to_json(&self) -> Value {
        match self {
            HostRequest::Send { agent, input, data } => {
                json!({ "do": "send", "agent": agent, "input": input, "data": data })
            }
            HostRequest::Start(agent) => json!({ "do": "start", "agent": agent }),
            HostRequest::Stop(agent) => json!({ "do": "stop", "agent": agent }),
            HostRequest::End(agent) => json!({ "do": "end", "agent": agent }),
            HostRequest::List(agent) => json!({ "do": "list", "agent": agent }),
        }
    }

    /// Reads a line.
    ///
    /// # Errors
    /// [`AgentError::Request`].
    pub(crate) fn read(line: &str) -> Result<HostRequest, AgentError> {
        let wrong = |reason: String| AgentError::Request(reason);
        let value: Value = serde_json::from_str(line).map_err(|error| wrong(error.to_string()))?;
        let text = |key: &str| match value.get(key) {
            None | Some(Value::Null) => Ok(None),
            Some(Value::String(text)) => Ok(Some(text.clone())),
            Some(_) => Err(wrong(format!("expected a text for `{key}`"))),
        };
        let need = |key: &str| text(key)?.ok_or_else(|| wrong(format!("expected a text for `{key}`")));
        Ok(match &*need("do")? {
            "send" => HostRequest::Send {
                agent: need("agent")?,
                input: need("input")?,
                data: text("data")?.unwrap_or_default(),
            },
            "start" => HostRequest::Start(need("agent")?),
            "stop" => HostRequest::Stop(need("agent")?),
            "end" => HostRequest::End(need("agent")?),
            "list" => HostRequest::List(text("agent")?),
            other => {
                return Err(wrong(format!(
                    "expected send, start, stop, end or list for `do`, found `{other}`"
                )));
            }
        })
    }
}

/// Reads data as programs write it, one behind the other.
///
/// # Errors
/// [`AgentError::NotData`].
pub(crate) fn read_data(text: &str) -> Result<Vec<Datum>, AgentError> {
    let mut environment = BareEnvironment::new();
    let (mut data, mut start) = (Vec::new(), 0);
    loop {
        match read_datum(&mut environment, text, start) {
            Ok((Some(datum), end)) => {
                data.push(datum);
                start = end;
            }
            Ok((None, _)) => return Ok(data),
            Err(fault) => return Err(AgentError::NotData(fault.message.clone())),
        }
    }
}

/// A connection to the host of a folder.
#[cfg(unix)]
pub struct HostClient {
    reader: BufReader<std::os::unix::net::UnixStream>,
}

#[cfg(unix)]
impl HostClient {
    /// Connects to the host that serves a folder.
    ///
    /// # Errors
    /// [`AgentError::NoHost`].
    pub fn connect(folder: &Path) -> Result<HostClient, AgentError> {
        let socket = super::folder::reachable(&super::folder::socket_path(folder));
        let stream = socket.and_then(|(path, _folder)| std::os::unix::net::UnixStream::connect(path));
        let stream = stream.map_err(|error| AgentError::NoHost(folder.into(), error))?;
        Ok(HostClient { reader: BufReader::new(stream) })
    }

    /// Makes a request, and returns the answer of the host.
    ///
    /// # Errors
    /// [`AgentError::Refused`], and [`AgentError::Request`] if the connection breaks.
    pub fn ask(&mut self, request: &HostRequest) -> Result<Value, AgentError> {
        let broken = |error: io::Error| AgentError::Request(format!("the connection is broken: {error}"));
        let line = format!("{}\n", request.to_json());
        self.reader.get_mut().write_all(line.as_bytes()).map_err(broken)?;
        let mut answer = String::new();
        self.reader.read_line(&mut answer).map_err(broken)?;
        let answer: Value = serde_json::from_str(&answer).map_err(|error| broken(error.into()))?;
        match answer.get("error").and_then(Value::as_str) {
            Some(reason) => Err(AgentError::Refused(reason.into())),
            None => Ok(answer),
        }
    }
}

/// Reads a line of at most [`LONGEST_REQUEST`] bytes; `None` at the end.
pub(crate) fn read_line(from: &mut impl BufRead) -> io::Result<Option<String>> {
    let mut line = Vec::new();
    let count = from.by_ref().take(LONGEST_REQUEST).read_until(b'\n', &mut line)?;
    if count == 0 {
        return Ok(None);
    }
    if line.last() != Some(&b'\n') && count as u64 == LONGEST_REQUEST {
        return Err(io::Error::other("the line is too long"));
    }
    // A line that is not text becomes an invalid request, which is answered.
    Ok(Some(String::from_utf8_lossy(&line).into_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_read_as_they_are_written() {
        let agent = || "rover".to_string();
        let all = [
            HostRequest::Send { agent: agent(), input: "order".into(), data: "(go \"a\n\") 3".into() },
            HostRequest::Start(agent()),
            HostRequest::Stop(agent()),
            HostRequest::End(agent()),
            HostRequest::List(None),
            HostRequest::List(Some(agent())),
        ];
        for request in all {
            let line = request.to_json().to_string();
            assert!(!line.contains('\n'));
            assert_eq!(HostRequest::read(&line).ok(), Some(request));
        }
        let list = "{\"do\":\"list\",\"agent\":3}";
        for wrong in
            ["", "3", "{}", "{\"do\":\"fly\"}", "{\"do\":\"stop\"}", "{\"do\":\"stop\",\"agent\":3}", list]
        {
            assert!(matches!(HostRequest::read(wrong), Err(AgentError::Request(_))), "{wrong}");
        }
    }

    #[test]
    fn data_are_read_one_behind_the_other() {
        let printed = |text: &str| {
            let data = read_data(text)?;
            Ok::<_, AgentError>(data.iter().map(ToString::to_string).collect::<Vec<_>>().join(" "))
        };
        assert_eq!(printed("(go :north) 3 \"x\"").ok(), Some("(GO :NORTH) 3 \"x\"".into()));
        assert_eq!(printed(" ").ok(), Some(String::new()));
        assert!(matches!(printed("(go"), Err(AgentError::NotData(_))));
    }

    #[test]
    fn a_line_without_an_end_has_one() {
        let mut endless = BufReader::new(io::repeat(b'x'));
        assert!(read_line(&mut endless).is_err());
        assert_eq!(read_line(&mut &b"a\nb"[..]).ok(), Some(Some("a\n".into())));
        assert_eq!(read_line(&mut &b""[..]).ok(), Some(None));
        assert_eq!(read_line(&mut &b"\xff\n"[..]).ok(), Some(Some("\u{fffd}\n".into())));
    }
}
