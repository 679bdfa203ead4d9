"use strict";
// The player: state, keys and buttons, and the loop that draws.

/** Longest time for which a step is shown (s); on a guided tour a step takes minutes. */
const LONGEST_STEP = 10;
const KEYS = [
  ["space", "play, pause"], ["n, b", "one step on, back"], ["← →", "10 s back, on"],
  ["home, end", "the beginning, the end"], ["+ −", "twice, half as fast"],
  ["e, shift e", "next event, event before"], ["f", "follow the robot"], ["0", "show all"],
  ["wheel, [ ]", "zoom"], ["drag, shift ← → ↑ ↓", "pan"], ["d", "light or dark"],
  ["? h", "show or hide this help"],
];

/** Return a curve with null, a gap, where a value is not finite. */
function plotted({ name, values }) {
  const whole = values.every(Number.isFinite);
  return { name, values: whole ? values : Array.from(values, (n) => (Number.isFinite(n) ? n : null)) };
}

/** What the page's data says of the episode. */
class Episode {
  constructor({ facts, arrays }) {
    const values = (name) => (arrays[name] || { values: [] }).values;
    Object.assign(this, facts);
    this.times = values("times");
    this.steps = this.times.length;
    this.lengths = values("lengths");
    this.updates = values("updates");
    this.roomNumbers = values("rooms");
    this.poses = values("poses");
    this.walls = values("walls");
    this.wayOut = values("way_out");
    this.scans = arrays.scans;
    this.bearings = values("bearings");
    this.things = new LifetimeTable(arrays, "things.");
    const curve = (prefix) => (name, k) => ({ name, values: values(`${prefix}.${k}`) });
    this.terms = facts.terms.map(curve("term")).map(plotted);
    this.curves = facts.curves.map(curve("curve")).map(plotted);
    this.tracks = facts.tracks.map((each, k) => new Track(each, arrays, `track.${k}.`));
  }

  pose(step) {
    return [this.poses[3 * step], this.poses[3 * step + 1], this.poses[3 * step + 2] / 1e4];
  }

  /** Return the points hit by the laser (mm, world frame). */
  hits(step) {
    const { bearings, scans, laser } = this;
    const [x, y, heading] = this.pose(step);
    const [mx, my, turn] = laser.mount;
    const [cos, sin] = [Math.cos(heading), Math.sin(heading)];
    const [lx, ly] = [x + 1000 * (cos * mx - sin * my), y + 1000 * (sin * mx + cos * my)];
    const points = [];
    for (let k = 0; k < bearings.length; k++) {
      const range = 10 * scans.values[step * scans.width + k];
      const angle = heading + turn + bearings[k];
      if (range) points.push(lx + range * Math.cos(angle), ly + range * Math.sin(angle));
    }
    return points;
  }

  /** Return what everything drawn lies in: x0, y0, x1, y1 (mm). */
  get bounds() {
    const bounds = [Infinity, Infinity, -Infinity, -Infinity];
    const add = (numbers, width, pairs) => {
      for (let k = 0; k < numbers.length; k += width) {
        for (let j = 0; j < pairs; j++) {
          const [x, y] = [numbers[k + 2 * j], numbers[k + 2 * j + 1]];
          if (x < bounds[0]) bounds[0] = x;
          if (y < bounds[1]) bounds[1] = y;
          if (x > bounds[2]) bounds[2] = x;
          if (y > bounds[3]) bounds[3] = y;
        }
      }
    };
    add(this.walls, 4, 2);
    add(this.poses, 3, 1);
    add(this.wayOut, 2, 1);
    for (const track of this.tracks) {
      add(track.beliefs, 3, 1);
      for (const { kind, table } of track.channels) {
        if (kind === "segments") add(table.rows, 4, 2);
      }
    }
    return bounds.every(Number.isFinite) ? bounds : [0, 0, 1000, 1000];
  }
}

class Player {
  constructor(episode) {
    this.episode = episode;
    this.step = 0;
    this.time = episode.times[0];
    this.speed = 10;
    this.playing = false;
    this.follow = false;
    this.stale = true;
    this.colours = {};
    this.theme(matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
    this.camera = new Camera();
    this.camera.bounds = episode.bounds;
    this.build();
    addEventListener("keydown", (event) => this.press(event));
    addEventListener("hashchange", () => this.readHash());
    this.readHash();
    this.seek(this.step);
    requestAnimationFrame((now) => this.loop(now));
  }

  build() {
    const { episode } = this;
    const { heading } = episode;
    const facts = Object.entries(heading).filter(([, value]) => value !== "" && value !== null);
    const byId = (id) => document.getElementById(id);
    byId("heading").append(...facts.flatMap(([name, value]) => [
      element("dt", { text: name }), element("dd", { text: String(value) })]));
    this.panels = [];
    if (episode.poses.length) this.panels.push(new TruthPanel(episode, this.camera, this));
    for (const track of episode.tracks) {
      this.panels.push(new MapPanel(track, episode, this.camera, this));
      if (track.activity) this.panels.push(new ActivityPanel(track, this));
    }
    byId("panels").append(...this.panels.map((panel) => panel.root));
    this.timeline = new Timeline(episode, this);
    byId("timeline").append(this.timeline.root);
    byId("events").append(this.timeline.filters, this.timeline.list);
    this.charts = chartsOf(episode, this);
    byId("charts").append(...this.charts.map((chart) => chart.root));
    this.buttons();
    byId("keys").append(...KEYS.flatMap(([key, meaning]) => [
      element("dt", { text: key }), element("dd", { text: meaning })]));
    if (episode.map_interval) {
      byId("remark").textContent = "The episode is long: its map is drawn anew "
        + `${episode.map_interval} s after the time before at the soonest.`;
    }
    byId("command").textContent = episode.command || "";
    byId("again").hidden = !episode.command;
  }

  buttons() {
    const on = (id, act) => document.getElementById(id).addEventListener("click", act);
    on("play", () => this.toggle());
    on("first", () => this.seek(0));
    on("last", () => this.seek(this.episode.steps - 1));
    on("back", () => this.go(-1));
    on("on", () => this.go(1));
    on("slower", () => this.faster(0.5));
    on("faster", () => this.faster(2));
    on("follow", () => this.toggleFollow());
    on("fit", () => this.fitAll());
    on("theme", () => this.theme());
    on("help", () => this.help());
    on("close", () => this.help());
    on("copy", () => this.copy());
  }

  press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { target } = event;
    if (target.tagName === "SELECT") return;
    const pressed = target.tagName === "BUTTON" || target.type === "checkbox";
    if (pressed && [" ", "Enter"].includes(event.key)) return; // The browser presses it.
    const acts = {
      " ": () => this.toggle(),
      n: () => this.go(1),
      b: () => this.go(-1),
      ArrowLeft: () => this.seekTime(this.time - 10),
      ArrowRight: () => this.seekTime(this.time + 10),
      Home: () => this.seek(0),
      End: () => this.seek(this.episode.steps - 1),
      "+": () => this.faster(2),
      "-": () => this.faster(0.5),
      e: () => this.goToEvent(true),
      E: () => this.goToEvent(false),
      f: () => this.toggleFollow(),
      0: () => this.fitAll(),
      d: () => this.theme(),
      "[": () => this.zoom(1 / 1.3),
      "]": () => this.zoom(1.3),
      "?": () => this.help(),
      h: () => this.help(),
    };
    const pans = { ArrowLeft: [60, 0], ArrowRight: [-60, 0], ArrowUp: [0, 60], ArrowDown: [0, -60] };
    const act = event.shiftKey && pans[event.key] ? () => this.pan(...pans[event.key])
      : acts[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  }

  /** Zoom about the middle. */
  zoom(factor) {
    this.camera.zoom(factor, 0, 0);
    this.redraw();
  }

  /** Move the pictures by pixels. */
  pan(dx, dy) {
    this.camera.pan(dx, dy);
    this.follow = false;
    this.redraw();
  }

  help() {
    const dialog = document.getElementById("overlay");
    if (dialog.open) dialog.close();
    else dialog.showModal();
  }

  toggle(playing = !this.playing) {
    if (playing && this.step >= this.episode.steps - 1) this.seek(0);
    this.playing = playing;
    this.before = null;
    const button = document.getElementById("play");
    button.textContent = playing ? "❚❚" : "▶";
    button.setAttribute("aria-label", playing ? "pause" : "play");
    if (!playing) this.say();
  }

  faster(factor) {
    this.speed = Math.min(Math.max(this.speed * factor, 0.1), 1000);
    this.redraw();
  }

  go(steps) {
    this.toggle(false);
    this.seek(this.step + steps);
  }

  goToEvent(forward) {
    const step = this.timeline.neighbour(this.step, forward);
    if (step === null) return;
    this.toggle(false);
    this.seek(step);
  }

  seekTime(time) {
    this.seek(countUpTo(this.episode.times, time + 1e-9) - 1);
  }

  seek(step) {
    this.step = Math.min(Math.max(step, 0), this.episode.steps - 1);
    this.time = this.episode.times[this.step];
    this.redraw();
    if (!this.playing) this.say();
  }

  toggleFollow() {
    this.follow = !this.follow && this.panels.length > 0;
    if (this.follow && this.camera.fitted) this.camera.scale *= 3;
    this.camera.fitted = false;
    this.redraw();
  }

  /** Show all in the smallest of the panels that share a camera. */
  fit(camera = this.camera) {
    this.follow &&= camera !== this.camera;
    const sizes = this.panels.filter((panel) => panel.camera === camera)
      .map(({ canvas }) => [canvas.clientWidth, canvas.clientHeight])
      .filter(([width, height]) => width && height);
    if (!sizes.length) return;
    camera.fit(Math.min(...sizes.map(([width]) => width)),
      Math.min(...sizes.map(([, height]) => height)));
    this.redraw();
  }

  fitAll() {
    for (const camera of new Set(this.panels.map((panel) => panel.camera))) this.fit(camera);
  }

  theme(name = document.documentElement.dataset.theme === "dark" ? "light" : "dark") {
    document.documentElement.dataset.theme = name;
    this.colours = {};
    if (this.charts) {
      for (const chart of this.charts) chart.make();
      this.timeline.draw();
    }
    this.redraw();
  }

  /** Return the colour of a style, as #rrggbb. */
  colour(style) {
    this.colours[style] ??= getComputedStyle(document.documentElement)
      .getPropertyValue(`--${style}`).trim();
    return this.colours[style];
  }

  async copy() {
    const { command } = this.episode;
    const button = document.getElementById("copy");
    try {
      await navigator.clipboard.writeText(command);
      button.textContent = "copied";
    } catch {
      getSelection().selectAllChildren(document.getElementById("command"));
      button.textContent = "selected: press Ctrl+C";
    }
    setTimeout(() => { button.textContent = "copy"; }, 2000);
  }

  readHash() {
    const found = /[#&]t=(\d+(?:\.\d+)?)/.exec(location.hash);
    if (!found) return;
    this.toggle(false);
    this.seekTime(Number(found[1]));
  }

  /** Tell where the player stands: in the address, and to screen readers. */
  say() {
    clearTimeout(this.saying);
    this.saying = setTimeout(() => {
      const { timeline, step } = this;
      const event = timeline.events[timeline.current];
      const text = event && event.step === step ? `, ${event.text}` : "";
      document.getElementById("live").textContent = `${clock(this.time)}${text}`;
      try {
        history.replaceState(null, "", `#t=${this.time.toFixed(1)}`);
      } catch { /* A page inside another has no address of its own. */ }
    }, 200);
  }

  redraw() {
    this.stale = true;
  }

  loop(now) {
    requestAnimationFrame((next) => this.loop(next));
    if (this.playing) {
      if (this.before !== null) this.advance(((now - this.before) / 1000) * this.speed);
      this.before = now;
    }
    if (this.stale) {
      this.stale = false;
      this.draw();
    }
  }

  /** Advance by simulated seconds. */
  advance(seconds) {
    const { times, steps } = this.episode;
    this.time += seconds;
    let moved = false;
    while (this.step < steps - 1) {
      const wait = times[this.step + 1] - times[this.step];
      // A step that takes longer than the longest is cut short.
      if (wait > LONGEST_STEP && this.time - times[this.step] >= LONGEST_STEP) {
        this.time += wait - LONGEST_STEP;
      }
      if (times[this.step + 1] > this.time) break;
      this.step++;
      moved = true;
    }
    if (moved) this.redraw();
    if (this.step >= steps - 1) {
      this.time = times[this.step];
      this.toggle(false);
    }
  }

  draw() {
    const { episode, step, camera } = this;
    if (this.follow) [camera.x, camera.y] = this.leader(step);
    for (const panel of this.panels) panel.draw(step);
    for (const chart of this.charts) chart.show(step);
    this.timeline.show(step);
    document.getElementById("clock").textContent =
      `${clock(episode.times[step])} / ${clock(episode.times[episode.steps - 1])}`;
    document.getElementById("speed").textContent = `× ${this.speed}`;
    document.getElementById("follow").setAttribute("aria-pressed", String(this.follow));
    document.getElementById("figures").textContent = this.figures(step);
  }

  /** Return the position that a view which follows is about. */
  leader(step) {
    const poses = this.episode.poses.length ? this.episode.poses : this.episode.tracks[0].beliefs;
    return [poses[3 * step], poses[3 * step + 1]];
  }

  /** Return the numbers of a moment. */
  figures(step) {
    const { episode } = this;
    const parts = [`step ${step}`];
    if (episode.lengths.length) {
      const out = episode.wayOut.length ? episode.lengths[0] : 0;
      const driven = `${(episode.lengths[step] - out).toFixed(1)} m driven`;
      parts.push(out ? `${driven} after ${out.toFixed(1)} m on the way out` : driven);
    }
    if (episode.updates.length) parts.push(`${episode.updates[step]} updates`);
    for (const { name, values } of episode.curves.slice(0, 1)) {
      if (values[step] !== null) parts.push(`${name} ${values[step].toFixed(2)}`);
    }
    if (episode.terms.length) {
      const sum = episode.terms.reduce((total, { values }) => total + values[step], 0);
      parts.push(`reward ${sum.toFixed(2)}`);
    }
    const room = episode.rooms[episode.roomNumbers[step]];
    if (room) parts.push(`in ${room}`);
    return parts.join(" · ");
  }
}

(async () => {
  const failed = document.getElementById("failed");
  try {
    const data = await readData(document.getElementById("data").textContent);
    document.head.append(element("script", { text: data.facts.library })); // It draws the curves.
    window.player = new Player(new Episode(data));
    failed.remove();
    document.documentElement.dataset.ready = "true";
  } catch (error) {
    failed.textContent = `This page cannot be shown: ${error.message}. It needs a browser of 2023 `
      + "or later.";
    failed.hidden = false;
    throw error;
  }
})();
