// The panels beside the map: state, commands, alerts.

import { Attitude } from "./attitude";
import { type AlertLog, type Flight, type Order, speedOf } from "./flight";
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
      <Attitude status={status} />
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

/** The colour of a state. */
export function tone(status: StatusOut): string {
  if (status.state === "aborted" || status.mode === "lost") return "bad";
  return ["paused", "returning", "diverted"].includes(status.state) ? "warn" : "good";
}

/** The commands given from this page with what became of them, and all that the flight records. */
export function CommandLog(props: { flight: Flight; robot: string; mayFly: boolean }) {
  const { flight, robot, mayFly } = props;
  const { commands } = flight.log;
  if (flight.recorded && commands.length === 0) return null;
  return (
    <section class="card commandlog" aria-label="Commands">
      <header>
        <h2>Commands</h2>
        {!mayFly && !flight.recorded && <span class="badge">you may watch</span>}
      </header>
      {mayFly && !flight.over && <p class="hint">Click the map to send {robot} there.</p>}
      {!flight.recorded && (
        <ol class="orders" aria-live="polite" data-testid="orders">
          {flight.orders.map((order) => (
            <OrderLine key={order.id} order={order} />
          ))}
        </ol>
      )}
      {commands.length > 0 && (
        <details open={flight.recorded}>
          <summary>All commands of this flight: {commands.length}</summary>
          <ol class="given" data-testid="given">
            {commands.map((text, place) => (
              <li key={commands.length - place}>{text}</li>
            ))}
          </ol>
        </details>
      )}
    </section>
  );
}

export const STAGES: Record<Order["stage"], string> = {
  asked: "asking…",
  accepted: "accepted, under way",
  done: "done",
  refused: "refused",
  unconfirmed: "accepted, not seen done",
  unanswered: "no answer: look whether it is carried out",
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
    <form class="card waypointform" aria-label="New waypoint" onSubmit={send}>
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

export function Alerts(props: {
  log: AlertLog;
  recorded: boolean;
  /** Of one of them, or of all for null. */
  onAcknowledge(id: number | null): void;
}) {
  const { log, recorded, onAcknowledge } = props;
  const open = log.alerts.filter((one) => !one.acknowledged);
  return (
    <section class="card alerts" aria-label="Alerts">
      <header>
        <h2>Alerts</h2>
        <span class={`badge ${open.length ? "warn" : "good"}`} data-testid="alerts">
          {recorded
            ? `${log.alerts.length} so far`
            : open.length
              ? `${open.length} new`
              : "none new"}
        </span>
        {!recorded && <Sound log={log} />}
        {open.length > 1 && (
          <button type="button" class="plain" onClick={() => onAcknowledge(null)}>
            Acknowledge all
          </button>
        )}
      </header>
      <ul aria-live="polite">
        {log.alerts.map((one) => (
          <li key={one.id} class={one.acknowledged && !recorded ? "old" : "new"}>
            <span>
              {one.source && <span class="muted">{one.source}: </span>}
              <strong>{one.kind.replaceAll("_", " ")}</strong> {one.text}
              {one.count > 1 && <em> ×{one.count}</em>}
            </span>
            {!one.acknowledged && (
              <button
                type="button"
                class="plain"
                aria-label={`Acknowledge: ${one.text}`}
                onClick={() => onAcknowledge(one.id)}
              >
                OK
              </button>
            )}
          </li>
        ))}
        {log.alerts.length === 0 && <li class="empty">Nothing so far</li>}
      </ul>
    </section>
  );
}
