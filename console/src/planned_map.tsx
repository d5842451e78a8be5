// Planned ways on the map, and over their length as a height profile.

import { useEffect, useRef, useState } from "preact/hooks";
import { niceStep } from "./map_layers";
import type { Spot } from "./place";
import type { PlannedWay } from "./planned";
import { type Sight, px } from "./sight";
import type { ClearanceOut } from "./wire";

/** Most waypoints of a robot that have their number beside them. */
const NUMBERED = 60;
const HEIGHT = 170;
/** Pixels around the profile. */
const EDGE = { left: 34, right: 12, top: 14, bottom: 22 };
/** Times the highest place up to which the profile shows a ceiling. */
const FAR_CEILING = 2.5;
/** Metres up to which a floor is as good as the ground. */
const LOW_FLOOR = 1;

interface LayerProps {
  ways: PlannedWay[];
  clearance: ClearanceOut | null;
  sight: Sight;
}

export function PlannedLayer({ ways, clearance, sight }: LayerProps) {
  return (
    <>
      {ways.map((way, number) => (
        <g key={way.robot} class={`robot ${way.tone}`} data-planned={way.robot}>
          <polyline class="trail" points={sight.line(way.track)} />
          <polyline class="way" points={sight.line(way.legs)} />
          {way.stops.map(({ id, point }, place) => (
            <g
              key={id}
              class="waypoint stop"
              data-waypoint={id}
              transform={`translate(${sight.x(point[0])} ${sight.y(point[1])})`}
            >
              <Numbered way={way} place={place} />
            </g>
          ))}
          <g class="drone" transform={`translate(${sight.x(way.start[0])} ${sight.y(way.start[1])})`}>
            <path class="body" d="M0-11L7 8L0 4L-7 8Z" />
            {/* Neighbours have their names on either side. */}
            <text y={number % 2 ? -16 : 24}>{way.robot}</text>
          </g>
        </g>
      ))}
      {clearance && (
        <g
          class="nearest"
          data-testid="nearest"
          transform={`translate(${sight.x(clearance.place[0])} ${sight.y(clearance.place[1])})`}
        >
          <path d="M-7-7L7 7M-7 7L7-7" />
          <text x="12" y="-8">{clearance.distance.toFixed(1)} m</text>
        </g>
      )}
    </>
  );
}

/** A waypoint with its number, where their order is known and there is room. */
function Numbered({ way, place }: { way: PlannedWay; place: number }) {
  const numbered = way.ordered && way.stops.length <= NUMBERED;
  return (
    <>
      <circle r={numbered ? 8.5 : 4} />
      {numbered && <text dy="4">{place + 1}</text>}
    </>
  );
}

interface ProfileProps {
  ways: PlannedWay[];
  clearance: ClearanceOut | null;
  ceiling: number;
  floor: number;
}

/** Heights over the length of the ways: planned and rehearsed, between floor and ceiling. */
export function HeightProfile({ ways, clearance, ceiling, floor }: ProfileProps) {
  const box = useRef<HTMLDivElement>(null);
  const [width, setWidth] = useState(600);
  useEffect(() => {
    const element = box.current;
    if (!element) return;
    const watch = new ResizeObserver(() => setWidth(element.clientWidth));
    watch.observe(element);
    return () => watch.disconnect();
  }, []);
  const drawn = ways.map((way) => {
    const level = way.stops.every(({ up }) => up !== null);
    return { way, legs: level ? alongOf(way.legs) : [], track: alongOf(way.track) };
  });
  const points = drawn.flatMap(({ legs, track }) => [...legs, ...track]);
  const most = Math.max(...points.map(([, up]) => up), 1);
  const far = Math.max(...points.map(([along]) => along), 1);
  const near = ceiling <= FAR_CEILING * most;
  const top = (near ? Math.max(ceiling, most) : most) * 1.12;
  const bottom = Math.min(0, floor, ...points.map(([, up]) => up));
  const x = (along: number) => EDGE.left + (along / far) * (width - EDGE.left - EDGE.right);
  const y = (up: number) => HEIGHT - EDGE.bottom - ((up - bottom) / (top - bottom)) * (HEIGHT - EDGE.top - EDGE.bottom);
  const line = (way: Along[]) => way.map(([along, up]) => `${px(x(along))},${px(y(up))}`).join(" ");
  const nearest = clearance && nearestOn(ways.find((one) => one.robot === clearance.robot)?.track ?? [], clearance.place);
  const label =
    `Highest ${most.toFixed(1)} m above home, ceiling ${ceiling} m, floor ${floor} m; ` +
    `${far.toFixed(0)} m along the longest way`;
  return (
    <div class="profile" ref={box}>
      <svg width={width} height={HEIGHT} role="img" aria-label={label} data-testid="profile">
        {ticks(bottom, top, 3).map((up) => (
          <g key={up}>
            <path class="grid" d={`M${EDGE.left} ${px(y(up))}H${width - EDGE.right}`} />
            <text class="coordinate" x={EDGE.left - 5} y={px(y(up) + 3)} text-anchor="end">{up}</text>
          </g>
        ))}
        {ticks(0, far, width / 110).map((along) => (
          <text key={along} class="coordinate" x={px(x(along))} y={HEIGHT - 6} text-anchor="middle">{along} m</text>
        ))}
        <path class="ground" d={`M${EDGE.left} ${px(y(0))}H${width - EDGE.right}`} />
        {floor > LOW_FLOOR && <path class="bound" d={`M${EDGE.left} ${px(y(floor))}H${width - EDGE.right}`} />}
        {near && <path class="bound" d={`M${EDGE.left} ${px(y(ceiling))}H${width - EDGE.right}`} />}
        <text class="boundname" x={width - EDGE.right - 3} y={near ? px(y(ceiling) - 4) : 11} text-anchor="end">
          ceiling {ceiling} m{near ? "" : ", beyond the chart"}
        </text>
        {drawn.map(({ way, legs, track }) => (
          <g key={way.robot} class={`robot ${way.tone}`}>
            <polyline class="trail" points={line(track)} />
            <polyline class="way" points={line(legs)} />
            {/* Two points before the first waypoint, and two after the last one. */}
            {legs.slice(2, -2).map(([along, up], place) => (
              <g key={place} class="waypoint stop" transform={`translate(${px(x(along))} ${px(y(up))})`}>
                <Numbered way={way} place={place} />
              </g>
            ))}
          </g>
        ))}
        {clearance && nearest && (
          <g class="nearest" transform={`translate(${px(x(nearest[0]))} ${px(y(nearest[1]))})`}>
            <path d="M-6-6L6 6M-6 6L6-6" />
          </g>
        )}
      </svg>
    </div>
  );
}

/** Metres along a way, and metres above home. */
type Along = [along: number, up: number];

function alongOf(way: Spot[]): Along[] {
  let [along, last] = [0, way[0]];
  return way.map((spot) => {
    along += last ? Math.hypot(spot[0] - last[0], spot[1] - last[1]) : 0;
    last = spot;
    return [along, spot[2]];
  });
}

/** The place of a way that is nearest to another place. */
function nearestOn(way: Spot[], [east, north, up]: Spot): Along | null {
  const away = way.map((one) => Math.hypot(one[0] - east, one[1] - north, one[2] - up));
  return alongOf(way)[away.indexOf(Math.min(...away))] ?? null;
}

/** Round values of an axis, about so many. */
function ticks(from: number, to: number, count: number): number[] {
  const step = niceStep((to - from) / Math.max(1, count));
  const first = Math.ceil(from / step);
  const values = Array.from({ length: Math.floor(to / step) - first + 1 }, (_, place) => (first + place) * step);
  return values.map((value) => Number(value.toFixed(2)));
}
