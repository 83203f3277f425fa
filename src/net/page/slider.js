// The slider for the number of lights.

/** The server accepts four requests a second; more count as a flood. */
const ASK_EVERY_MS = 260;

export class CountSlider {
  #input;
  #output;
  /** The numbers on offer; the last is that of all lights. */
  #counts = [];
  #timer = null;
  #askedAt = -Infinity;

  /** `ask` is called with the subscription; `output` shows the number. */
  constructor(input, output, ask) {
    this.#input = input;
    this.#output = output;
    input.addEventListener("input", () => {
      this.#show();
      clearTimeout(this.#timer);
      this.#timer = setTimeout(() => {
        this.#askedAt = performance.now();
        ask(this.#isAll ? {} : { lights: this.#counts[this.#input.value] });
      }, this.#askedAt + ASK_EVERY_MS - performance.now());
    });
  }

  /** Sets how many lights there are; the slider goes to all of them. */
  setAll(all) {
    if (all === this.#counts.at(-1)) return;
    this.#counts = [];
    for (let count = 1; count < all; count *= 2) {
      this.#counts.push(count);
      if (count > 1 && 1.5 * count < all) this.#counts.push(1.5 * count);
    }
    this.#counts.push(all);
    this.#input.disabled = false;
    this.#input.max = String(this.#counts.length - 1);
    this.#input.value = this.#input.max;
    this.#show();
  }

  get #isAll() {
    return Number(this.#input.value) === this.#counts.length - 1;
  }

  #show() {
    const all = this.#counts.at(-1);
    const text = this.#isAll ? `all ${all}` : `${this.#counts[this.#input.value]} of ${all}`;
    this.#output.textContent = text;
    this.#input.setAttribute("aria-valuetext", text);
  }
}
