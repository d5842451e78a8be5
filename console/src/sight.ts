// How the map looks at the ground: from straight above, or tilted, from the south.

import type { Point, Spot } from "./place";

export interface View {
  east: number;
  north: number;
  /** Pixels a metre. */
  scale: number;
}

export interface Size {
  width: number;
  height: number;
}

/** Of the tilted view: how far 57° from the zenith shortens what lies, and lets stand what stands. */
const LIES = 0.55;
const STANDS = Math.sqrt(1 - LIES * LIES);

/** An orthographic view: east is right, north is up, and in the tilted one, up is up, too. */
export class Sight {
  /** Pixels on the screen of a pixel's length towards north. */
  readonly lies: number;
  private readonly stands: number;

  constructor(
    readonly view: View,
    readonly size: Size,
    readonly tilted: boolean,
  ) {
    this.lies = tilted ? LIES : 1;
    this.stands = tilted ? STANDS : 0;
  }

  x(east: number): number {
    return this.size.width / 2 + (east - this.view.east) * this.view.scale;
  }

  y(north: number, up = 0): number {
    const shown = (north - this.view.north) * this.lies + up * this.stands;
    return this.size.height / 2 - shown * this.view.scale;
  }

  /** The place on the ground below a pixel. */
  metres(px: number, py: number): Point {
    const { east, north, scale } = this.view;
    return [
      east + (px - this.size.width / 2) / scale,
      north - (py - this.size.height / 2) / scale / this.lies,
    ];
  }

  /** Points of an SVG line; those without a height lie at `up`. */
  line(points: readonly (Point | Spot)[], up = 0): string {
    return points
      .map(([east, north, own]) => `${px(this.x(east))},${px(this.y(north, own ?? up))}`)
      .join(" ");
  }
}

export function px(value: number): string {
  return value.toFixed(1);
}
