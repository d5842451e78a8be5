// A survey on the map: the area with its corners, which can be dragged, and the path.

import type { RefObject } from "preact";
import { useRef } from "preact/hooks";
import type { Point } from "./place";
import { type Sight, px } from "./sight";

/** What the map needs of a survey that is being drawn. */
export interface Drawn {
  area: Point[];
  path: Point[];
  /** Where pictures are taken. */
  photos: Point[];
  refused: boolean;
  add(point: Point): void;
  move(corner: number, to: Point): void;
  undo(): void;
  cancel(): void;
}

interface LayerProps {
  drawn: Drawn;
  sight: Sight;
  box: RefObject<HTMLDivElement | null>;
}

export function SurveyLayer({ drawn, sight, box }: LayerProps) {
  const held = useRef<number | null>(null);
  const drag = (event: PointerEvent) => {
    const at = box.current?.getBoundingClientRect();
    if (held.current === null || !at) return;
    event.stopPropagation();
    drawn.move(held.current, sight.metres(event.clientX - at.left, event.clientY - at.top));
  };
  const [first] = drawn.path;
  return (
    <g class={`survey ${drawn.refused ? "refused" : ""}`}>
      {drawn.area.length > 1 && <polygon class="area" points={sight.line(drawn.area)} />}
      {drawn.path.length > 1 && <polyline class="sweeps" points={sight.line(drawn.path)} />}
      {drawn.photos.length > 0 && <path class="photos" d={dots(drawn.photos, sight)} />}
      {first && <circle class="entry" cx={sight.x(first[0])} cy={sight.y(first[1])} r="5" />}
      {drawn.area.map(([east, north], corner) => (
        <g
          key={corner}
          class="corner"
          data-corner={corner}
          transform={`translate(${sight.x(east)} ${sight.y(north)})`}
          onPointerDown={(event) => {
            event.stopPropagation();
            held.current = corner;
            event.currentTarget.setPointerCapture(event.pointerId);
          }}
          onPointerMove={drag}
          onPointerUp={(event) => {
            event.stopPropagation();
            held.current = null;
          }}
        >
          <circle class="touch" r="18" />
          <circle r="7" />
          <text x="10" y="-8">{corner + 1}</text>
        </g>
      ))}
    </g>
  );
}

/** One path of points without length: a survey has thousands of pictures. */
function dots(places: Point[], sight: Sight): string {
  return places.map(([east, north]) => `M${px(sight.x(east))} ${px(sight.y(north))}h0`).join("");
}
