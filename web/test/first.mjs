// The time until a first use: from `hapt live` on the command line to the wheel that turns in an open browser, in s. For
// `cargo xtask release minutes`.
import { launch, open, quit, serve } from "./desk.mjs";

await launch();
const begin = performance.now();
const server = await serve();
try {
  const { quiet } = await open(server.url);
  quiet();
  console.log(((performance.now() - begin) / 1000).toFixed(2));
} finally {
  await quit();
  await server.end();
}
