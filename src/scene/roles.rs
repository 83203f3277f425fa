use crate::error::{Error, Result};

/// What an instance contributes to the picture. An instance that only casts shadows is *held out*: a stand-in
/// for a real object in the photograph that the picture is composited over must cast its shadow, but must not
/// be visible twice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Roles {
    /// Whether the camera sees it.
    pub seen: bool,
    /// Whether it is drawn into shadow maps.
    pub casts: bool,
    /// Whether shadows fall on it.
    pub receives: bool,
}

impl Roles {
    /// All roles: an ordinary object.
    pub const ALL: Self = Self { seen: true, casts: true, receives: true };
    /// No role: as if the instance did not exist.
    pub const NONE: Self = Self { seen: false, casts: false, receives: false };
    /// Casts shadows but is not seen.
    pub const HELD_OUT: Self = Self { casts: true, ..Self::NONE };
    /// Is seen but casts no shadows, such as a ground plane, which only receives them.
    pub const NO_SHADOW: Self = Self { casts: false, ..Self::ALL };

    /// The roles with these names, which are the names of the fields; the instance does not play the others.
    ///
    /// # Errors
    /// Any other name; the message says what is wrong.
    pub fn of_names<'a>(names: impl IntoIterator<Item = &'a str>) -> Result<Self> {
        let mut roles = Self::NONE;
        for name in names {
            let role = match name {
                "seen" => &mut roles.seen,
                "casts" => &mut roles.casts,
                "receives" => &mut roles.receives,
                _ => {
                    let name = super::read::short(name);
                    return Err(Error::usage(format!(
                        "`{name}` is no role; there are seen, casts and receives"
                    )));
                }
            };
            *role = true;
        }
        Ok(roles)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roles_are_named_as_their_fields() {
        assert_eq!(Roles::of_names(["seen", "casts", "receives"]).unwrap(), Roles::ALL);
        assert_eq!(Roles::of_names([]).unwrap(), Roles::NONE);
        assert_eq!(Roles::of_names(["casts"]).unwrap(), Roles::HELD_OUT);
        assert!(Roles::of_names(["cast"]).unwrap_err().to_string().contains("`cast` is no role"));
    }
}
