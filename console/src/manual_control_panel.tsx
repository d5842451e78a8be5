// The panel to fly by hand: who has the controls, the keys, and how fast.

import { useCallback, useEffect, useRef, useState } from "preact/hooks";
import type { Flight } from "./flight";
import { KEYS, ManualControl } from "./manual_control";
import { Badge, Button, useEscape } from "./widgets";
import type { RobotConfig } from "./wire";

const TURN = Math.PI / 4;
const PAD: { key: string; face: string; name: string }[] = [
  { key: "ArrowLeft", face: "⟲", name: "Turn left" },
  { key: "KeyW", face: "W", name: "Forward" },
  { key: "ArrowRight", face: "⟳", name: "Turn right" },
  { key: "ArrowUp", face: "▲", name: "Climb" },
  { key: "KeyA", face: "A", name: "Left" },
  { key: "KeyS", face: "S", name: "Back" },
  { key: "KeyD", face: "D", name: "Right" },
  { key: "ArrowDown", face: "▼", name: "Descend" },
];

export function ManualControlPanel(props: {
  flight: Flight;
  robot: string;
  mayFly: boolean;
  config: RobotConfig | undefined;
}) {
  const { flight, robot, mayFly } = props;
  const limits = props.config?.limits;
  const [, draw] = useState(0);
  const [control, setControl] = useState<ManualControl | null>(null);
  const fastest = limits?.max_speed ?? 5;
  const [level, setLevel] = useState(Math.min(limits?.cruise_speed ?? 1, fastest));
  const speed = useRef(level);
  speed.current = level;
  const panel = useRef<HTMLElement>(null);
  const changed = useCallback(() => draw((count) => count + 1), []);
  useEffect(() => () => control?.release(), [control, robot]);

  const status = flight.status(robot);
  const holds = control !== null && !control.over;
  useEscape(holds ? () => control.release("let go") : null);
  const others = !holds && status?.mission.pilot ? status.mission.pilot : "";
  const takeOver = () => {
    const climb = limits?.max_climb ?? 1.5;
    const speeds = () => {
      const level = speed.current;
      return { forward: level, left: level, up: Math.min(level, climb), yaw_rate: TURN };
    };
    setControl(new ManualControl(flight.controls(robot), speeds, changed));
    panel.current?.focus();
  };
  const press = (key: string) => control?.held.add(key);
  const lift = (key: string) => control?.held.delete(key);
  const [tone, text] = !holds
    ? others
      ? ["warn", `${others} has the controls`]
      : ["", "nobody has the controls"]
    : control.silent
      ? ["bad", "no answer"]
      : control.granted
        ? ["good", "you have the controls"]
        : ["warn", "asking…"];

  return (
    <section
      class="card hand"
      ref={panel}
      tabIndex={holds ? 0 : -1}
      aria-label="Fly by hand"
      data-testid="hand"
      onKeyDown={(event) => {
        if (!holds || event.ctrlKey || event.metaKey || event.altKey) return;
        if (!(event.code in KEYS) || event.target instanceof HTMLInputElement) return;
        event.preventDefault();
        press(event.code);
      }}
      onKeyUp={(event) => lift(event.code)}
      onBlur={(event) => {
        // Keys that are lifted elsewhere are not heard of here.
        const to = event.relatedTarget;
        if (!(to instanceof Node && event.currentTarget.contains(to))) control?.held.clear();
      }}
    >
      <header>
        <h2>Fly by hand</h2>
        <Badge tone={tone} testid="controls" status>{text}</Badge>
        {holds && control.lag !== null && <small>{control.lag.toFixed(0)} ms</small>}
      </header>
      {control?.over && control.text && <p class="why">{control.text}</p>}
      {holds ? (
        <>
          <p class="hint">
            Hold the keys or a gamepad's sticks. The drone hovers when you let go. Escape gives the
            controls back; Resume continues the mission.
          </p>
          <div class="pad">
            {PAD.map(({ key, face, name }) => (
              <button
                key={key}
                type="button"
                class={control.held.has(key) ? "held" : ""}
                title={name}
                aria-label={name}
                onPointerDown={(event) => {
                  event.currentTarget.setPointerCapture(event.pointerId);
                  press(key);
                }}
                onPointerUp={() => lift(key)}
                onPointerCancel={() => lift(key)}
                onLostPointerCapture={() => lift(key)}
                onContextMenu={(event) => event.preventDefault()}
              >
                {face}
                <small>{name}</small>
              </button>
            ))}
          </div>
          <label class="speed">
            <span>Speed: {level.toFixed(1)} m/s</span>
            <input
              type="range"
              min={0.1}
              max={fastest}
              step={0.1}
              value={level}
              onInput={(event) => setLevel(Number(event.currentTarget.value))}
            />
          </label>
          <Button class="release" onClick={() => control.release("let go")}>Let go</Button>
        </>
      ) : (
        <Button
          class="take"
          disabled={!mayFly || flight.over || others !== "" || !IN_THE_AIR.has(status?.mission.state ?? "")}
          onClick={takeOver}
        >
          Take over
        </Button>
      )}
    </section>
  );
}

const IN_THE_AIR = new Set(["holding", "enroute", "loitering", "following", "diverted", "paused"]);
