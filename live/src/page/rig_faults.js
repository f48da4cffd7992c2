// A warning sign at the place of a fault that is active.

import { drawn, set } from "./dom.js";

/** A sign for faults at `place`, its foot in the middle at x, y. */
export function faultMark(place, x, y) {
  const sign = drawn("path", { class: "warning", d: `M${x} ${y - 20}l11 19h-22z` });
  const mark = drawn("text", { class: "warning-mark middle", x, y: y - 4 }, "!");
  const group = drawn("g", { visibility: "hidden" }, sign, mark);
  const show = ({ state }) => {
    const active = (state?.faults_active ?? []).some((fault) => fault.place === place);
    set(group, { visibility: active ? "visible" : "hidden" });
  };
  return { elements: [group], show };
}
