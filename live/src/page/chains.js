// The chains of states as diagrams, one for both controllers: the states in which drive and load are, are lit and lettered.

import { edgesOf, places } from "./chain_layout.js";
import { byId, drawn, element, set } from "./dom.js";
import { words } from "./units.js";

const BOX = { width: 92, height: 36 };
const STEP = { x: 118, y: 62 };
const EDGE = 6;
const LINE = 13;
const TITLES = {
  main: "Main chain: through the experiment",
  force: "Force chain: giving way, and pressing",
  matching: "Matching chain: both sensors agree",
  "emergency-stop": "Emergency stop, and the way back",
};
const LETTERS = { drive: "D", load: "L" };

export class Chains {
  constructor() {
    this.diagrams = new Map();
  }

  describe(chains) {
    this.diagrams = new Map(chains.map((chain) => [chain.name, diagram(chain)]));
    byId("chains").replaceChildren(...[...this.diagrams.values()].map(({ figure }) => figure));
  }

  show({ chains }) {
    for (const [name, { boxes, told }] of this.diagrams) {
      const key = name.replaceAll("-", "_");
      const states = { drive: chains?.drive?.[key] ?? null, load: chains?.load?.[key] ?? null };
      for (const [state, { box, letters }] of boxes) {
        const who = Object.keys(LETTERS).filter((axis) => states[axis] === state);
        set(box, { class: ["state", ...who.map((axis) => `with-${axis}`), who.length ? "lit" : ""].join(" ").trim() });
        for (const axis of Object.keys(LETTERS))
          set(letters[axis], { visibility: who.includes(axis) ? "visible" : "hidden" });
      }
      const sentence = Object.entries(states).map(
        ([axis, state]) => `${axis}: ${state === null ? "not heard" : words(state)}`,
      );
      if (told.textContent !== sentence.join(", ")) told.textContent = sentence.join(", ");
    }
  }
}

function diagram(chain) {
  const at = places(chain);
  const rows = 1 + Math.max(...[...at.values()].map(([, row]) => row));
  const { anywhere, single, onward } = edgesOf(chain);
  const corner = ([column, row]) => ({ x: 8 + column * STEP.x, y: 16 + row * STEP.y });
  const boxes = new Map([...at].map(([state, place]) => [state, stateBox(state, corner(place))]));
  const arrows = single
    .filter(([from, to]) => at.has(from) && at.has(to))
    .map(([from, to]) =>
      arrow(
        corner(at.get(from)),
        corner(at.get(to)),
        single.some(([a, b]) => a === to && b === from),
      ),
    );
  const fromAnywhere = [...anywhere]
    .filter((state) => at.has(state))
    .map((state) => arrowFromAnywhere(corner(at.get(state))));
  const further = [...onward].map(([state, to]) => wayOn(corner(at.get(state)), to));
  const height = rows * STEP.y + (onward.size > 0 ? 12 : 2);
  const told = element("p", { class: "soft small" });
  const svg = drawn(
    "svg",
    { class: "plot chain", viewBox: `0 0 ${2 * STEP.x + BOX.width + 20} ${height}`, "aria-hidden": "true" },
    ...[...boxes.values()].map(({ box }) => box),
    ...arrows.flat(),
    ...fromAnywhere.flat(),
    ...further,
    ...[...boxes.values()].flatMap(({ letters }) => Object.values(letters)),
  );
  const name = chain.name.replaceAll("_", "-");
  const figure = element(
    "figure",
    { "data-chain": name },
    element("figcaption", {}, TITLES[name] ?? words(name)),
    svg,
    told,
  );
  return { figure, boxes, told };
}

/** A state with its name on one line or two, and a letter for each axis that is in it. */
function stateBox(state, { x, y }) {
  const rect = drawn("rect", { x, y, width: BOX.width, height: BOX.height, rx: 6 });
  const lines = inTwo(words(state));
  const first = y + BOX.height / 2 + 4.5 - ((lines.length - 1) * LINE) / 2;
  const text = lines.map((line, place) =>
    drawn("text", { class: "middle", x: x + BOX.width / 2, y: first + place * LINE }, line),
  );
  const letters = Object.fromEntries(
    Object.entries(LETTERS).map(([axis, letter], place) => [
      axis,
      drawn(
        "g",
        { class: `who who-${axis}`, visibility: "hidden" },
        drawn("circle", { cx: x + 9 + place * (BOX.width - 18), cy: y - 1, r: 9 }),
        drawn("text", { class: "middle", x: x + 9 + place * (BOX.width - 18), y: y + 3.5 }, letter),
      ),
    ]),
  );
  return { box: drawn("g", { class: "state" }, rect, ...text), letters };
}

/** An arrow from box to box: straight to a neighbour, around others by an arc. */
function arrow(from, to, isBothWays) {
  const centre = ({ x, y }) => [x + BOX.width / 2, y + BOX.height / 2];
  const [[x1, y1], [x2, y2]] = [centre(from), centre(to)];
  const [dx, dy] = [x2 - x1, y2 - y1];
  const length = Math.hypot(dx, dy);
  const isNeighbour = Math.abs(dx) <= STEP.x + 1 && Math.abs(dy) <= STEP.y + 1;
  // To the right of its own way, so that two opposite arrows do not lie on each other.
  const side = isBothWays && isNeighbour ? 7 : 0;
  const bend = isNeighbour ? 0 : 30;
  const normal = [-dy / length, dx / length];
  const start = edgePoint([x1, y1], [dx + normal[0] * bend * 3, dy + normal[1] * bend * 3], normal, side);
  const end = edgePoint([x2, y2], [-dx + normal[0] * bend * 3, -dy + normal[1] * bend * 3], normal, side);
  const control = [(start[0] + end[0]) / 2 + normal[0] * bend, (start[1] + end[1]) / 2 + normal[1] * bend];
  const towards = [end[0] - control[0], end[1] - control[1]];
  return [
    drawn("path", { class: "way", d: `M${start.map(round)}Q${control.map(round)} ${end.map(round)}` }),
    drawn("path", { class: "way-head", d: headAt(end, towards) }),
  ];
}

function arrowFromAnywhere({ x, y }) {
  const middle = x + BOX.width / 2 - 24;
  return [
    drawn("text", { class: "quiet", x: middle + 7, y: y - 4 }, "from any"),
    drawn("path", { class: "way", d: `M${middle} ${y - 14}V${y - 1}` }),
    drawn("path", { class: "way-head", d: headAt([middle, y], [0, 1]) }),
  ];
}

/** Where a state leads to, in words. */
function wayOn({ x, y }, to) {
  const text = `→ ${words(to)}`;
  return drawn("text", { class: "onward middle", x: x + BOX.width / 2, y: y + BOX.height + 13 }, text);
}

/** Where a line from a box's centre in a direction leaves the box. */
function edgePoint([x, y], [dx, dy], normal, side) {
  const scale = Math.min(BOX.width / 2 / Math.abs(dx || 1e-9), BOX.height / 2 / Math.abs(dy || 1e-9));
  return [x + dx * scale + normal[0] * side, y + dy * scale + normal[1] * side];
}

function headAt([x, y], [dx, dy]) {
  const length = Math.hypot(dx, dy) || 1;
  const [ux, uy] = [dx / length, dy / length];
  const [bx, by] = [x - ux * EDGE, y - uy * EDGE];
  const corner = (side) => `${round(bx - side * uy * 4)} ${round(by + side * ux * 4)}`;
  return `M${round(x)} ${round(y)}L${corner(1)}L${corner(-1)}Z`;
}

function inTwo(name) {
  if (name.length < 12 || !name.includes(" ")) return [name];
  const spaces = [...name].flatMap((letter, place) => (letter === " " ? [place] : []));
  const best = spaces.reduce((a, b) => (Math.abs(b - name.length / 2) < Math.abs(a - name.length / 2) ? b : a));
  return [name.slice(0, best), name.slice(best + 1)];
}

function round(value) {
  return Math.round(value * 10) / 10;
}
