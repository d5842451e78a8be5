// The map: a metric grid in the environment's local frame, north up, drawn as SVG.

import type { ComponentChildren, RefObject } from "preact";
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { useEscape } from "./escape";
import type { Flight } from "./flight";
import { MarkLayer, nameOf } from "./ground";
import { Drone, Grid, Plan, Scale } from "./map_layers";
import type { LeasedArea, Place, Point } from "./place";
import { RulerLayer, measured } from "./ruler";
import { SceneryLayer } from "./scenery";
import { Sight, type Size, type View } from "./sight";
import { type Drawn, SurveyLayer } from "./survey_map";
import { useArchive } from "./tile_archive";
import { TileLayer } from "./tiles";
import { TrafficLayer, heightOf, headingOf, trafficOf } from "./traffic";
import type { SceneryOut } from "./wire";
import "./map.css";

const ZOOM = 1.25;

interface MapViewProps {
  /** What it shows and which keys it has, for who does not see it. */
  label: string;
  scenery: SceneryOut;
  token: string;
  /** The points that are in sight at first. */
  fitted: readonly Point[];
  /** Where the drone is that the view may follow; null while that is not known. */
  followed: Point | null;
  /** What a key does, beside those that move the view. */
  keys: Record<string, () => void>;
  /** A click, or Enter at the cross. */
  onPoint(point: Point, sight: Sight): void;
  buttons: ComponentChildren;
  below: ComponentChildren;
  /** What is drawn above grid and scenery. */
  children(sight: Sight, box: RefObject<HTMLDivElement | null>): ComponentChildren;
}

/** A map that is moved, zoomed and tilted, over scenery and tiles. */
export function MapView(props: MapViewProps) {
  const box = useRef<HTMLDivElement>(null);
  const [size, setSize] = useState({ width: 600, height: 400 });
  const [view, setView] = useState<View | null>(null);
  const [follow, setFollow] = useState(false);
  const [tilted, setTilted] = useState(false);
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

  const whole = useMemo(() => fit(props.fitted, size), [size, props.fitted]);
  let shown = view ?? whole;
  if (follow && props.followed) {
    shown = { ...shown, east: props.followed[0], north: props.followed[1] };
  }
  const sight = new Sight(shown, size, tilted);
  const zoom = (factor: number) => {
    const scale = Math.min(400, Math.max(0.05, shown.scale * factor));
    setView({ ...shown, scale });
  };
  const pan = (dx: number, dy: number) => {
    setFollow(false);
    setView({
      ...shown,
      east: shown.east - dx / shown.scale,
      north: shown.north + dy / shown.scale / sight.lies,
    });
  };
  const all = () => {
    setFollow(false);
    setView(null);
  };
  const map = useArchive(props.scenery.tiles, props.token);
  const keys: Record<string, () => void> = {
    "+": () => zoom(ZOOM),
    "=": () => zoom(ZOOM),
    "-": () => zoom(1 / ZOOM),
    "0": all,
    f: () => setFollow(!follow),
    t: () => setTilted(!tilted),
    ArrowLeft: () => pan(40, 0),
    ArrowRight: () => pan(-40, 0),
    ArrowUp: () => pan(0, 40),
    ArrowDown: () => pan(0, -40),
    Enter: () => props.onPoint([shown.east, shown.north], sight),
    ...props.keys,
  };

  return (
    <section class="card map" aria-label="Map">
      <div
        class="mapbox"
        ref={box}
        tabIndex={0}
        role="application"
        aria-label={props.label}
        data-testid="map"
        data-scale={shown.scale}
        data-east={shown.east}
        data-north={shown.north}
        data-tilted={tilted}
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
          if (!from || from.moved) return;
          const at = event.currentTarget.getBoundingClientRect();
          props.onPoint(sight.metres(event.clientX - at.left, event.clientY - at.top), sight);
        }}
      >
        <svg width={size.width} height={size.height} aria-hidden="true">
          {map.tiles && <TileLayer tiles={map.tiles} archive={map.archive} sight={sight} />}
          <Grid sight={sight} />
          <SceneryLayer shapes={props.scenery.shapes} sight={sight} />
          {props.children(sight, box)}
          <path class="cross" d={`M${size.width / 2 - 6} ${size.height / 2}h12m-6-6v12`} />
        </svg>
        <Scale scale={shown.scale} />
        {map.problem && (
          <p class="unmapped" role="status" data-testid="unmapped">
            {map.problem}
          </p>
        )}
        {props.scenery.tiles?.attribution && (
          <div class="attribution">{props.scenery.tiles.attribution}</div>
        )}
        <div class="north" aria-hidden="true">
          N
        </div>
      </div>
      <div class="mapkeys">
        {props.buttons}
        <button
          type="button"
          title="Look from the south, and see heights (T)"
          aria-pressed={tilted}
          onClick={() => setTilted(!tilted)}
        >
          Tilt
        </button>
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
        <button type="button" title="Show all (0)" onClick={all}>
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
      {props.below}
    </section>
  );
}

/** Home, the fences and no-fly zones of an environment, and the areas of leases. */
export function PlaceLayer(props: { place: Place; areas: LeasedArea[]; sight: Sight }) {
  const { place, areas, sight } = props;
  // Drones that share a fence have it drawn once.
  const fences = useMemo(() => {
    const shapes = place.fences.map((one) => [JSON.stringify([one.polygon, one.noFly]), one] as const);
    return [...new Map(shapes).values()];
  }, [place]);
  return (
    <>
      {fences.map((fence) => (
        <g key={fence.robot}>
          {fence.polygon.length > 2 && <polygon class="fence" points={sight.line(fence.polygon)} />}
          {fence.noFly.map((zone, number) => (
            <polygon key={number} class="nofly" points={sight.line(zone)} />
          ))}
        </g>
      ))}
      {areas.map(({ lease, polygon, title }) => (
        <g key={lease} class="area" data-lease={lease}>
          <polygon points={sight.line(polygon)} />
          <text {...middle(polygon, sight)}>{title}</text>
        </g>
      ))}
      <g class="home" transform={`translate(${sight.x(0)} ${sight.y(0)})`}>
        <circle r="9" />
        <text dy="4">H</text>
      </g>
    </>
  );
}

export interface MapProps {
  flight: Flight;
  place: Place;
  scenery: SceneryOut;
  areas: LeasedArea[];
  robot: string;
  mayFly: boolean;
  marked: Point | null;
  onMark(point: Point | null): void;
  /** The survey that is being drawn; a click is a corner then. */
  drawn: Drawn | null;
  onDraw(): void;
}

/** The map of one flight. */
export function FlightMap(props: MapProps) {
  const { flight, place, marked } = props;
  const drawing = props.drawn;
  /** The points that are measured between. */
  const [ruler, setRuler] = useState<Point[] | null>(null);
  const fitted = useMemo(() => pointsOf(props), [place, planKey(flight)]);
  const position = flight.status(props.robot)?.position;
  const own = position?.[2] ?? null;
  const marks = flight.marks.at(flight.now, flight.recorded);
  const traffic = trafficOf(flight.mission.status, props.robot);
  const measure = () => setRuler(ruler ? null : []);
  const keys: Record<string, () => void> = { m: measure };
  if (ruler) keys["Backspace"] = () => setRuler(ruler.slice(0, -1));
  else if (drawing) keys["Backspace"] = () => drawing.undo();
  const unmark = marked ? () => props.onMark(null) : null;
  useEscape(ruler ? () => setRuler(null) : drawing ? () => drawing.cancel() : unmark);
  return (
    <MapView
      label="Map of the flight. Arrow keys move it, plus and minus zoom, 0 shows all, F follows the drone, T tilts the view, M measures, Enter sets a waypoint, a corner of the survey that is drawn, or a point that is measured, at the cross."
      scenery={props.scenery}
      token={flight.token}
      fitted={fitted}
      followed={position?.[0] != null && position[1] != null ? [position[0], position[1]] : null}
      keys={keys}
      onPoint={(point) => {
        if (ruler) setRuler([...ruler, point]);
        else if (drawing) drawing.add(point);
        else if (props.mayFly) props.onMark(point);
      }}
      buttons={
        <>
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
          <button
            type="button"
            title="Measure distances (M)"
            aria-pressed={ruler !== null}
            onClick={measure}
          >
            Measure
          </button>
        </>
      }
      below={
        <>
          {ruler && (
            <p class="measured" role="status" data-testid="measured">
              {measured(ruler)}
            </p>
          )}
          <ul class="legend" aria-label="Legend">
            <li class="visited">visited</li>
            <li class="current">current</li>
            <li class="coming">coming</li>
            <li class="fenced">fence</li>
            <li class="forbidden">no-fly</li>
            {marks.length > 0 && (
              <li class="sighted">
                seen<span class="unseen">: {[...marks].reverse().map((one) => nameOf(one.what)).join(", ")}</span>
              </li>
            )}
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
        </>
      }
    >
      {(sight, box) => (
        <>
          <PlaceLayer place={place} areas={props.areas} sight={sight} />
          <MarkLayer marks={marks} now={flight.now} stale={flight.stale} sight={sight} />
          {flight.mission.robots.map((robot, number) => {
            const status = flight.status(robot);
            if (!status) return null;
            return (
              <g key={robot} class={`robot r${number % 6}`}>
                <polyline class="trail" points={sight.line(flight.trails.get(robot) ?? [])} />
                <Plan status={status} sight={sight} />
                <Drone
                  name={robot}
                  status={status}
                  sight={sight}
                  chosen={robot === props.robot}
                  stale={flight.stale}
                />
              </g>
            );
          })}
          <TrafficLayer traffic={traffic} own={own} stale={flight.stale} sight={sight} />
          {drawing && <SurveyLayer drawn={drawing} sight={sight} box={box} />}
          {ruler && <RulerLayer points={ruler} sight={sight} />}
          {marked && (
            <g class="marked" transform={`translate(${sight.x(marked[0])} ${sight.y(marked[1])})`}>
              <circle r="10" />
              <path d="M-15 0H15M0-15V15" />
            </g>
          )}
        </>
      )}
    </MapView>
  );
}

/** Where an area's name stands: amid its corners. */
function middle(polygon: Point[], sight: Sight): { x: number; y: number } {
  const mean = (of: (point: Point) => number) =>
    polygon.reduce((sum, point) => sum + of(point), 0) / polygon.length;
  return { x: sight.x(mean(([east]) => east)), y: sight.y(mean(([, north]) => north)) };
}

function planKey(flight: Flight): string {
  return Object.values(flight.mission.status)
    .map((status) => Object.keys(status.places).length)
    .join();
}

/** Home, starts, waypoints and fences. */
function pointsOf({ flight, place }: MapProps): Point[] {
  const points: Point[] = [[0, 0], ...place.starts];
  for (const status of Object.values(flight.mission.status)) {
    for (const [east, north] of Object.values(status.places)) points.push([east, north]);
  }
  for (const fence of place.fences) points.push(...fence.polygon);
  return points;
}

/** The view that shows some points. */
function fit(points: readonly Point[], size: Size): View {
  const easts = points.map(([east]) => east);
  const norths = points.map(([, north]) => north);
  const [left, right] = [Math.min(...easts), Math.max(...easts)];
  const [bottom, top] = [Math.min(...norths), Math.max(...norths)];
  const wide = Math.max(right - left, 10);
  const high = Math.max(top - bottom, 10);
  const scale = 0.86 * Math.min(size.width / wide, size.height / high);
  return { east: (left + right) / 2, north: (bottom + top) / 2, scale: Math.max(scale, 0.05) };
}
