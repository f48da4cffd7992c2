// The live page: what the program tells goes into the store and the views; a frame of the browser draws what is new.
//
//   stream ──► rows ──► store ──► drawing, figures, charts       (a frame of the browser)
//          ──► state, histograms, messages ──► the other views   (as they come)
//   controls, keys ──► command ──► the program

import { Chains } from "./chains.js";
import { Charts } from "./charts.js";
import { Controls } from "./controls.js";
import { byId, element, say, set } from "./dom.js";
import { broken } from "./fault_form.js";
import { Figures } from "./figures.js";
import { Heartbeat } from "./heartbeat.js";
import { addMessage, showMessages } from "./messages.js";
import { RigDrawing } from "./rig_drawing.js";
import { buildKey } from "./rig_key.js";
import { Store } from "./store.js";
import { catchUp, listen } from "./stream.js";
import { startTheme } from "./theme.js";
import { count, words } from "./units.js";

const TELL_MS = 5_000;

startTheme();
buildKey();
const store = new Store();
const drawing = new RigDrawing(byId("drawing"));
const figures = new Figures();
const charts = new Charts(store);
const chains = new Chains();
const heartbeat = new Heartbeat();
const controls = new Controls({ pause: () => charts.togglePause() });

let state = null;
let rowsAreNew = false;
let connections = { page: false, bus: null, telemetry: null };

const value = (column) => store.last(column) ?? state?.last?.[column] ?? null;

const listener = {
  description(description) {
    const name = description.experiment?.title ?? description.experiment?.name ?? description.experiment;
    say(byId("experiment"), name ? String(name) : "live");
    document.title = name ? `${name} – airbench live` : "airbench live";
    drawing.describe(description.rig ?? {});
    chains.describe(description.chains ?? []);
    controls.describe(description);
  },
  history(rows) {
    store.clear();
    store.take(rows);
    rowsAreNew = true;
  },
  rows(rows) {
    store.take(rows);
    rowsAreNew = true;
  },
  state(told) {
    state = told;
    if (told.messages) showMessages(told.messages, (message) => isGrave(message) && store.mark(message));
    chains.show(told);
    heartbeat.show(told);
    controls.show(told);
    showStop(told);
    showBroken(told);
    say(byId("viewers"), `${count(told.viewers)} looking on.`);
    rowsAreNew = true;
  },
  histograms: (told) => heartbeat.histograms(told),
  message(message) {
    addMessage(message);
    if (isGrave(message)) store.mark(message);
  },
  status(told) {
    const hadTelemetry = connections.telemetry;
    connections = { ...connections, ...told };
    showConnections();
    // Another emulator, another run: what it is has to be asked anew.
    if (told.telemetry === "connected" && hadTelemetry === "gone") catchUp(listener);
  },
  connection(isThere) {
    connections.page = isThere;
    showConnections();
  },
};

/** Whether the charts mark its moment. */
function isGrave({ level, t_s }) {
  return level !== "info" && typeof t_s === "number";
}

function showConnections() {
  const isGood = {
    page: connections.page,
    bus: connections.bus !== "gone",
    telemetry: connections.telemetry !== "gone",
  };
  for (const [name, good] of Object.entries(isGood)) {
    set(byId(`light-${name}`), { class: good ? "good" : "bad", title: good ? `${name}: connected` : `${name}: gone` });
  }
  const lost = [
    [
      connections.page,
      "The program that serves this page does not answer. What is shown is old; it connects again by itself.",
    ],
    [isGood.bus, "The bus is gone: the run has ended, or has not begun. It connects again by itself."],
    [isGood.telemetry, "The emulator’s telemetry is gone: shown is what the bus tells."],
  ].find(([isThere]) => !isThere);
  byId("banner").dataset.lost = lost ? lost[1] : "";
  showBanner();
}

function showStop({ emergency_stop: stop = {} }) {
  byId("banner").dataset.stop = stop.active
    ? `Emergency stop, held by ${(stop.senders ?? []).map(words).join(" and ") || "the rig"}: supply discharged, valves shut.`
    : "";
  set(document.body, { "data-stopped": Boolean(stop.active) });
  showBanner();
}

function showBanner() {
  const banner = byId("banner");
  const text = [banner.dataset.stop, banner.dataset.lost].filter(Boolean).join(" ");
  say(banner, text);
  banner.hidden = text === "";
  set(banner, { class: banner.dataset.stop ? "banner stopped" : "banner" });
}

function showBroken({ faults_active: active = [] }) {
  const text = active.map(broken);
  const list = byId("broken");
  if (list.dataset.text === text.join("\n")) return;
  list.dataset.text = text.join("\n");
  list.replaceChildren(...text.map((line) => element("li", {}, `Broken on purpose: ${line}`)));
}

function frame(now_ms) {
  requestAnimationFrame(frame);
  if (rowsAreNew) {
    rowsAreNew = false;
    const seen = { value, state };
    drawing.show(seen);
    figures.show(seen);
    const now_s = state?.t_s ?? store.last_s;
    say(byId("clock"), Number.isFinite(now_s) ? Math.max(now_s, store.last_s).toFixed(1) : "–");
  }
  charts.frame(now_ms);
}

setInterval(() => drawing.tell({ value, state }), TELL_MS);
requestAnimationFrame(frame);
listen(listener);
