//! The device: a server of HTTP in a process of its own, which performs actions and counts them.
//!
//! It serves one request after the other, in the order of their connections. So when a question about an
//! action is answered, an earlier request for it has been performed, or never will be.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::time::Duration;

/// The actions that were performed.
#[derive(Default)]
struct Device {
    /// How often each action was performed, by its name.
    performed: BTreeMap<String, u32>,
    /// How often an action was performed for each identity of a call.
    by_call: BTreeMap<String, u32>,
    /// How often each thing was read.
    read: BTreeMap<String, u32>,
}

/// Serves until the process is killed. The first line of standard output is the port.
#[allow(clippy::print_stdout, reason = "the port is for the process that has begun this one")]
pub(crate) fn serve() -> std::io::Result<()> {
    let listener = TcpListener::bind("127.0.0.1:0")?;
    println!("{}", listener.local_addr()?.port());
    let mut device = Device::default();
    for stream in listener.incoming() {
        // A client that was killed has no answer to wait for.
        drop(stream.and_then(|stream| device.serve_one(&stream)));
    }
    Ok(())
}

impl Device {
    /// Serves one request. One that was cut off is not performed.
    fn serve_one(&mut self, mut stream: &TcpStream) -> std::io::Result<()> {
        stream.set_read_timeout(Some(Duration::from_secs(5)))?;
        let mut lines = BufReader::new(stream).lines();
        let first = lines.next().transpose()?.unwrap_or_default();
        let mut call = String::new();
        loop {
            let Some(line) = lines.next().transpose()? else { return Ok(()) };
            if line.is_empty() {
                break;
            }
            if let Some((name, value)) = line.split_once(':')
                && name.eq_ignore_ascii_case("idempotency-key")
            {
                call = value.trim().into();
            }
        }
        let answer = self.perform(&first, call);
        write!(
            stream,
            "HTTP/1.1 200 OK\r\nContent-Length: {}\r\nConnection: close\r\n\r\n{answer}",
            answer.len()
        )
    }

    fn perform(&mut self, request: &str, call: String) -> String {
        let path = request.split(' ').nth(1).unwrap_or_default();
        let (kind, name) =
            path.trim_start_matches('/').split_once('/').unwrap_or((path.trim_start_matches('/'), ""));
        match kind {
            "act" => {
                *self.performed.entry(name.into()).or_default() += 1;
                *self.by_call.entry(call).or_default() += 1;
                "performed".into()
            }
            "read" => {
                *self.read.entry(name.into()).or_default() += 1;
                format!("value of {name}")
            }
            "asked" => if self.performed.contains_key(name) { "yes" } else { "no" }.into(),
            "report" => {
                let list = |kind: &str, counts: &BTreeMap<String, u32>| -> String {
                    counts.iter().map(|(name, count)| format!("{kind} {name} {count}\n")).collect()
                };
                let lists = [
                    list("performed", &self.performed),
                    list("call", &self.by_call),
                    list("read", &self.read),
                ];
                *self = Device::default();
                lists.concat()
            }
            _ => "unknown".into(),
        }
    }
}

/// Asks a device for something.
pub(crate) fn ask(port: u16, path: &str) -> std::io::Result<String> {
    let stream = TcpStream::connect(("127.0.0.1", port))?;
    write!(&stream, "GET /{path} HTTP/1.1\r\n\r\n")?;
    let text = std::io::read_to_string(&stream)?;
    Ok(text.split_once("\r\n\r\n").map_or(String::new(), |(_, body)| body.into()))
}
