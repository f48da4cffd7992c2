// The drawing of the rig: built once for a width, moved with every row. Whatever moves keeps its element and gets new
// attributes; nothing is made or thrown away while it runs.

import { drawn, say, set } from "./dom.js";
import { cylinder } from "./rig_cylinder.js";
import { AXES, layout } from "./rig_layout.js";
import { linkage } from "./rig_linkage.js";
import { carriage, ruler } from "./rig_carriage.js";
import { supply, valve } from "./rig_air.js";
import { BAR, MM, shown } from "./units.js";

const DEFAULT_STROKE_M = 0.5;

/** A drawing inside `place`; `rig` are the numbers of the description. */
export class RigDrawing {
  constructor(place) {
    this.place = place;
    this.rig = {};
    this.seen = null;
    this.width = 0;
    new ResizeObserver(([entry]) => this.fit(Math.floor(entry.contentRect.width))).observe(place);
  }

  /** Draws anew for another rig. */
  describe(rig) {
    this.rig = rig;
    this.build();
  }

  fit(width) {
    if (width === this.width || width < 100) return;
    this.width = width;
    this.build();
  }

  build() {
    if (!this.width) return;
    const at = layout(this.width, this.rig.stroke_m ?? DEFAULT_STROKE_M);
    this.parts = [
      supply(at),
      valve(at, "drive"),
      valve(at, "load"),
      ruler(at),
      cylinder(at, "drive"),
      cylinder(at, "load"),
      carriage(at, this.rig),
      linkage(at, this.rig),
    ];
    const titles = Object.entries(AXES).map(([axis, { title, does }]) => {
      const x = axis === "drive" ? at.cylinders.drive - at.cap : at.cylinders.load + at.inside + at.cap;
      return drawn(
        "text",
        { x, y: at.top.title, class: axis === "drive" ? "name" : "name end" },
        drawn("tspan", { class: `axis-${axis}` }, title),
        drawn("tspan", { class: "quiet", dx: 6 }, at.narrow ? "" : does),
      );
    });
    this.description = drawn("desc", { id: "rig-words" });
    const svg = drawn(
      "svg",
      {
        class: "plot rig",
        viewBox: `0 0 ${at.width} ${at.height}`,
        width: at.width,
        height: at.height,
        role: "img",
        "aria-labelledby": "rig-title rig-words",
      },
      this.description,
      ...titles,
      ...this.parts.flatMap((part) => part.elements),
    );
    this.svg = svg;
    this.place.replaceChildren(svg);
    if (this.seen) this.show(this.seen);
  }

  /** Moves everything to what was seen last: `value` gives a column's number, `state` is the program's last state. */
  show(seen) {
    this.seen = seen;
    if (!this.parts) return;
    this.parts.forEach((part) => part.show(seen));
    set(this.svg, { "data-stopped": Boolean(seen.state?.emergency_stop?.active) });
  }

  /** What is to be seen, in words, for who does not see it; now and then is often enough. */
  tell({ value, state }) {
    if (!this.description) return;
    const linked = state?.linked ? "linked" : "not linked";
    say(
      this.description,
      `The carriage is at ${shown(value("drive_position_m"), MM)}, the load at ${shown(value("load_position_m"), MM)}, ` +
        `${linked}; the supply has ${shown(value("supply_pressure_pa"), BAR)}.`,
    );
  }
}
