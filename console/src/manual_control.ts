// Flying by hand: keys and sticks become velocities, sent only while somebody is there to hold them.

import type { ControlsOut, SteerIn } from "./wire";

/** Milliseconds between two velocities; the drone brakes 300 ms after the last one. */
const PERIOD = 80;
/** Milliseconds without an answer after which the page says so. */
const SILENT = 600;
/** Share of a stick's way that counts as its middle. */
const DEAD_ZONE = 0.15;

/** Directions of a velocity, each -1 to 1; or its speeds, m/s and rad/s. */
export type Axes = Required<Omit<SteerIn, "at">>;

const NAMES = ["forward", "left", "up", "yaw_rate"] as const;

/** What each key does, by its place on the keyboard: whatever its letter is there. */
export const KEYS: Record<string, Partial<Axes>> = {
  KeyW: { forward: 1 },
  KeyS: { forward: -1 },
  KeyA: { left: 1 },
  KeyD: { left: -1 },
  ArrowUp: { up: 1 },
  ArrowDown: { up: -1 },
  ArrowLeft: { yaw_rate: 1 },
  ArrowRight: { yaw_rate: -1 },
};

/** The axes of keys that are held. */
function axesOfKeys(held: ReadonlySet<string>): Axes {
  const axes: Axes = { forward: 0, left: 0, up: 0, yaw_rate: 0 };
  for (const key of held) for (const name of NAMES) axes[name] += KEYS[key]?.[name] ?? 0;
  return axes;
}

/** A gamepad's sticks in mode 2: the left climbs and turns, the right flies; null while all are centred. */
function axesOfPad(pad: Gamepad | null): Axes | null {
  const sticks = (pad?.axes ?? []).map((one) => (Math.abs(one) < DEAD_ZONE ? 0 : one));
  const [right = 0, down = 0, aside = 0, back = 0] = sticks;
  return sticks.some(Boolean) ? { forward: -back, left: -aside, up: -down, yaw_rate: -right } : null;
}

/** One takeover, from the click until the controls are released or lost. */
export class ManualControl {
  readonly held = new Set<string>();
  /** Whether the mission has given the controls. */
  granted = false;
  over = false;
  text = "";
  /** Milliseconds from a velocity to its answer. */
  lag: number | null = null;
  private answeredAt = performance.now();
  private readonly timer: number;
  private readonly ended = new AbortController();

  constructor(
    private readonly socket: WebSocket,
    private readonly speeds: () => Axes,
    private readonly changed: () => void,
  ) {
    socket.onmessage = (event: MessageEvent<string>) => this.onAnswer(JSON.parse(event.data) as ControlsOut);
    socket.onclose = () => this.release(this.text || "the connection is lost: the drone holds");
    this.timer = setInterval(() => this.send(), PERIOD);
    const { signal } = this.ended;
    for (const name of ["blur", "pagehide"]) addEventListener(name, this.onLeave, { signal });
    document.addEventListener("visibilitychange", this.onLeave, { signal });
  }

  /** Whether the drone's answers have stopped. */
  get silent(): boolean {
    return this.granted && performance.now() - this.answeredAt > SILENT;
  }

  /** Give the controls back: the drone brakes and holds. */
  release(text = ""): void {
    if (this.over) return;
    this.over = true;
    this.granted = false;
    this.text = text;
    this.held.clear();
    clearInterval(this.timer);
    this.ended.abort();
    this.socket.close();
    this.changed();
  }

  /** Whoever looks elsewhere does not fly. */
  private readonly onLeave = (): void => {
    if (document.hidden || !document.hasFocus()) this.release("let go: this window was left");
  };

  private send(): void {
    this.onLeave();
    // What would have to wait would be stale when it arrives.
    if (!this.granted || this.over || this.socket.bufferedAmount > 0) return;
    const pads = typeof navigator.getGamepads === "function" ? navigator.getGamepads() : [];
    const axes = pads.map(axesOfPad).find(Boolean) ?? axesOfKeys(this.held);
    const speeds = this.speeds();
    const command: SteerIn = { at: performance.now() };
    for (const name of NAMES) command[name] = axes[name] * speeds[name];
    this.socket.send(JSON.stringify(command));
    this.changed();
  }

  private onAnswer({ held, text, at }: ControlsOut): void {
    this.answeredAt = performance.now();
    if (!held) {
      this.release(text);
      return;
    }
    this.granted = true;
    if (at > 0) this.lag = this.answeredAt - at;
    this.changed();
  }
}
