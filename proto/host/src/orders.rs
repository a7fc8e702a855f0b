//! Who may give orders from outside, through `Command`.

use std::fmt;
use tonic::{Request, Status};

/// Who may call `Command` of a simulator.
#[derive(Clone, Default, PartialEq, Eq)]
pub enum OrdersFromOutside {
    /// Everyone who reaches it.
    #[default]
    Anyone,
    /// Those who know this token, and send it as the metadata `authorization: Bearer TOKEN`.
    WithToken(String),
    /// Nobody: the experiment does not allow it.
    Nobody,
}

/// Without the token, which has no place in a log.
impl fmt::Debug for OrdersFromOutside {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Anyone => "Anyone",
            Self::WithToken(_) => "WithToken",
            Self::Nobody => "Nobody",
        })
    }
}

/// The metadata `authorization` of a call with a token.
#[must_use]
pub fn bearer(token: &str) -> String {
    format!("Bearer {token}")
}

impl OrdersFromOutside {
    /// Whether a call of `Command` may be taken.
    pub(super) fn admit<T>(&self, request: &Request<T>) -> Result<(), Status> {
        match self {
            Self::Anyone => Ok(()),
            Self::WithToken(token) => {
                let sent = request.metadata().get("authorization").map(|value| value.as_bytes());
                match sent {
                    Some(sent) if is_equal(sent, bearer(token).as_bytes()) => Ok(()),
                    Some(_) => Err(Status::unauthenticated(
                        "authorization: is not the token that this simulator requires",
                    )),
                    None => Err(Status::unauthenticated(
                        "authorization: is missing; this simulator requires the metadata \"authorization: Bearer TOKEN\"",
                    )),
                }
            }
            Self::Nobody => Err(Status::permission_denied(
                "this experiment takes no orders from outside; set experiment.accept_commands = true to allow them",
            )),
        }
    }
}

/// Compares in a time that does not depend on where two texts differ.
fn is_equal(a: &[u8], b: &[u8]) -> bool {
    a.len() == b.len() && a.iter().zip(b).fold(0, |differs, (a, b)| differs | (a ^ b)) == 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use tonic::Code;

    #[test]
    fn orders_are_taken_from_those_alone_who_may_give_them() {
        let call = |authorization: Option<&str>| {
            let mut request = Request::new(());
            if let Some(value) = authorization {
                request.metadata_mut().insert("authorization", value.parse().unwrap());
            }
            request
        };
        let code = |orders: &OrdersFromOutside, authorization| {
            orders.admit(&call(authorization)).map_err(|status| status.code())
        };
        assert_eq!(code(&OrdersFromOutside::Anyone, None), Ok(()));
        assert_eq!(code(&OrdersFromOutside::Nobody, Some("Bearer t")), Err(Code::PermissionDenied));
        let token = OrdersFromOutside::WithToken("t".to_owned());
        assert_eq!(code(&token, None), Err(Code::Unauthenticated));
        assert_eq!(code(&token, Some("Bearer u")), Err(Code::Unauthenticated));
        assert_eq!(code(&token, Some("t")), Err(Code::Unauthenticated));
        assert_eq!(code(&token, Some("Bearer t")), Ok(()));
        assert!(!format!("{token:?}").contains("\"t\""), "a token is not logged");
    }
}
