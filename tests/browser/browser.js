// A browser for the tests and the pictures: Debian's, without a window, that asks nobody for anything.

import { accessSync, constants } from "node:fs";
import { createRequire } from "node:module";
import path from "node:path";

const ARGUMENTS = [
  "--no-sandbox", // root has no user namespace to be confined in, and what it loads is our own page
  "--disable-gpu",
  "--disable-quic",
  "--no-first-run",
  "--disable-background-networking",
  "--disable-component-update",
  "--disable-sync",
];

/** What the environment has to say. */
export function given(name) {
  const value = process.env[name];
  if (!value) throw new Error(`${name} is not set`);
  return value;
}

/** A program of this name on the path: what drives the browser wants to know where it is. */
function program(name) {
  const found = given("PATH")
    .split(path.delimiter)
    .map((folder) => path.join(folder, name))
    .find((candidate) => {
      try {
        accessSync(candidate, constants.X_OK);
        return true;
      } catch {
        return false;
      }
    });
  if (!found) throw new Error(`no ${name} on the path: scripts/test installs it`);
  return found;
}

/** Starts the browser; with a folder for itself, which Playwright makes and clears away. */
export async function launch() {
  // node_modules stands below target/, not beside this file.
  const { chromium } = createRequire(path.resolve(given("AIRBENCH_BROWSER"), "package.json"))("playwright-core");
  return chromium.launch({ executablePath: program("chromium"), headless: true, args: ARGUMENTS });
}
