//! Input from unknown peers, without connections. Only tests and fuzzing compile this module.
//!
//! Guarantees: nothing is done; no bytes make this panic, or use more memory than a small multiple of their
//! number.

pub(crate) mod http;

use super::secrets::Secrets;
use super::{attach, monitor};

/// Secrets that a fuzzer can find.
const SECRETS: &str = "observe aaaaaaaaaaaaaaaa\ncommand bbbbbbbbbbbbbbbb\npatch cccccccccccccccc\n";

/// Takes bytes as all that comes over a connection, to the listener for operators and to the monitor. Returns
/// how many requests were understood.
pub fn understand(bytes: &[u8]) -> usize {
    let Ok(secrets) = Secrets::parse(SECRETS) else { return 0 };
    attach::noise::understand(&secrets, bytes) + monitor::understand(&secrets, bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Requests that are understood: a session of `eslvm attach` and SLIME, and those of a browser.
    fn examples() -> Vec<Vec<u8>> {
        let packet = |text: &str| format!("{:06x}{text}", text.len());
        let session = [
            "\"cccccccccccccccc\"",
            "(:emacs-rex (swank:connection-info) nil t 1)",
            "(:emacs-rex (swank:swank-require '(swank-repl)) \"COMMON-LISP-USER\" t 2)",
            "(:emacs-rex (esl:signal \"news\" \"1 (a \\\"b\\\") -2.5e3\") nil t 3)",
            "(:emacs-rex (cl:mapc 'swank:kill-nth-thread '(2 1)) nil t 4)",
            "(:emacs-return-string 1 2 \"x\")",
        ];
        let head =
            "Host: 127.0.0.1:80\r\nOrigin: http://127.0.0.1:80\r\nAuthorization: Bearer bbbbbbbbbbbbbbbb\r\n";
        let post = |path: &str, body: &str| {
            format!("POST {path} HTTP/1.1\r\n{head}Content-Length: {}\r\n\r\n{body}", body.len())
        };
        let body = "{\"viewer\":\"v\",\"count\":7}";
        let web = [
            format!("GET / HTTP/1.1\r\n{head}\r\n"),
            format!("GET /events?token=aaaaaaaaaaaaaaaa&viewer=v HTTP/1.1\r\n{head}\r\n"),
            post("/do", "{\"action\":\"signal\",\"input\":\"n\",\"data\":\"1 (2)\"}"),
            post("/view", body),
            format!(
                "POST /view HTTP/1.1\r\n{head}Transfer-Encoding: chunked\r\n\r\n{:x}\r\n{body}\r\n0\r\n\r\n",
                body.len()
            ),
        ];
        vec![session.map(packet).concat().into_bytes(), web.concat().into_bytes()]
    }

    /// Returns numbers that look random, the same ones each time.
    fn noise(mut state: u64) -> impl FnMut(usize) -> usize {
        move |count| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 33) as usize % count
        }
    }

    #[test]
    fn what_is_meant_well_is_understood() {
        assert_eq!(examples().iter().map(|bytes| understand(bytes)).collect::<Vec<_>>(), [5, 5]);
    }

    /// Number of inputs; `ESL_NOISE` sets another one, for longer runs by hand.
    fn inputs() -> usize {
        std::env::var("ESL_NOISE").ok().and_then(|count| count.parse().ok()).unwrap_or(6_000)
    }

    #[test]
    fn noise_is_understood_or_refused() {
        let examples = examples();
        let mut below = noise(15);
        let mut understood = 0;
        for round in 0..inputs() {
            let mut bytes = examples[round % examples.len()].clone();
            for _ in 0..below(6) {
                let (at, other) = (below(bytes.len()), below(bytes.len()));
                match below(5) {
                    0 => bytes[at] = below(256) as u8,
                    1 => bytes.truncate(at + 1),
                    2 => drop(bytes.drain(at.min(other)..at.max(other))),
                    3 => bytes.extend_from_within(at.min(other)..at.max(other)),
                    _ => bytes.insert(at, b"()\"' \r\n:0f{}[],%&="[below(18)]),
                }
                if bytes.is_empty() {
                    bytes.push(0);
                }
            }
            understood += understand(&bytes);
        }
        assert!(understood > inputs() / 2, "{understood}");
    }

    /// An announced length takes no memory before the data arrive, and nesting takes no stack.
    #[test]
    fn what_is_large_is_bounded_before_it_is_parsed() {
        let mut below = noise(1);
        for (open, close) in [("(", ")"), ("'", ""), ("\"", ""), ("[", "]")] {
            let nested = open.repeat(100_000) + &close.repeat(100_000);
            let packet = format!("000012\"cccccccccccccccc\"{:06x}{nested}", nested.len());
            assert!(understand(packet.as_bytes()) <= 1, "{open}");
            let data =
                format!("{{\"action\":\"signal\",\"input\":\"n\",\"data\":\"{}\"}}", "(".repeat(50_000));
            for body in [&nested, &data] {
                let post = format!(
                    "POST /do HTTP/1.1\r\nHost: localhost\r\nOrigin: http://localhost\r\nAuthorization: Bearer \
                     bbbbbbbbbbbbbbbb\r\nContent-Length: {}\r\n\r\n{body}",
                    body.len()
                );
                assert!(understand(post.as_bytes()) <= 1, "{open}");
            }
        }
        assert_eq!(understand(b"000012\"cccccccccccccccc\"ffffff("), 1);
        let header = format!("GET / HTTP/1.1\r\nHost: localhost\r\nX: {}\r\n\r\n", "x".repeat(1 << 20));
        assert_eq!(understand(header.as_bytes()), 0);
        for _ in 0..2_000 {
            let bytes: Vec<u8> = (0..below(200)).map(|_| below(256) as u8).collect();
            assert_eq!(understand(&bytes), 0);
        }
    }
}
