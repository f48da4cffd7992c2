// The loop's heartbeat: percentiles, overruns as they happen, histograms, the bus by frame, and whether it supports a claim.

import { byId, element, say, set } from "./dom.js";
import { Histogram } from "./histogram.js";
import { count, microseconds } from "./units.js";

const PERCENTILES = [
  ["p50", "p50", "half of all are below"],
  ["p99", "p99", "99 % are below"],
  ["p999", "p99.9", "99.9 % are below"],
  ["max", "max", "the longest"],
];
const STAGES = { wake_up: "wake-up", round_trip: "round trip" };
const VERDICTS = {
  yes: ["●", "Supports a latency claim"],
  doubtful: ["◆", "Whether it supports a latency claim is doubtful"],
  no: ["▲", "Supports no latency claim"],
};
const SECONDS = 60;

export class Heartbeat {
  constructor() {
    this.cells = Object.fromEntries(
      Object.keys(STAGES).map((stage) => [stage, PERCENTILES.map(() => element("td", { class: "n" }, "–"))]),
    );
    this.histogram = new Histogram();
    this.overruns = element("b", {}, "0");
    this.skipped = element("span", {}, "–");
    this.seconds = Array.from({ length: SECONDS }, () => element("i", {}));
    this.last = null;
    this.load = element("p", { class: "lead" });
    this.frames = element("tbody");
    this.rows = new Map();
    byId("heartbeat").append(this.percentiles(), this.histogram.figure, this.busTable());
  }

  /** A state of the program: percentiles, counts, bus, claim. */
  show({ t_s, timing = {}, bus = {}, claim }) {
    for (const [stage, cells] of Object.entries(this.cells)) {
      PERCENTILES.forEach(([key], place) => say(cells[place], microseconds(timing[stage]?.[key])));
    }
    this.showOverruns(t_s, timing);
    this.showBus(bus);
    this.showClaim(claim);
  }

  /** Once a second: the histograms. */
  histograms(told) {
    this.histogram.show(told);
  }

  percentiles() {
    const head = element(
      "tr",
      {},
      element("th", {}, ""),
      ...PERCENTILES.map(([, name, title]) => element("th", { class: "n", title }, name)),
    );
    const rows = Object.entries(STAGES).map(([stage, name]) =>
      element("tr", { "data-stage": stage }, element("th", {}, name), ...this.cells[stage]),
    );
    const strip = element(
      "div",
      { class: "seconds", role: "img", "aria-label": "Overruns in each of the last 60 seconds" },
      ...this.seconds,
    );
    return element(
      "div",
      { class: "pulse" },
      element("h3", {}, "Latency"),
      element(
        "div",
        { class: "scroll" },
        element("table", {}, element("thead", {}, head), element("tbody", {}, ...rows)),
      ),
      element(
        "p",
        { class: "overruns", id: "overruns" },
        this.overruns,
        " overruns, ",
        this.skipped,
        " cycles skipped",
      ),
      strip,
      element(
        "p",
        { class: "soft small ends" },
        element("span", {}, "a minute ago"),
        element("span", {}, "overruns in each second"),
        element("span", {}, "now"),
      ),
    );
  }

  showOverruns(t_s, { overruns = 0, skipped = 0, overruns_by_second = [] }) {
    say(this.overruns, count(overruns));
    say(this.skipped, count(skipped));
    if (this.last !== null && overruns > this.last) {
      byId("overruns").animate?.([{ backgroundColor: "var(--mark)" }, { backgroundColor: "transparent" }], 900);
    }
    this.last = overruns;
    const first = Math.floor(t_s ?? 0) - SECONDS + 1;
    this.seconds.forEach((bar, place) => {
      const many = overruns_by_second[place] ?? 0;
      // One is seen, ten fill the strip.
      const height = many === 0 ? 0 : Math.min(100, 30 + 70 * Math.log10(many));
      bar.style.height = `${height}%`;
      set(bar, { title: many ? `${many} in second ${first + place}` : "" });
    });
  }

  busTable() {
    const head = element(
      "tr",
      {},
      element("th", {}, "frame"),
      element("th", { class: "n" }, "a second"),
      element("th", {}, ""),
    );
    return element(
      "div",
      { class: "bus" },
      element("h3", {}, "Bus"),
      this.load,
      element(
        "div",
        { class: "scroll frames", tabindex: 0, role: "group", "aria-label": "Frames by name" },
        element("table", {}, element("thead", {}, head), this.frames),
      ),
    );
  }

  showBus({ load_percent, frames_per_s = {}, lost, malformed }) {
    const load = typeof load_percent === "number" ? `${load_percent.toFixed(1)} %` : "–";
    say(this.load, `${load} of 1 Mbit/s, ${count(lost)} frames lost, ${count(malformed)} malformed`);
    const most = Math.max(1, ...Object.values(frames_per_s));
    for (const [name, rate] of Object.entries(frames_per_s)) {
      if (!this.rows.has(name)) this.addFrame(name);
      const { number, bar } = this.rows.get(name);
      say(number, rate < 10 && rate > 0 ? rate.toFixed(1) : count(rate));
      bar.style.width = `${(100 * rate) / most}%`;
    }
    for (const [name, { row }] of this.rows) {
      if (name in frames_per_s) continue;
      row.remove();
      this.rows.delete(name);
    }
  }

  addFrame(name) {
    const number = element("td", { class: "n" });
    const bar = element("i", { class: "rate" });
    const row = element("tr", {}, element("td", {}, name), number, element("td", { class: "rates" }, bar));
    this.rows.set(name, { row, number, bar });
    this.frames.append(row);
  }

  showClaim(claim) {
    if (!claim) return;
    const [sign, sentence] = VERDICTS[claim.supported] ?? VERDICTS.doubtful;
    const text = [claim.supported, ...(claim.reasons ?? [])].join("\n");
    if (this.claimText === text) return;
    this.claimText = text;
    byId("claim").replaceChildren(
      element("p", {}, element("span", { class: "sign", "aria-hidden": "true" }, sign), ` ${sentence}`),
      ...((claim.reasons ?? []).length
        ? [element("ul", {}, ...claim.reasons.map((reason) => element("li", {}, reason)))]
        : []),
    );
    set(byId("claim"), {
      class: `claim verdict ${claim.supported === "yes" ? "" : "no"}`.trim(),
      "data-supported": claim.supported,
    });
  }
}
