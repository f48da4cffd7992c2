// The last minute of rows, a column each, in SI.

/** How long rows are kept, s. */
export const KEPT_S = 60;

/** Rows come every 10 ms; so much between two is a gap. */
const GAP_S = 0.1;

export class Store {
  constructor() {
    this.clear();
  }

  clear() {
    this.t_s = [];
    this.columns = new Map();
    this.marks = [];
  }

  /** Takes rows as the program sends them; a time that runs backwards is another run, and clears what was there. */
  take(rows) {
    if (rows.t_s.length === 0) return;
    if (rows.t_s[0] < this.last_s - 1) this.clear();
    const fresh = rows.t_s.findIndex((t) => t > this.last_s);
    if (fresh < 0) return;
    this.leaveGap(rows.t_s[fresh]);
    const before = this.t_s.length;
    this.t_s.push(...rows.t_s.slice(fresh));
    for (const [name, values] of Object.entries(rows.columns)) {
      if (!this.columns.has(name)) this.columns.set(name, new Array(before).fill(null));
      this.columns.get(name).push(...values.slice(fresh));
    }
    for (const values of this.columns.values()) {
      while (values.length < this.t_s.length) values.push(null);
    }
    this.forget();
  }

  /** Rows that were missed are a gap, no straight line. */
  leaveGap(next_s) {
    if (this.t_s.length === 0 || next_s - this.last_s < GAP_S) return;
    this.t_s.push(this.last_s + GAP_S / 2);
    for (const values of this.columns.values()) values.push(null);
  }

  /** Remembers a moment that the charts mark. */
  mark(mark) {
    this.marks.push(mark);
  }

  /** The newest time, s; before all times when there is none. */
  get last_s() {
    return this.t_s.length ? this.t_s[this.t_s.length - 1] : Number.NEGATIVE_INFINITY;
  }

  /** The newest value of a column; null when there is none. */
  last(name) {
    const values = this.columns.get(name);
    return values?.length ? values[values.length - 1] : null;
  }

  /** Rows from the one before `from_s` to the one after `to_s`: times, and values of a column times a factor. */
  between(from_s, to_s) {
    const first = Math.max(0, firstAfter(this.t_s, from_s) - 1);
    const end = Math.min(this.t_s.length, firstAfter(this.t_s, to_s) + 1);
    const nothing = new Array(end - first).fill(null);
    return {
      t_s: this.t_s.slice(first, end),
      column: (name, factor) => {
        const values = this.columns.get(name);
        return values ? values.slice(first, end).map((value) => (value === null ? null : value * factor)) : nothing;
      },
    };
  }

  /** A copy that stays as it is, for a pause. */
  copy() {
    const copy = new Store();
    copy.t_s = [...this.t_s];
    copy.columns = new Map([...this.columns].map(([name, values]) => [name, [...values]]));
    copy.marks = [...this.marks];
    return copy;
  }

  forget() {
    const old = firstAfter(this.t_s, this.last_s - KEPT_S);
    // In pieces: the front of an array is dear to cut.
    if (old < 200) return;
    this.t_s.splice(0, old);
    for (const values of this.columns.values()) values.splice(0, old);
    this.marks = this.marks.filter((mark) => mark.t_s >= this.t_s[0]);
  }
}

/** Index of the first time after `t_s`. */
function firstAfter(times, t_s) {
  let [low, high] = [0, times.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] > t_s) high = middle;
    else low = middle + 1;
  }
  return low;
}
