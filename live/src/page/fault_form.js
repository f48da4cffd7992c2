// Breaking something on purpose: which fault, where, with which numbers; and what is broken, to be mended.

import { element } from "./dom.js";
import { words } from "./units.js";

export class FaultForm {
  /** `act(command, parameters)` sends a command. */
  constructor(act) {
    this.act = act;
    this.faults = [];
    this.which = element("select", { id: "fault-name", onchange: () => this.choose() });
    this.where = element("select", { id: "fault-place" });
    this.about = element("p", { class: "soft small", id: "fault-about" });
    this.numbers = element("div", { class: "numbers" });
    this.active = element("ul", { class: "active", id: "faults-active" });
    this.mendAll = element("button", { type: "button", onclick: () => act("mend", { all: true }) }, "Mend all");
    this.form = element(
      "form",
      { id: "fault-form", onsubmit: (event) => this.submit(event) },
      element("label", {}, "fault ", this.which),
      element("label", {}, "at ", this.where),
      this.numbers,
      this.about,
      element("div", { class: "row" }, element("button", { type: "submit" }, "Break it"), this.mendAll),
    );
    this.element = element("div", {}, this.form, this.active);
  }

  describe(faults) {
    this.faults = faults;
    const groups = new Map();
    for (const { name, group = "faults" } of faults) groups.set(group, [...(groups.get(group) ?? []), name]);
    const kept = this.which.value;
    this.which.replaceChildren(
      ...[...groups].map(([group, names]) =>
        element("optgroup", { label: group }, ...names.map((name) => element("option", { value: name }, words(name)))),
      ),
    );
    if (faults.some(({ name }) => name === kept)) this.which.value = kept;
    this.choose();
  }

  choose() {
    const fault = this.faults.find(({ name }) => name === this.which.value);
    this.where.replaceChildren(...(fault?.places ?? []).map((place) => element("option", { value: place }, place)));
    this.about.textContent = fault?.about ?? "";
    this.numbers.replaceChildren(...(fault?.parameters ?? []).map(numberInput));
  }

  submit(event) {
    event.preventDefault();
    const values = {};
    for (const input of this.numbers.querySelectorAll("input")) {
      if (input.value !== "") values[input.name] = Number(input.value);
    }
    this.act("fault", { name: this.which.value, place: this.where.value, values });
  }

  show({ faults_active = [] }) {
    const text = JSON.stringify(faults_active);
    if (text === this.seen) return;
    this.seen = text;
    this.mendAll.disabled = faults_active.length === 0;
    this.active.replaceChildren(
      ...faults_active.map((fault) =>
        element(
          "li",
          {},
          element("span", {}, broken(fault)),
          element(
            "button",
            { type: "button", onclick: () => this.act("mend", { name: fault.name, place: fault.place }) },
            "Mend",
          ),
        ),
      ),
    );
  }
}

/** A fault that is active, in words. */
export function broken({ name, place, values }) {
  const numbers = Object.entries(values ?? {}).map(([key, value]) => `${key} ${Number(Number(value).toPrecision(6))}`);
  return `${words(name)} at ${place}${numbers.length ? ` (${numbers.join(", ")})` : ""}`;
}

function numberInput({ name, unit, low, high, default: usual, about, whole }) {
  const input = element("input", {
    type: "number",
    name,
    min: low,
    max: high,
    step: whole ? 1 : "any",
    value: usual ?? null,
    required: usual === null || usual === undefined,
    placeholder: `${low} to ${high}`,
    title: about ?? "",
  });
  return element("label", {}, `${words(name.replaceAll("_", " "))} `, input, unit && unit !== "1" ? ` ${unit}` : "");
}
