// What the map draws of a place and its drones: fences, plans, drones with their names, and the grid.

import { useMemo } from "preact/hooks";
import { type Vehicle, aheadOf, idsOf, placeOf, placesOf, spotOf, type Places } from "./flight";
import type { LeasedArea, Point } from "./place";
import { LETTER, LINE, Labels, type Sight, px } from "./sight";
import type { RobotConfig, RobotStatus } from "./wire";

/** Most waypoints with their names beside them; a survey has more than can be read. */
const LABELS = 24;
/** Standard deviations of the circle around a drone that shows how well its place is known. */
const SIGMAS = 2;
/** Pixels below a drone where its name may stand; the first where it covers no other name. */
const NAME_PLACES = [-20, 26, -36, 42];
/** Pixels of the upper left corner that north's arrow needs. */
const CORNER = 55;

/** Home, the fences and no-fly zones of an environment, and the areas of leases. */
export function PlaceLayer(props: { robots: RobotConfig[]; areas: LeasedArea[]; sight: Sight }) {
  const { robots, areas, sight } = props;
  // Drones that share a fence have it drawn once.
  const fences = useMemo(() => {
    const all = robots.map(({ limits: { geofence } }) => [JSON.stringify(geofence), geofence] as const);
    return [...new Map(all)];
  }, [robots]);
  return (
    <>
      {fences.map(([key, { polygon, no_fly }]) => (
        <g key={key}>
          {polygon.length > 2 && <polygon class="fence" points={sight.line(polygon)} />}
          {no_fly.map((zone, number) => (
            <polygon key={number} class="nofly" points={sight.line(zone)} />
          ))}
        </g>
      ))}
      {areas.map(({ lease, polygon, title }) => (
        <g key={lease} class="area" data-lease={lease}>
          <polygon points={sight.line(polygon)} />
          <text {...belowTop(polygon, sight)}>{title}</text>
        </g>
      ))}
      <g class="home" transform={`translate(${sight.x(0)} ${sight.y(0)})`}>
        <circle r="9" />
        <text dy="4">H</text>
      </g>
    </>
  );
}

/** Where an area's name stands: below its upper edge. */
function belowTop(polygon: Point[], sight: Sight): { x: string; y: string } {
  const xs = polygon.map(([east]) => sight.x(east));
  const top = Math.min(...polygon.map(([, north]) => sight.y(north)));
  return { x: px((Math.min(...xs) + Math.max(...xs)) / 2), y: px(top + LINE) };
}

/** The line from a drone along the waypoints that lie ahead of it. */
function Way({ status, sight }: { status: RobotStatus; sight: Sight }) {
  const ahead = aheadOf(status);
  const way = [spotOf(status), ...ahead.map(placeOf)].filter((one) => one !== null);
  return ahead.length > 0 ? <polyline class="way" points={sight.line(way)} /> : null;
}

function Plan({ status, behind, sight }: { status: RobotStatus; behind: Places; sight: Sight }) {
  const ahead = idsOf(aheadOf(status));
  const { target, visited: reached } = status.mission;
  const known = Object.entries(placesOf({ status, behind }));
  return (
    <g>
      <Way status={status} sight={sight} />
      {known.map(([id, [east, north]]) => {
        const number = ahead.indexOf(id);
        const current = id === target?.id;
        const visited = number < 0 && reached.includes(id);
        const kind = current ? "current" : number >= 0 ? "coming" : visited ? "visited" : "dropped";
        return (
          <g
            key={id}
            class={`waypoint ${kind}`}
            data-waypoint={id}
            transform={`translate(${sight.x(east)} ${sight.y(north)})`}
          >
            <circle r={current ? 8 : 6} />
            {visited && <path d="M-3 0l2 3 4-6" />}
            {(current || known.length <= LABELS) && (
              <text x="11" dy="4">{id}</text>
            )}
          </g>
        );
      })}
    </g>
  );
}

interface DronesProps {
  vehicles: Vehicle[];
  chosen: string | null;
  /** Whether the plans of all are drawn, not only of the chosen one. */
  plans: boolean;
  sight: Sight;
}

/** Drones with their trails and plans. */
export function Drones({ vehicles, chosen, plans, sight }: DronesProps) {
  const named = namePlaces(vehicles, chosen, sight);
  return (
    <>
      {vehicles.map((one) => {
        const { id, status, behind, trail, tone } = one;
        return (
          <g key={id} class={`robot ${tone}`}>
            <polyline class="trail" points={sight.line(trail)} />
            {status &&
              (plans || id === chosen ? (
                <Plan status={status} behind={behind} sight={sight} />
              ) : (
                <Way status={status} sight={sight} />
              ))}
            <Drone vehicle={one} chosen={id === chosen} name={named.get(id)} sight={sight} />
          </g>
        );
      })}
    </>
  );
}

/** A drone's name, with its height in flight. */
function nameOf({ id, status, position }: Vehicle): [name: string, height: string] {
  return [id, status && position ? ` ${position[2].toFixed(1)} m` : ""];
}

/** Pixels right of a drone and below it. */
type Shift = [dx: number, dy: number];

/** Where the drones' names stand; the chosen one's first, then those in flight. */
function namePlaces(vehicles: Vehicle[], chosen: string | null, sight: Sight): Map<string, Shift> {
  const rank = ({ id, status }: Vehicle) => (id === chosen ? 0 : status ? 1 : 2);
  const labels = new Labels();
  const found = new Map<string, Shift>();
  for (const one of [...vehicles].sort((first, second) => rank(first) - rank(second))) {
    if (!one.position) continue;
    const [east, north] = one.position;
    const half = (LETTER * nameOf(one).join("").length) / 2;
    const [x, y, { width }] = [sight.x(east), sight.y(north), sight.size];
    // A name is not cut off by the map's edge.
    const dx = x < 0 || x > width ? 0 : Math.max(half - x, Math.min(0, width - half - x));
    const free = NAME_PLACES.find((dy) => labels.add(x + dx, y + dy, half));
    found.set(one.id, [dx, free ?? (NAME_PLACES[0] as number)]);
  }
  return found;
}

interface DroneProps {
  vehicle: Vehicle;
  chosen: boolean;
  name: Shift | undefined;
  sight: Sight;
}

function Drone({ vehicle, chosen, name, sight }: DroneProps) {
  const { id, status, position, stale } = vehicle;
  if (!position) return null;
  const [east, north] = position;
  const turn = 90 - ((status?.vehicle?.odometry.yaw ?? Math.PI / 2) * 180) / Math.PI;
  const { x: ve, y: vn } = status?.vehicle?.odometry.velocity ?? {};
  const unsure = SIGMAS * (status?.vehicle?.gps?.horizontal_sigma ?? 0) * sight.view.scale;
  const [text, height] = nameOf(vehicle);
  return (
    <>
      <g
        class={`drone ${chosen ? "chosen" : ""} ${stale ? "stale" : ""}`}
        transform={`translate(${sight.x(east)} ${sight.y(north)})`}
        data-drone={id}
      >
        {unsure > 0 && <ellipse class="unsure" rx={px(unsure)} ry={px(unsure)} />}
        {ve != null && vn != null && (
          <path class="speed" d={`M0 0l${ve * 14} ${-vn * 14}`} />
        )}
        <path class="body" d="M0-14L9 10L0 5L-9 10Z" transform={`rotate(${turn})`} />
        <text x={name?.[0]} y={name?.[1]}>
          {text}
          {height && <tspan class="small">{height}</tspan>}
        </text>
      </g>
    </>
  );
}

/** Multiples of the grid's step in sight: metres east, and metres north. */
function gridOf({ size, view }: Sight): [east: number[], north: number[]] {
  const step = niceStep(70 / view.scale);
  const between = (middle: number, pixels: number) => {
    const half = pixels / 2 / view.scale;
    const [from, to] = [Math.ceil((middle - half) / step), Math.floor((middle + half) / step)];
    return Array.from({ length: Math.max(0, to - from + 1) }, (_, place) => (from + place) * step);
  };
  return [between(view.east, size.width), between(view.north, size.height)];
}

export function Grid({ sight }: { sight: Sight }) {
  const [easts, norths] = gridOf(sight);
  const { width, height } = sight.size;
  const kind = (value: number) => (value === 0 ? "axis" : "grid");
  return (
    <g>
      {easts.map((east) => (
        <path key={`e${east}`} class={kind(east)} d={`M${px(sight.x(east))} 0V${height}`} />
      ))}
      {norths.map((north) => (
        <path key={`n${north}`} class={kind(north)} d={`M0 ${px(sight.y(north))}H${width}`} />
      ))}
    </g>
  );
}

/** Numbers of the grid at the lower and the left edge, above the scenery; north's arrow has the corner. */
export function Coordinates({ sight }: { sight: Sight }) {
  const [easts, norths] = gridOf(sight);
  return (
    <g>
      {easts.map((east) => (
        <text key={`e${east}`} class="coordinate" x={px(sight.x(east) + 3)} y={sight.size.height - 5}>
          {label(east)}
        </text>
      ))}
      {norths
        .filter((north) => sight.y(north) > CORNER)
        .map((north) => (
          <text key={`n${north}`} class="coordinate" x="4" y={px(sight.y(north) - 3)}>
            {label(north)}
          </text>
        ))}
    </g>
  );
}

export function Scale({ scale }: { scale: number }) {
  const length = niceStep(60 / scale);
  return (
    <svg class="scale" width={length * scale + 4} height="24" aria-hidden="true">
      <text x={(length * scale) / 2 + 2} y="11">{label(length)} m</text>
      <path d={`M2 14v7h${length * scale}v-7`} />
    </svg>
  );
}

function label(value: number): string {
  return String(Number(value.toFixed(2)));
}

/** A round step of an axis that is not shorter. */
export function niceStep(least: number): number {
  const power = 10 ** Math.floor(Math.log10(least));
  return ([1, 2, 5, 10].find((one) => one * power >= least) ?? 10) * power;
}

