// On a phone the page shows one part at a time, chosen by these buttons; a wide page shows all parts and no buttons.

import { button } from "./dom.ts";

const TABS = { wheel: "Wheel", signals: "Signals", verdict: "Verdict", settings: "Settings" } as const;

type Tab = keyof typeof TABS;

/** Fills `nav`; what comes back turns to a tab. */
export function tabs(nav: HTMLElement): (tab: Tab) => void {
  const turn = (tab: Tab) => {
    document.body.dataset["tab"] = tab;
    for (const [name, choice] of choices) choice.setAttribute("aria-pressed", String(name === tab));
    scrollTo(0, 0);
  };
  const choices = (Object.keys(TABS) as Tab[]).map((name) => [name, button(TABS[name], () => turn(name))] as const);
  nav.append(...choices.map(([, choice]) => choice));
  turn("wheel");
  return turn;
}
