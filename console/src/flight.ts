// The state of one mission as the page knows it, live or recorded: newest status, trails, charts.

import { Refused, ask, openSocket } from "./connection";
import { GroundMarks } from "./ground";
import type { Spot } from "./place";
import type { Past, Source } from "./source";
import type {
  AnalyticsOut,
  Answer,
  CommandIn,
  MissionOut,
  NavigationIn,
  RearrangeIn,
  StatusOut,
  SurveyIn,
  SurveyOut,
} from "./wire";

const TRAIL = 3000;
const STEP = 0.05;
const HISTORY = 1200;
const SUMS = 0.5;
const STALE = 2500;
/** States of a drone that is not in the air. */
export const GROUNDED = new Set(["idle", "preflight", "landed", "aborted"]);
const CONFIRMING = 30000;
/** Milliseconds after which a command counts as one without an answer. */
const ANSWER = 20000;

export type Word = CommandIn["command"];
/** What the buttons call the commands. */
export const NAMES: Record<Word, string> = {
  pause: "Hold",
  resume: "Resume",
  "return-home": "Return",
  clear: "Stop",
  land: "Land",
};

export interface Sample {
  time: number;
  height: number | null;
  speed: number | null;
  battery: number | null;
}

export interface Order {
  id: number;
  robot: string;
  what: string;
  /** asked, accepted by the drone, done as seen in its state, refused with a reason, or without an
   *  answer. */
  stage: "asked" | "accepted" | "done" | "refused" | "unconfirmed" | "unanswered";
  text: string;
  at: number;
  took: number | null;
  seen: (status: StatusOut) => string | null;
}

export interface Alert {
  id: number;
  /** Whose it is, where several flights are shown; empty for the one that is. */
  source: string;
  kind: string;
  text: string;
  count: number;
  acknowledged: boolean;
}

/** States in which no waypoint is flown to any more: the mission's state machine leaves them for the
 *  ground alone. */
const ENDING = new Set(["returning", "landing", "landed", "aborted"]);
/** Whether a drone was seen to obey. */
export const SEEN: Record<Word, (status: StatusOut) => boolean> = {
  pause: (status) => status.state === "paused",
  resume: (status) => status.state !== "paused",
  clear: (status) => status.pending.length === 0 && status.target === null,
  "return-home": ({ state }) => ENDING.has(state) && state !== "aborted",
  land: (status) => ["landing", "landed", "aborted"].includes(status.state),
};

/** Alerts by which a flight records the commands that it was given. */
export const COMMAND_KIND = "console_command";
export const MOST_ALERTS = 100;

/** Alerts, newest first; the commands that a flight was given are a list of their own. */
export class AlertLog {
  alerts: Alert[] = [];
  commands: string[] = [];
  private told = new Map<string, string[]>();

  /** Take the newest alerts that a server tells of a source, oldest first; those that it told before
   *  are known by where they overlap. */
  take(texts: string[], source = ""): void {
    const told = this.told.get(source) ?? [];
    let shared = Math.min(texts.length, told.length);
    const same = (count: number): boolean =>
      told.slice(-count).every((text, place) => text === texts[place]);
    while (shared > 0 && !same(shared)) shared -= 1;
    for (const line of texts.slice(shared)) {
      const [kind = "", ...rest] = line.split(": ");
      this.add(kind, rest.join(": ") || line, source);
    }
    this.told.set(source, texts);
  }

  private add(kind: string, text: string, source: string): void {
    if (kind === COMMAND_KIND) {
      this.commands = [text, ...this.commands].slice(0, MOST_ALERTS);
      return;
    }
    const before = this.alerts.find(
      (one) => one.kind === kind && one.text === text && one.source === source,
    );
    const id = (this.alerts[0]?.id ?? 0) + 1;
    const newest: Alert = { id, source, kind, text, count: 1, acknowledged: false };
    if (before && !before.acknowledged) before.count += 1;
    else this.alerts = [newest, ...this.alerts].slice(0, MOST_ALERTS);
  }

  acknowledge(id: number | null): void {
    for (const one of this.alerts) if (id === null || one.id === id) one.acknowledged = true;
  }
}

/** Milliseconds by which the viewer's clock is ahead of the server's, as far as messages tell. */
export class ClockOffset {
  private least = Infinity;

  take(serverNs: number): void {
    this.least = Math.min(this.least, Date.now() - serverNs / 1e6);
  }

  age(serverNs: number): number | null {
    return this.least === Infinity ? null : Math.max(0, Date.now() - this.least - serverNs / 1e6);
  }
}

export class Flight {
  mission: MissionOut;
  connected = false;
  over = false;
  heard = Date.now();
  trails = new Map<string, Spot[]>();
  history = new Map<string, Sample[]>();
  orders: Order[] = [];
  log = new AlertLog();
  /** What the analytics scheduler had done by each time. */
  analytics: AnalyticsOut[] = [];
  readonly clock = new ClockOffset();
  /** Where what was seen stands. */
  readonly marks = new GroundMarks();
  private orderCount = 0;

  constructor(
    mission: MissionOut,
    readonly source: Source,
    readonly token: string,
    private readonly changed: () => void,
  ) {
    this.mission = mission;
    this.take(mission);
    source.follow({
      mission: (told, now) => {
        this.clock.take(now);
        this.take(told);
        this.changed();
      },
      moment: (told, past) => {
        this.show(told, past);
        this.changed();
      },
      end: () => {
        this.over = true;
        this.changed();
      },
      up: (connected) => {
        this.connected = connected;
        this.changed();
      },
    });
  }

  close(): void {
    this.source.close();
  }

  /** Whether what is shown was recorded. */
  get recorded(): boolean {
    return this.source.recorded;
  }

  /** Whether what is shown may not be so any more. */
  get stale(): boolean {
    return !this.recorded && !this.over && (!this.connected || Date.now() - this.heard > STALE);
  }

  /** Mission seconds of what is shown. */
  get now(): number {
    return Math.max(...Object.values(this.mission.status).map((status) => status.time), 0);
  }

  /** Take what was found in a picture. */
  see(message: Record<string, unknown>): void {
    this.marks.take(message);
    // Of a live flight, the next state draws it.
    if (this.recorded) this.changed();
  }

  status(robot: string): StatusOut | undefined {
    return this.mission.status[robot];
  }

  command(robot: string, command: Word): void {
    const body: CommandIn = { robot, command };
    this.give(robot, NAMES[command], "commands", body, (status) =>
      SEEN[command](status) ? status.state.replace("_", " ") : null,
    );
  }

  visit(navigation: NavigationIn): void {
    const waypoint = navigation.waypoints[0];
    const what = `${waypoint.id}: ${waypoint.x.toFixed(1)} E, ${waypoint.y.toFixed(1)} N`;
    this.fly(navigation, what, (status) =>
      status.visited.includes(waypoint.id) ? "visited" : null,
    );
  }

  /** Add waypoints; `seen` tells from the drone's status when that has taken effect. */
  fly(navigation: NavigationIn, what: string, seen: Order["seen"]): void {
    this.give(navigation.robot, what, "navigation", navigation, seen);
  }

  rearrange(change: RearrangeIn, what: string, seen: Order["seen"]): void {
    this.give(change.robot, what, "plan", change, seen);
  }

  /** Plan a survey; nothing is flown. Throws Refused with the reason. */
  survey(wanted: SurveyIn): Promise<SurveyOut> {
    return ask<SurveyOut>(`v1/missions/${this.mission.id}/survey`, this.token, wanted);
  }

  /** The connection by which a robot is flown by hand. */
  controls(robot: string): WebSocket {
    const query = new URLSearchParams({ robot });
    return openSocket(`v1/missions/${this.mission.id}/controls?${query}`, this.token);
  }

  acknowledge(id: number | null): void {
    this.log.acknowledge(id);
    this.changed();
  }

  private give(
    robot: string,
    what: string,
    route: string,
    body: CommandIn | NavigationIn | RearrangeIn,
    seen: Order["seen"],
  ): void {
    const order: Order = {
      id: (this.orderCount += 1),
      robot,
      what,
      stage: "asked",
      text: "",
      at: Date.now(),
      took: null,
      seen,
    };
    this.orders = [order, ...this.orders].slice(0, 20);
    this.changed();
    const path = `v1/missions/${this.mission.id}/${route}`;
    ask<Answer>(path, this.token, body, AbortSignal.timeout(ANSWER))
      .then((answer) => {
        if (order.stage === "asked") order.stage = answer.accepted ? "accepted" : "refused";
        const each = Object.entries(answer.refused).map(([id, why]) => `${id}: ${why}`);
        order.text = [answer.text, ...each].filter(Boolean).join("; ");
      })
      .catch((error: unknown) => {
        const lost = error instanceof Refused && error.status === 0;
        order.stage = lost ? "unanswered" : "refused";
        order.text = error instanceof Refused ? error.message : String(error);
      })
      .finally(() => this.changed());
  }

  /** Show a moment of a recording, with what came before it. */
  private show(mission: MissionOut, past: Past): void {
    this.mission = mission;
    this.over = false;
    Object.assign(this, past);
  }

  private take(mission: MissionOut): void {
    this.mission = mission;
    this.heard = this.newest(mission);
    this.over = ["landed", "failed", "cancelled", "refused"].includes(mission.phase);
    for (const [robot, status] of Object.entries(mission.status)) this.follow(robot, status);
    const sums = mission.analytics;
    if (sums && sums.time >= (this.analytics.at(-1)?.time ?? -SUMS) + SUMS) {
      this.analytics = [...this.analytics, sums].slice(-HISTORY);
    }
    this.log.take(mission.alerts);
    for (const order of this.orders) this.confirm(order);
  }

  /** When every drone in the air had told something: a server repeats what it knows of a flight
   *  whose process hangs. */
  private newest(mission: MissionOut): number {
    const ages = Object.entries(mission.told)
      .filter(([robot]) => !GROUNDED.has(mission.status[robot]?.state ?? "idle"))
      .map(([, moment]) => this.clock.age(moment * 1e9) ?? 0);
    return Date.now() - Math.max(0, ...ages);
  }

  private follow(robot: string, status: StatusOut): void {
    const [east, north, up] = status.position ?? [];
    if (east != null && north != null) {
      const trail = this.trails.get(robot) ?? [];
      const spot: Spot = [east, north, up ?? 0];
      if (shifted(trail.at(-1), spot)) trail.push(spot);
      this.trails.set(robot, trail.length > TRAIL ? trail.filter((_, n) => n % 2 === 0) : trail);
    }
    const samples = this.history.get(robot) ?? [];
    const newest = samples[samples.length - 1];
    if (!newest || status.time > newest.time + 0.1) {
      samples.push({
        time: status.time,
        height: up ?? null,
        speed: speedOf(status),
        battery: status.battery,
      });
    }
    this.history.set(robot, samples.slice(-HISTORY));
  }

  private confirm(order: Order): void {
    const status = this.mission.status[order.robot];
    if (!status || order.stage !== "accepted") return;
    const seen = order.seen(status);
    if (seen !== null) {
      order.stage = "done";
      order.text = seen;
      order.took = Date.now() - order.at;
    } else if (this.over && Date.now() - order.at > CONFIRMING) {
      order.stage = "unconfirmed";
    }
  }
}

/** Whether a place is far enough from the last one of a trail to be one of its own. */
export function shifted(last: Spot | undefined, [east, north, up]: Spot): boolean {
  return !last || Math.hypot(last[0] - east, last[1] - north, last[2] - up) >= STEP;
}

/** Whether a drone goes home, lands or has landed: its plan is over, whatever is left of it. */
export function ending({ state }: StatusOut): boolean {
  return ENDING.has(state);
}

/** Waypoints that lie ahead, the one being flown to first. */
export function aheadOf(status: StatusOut): string[] {
  if (ending(status)) return [];
  return status.target === null ? status.pending : [status.target, ...status.pending];
}

export function speedOf(status: Pick<StatusOut, "velocity">): number | null {
  const [east, north, up] = status.velocity ?? [];
  return east == null || north == null || up == null ? null : Math.hypot(east, north, up);
}
