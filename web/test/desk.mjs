// What every test needs: the server under test, a browser whose requests go to it only, and pointers.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { once } from "node:events";
import { createInterface } from "node:readline";
import { join } from "node:path";
import { chromium } from "playwright-core";

export const HAPT = process.env.HAPT ?? join(import.meta.dirname, "../../target/debug/hapt");
/** A wheel for games without a game: crates/hapt-live/examples/wheel_page.rs. */
export const WHEEL = process.env.WHEEL_PAGE ?? join(import.meta.dirname, "../../target/tested/examples/wheel_page");
const FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update", "--disable-sync"];

export const world = (name) => join(import.meta.dirname, "worlds", `${name}.toml`);

/** `hapt live`, and the address it prints; `more` are further options. */
export async function serve(file, port = 0, more = []) {
  const child = spawn(HAPT, ["live", ...(file ? [file] : []), "--port", String(port), ...more], { stdio: ["ignore", "pipe", "inherit"] });
  const lines = createInterface({ input: child.stdout });
  const [first] = await Promise.race([
    once(lines, "line"),
    once(child, "exit").then(([code]) => Promise.reject(new Error(`${HAPT} live ended with ${code}`))),
  ]);
  const end = async (signal = "SIGTERM") => {
    if (child.exitCode !== null || child.signalCode !== null) return;
    child.kill(signal);
    await once(child, "exit");
  };
  // A network prints its stations' names before their addresses.
  const url = first.trim().split(/ +/).at(-1);
  return { url, port: Number(new URL(url).port), end };
}

let browser;
export async function launch() {
  browser ??= await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: FLAGS });
  return browser;
}
export const quit = () => browser?.close();

/** A page on `url`, whose errors and requests are kept. `down`: the server will be away, so that failed connections are no complaint. */
export async function open(url, options = {}, { down = false } = {}) {
  const context = await (await launch()).newContext({ viewport: { width: 1280, height: 900 }, ...options });
  const page = await context.newPage();
  const complaints = [];
  const own = new URL(url).host;
  page.on("pageerror", (error) => complaints.push(error.message));
  page.on("console", (message) => {
    const away = down && /ERR_CONNECTION_REFUSED|ERR_CONNECTION_RESET|WebSocket/.test(message.text());
    if (["error", "warning"].includes(message.type()) && !away) complaints.push(message.text());
  });
  page.on("request", (request) => new URL(request.url()).host !== own && complaints.push(`asked for ${request.url()}`));
  page.on("websocket", (socket) => new URL(socket.url()).host !== own && complaints.push(`connected to ${socket.url()}`));
  await page.goto(url);
  await page.waitForSelector('.phase[data-phase="running"]');
  await page.waitForFunction(() => document.querySelector(".legend dd")?.textContent);
  return { page, context, quiet: () => assert.deepEqual(complaints, []) };
}

/** Position of the puck (0) or a body in degrees or millimetres, as the page shows it. */
export async function place(page, index = 0) {
  return number(await page.locator("#legend dd").nth(index).textContent());
}

export const number = (text) => Number(text.replace("−", "-").replace(/[^-\d.e].*$/, ""));

/** The smallest and the largest value of a reading over some seconds. */
export async function extremes(page, read, seconds) {
  const values = [];
  for (const end = Date.now() + 1000 * seconds; Date.now() < end; await page.waitForTimeout(25)) values.push(await read());
  return [Math.min(...values), Math.max(...values)];
}

/** Waits until a reading is as wanted, or fails with the last one. */
export async function until(read, wanted, seconds = 60) {
  let last;
  for (const end = Date.now() + 1000 * seconds; Date.now() < end; await new Promise((ok) => setTimeout(ok, 50))) {
    if (wanted((last = await read()))) return last;
  }
  throw new assert.AssertionError({ message: `${read} stays at ${JSON.stringify(last)}, expected ${wanted}` });
}

/** Moves the n-th slider of the network to a part of its track, as a finger does that is lifted there. */
export async function slide(page, n, part) {
  await page.locator("#network input").nth(n).evaluate((input, value) => {
    input.value = String(value);
    for (const name of ["input", "change"]) input.dispatchEvent(new Event(name));
  }, 1000 * part);
}

/** Grabs the wheel at its top and turns it by so many degrees, the button still down. */
export async function turn(page, degrees, wheel = "#stage") {
  const box = await page.locator(wheel).boundingBox();
  const [x, y, radius] = [box.x + box.width / 2, box.y + box.height / 2, box.width * 0.35];
  const at = (angle) => [x + radius * Math.sin((angle * Math.PI) / 180), y - radius * Math.cos((angle * Math.PI) / 180)];
  await page.mouse.move(...at(0));
  await page.mouse.down();
  for (let i = 1; i <= 30; i++) {
    await page.mouse.move(...at((degrees * i) / 30));
    await page.waitForTimeout(10);
  }
}

/** Turns the puck and releases it until the wheel swings by itself: its extremes in degrees, and those of the energy in the same swing. */
export async function swing(page, energy) {
  let seen = [];
  // On a slow machine a turn takes long, and the wheel comes along without a swing: then once more.
  for (const to of [60, -60, 60, -60, 60]) {
    const from = await place(page);
    await turn(page, to);
    await until(() => place(page), (puck) => Math.abs(puck - from) > 40);
    await until(() => page.getAttribute("#stage", "data-held"), (held) => held === "");
    await page.mouse.up();
    seen = await Promise.all([extremes(page, () => place(page, 1), 3), extremes(page, energy, 3)]);
    if (seen[0][1] - seen[0][0] > 5) break;
  }
  return seen;
}
