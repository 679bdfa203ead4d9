"use strict";
// Curves over the episode, by uPlot, with a line at the present moment.

const PALETTE = ["believed", "path", "home", "particle", "place", "doorway", "corrected", "wall"];

/** One chart of curves over time. */
class Chart {
  constructor(title, curves, player) {
    this.title = title;
    this.curves = curves;
    this.player = player;
    this.root = element("section", { class: "chart", "aria-label": title },
      element("h2", { text: title }));
    this.holder = element("div", { class: "plot" });
    this.line = element("div", { class: "now" });
    this.root.append(this.holder);
    new ResizeObserver(() => this.resize()).observe(this.holder);
  }

  /** Make the plot; again when the colours or the curves change. */
  make() {
    const { player, curves } = this;
    const width = this.holder.clientWidth;
    if (!width) return;
    if (this.plot) this.plot.destroy();
    const axis = {
      stroke: player.colour("text"),
      grid: { stroke: player.colour("rule"), width: 1 },
      ticks: { stroke: player.colour("rule"), width: 1 },
      font: "11px system-ui, sans-serif",
    };
    const times = { ...axis, size: 26, values: (_, ticks) => ticks.map((t) => clock(t)) };
    const shown = (_, value) => (value == null ? "" : value.toFixed(2));
    this.plot = new uPlot({
      width,
      height: 150,
      scales: { x: { time: false } },
      axes: [times, { ...axis, size: 48 }],
      series: [
        { label: "time", value: (_, t) => (t == null ? "" : clock(t)) },
        ...curves.map(({ name }, k) => ({
          label: name,
          stroke: player.colour(PALETTE[k % PALETTE.length]),
          width: 1.4,
          spanGaps: true,
          points: { show: false },
          value: shown,
        })),
      ],
    }, [player.episode.times, ...curves.map(({ values }) => values)], this.holder);
    this.plot.over.append(this.line);
    this.holder.querySelector("canvas").setAttribute("aria-hidden", "true");
    for (const label of this.holder.querySelectorAll(".u-series:not(:first-child) th")) {
      label.tabIndex = 0;
      label.setAttribute("role", "button");
      label.addEventListener("keydown", (event) => {
        if (![" ", "Enter"].includes(event.key)) return;
        event.preventDefault();
        event.stopPropagation(); // Or the episode plays.
        label.click();
      });
    }
    this.plot.over.addEventListener("click", (event) => {
      // After a drag uPlot has zoomed; a plain click seeks.
      if (this.plot.select.width < 2) {
        const { left } = this.plot.over.getBoundingClientRect();
        player.seekTime(this.plot.posToVal(event.clientX - left, "x"));
      }
    });
    this.show(player.step);
  }

  resize() {
    const width = this.holder.clientWidth;
    if (!this.plot) this.make();
    else if (width && width !== this.plot.width) this.plot.setSize({ width, height: 150 });
    this.show(this.player.step);
  }

  /** Move the line to a step. */
  show(step) {
    if (!this.plot) return;
    const x = this.plot.valToPos(this.player.episode.times[step], "x");
    const inside = x >= 0 && x <= this.plot.over.clientWidth;
    this.line.style.transform = `translateX(${x}px)`;
    this.line.hidden = !inside;
  }
}

/** A chart of one of several curves, which the user chooses. */
class ChoiceChart extends Chart {
  constructor(title, curves, player) {
    super(title, curves.slice(0, 1), player);
    this.select = element("select", { "aria-label": "curve" });
    curves.forEach(({ name }, k) => this.select.append(element("option", { value: k, text: name })));
    this.select.addEventListener("change", () => {
      this.curves = [curves[this.select.value]];
      this.make();
    });
    this.root.querySelector("h2").append(" ", this.select);
  }
}

/** Return the charts of an episode: distances, rewards, and a choice of the others. */
function chartsOf(episode, player) {
  const distances = episode.curves.filter(({ name }) => /^(position error|distance)/.test(name));
  const others = episode.curves.filter((curve) => !distances.includes(curve));
  others.sort((a, b) => (b.name === "confidence") - (a.name === "confidence"));
  const charts = [];
  if (distances.length) charts.push(new Chart("distances (m)", distances, player));
  const terms = episode.terms.filter(({ values }) => values.some((value) => value !== 0));
  if (terms.length) charts.push(new Chart("reward so far, by its terms", terms, player));
  if (others.length) charts.push(new ChoiceChart("more:", others, player));
  return charts;
}
