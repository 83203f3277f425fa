// The age of lists when they arrive, although the clocks of the server and of this device may differ.

/** Length of a part of the time for which the fastest transmission is remembered, and the number of parts. */
const PART_MS = 5000;
const PARTS = 12;

/**
 * The server's clock gives the time from the capture of a list to its sending. Of the transmission time, only
 * the excess over the fastest one of the last minute is known, and is added.
 */
export class Age {
  #fastest = [];
  #newest_ms = null;

  /** Takes the times of a list that arrives now. */
  take({ capture_utc_ns, sent_utc_ns }) {
    const now_ms = Date.now();
    const journey_ms = now_ms - sent_utc_ns / 1e6;
    const part = Math.floor(performance.now() / PART_MS);
    const last = this.#fastest.at(-1);
    if (last?.part === part) last.journey_ms = Math.min(last.journey_ms, journey_ms);
    else this.#fastest.push({ part, journey_ms });
    if (this.#fastest.length > PARTS) this.#fastest.shift();
    const least_ms = Math.min(...this.#fastest.map(({ journey_ms }) => journey_ms));
    this.#newest_ms = capture_utc_ns === null ? null : (sent_utc_ns - capture_utc_ns) / 1e6 + journey_ms - least_ms;
  }

  /** Age of the newest list in milliseconds; null where its capture time is unknown. */
  get ms() {
    return this.#newest_ms;
  }
}
