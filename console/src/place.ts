// What of an environment the page draws: home, fences and starts. Metres east and north of home.

import type { FleetOut, RobotOut } from "./wire";

export type Point = readonly [number, number];
/** With its height. */
export type Spot = readonly [number, number, number];

export interface Place {
  fences: { robot: string; polygon: Point[]; noFly: Point[][]; ceiling: number }[];
  starts: Point[];
  takeoffHeight: number;
  robots: Map<string, Abilities>;
}

/** Degrees downwards from which a camera looks straight down. */
const DOWN = 85;

/** What a robot is able to do, as far as its operator has to know. */
export interface Abilities {
  /** m/s. */
  cruiseSpeed: number;
  maxSpeed: number;
  maxClimb: number;
  /** Of its camera, horizontally, degrees. */
  fieldOfView: number;
  /** Ids of its cameras. */
  cameras: string[];
  /** The one that looks straight down or hangs from a gimbal; null without one. */
  surveys: string | null;
}

/** Where a lease's drones stay. */
export interface LeasedArea {
  lease: string;
  polygon: Point[];
  /** Who has it, and which drones. */
  title: string;
}

/** The areas of leases, each once, whatever the number of its drones. */
export function areasOf(robots: RobotOut[]): LeasedArea[] {
  const known = new Map<string, RobotOut[]>();
  for (const one of robots) {
    if (one.lease !== null && one.area) known.set(one.lease, [...(known.get(one.lease) ?? []), one]);
  }
  return [...known].map(([lease, held]) => ({
    lease,
    polygon: held[0]?.area ?? [],
    title: `${held[0]?.tenant ?? ""}: ${held.map((one) => one.id).join(", ")}`,
  }));
}

interface Robot {
  id: string;
  start?: number[];
  sensors?: {
    id: string;
    type?: string;
    settings?: { horizontal_fov?: number; pitch?: number; gimbal?: object | null };
  }[];
  limits?: {
    takeoff_height?: number;
    cruise_speed?: number;
    max_speed?: number;
    max_climb?: number;
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
    robots: new Map(robots.map((robot) => [robot.id, abilitiesOf(robot)])),
    takeoffHeight: robots[0]?.limits?.takeoff_height ?? 2,
  };
}

function abilitiesOf(robot: Robot): Abilities {
  const cameras = robot.sensors?.filter((one) => one.type === "camera") ?? [];
  const surveys = cameras.find(({ settings }) => settings?.gimbal || (settings?.pitch ?? 0) >= DOWN);
  return {
    cruiseSpeed: robot.limits?.cruise_speed ?? 1,
    maxSpeed: robot.limits?.max_speed ?? 5,
    maxClimb: robot.limits?.max_climb ?? 1.5,
    fieldOfView: cameras[0]?.settings?.horizontal_fov ?? 82.6,
    cameras: cameras.map((one) => one.id),
    surveys: surveys?.id ?? null,
  };
}
