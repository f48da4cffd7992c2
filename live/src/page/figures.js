// The numbers that one wants to read from across the room.

import { byId, element, say } from "./dom.js";
import { BAR, MM, MM_PER_S, NEWTON, number } from "./units.js";

const FIGURES = [
  { name: "carriage", column: "drive_position_m", of: MM, digits: 1 },
  { name: "set-point", column: "drive_set_point_m", of: MM, digits: 1 },
  { name: "error", column: "drive_control_error_m", of: MM, digits: 2 },
  { name: "velocity", column: "drive_velocity_m_per_s", of: MM_PER_S, digits: 0 },
  { name: "drive’s rod", column: "drive_force_n", of: NEWTON, digits: 0 },
  { name: "load’s rod", column: "load_force_n", of: NEWTON, digits: 0 },
  { name: "supply", column: "supply_pressure_pa", of: BAR, digits: 2 },
];

export class Figures {
  constructor() {
    this.outputs = FIGURES.map(() => element("b", {}, "–"));
    byId("figures").append(
      ...FIGURES.map(({ name, of, column }, place) =>
        element(
          "div",
          { "data-column": column },
          element("dt", {}, name),
          element("dd", {}, this.outputs[place], element("span", { class: "soft" }, ` ${of.unit}`)),
        ),
      ),
    );
  }

  show({ value }) {
    FIGURES.forEach(({ column, of, digits }, place) => say(this.outputs[place], number(value(column), of, digits)));
  }
}
