use glam::Vec3;
use lightcast_core::light::Light;

/// Factor by which a light must be brighter than one with a shadow map to take over its tile: otherwise
/// lights of nearly equal power would take it from each other in every frame.
const TAKE_OVER: f32 = 1.2;

/// Assignment of shadow maps (tiles of the shadow atlas) to lights: those with the most power have one, the
/// others use that of the nearest light.
#[derive(Clone, Debug, Default)]
pub(super) struct Tiles {
    /// For each tile the id of the light that owns it; `None`: free.
    owners: Vec<Option<u32>>,
    /// For each light of the last list its tile; `u32::MAX` where there are no tiles at all.
    pub tile_of: Vec<u32>,
    /// Direction towards the light of each tile in use; straight up for unused tiles.
    pub directions: Vec<[f32; 4]>,
    order: Vec<u32>,
    own: Vec<Option<u32>>,
}

impl Tiles {
    /// Assigns `count` tiles to the lights with the most power among `lights`, whose ids are distinct. A
    /// light keeps its tile while it exists, has power, and no light without a tile is brighter by a fifth.
    pub fn assign(&mut self, lights: &[Light], count: usize) {
        self.owners.resize(count, None);
        self.own.clear();
        self.own.resize(lights.len(), None);
        for (tile, owner) in self.owners.iter_mut().enumerate() {
            let found = lights.iter().position(|light| Some(light.id) == *owner && light.luminance() > 0.0);
            match found {
                Some(index) if self.own[index].is_none() => self.own[index] = Some(tile as u32),
                _ => *owner = None,
            }
        }
        let power = |index: u32| lights[index as usize].luminance();
        self.order.clear();
        self.order.extend((0..lights.len() as u32).filter(|&index| power(index) > 0.0));
        self.order.sort_unstable_by(|&a, &b| power(b).total_cmp(&power(a)).then(a.cmp(&b)));
        for &index in &self.order {
            if self.own[index as usize].is_some() {
                continue;
            }
            let tile = match self.owners.iter().position(Option::is_none) {
                Some(free) => free,
                None => {
                    // The weakest light with a tile.
                    let weakest = self.order.iter().rev().find(|&&weak| self.own[weak as usize].is_some());
                    match weakest {
                        Some(&weak) if power(index) > TAKE_OVER * power(weak) => {
                            self.own[weak as usize].take().map_or(0, |tile| tile as usize)
                        }
                        // All later lights are weaker still.
                        _ => break,
                    }
                }
            };
            self.owners[tile] = Some(lights[index as usize].id);
            self.own[index as usize] = Some(tile as u32);
        }
        self.directions.clear();
        self.directions.resize(count, [0.0, 1.0, 0.0, 0.0]);
        for (light, tile) in lights.iter().zip(&self.own) {
            if let Some(tile) = *tile {
                let [x, y, z] = light.direction;
                self.directions[tile as usize] = [x, y, z, 0.0];
            }
        }
        let mut tile_of = std::mem::take(&mut self.tile_of);
        tile_of.clear();
        let with_own = lights.iter().zip(&self.own);
        tile_of.extend(with_own.map(|(light, own)| own.unwrap_or_else(|| self.nearest(light))));
        self.tile_of = tile_of;
    }

    /// The tile of the nearest light that has one.
    fn nearest(&self, light: &Light) -> u32 {
        let direction = Vec3::from(light.direction);
        let dot = |tile: usize| direction.dot(Vec3::from_slice(&self.directions[tile][..3]));
        (0..self.owners.len())
            .filter(|&tile| self.owners[tile].is_some())
            .max_by(|&a, &b| dot(a).total_cmp(&dot(b)).then(b.cmp(&a)))
            .map_or(u32::MAX, |tile| tile as u32)
    }

    /// Tiles that are owned by a light.
    pub fn used(&self) -> impl Iterator<Item = u32> {
        self.owners.iter().enumerate().filter(|(_, owner)| owner.is_some()).map(|(tile, _)| tile as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightcast_core::math::direction;

    fn lights(powers: &[f32]) -> Vec<Light> {
        let light = |(i, &power): (usize, &f32)| Light {
            id: i as u32,
            direction: direction(0.1 * i as f64, 0.0).as_vec3().to_array(),
            irradiance: [power; 3],
            spread_rad: 0.0,
        };
        powers.iter().enumerate().map(light).collect()
    }

    #[test]
    fn the_brightest_have_tiles_and_the_others_borrow_the_nearest() {
        let mut tiles = Tiles::default();
        tiles.assign(&lights(&[1.0, 5.0, 2.0, 1.0, 9.0, 0.0]), 2);
        assert_eq!(tiles.owners, [Some(4), Some(1)]);
        assert_eq!(tiles.tile_of, [1, 1, 1, 0, 0, 0]);
    }

    #[test]
    fn a_light_keeps_its_tile_until_another_is_a_fifth_brighter() {
        let mut tiles = Tiles::default();
        tiles.assign(&lights(&[5.0, 4.0, 3.0]), 2);
        assert_eq!(tiles.owners, [Some(0), Some(1)]);
        tiles.assign(&lights(&[5.0, 4.0, 4.7]), 2);
        assert_eq!(tiles.owners, [Some(0), Some(1)]);
        tiles.assign(&lights(&[5.0, 4.0, 4.9]), 2);
        assert_eq!(tiles.owners, [Some(0), Some(2)]);
        tiles.assign(&lights(&[0.0, 4.0, 4.9]), 2);
        assert_eq!(tiles.owners, [Some(1), Some(2)], "a light without power gives its tile back");
    }

    #[test]
    fn no_lights_no_tiles_and_more_tiles_than_lights() {
        let mut tiles = Tiles::default();
        tiles.assign(&[], 3);
        assert_eq!((tiles.tile_of.len(), tiles.used().count()), (0, 0));
        tiles.assign(&lights(&[1.0]), 0);
        assert_eq!(tiles.tile_of, [u32::MAX]);
        tiles.assign(&lights(&[0.0, 2.0]), 3);
        assert_eq!(tiles.used().collect::<Vec<_>>(), [0]);
        assert_eq!(tiles.tile_of, [0, 0]);
        assert_eq!(tiles.directions[0][..3], lights(&[0.0, 2.0])[1].direction);
    }
}
