// Stop: a button that is always visible, Escape, and Space outside of text fields.

export function stopOn(button: HTMLButtonElement, stop: () => void): void {
  button.addEventListener("click", stop);
  const stops = (event: KeyboardEvent) => {
    if (event.key === "Escape") return true;
    const field = event.target;
    const types = field instanceof HTMLInputElement && field.type === "text";
    return event.key === " " && !types && !event.ctrlKey && !event.altKey && !event.metaKey;
  };
  // In the capture phase, before other handlers, so that Space presses no button and opens no list.
  const catches = (event: KeyboardEvent) => {
    if (!stops(event)) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    if (event.type === "keydown" && !event.repeat) {
      stop();
      button.classList.add("pressed");
      setTimeout(() => button.classList.remove("pressed"), 200);
    }
  };
  addEventListener("keydown", catches, { capture: true });
  addEventListener("keyup", catches, { capture: true });
}
