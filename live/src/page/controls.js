// What a hand can do: emergency stop and the way back, start and end, linkage, weights, a push, faults, and a record of the last
// minute. Shown only where the program takes commands from this page.

import { send, takeToken } from "./command.js";
import { byId, element, say, set } from "./dom.js";
import { FaultForm } from "./fault_form.js";
import { addMessage } from "./messages.js";
import { KEPT_S } from "./store.js";
import { MM } from "./units.js";

const STOP_KEY = "Escape";
const PAUSE_KEY = "p";
const DEFAULT_WEIGHTS_LIMIT_KG = 20;
const STEP_KG = 0.5;
const DEFAULT_PUSH_N = 40;
const MOST_PUSH_N = 500;
const DEFAULT_FORCE_N = 100;
const MOST_FORCE_N = 1000;
const MISSING = "Fill in a number first: nothing was asked for.";

export class Controls {
  /** `pause` pauses the charts. */
  constructor({ pause }) {
    this.token = takeToken();
    this.allowed = false;
    this.faults = new FaultForm((command, parameters) => this.act(command, parameters));
    this.build();
    byId("stop").addEventListener("click", () => this.act("emergency-stop"));
    addEventListener("hashchange", () => {
      this.token = takeToken();
      if (this.described) this.describe(this.described);
    });
    // In the capturing phase: nothing on the page can keep the key for itself.
    addEventListener("keydown", (event) => this.key(event, pause), { capture: true });
  }

  /** What the program allows, and what there is to break. */
  describe(description) {
    this.described = description;
    this.allowed = Boolean(description.control) && this.token !== null;
    byId("stop").hidden = !this.allowed;
    byId("watching").hidden = this.allowed;
    byId("controls").hidden = !this.allowed;
    byId("hands-off").hidden = this.allowed;
    say(
      byId("hands-off"),
      description.control
        ? "This page only watches: to act, open the address with the token that the program printed."
        : "This page only watches: the program was started without --control.",
    );
    this.faults.describe(description.faults ?? []);
    set(this.weights, { max: description.rig?.added_mass_limit_kg ?? DEFAULT_WEIGHTS_LIMIT_KG });
    const stroke_m = description.rig?.stroke_m;
    if (stroke_m) set(this.place, { max: MM.factor * stroke_m });
  }

  show(state) {
    this.faults.show(state);
    const chains = Object.values(state.chains ?? {});
    const isWaiting = chains.some((axis) => axis?.emergency_stop === "waiting-for-start");
    set(this.start, { class: isWaiting ? "wanted" : "" });
    this.release.disabled = !state.emergency_stop?.active;
    this.link.disabled = Boolean(state.linked);
    this.unlink.disabled = !state.linked;
    if (document.activeElement !== this.weights && !this.isEdited) this.weights.value = state.weights_kg ?? 0;
  }

  async act(command, parameters = {}) {
    if (!this.allowed) return;
    // A field that holds no number must not be taken for 0.
    const lacks = Object.values(parameters).some(Number.isNaN);
    const { ok, message } = lacks ? { ok: false, message: MISSING } : await send(command, parameters);
    set(byId("answer"), { class: ok ? "answer good" : "answer bad" });
    say(byId("answer"), message);
    if (!ok) addMessage({ t_s: null, level: "warning", text: message });
  }

  key(event, pause) {
    if (event.repeat || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === STOP_KEY && this.allowed) {
      event.preventDefault();
      this.act("emergency-stop");
    }
    const isTyping = event.target instanceof Element && event.target.closest("input, select, textarea");
    if (event.key.toLowerCase() === PAUSE_KEY && !isTyping) pause();
  }

  build() {
    const button = (text, command, parameters = () => ({})) =>
      element(
        "button",
        { type: "button", "data-command": command, onclick: () => this.act(command, parameters()) },
        text,
      );
    const number = (attributes) => element("input", { type: "number", ...attributes });
    const group = (name, ...children) => element("fieldset", {}, element("legend", {}, name), ...children);
    this.start = button("Start", "start");
    this.release = button("Release the stop", "release");
    this.link = button("Link", "link");
    this.unlink = button("Unlink", "unlink");
    this.weights = number({ id: "weights", min: 0, step: STEP_KG, value: 0, oninput: () => (this.isEdited = true) });
    const push = number({ id: "push", min: -MOST_PUSH_N, max: MOST_PUSH_N, step: 5, value: DEFAULT_PUSH_N });
    const on = element(
      "select",
      { id: "push-on" },
      element("option", { value: "carriage" }, "carriage"),
      element("option", { value: "load" }, "load"),
    );
    this.place = number({ id: "place", min: 0, step: 10, value: 250 });
    const force = number({ id: "force", min: 0, max: MOST_FORCE_N, step: 10, value: DEFAULT_FORCE_N });
    const seconds = number({ id: "save-seconds", min: 1, max: KEPT_S, step: 1, value: KEPT_S });
    const setWeights = button("Put on", "weights", () => {
      this.isEdited = false;
      return { kg: this.weights.valueAsNumber };
    });
    byId("controls").append(
      group("Run", element("div", { class: "row" }, this.start, button("Abort", "abort"), this.release)),
      group(
        "Rig",
        element(
          "div",
          { class: "row" },
          this.link,
          this.unlink,
          element("label", {}, "weights ", this.weights, " kg"),
          setWeights,
        ),
        element(
          "div",
          { class: "row" },
          element("label", {}, "a hand pushes ", on),
          element("label", {}, "with ", push, " N"),
          button("Push", "hand", () => ({ on: on.value, newton: push.valueAsNumber })),
          button("Let go", "hand", () => ({ on: on.value, newton: 0 })),
        ),
      ),
      group(
        "Set-points by hand",
        element(
          "div",
          { class: "row" },
          element("label", {}, "drive to ", this.place, " mm"),
          button("Go", "set-point", () => ({ axis: "drive", position_m: this.place.valueAsNumber / MM.factor })),
        ),
        element(
          "div",
          { class: "row" },
          element("label", {}, "load with ", force, " N"),
          button("Press", "set-point", () => ({ axis: "load", force_n: force.valueAsNumber })),
        ),
        element("p", { class: "small" }, "Obeyed by experiments that allow it, such as by-hand."),
      ),
      group("Break on purpose", this.faults.element),
      group(
        "Record",
        element(
          "div",
          { class: "row" },
          element("label", {}, "the last ", seconds, " s"),
          button("Save", "save", () => ({ seconds: seconds.valueAsNumber })),
        ),
      ),
    );
  }
}
