use super::Scene;
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
                    let name = super::file::short(name);
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

impl Scene {
    /// Gives these roles to all instances at nodes of this name and below them.
    ///
    /// # Errors
    /// Kind `Usage` where no node has the name, with those that there are.
    pub fn set_roles(&mut self, name: &str, roles: Roles) -> Result<()> {
        let mut is_meant = Vec::with_capacity(self.nodes.len());
        for (place, node) in self.nodes.iter().enumerate() {
            let is_named = self.node_names.get(place).is_some_and(|own| own == name);
            is_meant.push(is_named || node.parent.is_some_and(|parent| is_meant[parent]));
        }
        if !is_meant.contains(&true) {
            return Err(self.no_node(name));
        }
        let meant = self.instances.iter_mut().filter(|instance| is_meant[instance.node]);
        meant.for_each(|instance| instance.roles = roles);
        Ok(())
    }

    fn no_node(&self, name: &str) -> Error {
        /// Names that a message has room for.
        const MOST: usize = 20;
        let mut names: Vec<&str> =
            self.node_names.iter().map(String::as_str).filter(|name| !name.is_empty()).collect();
        names.sort_unstable();
        names.dedup();
        let more = if names.len() > MOST { ", ..." } else { "" };
        names.truncate(MOST);
        let known = if names.is_empty() {
            "its nodes have no names".to_owned()
        } else {
            format!("there are {}{more}", names.join(", "))
        };
        Error::usage(format!("the scene has no node `{name}`; {known}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roles_go_to_a_node_and_all_below_it() {
        let mut scene = Scene::built_in();
        let roles = |scene: &Scene| scene.instances.iter().map(|i| i.roles).collect::<Vec<_>>();
        assert_eq!(roles(&scene), [Roles::ALL, Roles::ALL, Roles::NO_SHADOW]);
        scene.set_roles("sphere", Roles::HELD_OUT).unwrap();
        assert_eq!(roles(&scene), [Roles::ALL, Roles::HELD_OUT, Roles::NO_SHADOW]);
        // Both stand below the root.
        scene.node_names[0] = "things".to_owned();
        scene.set_roles("things", Roles::NONE).unwrap();
        assert_eq!(roles(&scene), [Roles::NONE, Roles::NONE, Roles::NO_SHADOW]);
        let error = scene.set_roles("cube", Roles::NONE).unwrap_err().to_string();
        assert_eq!(error, "the scene has no node `cube`; there are ground, knot, sphere, things");
        let error = Scene::default().set_roles("cube", Roles::NONE).unwrap_err().to_string();
        assert!(error.contains("have no names"), "{error}");
    }

    #[test]
    fn roles_are_named_as_their_fields() {
        assert_eq!(Roles::of_names(["seen", "casts", "receives"]).unwrap(), Roles::ALL);
        assert_eq!(Roles::of_names([]).unwrap(), Roles::NONE);
        assert_eq!(Roles::of_names(["casts"]).unwrap(), Roles::HELD_OUT);
        assert!(Roles::of_names(["cast"]).unwrap_err().to_string().contains("`cast` is no role"));
    }
}
