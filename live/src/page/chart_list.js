// What the strip charts show, from the top down. A look is a place in the palette of all pages: colour and dashes belong
// together.

import { BAR, MM, MM_PER_S, NEWTON, PERCENT } from "./units.js";

/** Dashes of the looks, as the stylesheet of the reports has them; the last two are for what is wanted or given. */
export const LOOKS = {
  s0: { colour: "--s0", dash: [] },
  s1: { colour: "--s1", dash: [9, 3] },
  s2: { colour: "--s2", dash: [3, 3] },
  s3: { colour: "--s3", dash: [11, 3, 3, 3] },
  s4: { colour: "--s4", dash: [6, 2] },
  wanted: { colour: "--ink", dash: [2, 3], width: 1.3 },
  given: { colour: "--soft", dash: [8, 4, 2, 4], width: 1.2 },
};

const line = (column, name, look) => ({ column, name, look });

/** `least` is the smallest range of values shown, in the chart's unit; `fixed` ends do not move. */
export const CHARTS = [
  {
    title: "position",
    of: MM,
    least: 10,
    lines: [
      line("drive_set_point_m", "drive’s set-point", "wanted"),
      line("drive_position_m", "drive", "s0"),
      line("load_position_m", "load", "s1"),
    ],
  },
  { title: "control error", of: MM, least: 0.5, lines: [line("drive_control_error_m", "drive", "s0")] },
  {
    title: "velocity",
    of: MM_PER_S,
    least: 20,
    lines: [line("drive_velocity_m_per_s", "drive", "s0"), line("load_velocity_m_per_s", "load", "s1")],
  },
  {
    title: "pressure",
    of: BAR,
    least: 0.5,
    lines: [
      line("supply_pressure_pa", "supply", "given"),
      line("drive_pressure_a_pa", "drive a", "s0"),
      line("drive_pressure_b_pa", "drive b", "s2"),
      line("load_pressure_a_pa", "load a", "s1"),
      line("load_pressure_b_pa", "load b", "s3"),
    ],
  },
  {
    title: "valve opening",
    of: PERCENT,
    least: 10,
    lines: [
      line("drive_valve_opening", "drive’s command", "wanted"),
      line("load_valve_opening", "load’s command", "given"),
      line("drive_spool_opening", "drive", "s0"),
      line("load_spool_opening", "load", "s1"),
    ],
  },
  {
    title: "rod force",
    of: NEWTON,
    least: 20,
    lines: [
      line("load_force_set_point_n", "load’s set-point", "wanted"),
      line("drive_force_n", "drive", "s0"),
      line("load_force_n", "load", "s1"),
    ],
  },
];
