// The play between carriage and load, under a lens: a fifth of a millimetre decides whether they touch, and no one would see it
// on a drawing of a metre and a half.

import { drawn, say, set } from "./dom.js";
import { middle } from "./rig_cylinder.js";
import { faultMark } from "./rig_faults.js";
import { MM, NEWTON, shown } from "./units.js";

const DEFAULT_GAP_M = 0.2e-3;
const EYE = 8;
const LEAST_CONTACT_N = 1;

export function linkage(at, rig) {
  const gap_m = rig.gap_m ?? DEFAULT_GAP_M;
  const x = at.width / 2;
  const y = at.top.valve - 8;
  const half = at.narrow ? 30 : 52;
  // The fork of the carriage: two jaws, one to each side of the load's eye.
  const jaws = [-1, 1].map((side) =>
    drawn("path", { class: "jaw", d: `M${x + side * (half + EYE)} ${y - 15}h${side * 9}v30h${-side * 9}z` }),
  );
  const eye = drawn("circle", { class: "eye", cy: y, r: EYE });
  const pin = drawn("circle", { class: "pin", cy: y, r: 2.5 });
  const touch = drawn("path", { class: "touch" });
  const words = drawn("text", { class: "figure middle plain", x, y: y + 33 });
  const mark = faultMark("linkage", x, y - 14);
  // The eye at the end of the load's rod, where it really is.
  const tip = drawn("circle", { class: "eye", cy: middle(at), r: at.narrow ? 5 : 7 });
  const sentence = (linked, known_m, force_n) => {
    const name = at.narrow ? "" : `linkage (${shown(gap_m, MM, 1)} of play): `;
    if (linked && known_m === null) return "linked";
    const is_loose = Math.abs(force_n) <= LEAST_CONTACT_N;
    if (linked) return name + (is_loose ? "loose" : `${shown(Math.abs(force_n), NEWTON)} contact`);
    return at.narrow || known_m === null ? "not linked" : `not linked, ${shown(Math.abs(known_m), MM, 1)} apart`;
  };
  const show = (seen) => {
    const { value, state } = seen;
    const linked = Boolean(state?.linked);
    // Only a simulation knows it.
    const known_m = value("linkage_distance_m");
    const distance_m = known_m ?? 0;
    const force_n = value("linkage_force_n") ?? 0;
    const part = Math.max(-1, Math.min(1, distance_m / (gap_m / 2)));
    const centre = x + part * half;
    const load_m = value("load_position_m") ?? 0;
    set(tip, {
      cx: at.way + at.carriage + load_m * at.perMetre - (linked ? 10 : 0),
      class: linked ? "eye" : "eye apart",
    });
    set(eye, { cx: centre, class: linked ? "eye" : "eye apart" });
    set(pin, { cx: centre, visibility: linked ? "visible" : "hidden" });
    const touches = linked && Math.abs(force_n) > LEAST_CONTACT_N;
    const jaw = x + Math.sign(part) * (half + EYE + 4);
    set(touch, { visibility: touches ? "visible" : "hidden", d: `M${jaw} ${y - 20}v40` });
    say(words, sentence(linked, known_m, force_n));
    mark.show(seen);
  };
  return { elements: [tip, ...jaws, eye, pin, touch, words, ...mark.elements], show };
}
