// One loop: connects the link, the drawing and the visitor's inputs.

import { lateness, showBar, type Desk } from "./bar.ts";
import { Changes, described, download } from "./changes.ts";
import { attribute, button, byId, html, say } from "./dom.ts";
import { Euler } from "./euler.ts";
import { Gauge } from "./gauge.ts";
import { Hand } from "./hand.ts";
import { GameWheelCard } from "./gamewheel.ts";
import { History } from "./history.ts";
import { Knobs } from "./knobs.ts";
import { Link, type Peer } from "./link.ts";
import { Local, type Recorded } from "./local.ts";
import { NetworkCard } from "./network.ts";
import { PhoneCard } from "./phone.ts";
import { factors, panels } from "./panels.ts";
import { Plots, STEP } from "./plots.ts";
import { Poles } from "./poles.ts";
import { COLUMN, VERSION, type Frame, type Message, type World } from "./protocol.ts";
import { ScenarioStart } from "./scenario.ts";
import { Legend, Stage } from "./stage.ts";
import { stopOn } from "./stop.ts";
import { tabs } from "./tabs.ts";
import { Timing } from "./timing.ts";
import { steady, units, type Units } from "./units.ts";
import { VerdictCard } from "./verdict.ts";
import { Worlds } from "./worlds.ts";

const WINDOWS = [2, 5, 10];
/** The device with a hand that a page can move. */
const SIMULATED = "sim";
/** As the style has it. */
const NARROW = "(max-width: 760px)";
/** Between two drawings of the plots where motion is to be reduced, in ms. */
const REDUCED = 250;

/** `recorded`: what a page without a server runs. */
export function single(recorded: Recorded | undefined): void {
  const desk: Desk = { up: false, lost: false, mine: false, control: null, status: null, world: null };
  let client: number | null = null;
  let world: World | null = null;
  let shown: Units | null = null;
  let shape = "";
  let history = new History([]);
  let frame: Frame | null = null;
  let fresh = false;
  let drawn = 0;
  let retry: number | null = null;

  const stage = new Stage(byId("stage") as unknown as SVGSVGElement, byId("labels"), byId("far"));
  const legend = new Legend(byId("legend"));
  const gauge = new Gauge(byId("gauge"));
  const plots = new Plots(byId("plots"));
  const poles = new Poles(byId("poles"));
  const timing = new Timing(byId("timing"));
  const listener = { message, frame: arrived, connection };
  const link: Peer = recorded ? new Local(listener, recorded) : new Link(listener);
  const hand = new Hand(stage, link, () => worlds.press());
  const worlds = new Worlds(byId("worlds"), byId("choice"), (place) => {
    scenarioStart.cancel();
    // The new world's 0 is at the puck's present position.
    hand.release();
    link.send({ type: "enter", world: place });
  });
  const set = (key: string, value: string) => void link.send({ type: "set", key, value });
  const verdict = new VerdictCard(byId("sentences"), byId("verdict"), byId("strip"), (sets) => void link.send({ type: "sets", sets }), (key, value) => described(key, value, world?.keys.find(({ path }) => path === key)));
  const changes = new Changes(
    byId("changes"),
    byId("reset"),
    (sets) => void link.send(sets.length > 0 ? { type: "sets", sets, only: true } : { type: "reset" }),
    () => void link.send({ type: "file" }),
  );
  new PhoneCard(byId("phone")).show(location);
  const network = new NetworkCard(byId("network"), (change) => void link.send({ type: "network", ...change }));
  const gamewheel = new GameWheelCard(byId("gamewheel"), (controls) => void link.send({ type: "controls", ...controls }));
  const euler = new Euler((sets) => void link.send({ type: "sets", sets }));
  const scenarioStart = new ScenarioStart(
    () => {
      hand.release();
      link.send({ type: "restart" });
    },
    (name) => link.send({ type: "scenario", name }),
  );
  const knobs = new Knobs(byId("knobs"), { set, focus: (key) => void (desk.mine && link.send({ type: "focus", key })) });

  function message(message: Message): void {
    switch (message.type) {
      case "hello":
        client = message.client;
        if (message.v !== VERSION) fail(`The server speaks version ${message.v} of the page's protocol, and this page version ${VERSION}: reload it.`);
        return control(message.control);
      case "control":
        return control(message.control);
      case "world":
        return show(message);
      case "verdict":
        if (!world || message.generation < world.generation) return;
        verdict.show(message);
        euler.verdict(message);
        poles.show(message, world.step_s);
        return bar();
      case "range":
        if (message.generation === world?.generation) knobs.range(message);
        return;
      case "status":
        desk.status = message;
        scenarioStart.update(message.phase);
        timing.show(message);
        network.show(message.network, desk.up && desk.mine);
        gamewheel.show(message.wheel, desk.up && desk.mine && world?.device === SIMULATED);
        document.body.classList.toggle("games", message.wheel !== undefined);
        document.body.classList.toggle("unclocked", message.timing === null);
        return bar();
      case "refused":
        if (!message.key || !knobs.refused(message.key, message.message)) fail(message.message);
        return;
      case "file":
        return download(message.name, message.text);
      case "error":
        return fail(message.message);
    }
  }

  function control(holder: number | null): void {
    desk.control = holder;
    desk.mine = holder !== null && holder === client;
    if (!desk.mine) gamewheel.release();
    mayGrab();
    bar();
  }

  function connection(up: boolean, next: number | null): void {
    desk.up = up;
    desk.lost ||= !up;
    retry = next;
    if (!up) [desk.mine, desk.status] = [false, null];
    if (!up) gamewheel.release();
    mayGrab();
    document.body.classList.toggle("down", !up);
    byId("lost").hidden = up;
    countdown();
    bar();
  }

  /** The page's hand turns only a simulated device. */
  function mayGrab(): void {
    hand.allowed = desk.up && desk.mine && world?.device === SIMULATED;
  }

  function bar(): void {
    showBar(desk);
    changes.show(desk.up && desk.mine);
    worlds.allow(desk.up && desk.mine);
  }

  function countdown(): void {
    if (retry === null) return;
    const seconds = Math.max(0, Math.ceil((retry - performance.now()) / 1000));
    say(byId("countdown"), seconds > 0 ? `Trying again in ${seconds} s.` : "Trying again.");
  }

  function fail(text: string): void {
    byId("error").hidden = false;
    say(byId("error-text"), text);
  }

  function show(next: World): void {
    const before = world;
    world = next;
    shown = units(next);
    document.title = `${next.title} · hapt`;
    say(byId("title"), next.title);
    // Plots begin anew only where their signals or units do.
    const now = JSON.stringify([next.motion, next.bodies.map(({ name }) => name), next.columns.length, next.limit, shown]);
    if (now !== shape) {
      shape = now;
      plots.show(panels(next, shown));
      history = new History(factors(next, shown));
    }
    stage.show(next);
    legend.show(next);
    gauge.show(stage.strongest, next.limit !== null, shown);
    knobs.show(next);
    if (before && before.place !== next.place) hand.release();
    worlds.show(next);
    changes.world(next, performance.now());
    verdict.outdated();
    euler.world(next);
    desk.world = next;
    // Refusals shown are those of the earlier world.
    if (before && before.generation !== next.generation) byId("error").hidden = true;
    const way = next.motion === "rotary" ? "Clockwise" : "To the right";
    const grab = next.device === SIMULATED ? "Drag it and release it; on the keyboard hold an arrow key (with Shift, slowly), and H keeps holding." : `It moves as ${next.device} does.`;
    say(byId("hint"), `${grab} ${way} is positive. Couplings have the colour of their ${shown.what} on this scale.`);
    byId("restart").hidden = next.device !== SIMULATED;
    mayGrab();
    const names = (of: World | null) => of?.scenarios.map(({ name }) => name).join(" ");
    if (!before || before.device !== next.device || before.place !== next.place || names(before) !== names(next)) experiments(next);
    bar();
  }

  /** Only for a simulated device: what breaks a loop, or pushes its puck, must not reach a motor. */
  function experiments({ device, scenarios }: World): void {
    byId("experiments").hidden = byId("scenarios").hidden = device !== SIMULATED;
    const played = scenarios.map(({ name, hand: kind, duration_s }) =>
      button(name, () => (desk.status?.scenario === name ? link.send({ type: "scenario", name: null }) : scenarioStart.begin(name)), {
        "data-name": name,
        "aria-pressed": "false",
        title: `starts over, then a hand (${kind}) for ${duration_s} s; again: stop it`,
      }),
    );
    byId("scenarios").replaceChildren(...played, euler.button);
  }

  function arrived(next: Frame): void {
    frame = next;
    fresh = true;
    worlds.frame(next.generation, next.last[COLUMN.puck]!);
    if (!plots.paused && world && next.last.length === world.columns.length) history.add(next);
  }

  const reduced = matchMedia("(prefers-reduced-motion: reduce)");

  function draw(now: number): void {
    requestAnimationFrame(draw);
    hand.frame(now);
    if (retry !== null) countdown();
    if (!world || !shown || !frame || !fresh || !desk.up) return;
    fresh = false;
    stage.frame(frame, hand.intended);
    if (world.limit === null) gauge.show(stage.strongest, false, shown);
    gauge.frame(frame.last[COLUMN.output]!, shown);
    const quick = reduced.matches ? REDUCED : 0;
    if (now - drawn < quick) return;
    drawn = now;
    const { position } = shown;
    const places = [COLUMN.puck, ...world.bodies.map((_, i) => COLUMN.bodies + 2 * i)].map((column) => frame!.last[column]! * position.per);
    legend.frame(places.map((place) => `${steady(place, 90)}\u2009${position.name}`));
    attribute(stage.svg, "aria-valuenow", Math.round(places[0]!));
    attribute(stage.svg, "aria-valuetext", `${steady(places[0]!, 100)} ${position.name}${hand.intended === null ? "" : ", held"}`);
    plots.draw(history);
  }

  /** Hides what a page without a server cannot do, and explains it. */
  function serverless({ place }: Recorded): void {
    document.body.classList.add("alone");
    byId("alone").hidden = false;
    byId("alone").append(
      "hapt’s own core runs in this page, and no server. ",
      html("code", {}, place ? `hapt live ${place.command}` : "world.live()"),
      " has one: it makes a certificate of whatever you change, records, and keeps real time. ",
      ...(place ? [html("a", { href: place.report }, "The report")] : []),
    );
  }

  /** On a phone what is unusual stands below the experiments that show it, and not above the wheel. */
  function placeWarnings(): void {
    if (narrow.matches) byId("scenarios").after(byId("warnings"));
    else byId("error").before(byId("warnings"));
  }

  function press(id: string, act: () => void): void {
    byId(id).addEventListener("click", act);
  }

  for (const order of ["disarm", "clear"] as const) {
    press(order, () => {
      scenarioStart.cancel();
      link.send({ type: "order", order });
    });
  }
  // Arming sets 0 to the puck's position: a hand with another intended position would move the puck suddenly.
  press("arm", () => {
    scenarioStart.cancel();
    hand.release();
    link.send({ type: "order", order: "arm" });
  });
  press("restart", () => {
    scenarioStart.cancel();
    hand.release();
    link.send({ type: "restart" });
  });
  stopOn(byId("stop"), () => {
    scenarioStart.cancel();
    hand.release();
    link.send({ type: "order", order: "stop" });
  });
  addEventListener("keydown", (event) => {
    const onKnob = event.target === document.body || event.target === stage.svg;
    if (event.key === "Enter" && onKnob && !event.repeat) worlds.press();
  });
  press("take", () => link.send({ type: "take" }));
  press("reset", () => link.send({ type: "reset" }));
  press("record", () => link.send({ type: "record", on: byId("record").getAttribute("aria-pressed") !== "true" }));
  press("copy", () => void navigator.clipboard.writeText(byId("recording-file").textContent ?? ""));
  press("retry", () => link.now());
  press("dismiss", () => (byId("error").hidden = true));
  press("pause", () => {
    plots.paused = !plots.paused;
    byId("pause").setAttribute("aria-pressed", String(plots.paused));
    byId("views").hidden = !plots.paused;
  });
  press("zoom-in", () => plots.zoom(STEP));
  press("zoom-out", () => plots.zoom(1 / STEP));
  press("as-csv", () => world && download("signals.csv", history.csv(world.columns.map(({ name }) => name), ...plots.span), "text/csv"));
  press("as-png", () => void plots.picture().then((picture) => picture && download("signals.png", picture, "image/png")));
  // The sliders stay where they are while one is dragged, however long the verdict above them becomes.
  const card = byId("card");
  byId("knobs").addEventListener("pointerdown", () => (card.style.height = `${card.offsetHeight}px`));
  for (const end of ["pointerup", "pointercancel"]) addEventListener(end, () => (card.style.height = ""));
  for (const seconds of WINDOWS) {
    const choice = button(`${seconds} s`, () => {
      plots.seconds = seconds;
      for (const other of byId("windows").children) other.setAttribute("aria-pressed", String(other === choice));
      plots.follow();
    });
    choice.setAttribute("aria-pressed", String(seconds === plots.seconds));
    byId("windows").append(choice);
  }
  press("meet", () => {
    const { sets, settable } = lateness(desk);
    if (sets.length > 0 && settable) link.send({ type: "sets", sets });
  });
  const turnTo = tabs(byId("tabs"));
  const narrow = matchMedia(NARROW);
  narrow.addEventListener("change", placeWarnings);
  placeWarnings();
  bar();
  press("strip", () => turnTo("verdict"));
  if (recorded) serverless(recorded);
  requestAnimationFrame(draw);
}
