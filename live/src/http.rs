//! The subset of HTTP that the live page needs: requests from bytes, responses to bytes. No input or output; the sockets are in
//! `client`.
//!
//! Every response but an event stream ends its connection. All lengths that a client chooses are bounded.

use serde_json::{Value, json};
use std::net::IpAddr;

/// Longest head of a request, bytes.
pub(crate) const LONGEST_HEAD: usize = 16 << 10;
/// Longest body of a request, bytes.
pub(crate) const LONGEST_BODY: usize = 64 << 10;
const MOST_FIELDS: usize = 64;

/// Security headers of every response: no foreign resources, no embedding in foreign frames, no referrer.
const SECURITY: &str = "Content-Security-Policy: default-src 'self'; style-src 'self' 'unsafe-inline'; frame-ancestors 'none'; \
                        base-uri 'none'; form-action 'none'\r\nX-Content-Type-Options: nosniff\r\n\
                        Referrer-Policy: no-referrer\r\nCross-Origin-Resource-Policy: same-origin\r\n";

/// A complete request.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Request {
    /// Its method, as `GET`.
    pub method: String,
    /// Its path, without the query.
    pub path: String,
    pub query: String,
    /// Value of `Host`, as `127.0.0.1:8080`.
    pub host: Option<String>,
    /// Value of `Origin`; browsers send it, programs do not.
    pub origin: Option<String>,
    /// Token of the request, if any.
    pub token: Option<String>,
    pub body: Vec<u8>,
}

/// Result of parsing the bytes received so far.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Progress {
    Partial,
    Whole(Request),
    /// Invalid or too large: the status of the response.
    Refused(Status),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Status {
    Good,
    BadRequest,
    Unauthorized,
    Forbidden,
    NotFound,
    MethodNotAllowed,
    TooLarge,
    HeadTooLarge,
    Busy,
    NoAnswer,
}

impl Status {
    fn line(self) -> &'static str {
        match self {
            Self::Good => "200 OK",
            Self::BadRequest => "400 Bad Request",
            Self::Unauthorized => "401 Unauthorized",
            Self::Forbidden => "403 Forbidden",
            Self::NotFound => "404 Not Found",
            Self::MethodNotAllowed => "405 Method Not Allowed",
            Self::TooLarge => "413 Content Too Large",
            Self::HeadTooLarge => "431 Request Header Fields Too Large",
            Self::Busy => "503 Service Unavailable",
            Self::NoAnswer => "504 Gateway Timeout",
        }
    }
}

/// Parses the bytes received so far.
pub(crate) fn parse(bytes: &[u8]) -> Progress {
    let mut fields = [httparse::EMPTY_HEADER; MOST_FIELDS];
    let mut head = httparse::Request::new(&mut fields);
    let head_bytes = match head.parse(bytes) {
        Ok(httparse::Status::Complete(head_bytes)) if head_bytes <= LONGEST_HEAD => head_bytes,
        Ok(httparse::Status::Partial) if bytes.len() <= LONGEST_HEAD => return Progress::Partial,
        Ok(_) | Err(httparse::Error::TooManyHeaders) => return Progress::Refused(Status::HeadTooLarge),
        Err(_) => return Progress::Refused(Status::BadRequest),
    };
    let mut request = Request { method: head.method.unwrap_or_default().into(), ..Request::default() };
    let target = head.path.unwrap_or_default();
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    (request.path, request.query) = (path.into(), query.into());
    let mut length = 0;
    for field in head.headers.iter() {
        let Ok(value) = std::str::from_utf8(field.value) else {
            return Progress::Refused(Status::BadRequest);
        };
        let is = |name: &str| field.name.eq_ignore_ascii_case(name);
        // Duplicate fields are refused: parsers disagree on which one counts.
        let once = |place: &mut Option<String>| place.replace(value.trim().to_owned()).is_none();
        let good = if is("host") {
            once(&mut request.host)
        } else if is("origin") {
            once(&mut request.origin)
        } else if is("x-airbench-token") {
            once(&mut request.token)
        } else if is("content-length") {
            value.trim().parse().map(|reported: usize| length = reported).is_ok()
        } else {
            // Chunked bodies are refused: requests are short.
            !is("transfer-encoding")
        };
        if !good {
            return Progress::Refused(Status::BadRequest);
        }
    }
    if length > LONGEST_BODY {
        return Progress::Refused(Status::TooLarge);
    }
    let Some(body) = bytes[head_bytes..].get(..length) else { return Progress::Partial };
    request.body = body.to_vec();
    Progress::Whole(request)
}

/// Whether `Host` names this server at `port`, as `localhost` or by an address in digits. A foreign name that resolves to this
/// address (DNS rebinding) would let a foreign page send requests.
pub(crate) fn is_ours(host: &str, port: u16) -> bool {
    let (name, reported) = match host.rsplit_once(':') {
        Some((name, reported)) if !reported.ends_with(']') => (name, reported),
        // Browsers leave out the port that http has by itself.
        _ => (host, "80"),
    };
    let bare = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
    reported.parse() == Ok(port) && (name.eq_ignore_ascii_case("localhost") || bare.parse::<IpAddr>().is_ok())
}

pub(crate) fn response(status: Status, content_type: &str, body: &[u8]) -> Vec<u8> {
    let head = format!(
        "HTTP/1.1 {}\r\nContent-Type: {content_type}\r\nContent-Length: {}\r\nCache-Control: no-store\r\n{SECURITY}\
         Connection: close\r\n\r\n",
        status.line(),
        body.len()
    );
    [head.as_bytes(), body].concat()
}

pub(crate) fn json_response(status: Status, value: &Value) -> Vec<u8> {
    response(status, "application/json", value.to_string().as_bytes())
}

/// A response with a message as JSON.
pub(crate) fn message_response(status: Status, message: &str) -> Vec<u8> {
    json_response(status, &json!({ "ok": status == Status::Good, "message": message }))
}

/// The head of a stream of Server-Sent Events, which ends with the connection.
pub(crate) fn stream_head() -> Vec<u8> {
    format!(
        "HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nCache-Control: no-store\r\n{SECURITY}Connection: close\r\n\r\n"
    )
    .into_bytes()
}

pub(crate) fn event(name: &str, data: &Value) -> Vec<u8> {
    // JSON is written without line breaks, so that it is one line of data.
    format!("event: {name}\ndata: {data}\n\n").into_bytes()
}

/// A comment that keeps an event stream alive.
pub(crate) const HEARTBEAT: &[u8] = b": still here\n\n";

#[cfg(test)]
mod tests {
    use super::*;

    fn whole(text: &str) -> Request {
        match parse(text.as_bytes()) {
            Progress::Whole(request) => request,
            other => panic!("{other:?}"),
        }
    }

    fn refused(text: &str) -> Status {
        match parse(text.as_bytes()) {
            Progress::Refused(status) => status,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_request_is_read_in_whatever_pieces() {
        let text = "POST /api/control?x=1 HTTP/1.1\r\nHOST: localhost:80\r\nOrigin: http://localhost:80\r\n\
                    X-Airbench-Token: abc\r\nContent-Length: 2\r\n\r\n{}";
        for end in 0..text.len() {
            assert_eq!(parse(&text.as_bytes()[..end]), Progress::Partial, "{end}");
        }
        let request = whole(text);
        assert_eq!((request.method.as_str(), request.path.as_str()), ("POST", "/api/control"));
        assert_eq!((request.query.as_str(), request.host.as_deref()), ("x=1", Some("localhost:80")));
        assert_eq!(request.origin.as_deref(), Some("http://localhost:80"));
        assert_eq!((request.token.as_deref(), request.body.as_slice()), (Some("abc"), &b"{}"[..]));
    }

    #[test]
    fn what_is_too_much_or_twofold_is_refused() {
        let long = format!("GET / HTTP/1.1\r\nA: {}", "x".repeat(LONGEST_HEAD));
        assert_eq!(refused(&long), Status::HeadTooLarge);
        let many = format!("GET / HTTP/1.1\r\n{}\r\n", "A: b\r\n".repeat(MOST_FIELDS + 1));
        assert_eq!(refused(&many), Status::HeadTooLarge);
        let head = |field: &str| refused(&format!("POST / HTTP/1.1\r\nHost: a:1\r\n{field}\r\n\r\n"));
        assert_eq!(head("Content-Length: 65537"), Status::TooLarge);
        assert_eq!(head("Content-Length: -1"), Status::BadRequest);
        assert_eq!(head("Host: b:1"), Status::BadRequest);
        assert_eq!(head("Transfer-Encoding: chunked"), Status::BadRequest);
        assert_eq!(refused("\u{1}\r\n\r\n"), Status::BadRequest);
    }

    #[test]
    fn only_names_that_no_foreign_page_can_have_are_ours() {
        for host in ["localhost:8080", "LOCALHOST:8080", "127.0.0.1:8080", "[::1]:8080", "192.168.0.7:8080"] {
            assert!(is_ours(host, 8080), "{host}");
        }
        for host in [
            "localhost",
            "localhost:80",
            "[::1]",
            "evil.example:8080",
            "127.0.0.1.evil.example:8080",
            ":8080",
        ] {
            assert!(!is_ours(host, 8080), "{host}");
        }
        for host in ["localhost", "127.0.0.1", "[::1]", "localhost:80"] {
            assert!(is_ours(host, 80), "{host}");
        }
        for host in ["evil.example", "localhost:8080", ""] {
            assert!(!is_ours(host, 80), "{host}");
        }
    }

    #[test]
    fn an_event_is_one_line_of_data() {
        let text = String::from_utf8(event("message", &json!({ "text": "two\nlines" }))).unwrap();
        assert_eq!(text, "event: message\ndata: {\"text\":\"two\\nlines\"}\n\n");
    }
}
