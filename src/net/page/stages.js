// The server's stages, read from its metrics (Prometheus's text format).

/** Most stages that are shown. */
const MOST = 32;

/**
 * @param {string} text
 * @returns {{name: string, frames: number, drops: number, bad: number, median_s: number, p99_s: number}[]} in the order
 *   in which the text names them; NaN for missing values
 */
export function parseStages(text) {
  const stages = new Map();
  const keys = {
    lightcast_stage_frames_total: () => "frames",
    lightcast_stage_drops_total: () => "drops",
    lightcast_stage_bad_frames_total: () => "bad",
    lightcast_stage_time_seconds: (labels) => ({ 0.5: "median_s", 0.99: "p99_s" })[labels.quantile],
  };
  for (const [, metric, inside, value] of text.matchAll(/^(lightcast_stage_\w+)\{([^}]*)\} (\S+)/gm)) {
    const labels = Object.fromEntries([...inside.matchAll(/(\w+)="([^"]*)"/g)].map(([, key, text]) => [key, text]));
    const key = Object.hasOwn(keys, metric) ? keys[metric](labels) : undefined;
    if (key === undefined || labels.stage === undefined) continue;
    if (!stages.has(labels.stage)) {
      if (stages.size === MOST) break;
      stages.set(labels.stage, { name: labels.stage, frames: NaN, drops: NaN, bad: NaN, median_s: NaN, p99_s: NaN });
    }
    stages.get(labels.stage)[key] = Number(value);
  }
  return [...stages.values()];
}

/** Writes the stages into the rows of a table. */
export function showStages(body, stages) {
  const number = (value, digits) => {
    const options = value < 1e6 ? { minimumFractionDigits: digits, maximumFractionDigits: digits } : { notation: "compact", maximumSignificantDigits: 4 };
    return Number.isFinite(value) ? value.toLocaleString("en", options) : "\u2013";
  };
  const milliseconds = (seconds) => number(seconds * 1e3, seconds < 0.1 ? 2 : 0);
  body.replaceChildren(
    ...stages.map(({ name, frames, drops, bad, median_s, p99_s }) => {
      const row = document.createElement("tr");
      const texts = [name, milliseconds(median_s), milliseconds(p99_s), number(frames, 0), number(drops, 0), number(bad, 0)];
      row.append(...texts.map((text) => Object.assign(document.createElement("td"), { textContent: text })));
      row.children[4].classList.toggle("some", drops > 0);
      row.children[5].classList.toggle("some", bad > 0);
      return row;
    }),
  );
}
