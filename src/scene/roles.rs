use crate::error::{Error, Result};

/// What an instance is there for. One that only casts shadows is *held out*: a real thing of a photograph
/// that pictures are laid over has a shadow of what stands on it, but must not be seen twice.
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
    /// All of them: what things are like.
    pub const ALL: Self = Self { seen: true, casts: true, receives: true };
    /// None: as if it were not there.
    pub const NONE: Self = Self { seen: false, casts: false, receives: false };
    /// It casts shadows, and is not seen.
    pub const HELD_OUT: Self = Self { casts: true, ..Self::NONE };
    /// It is seen, and casts none: what a ground plane is like, which only catches them.
    pub const NO_SHADOW: Self = Self { casts: false, ..Self::ALL };

    /// Roles by their names, which are those of the fields; the others are not played.
    ///
    /// # Errors
    /// With what is wrong, for any other name.
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
