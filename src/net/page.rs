//! The page at `/`: files that are compiled in, with the JavaScript client that it uses. Nobody needs a token
//! for them.

use axum::Router;
use axum::http::header::{CONTENT_SECURITY_POLICY, CONTENT_TYPE, REFERRER_POLICY};
use axum::routing::get;

const HTML: &str = "text/html; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
const PICTURE: &str = "image/svg+xml";

/// The page runs only scripts from this server and sends requests only to it.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; connect-src 'self'; \
                      base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// Path, kind and text of every file.
const FILES: [(&str, &str, &str); 15] = [
    ("/", HTML, include_str!("page/index.html")),
    ("/page.css", STYLE, include_str!("page/page.css")),
    ("/icon.svg", PICTURE, include_str!("page/icon.svg")),
    ("/lightcast.js", SCRIPT, include_str!("../../clients/lightcast.js")),
    ("/page.js", SCRIPT, include_str!("page/page.js")),
    ("/age.js", SCRIPT, include_str!("page/age.js")),
    ("/first_lights.js", SCRIPT, include_str!("page/first_lights.js")),
    ("/gl.js", SCRIPT, include_str!("page/gl.js")),
    ("/map.js", SCRIPT, include_str!("page/map.js")),
    ("/meshes.js", SCRIPT, include_str!("page/meshes.js")),
    ("/plots.js", SCRIPT, include_str!("page/plots.js")),
    ("/scene.js", SCRIPT, include_str!("page/scene.js")),
    ("/scene_shader.js", SCRIPT, include_str!("page/scene_shader.js")),
    ("/slider.js", SCRIPT, include_str!("page/slider.js")),
    ("/stages.js", SCRIPT, include_str!("page/stages.js")),
];

/// Routes to the files.
pub(super) fn router<S: Clone + Send + Sync + 'static>() -> Router<S> {
    FILES.into_iter().fold(Router::new(), |router, (path, kind, text)| {
        let headers =
            [(CONTENT_TYPE, kind), (CONTENT_SECURITY_POLICY, POLICY), (REFERRER_POLICY, "no-referrer")];
        router.route(path, get(move || async move { (headers, text) }))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The text between `before` and the next quote.
    fn quoted<'a>(text: &'a str, before: &str) -> Vec<&'a str> {
        text.split(before).skip(1).filter_map(|rest| rest.split('"').next()).collect()
    }

    #[test]
    fn every_file_that_a_file_names_is_there() {
        let mut named = 0;
        for (path, kind, text) in FILES {
            let befores: &[&str] = if kind == HTML { &["href=\"", "src=\""] } else { &["from \""] };
            for name in befores.iter().flat_map(|before| quoted(text, before)) {
                if kind == SCRIPT || kind == HTML {
                    assert!(FILES.iter().any(|&(path, ..)| path == name), "{path} names {name}");
                    named += 1;
                }
            }
        }
        // Every file except the page itself is named by another.
        assert!(named >= FILES.len() - 1);
    }

    #[test]
    fn the_policy_lets_the_page_do_what_it_does() {
        for (path, kind, text) in FILES {
            if kind == HTML {
                for forbidden in ["style=", "onclick=", "<style", "<script>", "http:", "https:"] {
                    assert!(!text.contains(forbidden), "{path} has {forbidden}");
                }
            }
            if kind == SCRIPT {
                for forbidden in ["eval(", "new Function", ".innerHTML", "http://", "https://"] {
                    assert!(!text.contains(forbidden), "{path} has {forbidden}");
                }
            }
        }
    }
}
