// A recorded flight as a data source: the same messages as from the live socket, at any moment.

import { AlertLog } from "./alerts";
import { answered } from "./connection";
import { type Sample, isStep, speedOf, spotOf } from "./flight";
import type { Spot } from "./place";
import type { Past, PictureListener, Source, StateListener, Watched } from "./source";
import type { AnalyticsOut, ItemMessage, MissionOut, RecordedOut, StatusOut, TrackOut, TrafficOut } from "./wire";

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
  readonly kind = "recording";
  time: number;
  playing = false;
  speed = 1;
  private listener: StateListener | undefined;
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
    begin: number | null,
  ) {
    this.tracks = Object.entries(flight.tracks).map(([robot, one]) => [robot, new Track(one)]);
    this.time = this.within(begin ?? openingOf(flight));
  }

  follow(listener: StateListener): void {
    this.listener = listener;
    listener.onConnected(true);
    this.publish();
  }

  /** Have another recording show the same mission time from now on; it takes no time of its own. */
  lead(other: Playback): void {
    this.led = other;
    other.leader = this;
    this.time = this.within(this.time);
    this.publish();
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
    this.asked = requestAnimationFrame(this.onFrame);
    this.publish();
  }

  pause(): void {
    this.playing = false;
    cancelAnimationFrame(this.asked);
    this.publish();
  }

  close(): void {
    this.playing = false;
    cancelAnimationFrame(this.asked);
    this.listener = undefined;
  }

  /** What was decided by a moment: the last sums at or before it. */
  sums(): AnalyticsOut | undefined {
    const rows = this.flight.analytics;
    return rows[lastBefore(rows, this.time, (one) => one.time)];
  }

  watch({ camera, depth }: Watched, listener: PictureListener): () => void {
    const gone = new AbortController();
    let shown = -1;
    let busy = false;
    const load = async (): Promise<void> => {
      if (busy) return;
      busy = true;
      while (!gone.signal.aborted && shown !== this.time) {
        const began = performance.now();
        shown = this.time;
        await this.loadPicture(camera, depth, listener, gone.signal).catch(() => undefined);
        const rest = STEP - (performance.now() - began);
        if (rest > 0) await new Promise((done) => setTimeout(done, rest));
      }
      busy = false;
    };
    const onTime = () => void load();
    this.watchers.add(onTime);
    onTime();
    return () => {
      this.watchers.delete(onTime);
      gone.abort();
    };
  }

  private async loadPicture(
    camera: string,
    depth: boolean,
    listener: PictureListener,
    signal: AbortSignal,
  ): Promise<void> {
    const at = String(Math.max(0, Math.round(this.time * 1e9)));
    const query = new URLSearchParams({ stream: camera, at, depth: String(depth) });
    const path = `v1/missions/${this.mission.id}/playback/picture?${query}`;
    const data = await (await answered(path, undefined, signal)).arrayBuffer();
    if (signal.aborted) return;
    const end = new Uint8Array(data).indexOf(NEWLINE);
    const text = new TextDecoder().decode(new Uint8Array(data, 0, end));
    const messages = JSON.parse(text) as ItemMessage[];
    if (messages.length === 0) listener.onNothing();
    let from = end + 1;
    for (const message of messages) {
      const size = "bytes" in message.item ? message.item.bytes[0] : 0;
      await listener.onItem(message, data.slice(from, from + size));
      from += size;
    }
  }

  private readonly onFrame = (now: number): void => {
    if (!this.playing) return;
    this.asked = requestAnimationFrame(this.onFrame);
    // A tab in the background does not run on.
    const step = Math.min(LONGEST_STEP, Math.max(0, (now - this.before) / 1000));
    this.before = now;
    this.time = this.within(this.time + step * this.speed);
    if (this.time >= this.end) this.pause();
    else if (now - this.shown >= STEP) this.publish();
  };

  private show(time: number): void {
    this.time = this.within(time);
    this.publish();
  }

  private within(time: number): number {
    return Math.min(this.end, Math.max(this.begin, time));
  }

  private publish(): void {
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
    const mission = { ...this.mission, name, robots, status, streams };
    this.listener?.onState({ missions: [mission], robots: [], now: null, past });
    for (const one of this.watchers) one();
    this.led?.show(this.time);
  }

  /** Commands and alerts until now. */
  private log(): AlertLog {
    const log = new AlertLog();
    const until = lastBefore(this.flight.alerts, this.time, (one) => one.time);
    for (const { kind, text } of this.flight.alerts.slice(0, until + 1)) log.add(kind, text);
    return log;
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
      const spot = spotOf({ position: track.position[row] ?? null });
      if (spot && isStep(this.way.at(-1)?.spot, spot)) this.way.push({ time, spot });
    });
    while (this.way.length > TRAIL) this.way = this.way.filter((_, place) => place % 2 === 0);
  }

  trail(time: number): Spot[] {
    const until = lastBefore(this.way, time, (one) => one.time);
    return this.way.slice(0, until + 1).map((one) => one.spot);
  }

  /** Other aircraft at a time: from their last known place on, at their last known velocity. */
  private trafficAt(time: number): TrafficOut[] {
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
      traffic: this.trafficAt(time),
    };
  }
}
