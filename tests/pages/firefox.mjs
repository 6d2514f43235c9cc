// The page of PmsmDrive in a Firefox, against the native run: bits of every real output, state, speed. Before a release:
//     npm install --no-save puppeteer-core && FMU_PAGES=FOLDER node tests/pages/firefox.mjs
// FOLDER is target/tmp/run-pages, after `cargo test --test page browser -- --ignored`; FIREFOX is the path of the browser.
import { strict as assert } from "node:assert";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";

const puppeteer = createRequire(join(process.cwd(), "package.json"))("puppeteer-core");
const folder = resolve(process.env.FMU_PAGES);
const expected = JSON.parse(readFileSync(join(folder, "expected.json")));
const browser = await puppeteer.launch({ browser: "firefox", executablePath: process.env.FIREFOX ?? "/usr/bin/firefox", headless: true });
const page = await browser.newPage();
page.on("pageerror", error => assert.fail(String(error)));
page.on("console", message => assert.fail(message.text()));
await page.setViewport({ width: 1400, height: 900 });
const begun = Date.now();
await page.goto(pathToFileURL(join(folder, "PmsmDrive.html")).href);
await page.waitForSelector("#run:enabled", { timeout: 10000 });
console.log(`${await browser.version()}: Run is enabled after ${Date.now() - begun} ms`);

await page.evaluate(run => { plan = { ...start(), set: new Map(run.set), events: run.events, stop: run.stop }; choose(0); begin(true); }, expected.run);
await page.waitForFunction(() => !running && !wanted && rec.n > 1, { timeout: 60000 });
const rows = await page.evaluate(names => Array.from({ length: rec.n }, (_, k) => names.map(name => {
  const view = new DataView(new ArrayBuffer(8));
  view.setFloat64(0, rec.columns.get(name)[k]);
  return view.getBigUint64(0).toString(16).padStart(16, "0");
})), expected.names);
assert.deepEqual(rows, expected.rows);
await page.click("#save");
await page.waitForFunction(() => saved !== null);
assert.equal(await page.evaluate(() => Array.from(saved.state, byte => byte.toString(16).padStart(2, "0")).join("")), expected.state);
console.log(`${rows.length} rows of ${expected.names.length} outputs and the state: the native bits; ${await page.evaluate(() => document.getElementById("speed").textContent)}`);
await page.screenshot({ path: join(folder, "PmsmDrive-firefox.png") });
await browser.close();
