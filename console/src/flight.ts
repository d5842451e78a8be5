// What a page knows of drones, live, of a provider's fleet or recorded: states, trails, charts, commands.

import { useCallback, useEffect, useState } from "preact/hooks";
import { AlertLog } from "./alerts";
import { Refused, ask, messageOf, openSocket } from "./connection";
import { GroundMarks } from "./ground";
import type { Spot } from "./place";
import type { Snapshot, Source } from "./source";
import { wordsOf } from "./words";
import type {
  AnalyticsOut,
  Answer,
  CommandIn,
  MissionOut,
  NavigationIn,
  RearrangeIn,
  RobotOut,
  RobotStatus,
  Waypoint,
} from "./wire";

const TRAIL = 3000;
/** Metres between two places of a trail. */
const STEP = 0.05;
const HISTORY = 1200;
/** Mission seconds between two rows of the analytics' sums. */
const SUMS = 0.5;
/** Milliseconds of silence after which what is shown counts as old; a fleet is polled. */
const STALE = { live: 2500, fleet: 5000, recording: Infinity };
/** Milliseconds of silence after which a fleet's flying drone is shown as old. */
const STALE_DRONE = 5000;
const CONFIRMING = 30000;
/** Milliseconds after which a command counts as one without an answer. */
const ANSWER = 20000;
const MOST_ORDERS = 20;
const UNKNOWN = { x: null, y: null, z: null };
/** States of a drone that is not in the air. */
export const GROUNDED = new Set(["idle", "preflight", "landed", "aborted"]);
/** States in which no waypoint is flown to any more. */
const ENDING = new Set(["returning", "landing", "landed", "aborted"]);
const OVER = new Set<MissionOut["phase"]>(["landed", "applied", "failed", "cancelled", "refused"]);

export type Word = CommandIn["command"];

/** What the buttons call the commands, and whether a drone was seen to obey. */
export const COMMANDS: Record<Word, { name: string; obeyed(mission: RobotStatus["mission"]): boolean }> = {
  pause: { name: "Hold", obeyed: ({ state }) => state === "paused" },
  resume: { name: "Resume", obeyed: ({ state }) => state !== "paused" },
  "return-home": { name: "Return", obeyed: ({ state }) => ENDING.has(state) && state !== "aborted" },
  clear: { name: "Stop", obeyed: ({ pending, target }) => pending.length === 0 && target === null },
  land: { name: "Land", obeyed: ({ state }) => ENDING.has(state) && state !== "returning" },
};

export interface Sample {
  time: number;
  height: number | null;
  speed: number | null;
  battery: number | null;
}

/** Stages of a command, the least settled first. */
const STAGES = ["refused", "unanswered", "asked", "accepted", "unconfirmed", "done"] as const;
export type Stage = (typeof STAGES)[number];

/** A command to one drone or several, with what became of it. */
export interface Order {
  id: number;
  what: string;
  at: number;
  drones: { robot: string; stage: Stage; text: string; seconds: number | null }[];
  /** What was seen of the drone by which it obeyed; null before. */
  seen(status: RobotStatus): string | null;
}

/** The stage of the drone that is least far. */
export function stageOf({ drones }: Order): Stage {
  return STAGES.find((stage) => drones.some((one) => one.stage === stage)) ?? "done";
}

/** Milliseconds by which the viewer's clock is ahead of the server's, as far as messages show. */
export class ClockOffset {
  private least = Infinity;

  receive(serverNs: number): void {
    this.least = Math.min(this.least, Date.now() - serverNs / 1e6);
  }

  age(serverNs: number): number | null {
    return this.least === Infinity ? null : Math.max(0, Date.now() - this.least - serverNs / 1e6);
  }

  /** Milliseconds until a moment of the server's. */
  until(serverNs: number): number {
    return serverNs / 1e6 - Date.now() + (this.least === Infinity ? 0 : this.least);
  }
}

/** Places of waypoints by id. */
export type Places = Record<string, Spot>;

/** A drone as the map draws it. */
export interface Vehicle {
  id: string;
  /** What its mission says; undefined between missions. */
  status: RobotStatus | undefined;
  /** Waypoints that lie behind it. */
  behind: Places;
  position: Spot | null;
  trail: Spot[];
  stale: boolean;
  /** Class of its colour. */
  tone: string;
}

export class Flight {
  missions: MissionOut[] = [];
  robots: RobotOut[] = [];
  connected = false;
  over = false;
  /** When the state came that is shown, by this machine's clock. */
  heard = Date.now();
  trails = new Map<string, Spot[]>();
  history = new Map<string, Sample[]>();
  orders: Order[] = [];
  log = new AlertLog();
  /** What the analytics scheduler had done by each time. */
  analytics: AnalyticsOut[] = [];
  readonly clock = new ClockOffset();
  /** Where detected objects stand. */
  readonly marks = new GroundMarks();

  constructor(
    first: MissionOut[],
    readonly source: Source,
    readonly changed: () => void,
  ) {
    this.receive({ missions: first, robots: [], now: null });
    source.follow({
      onState: (snapshot) => {
        this.receive(snapshot);
        changed();
      },
      onEnd: () => {
        this.over = true;
        changed();
      },
      onConnected: (connected) => {
        this.connected = connected;
        changed();
      },
    });
  }

  close(): void {
    this.source.close();
  }

  /** The mission that is shown, where only one is. */
  get mission(): MissionOut {
    return this.missions[0] as MissionOut;
  }

  get recorded(): boolean {
    return this.source.kind === "recording";
  }

  /** Whether what is shown may be out of date. */
  get stale(): boolean {
    const silent = Date.now() - this.heard > STALE[this.source.kind];
    return !this.recorded && !this.over && (!this.connected || silent);
  }

  /** Mission seconds of what is shown. */
  get now(): number {
    return Math.max(...this.statuses.map(timeOf), 0);
  }

  get statuses(): RobotStatus[] {
    return this.vehicles().flatMap(({ status }) => status ?? []);
  }

  /** The mission that flies a robot. */
  missionOf(robot: string): MissionOut | undefined {
    if (this.source.kind !== "fleet") return this.mission;
    return this.missions.find((one) => one.phase === "flying" && concerns(one, robot));
  }

  status(robot: string): RobotStatus | undefined {
    return this.missionOf(robot)?.status[robot];
  }

  /** Milliseconds since a robot was heard; null if it never was. */
  age(robot: string): number | null {
    const known = this.robots.find((one) => one.id === robot)?.heard ?? null;
    const heard = this.missionOf(robot)?.told[robot] ?? known;
    return heard === null ? null : this.clock.age(heard * 1e9);
  }

  vehicles(): Vehicle[] {
    if (this.source.kind !== "fleet") {
      return this.mission.robots.map((id, number) => this.vehicle(id, null, `r${number % 6}`));
    }
    return this.robots.map((robot) => {
      const status = this.status(robot.id);
      return this.vehicle(robot.id, robot.position, robot.link === "lost" ? "bad" : toneOf(status));
    });
  }

  private vehicle(id: string, parked: Spot | null, tone: string): Vehicle {
    const status = this.status(id);
    const position = status ? spotOf(status) : parked;
    const silent = this.source.kind === "fleet" && (this.age(id) ?? 0) > STALE_DRONE;
    const stale = this.stale || (status !== undefined && silent);
    const behind = this.missionOf(id)?.places[id] ?? {};
    return { id, status, behind, position, trail: this.trails.get(id) ?? [], stale, tone };
  }

  command(robots: string[], command: Word): void {
    const { name, obeyed } = COMMANDS[command];
    const what = this.source.kind === "fleet" ? `${name} ${robots.join(", ")}` : name;
    this.order(robots, what, "commands", (robot): CommandIn => ({ robot, command }), ({ mission }) =>
      obeyed(mission) ? wordsOf(mission.state) : null,
    );
  }

  /** Add waypoints; `seen` has what shows in the drone's status that this has taken effect. */
  fly(navigation: NavigationIn, what: string, seen: Order["seen"]): void {
    this.order([navigation.robot], what, "navigation", () => navigation, seen);
  }

  rearrange(change: RearrangeIn, what: string, seen: Order["seen"]): void {
    this.order([change.robot], what, "plan", () => change, seen);
  }

  /** The connection by which a robot is flown by hand. */
  controls(robot: string): WebSocket {
    return openSocket(`v1/missions/${this.mission.id}/controls?${new URLSearchParams({ robot })}`);
  }

  readonly acknowledge = (id: number | null): void => {
    this.log.acknowledge(id);
    this.changed();
  };

  private order(
    robots: string[],
    what: string,
    route: string,
    body: (robot: string) => CommandIn | NavigationIn | RearrangeIn,
    seen: Order["seen"],
  ): void {
    const drones = robots.map((robot) => ({ robot, stage: "asked" as Stage, text: "", seconds: null }));
    const order: Order = { id: (this.orders[0]?.id ?? 0) + 1, what, at: Date.now(), drones, seen };
    this.orders = [order, ...this.orders].slice(0, MOST_ORDERS);
    this.changed();
    for (const one of drones) {
      const path = `v1/missions/${this.missionOf(one.robot)?.id}/${route}`;
      ask<Answer>(path, body(one.robot), AbortSignal.timeout(ANSWER))
        .then((answer) => {
          if (one.stage === "asked") one.stage = answer.accepted ? "accepted" : "refused";
          const each = Object.entries(answer.refused).map(([id, why]) => `${id}: ${why}`);
          one.text = [answer.text, ...each].filter(Boolean).join("; ");
        })
        .catch((error: unknown) => {
          one.stage = error instanceof Refused && error.status === 0 ? "unanswered" : "refused";
          one.text = messageOf(error);
        })
        .finally(() => this.changed());
    }
  }

  private receive({ missions, robots, now, past }: Snapshot): void {
    if (now !== null) this.clock.receive(now);
    this.missions = missions;
    this.robots = robots;
    if (past) {
      Object.assign(this, past, { over: false });
      return;
    }
    const fleet = this.source.kind === "fleet";
    this.over = !fleet && OVER.has(this.mission.phase);
    for (const { id, status, position, trail } of this.vehicles()) {
      // A fleet's trails are those of the missions in flight.
      if (!status) this.trails.delete(id);
      else this.extend(id, status, position, trail);
    }
    const ages = fleet ? [] : this.flying().map(({ id }) => this.age(id) ?? 0);
    // A server repeats what it knows of a flight whose process hangs.
    this.heard = Date.now() - Math.max(0, ...ages);
    const sums = fleet ? null : this.mission.analytics;
    if (sums && sums.time >= (this.analytics.at(-1)?.time ?? -SUMS) + SUMS) {
      this.analytics = [...this.analytics, sums].slice(-HISTORY);
    }
    for (const one of missions) {
      if (!fleet) this.log.receive(one.alerts);
      else if (one.phase === "flying") this.log.receive(one.alerts, one.name);
    }
    for (const order of this.orders) this.confirm(order);
  }

  /** The drones in the air. */
  flying(): Vehicle[] {
    return this.vehicles().filter(({ status }) => !GROUNDED.has(status?.mission.state ?? "idle"));
  }

  private extend(robot: string, status: RobotStatus, position: Spot | null, trail: Spot[]): void {
    if (position && isStep(trail.at(-1), position)) {
      trail.push(position);
      this.trails.set(robot, trail.length > TRAIL ? trail.filter((_, n) => n % 2 === 0) : trail);
    }
    const samples = this.history.get(robot) ?? [];
    const newest = samples.at(-1);
    const sample = sampleOf(status);
    if (newest && sample.time <= newest.time + 0.1) return;
    this.history.set(robot, [...samples, sample].slice(-HISTORY));
  }

  private confirm(order: Order): void {
    for (const one of order.drones) {
      if (one.stage !== "accepted") continue;
      const status = this.status(one.robot);
      // A fleet's drone that has no state any more has ended its mission.
      const ended = this.source.kind === "fleet" ? "its mission is over" : null;
      const seen = status ? order.seen(status) : ended;
      if (seen !== null) {
        Object.assign(one, { stage: "done", text: seen, seconds: (Date.now() - order.at) / 1000 });
      } else if (this.over && Date.now() - order.at > CONFIRMING) {
        one.stage = "unconfirmed";
      }
    }
  }
}

/** Follow a source, drawing again at each change; null before the first one. */
export function useFlight(key: string, first: MissionOut[], open: () => Source): Flight | null {
  const [, draw] = useState(0);
  const [flight, setFlight] = useState<Flight | null>(null);
  const changed = useCallback(() => draw((count) => count + 1), []);
  useEffect(() => {
    const opened = new Flight(first, open(), changed);
    setFlight(opened);
    // Silence has to show, too.
    const timer = setInterval(changed, 500);
    return () => {
      clearInterval(timer);
      opened.close();
    };
  }, [key, changed]);
  return flight;
}

/** Whether a mission flies a robot, or is to; one that is attached to another one does not. */
export function concerns({ attach, robots }: MissionOut, robot: string): boolean {
  return attach === null && robots.includes(robot);
}

/** Mission seconds of a message. */
export function secondsOf({ stamp }: { stamp: number }): number {
  return stamp / 1e9;
}

/** Mission seconds of a status. */
export function timeOf({ mission }: RobotStatus): number {
  return secondsOf(mission);
}

/** Where a drone is; null while that is not known. */
export function spotOf({ vehicle }: Pick<RobotStatus, "vehicle">): Spot | null {
  if (!vehicle) return null;
  const { x, y, z } = vehicle.odometry.position;
  return x === null || y === null ? null : [x, y, z ?? 0];
}

export function heightOf(status: Pick<RobotStatus, "vehicle"> | undefined): number | null {
  return status?.vehicle?.odometry.position.z ?? null;
}

/** Charge left, 0 to 1. */
export function chargeOf(status: Pick<RobotStatus, "vehicle"> | undefined): number | null {
  return status?.vehicle?.battery.fraction ?? null;
}

/** What the charts draw of a status. */
function sampleOf(status: RobotStatus): Sample {
  return { time: timeOf(status), height: heightOf(status), speed: speedOf(status), battery: chargeOf(status) };
}

/** Whether a place is far enough from the last one of a trail to be added. */
export function isStep(last: Spot | undefined, [east, north, up]: Spot): boolean {
  return !last || Math.hypot(last[0] - east, last[1] - north, last[2] - up) >= STEP;
}

/** Whether a drone goes home, lands or has landed: its plan is over, whatever is left of it. */
export function isEnding({ mission }: RobotStatus): boolean {
  return ENDING.has(mission.state);
}

/** Waypoints that lie ahead, the one being flown to first. */
export function aheadOf(status: RobotStatus): Waypoint[] {
  if (isEnding(status)) return [];
  const { target, pending } = status.mission;
  return target === null ? pending : [target, ...pending];
}

export function placeOf({ x, y, z }: Waypoint): Spot {
  return [x, y, z];
}

/** Places of a drone's waypoints by id: those behind it, and those ahead. */
export function placesOf({ status, behind }: Pick<Vehicle, "status" | "behind">): Places {
  const { target = null, pending = [] } = status?.mission ?? {};
  const ahead = target === null ? pending : [target, ...pending];
  return { ...behind, ...Object.fromEntries(ahead.map((one) => [one.id, placeOf(one)])) };
}

export function idsOf(waypoints: Waypoint[]): string[] {
  return waypoints.map(({ id }) => id);
}

export function speedOf({ vehicle }: Pick<RobotStatus, "vehicle">): number | null {
  const { x, y, z } = vehicle?.odometry.velocity ?? UNKNOWN;
  return x === null || y === null || z === null ? null : Math.hypot(x, y, z);
}

/** Class of a state's colour. */
export function toneOf(status: RobotStatus | undefined): string {
  if (!status) return "muted";
  const { state } = status.mission;
  if (state === "aborted" || status.vehicle?.mode === "lost") return "bad";
  return ["paused", "returning", "diverted"].includes(state) ? "warn" : "good";
}
