// How long a verdict takes: from the moment that a slider moves to the page that shows the new verdict, in ms, as a list in JSON. For
// `cargo xtask bench page`.
import { open, quit, serve } from "./desk.mjs";

const [file, key] = process.argv.slice(2);
const MOVES = 60;
/** Between two moves, in ms: remedies and ranges of the one before are shown by then. */
const REST = 700;

const server = await serve(file);
try {
  const { page } = await open(server.url);
  const times = await page.evaluate(
    async ([key, moves, rest]) => {
      const slider = document.querySelector(`[data-key="${key}"] input[type=range]`);
      const sentences = document.querySelector("#sentences");
      const wait = (ms) => new Promise((done) => setTimeout(done, ms));
      const times = [];
      for (let i = 0; i < moves; i++) {
        await wait(rest);
        const shown = new Promise((done) => {
          const observer = new MutationObserver(() => (observer.disconnect(), done(performance.now())));
          observer.observe(sentences, { childList: true });
        });
        slider.value = String(500 + (i % 2 ? 1 : -1) * (20 + i));
        const begin = performance.now();
        slider.dispatchEvent(new Event("input", { bubbles: true }));
        times.push((await shown) - begin);
      }
      return times;
    },
    [key, MOVES, REST],
  );
  console.log(JSON.stringify(times));
} finally {
  await quit();
  await server.end();
}
