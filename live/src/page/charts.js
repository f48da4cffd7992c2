// The strip charts together: one time axis for all, which follows the newest row until somebody pauses, zooms or moves it.

import { CHARTS } from "./chart_list.js";
import { byId, element, say, set } from "./dom.js";
import { KEPT_S } from "./store.js";
import { Strip } from "./strip.js";
import { onColours } from "./theme.js";

const SPANS_S = [2, 5, 10, 20, 60];
const USUAL_S = 10;
const SHORTEST_S = 0.05;
const STRIP_PX = { wide: 128, narrow: 118 };
const NARROW_PX = 600;
const ZOOM = 2;
/** Times that a chart is drawn in a second: a minute has six times the points of ten seconds. */
const drawings = (span_s) => (span_s > 30 ? 4 : span_s > 10 ? 10 : 20);

export class Charts {
  constructor(store) {
    this.store = store;
    /** Rows that stay as they were when somebody paused; null while the newest are followed. */
    this.kept = null;
    this.span_s = USUAL_S;
    this.end_s = null;
    this.visible = new Set();
    this.drawn_ms = 0;
    this.pointed_s = null;
    const handlers = {
      zoomed: (from_s, to_s) => this.look(to_s, to_s - from_s),
      resumed: () => this.resume(),
      pointed: (t_s) => this.tell(t_s),
    };
    this.strips = CHARTS.map((chart) => new Strip(chart, handlers));
    this.place = byId("strips");
    this.place.append(...this.strips.map((strip) => strip.element));
    this.watchSizes();
    this.furnishTools();
    onColours(() => this.strips.forEach((strip) => strip.recolour()));
  }

  /** Draws what is due; called with every frame of the browser. */
  frame(now_ms) {
    if (this.kept || now_ms - this.drawn_ms < 1000 / drawings(this.span_s) - 4) return;
    this.drawn_ms = now_ms;
    this.draw();
  }

  draw() {
    const rows = this.kept ?? this.store;
    if (rows.t_s.length === 0) return;
    const to_s = this.kept ? this.end_s : rows.last_s;
    const from_s = to_s - this.span_s;
    const shown = rows.between(from_s, to_s);
    for (const strip of this.strips) {
      if (strip.plot && this.visible.has(strip.element)) strip.show(shown, from_s, to_s, rows.marks);
      else strip.tell(rows);
    }
  }

  /** Pauses at what is shown now, or at this end and span. */
  look(end_s = this.store.last_s, span_s = this.span_s) {
    if (this.store.t_s.length === 0) return;
    this.kept ??= this.store.copy();
    this.span_s = Math.min(KEPT_S, Math.max(SHORTEST_S, span_s));
    const first_s = this.kept.t_s[0];
    this.end_s = Math.min(this.kept.last_s, Math.max(first_s + this.span_s, end_s));
    this.tools();
    this.draw();
  }

  resume() {
    this.kept = null;
    if (!SPANS_S.includes(this.span_s)) this.span_s = USUAL_S;
    this.tools();
    this.draw();
  }

  togglePause() {
    if (this.kept) this.resume();
    else this.look();
  }

  zoom(factor) {
    if (!this.kept) {
      const wanted = SPANS_S[SPANS_S.indexOf(this.span_s) + (factor > 1 ? 1 : -1)];
      this.setSpan(wanted ?? this.span_s);
      return;
    }
    const middle_s = this.end_s - this.span_s / 2;
    const span_s = this.span_s * factor;
    this.look(middle_s + span_s / 2, span_s);
  }

  setSpan(span_s) {
    this.span_s = span_s;
    if (this.kept) this.look(this.end_s, span_s);
    this.tools();
    this.draw();
  }

  shift(part) {
    if (this.kept) this.look(this.end_s + part * this.span_s, this.span_s);
  }

  /** Moves the read-out by keys: so many rows on, from the newest when there was none. */
  step(rows) {
    const times = (this.kept ?? this.store).t_s;
    if (times.length < 2) return;
    if (!this.kept) this.look();
    const from_s = this.pointed_s ?? this.end_s;
    this.pointed_s = Math.min(this.end_s, Math.max(this.end_s - this.span_s, from_s + rows * (times[1] - times[0])));
    this.strips.forEach((strip) => strip.plot && strip.point(this.pointed_s));
    this.tell(this.pointed_s);
  }

  tell(t_s) {
    this.pointed_s = t_s;
    say(byId("reading"), t_s === null ? (this.kept ? "paused" : "now") : `at ${t_s.toFixed(2)} s`);
  }

  watchSizes() {
    new ResizeObserver(([entry]) => {
      const width = Math.floor(entry.contentRect.width);
      const height = width < NARROW_PX ? STRIP_PX.narrow : STRIP_PX.wide;
      if (width > 0) this.strips.forEach((strip) => strip.fit(width, height));
      this.draw();
    }).observe(this.place);
    // A chart that nobody sees costs nothing.
    const seen = new IntersectionObserver((entries) => {
      for (const { target, isIntersecting } of entries) this.visible[isIntersecting ? "add" : "delete"](target);
      this.draw();
    });
    this.strips.forEach((strip) => seen.observe(strip.element));
  }

  furnishTools() {
    const select = byId("span");
    select.append(...SPANS_S.map((span_s) => element("option", { value: span_s }, `${span_s} s`)));
    select.addEventListener("change", () => this.setSpan(Number(select.value)));
    byId("pause").addEventListener("click", () => this.togglePause());
    byId("earlier").addEventListener("click", () => this.shift(-0.5));
    byId("later").addEventListener("click", () => this.shift(0.5));
    byId("closer").addEventListener("click", () => this.zoom(1 / ZOOM));
    byId("wider").addEventListener("click", () => this.zoom(ZOOM));
    this.place.addEventListener("keydown", (event) => {
      const act = {
        ArrowLeft: () => this.step(event.shiftKey ? -10 : -1),
        ArrowRight: () => this.step(event.shiftKey ? 10 : 1),
        "+": () => this.zoom(1 / ZOOM),
        "-": () => this.zoom(ZOOM),
      }[event.key];
      if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      act();
    });
    this.tools();
  }

  tools() {
    const paused = this.kept !== null;
    set(byId("pause"), { "aria-pressed": paused });
    byId("pause").firstChild.textContent = paused ? "Go on " : "Pause ";
    byId("earlier").disabled = !paused;
    byId("later").disabled = !paused;
    const select = byId("span");
    select.querySelector("[data-odd]")?.remove();
    if (!SPANS_S.includes(this.span_s)) {
      select.append(
        element("option", { value: this.span_s, "data-odd": true }, `${Number(this.span_s.toPrecision(2))} s`),
      );
    }
    select.value = String(this.span_s);
    this.tell(null);
  }
}
