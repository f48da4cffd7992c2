// Commands to the program: allowed only with --control, and with the token that it prints with its address.

const KEY = "airbench-token";
const HEADER = "X-Airbench-Token";

/** The token: out of the address, which then forgets it, or kept since an earlier load of this tab; null without one. */
export function takeToken() {
  const inAddress = new URLSearchParams(location.hash.slice(1)).get("token");
  if (inAddress) {
    sessionStorage.setItem(KEY, inAddress);
    history.replaceState(null, "", location.pathname + location.search);
  }
  return sessionStorage.getItem(KEY);
}

/** Sends a command; `{ ok, message }` in any case. */
export async function send(command, parameters = {}) {
  try {
    const answer = await fetch("/api/control", {
      method: "POST",
      headers: { "Content-Type": "application/json", [HEADER]: sessionStorage.getItem(KEY) ?? "" },
      body: JSON.stringify({ command, ...parameters }),
    });
    const told = await answer.json().catch(() => ({}));
    return { ok: answer.ok && told.ok !== false, message: told.message ?? `${answer.status} ${answer.statusText}` };
  } catch {
    return { ok: false, message: "The program does not answer." };
  }
}
