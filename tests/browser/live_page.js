// The live page in a browser, against programs that run: the cases of tests/tests/watch_page.rs, one after the other in one
// browser.
//
// AIRBENCH_PAGE is the address with its token. What only the test can do is asked for on standard error ("asks: …") and waited
// for on standard input ("done"). Nothing is ever waited for by time alone: each wait is for something to be seen.

import assert from "node:assert/strict";
import readline from "node:readline";
import { given, launch } from "./browser.js";

/** How long anything may take that should take a moment: a protection against hanging, no measure. */
const PATIENCE_MS = 60_000;
const WIDTHS = [1280, 400];
const FAULT = { name: "pressure-sensor-offset", place: "load.a", key: "offset_pa", value: 150_000 };
const SHOWN_BAR = 1.5;
/** Noise of the sensor, and the air that moves meanwhile, bar. */
const WITHIN_BAR = 0.3;

const address = new URL(given("AIRBENCH_PAGE"));
const origin = address.origin;
const browser = await launch();
const told = readline.createInterface({ input: process.stdin })[Symbol.asyncIterator]();

/** Has the test do something. */
async function ask(what) {
  console.error(`asks: ${what}`);
  const { value } = await told.next();
  assert.equal(value, "done");
}

/** A page that is watched: errors it has, and where it sends requests. */
async function open(url, width = WIDTHS[0]) {
  const context = await browser.newContext({ viewport: { width, height: 900 } });
  const page = await context.newPage();
  page.setDefaultTimeout(PATIENCE_MS);
  page.seen = { errors: [], foreign: [] };
  page.on("console", (message) => message.type() === "error" && page.seen.errors.push(message.text()));
  page.on("pageerror", (error) => page.seen.errors.push(String(error)));
  context.on("request", (request) => {
    if (!request.url().startsWith(`${origin}/`)) page.seen.foreign.push(request.url());
  });
  await page.goto(url);
  return page;
}

/** A number that the page shows; NaN for a dash. */
function number(text) {
  return Number(text.replace("−", "-"));
}

async function figure(page, column) {
  return number(await page.locator(`#figures [data-column=${column}] b`).innerText());
}

/** The value that a chart's read-out tells of a curve. */
async function plotted(page, chart, curve) {
  const entry = page.locator(`figure[data-chart="${chart}"] .legend li:has(span:text-is("${curve}"))`);
  return number(await entry.locator("output").innerText());
}

async function until(what, condition) {
  const end = Date.now() + PATIENCE_MS;
  while (!(await condition())) {
    assert.ok(Date.now() < end, `not within patience: ${what}`);
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
}

const stopped = (page, is) =>
  until(`stopped: ${is}`, async () => (await page.getAttribute("body", "data-stopped")) === String(is));

const moves = (page) =>
  until("the drive moves", async () => Math.abs(await figure(page, "drive_velocity_m_per_s")) > 20);

/** Without air, and at rest: not only where it turns, so several times in a row. */
async function stands(page) {
  await until("the supply is discharged", async () => (await figure(page, "supply_pressure_pa")) < 1.2);
  let looks = 0;
  await until("the axis stands", async () => {
    looks = (await figure(page, "drive_velocity_m_per_s")) === 0 ? looks + 1 : 0;
    return looks === 5;
  });
}

/** After a stop: its release, and a start. */
async function back(page) {
  await page.getByRole("button", { name: "Release the stop" }).click();
  await stopped(page, false);
  await page.locator("button.wanted", { hasText: "Start" }).click();
  await moves(page);
}

const cases = {
  async "the page loads, and drawing and charts move"(page) {
    await moves(page);
    const piston = () => page.locator(".piston").first().getAttribute("x");
    const [x, position, clock] = [
      await piston(),
      await plotted(page, "position", "drive"),
      await page.innerText("#clock"),
    ];
    await until("the piston moves", async () => (await piston()) !== x);
    await until("the read-out moves", async () => (await plotted(page, "position", "drive")) !== position);
    await until("the clock goes on", async () => number(await page.innerText("#clock")) > number(clock));
    const drawn = () => page.locator("figure[data-chart=position] canvas").evaluate((canvas) => canvas.toDataURL());
    const before = await drawn();
    await until("the chart is drawn anew", async () => (await drawn()) !== before);
    await until("percentiles", async () => /µs|ms/.test(await page.innerText("tr[data-stage=wake_up]")));
    await until("frames by name", async () => (await page.innerText(".frames")).includes("DriveSensors"));
    await until("the light", async () =>
      /yes|doubtful|no/.test((await page.getAttribute("#claim", "data-supported")) ?? ""),
    );
    await until("a state is lit", async () => (await page.locator("[data-chain=main] .state.lit").count()) > 0);
  },

  async "it is readable at both widths, and the stop stays in reach"(page) {
    for (const width of WIDTHS) {
      await page.setViewportSize({ width, height: 900 });
      // Drawings take the new width with the next frame, which a busy machine draws later than it answers here.
      await until(
        `no more than ${width} px wide`,
        async () => (await page.evaluate(() => document.documentElement.scrollWidth)) <= width,
      );
      await page.evaluate(() => scrollTo(0, document.body.scrollHeight));
      const box = await page.locator("#stop").boundingBox();
      assert.ok(box && box.y >= 0 && box.y < 200 && box.x + box.width <= width, `the stop at ${JSON.stringify(box)}`);
      await page.evaluate(() => scrollTo(0, 0));
    }
    await page.setViewportSize({ width: WIDTHS[0], height: 900 });
  },

  async "charts pause, zoom and tell what is under the cursor"(page) {
    await page.keyboard.press("p");
    assert.equal(await page.getAttribute("#pause", "aria-pressed"), "true");
    const box = await page.locator("figure[data-chart=position] .u-over").boundingBox();
    await page.mouse.move(box.x + 0.4 * box.width, box.y + 20);
    await page.mouse.down();
    await page.mouse.move(box.x + 0.6 * box.width, box.y + 20, { steps: 4 });
    await page.mouse.up();
    const span = Number(await page.locator("#span").inputValue());
    assert.ok(span > 1.5 && span < 2.5, `a fifth of 10 s, not ${span} s`);
    await page.mouse.move(box.x + 0.3 * box.width, box.y + 20);
    const early = await plotted(page, "position", "drive");
    await until("a time under the cursor", async () => /at .* s/.test(await page.innerText("#reading")));
    await page.mouse.move(box.x + 0.9 * box.width, box.y + 20);
    await until("another value at another time", async () => (await plotted(page, "position", "drive")) !== early);
    await page.mouse.move(0, 0);
    await page.keyboard.press("p");
    assert.equal(await page.getAttribute("#pause", "aria-pressed"), "false");
    assert.equal(await page.locator("#span").inputValue(), "10");
  },

  async "a fault that is switched on is seen in the plot, and mended"(page) {
    const sound = await plotted(page, "pressure", "load a");
    await page.selectOption("#fault-name", FAULT.name);
    await page.selectOption("#fault-place", FAULT.place);
    await page.fill(`#fault-form input[name=${FAULT.key}]`, String(FAULT.value));
    await page.getByRole("button", { name: "Break it" }).click();
    const shows = async (bar) => Math.abs((await plotted(page, "pressure", "load a")) - bar) < WITHIN_BAR;
    await until("the pressure is off", () => shows(sound + SHOWN_BAR));
    await until("it is told", async () =>
      (await page.innerText("#broken")).includes("pressure sensor offset at load.a"),
    );
    await page.locator("#faults-active button").click();
    await until("the pressure is sound", () => shows(sound));
    await until("nothing is told", async () => (await page.innerText("#broken")) === "");
  },

  async "weights are put on and taken off"(page) {
    for (const [weights, together] of [
      ["2.5", "7.5 kg"],
      ["0", "5.0 kg"],
    ]) {
      await page.fill("#weights", weights);
      await page.getByRole("button", { name: "Put on" }).click();
      await until(together, async () => (await page.textContent(".rig")).includes(together));
    }
  },

  async "a set-point by hand goes on the bus, and one that is not filled in does not"(page) {
    assert.equal(await page.getAttribute("#place", "max"), "500", "the stroke of the rig");
    await page.fill("#place", "");
    await page.getByRole("button", { name: "Go", exact: true }).click();
    await until("it is refused", async () => (await page.innerText("#answer")).startsWith("Fill in a number"));
    await page.fill("#place", "200");
    await page.getByRole("button", { name: "Go", exact: true }).click();
    await until("it is sent", async () => (await page.innerText("#answer")) === "on the bus");
  },

  async "an emergency stop by click stops the axis, and there is a way back"(page) {
    await moves(page);
    await page.click("#stop");
    await stopped(page, true);
    await until("the banner", async () => (await page.innerText("#banner")).includes("Emergency stop, held by"));
    await stands(page);
    await back(page);
  },

  async "an emergency stop by key stops the axis from within a field"(page) {
    await moves(page);
    await page.focus("#weights");
    await page.keyboard.press("Escape");
    await stopped(page, true);
    await stands(page);
    await back(page);
  },

  async "without the token a page only watches, and is refused"() {
    const page = await open(`${origin}/`);
    await moves(page);
    assert.ok(!(await page.locator("#stop").isVisible()) && !(await page.locator("#controls").isVisible()));
    await page.keyboard.press("Escape");
    const status = (token) =>
      page.evaluate(async (shown) => {
        const headers = { "Content-Type": "application/json", "X-Airbench-Token": shown };
        return (await fetch("/api/control", { method: "POST", headers, body: '{"command":"emergency-stop"}' })).status;
      }, token);
    assert.deepEqual([await status(""), await status("0".repeat(32))], [401, 401]);
    await page.context().close();
  },

  async "a foreign page cannot act, even with the token"(main) {
    const token = new URLSearchParams(address.hash.slice(1)).get("token");
    const elsewhere = `http://localhost:${address.port}`;
    assert.notEqual(elsewhere, origin, "the program listens at a number, so that its name is another origin");
    const context = await browser.newContext();
    const page = await context.newPage();
    // A page of another origin, whose own policy would not keep it from trying.
    await page.route(`${elsewhere}/`, (route) => route.fulfill({ contentType: "text/html", body: "<p>foreign</p>" }));
    await page.goto(`${elsewhere}/`);
    const tried = await page.evaluate(
      async ([url, shown]) => {
        const body = '{"command":"emergency-stop"}';
        const attempt = async (options) => {
          try {
            return String((await fetch(url, { method: "POST", body, ...options })).status);
          } catch (error) {
            return error.name;
          }
        };
        const headers = { "Content-Type": "application/json", "X-Airbench-Token": shown };
        return [await attempt({ headers }), await attempt({ mode: "no-cors" })];
      },
      [`${origin}/api/control`, token],
    );
    // Neither is its preflight answered, nor is it let see what became of a request without one.
    assert.deepEqual(tried, ["TypeError", "TypeError"]);
    await context.close();
    await moves(main);
    assert.equal(await main.getAttribute("body", "data-stopped"), "false");
  },

  async "it connects again when the emulator has started anew"(page) {
    assert.equal(await page.innerText("#experiment"), "to and fro");
    await ask("end");
    await until("the banner", async () => (await page.innerText("#banner")) !== "");
    const before = number(await page.innerText("#clock"));
    await ask("start");
    await until("no banner", async () => !(await page.locator("#banner").isVisible()));
    await moves(page);
    await until("another run's time", async () => number(await page.innerText("#clock")) < before);
    await until("its name", async () => (await page.innerText("#experiment")) === "to and fro again");
    await until("charts of it", async () => Number.isFinite(await plotted(page, "position", "drive")));
  },

  async "the look changes by its button"(page) {
    const ground = () => page.evaluate(() => getComputedStyle(document.body).backgroundColor);
    const looks = new Set();
    for (let press = 0; press < 3; press += 1) {
      looks.add(await ground());
      await page.click("#theme");
    }
    assert.equal(looks.size, 2, [...looks].join(" "));
  },
};

const page = await open(address.href);
for (const [name, run] of Object.entries(cases)) {
  const began = Date.now();
  try {
    await run(page);
  } catch (error) {
    console.error(
      `FAILED ${name}: ${error.stack}\nmessages of the page: ${await page.innerText("#messages").catch(() => "")}`,
    );
    console.error(`errors of the page: ${page.seen.errors.join("\n")}`);
    process.exit(1);
  }
  console.error(`passed: ${name} (${((Date.now() - began) / 1000).toFixed(1)} s)`);
}
assert.deepEqual(page.seen, { errors: [], foreign: [] }, "no error in the console, no request elsewhere");
assert.ok(!page.url().includes("token"), "the token stays in the address");
console.error(`passed: ${Object.keys(cases).length} cases, no error, no request elsewhere`);
await browser.close();
process.exit(0);
