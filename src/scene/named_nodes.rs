//! Roles of nodes that are set by the nodes' names.

use super::{Roles, Scene};
use crate::error::{Error, Result};

impl Scene {
    /// Changes the roles of all instances at nodes of this name and below them.
    ///
    /// # Errors
    /// Kind `Usage` where no node has the name; the message lists the existing names.
    pub fn change_roles(&mut self, name: &str, changed: impl Fn(Roles) -> Roles) -> Result<()> {
        let mut is_meant = Vec::with_capacity(self.nodes.len());
        for (place, node) in self.nodes.iter().enumerate() {
            let is_named = self.node_names.get(place).is_some_and(|own| own == name);
            is_meant.push(is_named || node.parent.is_some_and(|parent| is_meant[parent]));
        }
        if !is_meant.contains(&true) {
            return Err(self.no_node(name));
        }
        let meant = self.instances.iter_mut().filter(|instance| is_meant[instance.node]);
        meant.for_each(|instance| instance.roles = changed(instance.roles));
        Ok(())
    }

    fn no_node(&self, name: &str) -> Error {
        /// Most names that a message lists.
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
        scene.change_roles("sphere", |_| Roles::HELD_OUT).unwrap();
        assert_eq!(roles(&scene), [Roles::ALL, Roles::HELD_OUT, Roles::NO_SHADOW]);
        // Both stand below the root.
        scene.node_names[0] = "things".to_owned();
        scene.change_roles("things", |_| Roles::NONE).unwrap();
        assert_eq!(roles(&scene), [Roles::NONE, Roles::NONE, Roles::NO_SHADOW]);
        let error = scene.change_roles("cube", |_| Roles::NONE).unwrap_err().to_string();
        assert_eq!(error, "the scene has no node `cube`; there are ground, knot, sphere, things");
        let error = Scene::default().change_roles("cube", |_| Roles::NONE).unwrap_err().to_string();
        assert!(error.contains("have no names"), "{error}");
    }
}
