"use strict";
// Reading of the page's data: the facts (JSON) and the arrays, and tables that change with time.

/** The format that this player reads. */
const FORMAT = 1;

/**
 * Unpack the data of a page.
 * @param {string} text The content, compressed by gzip, in base64.
 * @returns {Promise<{facts: object, arrays: Object<string, object>}>}
 */
async function readData(text) {
  const packed = Uint8Array.from(atob(text.trim()), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const content = await new Response(stream).arrayBuffer();
  const length = new DataView(content).getUint32(0, true);
  const facts = JSON.parse(new TextDecoder().decode(new Uint8Array(content, 4, length)));
  if (facts.format !== FORMAT) throw new Error(`data of format ${facts.format}`);
  const begin = Math.ceil((4 + length) / 8) * 8;
  const arrays = {};
  for (const [name, entry] of Object.entries(facts.arrays)) {
    arrays[name] = unpack(content, begin + entry.at, entry);
  }
  return { facts, arrays };
}

const TYPES = { i4: Int32Array, u1: Uint8Array, u2: Uint16Array, f4: Float32Array, f8: Float64Array };

/** Return one array: `values`, one after another, and its `shape`. */
function unpack(content, at, { type, shape, across }) {
  const count = shape.reduce((product, size) => product * size, 1);
  const values = new TYPES[type](count);
  const size = values.BYTES_PER_ELEMENT;
  const source = new Uint8Array(content, at, count * size);
  const target = new Uint8Array(values.buffer);
  for (let plane = 0; plane < size; plane++) {
    const from = plane * count;
    for (let k = 0, to = plane; k < count; k++, to += size) target[to] = source[from + k];
  }
  if (type[0] !== "f") {
    // Differences: from the number above, or from the one beside it.
    const width = shape.length > 1 ? count / shape[0] : 1;
    if (across && shape.length > 1) {
      for (let k = 0; k < count; k++) if (k % width) values[k] += values[k - 1];
    } else {
      for (let k = width; k < count; k++) values[k] += values[k - width];
    }
  }
  return { values, shape, width: shape.length > 1 ? shape[1] : 1, length: shape[0] };
}

/** Return how many of the first `length` ascending numbers are at most `value`. */
function countUpTo(numbers, value, length = numbers.length) {
  let low = 0;
  let high = length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (numbers[middle] <= value) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** Rows that appear at one version and vanish at a later one. */
class LifetimeTable {
  constructor(arrays, prefix) {
    const rows = arrays[`${prefix}rows`];
    this.rows = rows.values;
    this.width = rows.width;
    this.births = arrays[`${prefix}births`].values;
    this.deaths = arrays[`${prefix}deaths`].values;
  }

  /** Call `use` with the offset and the birth of each row that lives at a version. */
  each(version, use) {
    const { births, deaths, width } = this;
    const end = countUpTo(births, version);
    for (let k = 0; k < end; k++) {
      if (deaths[k] < 0 || deaths[k] > version) use(k * width, births[k]);
    }
  }

  count(version) {
    let count = 0;
    this.each(version, () => count++);
    return count;
  }
}

/** Rows that are all new at each version. */
class FrameTable {
  constructor(arrays, prefix) {
    const rows = arrays[`${prefix}rows`];
    this.rows = rows.values;
    this.width = rows.width;
    this.versions = arrays[`${prefix}versions`].values;
    this.ends = arrays[`${prefix}ends`].values;
  }

  /** Call `use` with the offset of each row at a version. */
  each(version, use) {
    const frame = countUpTo(this.versions, version) - 1;
    if (frame < 0) return;
    const begin = frame ? this.ends[frame - 1] : 0;
    for (let k = begin; k < this.ends[frame]; k++) use(k * this.width, this.versions[frame]);
  }
}

/** An occupancy grid: whole now and then, and in between the cells that change. */
class GridTable {
  constructor(arrays, prefix) {
    for (const name of ["whole", "places", "cells", "versions", "ends", "changed", "values"]) {
      this[name] = arrays[prefix + name].values;
    }
    this.begins = []; // Where the cells of each whole grid begin.
    this.wholeVersions = [];
    let begin = 0;
    for (let k = 0; k < this.whole.length; k += 3) {
      this.wholeVersions.push(this.whole[k]);
      this.begins.push(begin);
      begin += this.whole[k + 1] * this.whole[k + 2];
    }
    this.now = null;
  }

  /** Return the grid of a version: `cells`, `rows`, `columns`, `place`; null before the first. */
  at(version) {
    const last = countUpTo(this.versions, version) - 1;
    if (last < 0) return null;
    const number = countUpTo(this.wholeVersions, version) - 1;
    let now = this.now;
    if (!now || now.number !== number || now.last > last) {
      const [rows, columns] = [this.whole[3 * number + 1], this.whole[3 * number + 2]];
      const begin = this.begins[number];
      const first = countUpTo(this.versions, this.wholeVersions[number]) - 1;
      now = {
        number, rows, columns, last: first,
        cells: this.cells.slice(begin, begin + rows * columns),
        place: this.places.slice(4 * number, 4 * number + 4),
      };
    }
    for (; now.last < last; now.last++) {
      for (let k = this.ends[now.last]; k < this.ends[now.last + 1]; k++) {
        now.cells[this.changed[k]] = this.values[k];
      }
    }
    this.now = now;
    return now;
  }
}

/** What one mapper believed. */
class Track {
  constructor(facts, arrays, prefix) {
    this.mapper = facts.mapper;
    this.beliefs = arrays[`${prefix}beliefs`].values;
    this.homes = arrays[`${prefix}homes`].values;
    this.mapSteps = arrays[`${prefix}map_steps`].values;
    const kinds = { grid: GridTable, line: FrameTable };
    this.channels = facts.channels.map((channel, number) => {
      const table = new (kinds[channel.kind] || LifetimeTable)(arrays, `${prefix}${number}.`);
      return { ...channel, table };
    });
    this.errors = (arrays[`${prefix}errors`] || { values: null }).values;
    this.activity = facts.activity && {
      ...facts.activity,
      cells: new FrameTable(arrays, `${prefix}activity.`),
      steps: arrays[`${prefix}activity.steps`].values,
      packets: arrays[`${prefix}activity.packets`].values,
    };
  }

  /** Return the version of the map at a step; -1 before the first. */
  version(step) {
    return countUpTo(this.mapSteps, step) - 1;
  }
}

/** Return a time as minutes and seconds, such as 1:23.2. */
function clock(seconds) {
  const tenths = Math.round(seconds * 10);
  const rest = (tenths % 600) / 10;
  return `${Math.floor(tenths / 600)}:${rest < 10 ? "0" : ""}${rest.toFixed(1)}`;
}

/** Return a new element with a class and a text. */
function element(name, { text = "", ...attributes } = {}, ...children) {
  const made = document.createElement(name);
  if (text) made.textContent = text;
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}
