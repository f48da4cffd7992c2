// From SI, which the program speaks, to the units that people use.

const quantity = (unit, factor, digits) => ({ unit, factor, digits });

export const MM = quantity("mm", 1e3, 2);
export const MM_PER_S = quantity("mm/s", 1e3, 0);
export const BAR = quantity("bar", 1e-5, 2);
export const NEWTON = quantity("N", 1, 0);
export const PERCENT = quantity("%", 100, 1);
export const NL_PER_MIN = quantity("Nl/min", 6e4, 0);
export const KG = quantity("kg", 1, 1);

/** The number in the quantity's unit, without it; a dash for none. */
export function number(value, of, digits = of.digits) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const text = (value * of.factor).toFixed(digits);
  // A minus as wide as a plus, and none before a zero.
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−");
}

/** The number with its unit. */
export function shown(value, of, digits = of.digits) {
  return `${number(value, of, digits)} ${of.unit}`;
}

/** Microseconds with the digits that they are known to. */
export function microseconds(value) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value >= 1e4) return `${(value / 1e3).toFixed(1)} ms`;
  return `${value.toFixed(value < 100 ? 1 : 0)} µs`;
}

/** A count with thin spaces between thousands. */
export function count(value) {
  return value === null || value === undefined ? "–" : String(Math.round(value)).replace(/\B(?=(\d{3})+$)/g, "\u2009");
}

/** A state's or a fault's name as words. */
export function words(name) {
  return name.replaceAll("-", " ");
}
