// The legend of the drawing: the colour scale of the pressures, and what the arrows are.

import { byId, drawn, element } from "./dom.js";
import { PRESSURES_PA } from "./rig_air.js";
import { BAR, number } from "./units.js";

const ENTRIES = [
  ["M1 7H27", "force force-air", "M36 7l-9 -5v10z", "head head-air", "air pushes"],
  ["M1 7H27", "force force-friction", "M36 7l-9 -5v10z", "head head-friction", "friction"],
  ["M1 7H27", "force force-rod", "M36 7l-9 -5v10z", "head head-rod", "rod presses"],
  ["M19 13l-7 -11h14z", "flow", "", "", "air flows"],
  ["M19 13l-6 -10h12z", "command", "", "", "valve is told"],
  ["M19 2l7 11h-14z", "wanted", "", "", "set-point"],
];

export function buildKey() {
  const [low, high] = PRESSURES_PA.map((pressure_pa) => number(pressure_pa, BAR, 0));
  const scale = element(
    "span",
    { class: "scale" },
    element("span", {}, `${low}`),
    element("i", { class: "ramp" }),
    element("span", {}, `${high} bar`),
  );
  const sample = ([first, firstClass, second, secondClass, name]) =>
    element(
      "li",
      {},
      drawn(
        "svg",
        { class: "plot", viewBox: "0 0 38 14", "aria-hidden": "true" },
        drawn("path", { class: firstClass, d: first }),
        ...(second ? [drawn("path", { class: secondClass, d: second })] : []),
      ),
      element("span", {}, name),
    );
  byId("key").append(scale, element("ul", { class: "legend" }, ...ENTRIES.map(sample)));
}
