// Forces as arrows: an arrow's length is in proportion to its force, it points where the force pushes, and it stands before the
// carriage, which is what the forces move. A force beyond the longest arrow gets a second head.

import { drawn, say, set } from "./dom.js";
import { AXES } from "./rig_layout.js";
import { NEWTON, shown } from "./units.js";

const HEAD = 7;
const LEAST_N = 1;

/** The arrow of a force in the row that begins at `y`; it is told along its axis' own extension. */
export function forceArrow(at, axis, { column, name, kind, isAlongX }, y) {
  const { sign } = AXES[axis];
  const shaft = drawn("path", { class: `force force-${kind}` });
  const head = drawn("path", { class: `head head-${kind}` });
  const words = drawn("text", { class: axis === "drive" ? "figure end" : "figure", y: y + 10 });
  const line = y + 18;
  const show = ({ value }, reach) => {
    // The edge of the carriage that looks at this axis; the arrow is on the axis' side of it.
    const edge = reach - 4 * sign;
    const told_n = value(`${axis}_${column}`);
    const force_n = told_n === null || !isAlongX ? told_n : sign * told_n;
    // The arrow tells the direction, so its number needs no sign.
    const size_n = force_n === null ? null : Math.abs(force_n);
    say(words, at.narrow ? `${name} ${shown(size_n, NEWTON)}` : `${name}  ${shown(size_n, NEWTON)}`);
    set(words, { x: edge });
    const is_there = force_n !== null && size_n >= LEAST_N;
    set(shaft, { visibility: is_there ? "visible" : "hidden" });
    set(head, { visibility: is_there ? "visible" : "hidden" });
    if (!is_there) return;
    const wanted = size_n * at.newton;
    const length = Math.min(at.longest, Math.max(HEAD + 2, wanted));
    const pushes = force_n > 0;
    // Pushing, the arrow ends at the edge; pulling, it begins there.
    const [tip, tail] = pushes ? [edge, edge - sign * length] : [edge - sign * length, edge];
    const back = pushes ? -sign : sign;
    set(shaft, { d: `M${tail} ${line}L${tip + back * (HEAD - 1)} ${line}` });
    const heads = wanted > at.longest ? [0, HEAD + 1] : [0];
    set(head, { d: heads.map((step) => triangle(tip + back * step, line, back)).join("") });
  };
  return { elements: [shaft, head, words], show };
}

function triangle(tip, y, back) {
  return `M${tip} ${y}L${tip + back * HEAD} ${y - 4.5}L${tip + back * HEAD} ${y + 4.5}Z`;
}
