// Starts a scenario from its initial state: start over first, then play it as soon as the loop is running again.

/** A start over takes no longer than TIMEOUT; after SHORT it is done, even where a phase was too short for a status message. In ms. */
const [TIMEOUT, SHORT] = [4000, 1000];

export class ScenarioStart {
  private name: string | null = null;
  private since = 0;
  /** Whether the loop has left the phase "running" since. */
  private left = false;

  constructor(
    private readonly restart: () => void,
    private readonly play: (name: string) => void,
    private readonly now: () => number = () => performance.now(),
  ) {}

  begin(name: string): void {
    [this.name, this.since, this.left] = [name, this.now(), false];
    this.restart();
  }

  cancel(): void {
    this.name = null;
  }

  /** With each status message. A stop on the way cancels. */
  update(phase: string): void {
    if (this.name === null) return;
    const waited = this.now() - this.since;
    if (waited > TIMEOUT || (phase === "faulted" && this.left)) return this.cancel();
    if (phase !== "running") this.left ||= phase !== "faulted";
    else if (this.left || waited > SHORT) {
      this.play(this.name);
      this.cancel();
    }
  }
}
