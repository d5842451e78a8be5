// The map: a metric grid in the environment's local frame, north up, drawn as SVG.

import type { ComponentChildren, RefObject } from "preact";
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { type Flight, placesOf, timeOf } from "./flight";
import { MarkLayer, nameOf } from "./ground";
import { Coordinates, Drones, Grid, PlaceLayer, Scale } from "./map_layers";
import type { LeasedArea, Point } from "./place";
import { RulerLayer, measured } from "./ruler";
import { SceneryLayer } from "./scenery";
import { Sight, type Size, type View } from "./sight";
import { type Drawn, SurveyLayer } from "./survey_map";
import { useArchive } from "./tile_archive";
import { TileLayer } from "./tiles";
import { TrafficLayer, headingOf, relativeHeight, trafficOf } from "./traffic";
import { useEscape } from "./widgets";
import type { RobotConfig, SceneryOut } from "./wire";
import "./map.css";

const ZOOM = 1.25;
/** Pixels around a drone within which a click chooses it. */
const NEAR = 30;

/** Classes and texts of the legend. */
const STATES = { good: "in flight", warn: "holds, returns", bad: "lost, aborted", muted: "on the ground" };
const WAYPOINTS = { visited: "visited", current: "current", coming: "coming" };
const ZONES = { fenced: "fence", forbidden: "no-fly" };

export interface MapProps {
  flight: Flight;
  /** The robots of the environment. */
  robots: RobotConfig[];
  scenery: SceneryOut;
  areas: LeasedArea[];
  /** The drone whose plan is drawn and that the view may follow. */
  chosen: string | null;
  /** Called with the drone at a click; missing where a click does something else. */
  onChoose?: (robot: string | null) => void;
  /** What a pilot does on the map. */
  pilot?: PilotTools | undefined;
  /** What is planned, where nothing flies yet. */
  planned?: PlannedLayer;
}

export interface PlannedLayer {
  draw(sight: Sight): ComponentChildren;
  /** Places that the view of all shows. */
  points: Point[];
  /** Classes and texts of its legend. */
  legend: Record<string, string>;
  /** The area that is being drawn; a click is a corner then. */
  drawn: Drawn | null;
}

export interface PilotTools {
  /** Where a waypoint is to be. */
  marked: Point | null;
  onMark(point: Point | null): void;
  /** The survey that is being drawn; a click is a corner then. */
  drawn: Drawn | null;
  onDraw(): void;
}

/** Drones with their plans and trails, over the scenery or the tiles of a place. */
export function FlightMap(props: MapProps) {
  const { flight, robots, scenery, areas, chosen, onChoose, pilot, planned } = props;
  const fleet = flight.source.kind === "fleet";
  const box = useRef<HTMLDivElement>(null);
  /** The points that are measured between. */
  const [ruler, setRuler] = useState<Point[] | null>(null);
  const vehicles = flight.vehicles();
  const focus = vehicles.find((one) => one.id === chosen);
  const all = useMemo(() => pointsOf(flight, robots), [robots, fleet || planKey(flight)]);
  const fitted = planned?.points ?? all;
  const view = useView(box, fitted, focus?.position ?? null);
  const { sight } = view;
  const { size } = sight;
  const map = useArchive(scenery.tiles);
  const drawing = (planned ?? pilot)?.drawn ?? null;
  const marked = pilot?.marked ?? null;
  const up = focus?.position?.[2] ?? null;
  const now = fleet ? (focus?.status ? timeOf(focus.status) : 0) : flight.now;
  const marks = flight.marks.at(now, flight.recorded);
  const traffic = trafficOf(flight.statuses, focus?.status);

  const onPoint = (point: Point) => {
    if (ruler) setRuler([...ruler, point]);
    else if (drawing) drawing.add(point);
    else if (pilot) pilot.onMark(point);
    else if (onChoose) onChoose(nearest(point));
  };
  const nearest = ([east, north]: Point): string | null => {
    const pixels = vehicles.map(({ id, position }) => {
      const [e, n] = position ?? [Infinity, Infinity];
      return { id, far: sight.view.scale * Math.hypot(e - east, n - north) };
    });
    const [first] = pixels.sort((one, other) => one.far - other.far);
    return first && first.far < NEAR ? first.id : null;
  };
  const measure = () => setRuler(ruler ? null : []);
  const keys: Record<string, () => void> = {
    ...view.keys,
    Enter: () => onPoint([sight.view.east, sight.view.north]),
    m: measure,
  };
  if (ruler) keys["Backspace"] = () => setRuler(ruler.slice(0, -1));
  else if (drawing) keys["Backspace"] = () => drawing.undo();
  const unmark = pilot && marked ? () => pilot.onMark(null) : null;
  useEscape(ruler ? () => setRuler(null) : drawing ? () => drawing.cancel() : unmark);
  const enter = onChoose
    ? "chooses the drone at the cross"
    : planned
    ? "sets a corner of the area, or a point of the measured line at the cross"
    : "sets a waypoint, a corner of the survey, or a point of the measured line at the cross";

  return (
    <section class="card map" aria-label="Map">
      <div
        class="mapbox"
        ref={box}
        tabIndex={0}
        role="application"
        aria-label={`Map. Arrow keys move it, plus and minus zoom, 0 shows all, F follows the drone, M measures, Enter ${enter}.`}
        data-testid="map"
        data-scale={sight.view.scale}
        data-east={sight.view.east}
        data-north={sight.view.north}
        onKeyDown={(event) => {
          const act = keys[event.key];
          if (!act) return;
          event.preventDefault();
          act();
        }}
        {...view.pointer(onPoint)}
      >
        <svg width={size.width} height={size.height} aria-hidden="true">
          {map.tiles && <TileLayer tiles={map.tiles} archive={map.archive} sight={sight} />}
          <Grid sight={sight} />
          <SceneryLayer shapes={scenery.shapes} sight={sight} />
          <Coordinates sight={sight} />
          <PlaceLayer robots={robots} areas={areas} sight={sight} />
          <MarkLayer marks={marks} now={now} stale={flight.stale} sight={sight} />
          <Drones vehicles={vehicles} chosen={chosen} plans={!fleet} sight={sight} />
          <TrafficLayer traffic={traffic} own={up} stale={flight.stale} sight={sight} />
          {planned?.draw(sight)}
          {drawing && <SurveyLayer drawn={drawing} sight={sight} box={box} />}
          {ruler && <RulerLayer points={ruler} sight={sight} />}
          {marked && (
            <g class="marked" transform={`translate(${sight.x(marked[0])} ${sight.y(marked[1])})`}>
              <circle r="10" />
              <path d="M-15 0H15M0-15V15" />
            </g>
          )}
          <path class="cross" d={`M${size.width / 2 - 6} ${size.height / 2}h12m-6-6v12`} />
        </svg>
        <Scale scale={sight.view.scale} />
        {map.problem && (
          <p class="unmapped" role="status" data-testid="unmapped">{map.problem}</p>
        )}
        {scenery.tiles?.attribution && <div class="attribution">{scenery.tiles.attribution}</div>}
        <div class="north" aria-hidden="true">N</div>
      </div>
      <div class="mapkeys">
        {pilot && (
          <Key
            class="draw"
            text="Survey"
            title="Draw an area to survey"
            pressed={drawing !== null}
            onClick={drawing ? drawing.cancel : pilot.onDraw}
          />
        )}
        <Key text="Measure" title="Measure distances (M)" pressed={ruler !== null} onClick={measure} />
        <Key text="+" title="Zoom in (+)" onClick={() => view.zoom(ZOOM)} />
        <Key text="−" title="Zoom out (-)" onClick={() => view.zoom(1 / ZOOM)} />
        <Key text="All" title="Show all (0)" onClick={view.showAll} />
        {!planned && <Key text="Follow" title="Follow the drone (F)" pressed={view.follows} onClick={view.follow} />}
      </div>
      {ruler && (
        <p class="measured" role="status" data-testid="measured">{measured(ruler)}</p>
      )}
      <ul class="legend" aria-label="Legend">
        {Object.entries({ ...(planned?.legend ?? (fleet ? STATES : WAYPOINTS)), ...ZONES }).map(([kind, text]) => (
          <li key={kind} class={kind}>{text}</li>
        ))}
        <Listed name="sighted" word="seen" items={[...marks].reverse().map(({ what }) => nameOf(what))} />
        <Listed
          name="aircraft"
          word="aircraft"
          items={traffic.map((one) => `${one.callsign} ${relativeHeight(one, up)}, ${headingOf(one)}`)}
        />
        <Listed name="leased" word="lease" items={areas.map((one) => one.title)} />
      </ul>
    </section>
  );
}

/** A button of the map. */
function Key(props: { class?: string; text: string; title: string; pressed?: boolean; onClick(): void }) {
  const { text, title, pressed, ...rest } = props;
  const label = text.length > 1 ? {} : { "aria-label": title.replace(/ \(.*/, "") };
  return (
    <button type="button" title={title} aria-pressed={pressed} {...label} {...rest}>{text}</button>
  );
}

/** An entry of the legend whose items are read out, for who does not see the map; none without items. */
function Listed(props: { name: string; word: string; items: string[] }): ComponentChildren {
  if (props.items.length === 0) return null;
  return (
    <li class={props.name}>
      {props.word}
      <span class="unseen">: {props.items.join(props.name === "sighted" ? ", " : "; ")}</span>
    </li>
  );
}

/** A view that is moved and zoomed, and that follows a drone if asked to. */
function useView(box: RefObject<HTMLDivElement | null>, fitted: readonly Point[], drone: readonly number[] | null) {
  const [size, setSize] = useState<Size>({ width: 600, height: 400 });
  /** Null for the view that shows all. */
  const [own, setOwn] = useState<View | null>(null);
  const [follows, setFollows] = useState(false);
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
  const whole = useMemo(() => fit(fitted, size), [size, fitted]);
  const [east, north] = (follows && drone) || [];
  const shown = { ...(own ?? whole), ...(east !== undefined && north !== undefined && { east, north }) };
  const sight = new Sight(shown, size);
  const zoom = (factor: number) =>
    setOwn({ ...shown, scale: Math.min(400, Math.max(0.05, shown.scale * factor)) });
  const pan = (dx: number, dy: number) => {
    setFollows(false);
    const { scale } = shown;
    setOwn({ scale, east: shown.east - dx / scale, north: shown.north + dy / scale });
  };
  const showAll = () => {
    setFollows(false);
    setOwn(null);
  };
  const follow = () => setFollows(!follows);
  const keys: Record<string, () => void> = {
    "+": () => zoom(ZOOM),
    "=": () => zoom(ZOOM),
    "-": () => zoom(1 / ZOOM),
    "0": showAll,
    f: follow,
    ArrowLeft: () => pan(40, 0),
    ArrowRight: () => pan(-40, 0),
    ArrowUp: () => pan(0, 40),
    ArrowDown: () => pan(0, -40),
  };
  /** What the map does with wheel and pointer; a press that does not move is a point. */
  const pointer = (onPoint: (point: Point) => void) => ({
    onWheel: (event: WheelEvent) => {
      event.preventDefault();
      zoom(event.deltaY < 0 ? ZOOM : 1 / ZOOM);
    },
    onPointerDown: (event: PointerEvent) => {
      drag.current = { x: event.clientX, y: event.clientY, moved: false };
      (event.currentTarget as HTMLElement).setPointerCapture(event.pointerId);
    },
    onPointerMove: (event: PointerEvent) => {
      const from = drag.current;
      if (!from) return;
      const [dx, dy] = [event.clientX - from.x, event.clientY - from.y];
      if (!from.moved && Math.hypot(dx, dy) < 5) return;
      pan(dx, dy);
      drag.current = { x: event.clientX, y: event.clientY, moved: true };
    },
    onPointerUp: (event: PointerEvent) => {
      const from = drag.current;
      drag.current = null;
      if (!from || from.moved) return;
      const at = (event.currentTarget as HTMLElement).getBoundingClientRect();
      onPoint(sight.metres(event.clientX - at.left, event.clientY - at.top));
    },
  });
  return { sight, keys, pointer, zoom, showAll, follow, follows };
}

function planKey(flight: Flight): string {
  return flight.vehicles().map((one) => Object.keys(placesOf(one)).length).join();
}

/** Home, starts and fences; of a single flight its waypoints, too. */
function pointsOf(flight: Flight, robots: RobotConfig[]): Point[] {
  const vehicles = flight.source.kind === "fleet" ? [] : flight.vehicles();
  return [
    [0, 0],
    ...robots.map(({ start }): Point => [start[0], start[1]]),
    ...robots.flatMap(({ limits }) => limits.geofence.polygon),
    ...vehicles.flatMap((one) => Object.values(placesOf(one)).map(([e, n]): Point => [e, n])),
  ];
}

/** The view that shows some points. */
function fit(points: readonly Point[], size: Size): View {
  const easts = points.map(([east]) => east);
  const norths = points.map(([, north]) => north);
  const [left, right] = [Math.min(...easts), Math.max(...easts)];
  const [bottom, top] = [Math.min(...norths), Math.max(...norths)];
  const [wide, high] = [Math.max(right - left, 10), Math.max(top - bottom, 10)];
  const scale = 0.86 * Math.min(size.width / wide, size.height / high);
  return { east: (left + right) / 2, north: (bottom + top) / 2, scale: Math.max(scale, 0.05) };
}
