//! From a request to a WebSocket.

use axum::body::Body;
use axum::extract::Request;
use axum::http::header::SEC_WEBSOCKET_PROTOCOL;
use axum::http::{HeaderMap, HeaderValue};
use axum::response::Response;
use hyper::upgrade::{OnUpgrade, Upgraded};
use hyper_util::rt::TokioIo;
use std::future::Future;
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::Error;
use tokio_tungstenite::tungstenite::handshake::server::create_response_with_body;
use tokio_tungstenite::tungstenite::protocol::{Role, WebSocketConfig};

/// The connection of a client that streams.
pub(super) type Socket = WebSocketStream<TokioIo<Upgraded>>;

/// A request that asks for a WebSocket as it should.
pub(super) struct Upgrade {
    response: Response,
    connection: OnUpgrade,
}

impl Upgrade {
    /// Checks the request and prepares its answer.
    ///
    /// # Errors
    /// What is missing in it.
    pub fn of(request: Request) -> Result<Self, Error> {
        let response = create_response_with_body(&request, Body::empty)?;
        let connection = hyper::upgrade::on(request);
        Ok(Self { response, connection })
    }

    /// Agrees to this subprotocol.
    #[must_use]
    pub fn with_protocol(mut self, name: &'static str) -> Self {
        self.response.headers_mut().insert(SEC_WEBSOCKET_PROTOCOL, HeaderValue::from_static(name));
        self
    }

    /// The answer to the request. `session` runs on a task of its own once the client has it.
    pub fn begin<S, F>(self, config: WebSocketConfig, session: S) -> Response
    where
        S: FnOnce(Socket) -> F + Send + 'static,
        F: Future<Output = ()> + Send + 'static,
    {
        let Self { response, connection } = self;
        tokio::spawn(async move {
            // A client that leaves before it has the answer has no session.
            if let Ok(upgraded) = connection.await {
                let socket = TokioIo::new(upgraded);
                session(WebSocketStream::from_raw_socket(socket, Role::Server, Some(config)).await).await;
            }
        });
        response
    }
}

/// The first of `names`, in the server's order, that a client offers as a subprotocol.
pub(super) fn protocol(headers: &HeaderMap, names: [&'static str; 2]) -> Option<&'static str> {
    let offers = |name: &str| {
        let values = headers.get_all(SEC_WEBSOCKET_PROTOCOL).iter();
        values
            .filter_map(|value| value.to_str().ok())
            .any(|value| value.split(',').any(|one| one.trim() == name))
    };
    names.into_iter().find(|name| offers(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_servers_order_of_subprotocols_decides() {
        let headers = |values: &[&'static str]| -> HeaderMap {
            values.iter().map(|value| (SEC_WEBSOCKET_PROTOCOL, HeaderValue::from_static(value))).collect()
        };
        let chosen = |values: &[&'static str]| protocol(&headers(values), ["a.binary", "a.json"]);
        assert_eq!(chosen(&["a.json, a.binary"]), Some("a.binary"));
        assert_eq!(chosen(&["other", "a.json"]), Some("a.json"));
        assert_eq!(chosen(&["a.jso"]), None);
        assert_eq!(chosen(&[]), None);
    }
}
