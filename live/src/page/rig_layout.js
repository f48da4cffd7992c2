// Where the parts of the rig stand on a drawing of a given width, in its pixels. Lengths along x are to scale with each other:
// the strokes of both cylinders and the way of the carriage are the same number of pixels a metre.

const CAP = 8;
const NARROW = 700;

/** The layout for a drawing so wide; `stroke_m` is that of both cylinders. */
export function layout(width, stroke_m) {
  const narrow = width < NARROW;
  const margin = narrow ? 1 : 6;
  const piston = narrow ? 8 : 14;
  const carriage = narrow ? 48 : 92;
  const clear = narrow ? 3 : 12;
  const perMetre = (width - 2 * margin - 4 * CAP - 2 * piston - carriage - 2 * clear) / (3 * stroke_m);
  const stroke = perMetre * stroke_m;
  const inside = stroke + piston;
  const driveInside = margin + CAP;
  const way = driveInside + inside + CAP + clear;
  const loadInside = way + carriage + stroke + clear + CAP;
  return {
    width,
    narrow,
    height: 400,
    perMetre,
    stroke,
    stroke_m,
    cap: CAP,
    piston,
    carriage,
    inside,
    /** Left end of the carriage's way: its left edge at 0 m. */
    way,
    cylinders: { drive: driveInside, load: loadInside },
    top: { title: 18, arrows: 38, cylinder: 140, carriage: 122, ruler: 236, valve: 304, supply: 372 },
    tall: { cylinder: 66, carriage: 98, arrow: 27, rod: 14 },
    newton: narrow ? 0.09 : 0.25,
    longest: narrow ? 64 : 200,
  };
}

/** The two axes: which way each extends, and on which side of its cylinder the cap is. */
export const AXES = {
  drive: { sign: 1, title: "Drive", does: "position control" },
  load: { sign: -1, title: "Load", does: "force control" },
};
