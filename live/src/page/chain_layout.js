// Where the states of the chains stand: column and row, so that the usual way reads as a path. States that a place is not known
// for follow below; edges come from the program.

const PLACES = {
  main: {
    "waiting-for-rig": [0, 0],
    "initial-positioning": [1, 0],
    preparing: [2, 0],
    done: [0, 1],
    "final-settling": [1, 1],
    "initial-force": [2, 1],
    experiment: [1, 2],
    settling: [2, 2],
    aborted: [0, 3],
    fault: [1, 3],
  },
  force: {
    "initial-ramp": [0, 0],
    "load-profile": [1, 0],
    moving: [2, 0],
    idle: [0, 1],
    limited: [1, 1],
    standstill: [2, 1],
    fault: [0, 2],
    done: [2, 2],
  },
  matching: { idle: [0, 0], "waiting-for-rest": [1, 0], averaging: [2, 0], matched: [2, 1], fault: [1, 1] },
  "emergency-stop": {
    ready: [0, 0],
    tripped: [1, 0],
    "waiting-for-release": [2, 0],
    "waiting-for-start": [0, 1],
    recovering: [1, 1],
  },
};
const COLUMNS = 3;
/** States that are reached from any other, or nearly: one arrow says so. */
const ANYWHERE = {
  main: ["aborted", "fault", "waiting-for-rig"],
  force: ["fault"],
  matching: ["idle"],
  "emergency-stop": ["tripped"],
};

/** Each state's column and row. */
export function places({ name, states }) {
  const known = PLACES[name.replaceAll("_", "-")] ?? {};
  const rows = Object.values(known).map(([, row]) => row + 1);
  let next = COLUMNS * Math.max(0, ...rows);
  const placed = (state) => known[state] ?? [next % COLUMNS, Math.floor(next++ / COLUMNS)];
  return new Map(states.map((state) => [state, placed(state)]));
}

/**
 * Edges to be drawn one by one, states that are reached from anywhere, and, for each of these that leads on to a state far away,
 * which one: words say it better than an arrow across the others.
 */
export function edgesOf({ name, edges }) {
  const at = PLACES[name.replaceAll("_", "-")] ?? {};
  const isFar = (from, to) => anywhere.has(from) && at[from] && at[to] && Math.abs(at[from][1] - at[to][1]) > 1;
  const anywhere = new Set(ANYWHERE[name.replaceAll("_", "-")] ?? []);
  const single = edges.filter(([from, to]) => !anywhere.has(to) && !isFar(from, to));
  const onward = new Map(edges.filter(([from, to]) => isFar(from, to)));
  return { anywhere, single, onward };
}
