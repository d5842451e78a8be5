// What of an environment the page draws: robots, fences and leased areas. Metres east and north of home.

import type { CameraConfig, FleetOut, RobotConfig, RobotOut } from "./wire";

export type Point = readonly [number, number];
/** With its height. */
export type Spot = readonly [number, number, number];

/** Degrees downwards from which a camera looks straight down. */
const DOWN = 85;

/** The robots of a fleet's or a recording's environment; none where that is not known. */
export function robotsOf({ environment }: Pick<FleetOut, "environment">): RobotConfig[] {
  return (environment["robots"] ?? []) as RobotConfig[];
}

interface Camera {
  id: string;
  settings: Partial<CameraConfig>;
}

export function camerasOf(robot: RobotConfig | undefined): Camera[] {
  return robot?.sensors.filter((one) => one.type === "camera") ?? [];
}

/** The camera that looks straight down or hangs from a gimbal. */
export function surveyCamera(robot: RobotConfig | undefined): Camera | undefined {
  return camerasOf(robot).find(({ settings }) => settings.gimbal || (settings.pitch ?? 0) >= DOWN);
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
  const leased = robots.filter((one) => one.lease !== null && one.area);
  return [...new Set(leased.map((one) => one.lease))].map((lease) => {
    const drones = leased.filter((one) => one.lease === lease);
    return {
      lease: lease ?? "",
      polygon: drones[0]?.area ?? [],
      title: `${drones[0]?.tenant ?? ""}: ${drones.map((one) => one.id).join(", ")}`,
    };
  });
}
