// The ways that a proposed mission would fly: as its document says, and as they were rehearsed.

import type { Point, Spot } from "./place";
import type { FleetOut, MissionOut, RobotConfig, Waypoint } from "./wire";
import { wordsOf } from "./words";

/** Metres of the Earth's equatorial radius, and its first eccentricity squared (WGS84). */
const EARTH = 6378137;
const ECCENTRICITY = 0.00669437999014;
const RADIANS = Math.PI / 180;
/** Times the ways' extent up to which the view of all shows the whole fence. */
const FAR_FENCE = 1.5;

/** A waypoint of the document in the local frame. */
export interface Stop {
  id: string;
  point: Point;
  /** Metres above home; null for one that is counted from the sea or the ground. */
  up: number | null;
  /** Its height as the document states it. */
  height: string;
  /** What is done there. */
  doing: string;
}

export interface PlannedWay {
  robot: string;
  /** Class of its colour. */
  tone: string;
  start: Spot;
  stops: Stop[];
  /** Whether the waypoints are flown to in the document's order. */
  ordered: boolean;
  /** Analysis that decides the way; null where waypoints do. */
  stream: string | null;
  /** Start, waypoints and return; empty where their order is not known. */
  legs: Spot[];
  /** The way of the rehearsal. */
  track: Spot[];
}

interface Home {
  latitude: number;
  longitude: number;
  altitude: number;
}

/** The ways of a mission's robots. */
export function plannedWays(mission: MissionOut, fleet: FleetOut, robots: RobotConfig[]): PlannedWay[] {
  const home = (fleet.environment["home"] ?? null) as Home | null;
  return mission.robots.map((robot, number) => {
    const config = robots.find((one) => one.id === robot);
    const parked = fleet.robots.find((one) => one.id === robot)?.position;
    const start: Spot = parked ?? config?.start ?? [0, 0, 0];
    const change = mission.proposal?.change_of != null;
    const own = mission.proposal?.document.navigation.filter((one) => one.robot === robot) ?? [];
    const waypoints = own.flatMap((one) => one.waypoints);
    const stops = waypoints.map((one) => stopOf(one, start, home));
    const urgent = new Set(own.flatMap((one) => one.waypoints.map(({ priority = 5 }) => one.priority ?? priority)));
    const stream = own.find((one) => one.stream !== null)?.stream ?? null;
    const ordered = urgent.size < 2 && own.every((one) => one.ordered && one.index === null);
    return {
      ...{ robot, tone: `r${number % 6}`, start, stops, ordered, stream },
      legs: ordered && stream === null ? legsOf(start, stops, change ? null : (config?.limits.takeoff_height ?? 0)) : [],
      track: mission.verdict?.tracks[robot] ?? [],
    };
  });
}

/** Take-off, the way along the waypoints, return and landing; only the way for a drone in flight (null). */
function legsOf(start: Spot, stops: Stop[], takeoff: number | null): Spot[] {
  const [east, north, up] = start;
  const flown = stops.map(({ point, up: height }): Spot => [...point, height ?? up]);
  const last = flown.at(-1);
  if (!last) return [];
  if (takeoff === null) return [start, start, ...flown, last, last];
  const lowest = up + takeoff;
  return [start, [east, north, lowest], ...flown, [east, north, Math.max(last[2], lowest)], start];
}

function stopOf(waypoint: Waypoint, start: Spot, home: Home | null): Stop {
  const { id, x, y, z, above = null, waypoint_type = "relative", hover_duration = 0, yaw, speed } = waypoint;
  const relative = waypoint_type === "relative";
  const global = waypoint_type === "global" || waypoint_type === "global_relative";
  const point: Point = global ? localOf(x, y, home) : relative ? [start[0] + x, start[1] + y] : [x, y];
  const level = above === null && relative ? z + start[2] : z;
  const up = above === null && waypoint_type === "global" ? z - (home?.altitude ?? 0) : level;
  const homely = above === null || above === "home";
  const doing = [
    hover_duration > 0 ? `stays ${hover_duration} s` : "",
    yaw == null ? "" : `looks to ${((450 - yaw / RADIANS) % 360).toFixed(0)}°`,
    speed == null ? "" : `at ${speed} m/s`,
    ...(waypoint.actions ?? []).map(({ type }) => wordsOf(type ?? "")),
  ];
  return {
    ...{ id, point, up: homely ? up : null },
    height: homely ? `${up.toFixed(1)} m` : `${z} m above ${above === "sea" ? "the sea" : "ground"}`,
    doing: doing.filter(Boolean).join(", "),
  };
}

/** Metres east and north of home, near it. */
function localOf(latitude: number, longitude: number, home: Home | null): Point {
  if (!home) return [0, 0];
  const sine = Math.sin(home.latitude * RADIANS);
  const bend = 1 - ECCENTRICITY * sine * sine;
  const [prime, meridian] = [EARTH / Math.sqrt(bend), (EARTH * (1 - ECCENTRICITY)) / bend ** 1.5];
  return [
    (longitude - home.longitude) * RADIANS * prime * Math.cos(home.latitude * RADIANS),
    (latitude - home.latitude) * RADIANS * meridian,
  ];
}

/** All places on the ways. */
export function placesOn(ways: PlannedWay[]): Point[] {
  const on = ({ start, stops, track }: PlannedWay): (Point | Spot)[] => [
    ...[start, ...track],
    ...stops.map(({ point }) => point),
  ];
  return ways.flatMap(on).map(([east, north]): Point => [east, north]);
}

/** Highest and lowest of the waypoints and of the rehearsal, metres above home. */
export function heightsOf(ways: PlannedWay[]): [lowest: number, highest: number] {
  const ups = ways.flatMap(({ stops, track }) => [...stops.map(({ up }) => up ?? 0), ...track.map((one) => one[2])]);
  return [Math.min(...ups, Infinity), Math.max(...ups, 0)];
}

/** Corners, at whole metres, of a rectangle around some places. */
export function boxAround(places: Point[], margin: number): [Point, Point, Point, Point] {
  const [easts, norths] = [places.map(([east]) => east), places.map(([, north]) => north)];
  const [west, east] = [Math.floor(Math.min(...easts) - margin), Math.ceil(Math.max(...easts) + margin)];
  const [south, north] = [Math.floor(Math.min(...norths) - margin), Math.ceil(Math.max(...norths) + margin)];
  return [[west, south], [east, south], [east, north], [west, north]];
}

/** What the view of all shows: the ways with some ground around them, and a fence that is near. */
export function shownOf(ways: PlannedWay[], robots: RobotConfig[]): Point[] {
  const near = boxAround(placesOn(ways), 5);
  const fences = robots.flatMap(({ limits }) => limits.geofence.polygon);
  if (fences.length === 0) return near;
  const size = ([[west, south], , [east, north]]: [Point, Point, Point, Point]) =>
    Math.max(east - west, north - south);
  const whole = boxAround(fences, 0);
  return size(whole) <= FAR_FENCE * size(near) ? [...near, ...whole] : near;
}
