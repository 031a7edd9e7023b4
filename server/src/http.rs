//! A small HTTP server: it listens on this machine alone, answers GET and nothing else, and closes after each answer.
//!
//! A page of another site may make a browser send requests here, but not under this server's name: the Host of a request must be
//! the address that was printed, so a name that somebody points at this machine (DNS rebinding) is refused. What is answered carries
//! a policy that lets the page load from here alone.

use std::io::{self, Read as _, Write as _};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

/// The head of a request, bytes at most.
const HEAD: usize = 16 << 10;
/// Header lines of a request at most.
const LINES: usize = 64;
/// Requests answered at the same time at most.
const AT_ONCE: usize = 32;
/// How long a client may take to send its request, and to take its answer.
const PATIENCE: Duration = Duration::from_secs(10);

/// Texts that are told one after the other, as events of a stream; `None` ends it. It may wait for the next one, and tells an empty text
/// every now and then where there is none, so that a client that has gone is noticed.
pub struct Events(pub Box<dyn FnMut() -> Option<String> + Send>);

impl std::fmt::Debug for Events {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Events")
    }
}

/// What is answered.
#[derive(Debug)]
pub struct Answer {
    /// HTTP's number.
    pub status: u16,
    /// The kind of its content.
    pub content: &'static str,
    /// The content.
    pub body: Vec<u8>,
    /// What comes behind it until it ends (server-sent events).
    pub events: Option<Events>,
}

impl Answer {
    /// What was asked for.
    pub fn of(content: &'static str, body: impl Into<Vec<u8>>) -> Self {
        Self { status: 200, content, body: body.into(), events: None }
    }

    /// A stream of server-sent events.
    pub fn stream(events: Events) -> Self {
        Self { events: Some(events), ..Self::of("text/event-stream", "") }
    }

    /// A sentence why not.
    pub fn refused(status: u16, sentence: impl Into<String>) -> Self {
        Self { status, ..Self::of("text/plain; charset=utf-8", sentence.into() + "\n") }
    }
}

/// What answers the path of a request (with its query) that may be answered.
pub type Answers = dyn Fn(&str) -> Answer + Send + Sync;

/// A server that listens and does not answer yet.
#[derive(Debug)]
pub struct Listening {
    listener: TcpListener,
    address: SocketAddr,
}

impl Listening {
    /// Listens on 127.0.0.1; a port of 0 is any that is free.
    ///
    /// # Errors
    /// One sentence why it cannot.
    pub fn on(port: u16) -> Result<Self, String> {
        let failed = |e: io::Error| format!("expected to listen on 127.0.0.1:{port}, found {e}; choose another port");
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        Ok(Self { listener, address })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Answers requests until the process ends.
    ///
    /// # Errors
    /// The system's, where it takes no connections any more.
    pub fn answer(&self, answers: &Arc<Answers>) -> io::Result<()> {
        let open = Arc::new(AtomicUsize::new(0));
        loop {
            let stream = match self.listener.accept() {
                Ok((stream, _)) => stream,
                // A client that has gone again, or no file left for now.
                Err(e) if matches!(e.kind(), io::ErrorKind::ConnectionAborted | io::ErrorKind::Interrupted) => continue,
                Err(e) => return Err(e),
            };
            let (answers, open, port) = (answers.clone(), open.clone(), self.address.port());
            if open.fetch_add(1, Ordering::AcqRel) >= AT_ONCE {
                let _ = write(&stream, Answer::refused(503, "too many requests at the same time: ask again"));
                open.fetch_sub(1, Ordering::AcqRel);
                continue;
            }
            std::thread::spawn(move || {
                // A client that has gone away misses nothing.
                let _ = serve(&stream, port, answers.as_ref());
                open.fetch_sub(1, Ordering::AcqRel);
            });
        }
    }
}

fn serve(stream: &TcpStream, port: u16, answers: &Answers) -> io::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    stream.set_nodelay(true)?;
    let answer = match head_of(stream) {
        Ok(head) => asked(&head, port).map_or_else(|refused| refused, |path| answers(&path)),
        Err(refused) => refused,
    };
    write(stream, answer)
}

/// The bytes of a request up to the empty line.
fn head_of(mut stream: &TcpStream) -> Result<Vec<u8>, Answer> {
    let (mut head, mut piece) = (Vec::new(), [0; 2048]);
    loop {
        let read =
            stream.read(&mut piece).map_err(|_| Answer::refused(408, "expected a request, found none in time"))?;
        head.extend_from_slice(&piece[..read]);
        if head.len() > HEAD {
            return Err(Answer::refused(431, format!("expected a request of {HEAD} bytes at most")));
        }
        if head.windows(4).any(|w| w == b"\r\n\r\n") {
            return Ok(head);
        }
        if read == 0 {
            return Err(Answer::refused(400, "expected a whole request, found its beginning"));
        }
    }
}

/// The path that a request asks for, if it may.
///
/// # Errors
/// What it is refused with.
pub fn asked(head: &[u8], port: u16) -> Result<String, Answer> {
    let mut lines = [httparse::EMPTY_HEADER; LINES];
    let mut request = httparse::Request::new(&mut lines);
    match request.parse(head) {
        Ok(httparse::Status::Complete(_)) => {}
        Ok(httparse::Status::Partial) => {
            return Err(Answer::refused(400, "expected a whole request, found its beginning"));
        }
        Err(e) => return Err(Answer::refused(400, format!("expected a request of HTTP 1, found {e}"))),
    }
    let mut hosts = request.headers.iter().filter(|h| h.name.eq_ignore_ascii_case("host"));
    let own = [format!("127.0.0.1:{port}"), format!("localhost:{port}")];
    let host = match (hosts.next(), hosts.next()) {
        (Some(one), None) => String::from_utf8_lossy(one.value).into_owned(),
        (None, _) => "none".into(),
        (Some(_), Some(_)) => "two".into(),
    };
    if !own.contains(&host) {
        return Err(Answer::refused(403, format!("expected the host {}, found {host:?}", own[0])));
    }
    match request.method {
        Some("GET") => Ok(request.path.unwrap_or("/").to_owned()),
        other => Err(Answer::refused(405, format!("expected GET, found {}", other.unwrap_or("nothing")))),
    }
}

fn write(mut stream: &TcpStream, answer: Answer) -> io::Result<()> {
    let reason = match answer.status {
        200 => "OK",
        400 => "Bad Request",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        408 => "Request Timeout",
        431 => "Request Header Fields Too Large",
        503 => "Service Unavailable",
        _ => "Error",
    };
    // A stream ends where the connection does.
    let length =
        if answer.events.is_none() { format!("Content-Length: {}\r\n", answer.body.len()) } else { String::new() };
    let head = format!(
        "HTTP/1.1 {} {reason}\r\nContent-Type: {}\r\n{length}Connection: close\r\nCache-Control: no-store\r\n\
         X-Content-Type-Options: nosniff\r\nX-Frame-Options: DENY\r\nReferrer-Policy: no-referrer\r\n\
         Cross-Origin-Resource-Policy: same-origin\r\nContent-Security-Policy: default-src 'self'; frame-ancestors 'none'; \
         base-uri 'none'; form-action 'none'\r\n\r\n",
        answer.status, answer.content,
    );
    stream.write_all(head.as_bytes())?;
    stream.write_all(&answer.body)?;
    let Some(Events(mut next)) = answer.events else { return Ok(()) };
    while let Some(text) = next() {
        let event = if text.is_empty() { ":\n\n".into() } else { format!("data: {text}\n\n") };
        stream.write_all(event.as_bytes())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(head: &str) -> u16 {
        asked(head.as_bytes(), 8123).map_or_else(|refused| refused.status, |_| 200)
    }

    #[test]
    fn only_get_of_the_printed_address_is_answered() {
        for (head, expected) in [
            ("GET / HTTP/1.1\r\nHost: 127.0.0.1:8123\r\n\r\n", 200),
            ("GET /step/0/0 HTTP/1.1\r\nhost: localhost:8123\r\n\r\n", 200),
            ("GET / HTTP/1.1\r\nHost: localhost:8124\r\n\r\n", 403),
            ("GET / HTTP/1.1\r\nHost: evil.example:8123\r\n\r\n", 403),
            ("GET / HTTP/1.1\r\nHost: 127.0.0.1:8123.evil.example\r\n\r\n", 403),
            ("GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n", 403),
            ("GET / HTTP/1.1\r\n\r\n", 403),
            ("GET / HTTP/1.1\r\nHost: 127.0.0.1:8123\r\nHost: evil.example\r\n\r\n", 403),
            ("POST / HTTP/1.1\r\nHost: 127.0.0.1:8123\r\n\r\n", 405),
            ("HEAD / HTTP/1.1\r\nHost: 127.0.0.1:8123\r\n\r\n", 405),
            ("GET / HTTP/9.1\r\nHost: 127.0.0.1:8123\r\n\r\n", 400),
            ("GET\r\n\r\n", 400),
            ("GET / HTTP/1.1\r\nHost: 127.0.0.1:8123\r\n", 400),
        ] {
            assert_eq!(status(head), expected, "{head:?}");
        }
    }
}
