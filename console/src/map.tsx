// The map: a metric grid in the environment's local frame, north up, drawn as SVG.

import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { type Flight, aheadOf } from "./flight";
import type { LeasedArea, Place, Point } from "./place";
import { type Drawn, SurveyLayer } from "./survey_map";
import { TrafficLayer, heightOf, headingOf, trafficOf } from "./traffic";
import type { StatusOut } from "./wire";
import "./map.css";

interface View {
  east: number;
  north: number;
  /** Pixels a metre. */
  scale: number;
}

export interface MapProps {
  flight: Flight;
  place: Place;
  areas: LeasedArea[];
  robot: string;
  mayFly: boolean;
  marked: Point | null;
  onMark(point: Point): void;
  /** The survey that is being drawn; a click is a corner then. */
  drawn: Drawn | null;
  onDraw(): void;
}

const ZOOM = 1.25;
/** Most waypoints with their names beside them; a survey has more than can be read. */
const LABELS = 24;

export function FlightMap(props: MapProps) {
  const box = useRef<HTMLDivElement>(null);
  const [size, setSize] = useState({ width: 600, height: 400 });
  const [view, setView] = useState<View | null>(null);
  const [follow, setFollow] = useState(false);
  const drag = useRef<{ x: number; y: number; moved: boolean } | null>(null);

  useEffect(() => {
    const element = box.current;
    if (!element) return;
    const watch = new ResizeObserver(([entry]) => {
      if (entry) setSize({ width: entry.contentRect.width, height: entry.contentRect.height });
    });
    watch.observe(element);
    return () => watch.disconnect();
  }, []);

  const whole = useMemo(() => fit(props, size), [size, props.place, planKey(props.flight)]);
  const position = props.flight.status(props.robot)?.position;
  let shown = view ?? whole;
  if (follow && position?.[0] != null && position[1] != null) {
    shown = { ...shown, east: position[0], north: position[1] };
  }
  const x = (east: number) => size.width / 2 + (east - shown.east) * shown.scale;
  const y = (north: number) => size.height / 2 - (north - shown.north) * shown.scale;
  const metres = (px: number, py: number): Point => [
    shown.east + (px - size.width / 2) / shown.scale,
    shown.north - (py - size.height / 2) / shown.scale,
  ];
  const line = (points: readonly Point[]) =>
    points.map(([east, north]) => `${x(east).toFixed(1)},${y(north).toFixed(1)}`).join(" ");
  const zoom = (factor: number) => {
    const scale = Math.min(400, Math.max(0.05, shown.scale * factor));
    setView({ ...shown, scale });
  };
  const pan = (dx: number, dy: number) => {
    setFollow(false);
    setView({ ...shown, east: shown.east - dx / shown.scale, north: shown.north + dy / shown.scale });
  };

  const own = props.flight.status(props.robot)?.position?.[2] ?? null;
  const traffic = trafficOf(props.flight.mission.status, props.robot);

  const keys: Record<string, () => void> = {
    "+": () => zoom(ZOOM),
    "=": () => zoom(ZOOM),
    "-": () => zoom(1 / ZOOM),
    "0": () => (setFollow(false), setView(null)),
    f: () => setFollow(!follow),
    ArrowLeft: () => pan(40, 0),
    ArrowRight: () => pan(-40, 0),
    ArrowUp: () => pan(0, 40),
    ArrowDown: () => pan(0, -40),
    Enter: () => props.mayFly && place([shown.east, shown.north]),
  };
  const drawing = props.drawn;
  if (drawing) {
    keys["Backspace"] = () => drawing.undo();
    keys["Escape"] = () => drawing.cancel();
  }
  const place = (point: Point) => (drawing ? drawing.add(point) : props.onMark(point));

  return (
    <section class="card map" aria-label="Map">
      <div
        class="mapbox"
        ref={box}
        tabIndex={0}
        role="application"
        aria-label="Map of the flight. Arrow keys move it, plus and minus zoom, 0 shows all, F follows the drone, Enter sets a waypoint, or a corner of the survey that is drawn, at the cross."
        data-testid="map"
        data-scale={shown.scale}
        data-east={shown.east}
        data-north={shown.north}
        onKeyDown={(event) => {
          const act = keys[event.key];
          if (act) {
            event.preventDefault();
            act();
          }
        }}
        onWheel={(event) => {
          event.preventDefault();
          zoom(event.deltaY < 0 ? ZOOM : 1 / ZOOM);
        }}
        onPointerDown={(event) => {
          drag.current = { x: event.clientX, y: event.clientY, moved: false };
          event.currentTarget.setPointerCapture(event.pointerId);
        }}
        onPointerMove={(event) => {
          const from = drag.current;
          if (!from) return;
          const [dx, dy] = [event.clientX - from.x, event.clientY - from.y];
          if (!from.moved && Math.hypot(dx, dy) < 5) return;
          pan(dx, dy);
          drag.current = { x: event.clientX, y: event.clientY, moved: true };
        }}
        onPointerUp={(event) => {
          const from = drag.current;
          drag.current = null;
          if (!from || from.moved || !props.mayFly) return;
          const at = event.currentTarget.getBoundingClientRect();
          place(metres(event.clientX - at.left, event.clientY - at.top));
        }}
      >
        <svg width={size.width} height={size.height} aria-hidden="true">
          <Grid size={size} view={shown} x={x} y={y} />
          {props.place.fences.map((fence) => (
            <g key={fence.robot}>
              {fence.polygon.length > 2 && <polygon class="fence" points={line(fence.polygon)} />}
              {fence.noFly.map((zone, number) => (
                <polygon key={number} class="nofly" points={line(zone)} />
              ))}
            </g>
          ))}
          {props.areas.map(({ lease, polygon, title }) => (
            <g key={lease} class="area" data-lease={lease}>
              <polygon points={line(polygon)} />
              <text {...middle(polygon, x, y)}>{title}</text>
            </g>
          ))}
          <g class="home" transform={`translate(${x(0)} ${y(0)})`}>
            <circle r="9" />
            <text dy="4">H</text>
          </g>
          {props.flight.mission.robots.map((robot, number) => {
            const status = props.flight.status(robot);
            if (!status) return null;
            return (
              <g key={robot} class={`robot r${number % 6}`}>
                <polyline class="trail" points={line(props.flight.trails.get(robot) ?? [])} />
                <Plan status={status} x={x} y={y} line={line} />
                <Drone
                  name={robot}
                  status={status}
                  x={x}
                  y={y}
                  chosen={robot === props.robot}
                  stale={props.flight.stale}
                />
              </g>
            );
          })}
          <TrafficLayer traffic={traffic} own={own} stale={props.flight.stale} x={x} y={y} />
          {drawing && (
            <SurveyLayer drawn={drawing} x={x} y={y} line={line} metres={metres} box={box} />
          )}
          {props.marked && (
            <g class="marked" transform={`translate(${x(props.marked[0])} ${y(props.marked[1])})`}>
              <circle r="10" />
              <path d="M-15 0H15M0-15V15" />
            </g>
          )}
          <path class="cross" d={`M${size.width / 2 - 6} ${size.height / 2}h12m-6-6v12`} />
        </svg>
        <Scale scale={shown.scale} />
        <div class="north" aria-hidden="true">
          N
        </div>
      </div>
      <div class="mapkeys">
        {props.mayFly && (
          <button
            type="button"
            class="draw"
            title="Draw an area to survey"
            aria-pressed={drawing !== null}
            onClick={drawing ? drawing.cancel : props.onDraw}
          >
            Survey
          </button>
        )}
        <button type="button" title="Zoom in (+)" aria-label="Zoom in" onClick={() => zoom(ZOOM)}>
          +
        </button>
        <button
          type="button"
          title="Zoom out (-)"
          aria-label="Zoom out"
          onClick={() => zoom(1 / ZOOM)}
        >
          −
        </button>
        <button
          type="button"
          title="Show all (0)"
          onClick={() => {
            setFollow(false);
            setView(null);
          }}
        >
          All
        </button>
        <button
          type="button"
          title="Follow the drone (F)"
          aria-pressed={follow}
          onClick={() => setFollow(!follow)}
        >
          Follow
        </button>
      </div>
      <ul class="legend" aria-label="Legend">
        <li class="visited">visited</li>
        <li class="current">current</li>
        <li class="coming">coming</li>
        <li class="fenced">fence</li>
        <li class="forbidden">no-fly</li>
        {traffic.length > 0 && (
          <li class="aircraft">
            aircraft
            <span class="unseen">
              :{" "}
              {traffic
                .map((one) => `${one.callsign} ${heightOf(one, own)}, ${headingOf(one)}`)
                .join("; ")}
            </span>
          </li>
        )}
        {props.areas.length > 0 && (
          <li class="leased">
            lease<span class="unseen">: {props.areas.map((one) => one.title).join("; ")}</span>
          </li>
        )}
      </ul>
    </section>
  );
}

export interface Frame {
  x(east: number): number;
  y(north: number): number;
}

function Plan({ status, x, y, line }: Frame & { status: StatusOut; line(p: Point[]): string }) {
  const ahead = aheadOf(status);
  const known = Object.entries(status.places);
  const way: Point[] = [];
  if (status.position?.[0] != null && status.position[1] != null) {
    way.push([status.position[0], status.position[1]]);
  }
  for (const id of ahead) {
    const place = status.places[id];
    if (place) way.push([place[0], place[1]]);
  }
  return (
    <g>
      {ahead.length > 0 && <polyline class="way" points={line(way)} />}
      {known.map(([id, [east, north]]) => {
        const number = ahead.indexOf(id);
        const current = id === status.target;
        const visited = number < 0 && status.visited.includes(id);
        const kind = current ? "current" : number >= 0 ? "coming" : visited ? "visited" : "dropped";
        return (
          <g
            key={id}
            class={`waypoint ${kind}`}
            data-waypoint={id}
            transform={`translate(${x(east)} ${y(north)})`}
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

function Drone(props: Frame & { name: string; status: StatusOut; chosen: boolean; stale: boolean }) {
  const [east, north, up] = props.status.position ?? [];
  if (east == null || north == null) return null;
  const turn = 90 - ((props.status.yaw ?? Math.PI / 2) * 180) / Math.PI;
  const [ve, vn] = props.status.velocity ?? [];
  return (
    <g
      class={`drone ${props.chosen ? "chosen" : ""} ${props.stale ? "stale" : ""}`}
      transform={`translate(${props.x(east)} ${props.y(north)})`}
      data-drone={props.name}
    >
      {ve != null && vn != null && <path class="speed" d={`M0 0l${ve * 14} ${-vn * 14}`} />}
      <path class="body" d="M0-14L9 10L0 5L-9 10Z" transform={`rotate(${turn})`} />
      <text y="-20">
        {props.name}
        {up != null && <tspan class="small"> {up.toFixed(1)} m</tspan>}
      </text>
    </g>
  );
}

function Grid(props: Frame & { size: { width: number; height: number }; view: View }) {
  const step = niceStep(70 / props.view.scale);
  const lines = [];
  const half = props.size.width / 2 / props.view.scale;
  const high = props.size.height / 2 / props.view.scale;
  const from = Math.ceil((props.view.east - half) / step);
  const to = Math.floor((props.view.east + half) / step);
  for (let n = from; n <= to; n += 1) {
    const at = props.x(n * step);
    lines.push(
      <g key={`e${n}`}>
        <path class={n === 0 ? "axis" : "grid"} d={`M${at} 0V${props.size.height}`} />
        <text class="coordinate" x={at + 3} y={props.size.height - 5}>
          {label(n * step)}
        </text>
      </g>,
    );
  }
  const low = Math.ceil((props.view.north - high) / step);
  const top = Math.floor((props.view.north + high) / step);
  for (let n = low; n <= top; n += 1) {
    const at = props.y(n * step);
    lines.push(
      <g key={`n${n}`}>
        <path class={n === 0 ? "axis" : "grid"} d={`M0 ${at}H${props.size.width}`} />
        <text class="coordinate" x="4" y={at - 3}>
          {label(n * step)}
        </text>
      </g>,
    );
  }
  return <g>{lines}</g>;
}

function Scale({ scale }: { scale: number }) {
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

/** Where an area's name stands: amid its corners. */
function middle(polygon: Point[], x: Frame["x"], y: Frame["y"]): { x: number; y: number } {
  const mean = (of: (point: Point) => number) =>
    polygon.reduce((sum, point) => sum + of(point), 0) / polygon.length;
  return { x: x(mean(([east]) => east)), y: y(mean(([, north]) => north)) };
}

function planKey(flight: Flight): string {
  return Object.values(flight.mission.status)
    .map((status) => Object.keys(status.places).length)
    .join();
}

/** The view that shows home, starts, waypoints and the fences that are not far beyond them. */
function fit({ flight, place }: MapProps, size: { width: number; height: number }): View {
  const points: Point[] = [[0, 0], ...place.starts];
  for (const status of Object.values(flight.mission.status)) {
    for (const [east, north] of Object.values(status.places)) points.push([east, north]);
  }
  for (const fence of place.fences) points.push(...fence.polygon);
  const easts = points.map(([east]) => east);
  const norths = points.map(([, north]) => north);
  const [left, right] = [Math.min(...easts), Math.max(...easts)];
  const [bottom, top] = [Math.min(...norths), Math.max(...norths)];
  const wide = Math.max(right - left, 10);
  const high = Math.max(top - bottom, 10);
  const scale = 0.86 * Math.min(size.width / wide, size.height / high);
  return { east: (left + right) / 2, north: (bottom + top) / 2, scale: Math.max(scale, 0.05) };
}
