// Light, dark, or as the system has it. The stylesheets know the system's wish only; a person's own is put over it by changing
// the condition of their rules for dark, so that the palette stands in one place.

import { byId } from "./dom.js";

const CHOICES = ["system", "light", "dark"];
const CONDITION = { system: "(prefers-color-scheme: dark)", light: "not all", dark: "all" };
const KEY = "airbench-look";

const listeners = [];

/** Calls back whenever colours may have changed. */
export function onColours(listener) {
  listeners.push(listener);
}

/** The colour that a variable of the stylesheet has now. */
export function colour(variable) {
  return getComputedStyle(document.documentElement).getPropertyValue(variable).trim();
}

/** Puts the kept choice into force, and the button to work. */
export function startTheme() {
  const rules = darkRules();
  const button = byId("theme");
  let choice = CHOICES.includes(localStorage.getItem(KEY)) ? localStorage.getItem(KEY) : "system";
  const apply = () => {
    for (const rule of rules) rule.media.mediaText = CONDITION[choice];
    document.documentElement.style.colorScheme = choice === "system" ? "light dark" : choice;
    button.lastChild.textContent = ` ${choice}`;
    listeners.forEach((listener) => listener());
  };
  button.addEventListener("click", () => {
    choice = CHOICES[(CHOICES.indexOf(choice) + 1) % CHOICES.length];
    localStorage.setItem(KEY, choice);
    apply();
  });
  matchMedia(CONDITION.system).addEventListener("change", apply);
  apply();
}

function darkRules() {
  const rules = [...document.styleSheets].flatMap((sheet) => [...sheet.cssRules]);
  return rules.filter((rule) => rule instanceof CSSMediaRule && rule.conditionText.includes("prefers-color-scheme"));
}
