// The page's own link as a QR code: a second player scans it.

import { encode } from "uqr";
import { attribute, html, svg } from "./dom.ts";

/** Light modules around the code, which readers need. */
const QUIET = 4;

/** The modules of a text's code, row by row, dark where true, without the quiet zone. */
export function modules(text: string): boolean[][] {
  return encode(text, { ecc: "M", border: 0 }).data;
}

/** Whether other machines reach a page at this address. */
export function isReachable({ protocol, hostname }: { protocol: string; hostname: string }): boolean {
  const own = hostname === "localhost" || hostname === "[::1]" || /^127\./.test(hostname);
  return protocol === "http:" && !own;
}

export class PhoneCard {
  private readonly root: HTMLElement;
  private readonly drawing = svg("svg", { role: "img", "aria-label": "The link to this page as a QR code" });

  constructor(root: HTMLElement) {
    this.root = root;
    root.append(this.drawing, html("p", { class: "soft" }, "The code has the token of the link: who scans it can take control."));
  }

  show(address: Location): void {
    attribute(this.root, "hidden", !isReachable(address));
    if (!isReachable(address)) return;
    const rows = modules(address.href);
    const size = rows.length + 2 * QUIET;
    const dark = rows.flatMap((row, y) => row.flatMap((is, x) => (is ? [`M${x + QUIET} ${y + QUIET}h1v1h-1z`] : [])));
    attribute(this.drawing, "viewBox", `0 0 ${size} ${size}`);
    this.drawing.replaceChildren(svg("rect", { class: "light", width: size, height: size }), svg("path", { class: "dark", d: dark.join("") }));
  }
}
