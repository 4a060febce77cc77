// WCAG 2 contrast, of everything that is seen, in both themes: text 4.5 : 1, large text and marks 3 : 1.
import assert from "node:assert/strict";
import { after, test } from "node:test";
import { open, quit, serve, until, world } from "./desk.mjs";

after(quit);

/** Runs in the page: every visible text with too little contrast to what lies behind it. */
function faint() {
  const canvas = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
  const rgba = (colour) => {
    canvas.clearRect(0, 0, 1, 1);
    canvas.fillStyle = colour;
    canvas.fillRect(0, 0, 1, 1);
    const [r, g, b, a] = canvas.getImageData(0, 0, 1, 1).data;
    return [r, g, b, a / 255];
  };
  const linear = (c) => ((c /= 255) <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
  const luminance = ([r, g, b]) => 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
  const over = ([r, g, b, a], below) => [r, g, b].map((c, i) => c * a + below[i] * (1 - a));
  const ratio = (one, other) => {
    const [low, high] = [luminance(one), luminance(other)].sort((a, b) => a - b);
    return (high + 0.05) / (low + 0.05);
  };
  const behind = (element) => {
    const layers = [];
    for (let e = element; e; e = e.parentElement) layers.push(rgba(getComputedStyle(e).backgroundColor));
    return layers.reverse().reduce((below, layer) => over(layer, below), [255, 255, 255]);
  };
  const found = [];
  let seen = 0;
  const judge = (what, colour, ground, wanted) => {
    seen += 1;
    const got = ratio(over(rgba(colour), ground), ground);
    if (got < wanted) found.push(`${what}: ${got.toFixed(2)}, expected ${wanted}`);
  };
  for (const element of document.querySelectorAll("body *")) {
    const style = getComputedStyle(element);
    if (!element.checkVisibility({ visibilityProperty: true }) || element.closest(":disabled, noscript")) continue;
    const texts = [...element.childNodes].some((node) => node.nodeType === Node.TEXT_NODE && node.textContent.trim());
    const drawn = element instanceof SVGElement;
    const large = parseFloat(style.fontSize) >= 24 || (parseFloat(style.fontSize) >= 18.66 && Number(style.fontWeight) >= 700);
    const name = `<${element.tagName.toLowerCase()} class="${element.getAttribute("class") ?? ""}"> ${element.textContent.trim().slice(0, 40)}`;
    const field = element.matches("input:not([type=range]), select");
    if (texts || field) judge(name, drawn ? style.fill : style.color, behind(element), large ? 3 : 4.5);
    if (field) judge(`border of ${name}`, style.borderTopColor, behind(element.parentElement), 3);
    if (drawn && element.closest("#stage, .map, .histogram") && element.matches(".outline, .mark, .nub, .finger, .hub, .coupling, .held, .free, .unit, .bars")) {
      const fill = element.matches(".mark, .nub, .hub, .bars");
      judge(name, fill ? style.fill : style.stroke, behind(element.ownerSVGElement), 3);
    }
  }
  const root = getComputedStyle(document.documentElement);
  const paper = rgba(root.getPropertyValue("--paper"));
  for (let i = 0; i <= 6; i++) judge(`trace c${i}`, root.getPropertyValue(`--c${i}`), paper, 3);
  for (const mark of ["good", "bad", "even", "on", "plus", "minus"]) judge(mark, root.getPropertyValue(`--${mark}`), paper, 3);
  return { found, seen };
}

for (const colorScheme of ["light", "dark"]) {
  test(`everything stands out from what lies behind it, ${colorScheme}`, { timeout: 60_000 }, async () => {
    const server = await serve(world("two-bodies"));
    try {
      const { page, context, quiet } = await open(server.url, { colorScheme });
      const watcher = await open(server.url, { colorScheme });
      const look = async (page, state) => {
        const { found, seen } = await page.evaluate(faint);
        assert.ok(seen > 80, `${seen} things looked at`);
        assert.deepEqual(found, [], state);
      };
      await page.evaluate(() => document.querySelectorAll("details").forEach((details) => (details.open = true)));
      await look(page, "running");
      await look(watcher.page, "watching");
      await page.fill('[data-key="couplings.0.stiffness"] input[type=text]', "3 bananas");
      await page.keyboard.press("Enter");
      await page.click("#euler");
      await until(() => page.textContent("#verdict"), (text) => text === "Not certified: unstable");
      await page.click("#stop");
      await until(() => page.isVisible("#fault"), Boolean);
      await look(page, "a fault, a refusal, an unstable loop");
      quiet();
      await context.close();
      await watcher.context.close();
    } finally {
      await server.end();
    }
  });
}
