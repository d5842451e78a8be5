// The panels beside the map: state, commands, alerts.

import { useEffect, useState } from "preact/hooks";
import { type Flight, type Order, type Word, speedOf } from "./flight";
import type { Point } from "./place";
import { Sound } from "./sound";
import type { NavigationIn, StatusOut } from "./wire";

export function StatePanel({ flight, robot }: { flight: Flight; robot: string }) {
  const status = flight.status(robot);
  if (!status) {
    return (
      <section class="card state" aria-label="State">
        <p class="empty">{robot} has not said anything yet</p>
      </section>
    );
  }
  const height = status.position?.[2];
  const speed = speedOf(status);
  const silent = status.mode === "lost" || status.faults.length > 0;
  const outlook = status.outlook;
  const short = outlook != null && status.battery !== null && outlook.plan > status.battery;
  const link = status.mode === "lost" ? "lost" : flight.stale ? "stale" : "up";
  return (
    <section class={`card state ${flight.stale ? "stale" : ""}`} aria-label="State">
      <header>
        <h2>{robot}</h2>
        <span class={`badge ${tone(status)}`} data-testid="state">
          {status.state.replace("_", " ")}
        </span>
      </header>
      <p class="why" data-testid="why">
        {status.reason || UNSAID[status.state] || "as planned"}
      </p>
      <dl>
        <Figure name="Height" unit="m" value={height?.toFixed(1)} />
        <Figure name="Speed" unit="m/s" value={speed?.toFixed(1)} />
        <Figure
          name="Battery"
          unit="%"
          value={status.battery === null ? undefined : (100 * status.battery).toFixed(0)}
          bar={status.battery}
        />
        {outlook && (
          <>
            <Figure
              name="Returns at"
              unit={`%, in ${clock(outlook.hover)}`}
              title="Charge at which it goes home from where it is; how long it can hover until then"
              value={(100 * outlook.returns_at).toFixed(0)}
            />
            <Figure
              name="Plan needs"
              unit="%"
              title="Charge that the rest of the plan, the way home and the landing's reserve need"
              value={(100 * outlook.plan).toFixed(0)}
              tone={short ? "bad" : ""}
            />
          </>
        )}
        <Figure name="Flown" unit="m" value={status.distance.toFixed(0)} />
        <Figure
          name="Waypoints"
          unit={`of ${status.waypoints_known}`}
          value={String(status.waypoints_visited)}
        />
        <Figure name="Mission time" unit="s" value={status.time.toFixed(0)} />
        <Figure name="Link" value={link} tone={link === "up" ? "good" : "bad"} />
        <Figure name="Mode" value={status.mode ?? undefined} />
        {status.satellites != null && <Gps {...status} />}
      </dl>
      {silent && status.faults.length > 0 && (
        <ul class="faults">
          {status.faults.map((fault) => (
            <li key={fault}>{fault}</li>
          ))}
        </ul>
      )}
    </section>
  );
}

/** Why, where the mission itself sees no need to say it. */
const UNSAID: Record<string, string> = {
  idle: "nothing has been asked yet",
  paused: "hovers until it is told to resume",
};

function Gps({ satellites, position_sigma: sigma }: StatusOut) {
  const unit = sigma == null ? "satellites" : `sat., ±${sigma.toFixed(1)} m`;
  return <Figure name="GPS" unit={unit} value={satellites?.toString()} />;
}

/** Minutes and seconds. */
function clock(seconds: number): string {
  const whole = Math.round(seconds);
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}

function Figure(props: {
  name: string;
  unit?: string;
  value: string | undefined;
  bar?: number | null;
  tone?: string;
  title?: string;
}) {
  const low = props.bar != null && props.bar < 0.3;
  return (
    <div class="figure" title={props.title ?? ""}>
      <dt>{props.name}</dt>
      <dd class={props.tone ?? ""}>
        {props.value ?? "—"} {props.value !== undefined && <small>{props.unit}</small>}
        {props.bar != null && (
          <meter class={low ? "low" : ""} min={0} max={1} value={props.bar} aria-label={props.name} />
        )}
      </dd>
    </div>
  );
}

function tone(status: StatusOut): string {
  if (status.state === "aborted" || status.mode === "lost") return "bad";
  return ["paused", "returning", "diverted"].includes(status.state) ? "warn" : "good";
}

const BUTTONS: { word: Word; name: string; title: string; sure: boolean }[] = [
  { word: "pause", name: "Pause", title: "Hover until told to resume", sure: false },
  { word: "resume", name: "Resume", title: "Go on where it was paused", sure: false },
  { word: "return-home", name: "Return", title: "Fly back to take-off and land", sure: false },
  { word: "clear", name: "Stop", title: "Drop the plan and hover here", sure: true },
  { word: "land", name: "Land", title: "Land at once, where the drone is", sure: true },
];
const SURE = 4000;

export function Commands(props: { flight: Flight; robot: string; mayFly: boolean }) {
  const { flight, robot, mayFly } = props;
  const [asked, setAsked] = useState<Word | null>(null);
  useEffect(() => {
    if (asked === null) return;
    const timer = setTimeout(() => setAsked(null), SURE);
    return () => clearTimeout(timer);
  }, [asked]);
  const state = flight.status(robot)?.state;
  const senseless = (word: Word) =>
    (word === "pause" && state === "paused") || (word === "resume" && state !== "paused");
  return (
    <section class="card commands" aria-label="Commands">
      <header>
        <h2>Commands</h2>
        {!mayFly && <span class="badge">you may watch</span>}
      </header>
      <div class="buttons">
        {BUTTONS.map(({ word, name, title, sure }) => (
          <button
            key={word}
            type="button"
            class={`command ${word}`}
            title={title}
            disabled={!mayFly || flight.over || senseless(word)}
            onClick={() => {
              if (sure && asked !== word) {
                setAsked(word);
                return;
              }
              setAsked(null);
              flight.command(robot, word);
            }}
          >
            {asked === word ? `${name}: sure?` : name}
          </button>
        ))}
      </div>
      {mayFly && !flight.over && <p class="hint">Click the map to send {robot} there.</p>}
      <ol class="orders" aria-live="polite" data-testid="orders">
        {flight.orders.map((order) => (
          <OrderLine key={order.id} order={order} />
        ))}
      </ol>
    </section>
  );
}

const STAGES: Record<Order["stage"], string> = {
  asked: "asking…",
  accepted: "accepted, under way",
  done: "done",
  refused: "refused",
  unconfirmed: "accepted, not seen done",
};

function OrderLine({ order }: { order: Order }) {
  const took = order.took === null ? "" : ` after ${(order.took / 1000).toFixed(1)} s`;
  return (
    <li class={order.stage} data-stage={order.stage}>
      <strong>{order.what}</strong>{" "}
      <span>
        {STAGES[order.stage]}
        {order.text && `: ${order.text}`}
        {took}
      </span>
    </li>
  );
}

export function WaypointForm(props: {
  flight: Flight;
  robot: string;
  point: Point;
  height: number;
  ceiling: number;
  onDone(): void;
}) {
  const { flight, robot, point, onDone } = props;
  const time = flight.status(robot)?.time ?? 0;
  const send = (event: SubmitEvent) => {
    event.preventDefault();
    const given = new FormData(event.currentTarget as HTMLFormElement);
    const number = (name: string) => Number(given.get(name));
    const within = given.get("deadline");
    const navigation: NavigationIn = {
      robot,
      waypoints: [
        {
          id: `map_${Date.now().toString(36).slice(-5)}`,
          waypoint_type: "local",
          x: number("east"),
          y: number("north"),
          z: number("height"),
          hover_duration: number("hover"),
          priority: number("priority"),
          deadline: within ? time + Number(within) : null,
        },
      ],
    };
    flight.visit(navigation);
    onDone();
  };
  return (
    <form
      class="card waypointform"
      aria-label="New waypoint"
      onSubmit={send}
      onKeyDown={(event) => event.key === "Escape" && onDone()}
    >
      <h2>Send {robot} here</h2>
      <Field name="east" label="East, m" value={point[0].toFixed(1)} />
      <Field name="north" label="North, m" value={point[1].toFixed(1)} />
      <Field
        name="height"
        label="Height, m"
        value={props.height.toFixed(1)}
        min={0.5}
        max={props.ceiling}
        first
      />
      <Field name="hover" label="Hover, s" value="2" min={0} />
      <Field name="priority" label="Priority (1 first)" value="5" min={0} step="1" />
      <Field name="deadline" label="Within, s" value="" min={1} optional="any time" />
      <div class="buttons">
        <button type="submit" class="primary">
          Fly there
        </button>
        <button type="button" onClick={onDone}>
          Cancel
        </button>
      </div>
    </form>
  );
}

export function Field(props: {
  name: string;
  label: string;
  value: string;
  min?: number;
  max?: number;
  step?: string;
  /** What is meant where nothing is given. */
  optional?: string;
  first?: boolean;
  onValue?(value: string): void;
}) {
  return (
    <label>
      <span>{props.label}</span>
      <input
        name={props.name}
        type="number"
        inputMode="decimal"
        step={props.step ?? "0.1"}
        defaultValue={props.value}
        placeholder={props.optional ?? ""}
        required={props.optional === undefined}
        autoFocus={props.first ?? false}
        onInput={(event) => {
          const { validity, value } = event.currentTarget;
          if (validity.valid) props.onValue?.(value);
        }}
        {...(props.min === undefined ? {} : { min: props.min })}
        {...(props.max === undefined ? {} : { max: props.max })}
      />
    </label>
  );
}

export function Alerts({ flight }: { flight: Flight }) {
  const open = flight.alerts.filter((one) => !one.acknowledged);
  return (
    <section class="card alerts" aria-label="Alerts">
      <header>
        <h2>Alerts</h2>
        <span class={`badge ${open.length ? "warn" : "good"}`} data-testid="alerts">
          {flight.recorded
            ? `${flight.alerts.length} so far`
            : open.length
              ? `${open.length} new`
              : "none new"}
        </span>
        {!flight.recorded && <Sound flight={flight} />}
        {open.length > 1 && (
          <button type="button" class="plain" onClick={() => flight.acknowledge(null)}>
            Acknowledge all
          </button>
        )}
      </header>
      <ul aria-live="polite">
        {flight.alerts.map((one) => (
          <li key={one.id} class={one.acknowledged && !flight.recorded ? "old" : "new"}>
            <span>
              <strong>{one.kind.replaceAll("_", " ")}</strong> {one.text}
              {one.count > 1 && <em> ×{one.count}</em>}
            </span>
            {!one.acknowledged && (
              <button
                type="button"
                class="plain"
                aria-label={`Acknowledge: ${one.text}`}
                onClick={() => flight.acknowledge(one.id)}
              >
                OK
              </button>
            )}
          </li>
        ))}
        {flight.alerts.length === 0 && <li class="empty">Nothing so far</li>}
      </ul>
    </section>
  );
}
