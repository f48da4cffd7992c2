// What happened, the newest first: a sign for how grave it is, the rig's time, a sentence.

import { byId, element } from "./dom.js";

const MOST = 200;
const SIGNS = { info: "·", warning: "!", error: "✕" };

/** Shows these in place of all others, the oldest first, each handed on too. */
export function showMessages(messages, each) {
  byId("messages").replaceChildren();
  for (const message of messages) {
    addMessage(message);
    each(message);
  }
}

/** Adds a message; the same one again only counts. */
export function addMessage({ t_s, level, text }) {
  const list = byId("messages");
  const newest = list.firstElementChild;
  if (newest && newest.dataset.text === text) {
    newest.dataset.times = Number(newest.dataset.times ?? 1) + 1;
    newest.querySelector(".times").textContent = ` (${newest.dataset.times} times)`;
    return;
  }
  const time = typeof t_s === "number" ? t_s.toFixed(2) : "";
  const item = element(
    "li",
    { class: `message ${level}` },
    element("span", { class: "sign", title: level }, SIGNS[level] ?? SIGNS.info),
    element("span", { class: "when" }, time),
    element("span", { class: "what" }, text, element("span", { class: "times soft" })),
  );
  item.dataset.text = text;
  list.prepend(item);
  while (list.childElementCount > MOST) list.lastElementChild.remove();
}
