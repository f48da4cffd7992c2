// What the program tells: its description, the last minute, then events as they come. The browser connects again by itself; a
// connection that came back asks for description and history anew, since another run may have begun meanwhile.

const HISTORY_S = 60;
/** Silence after which the connection counts as lost, ms; the program lets itself be heard every 5 s. */
const SILENCE_MS = 12_000;
const RETRY_MS = 1_000;

/**
 * Listens for good. `listener` has a method for each event: description, rows, state, message, histograms, status, and
 * connection with true or false.
 */
export function listen(listener) {
  let source = null;
  let heard = 0;

  const open = () => {
    heard = performance.now();
    source = new EventSource("/api/events");
    source.onopen = () => {
      heard = performance.now();
      catchUp(listener);
    };
    source.onerror = () => {
      listener.connection(false);
      // A refusal closes it for good: the browser tries no more, this does.
      if (source.readyState === EventSource.CLOSED) setTimeout(open, RETRY_MS);
    };
    for (const kind of ["rows", "state", "message", "histograms", "status"]) {
      source.addEventListener(kind, (event) => {
        heard = performance.now();
        listener[kind](JSON.parse(event.data));
      });
    }
  };

  setInterval(() => {
    if (source.readyState === EventSource.OPEN && performance.now() - heard > SILENCE_MS) {
      source.close();
      listener.connection(false);
      open();
    }
  }, RETRY_MS);
  open();
}

/** Description, history and state, for a beginning or after another run has begun. */
export async function catchUp(listener) {
  try {
    const [description, history, state] = await Promise.all(
      ["/api/description", `/api/history?seconds=${HISTORY_S}`, "/api/state"].map(json),
    );
    listener.description(description);
    listener.history(history);
    listener.state(state);
    listener.connection(true);
  } catch {
    // The stream's own error tells of it, and its next opening asks again.
    listener.connection(false);
  }
}

async function json(path) {
  const answer = await fetch(path, { cache: "no-store" });
  if (!answer.ok) throw new Error(`${path}: ${answer.status}`);
  return answer.json();
}
