// How often a stage took how long, both axes logarithmic as in the latency reports: since the start, and in the last ten seconds.

import { drawn, element, set } from "./dom.js";

const SIZE = { width: 420, height: 250 };
const EDGES = { left: 40, right: 26, top: 10, bottom: 34 };
const SPAN_US = [1, 10_000];
const CURVES = [
  { stage: "wake_up", name: "wake-up", look: "s0" },
  { stage: "round_trip", name: "round trip", look: "s1" },
];
/** Foot of the axis: under one sample. */
const LEAST = 0.7;
/** Ends of a bin: ten bins to a decade. */
const BIN_RATIO = 10 ** 0.1;

export class Histogram {
  constructor() {
    this.grid = drawn("g");
    this.curves = CURVES.map(({ look }) => ({
      all: drawn("path", { class: `line ${look}` }),
      recent: drawn("path", { class: `trace ${look}` }),
    }));
    const svg = drawn(
      "svg",
      {
        class: "plot",
        viewBox: `0 0 ${SIZE.width} ${SIZE.height}`,
        role: "img",
        "aria-label": "Histograms of wake-up and round trip",
      },
      this.grid,
      ...this.curves.map(({ recent }) => recent),
      ...this.curves.map(({ all }) => all),
    );
    const entry = ({ name, look }) => {
      const sample = drawn(
        "svg",
        { viewBox: "0 0 38 14", "aria-hidden": "true" },
        drawn("path", { class: `line ${look}`, d: "M1 7H37" }),
      );
      return element("li", {}, sample, element("span", {}, name));
    };
    const filled = drawn(
      "svg",
      { viewBox: "0 0 38 14", "aria-hidden": "true" },
      drawn("path", { class: "trace s0", d: "M1 13V4H37V13Z" }),
    );
    const legend = element(
      "ul",
      { class: "legend" },
      ...CURVES.map(entry),
      element("li", {}, filled, element("span", {}, "last 10 s")),
    );
    this.figure = element("div", { class: "histogram" }, element("h3", {}, "How often how long"), legend, svg);
    this.most = 0;
  }

  /** `told` has for each stage the bins that hold samples, as [upper end in us, count]. */
  show(told) {
    const of = (stage, part) => told?.[stage]?.[part] ?? [];
    const counts = CURVES.flatMap(({ stage }) => of(stage, "whole").map(([, count]) => count));
    const most = 10 ** Math.ceil(Math.log10(Math.max(10, ...counts)));
    if (most !== this.most) this.drawGrid(most);
    CURVES.forEach(({ stage }, place) => {
      set(this.curves[place].all, { d: outline(of(stage, "whole"), most, false) });
      set(this.curves[place].recent, { d: outline(of(stage, "last_10_s"), most, true) });
    });
  }

  drawGrid(most) {
    this.most = most;
    const bottom = SIZE.height - EDGES.bottom;
    const lines = [];
    for (let us = SPAN_US[0]; us <= SPAN_US[1]; us *= 10) {
      const x = xOf(us);
      lines.push(drawn("path", { class: "grid", d: `M${x} ${EDGES.top}V${bottom}` }));
      lines.push(drawn("text", { class: "middle", x, y: bottom + 16 }, us < 1000 ? `${us} µs` : `${us / 1000} ms`));
    }
    for (let count = 1; count <= most; count *= 10) {
      const y = yOf(count, most);
      lines.push(drawn("path", { class: "grid", d: `M${EDGES.left} ${y}H${SIZE.width - EDGES.right}` }));
      lines.push(drawn("text", { class: "end", x: EDGES.left - 5, y: y + 4 }, short(count)));
    }
    this.grid.replaceChildren(...lines);
  }
}

/** Steps over the bins, down to the axis where one is empty. */
function outline(bins, most, isClosed) {
  const base = yOf(LEAST, most);
  let path = "";
  let end = null;
  for (const [upper, count] of bins) {
    const [from, to, height] = [xOf(upper / BIN_RATIO), xOf(upper), yOf(count, most)];
    if (end === null || Math.abs(from - end) > 0.5) path += `${end === null ? "" : `V${base}`}M${from} ${base}`;
    path += `V${height}H${to}`;
    end = to;
  }
  return path && `${path}V${base}${isClosed ? "Z" : ""}`;
}

function xOf(us) {
  const [low, high] = SPAN_US;
  const share = Math.log10(Math.min(high, Math.max(low, us)) / low) / Math.log10(high / low);
  return round(EDGES.left + share * (SIZE.width - EDGES.left - EDGES.right));
}

function yOf(count, most) {
  const share = Math.log10(count / LEAST) / Math.log10(most / LEAST);
  return round(SIZE.height - EDGES.bottom - share * (SIZE.height - EDGES.bottom - EDGES.top));
}

function short(count) {
  return count < 1000 ? String(count) : count < 1e6 ? `${count / 1e3}k` : `${count / 1e6}M`;
}

function round(value) {
  return Math.round(value * 10) / 10;
}
