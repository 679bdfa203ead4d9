"use strict";
// The line of time with marks for events, and the list of events.

const STYLES = { map: "faint", place: "place", right: "home", wrong: "believed",
  contact: "doorway", room: "path", fault: "wrong", end: "text" };
const NAMES = { map: "map updates", place: "places", right: "right", wrong: "wrong",
  contact: "contact", room: "rooms", fault: "faults", end: "other" };

/** Largest number of events in the list. */
const MOST_LISTED = 2000;

class Timeline {
  constructor(episode, player) {
    this.episode = episode;
    this.player = player;
    this.canvas = element("canvas", { "aria-hidden": "true" });
    this.slider = element("input", { type: "range", min: "0", max: String(episode.steps - 1),
      step: "1", value: "0", "aria-label": "step of the episode" });
    this.root = element("div", { class: "timeline" }, this.canvas, this.slider);
    this.slider.addEventListener("input", () => player.seek(Number(this.slider.value)));
    // The player's keys hold everywhere; here the slider would move, too.
    this.slider.addEventListener("keydown", (event) => {
      const own = ["ArrowLeft", "ArrowRight", "Home", "End"].includes(event.key);
      if (own && !event.ctrlKey && !event.metaKey && !event.altKey) event.preventDefault();
    });
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    this.list = element("ol", { class: "events" });
    this.shown = new Set(Object.keys(NAMES).filter((kind) => kind !== "map"));
    this.filters = element("div", { class: "legend" });
    for (const kind of Object.keys(NAMES)) {
      if (!episode.events.some((event) => event.kind === kind)) continue;
      const box = element("input", { type: "checkbox" });
      box.checked = this.shown.has(kind);
      box.addEventListener("change", () => {
        if (box.checked) this.shown.add(kind);
        else this.shown.delete(kind);
        this.fill();
      });
      this.filters.append(element("label", {}, box,
        element("span", { class: "swatch", style: `background:var(--${STYLES[kind]})` }),
        NAMES[kind]));
    }
    this.fill();
  }

  /** Draw the marks, which do not move. */
  draw() {
    const { canvas, episode, player } = this;
    const ratio = window.devicePixelRatio || 1;
    canvas.width = Math.max(1, canvas.clientWidth * ratio);
    canvas.height = Math.max(1, canvas.clientHeight * ratio);
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    // The middle of the slider's thumb stays half a thumb from its ends.
    const [margin, height] = [8, canvas.clientHeight];
    const width = canvas.clientWidth - 2 * margin;
    const last = Math.max(episode.steps - 1, 1);
    for (const { kind, step } of episode.events) {
      context.fillStyle = player.colour(STYLES[kind]);
      const top = kind === "map" ? height * 0.6 : 0;
      context.fillRect(margin + (width * step) / last - 0.75, top, 1.5, height - top);
    }
  }

  /** Fill the list with the events of the kinds that are shown. */
  fill() {
    const { episode, player } = this;
    this.events = episode.events.filter(({ kind }) => this.shown.has(kind));
    this.steps = this.events.map(({ step }) => step);
    this.items = this.events.slice(0, MOST_LISTED).map(({ step, kind, text }) => {
      const button = element("button", { type: "button" },
        element("span", { class: "swatch", style: `background:var(--${STYLES[kind]})` }),
        element("time", { text: clock(episode.times[step]) }), ` ${text}`);
      button.addEventListener("click", () => player.seek(step));
      return element("li", {}, button);
    });
    this.list.replaceChildren(...this.items);
    const more = this.events.length - this.items.length;
    if (more) this.list.append(element("li", { text: `and ${more} more, on the line of time` }));
    this.current = -1;
    this.show(player.step);
  }

  show(step) {
    this.slider.value = String(step);
    const at = clock(this.episode.times[step]);
    this.slider.setAttribute("aria-valuetext", `step ${step}, ${at}`);
    const current = countUpTo(this.steps, step) - 1;
    if (current === this.current) return;
    if (this.items[this.current]) this.items[this.current].removeAttribute("aria-current");
    this.current = current;
    const item = this.items[current];
    if (item) {
      item.setAttribute("aria-current", "true");
      const { list } = this;
      list.scrollTop = item.offsetTop - list.clientHeight / 2;
    }
  }

  /** Return the step of the next shown event, or of the one before; null if there is none. */
  neighbour(step, forward) {
    const { steps } = this;
    const later = countUpTo(steps, step);
    const k = forward ? later : countUpTo(steps, step - 1) - 1;
    return k >= 0 && k < steps.length ? steps[k] : null;
  }
}
