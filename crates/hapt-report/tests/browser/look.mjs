// Opens pages from disk in a real browser, wide and narrow, light and dark, and reports their faults.
//
//   node look.mjs BROWSER SCREENSHOTS PAGE.html...
//
// One line of JSON per fault; exit code 1 when there is any. A page with a fault leaves a screenshot, with HAPT_SCREENSHOTS set every page does.
import { chromium } from "playwright-core";
import { basename, join } from "node:path";
import { pathToFileURL } from "node:url";

const [browserPath, screenshots, ...pages] = process.argv.slice(2);
const views = [
  { name: "wide-light", width: 1280, height: 900, colorScheme: "light" },
  { name: "wide-dark", width: 1280, height: 900, colorScheme: "dark" },
  { name: "narrow-light", width: 390, height: 844, colorScheme: "light" },
  { name: "narrow-dark", width: 390, height: 844, colorScheme: "dark" },
  // Print with dark colours selected: white paper, A4 less its margins.
  { name: "print", width: 718, height: 1000, colorScheme: "dark", media: "print" },
];

// In the page: everything that is cut off, overlaps other text, or is unreadable.
function faults() {
  const found = [];
  const root = document.documentElement;
  if (root.scrollWidth > window.innerWidth) found.push(`the page is ${root.scrollWidth} px wide in ${window.innerWidth}`);
  const seen = (element) => element.checkVisibility() && element.getBoundingClientRect().width > 0;
  for (const element of document.body.querySelectorAll("*:not(svg *)")) {
    if (!seen(element) || element.closest(".scroll")) continue;
    const box = element.getBoundingClientRect();
    if (box.right > window.innerWidth + 0.5 || box.left < -0.5) {
      found.push(`<${element.localName}> reaches ${Math.round(box.right)} px: ${element.textContent.slice(0, 60)}`);
    }
    const hides = element.scrollWidth > element.clientWidth + 1 && getComputedStyle(element).display !== "inline";
    if (hides && element.localName !== "svg") found.push(`<${element.localName}> overflows: ${element.textContent.slice(0, 60)}`);
  }
  for (const svg of document.querySelectorAll("svg[role=img]")) {
    if (!svg.getAttribute("aria-label")) found.push("a figure without alternative text");
    if (!seen(svg)) continue;
    const frame = svg.getBoundingClientRect();
    const texts = [...svg.querySelectorAll("text")].map((text) => [text.textContent, text.getBoundingClientRect(), text]);
    for (const [i, [content, box, text]] of texts.entries()) {
      const out = Math.max(frame.left - box.left, box.right - frame.right, frame.top - box.top, box.bottom - frame.bottom);
      if (out > 1) found.push(`"${content}" leaves its figure by ${out.toFixed(1)} px`);
      const size = parseFloat(getComputedStyle(text).fontSize) * (frame.width / svg.viewBox.baseVal.width);
      // Paper cannot scroll: a chain of many bodies is drawn small there.
      const shrinks = svg.closest(".scroll") && matchMedia("print").matches;
      if (size < 8.5 && !shrinks) found.push(`"${content}" is only ${size.toFixed(1)} px high`);
      for (const [other, its] of texts.slice(i + 1)) {
        const wide = Math.min(box.right, its.right) - Math.max(box.left, its.left);
        const tall = Math.min(box.bottom, its.bottom) - Math.max(box.top, its.top);
        if (wide > 1 && tall > 4) found.push(`"${content}" lies on "${other}"`);
      }
    }
  }
  // The contrast of text and background: WCAG's 4.5, by the computed colours.
  const channels = (colour) => colour.match(/[\d.]+/g).map(Number);
  const light = (colour) => {
    const linear = (c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
    const [r, g, b] = channels(colour).map((c) => linear(c / 255));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const paper = getComputedStyle(document.body).backgroundColor;
  const contrast = (colour) => {
    const [a, b] = [light(colour), light(paper)].sort((a, b) => b - a);
    return (a + 0.05) / (b + 0.05);
  };
  const said = [...document.querySelectorAll("svg text, p, td, dt, dd, h1, h2, a, b")].filter(seen);
  const colours = new Set(said.map((e) => getComputedStyle(e)[e.closest("svg") ? "fill" : "color"]));
  for (const colour of colours) {
    if (contrast(colour) < 4.5) found.push(`${colour} on ${paper} has a contrast of ${contrast(colour).toFixed(1)}`);
  }
  for (const figure of document.querySelectorAll("figure")) {
    if (![...figure.querySelectorAll("svg")].some(seen)) found.push(`nothing is seen of ${figure.textContent.slice(0, 40)}`);
  }
  return found;
}

const args = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update", "--disable-sync"];
const browser = await chromium.launch({ executablePath: browserPath, args });
let bad = 0;
for (const path of pages) {
  const context = await browser.newContext({ offline: true });
  const page = await context.newPage();
  let view = "loaded";
  const say = (fault) => {
    bad += 1;
    console.log(JSON.stringify({ page: basename(path), view, fault }));
  };
  page.on("console", (message) => {
    if (["error", "warning"].includes(message.type())) say(`console: ${message.text()}`);
  });
  page.on("pageerror", (error) => say(`error: ${error.message}`));
  page.on("request", (request) => {
    if (request.url() !== pathToFileURL(path).href) say(`asks for ${request.url()}`);
  });
  // Loaded once: a page without a script is laid out anew for each view, without state from the last one.
  await page.goto(pathToFileURL(path).href);
  if (await page.locator("script").count()) say("has a script");
  for (const { name, width, height, colorScheme, media = "screen" } of views) {
    view = name;
    await page.setViewportSize({ width, height });
    await page.emulateMedia({ media, colorScheme });
    const found = await page.evaluate(faults);
    found.forEach(say);
    if (found.length > 0 || process.env.HAPT_SCREENSHOTS) {
      await page.screenshot({ path: join(screenshots, `${basename(path, ".html")}-${name}.png`), fullPage: true });
    }
  }
  await context.close();
}
await browser.close();
process.exitCode = bad ? 1 : 0;
