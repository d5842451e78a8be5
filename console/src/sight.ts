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

/** Pixels of a label's letter across and of its line. */
export const LETTER = 7;
export const LINE = 13;
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

/** Labels of which none covers another one. */
export class Labels {
  private readonly placed: { x: number; y: number; half: number }[] = [];

  /** Place a label by its middle and half its width, pixels; false if it would cover another one. */
  add(x: number, y: number, half: number): boolean {
    const free = this.placed.every(
      (one) => Math.abs(one.y - y) >= LINE || Math.abs(one.x - x) >= one.half + half,
    );
    if (free) this.placed.push({ x, y, half });
    return free;
  }
}
