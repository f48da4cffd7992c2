// A cylinder: two chambers in the colour of their pressure, a piston, its rod, and the forces along it as arrows.

import { drawn, say, set } from "./dom.js";
import { AXES } from "./rig_layout.js";
import { forceArrow } from "./rig_arrows.js";
import { faultMark } from "./rig_faults.js";
import { share } from "./rig_air.js";
import { BAR, number, shown } from "./units.js";

/** Forces on an axis from the top row down; those along x are told so, the sensor tells what its rod presses with. */
const FORCES = [
  { column: "pneumatic_force_n", name: "air", kind: "air", isAlongX: true },
  { column: "friction_force_n", name: "friction", kind: "friction", isAlongX: true },
  { column: "force_n", name: "rod", kind: "rod", isAlongX: false },
];

export function cylinder(at, axis) {
  const { sign } = AXES[axis];
  const left = at.cylinders[axis];
  const { top, tall } = at;
  const bottom = top.cylinder + tall.cylinder;
  const box = { y: top.cylinder, height: tall.cylinder };
  // The cap's chamber, a, is outside: left of the drive's piston, right of the load's.
  const chambers = Object.fromEntries(["a", "b"].map((name) => [name, drawn("rect", { class: "air", ...box })]));
  const letters = Object.fromEntries(["a", "b"].map((name) => [name, drawn("text", { class: "letter middle" }, name)]));
  const rod = drawn("rect", { class: "rod", y: middle(at) - tall.rod / 2, height: tall.rod });
  const piston = drawn("rect", { class: "piston", ...box, width: at.piston, rx: 2 });
  const wall = (x) => drawn("rect", { class: "wall", x, y: box.y - 3, width: at.cap, height: box.height + 6, rx: 2 });
  const body = drawn("rect", { class: "body", x: left, width: at.inside, ...box });
  const pressures = Object.fromEntries(
    ["a", "b"].map((name) => {
      const isLeft = (name === "a") === sign > 0;
      const x = isLeft ? left + 18 : left + at.inside - 18;
      return [name, drawn("text", { class: isLeft ? "figure" : "figure end", x, y: bottom + 19 })];
    }),
  );
  const arrows = FORCES.map((force, row) => forceArrow(at, axis, force, top.arrows + row * tall.arrow));
  const marks = ["a", "b"].map((name) => {
    const isLeft = (name === "a") === sign > 0;
    return faultMark(`${axis}.${name}`, isLeft ? left + 10 : left + at.inside - 10, top.cylinder - 3);
  });
  marks.push(faultMark(axis, left + at.inside / 2, top.cylinder - 3));

  const show = (seen) => {
    const { value } = seen;
    const position_m = clamp(value(`${axis}_position_m`) ?? 0, 0, at.stroke_m);
    const x = left + position_m * at.perMetre;
    set(piston, { x });
    const reach = at.way + position_m * at.perMetre + (axis === "load" ? at.carriage : 0);
    const rodFrom = axis === "drive" ? x + at.piston : reach;
    const rodTo = axis === "drive" ? reach : x;
    set(rod, { x: rodFrom, width: Math.max(0, rodTo - rodFrom) });
    const places = [
      [left, x],
      [x + at.piston, left + at.inside],
    ];
    for (const name of ["a", "b"]) {
      const [from, to] = places[(name === "a") === sign > 0 ? 0 : 1];
      const pressure_pa = value(`${axis}_pressure_${name}_pa`);
      set(chambers[name], { x: from, width: Math.max(0, to - from) });
      chambers[name].style.setProperty("--share", share(pressure_pa));
      set(letters[name], {
        x: (from + to) / 2,
        y: top.cylinder + 17,
        visibility: to - from > 16 ? "visible" : "hidden",
      });
      say(pressures[name], at.narrow ? number(pressure_pa, BAR, 1) : `${name}  ${shown(pressure_pa, BAR)}`);
    }
    arrows.forEach((arrow) => arrow.show(seen, reach));
    marks.forEach((mark) => mark.show(seen));
  };
  return {
    elements: [
      ...Object.values(chambers),
      body,
      ...Object.values(letters),
      rod,
      piston,
      wall(left - at.cap),
      wall(left + at.inside),
      ...Object.values(pressures),
      ...arrows.flatMap((arrow) => arrow.elements),
      ...marks.flatMap((mark) => mark.elements),
    ],
    show,
  };
}

/** Height of both rods. */
export function middle(at) {
  return at.top.cylinder + at.tall.cylinder / 2;
}

function clamp(value, low, high) {
  return Math.min(high, Math.max(low, value));
}
