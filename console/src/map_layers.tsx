// What the map draws of a flight: its plan, its drones, and the grid below them.

import { aheadOf } from "./flight";
import type { Spot } from "./place";
import { type Sight, px } from "./sight";
import type { StatusOut } from "./wire";

/** Most waypoints with their names beside them; a survey has more than can be read. */
const LABELS = 24;
/** Standard deviations of the circle around a drone that says how well its place is known. */
const SIGMAS = 2;

/** The line from a drone along the waypoints that lie ahead of it. */
export function Way({ status, sight }: { status: StatusOut; sight: Sight }) {
  const ahead = aheadOf(status);
  const [east, north, up] = status.position ?? [];
  const way: Spot[] = east != null && north != null ? [[east, north, up ?? 0]] : [];
  for (const id of ahead) {
    const place = status.places[id];
    if (place) way.push(place);
  }
  return ahead.length > 0 ? <polyline class="way" points={sight.line(way)} /> : null;
}

export function Plan({ status, sight }: { status: StatusOut; sight: Sight }) {
  const ahead = aheadOf(status);
  const known = Object.entries(status.places);
  return (
    <g>
      <Way status={status} sight={sight} />
      {sight.tilted && known.map(([id, place]) => <Stem key={id} place={place} sight={sight} />)}
      {known.map(([id, [east, north, up]]) => {
        const number = ahead.indexOf(id);
        const current = id === status.target;
        const visited = number < 0 && status.visited.includes(id);
        const kind = current ? "current" : number >= 0 ? "coming" : visited ? "visited" : "dropped";
        return (
          <g
            key={id}
            class={`waypoint ${kind}`}
            data-waypoint={id}
            transform={`translate(${sight.x(east)} ${sight.y(north, up)})`}
          >
            <circle r={current ? 8 : 6} />
            {visited && <path d="M-3 0l2 3 4-6" />}
            {(current || known.length <= LABELS) && (
              <text x="11" dy="4">
                {id}
              </text>
            )}
          </g>
        );
      })}
    </g>
  );
}

/** From the ground to what is above it. */
function Stem({ place, sight }: { place: Spot; sight: Sight }) {
  const [east, north, up] = place;
  return <path class="stem" d={`M${px(sight.x(east))} ${px(sight.y(north))}V${px(sight.y(north, up))}`} />;
}

interface DroneProps {
  name: string;
  status: Pick<StatusOut, "position" | "velocity" | "yaw" | "position_sigma">;
  sight: Sight;
  chosen: boolean;
  stale: boolean;
  /** Whether its name stands below it: names of drones side by side would cover each other. */
  below?: boolean;
}

export function Drone({ name, status, sight, chosen, stale, below = false }: DroneProps) {
  const [east, north, up] = status.position ?? [];
  if (east == null || north == null) return null;
  const turn = 90 - ((status.yaw ?? Math.PI / 2) * 180) / Math.PI;
  const [ve, vn] = status.velocity ?? [];
  const unsure = SIGMAS * (status.position_sigma ?? 0) * sight.view.scale;
  return (
    <>
      {sight.tilted && <Stem place={[east, north, up ?? 0]} sight={sight} />}
      <g
        class={`drone ${chosen ? "chosen" : ""} ${stale ? "stale" : ""}`}
        transform={`translate(${sight.x(east)} ${sight.y(north, up ?? 0)})`}
        data-drone={name}
      >
        {unsure > 0 && <ellipse class="unsure" rx={px(unsure)} ry={px(unsure * sight.lies)} />}
        {ve != null && vn != null && (
          <path class="speed" d={`M0 0l${ve * 14} ${-vn * 14 * sight.lies}`} />
        )}
        <path
          class="body"
          d="M0-14L9 10L0 5L-9 10Z"
          transform={`scale(1 ${sight.lies}) rotate(${turn})`}
        />
        <text y={below ? 26 : -20}>
          {name}
          {up != null && <tspan class="small"> {up.toFixed(1)} m</tspan>}
        </text>
      </g>
    </>
  );
}

export function Grid({ sight }: { sight: Sight }) {
  const { size, view } = sight;
  const step = niceStep(70 / view.scale);
  const lines = [];
  const half = size.width / 2 / view.scale;
  const high = size.height / 2 / view.scale / sight.lies;
  const from = Math.ceil((view.east - half) / step);
  const to = Math.floor((view.east + half) / step);
  for (let n = from; n <= to; n += 1) {
    const at = sight.x(n * step);
    lines.push(
      <g key={`e${n}`}>
        <path class={n === 0 ? "axis" : "grid"} d={`M${at} 0V${size.height}`} />
        <text class="coordinate" x={at + 3} y={size.height - 5}>
          {label(n * step)}
        </text>
      </g>,
    );
  }
  const low = Math.ceil((view.north - high) / step);
  const top = Math.floor((view.north + high) / step);
  for (let n = low; n <= top; n += 1) {
    const at = sight.y(n * step);
    lines.push(
      <g key={`n${n}`}>
        <path class={n === 0 ? "axis" : "grid"} d={`M0 ${at}H${size.width}`} />
        <text class="coordinate" x="4" y={at - 3}>
          {label(n * step)}
        </text>
      </g>,
    );
  }
  return <g>{lines}</g>;
}

export function Scale({ scale }: { scale: number }) {
  const length = niceStep(60 / scale);
  return (
    <svg class="scale" width={length * scale + 4} height="24" aria-hidden="true">
      <text x={(length * scale) / 2 + 2} y="11">
        {label(length)} m
      </text>
      <path d={`M2 14v7h${length * scale}v-7`} />
    </svg>
  );
}

function label(value: number): string {
  return String(Number(value.toFixed(2)));
}

function niceStep(least: number): number {
  const power = 10 ** Math.floor(Math.log10(least));
  return ([1, 2, 5, 10].find((one) => one * power >= least) ?? 10) * power;
}

