// The pictures of bench/docs/pictures: the live page at both widths, light and dark.
//
//     AIRBENCH_BROWSER=target/tools/browser AIRBENCH_PAGE=ADDRESS node tests/browser/pictures.js FOLDER
//
// beside `scripts/run --watch --seconds 120 load-step`, which prints the address.

import path from "node:path";
import { given, launch } from "./browser.js";

const VIEWS = [
  { name: "live", width: 1280, height: 1180 },
  { name: "live-narrow", width: 400, height: 1560 },
];
/** Part of the page further down, in one look. */
const BELOW = { selector: "#heart, #chains-section", name: "live-below", width: 1280, height: 1000 };
/** Rows that the charts have to hold before they are worth a picture, s. */
const FILLED_S = 11;

const [folder] = process.argv.slice(2);
if (!folder) throw new Error("name a folder");
const browser = await launch();

async function look(width, height, colorScheme, use) {
  const context = await browser.newContext({ viewport: { width, height }, colorScheme });
  const page = await context.newPage();
  await page.goto(given("AIRBENCH_PAGE"));
  await page.waitForFunction((least) => Number(document.getElementById("clock").textContent) > least, FILLED_S);
  await page.waitForSelector("#claim[data-supported]");
  await use(page);
  await context.close();
}

for (const scheme of ["light", "dark"]) {
  for (const { name, width, height } of VIEWS) {
    await look(width, height, scheme, async (page) => {
      // The carriage under way, with the load pressing.
      await page.waitForFunction(() => {
        const speed = document.querySelector("#figures [data-column=drive_velocity_m_per_s] b").textContent;
        return Number(speed) > 150;
      });
      await page.screenshot({ path: path.join(folder, `${name}-${scheme}.png`) });
    });
  }
}
await look(BELOW.width, BELOW.height, "light", async (page) => {
  await page.locator("#heart").evaluate((section) => scrollTo(0, section.offsetTop - 70));
  await page.waitForSelector(".histogram .trace[d^=M]");
  await page.screenshot({ path: path.join(folder, `${BELOW.name}.png`) });
});
await browser.close();
