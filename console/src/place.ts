// What of an environment the page draws: home, fences and starts. Metres east and north of home.

import type { FleetOut } from "./wire";

export type Point = readonly [number, number];

export interface Place {
  fences: { robot: string; polygon: Point[]; noFly: Point[][]; ceiling: number }[];
  starts: Point[];
  takeoffHeight: number;
}

interface Robot {
  id: string;
  start?: number[];
  limits?: {
    takeoff_height?: number;
    geofence?: { polygon?: Point[]; no_fly?: Point[][]; ceiling?: number };
  };
}

export function placeOf(fleet: FleetOut): Place {
  const robots = (fleet.environment["robots"] ?? []) as Robot[];
  return {
    fences: robots.map((robot) => ({
      robot: robot.id,
      polygon: robot.limits?.geofence?.polygon ?? [],
      noFly: robot.limits?.geofence?.no_fly ?? [],
      ceiling: robot.limits?.geofence?.ceiling ?? 120,
    })),
    starts: robots.map((robot) => [robot.start?.[0] ?? 0, robot.start?.[1] ?? 0] as const),
    takeoffHeight: robots[0]?.limits?.takeoff_height ?? 2,
  };
}
