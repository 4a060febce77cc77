// The plots of a report: its still figures become plots to pan, zoom, read and save.

import { download } from "./changes.ts";
import { button, html, say } from "./dom.ts";
import { Plots, STEP, type Panel } from "./plots.ts";
import { Samples } from "./samples.ts";
import { number } from "./units.ts";
import "./style/report.css";

/** What a report has of a run (crates/hapt-report/src/recorded.rs). Numbers are SI, in base64: times in double precision, the others in single. */
interface Recorded {
  /** What its files are called. */
  name: string;
  panels: Panel[];
  /** The columns' names in a run's file. */
  names: string[];
  /** What one SI unit of each column is shown as. */
  factors: number[];
  time: string;
  /** The last values of each column, then their extremes since the time before where those differ. */
  columns: ([last: string] | [last: string, low: string, high: string])[];
}

/** An axis cannot reach infinity: what has run away leaves a gap. */
const finite = (value: number) => (Number.isFinite(value) ? value : Number.NaN);

const bytes = (text: string) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;

function samples({ time, columns, factors }: Recorded): Samples {
  const shown = (text: string, factor: number) => Float64Array.from(new Float32Array(bytes(text)), (value) => finite(value * factor));
  const three = columns.flatMap((column, i) => {
    const parts = column.map((text) => shown(text, factors[i]!));
    return parts.length === 3 ? parts : [parts[0]!, parts[0]!, parts[0]!];
  });
  return new Samples(new Float64Array(bytes(time)), three, factors);
}

/** Puts the plots of a run, of each of its clocks, in the place of its still figures, which stay for paper. */
function show(run: HTMLElement): void {
  const clocks = [...run.querySelectorAll("script")].map((script) => JSON.parse(script.textContent!) as Recorded);
  run.classList.add("moves");
  for (const recorded of clocks) add(run, recorded, clocks.length > 1);
}

/** `named`: there are others. */
function add(run: HTMLElement, recorded: Recorded, named: boolean): void {
  const history = samples(recorded);
  const root = html("div", { role: "group", "aria-label": `Plots of ${recorded.name}` });
  const plots = new Plots(root, true);
  const [first, last] = history.span;
  plots.seconds = last - first;
  plots.paused = true;
  const at = html("p", { class: "soft" });
  const tell = () => {
    const time = plots.cursor;
    plots.draw(history);
    say(at, time === null ? "Drag to move; zoom with + and − or Ctrl and the wheel; a double click shows all." : `At ${number(time, 6)} s`);
  };
  const save = (ending: string, content: BlobPart, type: string) => download(`${recorded.name}.${ending}`, content, type);
  const tools = html(
    "div",
    { class: "tools", role: "group", "aria-label": "What the plots show" },
    at,
    button("−", () => plots.zoom(1 / STEP), { "aria-label": "Zoom out" }),
    button("+", () => plots.zoom(STEP), { "aria-label": "Zoom in" }),
    button("All", () => plots.follow(), { title: "The whole run" }),
    button("Save as PNG", () => void plots.picture().then((picture) => picture && save("png", picture, "image/png")), { title: "What is seen, as a picture" }),
    button("Save as CSV", () => save("csv", history.csv(recorded.names, ...plots.span), "text/csv"), { title: `What is seen, in SI, ${intervals(history)}` }),
  );
  run.append(...(named ? [html("h3", {}, recorded.name)] : []), tools, root);
  plots.show(recorded.panels);
  tell();
  for (const event of ["pointermove", "pointerleave"]) root.addEventListener(event, () => requestAnimationFrame(tell));
}

/** How fine the table is. */
function intervals(history: Samples): string {
  const [first, last] = history.span;
  const rows = history.window([], first, last)[0]!.length;
  return `a row every ${number(Math.max(0, last - first) / Math.max(1, rows - 1), 3)} s`;
}

for (const run of document.querySelectorAll<HTMLElement>(".run")) show(run);
