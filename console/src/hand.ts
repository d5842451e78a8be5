// Flying by hand: keys and sticks become velocities, sent only while somebody is there to hold them.

import type { ControlsOut, SteerIn } from "./wire";

/** Milliseconds between two velocities; the drone brakes 300 ms after the last one. */
const PERIOD = 80;
/** Milliseconds without an answer after which the page says so. */
const SILENT = 600;
/** Share of a stick's way that counts as its middle. */
const DEAD_ZONE = 0.15;

export interface Axes {
  forward: number;
  left: number;
  up: number;
  turn: number;
}

export interface Speeds {
  /** m/s. */
  level: number;
  climb: number;
  /** rad/s. */
  turn: number;
}

/** What each key does, by its place on the keyboard: whatever its letter is there. */
export const KEYS: Record<string, Partial<Axes>> = {
  KeyW: { forward: 1 },
  KeyS: { forward: -1 },
  KeyA: { left: 1 },
  KeyD: { left: -1 },
  ArrowUp: { up: 1 },
  ArrowDown: { up: -1 },
  ArrowLeft: { turn: 1 },
  ArrowRight: { turn: -1 },
};

/** Keys that are held as axes of -1 to 1. */
export function axesOfKeys(held: ReadonlySet<string>): Axes {
  const axes: Axes = { forward: 0, left: 0, up: 0, turn: 0 };
  for (const key of held) {
    const part = KEYS[key] ?? {};
    for (const name of ["forward", "left", "up", "turn"] as const) axes[name] += part[name] ?? 0;
  }
  return axes;
}

/** A gamepad's sticks in mode 2: the left climbs and turns, the right flies. */
export function axesOfPad(pad: { axes: readonly number[] } | null | undefined): Axes | null {
  const [turn = 0, down = 0, right = 0, back = 0] = (pad?.axes ?? []).map((one) =>
    Math.abs(one) < DEAD_ZONE ? 0 : one,
  );
  if (!turn && !down && !right && !back) return null;
  return { forward: -back, left: -right, up: -down, turn: -turn };
}

/** One takeover, from the click until the controls are let go or lost. */
export class Hand {
  readonly held = new Set<string>();
  taken = false;
  over = false;
  text = "";
  /** Milliseconds from a velocity to its answer. */
  lag: number | null = null;
  private answered = performance.now();
  private readonly timer: number;

  constructor(
    private readonly socket: WebSocket,
    private readonly speeds: () => Speeds,
    private readonly changed: () => void,
  ) {
    socket.onmessage = (event: MessageEvent<string>) => this.hear(event.data);
    socket.onclose = () => this.end(this.text || "the connection is lost: the drone holds");
    this.timer = setInterval(() => this.tick(), PERIOD);
    addEventListener("blur", this.leave);
    addEventListener("pagehide", this.leave);
    document.addEventListener("visibilitychange", this.leave);
  }

  /** Whether the drone's answers have stopped. */
  get silent(): boolean {
    return this.taken && performance.now() - this.answered > SILENT;
  }

  /** Let go: the drone brakes and holds. */
  release(text = ""): void {
    this.end(text);
  }

  /** Whoever looks elsewhere does not fly. */
  private readonly leave = (): void => {
    if (document.hidden || !document.hasFocus()) this.end("let go: this window was left");
  };

  private tick(): void {
    this.leave();
    // What would have to wait would be stale when it arrives.
    if (!this.taken || this.over || this.socket.bufferedAmount > 0) return;
    const pads = typeof navigator.getGamepads === "function" ? navigator.getGamepads() : [];
    const axes = pads.map(axesOfPad).find(Boolean) ?? axesOfKeys(this.held);
    const { level, climb, turn } = this.speeds();
    const command: SteerIn = {
      at: performance.now(),
      forward: axes.forward * level,
      left: axes.left * level,
      up: axes.up * climb,
      yaw_rate: axes.turn * turn,
    };
    this.socket.send(JSON.stringify(command));
    this.changed();
  }

  private hear(data: string): void {
    const answer = JSON.parse(data) as ControlsOut;
    this.answered = performance.now();
    if (!answer.held) {
      this.end(answer.text);
      return;
    }
    this.taken = true;
    if (answer.at > 0) this.lag = this.answered - answer.at;
    this.changed();
  }

  private end(text: string): void {
    if (this.over) return;
    this.over = true;
    this.taken = false;
    this.text = text;
    this.held.clear();
    clearInterval(this.timer);
    removeEventListener("blur", this.leave);
    removeEventListener("pagehide", this.leave);
    document.removeEventListener("visibilitychange", this.leave);
    this.socket.close();
    this.changed();
  }
}
