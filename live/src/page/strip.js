// One strip chart: its name, its read-out, its curves. What time it shows is told by `charts.js`, to all strips alike.

import uPlot from "/assets/vendor/uplot/uPlot.esm.js";
import { LOOKS } from "./chart_list.js";
import { drawn, element, say } from "./dom.js";
import { colour } from "./theme.js";
import { number } from "./units.js";

const AXIS_PX = 54;
const FONT = "12px system-ui, -apple-system, 'Segoe UI', Roboto, Arial, sans-serif";
/** Room above and below the curves, as a share of their range. */
const ROOM = 0.08;
const TICK_PX = 7;

export class Strip {
  /** `chart` is an entry of the list; `handlers` has `zoomed(from_s, to_s)`, `resumed()` and `pointed(t_s or null)`. */
  constructor(chart, handlers) {
    this.chart = chart;
    this.values = chart.lines.map(() => element("output", {}, "–"));
    const entries = chart.lines.map((line, place) =>
      element("li", {}, sample(line.look), element("span", {}, line.name), this.values[place]),
    );
    this.plotted = element("div", { class: "plotted" });
    this.element = element(
      "figure",
      { class: "strip", "data-chart": chart.title },
      element(
        "figcaption",
        {},
        element("span", { class: "strip-name" }, chart.title, element("span", { class: "soft" }, ` ${chart.of.unit}`)),
        element("ul", { class: "legend" }, ...entries),
      ),
      this.plotted,
    );
    this.options = this.optionsWith(handlers);
    this.plot = null;
  }

  /** Fits the plot to a size in pixels. */
  fit(width, height) {
    if (this.plot) {
      this.plot.setSize({ width, height });
      return;
    }
    const nothing = [[], ...this.chart.lines.map(() => [])];
    this.plot = new uPlot({ ...this.options, width, height }, nothing, this.plotted);
  }

  /** Shows these rows between two times. */
  show(rows, from_s, to_s, marks) {
    this.marks = marks;
    const { factor } = this.chart.of;
    const data = [rows.t_s, ...this.chart.lines.map((line) => rows.column(line.column, factor))];
    this.plot.batch(() => {
      this.plot.setData(data, false);
      this.plot.setScale("x", { min: from_s, max: to_s });
    });
    this.read();
  }

  /** Tells the newest values of rows without drawing them: for a strip that nobody sees, but somebody may hear. */
  tell(rows) {
    this.chart.lines.forEach((line, place) => say(this.values[place], number(rows.last(line.column), this.chart.of)));
  }

  /** Colours may have changed. */
  recolour() {
    this.plot?.redraw(false, true);
  }

  /** Puts the cursor at a time; null takes it away. */
  point(t_s) {
    const left = t_s === null ? -10 : this.plot.valToPos(t_s, "x");
    this.plot.setCursor({ left, top: t_s === null ? -10 : 10 });
  }

  /** Tells the values at the cursor, or the newest ones. */
  read() {
    const { data, cursor } = this.plot;
    const index = cursor.idx ?? data[0].length - 1;
    const own = { ...this.chart.of, factor: 1 };
    this.values.forEach((output, place) => say(output, number(data[place + 1][index], own)));
  }

  optionsWith(handlers) {
    const { chart } = this;
    const grid = { stroke: () => colour("--grid"), width: 1 };
    const axis = { stroke: () => colour("--soft"), font: FONT, grid, ticks: { ...grid, size: 4 } };
    const lines = chart.lines.map(({ name, look }) => {
      const { colour: variable, dash, width = 1.8 } = LOOKS[look];
      return { label: name, stroke: () => colour(variable), width, dash, points: { show: false } };
    });
    return {
      legend: { show: false },
      // Curves between pixels, else a slow movement looks like stairs.
      pxAlign: 0,
      padding: [6, 8, 0, 0],
      scales: { x: { time: false }, y: { range: (_, low, high) => range(low, high, chart.least) } },
      series: [{}, ...lines],
      axes: [
        { ...axis, size: 26, gap: 3, values: (_, ticks) => ticks.map((t) => String(Number(t.toFixed(3)))) },
        {
          ...axis,
          size: AXIS_PX,
          space: 26,
          values: (_, ticks) => ticks.map((v) => String(Number(v.toFixed(6))).replace("-", "−")),
        },
      ],
      cursor: {
        // The read-out goes along in all strips; a drag zooms from the one in which it is.
        sync: {
          key: "strips",
          setSeries: false,
          filters: { pub: (kind) => kind === "mousemove" || kind === "mouseleave" },
        },
        drag: { x: true, y: false, setScale: false },
        y: false,
        points: { size: 6 },
        bind: { dblclick: () => () => (handlers.resumed(), null) },
      },
      hooks: {
        draw: [(plot) => this.drawMarks(plot)],
        setCursor: [
          (plot) => {
            this.read();
            if (plot.cursor.event) handlers.pointed(plot.cursor.idx === null ? null : plot.data[0][plot.cursor.idx]);
          },
        ],
        setSelect: [
          (plot) => {
            const { left, width } = plot.select;
            if (width < 4) return;
            plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
            handlers.zoomed(plot.posToVal(left, "x"), plot.posToVal(left + width, "x"));
          },
        ],
      },
    };
  }

  /** Moments that matter: a line from the top down for what stops or breaks something, a tick at the top for the rest. */
  drawMarks(plot) {
    const { ctx, bbox } = plot;
    const scale = devicePixelRatio;
    ctx.save();
    ctx.strokeStyle = colour("--bad");
    for (const { t_s, level } of this.marks ?? []) {
      const x = plot.valToPos(t_s, "x", true);
      if (x < bbox.left || x > bbox.left + bbox.width) continue;
      const isGrave = level === "error";
      ctx.setLineDash(isGrave ? [4 * scale, 3 * scale] : []);
      ctx.lineWidth = (isGrave ? 2 : 1.5) * scale;
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + (isGrave ? bbox.height : TICK_PX * scale));
      ctx.stroke();
    }
    ctx.restore();
  }
}

/** Ends of the vertical axis. */
function range(low, high, least) {
  if (low === null || high === null) return [0, least];
  const middle = (low + high) / 2;
  const half = Math.max((high - low) * (0.5 + ROOM), least / 2);
  return [middle - half, middle + half];
}

/** A piece of the line for the legend. */
function sample(look) {
  const { colour: variable, dash, width = 2 } = LOOKS[look];
  const line = drawn("path", { d: "M1 7H29", "stroke-dasharray": dash.join(" "), "stroke-width": width, fill: "none" });
  line.style.stroke = `var(${variable})`;
  return drawn("svg", { viewBox: "0 0 30 14", class: "sample", "aria-hidden": "true" }, line);
}
