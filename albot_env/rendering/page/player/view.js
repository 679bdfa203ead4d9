"use strict";
// Panels that draw the truth, a map, or a network's activity on a canvas, in millimetres.

/** The part of the plane that panels show; those of the truth and of maps share one. */
class Camera {
  constructor() {
    this.x = 0;
    this.y = 0;
    this.scale = 0.02; // Pixels a millimetre.
    this.bounds = [0, 0, 1, 1];
    this.fitted = true;
  }

  fit(width, height) {
    const [x0, y0, x1, y1] = this.bounds;
    this.x = (x0 + x1) / 2;
    this.y = (y0 + y1) / 2;
    this.scale = Math.min(width / Math.max(x1 - x0, 1), height / Math.max(y1 - y0, 1)) * 0.94;
    this.fitted = true;
  }

  /** Move what is shown by pixels. */
  pan(dx, dy) {
    this.x -= dx / this.scale;
    this.y += dy / this.scale;
    this.fitted = false;
  }

  /** Zoom by a factor so that the point at a place of the panel stays there. */
  zoom(factor, dx, dy) {
    const scale = Math.min(Math.max(this.scale * factor, 1e-4), 5);
    this.x += dx * (1 / this.scale - 1 / scale);
    this.y -= dy * (1 / this.scale - 1 / scale);
    this.scale = scale;
    this.fitted = false;
  }
}

/** A canvas with a title and a legend whose entries show or hide what they name. */
class Panel {
  constructor(title, camera, player) {
    this.camera = camera;
    this.player = player;
    this.hidden = new Set();
    this.canvas = element("canvas", { role: "img", "aria-label": title, tabindex: "-1" });
    this.legend = element("div", { class: "legend" });
    this.note = element("div", { class: "note", hidden: "" });
    this.root = element("section", { class: "panel", "aria-label": title },
      element("h2", { text: title }), element("div", { class: "frame" }, this.canvas, this.note),
      this.legend);
    this.context = this.canvas.getContext("2d");
    new ResizeObserver(() => this.resize()).observe(this.canvas);
    this.listen();
  }

  resize() {
    const ratio = window.devicePixelRatio || 1;
    const { clientWidth, clientHeight } = this.canvas;
    this.canvas.width = Math.max(1, Math.round(clientWidth * ratio));
    this.canvas.height = Math.max(1, Math.round(clientHeight * ratio));
    if (this.camera.fitted) this.player.fit(this.camera);
    this.player.redraw();
  }

  listen() {
    const { canvas, camera, player } = this;
    const held = new Map(); // Where each finger or the mouse was last.
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const { left, top, width, height } = canvas.getBoundingClientRect();
      camera.zoom(Math.exp(-event.deltaY / 400), event.clientX - left - width / 2,
        event.clientY - top - height / 2);
      player.redraw();
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => {
      if (event.button) return;
      held.set(event.pointerId, [event.clientX, event.clientY]);
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!event.buttons) held.delete(event.pointerId);
      const before = held.get(event.pointerId);
      if (before) {
        const now = [event.clientX, event.clientY];
        held.set(event.pointerId, now);
        if (held.size === 1) this.pan(now[0] - before[0], now[1] - before[1]);
        else this.pinch(event.pointerId, before, now, held);
      }
      this.inspect(event);
    });
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, (event) => held.delete(event.pointerId));
    }
    canvas.addEventListener("pointerleave", () => { this.note.hidden = true; });
    canvas.addEventListener("dblclick", () => player.fit(camera));
  }

  /** Move the picture by pixels. */
  pan(dx, dy) {
    this.camera.pan(dx, dy);
    this.player.follow = false;
    this.player.redraw();
  }

  /** Zoom as one of two fingers moves, about the other one. */
  pinch(id, before, now, held) {
    const other = [...held].find(([each]) => each !== id)[1];
    const distance = ([x, y]) => Math.max(Math.hypot(x - other[0], y - other[1]), 1);
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    this.camera.zoom(distance(now) / distance(before), other[0] - left - width / 2,
      other[1] - top - height / 2);
    this.player.redraw();
  }

  /** Show what is under the pointer. */
  inspect(event) {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const [px, py] = [event.clientX - left, event.clientY - top];
    const x = this.camera.x + (px - width / 2) / this.camera.scale;
    const y = this.camera.y - (py - height / 2) / this.camera.scale;
    const found = this.find(x, y, 9 / this.camera.scale);
    const at = `${(x / 1000).toFixed(2)}, ${(y / 1000).toFixed(2)} m`;
    this.note.textContent = found ? `${found}\n${at}` : at;
    this.note.hidden = false;
    this.note.style.left = `${Math.min(px + 14, width - this.note.offsetWidth - 4)}px`;
    this.note.style.top = `${Math.min(py + 14, height - this.note.offsetHeight - 4)}px`;
  }

  /** Return what lies within a distance of a point, as a text; overridden. */
  find() {
    return "";
  }

  /** Begin a frame: clear, and draw in millimetres from now on. */
  begin() {
    const { canvas, context, camera } = this;
    const ratio = canvas.width / Math.max(canvas.clientWidth, 1);
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, canvas.width, canvas.height);
    const scale = camera.scale * ratio;
    this.pixel = 1 / camera.scale; // A pixel of the page, in millimetres.
    context.setTransform(scale, 0, 0, -scale, canvas.width / 2 - camera.x * scale,
      canvas.height / 2 + camera.y * scale);
    context.lineCap = context.lineJoin = "round";
  }

  stroke(path, style, width = 1.5, dash = []) {
    const { context } = this;
    context.strokeStyle = this.player.colour(style);
    context.lineWidth = width * this.pixel;
    context.setLineDash(dash.map((part) => part * this.pixel));
    context.stroke(path);
    context.setLineDash([]);
  }

  robot(x, y, heading, radius, style = "robot") {
    const path = new Path2D();
    const size = Math.max(radius, 5 * this.pixel);
    path.arc(x, y, size, 0, 2 * Math.PI);
    path.moveTo(x, y);
    path.lineTo(x + 1.7 * size * Math.cos(heading), y + 1.7 * size * Math.sin(heading));
    this.stroke(path, style, 2);
  }

  home(x, y) {
    const path = new Path2D();
    const size = Math.max(250, 7 * this.pixel);
    path.moveTo(x - size, y);
    path.lineTo(x, y + size);
    path.lineTo(x + size, y);
    path.lineTo(x + 0.7 * size, y);
    path.lineTo(x + 0.7 * size, y - 0.8 * size);
    path.lineTo(x - 0.7 * size, y - 0.8 * size);
    path.lineTo(x - 0.7 * size, y);
    path.closePath();
    this.stroke(path, "home", 2);
  }

  dots(points, style, size = 2) {
    const { context } = this;
    context.fillStyle = this.player.colour(style);
    const side = size * this.pixel;
    for (let k = 0; k < points.length; k += 2) {
      context.fillRect(points[k] - side / 2, points[k + 1] - side / 2, side, side);
    }
  }

  /** Draw named marks; a name stands beside its mark, upright. */
  marks(marks, style) {
    const { context } = this;
    context.fillStyle = this.player.colour(style);
    const radius = 4 * this.pixel;
    for (const { x, y } of marks) {
      context.beginPath();
      context.arc(x, y, radius, 0, 2 * Math.PI);
      context.fill();
    }
    context.save();
    context.font = "12px system-ui, sans-serif";
    const { a, d, e, f } = context.getTransform();
    const ratio = this.canvas.width / Math.max(this.canvas.clientWidth, 1);
    for (const { x, y, name } of marks) {
      context.setTransform(ratio, 0, 0, ratio, a * x + e, d * y + f);
      context.fillText(name, 6, -5);
    }
    context.restore();
  }

  /** Add an entry of the legend. */
  entry(label, style) {
    if (this.legend.querySelector(`[data-label="${CSS.escape(label)}"]`)) return;
    const box = element("input", { type: "checkbox", checked: "" });
    box.addEventListener("change", () => {
      if (box.checked) this.hidden.delete(label);
      else this.hidden.add(label);
      this.player.redraw();
    });
    this.legend.append(element("label", { "data-label": label }, box,
      element("span", { class: "swatch", style: `background:var(--${style})` }), label));
  }

  shows(label) {
    return !this.hidden.has(label);
  }
}

/** A path of poses up to a step, extended as steps go on. */
class GrowingPath {
  constructor(poses) {
    this.poses = poses;
    this.clear();
  }

  clear() {
    this.path = new Path2D();
    this.step = -1;
    this.x = this.y = Infinity;
  }

  upTo(step) {
    if (step < this.step) this.clear();
    const { poses, path } = this;
    for (let k = this.step + 1; k <= step; k++) {
      const [x, y] = [poses[3 * k], poses[3 * k + 1]];
      if (Math.abs(x - this.x) + Math.abs(y - this.y) < 20 && k < step) continue;
      if (this.step < 0) path.moveTo(x, y);
      else path.lineTo(x, y);
      [this.x, this.y, this.step] = [x, y, k];
    }
    return path;
  }
}

function segmentsPath(table, version) {
  const path = new Path2D();
  const { rows } = table;
  table.each(version, (k) => {
    path.moveTo(rows[k], rows[k + 1]);
    path.lineTo(rows[k + 2], rows[k + 3]);
  });
  return path;
}

/** Return the stops of a guided tour up to a step; the first is stop 2, as home is the first. */
function stopsUpTo(poses, step) {
  const stops = [];
  for (let k = 0; k <= step; k++) {
    const [x, y] = [poses[3 * k], poses[3 * k + 1]];
    const before = stops[stops.length - 1];
    if (!before || before.x !== x || before.y !== y) stops.push({ x, y, name: String(k + 2) });
  }
  return stops;
}

/** Return the distance of a point from a segment. */
function distanceTo(x, y, x1, y1, x2, y2) {
  const [dx, dy] = [x2 - x1, y2 - y1];
  const along = ((x - x1) * dx + (y - y1) * dy) / Math.max(dx * dx + dy * dy, 1e-9);
  const share = Math.min(Math.max(along, 0), 1);
  return Math.hypot(x1 + share * dx - x, y1 + share * dy - y);
}

/** The truth. */
class TruthPanel extends Panel {
  constructor(episode, camera, player) {
    super("the truth", camera, player);
    this.episode = episode;
    this.walls = { rows: episode.walls, each: (_, use) => {
      for (let k = 0; k < episode.walls.length; k += 4) use(k, 0);
    } };
    this.wallPath = segmentsPath(this.walls, 0);
    this.wayOut = new Path2D();
    for (let k = 0; k < episode.wayOut.length; k += 2) {
      this.wayOut.lineTo(episode.wayOut[k], episode.wayOut[k + 1]);
    }
    this.path = new GrowingPath(episode.poses);
    if (episode.walls.length) this.entry("walls", "wall");
    if (episode.things.births.length) this.entry("dynamic obstacles", "thing");
    if (episode.scans) this.entry("laser", "laser");
    if (episode.wayOut.length) this.entry("way out", "path");
    this.entry(episode.led ? "stops" : "path", "path");
    this.entry("home", "home");
  }

  draw(step) {
    const { episode } = this;
    this.begin();
    if (this.shows("walls")) this.stroke(this.wallPath, "wall");
    if (this.shows("dynamic obstacles")) {
      this.stroke(segmentsPath(episode.things, step), "thing");
    }
    if (episode.scans && this.shows("laser")) this.dots(episode.hits(step), "laser");
    if (this.shows("way out")) this.stroke(this.wayOut, "path", 0.8);
    if (episode.led) {
      if (this.shows("stops")) this.marks(stopsUpTo(episode.poses, step), "path");
    } else if (this.shows("path")) this.stroke(this.path.upTo(step), "path");
    const [x, y] = episode.start;
    if (this.shows("home")) this.home(1000 * x, 1000 * y);
    this.robot(...episode.pose(step), 1000 * episode.radius);
  }

  find(x, y, reach) {
    const { episode } = this;
    const [rx, ry, heading] = episode.pose(this.player.step);
    if (Math.hypot(rx - x, ry - y) < Math.max(reach, 1000 * episode.radius)) {
      const at = `${(rx / 1000).toFixed(2)}, ${(ry / 1000).toFixed(2)} m`;
      return `the robot at ${at}, ${((heading * 180) / Math.PI).toFixed(0)}°`;
    }
    return nearest(x, y, reach, this.walls, 0, () => "wall");
  }
}

/** Return what a text says of the segment nearest to a point, within reach. */
function nearest(x, y, reach, table, version, say) {
  let [best, found] = [reach, ""];
  const { rows } = table;
  table.each(version, (k, birth) => {
    const distance = distanceTo(x, y, rows[k], rows[k + 1], rows[k + 2], rows[k + 3]);
    if (distance < best) {
      best = distance;
      const length = Math.hypot(rows[k + 2] - rows[k], rows[k + 3] - rows[k + 1]) / 1000;
      found = `${say(birth)}, ${length.toFixed(2)} m`;
    }
  });
  return found;
}

/** What a mapper believes. */
class MapPanel extends Panel {
  constructor(track, episode, camera, player) {
    super(`what the robot believes (${track.mapper})`, camera, player);
    this.track = track;
    this.episode = episode;
    this.path = new GrowingPath(track.beliefs);
    this.version = -2;
    this.paths = new Map();
    this.image = document.createElement("canvas");
    for (const channel of track.channels) this.entry(channel.label, channel.style);
    this.entry(episode.led ? "stops" : "path", "believed");
    this.entry("home", "home");
  }

  draw(step) {
    const { track, episode, context } = this;
    const version = track.version(step);
    if (version !== this.version) this.paths.clear();
    this.begin();
    const channels = track.channels.filter(({ label }) => this.shows(label));
    for (const channel of channels) {
      if (channel.kind === "grid") this.drawGrid(channel.table, version);
    }
    for (const { kind, style, table, names, label } of channels) {
      const { rows } = table;
      if (kind === "segments") {
        if (!this.paths.has(label)) this.paths.set(label, segmentsPath(table, version));
        const dash = style === "doorway" ? [5, 4] : [];
        this.stroke(this.paths.get(label), style, style === "link" ? 1 : 1.5, dash);
      } else if (kind === "line") {
        const path = new Path2D();
        table.each(version, (k) => path.lineTo(rows[k], rows[k + 1]));
        this.stroke(path, style, 2);
      } else if (kind === "dots") {
        const points = [];
        table.each(version, (k) => points.push(rows[k], rows[k + 1]));
        this.dots(points, style, 3);
      } else if (kind === "marks") {
        const marks = [];
        table.each(version, (k) => marks.push(
          { x: rows[k], y: rows[k + 1], name: names[rows[k + 2]] }));
        this.marks(marks, style);
      }
    }
    if (episode.led) {
      if (this.shows("stops")) this.marks(stopsUpTo(track.beliefs, step), "believed");
    } else if (this.shows("path")) this.stroke(this.path.upTo(step), "believed");
    const at = (poses) => [poses[3 * step], poses[3 * step + 1], poses[3 * step + 2] / 1e4];
    const [hx, hy] = at(track.homes);
    if (this.shows("home")) this.home(hx, hy);
    this.robot(...at(track.beliefs), 1000 * episode.radius);
    this.version = version;
    context.globalAlpha = 1;
  }

  /** Draw an occupancy grid: dark where it is occupied, tinted where it is free. */
  drawGrid(table, version) {
    const grid = table.at(version);
    if (!grid) return;
    const { context, image } = this;
    const { rows, columns, cells, place } = grid;
    const key = `${version} ${document.documentElement.dataset.theme}`;
    if (this.imageKey !== key) {
      image.width = columns;
      image.height = rows;
      const colours = cellColours(this.player);
      const pixels = new ImageData(columns, rows);
      new Uint32Array(pixels.data.buffer).set(Uint32Array.from(cells, (cell) => colours[cell]));
      image.getContext("2d").putImageData(pixels, 0, 0);
      this.imageKey = key;
    }
    context.save();
    context.translate(1000 * place[0], 1000 * place[1]);
    context.rotate(place[2]);
    context.imageSmoothingEnabled = false;
    const side = 1000 * place[3];
    context.drawImage(image, 0, 0, columns * side, rows * side);
    context.restore();
  }

  find(x, y, reach) {
    const { track, player } = this;
    const version = track.version(player.step);
    const since = (birth) => `since ${clock(player.episode.times[track.mapSteps[birth]])}`;
    for (const { kind, table, names, label } of [...track.channels].reverse()) {
      if (!this.shows(label)) continue;
      const { rows } = table;
      let found = "";
      if (kind === "marks" || kind === "dots") {
        let best = reach;
        table.each(version, (k, birth) => {
          const distance = Math.hypot(rows[k] - x, rows[k + 1] - y);
          if (distance < best) {
            best = distance;
            const name = kind === "marks" ? ` ${names[rows[k + 2]]}` : "";
            found = `${label.replace(/s$/, "")}${name}, here ${since(birth)}`;
          }
        });
      } else if (kind === "segments") {
        const one = label.replace(/s$/, "");
        found = nearest(x, y, reach, table, version, (birth) => `${one}, here ${since(birth)}`);
      } else if (kind === "grid") {
        found = cellText(table.at(version), x / 1000, y / 1000);
      }
      if (found) return found;
    }
    return "";
  }
}

/** Return what a cell of a grid holds at a point (m). */
function cellText(grid, x, y) {
  if (!grid) return "";
  const [x0, y0, heading, side] = grid.place;
  const [dx, dy, cos, sin] = [x - x0, y - y0, Math.cos(heading), Math.sin(heading)];
  const column = Math.floor((cos * dx + sin * dy) / side);
  const row = Math.floor((cos * dy - sin * dx) / side);
  if (column < 0 || row < 0 || column >= grid.columns || row >= grid.rows) return "";
  const cell = grid.cells[row * grid.columns + column];
  return cell === 255 ? "unknown" : `occupied with ${((100 * cell) / 254).toFixed(0)} %`;
}

/** Return the colour of each byte of a grid, as 32 bits. */
function cellColours(player) {
  const parts = (style) => {
    const [, r, g, b] = /^#(..)(..)(..)/.exec(player.colour(style)).map((part) => parseInt(part, 16));
    return [r, g, b];
  };
  const [free, wall] = [parts("free"), parts("wall")];
  return Array.from({ length: 256 }, (_, cell) => {
    if (cell === 255) return 0;
    const share = cell / 254;
    const [r, g, b] = free.map((from, k) => Math.round(from + share * (wall[k] - from)));
    return ((255 << 24) | (b << 16) | (g << 8) | r) >>> 0;
  });
}

/** The activity of a network over its plane, which wraps round. */
class ActivityPanel extends Panel {
  constructor(track, player) {
    super("the network's activity", new Camera(), player);
    this.activity = track.activity;
    const { rows, columns, cell } = this.activity;
    this.camera.bounds = [-500, -500, 1000 * columns * cell + 500, 1000 * rows * cell + 500];
    this.entry("activity", "activity");
    this.entry("packet's path", "believed");
  }

  draw(step) {
    const { rows, columns, cell, cells, steps, packets } = this.activity;
    const { context } = this;
    const [width, height] = [1000 * columns * cell, 1000 * rows * cell];
    const version = countUpTo(steps, step) - 1;
    this.begin();
    const frame = new Path2D();
    frame.rect(0, 0, width, height);
    this.stroke(frame, "grid", 1);
    if (version < 0) return;
    if (this.shows("activity")) {
      context.fillStyle = this.player.colour("activity");
      const side = 1000 * cell;
      cells.each(version, (k) => {
        context.globalAlpha = cells.rows[k + 2] / 255;
        context.fillRect(cells.rows[k] * side, cells.rows[k + 1] * side, side, side);
      });
      context.globalAlpha = 1;
    }
    if (this.shows("packet's path")) {
      const path = new Path2D();
      for (let k = 1; k <= version; k++) {
        const [x0, y0, x1, y1] = [packets[3 * k - 3], packets[3 * k - 2], packets[3 * k],
          packets[3 * k + 1]];
        if (Math.abs(x1 - x0) > width / 2 || Math.abs(y1 - y0) > height / 2) continue;
        path.moveTo(x0, y0);
        path.lineTo(x1, y1);
      }
      this.stroke(path, "believed", 1);
    }
    const last = 3 * version;
    this.robot(packets[last], packets[last + 1], packets[last + 2] / 1e4, 0);
  }
}
