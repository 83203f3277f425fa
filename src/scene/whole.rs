use super::{
    Camera, Channel, Deformation, Figure, Instance, Material, Mesh, Node, Roles, Skin, Texture, Transform,
};

/// Meshes with their positions, materials and animations: plain lists that refer to each other by index.
///
/// World: right-handed, +Y up.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// Triangles.
    pub meshes: Vec<Mesh>,
    /// Materials of the meshes.
    pub materials: Vec<Material>,
    /// Textures of the materials.
    pub textures: Vec<Texture>,
    /// The tree of frames, parents before their children.
    pub nodes: Vec<Node>,
    /// Names of the nodes, in their order; empty for a node without a name. The list ends early where no
    /// later node has a name.
    pub node_names: Vec<String>,
    /// The meshes at their nodes.
    pub instances: Vec<Instance>,
    /// How the vertices of some meshes can move.
    pub deformations: Vec<Deformation>,
    /// The joints that move them.
    pub skins: Vec<Skin>,
    /// The instances whose vertices move, in the order of the instances, each once. Every other instance is
    /// rigid.
    pub figures: Vec<Figure>,
    /// How nodes and the weights of their meshes change, in the order of their nodes. All animations of a file play at the same time, each in a
    /// loop.
    pub channels: Vec<Channel>,
    /// The file's first perspective camera, where it stands at time 0.
    pub camera: Option<Camera>,
    /// What a viewer of the picture should know: what was left out of the file, and why.
    pub notes: Vec<String>,
}

impl Scene {
    /// A scene of meshes at the positions that their coordinates give.
    pub(super) fn of_meshes(
        meshes: Vec<Mesh>,
        materials: Vec<Material>,
        textures: Vec<Texture>,
        notes: Vec<String>,
    ) -> Self {
        let instances = (0..meshes.len()).map(|mesh| Instance { mesh, node: 0, roles: Roles::ALL }).collect();
        let nodes = vec![Node { parent: None, transform: Transform::IDENTITY }];
        Self { meshes, materials, textures, nodes, instances, notes, ..Self::default() }
    }
}
