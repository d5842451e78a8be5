// The panels beside the map: a drone's state, and the form of a waypoint.

import { Attitude } from "./attitude";
import { type Flight, chargeOf, heightOf, speedOf, timeOf, toneOf } from "./flight";
import type { Point } from "./place";
import { Badge, Button, Card, Field, Figure, type FigureProps } from "./widgets";
import { clock, wordsOf } from "./words";
import type { RobotStatus, Waypoint } from "./wire";

/** Reasons of states for which the mission gives none. */
const REASONS: Record<string, string> = {
  idle: "waits for its first command",
  paused: "hovers until somebody resumes the mission",
};

export function StatePanel({ flight, robot }: { flight: Flight; robot: string }) {
  const status = flight.status(robot);
  if (!status) {
    return (
      <Card kind="state" label="State" title={robot}>
        <p class="empty">No state yet</p>
      </Card>
    );
  }
  const { state, faults, reason } = status.mission;
  const mode = status.vehicle?.mode ?? null;
  const link = mode === "lost" ? "lost" : flight.stale ? "stale" : "up";
  const head = (
    <Badge tone={toneOf(status)} testid="state">{wordsOf(state)}</Badge>
  );
  return (
    <Card kind={`state ${flight.stale ? "stale" : ""}`} label="State" title={robot} head={head}>
      <p class="why" data-testid="why">{reason || REASONS[state] || "follows the plan"}</p>
      <Attitude vehicle={status.vehicle} />
      <dl>
        {figuresOf(status).map((figure) => (
          <Figure key={figure.name} {...figure} />
        ))}
        <Figure name="Link" value={link} tone={link === "up" ? "good" : "bad"} />
        <Figure name="Mode" value={mode} />
        <Gps vehicle={status.vehicle} />
      </dl>
      {faults.length > 0 && (
        <ul class="faults">
          {faults.map((fault) => (
            <li key={fault}>{fault}</li>
          ))}
        </ul>
      )}
    </Card>
  );
}

function figuresOf(status: RobotStatus): FigureProps[] {
  const { outlook, waypoint_counts: [visited, known] } = status.mission;
  const battery = chargeOf(status);
  const percent = (share: number | null) => (share === null ? null : (100 * share).toFixed(0));
  const ahead: FigureProps[] = outlook
    ? [
        {
          name: "Returns at",
          value: percent(outlook.returns_at),
          unit: `%, in ${clock(outlook.hover ?? 0)}`,
          title: "Charge at which it returns home from here; how long it can hover until then",
        },
        {
          name: "Plan needs",
          value: percent(outlook.plan),
          unit: "%",
          title: "Charge that the rest of the plan, the way home and the reserve for landing need",
          // Null: more than any battery has.
          tone: battery !== null && (outlook.plan ?? Infinity) > battery ? "bad" : "",
        },
      ]
    : [];
  return [
    { name: "Height", value: heightOf(status)?.toFixed(1), unit: "m" },
    { name: "Speed", value: speedOf(status)?.toFixed(1), unit: "m/s" },
    { name: "Battery", value: percent(battery), unit: "%", bar: battery },
    ...ahead,
    { name: "Flown", value: status.mission.distance?.toFixed(0), unit: "m" },
    { name: "Waypoints", value: String(visited), unit: `of ${known}` },
    { name: "Mission time", value: timeOf(status).toFixed(0), unit: "s" },
  ];
}

/** Zeros stand for what a receiver does not tell. */
function Gps({ vehicle }: Pick<RobotStatus, "vehicle">) {
  const { satellites, horizontal_sigma: sigma } = vehicle?.gps ?? {};
  if (!satellites) return null;
  const unit = sigma ? `sat., ±${sigma.toFixed(1)} m` : "satellites";
  return <Figure name="GPS" unit={unit} value={satellites.toString()} />;
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
  const status = flight.status(robot);
  const time = status ? timeOf(status) : 0;
  const send = (event: SubmitEvent) => {
    event.preventDefault();
    const given = new FormData(event.currentTarget as HTMLFormElement);
    const number = (name: string) => Number(given.get(name));
    const within = given.get("deadline");
    const [x, y] = [number("east"), number("north")];
    const waypoint: Waypoint = {
      ...{ id: `map_${Date.now().toString(36).slice(-5)}`, waypoint_type: "local" },
      ...{ x, y, z: number("height"), hover_duration: number("hover"), priority: number("priority") },
      deadline: within ? time + Number(within) : null,
    };
    const what = `${waypoint.id}: ${x.toFixed(1)} E, ${y.toFixed(1)} N`;
    flight.fly({ robot, waypoints: [waypoint] }, what, ({ mission }) =>
      mission.visited.includes(waypoint.id) ? "visited" : null,
    );
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
      <Field name="priority" label="Priority, 1 is first" value="5" min={0} step="1" />
      <Field name="deadline" label="Arrive within, s" value="" min={1} optional="any time" />
      <div class="buttons">
        <button type="submit" class="primary">Fly there</button>
        <Button onClick={onDone}>Cancel</Button>
      </div>
    </form>
  );
}
