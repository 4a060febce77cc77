//! What the server answers: the page's files, and the way to the websocket. GET and HEAD, and nothing that changes anything.

use bytes::Bytes;
use http_body_util::Full;
use hyper::body::Incoming;
use hyper::header::{self, HeaderMap, HeaderName, HeaderValue};
use hyper::{Method, Request, Response, StatusCode};
use tokio_tungstenite::tungstenite::handshake::derive_accept_key;

use crate::access::Access;
use crate::assets::asset;

/// Of every answer, beside [`policy`].
const HEADERS: [(HeaderName, &str); 6] = [
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
    (header::X_FRAME_OPTIONS, "DENY"),
    (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    (HeaderName::from_static("permissions-policy"), "camera=(), microphone=(), geolocation=()"),
];

/// What becomes of a request.
pub enum Answer {
    /// This, and that is all.
    Plain(Response<Full<Bytes>>),
    /// This, and then the connection is a websocket.
    Socket(Response<Full<Bytes>>),
}

/// The answer to a request; `is_full`: there is no room for another websocket.
pub fn answer(request: &Request<Incoming>, access: &Access, is_full: bool) -> Answer {
    let is_socket = request.uri().path() == "/ws";
    if let Err(words) = admit(request, access, is_socket) {
        return Answer::Plain(words_only(StatusCode::FORBIDDEN, &words));
    }
    let is_head = request.method() == Method::HEAD;
    if request.method() != Method::GET && !is_head {
        let mut refused = words_only(StatusCode::METHOD_NOT_ALLOWED, "GET and HEAD only");
        refused.headers_mut().insert(header::ALLOW, HeaderValue::from_static("GET, HEAD"));
        return Answer::Plain(refused);
    }
    if is_socket {
        return socket(request, is_full);
    }
    let mut found = match asset(request.uri().path()) {
        Some(file) => {
            let mut response = Response::new(Full::new(Bytes::from_static(if is_head { b"" } else { file.bytes })));
            let headers = response.headers_mut();
            headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(file.media));
            headers.insert(header::CONTENT_LENGTH, HeaderValue::from(file.bytes.len()));
            let cached = if file.is_hashed { "public, max-age=31536000, immutable" } else { "no-cache" };
            headers.insert(header::CACHE_CONTROL, HeaderValue::from_static(cached));
            response
        }
        None => words_only(StatusCode::NOT_FOUND, "there is nothing here; the page is at /"),
    };
    // It has been admitted: it is one of our own names.
    guard(found.headers_mut(), only(request.headers(), header::HOST).ok().flatten());
    Answer::Plain(found)
}

/// Whether the request is for us and from us.
fn admit(request: &Request<Incoming>, access: &Access, is_socket: bool) -> Result<(), String> {
    let host = only(request.headers(), header::HOST)?;
    let origin = only(request.headers(), header::ORIGIN)?;
    // A proxy's form of the request names its server again.
    if let Some(authority) = request.uri().authority() {
        access.admits(Some(authority.as_str()), None, false).map_err(|denied| denied.to_string())?;
    }
    access.admits(host, origin, is_socket).map_err(|denied| denied.to_string())
}

/// The header's value, where it stands there once and is text.
fn only(headers: &HeaderMap, name: HeaderName) -> Result<Option<&str>, String> {
    let mut values = headers.get_all(&name).iter();
    let first = values.next().map(|value| value.to_str().map_err(|_| format!("{name} is no text"))).transpose()?;
    match values.next() {
        Some(_) => Err(format!("{name} stands there twice")),
        None => Ok(first),
    }
}

/// The way to the websocket (RFC 6455, section 4.2).
fn socket(request: &Request<Incoming>, is_full: bool) -> Answer {
    let headers = request.headers();
    let says = |name: HeaderName, word: &str| {
        let words =
            headers.get_all(name).iter().filter_map(|value| value.to_str().ok()).flat_map(|value| value.split(','));
        words.map(str::trim).any(|said| said.eq_ignore_ascii_case(word))
    };
    let key = headers.get(header::SEC_WEBSOCKET_KEY).filter(|key| key.len() == 24);
    let asks = request.method() == Method::GET
        && says(header::CONNECTION, "upgrade")
        && says(header::UPGRADE, "websocket")
        && says(header::SEC_WEBSOCKET_VERSION, "13");
    let Some(key) = key.filter(|_| asks) else {
        let mut refused = words_only(StatusCode::UPGRADE_REQUIRED, "this is the page's websocket");
        refused.headers_mut().insert(header::UPGRADE, HeaderValue::from_static("websocket"));
        refused.headers_mut().insert(header::SEC_WEBSOCKET_VERSION, HeaderValue::from_static("13"));
        return Answer::Plain(refused);
    };
    if is_full {
        return Answer::Plain(words_only(StatusCode::SERVICE_UNAVAILABLE, "too many pages are open"));
    }
    let mut response = Response::new(Full::default());
    *response.status_mut() = StatusCode::SWITCHING_PROTOCOLS;
    let headers = response.headers_mut();
    headers.insert(header::CONNECTION, HeaderValue::from_static("Upgrade"));
    headers.insert(header::UPGRADE, HeaderValue::from_static("websocket"));
    // Base64 is text.
    if let Ok(accept) = HeaderValue::from_str(&derive_accept_key(key.as_bytes())) {
        headers.insert(header::SEC_WEBSOCKET_ACCEPT, accept);
    }
    Answer::Socket(response)
}

/// An answer in a sentence.
fn words_only(status: StatusCode, words: &str) -> Response<Full<Bytes>> {
    let mut response = Response::new(Full::new(Bytes::from(format!("{words}\n"))));
    *response.status_mut() = status;
    response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static("text/plain; charset=utf-8"));
    // Who was refused may come again, by another connection.
    response.headers_mut().insert(header::CONNECTION, HeaderValue::from_static("close"));
    guard(response.headers_mut(), None);
    response
}

/// Nothing is loaded from elsewhere, nothing runs that is not a file of ours, and nobody frames the page. `host` is our own name, for
/// browsers that do not count its websocket among 'self'.
fn policy(host: Option<&str>) -> String {
    let socket = host.map_or(String::new(), |host| format!(" ws://{host}"));
    format!(
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; font-src 'self'; connect-src 'self'{socket}; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
}

fn guard(headers: &mut HeaderMap, host: Option<&str>) {
    if let Ok(policy) = HeaderValue::from_str(&policy(host)) {
        headers.insert(header::CONTENT_SECURITY_POLICY, policy);
    }
    for (name, value) in HEADERS {
        headers.insert(name, HeaderValue::from_static(value));
    }
}
