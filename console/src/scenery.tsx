// What lies below a flight: the simulated world, as walls and crowns where the view is tilted.

import { useMemo } from "preact/hooks";
import { ask, usePolled } from "./connection";
import type { Point } from "./place";
import type { Sight } from "./sight";
import { px } from "./sight";
import type { SceneryOut, Shape } from "./wire";

/** Where a tree's crown is, as a share of its height. */
const CROWN = 0.62;
/** Rungs of a tower, and how much of its foot is left at its top. */
const RUNGS = 6;
const TOP = 0.25;
/** Kinds that lie flat, below all that stands. */
const FLAT = new Set(["road", "crops"]);

const EMPTY: SceneryOut = { shapes: [], tiles: null };

/** The scenery at a path of the server, an empty one until it is there; or the recorded one. */
export function useScenery(path: string, recorded?: SceneryOut): SceneryOut {
  // The flight can be seen without.
  const polled = usePolled(recorded ? "" : path, (signal) => ask<SceneryOut>(path, undefined, signal), () => null);
  return recorded ?? polled.answer ?? EMPTY;
}

export function SceneryLayer({ shapes, sight }: { shapes: readonly Shape[]; sight: Sight }) {
  const { east, north, scale } = sight.view;
  // Many shapes, and ten states a second: drawn anew only where the view has changed.
  return useMemo(() => {
    const far = (one: Shape) => Math.min(...one.outline.map((point) => point[1]));
    const ordered = [...shapes].sort(
      (one, other) =>
        Number(FLAT.has(other.kind)) - Number(FLAT.has(one.kind)) || far(other) - far(one),
    );
    return (
      <g class="scenery">
        {ordered.map((shape, number) => (
          <Thing key={number} shape={shape} sight={sight} />
        ))}
      </g>
    );
  }, [shapes, east, north, scale, sight.size, sight.tilted]);
}

function Thing({ shape, sight }: { shape: Shape; sight: Sight }) {
  const { kind, outline, height, width } = shape;
  const [first] = outline;
  if (!first) return null;
  if (kind === "road") {
    const wide = Math.max(1.5, width * sight.view.scale);
    return <polyline class="road" points={sight.line(outline)} stroke-width={px(wide)} />;
  }
  if (kind === "fence") {
    return (
      <g class="rail">
        <polyline points={sight.line(outline)} />
        {sight.tilted && <polyline points={sight.line(outline, height)} />}
      </g>
    );
  }
  if (kind === "tree") return <Tree place={first} height={height} width={width} sight={sight} />;
  if (kind === "tower") return <Tower foot={outline} height={height} sight={sight} />;
  return (
    <g class={kind}>
      <polygon points={sight.line(outline)} />
      {sight.tilted &&
        walls(outline).map(([from, to], number) => (
          <polygon
            key={number}
            class="wall"
            points={`${sight.line([from, to])} ${sight.line([to, from], height)}`}
          />
        ))}
      {sight.tilted && <polygon class="roof" points={sight.line(outline, height)} />}
    </g>
  );
}

/** The sides of an area that look south, towards the viewer; its corners go counter-clockwise. */
function walls(outline: readonly Point[]): [Point, Point][] {
  return outline
    .map((from, place): [Point, Point] => [from, outline[(place + 1) % outline.length] ?? from])
    .filter(([from, to]) => to[0] > from[0]);
}

function Tree(props: { place: Point; height: number; width: number; sight: Sight }) {
  const { place, height, width, sight } = props;
  const [east, north] = place;
  const [x, crown] = [sight.x(east), sight.y(north, CROWN * height)];
  return (
    <g class="tree">
      {sight.tilted && <path class="trunk" d={`M${px(x)} ${px(sight.y(north))}V${px(crown)}`} />}
      <circle cx={px(x)} cy={px(crown)} r={px((width / 2) * sight.view.scale)} />
    </g>
  );
}

function Tower({ foot, height, sight }: { foot: readonly Point[]; height: number; sight: Sight }) {
  const [a, b, c, d] = foot;
  if (!a || !b || !c || !d) return null;
  const middle: Point = [(a[0] + c[0]) / 2, (a[1] + c[1]) / 2];
  const ring = (share: number) => {
    const left = 1 - (1 - TOP) * share;
    return foot.map(
      ([east, north]): Point => [
        middle[0] + left * (east - middle[0]),
        middle[1] + left * (north - middle[1]),
      ],
    );
  };
  const shares = sight.tilted ? Array.from({ length: RUNGS + 1 }, (_, n) => n / RUNGS) : [0];
  const [top] = ring(1);
  return (
    <g class="tower">
      {shares.map((share) => (
        <polygon key={share} points={sight.line(ring(share), share * height)} />
      ))}
      {sight.tilted && top
        ? foot.map((corner, place) => (
            <polyline
              key={place}
              points={`${sight.line([corner])} ${sight.line([ring(1)[place] ?? top], height)}`}
            />
          ))
        : [[a, c], [b, d]].map((pair, place) => (
            <polyline key={place} points={sight.line(pair as [Point, Point])} />
          ))}
    </g>
  );
}
