// The carriage with its weights on its rail, and the ruler under it, on which the set-point is marked.

import { drawn, say, set } from "./dom.js";
import { KG, MM, number, shown } from "./units.js";

const PLATE_KG = 5;
const PLATES = 4;
const PLATE = 10;

/** A ruler from 0 to the stroke, for the middle of the carriage. */
export function ruler(at) {
  const from = at.way + at.carriage / 2;
  const y = at.top.ruler;
  const steps = at.narrow ? [0, 1] : [0, 0.2, 0.4, 0.6, 0.8, 1];
  const ticks = steps.map((part) => {
    const x = from + part * at.stroke;
    return drawn(
      "g",
      {},
      drawn("path", { class: "edge", d: `M${x} ${y}v6` }),
      drawn("text", { class: "middle", x, y: y + 26 }, number(part * at.stroke_m, MM, 0) + (part === 1 ? " mm" : "")),
    );
  });
  const line = drawn("path", { class: "edge", d: `M${from} ${y}h${at.stroke}` });
  const wanted = drawn("path", { class: "wanted" });
  const show = ({ value }) => {
    const position_m = value("drive_set_point_m");
    const is_there = position_m !== null && position_m !== undefined;
    set(wanted, { visibility: is_there ? "visible" : "hidden" });
    if (is_there) set(wanted, { d: `M${from + position_m * at.perMetre} ${y}l6 11h-12z` });
  };
  const rail = drawn("rect", { class: "rail", x: at.way, y: y - 8, width: at.carriage + at.stroke, height: 4 });
  return { elements: [rail, line, ...ticks, wanted], show };
}

/** The block that the drive moves, and the plates on it. */
export function carriage(at, rig) {
  const { top, tall } = at;
  const block = drawn("rect", { class: "carriage", y: top.carriage, width: at.carriage, height: tall.carriage, rx: 4 });
  const words = drawn("text", { class: "name middle", y: top.carriage + 24 }, at.narrow ? "" : "carriage");
  const mass = drawn("text", { class: "figure middle", y: top.carriage + (at.narrow ? 20 : 84) });
  const pointer = drawn("path", { class: "pointer" });
  const position = drawn("text", { class: "figure middle", y: top.carriage + (at.narrow ? 86 : 68) });
  const plates = Array.from({ length: PLATES }, () => drawn("rect", { class: "weight", height: PLATE - 2, rx: 1.5 }));
  const own_kg = rig.drive_mass_kg ?? null;
  const show = ({ value, state }) => {
    const position_m = value("drive_position_m") ?? 0;
    const x = at.way + position_m * at.perMetre;
    const centre = x + at.carriage / 2;
    set(block, { x });
    set(words, { x: centre });
    set(mass, { x: centre });
    set(position, { x: centre });
    set(pointer, { d: `M${centre} ${top.carriage + tall.carriage}v16` });
    const weights_kg = state?.weights_kg ?? 0;
    const together_kg = own_kg === null ? weights_kg : own_kg + weights_kg;
    say(mass, shown(together_kg, KG, at.narrow ? 0 : 1));
    say(position, at.narrow ? number(position_m, MM, 0) : shown(position_m, MM, 1));
    plates.forEach((plate, place) => {
      const part = Math.min(1, Math.max(0, weights_kg / PLATE_KG - place));
      const width = part * (at.carriage - 16);
      set(plate, {
        x: centre - width / 2,
        y: top.carriage - PLATE * (place + 1),
        width,
        visibility: part > 0 ? "visible" : "hidden",
      });
    });
  };
  return { elements: [...plates, block, pointer, words, mass, position], show };
}
