// All stations of a network on one page without a server: a wheel each, and the links between them.

import { attribute, button, byId, html, say, svg } from "./dom.ts";
import { Hand } from "./hand.ts";
import type { Peer } from "./link.ts";
import { Program } from "./local.ts";
import { NetworkCard } from "./network.ts";
import { PHASES } from "./bar.ts";
import { COLUMN, type Frame, type Message, type NetworkChange, type Stations, type Status, type ToServer, type World } from "./protocol.ts";
import { Legend, Stage } from "./stage.ts";
import { stopOn } from "./stop.ts";
import { steady, units } from "./units.ts";

/** What `hapt report` writes for the page of a network, as `window.hapt`. */
export interface RecordedNetwork {
  /** The program, in base64. */
  core: string;
  /** The network's text, the files that it names and its stations' own certificates, as the program reads them. */
  network: unknown;
  title: string;
  /** Of the stations, in the file's order. */
  stations: string[];
  /** What the network is called on the command line, with what was set there, and the report's file; `null`: under a cell of a notebook. */
  place: { command: string; report: string } | null;
}

/** A station: its wheel, and what is said of it. */
class Station implements Peer {
  readonly up = true;
  readonly root: HTMLElement;
  status: Status | null = null;
  private world: World | null = null;
  private frame: Frame | null = null;
  private readonly phase = html("p", { class: "phase", role: "status" });
  private readonly fault = html("p", { class: "fault", role: "alert" });
  private readonly stage: Stage;
  private readonly legend: Legend;
  private readonly hand: Hand;

  constructor(
    private readonly program: Program,
    private readonly index: number,
    readonly name: string,
  ) {
    const wheel = svg("svg", { class: "wheel", tabindex: 0, role: "slider", "aria-label": `The puck of ${name}: drag it, or hold an arrow key; H holds and releases it`, "aria-valuemin": -360, "aria-valuemax": 360, "aria-valuenow": 0 });
    const [labels, far, legend] = [html("div", { class: "labels", "aria-hidden": "true" }), html("p", { class: "far soft" }), html("dl", { class: "legend" })];
    this.root = html("section", { class: "stage", "aria-label": `Station ${name}`, "data-station": name }, html("h2", {}, name), this.phase, html("div", { class: "drawing" }, wheel, labels, far), legend, this.fault);
    this.stage = new Stage(wheel, labels, far);
    this.legend = new Legend(legend);
    this.hand = new Hand(this.stage, this);
    this.hand.allowed = true;
  }

  now(): void {}

  send(message: ToServer): boolean {
    this.program.send(this.index, message);
    this.listen();
    return true;
  }

  /** Whatever moves it starts over. */
  release(): void {
    this.hand.release();
  }

  listen(): void {
    this.program.listen(this.index, (message) => this.message(message), (frame) => (this.frame = frame));
  }

  draw(now: number): void {
    this.hand.frame(now);
    if (!this.world || !this.frame) return;
    this.stage.frame(this.frame, this.hand.intended);
    const { position } = units(this.world);
    const places = [COLUMN.puck, ...this.world.bodies.map((_, i) => COLUMN.bodies + 2 * i)].map((column) => this.frame!.last[column]! * position.per);
    this.legend.frame(places.map((place) => `${steady(place, 90)}\u2009${position.name}`));
    attribute(this.stage.svg, "aria-valuenow", Math.round(places[0]!));
    attribute(this.stage.svg, "aria-valuetext", `${steady(places[0]!, 100)} ${position.name}${this.hand.intended === null ? "" : ", held"}`);
  }

  private message(message: Message): void {
    switch (message.type) {
      case "world":
        this.world = message;
        this.stage.show(message);
        return this.legend.show(message);
      case "status": {
        this.status = message;
        const { phase, code, sentence } = message;
        attribute(this.phase, "data-phase", phase);
        say(this.phase, PHASES[phase]);
        // A phase that no visitor requested has a reason.
        const why = sentence === null ? [] : [`${phase === "faulted" ? "Fault" : PHASES[phase]}${code === null ? "" : ` ${code}`}: ${sentence}`];
        const then = phase === "faulted" ? ["Start over clears it."] : why.length > 0 && phase === "disarmed" ? ["Start over arms it."] : message.warnings;
        return say(this.fault, [...why, ...then].join(" "));
      }
      case "refused":
      case "error":
        return say(this.fault, message.message);
      default:
        return;
    }
  }
}

export function wheels(recorded: RecordedNetwork): void {
  const program = new Program(recorded.core, "network", recorded.network);
  const stations = recorded.stations.map((name, index) => new Station(program, index, name));
  const all = (message: ToServer) => stations.forEach((station) => station.send(message));
  const restart = () => {
    stations.forEach((station) => station.release());
    all({ type: "restart" });
  };

  document.title = `${recorded.title} · hapt`;
  document.body.classList.add("wheels");
  say(byId("title"), recorded.title);
  byId("phase").remove();
  byId("recording").remove();
  byId("strip").remove();
  byId("tabs").remove();
  byId("banners").remove();
  const card = byId("network");
  document.querySelector(".controls")!.replaceChildren(button("Start over", restart, { id: "restart", title: "Every puck at rest at 0, every world at its start, and armed" }));
  stopOn(byId<HTMLButtonElement>("stop"), () => {
    stations.forEach((station) => station.release());
    all({ type: "order", order: "stop" });
  });
  const network = new NetworkCard(card, (change: NetworkChange) => stations[0]?.send({ type: "network", ...change }));
  const about = html("p", { id: "alone", class: "soft" });
  about.append(
    "Drag a wheel, or several with as many fingers. hapt’s own core runs every station in this page, and no server; the messages between them take the time, and are lost, as the sliders say. ",
  );
  if (recorded.place) {
    about.append(
      html("code", {}, `hapt live ${recorded.place.command}`),
      " gives each station a page of its own, on as many phones, and sets the keys of its world. ",
      html("a", { href: recorded.place.report }, "The report"),
    );
  }
  document.querySelector("main")!.replaceChildren(html("div", { class: "stations" }, ...stations.map((station) => station.root)), html("div", { class: "column" }, card, about));

  const draw = (now: number) => {
    requestAnimationFrame(draw);
    program.poll(now);
    for (const station of stations) {
      station.listen();
      station.draw(now);
    }
    network.show(together(stations), true);
  };
  requestAnimationFrame(draw);
}

/** The network with the links of all stations. */
function together(stations: Station[]): Stations | undefined {
  const network = stations[0]?.status?.network;
  if (!network) return undefined;
  const links = stations.flatMap(({ name, status }) => (status?.network?.links ?? []).map((link) => ({ ...link, from: name })));
  return { ...network, station: null, links };
}
