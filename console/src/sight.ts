// How the map looks at the ground: from straight above.

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

/** A view from straight above: east is right, north is up. */
export class Sight {
  constructor(
    readonly view: View,
    readonly size: Size,
  ) {}

  x(east: number): number {
    return this.size.width / 2 + (east - this.view.east) * this.view.scale;
  }

  y(north: number): number {
    return this.size.height / 2 - (north - this.view.north) * this.view.scale;
  }

  /** The place at a pixel. */
  metres(px: number, py: number): Point {
    const { east, north, scale } = this.view;
    return [east + (px - this.size.width / 2) / scale, north - (py - this.size.height / 2) / scale];
  }

  /** Points of an SVG line. */
  line(points: readonly (Point | Spot)[]): string {
    return points.map(([east, north]) => `${px(this.x(east))},${px(this.y(north))}`).join(" ");
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
