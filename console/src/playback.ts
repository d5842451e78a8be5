// A recorded flight as a source: the same words as from the live socket, at any moment asked for.

import { answered } from "./connection";
import {
  type Alert,
  AlertLog,
  COMMAND_KIND,
  MOST_ALERTS,
  type Sample,
  shifted,
  speedOf,
} from "./flight";
import type { Spot } from "./place";
import type { FlightEars, ItemEars, Past, Source, Wanted } from "./source";
import type { AnalyticsOut, MissionOut, RecordedOut, StatusOut, TrackOut, TrafficOut } from "./wire";

/** Milliseconds between two moments shown while it plays, and between two pictures asked for. */
const STEP = 50;
const TRAIL = 3000;
const LONGEST_STEP = 0.25;
const NEWLINE = 10;
/** Seconds after which another aircraft is forgotten, as a vehicle forgets it. */
const FORGOTTEN = 10;

/** Seconds of its beginning that a recording may be opened after, so that its camera shows something. */
const OPENING = 10;

/** Where a recording is opened: at its first picture, if that comes early. */
function openingOf({ begin, pictured }: RecordedOut): number {
  return pictured !== null && pictured < begin + OPENING ? pictured : begin;
}

/** Place of the last of some times at or before `time`; -1 for none. */
export function lastBefore<T>(items: readonly T[], time: number, of: (item: T) => number): number {
  let [low, high] = [0, items.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (of(items[middle] as T) <= time) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

export class Playback implements Source {
  readonly recorded = true;
  time: number;
  playing = false;
  speed = 1;
  private ears: FlightEars | undefined;
  private readonly watchers = new Set<() => void>();
  private readonly tracks: [string, Track][];
  private asked = 0;
  private shown = 0;
  private before = 0;
  private led: Playback | undefined;
  private leader: Playback | undefined;

  constructor(
    private readonly mission: MissionOut,
    readonly flight: RecordedOut,
    private readonly token: string,
    begin: number | null,
  ) {
    this.tracks = Object.entries(flight.tracks).map(([robot, one]) => [robot, new Track(one)]);
    this.time = this.within(begin ?? openingOf(flight));
  }

  follow(ears: FlightEars): void {
    this.ears = ears;
    ears.up(true);
    this.tell();
  }

  /** Have another recording show the same mission time from now on; it takes no time of its own. */
  lead(other: Playback): void {
    this.led = other;
    other.leader = this;
    this.time = this.within(this.time);
    this.tell();
  }

  /** Mission seconds at which there is something to be seen for the first time. */
  get begin(): number {
    return Math.min(this.flight.begin, this.led?.flight.begin ?? Infinity);
  }

  /** Mission seconds after which nothing more is to be seen. */
  get end(): number {
    return Math.max(this.flight.end, this.led?.flight.end ?? -Infinity);
  }

  seek(time: number): void {
    if (this.leader) this.leader.seek(time);
    else this.show(time);
  }

  play(): void {
    if (this.time >= this.end) this.time = this.begin;
    this.playing = true;
    this.before = performance.now();
    cancelAnimationFrame(this.asked);
    this.asked = requestAnimationFrame(this.turn);
    this.tell();
  }

  pause(): void {
    this.playing = false;
    cancelAnimationFrame(this.asked);
    this.tell();
  }

  close(): void {
    this.playing = false;
    cancelAnimationFrame(this.asked);
    this.ears = undefined;
  }

  /** What was decided by a moment: the last sums at or before it. */
  sums(): AnalyticsOut | undefined {
    const rows = this.flight.analytics;
    return rows[lastBefore(rows, this.time, (one) => one.time)];
  }

  watch({ camera, depth }: Wanted, ears: ItemEars): () => void {
    const gone = new AbortController();
    let shown = -1;
    let busy = false;
    const look = async (): Promise<void> => {
      if (busy) return;
      busy = true;
      while (!gone.signal.aborted && shown !== this.time) {
        const began = performance.now();
        shown = this.time;
        await this.picture(camera, depth, shown, ears, gone.signal).catch(() => undefined);
        const rest = STEP - (performance.now() - began);
        if (rest > 0) await new Promise((done) => setTimeout(done, rest));
      }
      busy = false;
    };
    const changed = () => void look();
    this.watchers.add(changed);
    changed();
    return () => {
      this.watchers.delete(changed);
      gone.abort();
    };
  }

  private async picture(
    camera: string,
    depth: boolean,
    time: number,
    ears: ItemEars,
    signal: AbortSignal,
  ): Promise<void> {
    const at = String(Math.max(0, Math.round(time * 1e9)));
    const query = new URLSearchParams({ stream: camera, at, depth: String(depth) });
    const path = `v1/missions/${this.mission.id}/playback/picture?${query}`;
    const answer = await answered(path, this.token, undefined, signal);
    const data = await answer.arrayBuffer();
    if (signal.aborted) return;
    const end = new Uint8Array(data).indexOf(NEWLINE);
    const text = new TextDecoder().decode(new Uint8Array(data, 0, end));
    const messages = JSON.parse(text) as Record<string, unknown>[];
    if (messages.length === 0) ears.nothing();
    let from = end + 1;
    for (const message of messages) {
      if (message["blob"] === true) {
        const [size = 0] = (message["item"] as { bytes: number[] }).bytes;
        await ears.picture(message, data.slice(from, from + size));
        from += size;
      } else ears.found(message);
    }
  }

  private readonly turn = (now: number): void => {
    if (!this.playing) return;
    this.asked = requestAnimationFrame(this.turn);
    // A tab in the background does not run on.
    const step = Math.min(LONGEST_STEP, Math.max(0, (now - this.before) / 1000));
    this.before = now;
    this.time = this.within(this.time + step * this.speed);
    if (this.time >= this.end) this.pause();
    else if (now - this.shown >= STEP) this.tell();
  };

  private show(time: number): void {
    this.time = this.within(time);
    this.tell();
  }

  private within(time: number): number {
    return Math.min(this.end, Math.max(this.begin, time));
  }

  private tell(): void {
    this.shown = performance.now();
    const status: Record<string, StatusOut> = {};
    const past: Past = {
      trails: new Map<string, Spot[]>(),
      history: new Map<string, Sample[]>(),
      log: this.log(),
      analytics: this.flight.analytics,
    };
    for (const [robot, track] of this.tracks) {
      const one = track.at(this.time);
      if (one) status[robot] = one;
      past.trails.set(robot, track.trail(this.time));
      past.history.set(robot, track.history);
    }
    const robots = this.tracks.map(([robot]) => robot);
    const { name, streams } = this.flight;
    this.ears?.moment({ ...this.mission, name, robots, status, streams }, past);
    for (const one of this.watchers) one();
    this.led?.show(this.time);
  }

  /** Commands and alerts until now, the newest first; an alert that repeats itself counts up. */
  private log(): AlertLog {
    const known = new Map<string, Alert>();
    const commands: string[] = [];
    const until = lastBefore(this.flight.alerts, this.time, (one) => one.time);
    for (const { kind, text } of this.flight.alerts.slice(0, until + 1)) {
      if (kind === COMMAND_KIND) {
        commands.push(text);
        continue;
      }
      const key = `${kind}: ${text}`;
      const before = known.get(key);
      known.delete(key);
      const count = (before?.count ?? 0) + 1;
      known.set(key, { id: known.size + 1, source: "", kind, text, count, acknowledged: true });
    }
    const newest = <T>(list: T[]) => list.reverse().slice(0, MOST_ALERTS);
    return Object.assign(new AlertLog(), {
      alerts: newest([...known.values()]),
      commands: newest(commands),
    });
  }
}

/** One robot's flight by time. */
class Track {
  readonly history: Sample[];
  private way: { time: number; spot: Spot }[] = [];

  constructor(private readonly track: TrackOut) {
    this.history = track.time.map((time, row) => ({
      time,
      height: track.position[row]?.[2] ?? null,
      speed: speedOf({ velocity: track.velocity[row] ?? null }),
      battery: track.battery[row] ?? null,
    }));
    track.time.forEach((time, row) => {
      const [east, north, up] = track.position[row] ?? [];
      if (east == null || north == null) return;
      const spot: Spot = [east, north, up ?? 0];
      if (shifted(this.way.at(-1)?.spot, spot)) this.way.push({ time, spot });
    });
    while (this.way.length > TRAIL) this.way = this.way.filter((_, place) => place % 2 === 0);
  }

  trail(time: number): Spot[] {
    const until = lastBefore(this.way, time, (one) => one.time);
    return this.way.slice(0, until + 1).map((one) => one.spot);
  }

  /** Other aircraft at a time: where the last word put them, and on from there. */
  private heard(time: number): TrafficOut[] {
    const last = this.track.traffic[lastBefore(this.track.traffic, time, (one) => one.since)];
    const later = time - (last?.since ?? 0);
    // Where the recording has no states any more, nothing is heard either.
    return (last?.aircraft ?? [])
      .map(({ position: [east, north, up], velocity, age, ...one }): TrafficOut => {
        const [ve, vn, vu] = velocity;
        const high = up === null ? null : up + later * vu;
        return { ...one, velocity, position: [east + later * ve, north + later * vn, high], age: age + later };
      })
      .filter((one) => one.age <= FORGOTTEN);
  }

  at(time: number): StatusOut | undefined {
    const { statuses, places } = this.track;
    const status = statuses[lastBefore(statuses, time, (one) => one.time)];
    const row = lastBefore(this.track.time, time, (one) => one);
    if (!status) return undefined;
    const until = lastBefore(places, time, (one) => one.since);
    const known = places.slice(0, until + 1).map((one) => [one.id, one.place] as const);
    return {
      ...status,
      time,
      measured: this.track.time[row] ?? null,
      position: this.track.position[row] ?? null,
      velocity: this.track.velocity[row] ?? null,
      yaw: this.track.yaw[row] ?? null,
      roll: this.track.roll[row] ?? null,
      pitch: this.track.pitch[row] ?? null,
      battery: this.track.battery[row] ?? null,
      distance: this.track.distance[row] ?? 0,
      outlook: this.track.outlook[row] ?? null,
      satellites: this.track.gps[row]?.satellites ?? null,
      position_sigma: this.track.gps[row]?.position_sigma ?? null,
      places: Object.fromEntries(known),
      traffic: this.heard(time),
    };
  }
}
