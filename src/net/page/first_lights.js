// Shortens a list as the server does.

import { luminance } from "/gl.js";

/**
 * The first `count` lights, which the others have joined: each joins the nearest of them, so that the power
 * is kept. Directions and spreads become those of the joined lights together.
 */
export function firstLights(lights, count) {
  if (count >= lights.length) return lights;
  const heads = lights.slice(0, count).map((light) => ({ ...light, irradiance: [0, 0, 0], flux: 0, moment: [0, 0, 0] }));
  lights.forEach((light, index) => join(index < count ? heads[index] : nearest(heads, light.direction), light));
  return heads.map(({ direction, spread_rad, irradiance, flux, moment }) => {
    const length = Math.hypot(...moment);
    // A light without power keeps its direction.
    if (!(length > 0)) return { direction, spread_rad, irradiance };
    return { direction: moment.map((part) => part / length), spread_rad: Math.acos(Math.min(1, length / flux)), irradiance };
  });
}

function nearest(heads, [x, y, z]) {
  let found = null;
  let closest = -Infinity;
  for (const head of heads) {
    const near = head.direction[0] * x + head.direction[1] * y + head.direction[2] * z;
    if (near > closest) [found, closest] = [head, near];
  }
  return found;
}

/**
 * Adds power and first moment, which is the direction times the flux, shortened by the spread of the light.
 */
function join(head, { direction, irradiance, spread_rad }) {
  const flux = luminance(irradiance);
  head.flux += flux;
  for (let i = 0; i < 3; i++) {
    head.irradiance[i] += irradiance[i];
    head.moment[i] += direction[i] * flux * Math.cos(spread_rad);
  }
}
