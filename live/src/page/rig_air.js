// Where the air comes from: the supply, both valves, the hoses to the chambers with what flows through them.

import { drawn, say, set } from "./dom.js";
import { AXES } from "./rig_layout.js";
import { faultMark } from "./rig_faults.js";
import { BAR, NL_PER_MIN, PERCENT, shown } from "./units.js";

/** Ends of the colour scale of pressures, Pa: the atmosphere, and a little more than the supply. */
export const PRESSURES_PA = [1e5, 8e5];
/** A flow that fills the arrow, m3/s of normal volume: 600 Nl/min. */
const FULL_FLOW_M3_PER_S = 0.01;
const LEAST_FLOW_M3_PER_S = 8e-5;

/** Where on the colour scale a pressure is, 0 to 100 %. */
export function share(pressure_pa) {
  const [low, high] = PRESSURES_PA;
  if (pressure_pa === null || pressure_pa === undefined) return "0%";
  return `${Math.round(100 * Math.min(1, Math.max(0, (pressure_pa - low) / (high - low))))}%`;
}

/** The node that feeds both valves. */
export function supply(at) {
  const x = at.width / 2;
  const y = at.top.supply;
  const half = at.narrow ? 52 : 78;
  const tank = drawn("rect", { class: "air tank", x: x - half, y: y - 13, width: 2 * half, height: 26, rx: 13 });
  const plate = drawn("rect", { class: "plate", x: x - half + 7, y: y - 9, width: 2 * half - 14, height: 18, rx: 9 });
  const words = drawn("text", { class: "figure middle", x, y: y + 4.5 });
  const lines = Object.keys(AXES).map((axis) => {
    const from = axis === "drive" ? x - half : x + half;
    return drawn("path", { class: "hose", d: `M${from} ${y}H${valveX(at, axis)}V${at.top.valve + 14}` });
  });
  const mark = faultMark("supply", x - half - 14, y + 8);
  const show = (seen) => {
    const pressure_pa = seen.value("supply_pressure_pa");
    tank.style.setProperty("--share", share(pressure_pa));
    say(words, `supply ${shown(pressure_pa, BAR, at.narrow ? 1 : 2)}`);
    mark.show(seen);
  };
  return { elements: [...lines, tank, plate, words, ...mark.elements], show };
}

/** The valve of an axis: a bar towards the chamber that is fed, a triangle where it is told to be; and its two hoses. */
export function valve(at, axis) {
  const { sign } = AXES[axis];
  const x = valveX(at, axis);
  const y = at.top.valve;
  const half = at.narrow ? 34 : 74;
  const box = drawn("rect", { class: "valve", x: x - half, y: y - 12, width: 2 * half, height: 24, rx: 3 });
  const bar = drawn("rect", { class: "opening", y: y - 8, height: 16 });
  const zero = drawn("path", { class: "edge", d: `M${x} ${y - 12}V${y + 12}` });
  const command = drawn("path", { class: "command" });
  const words = drawn("text", { class: "figure end plain", x: x - 9, y: y + 27 });
  const hoses = ["a", "b"].map((name) => hose(at, axis, name, half));
  const shut = drawn(
    "text",
    { class: "shut middle", x, y: at.top.cylinder + at.tall.cylinder + 36 },
    "check valves shut",
  );
  const show = (seen) => {
    const { value } = seen;
    const spool = Math.max(-1, Math.min(1, value(`${axis}_spool_opening`) ?? value(`${axis}_valve_opening`) ?? 0));
    // Positive feeds chamber a, which is left at the drive and right at the load.
    const end = x - sign * spool * half;
    set(bar, { x: Math.min(x, end), width: Math.abs(end - x) });
    const told = x - sign * Math.max(-1, Math.min(1, value(`${axis}_valve_opening`) ?? 0)) * half;
    set(command, { d: `M${told} ${y - 9}l5 -9h-10z` });
    say(words, at.narrow ? shown(spool, PERCENT, 0) : `valve ${shown(spool, PERCENT, 0)}`);
    hoses.forEach((one) => one.show(seen));
    set(shut, { visibility: seen.state?.check_valves_shut ? "visible" : "hidden" });
  };
  return { elements: [...hoses.flatMap((one) => one.elements), box, bar, zero, command, words, shut], show };
}

/** From a port of the valve to its chamber, with an arrow as wide as its flow is strong. */
function hose(at, axis, name, half) {
  const { sign } = AXES[axis];
  const isLeft = (name === "a") === sign > 0;
  const side = isLeft ? -1 : 1;
  const left = at.cylinders[axis];
  const port = isLeft ? left + 9 : left + at.inside - 9;
  const from = valveX(at, axis) + side * half;
  const bottom = at.top.cylinder + at.tall.cylinder;
  const y = at.top.valve;
  const pipe = drawn("path", { class: "hose", d: `M${from} ${y}H${port}V${bottom}` });
  const arrow = drawn("path", { class: "flow" });
  const words = drawn("text", { class: isLeft ? "figure plain" : "figure plain end", x: port - side * 14, y: y - 30 });
  const show = ({ value }) => {
    const flow = value(`${axis}_flow_${name}_m3_per_s`);
    const is_there = flow !== null && Math.abs(flow) > LEAST_FLOW_M3_PER_S;
    set(arrow, { visibility: is_there ? "visible" : "hidden" });
    say(words, is_there && !at.narrow ? `${shown(Math.abs(flow), NL_PER_MIN)} ${flow > 0 ? "in" : "out"}` : "");
    if (!is_there) return;
    const wide = 4 + 7 * Math.sqrt(Math.min(1, Math.abs(flow) / FULL_FLOW_M3_PER_S));
    const up = flow > 0 ? -1 : 1;
    const tip = y - 35 + up * wide * 0.8;
    set(arrow, { d: `M${port} ${tip}l${wide} ${-up * wide * 1.6}h${-2 * wide}z` });
  };
  return { elements: [pipe, arrow, words], show };
}

function valveX(at, axis) {
  return at.cylinders[axis] + at.inside / 2;
}
