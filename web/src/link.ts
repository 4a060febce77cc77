// The websocket: sends the hello, keeps the hand alive, and reconnects by itself after growing pauses.

import { decode, VERSION, type Frame, type Message, type ToServer } from "./protocol.ts";

/** A motor's torque is off 0.3 s after the last message, its fade of 0.1 s included: three of these may be late. */
const ALIVE_MS = 50;
const FIRST_PAUSE_MS = 250;
const LONGEST_PAUSE_MS = 4000;

export interface Listener {
  message(message: Message): void;
  frame(frame: Frame): void;
  /** Up, or down with the time of the next attempt on the clock of `performance.now`. */
  connection(up: boolean, retry: number | null): void;
}

/** The connection to a loop: of a server, or in the page itself. */
export interface Peer {
  readonly up: boolean;
  /** False: there is no connection, and nothing was sent. */
  send(message: ToServer): boolean;
  /** Connects without waiting for the pause to end. */
  now(): void;
}

export class Link implements Peer {
  private socket: WebSocket | null = null;
  private pause = FIRST_PAUSE_MS;
  private timer = 0;
  private readonly listener: Listener;

  constructor(listener: Listener) {
    this.listener = listener;
    setInterval(() => this.send({ type: "alive" }), ALIVE_MS);
    this.connect();
  }

  get up(): boolean {
    return this.socket?.readyState === WebSocket.OPEN;
  }

  send(message: ToServer): boolean {
    if (!this.up) return false;
    this.socket!.send(JSON.stringify(message));
    return true;
  }

  now(): void {
    clearTimeout(this.timer);
    this.pause = FIRST_PAUSE_MS;
    if (!this.up) this.connect();
  }

  private connect(): void {
    this.socket?.close();
    const socket = new WebSocket(new URL("ws", location.href.replace(/^http/, "ws").replace(/#.*$/, "")));
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => {
      const token = location.hash.slice(1);
      this.send({ type: "hello", v: VERSION, ...(token === "" ? {} : { token }) });
    };
    socket.onmessage = ({ data }: MessageEvent<string | ArrayBuffer>) => {
      if (this.socket !== socket) return;
      if (typeof data !== "string") {
        const frame = decode(data);
        if (frame) this.listener.frame(frame);
        return;
      }
      const message = JSON.parse(data) as Message;
      if (message.type === "hello") {
        this.pause = FIRST_PAUSE_MS;
        this.listener.connection(true, null);
      }
      this.listener.message(message);
    };
    socket.onclose = () => {
      if (this.socket !== socket) return;
      this.socket = null;
      this.listener.connection(false, performance.now() + this.pause);
      this.timer = setTimeout(() => this.connect(), this.pause);
      this.pause = Math.min(2 * this.pause, LONGEST_PAUSE_MS);
    };
  }
}
