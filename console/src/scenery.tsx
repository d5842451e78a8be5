// What lies below a flight: the simulated world.

import { useMemo } from "preact/hooks";
import { ask, usePolled } from "./connection";
import type { Sight } from "./sight";
import { px } from "./sight";
import type { SceneryOut, Shape } from "./wire";

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
  }, [shapes, east, north, scale, sight.size]);
}

function Thing({ shape, sight }: { shape: Shape; sight: Sight }) {
  const { kind, outline, width } = shape;
  const [first, second, third, fourth] = outline;
  if (!first) return null;
  if (kind === "road") {
    const wide = Math.max(1.5, width * sight.view.scale);
    return <polyline class="road" points={sight.line(outline)} stroke-width={px(wide)} />;
  }
  if (kind === "fence") return <polyline class="rail" points={sight.line(outline)} />;
  if (kind === "tree") {
    const radius = px((width / 2) * sight.view.scale);
    return <circle class="tree" cx={px(sight.x(first[0]))} cy={px(sight.y(first[1]))} r={radius} />;
  }
  return (
    <g class={kind}>
      <polygon points={sight.line(outline)} />
      {kind === "tower" && second && third && fourth && (
        <>
          <polyline points={sight.line([first, third])} />
          <polyline points={sight.line([second, fourth])} />
        </>
      )}
    </g>
  );
}
