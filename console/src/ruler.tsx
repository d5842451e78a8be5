// A ruler on the map: distances from point to point along the ground, and the way to each.

import type { Point } from "./place";
import type { Sight } from "./sight";
import { px } from "./sight";
import { bearingOf } from "./words";

/** Metres between two points. */
function lengthOf(from: Point, to: Point): number {
  return Math.hypot(to[0] - from[0], to[1] - from[1]);
}

function metres(length: number): string {
  return length < 1000 ? `${length.toFixed(1)} m` : `${(length / 1000).toFixed(2)} km`;
}

/** What was measured, in words. */
export function measured(points: readonly Point[]): string {
  const [last, before] = [points.at(-1), points.at(-2)];
  if (!last) return "Measure: click a first point.";
  if (!before) return "Measure: click the next point.";
  const whole = points.reduce((sum, point, place) => {
    const from = points[place - 1];
    return from ? sum + lengthOf(from, point) : sum;
  }, 0);
  const leg = `${metres(lengthOf(before, last))} at ${bearingOf(last[0] - before[0], last[1] - before[1])}`;
  return points.length > 2 ? `${leg}, ${metres(whole)} in all` : leg;
}

export function RulerLayer({ points, sight }: { points: readonly Point[]; sight: Sight }) {
  return (
    <g class="ruler">
      <polyline points={sight.line(points)} />
      {points.map((point, place) => {
        const from = points[place - 1];
        const [x, y] = [sight.x(point[0]), sight.y(point[1])];
        return (
          <g key={place}>
            <circle cx={px(x)} cy={px(y)} r="4" />
            {from && (
              <text x={px((x + sight.x(from[0])) / 2)} y={px((y + sight.y(from[1])) / 2 - 6)}>
                {metres(lengthOf(from, point))}
              </text>
            )}
          </g>
        );
      })}
    </g>
  );
}
