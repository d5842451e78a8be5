// A recorded flight as a data source: the same messages as from the live socket, at any moment.

import { AlertLog } from "./alerts";
import { answered } from "./connection";
import { type Sample, chargeOf, heightOf, isStep, secondsOf, speedOf, spotOf } from "./flight";
import type { Spot } from "./place";
import type { Past, PictureListener, Source, StateListener, Watched } from "./source";
import type { AnalyticsOut, ItemMessage, MissionOut, RecordedOut, RobotStatus, TrackOut, Traffic, Waypoint } from "./wire";

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
    const status: Record<string, RobotStatus> = {};
    const places: MissionOut["places"] = {};
    const past: Past = {
      trails: new Map<string, Spot[]>(),
      history: new Map<string, Sample[]>(),
      log: this.log(),
      analytics: this.flight.analytics,
    };
    for (const [robot, track] of this.tracks) {
      const one = track.at(this.time);
      if (one) status[robot] = one;
      places[robot] = track.placesAt(this.time);
      past.trails.set(robot, track.trail(this.time));
      past.history.set(robot, track.history);
    }
    const robots = this.tracks.map(([robot]) => robot);
    const { name, streams } = this.flight;
    const mission: MissionOut = { ...this.mission, name, robots, status, places, streams };
    this.listener?.onState({ missions: [mission], robots: [], now: null, past });
    for (const one of this.watchers) one();
    this.led?.show(this.time);
  }

  /** Commands and alerts until now. */
  private log(): AlertLog {
    const log = new AlertLog();
    const until = lastBefore(this.flight.alerts, this.time, (one) => secondsOf(one.header));
    for (const { kind, text } of this.flight.alerts.slice(0, until + 1)) log.add(kind, text);
    return log;
  }
}

/** One robot's flight by time. */
class Track {
  readonly history: Sample[];
  private way: { time: number; spot: Spot }[] = [];

  constructor(private readonly track: TrackOut) {
    this.history = track.states.map((vehicle) => ({
      time: secondsOf(vehicle),
      height: heightOf({ vehicle }),
      speed: speedOf({ vehicle }),
      battery: chargeOf({ vehicle }),
    }));
    for (const vehicle of track.states) {
      const spot = spotOf({ vehicle });
      if (spot && isStep(this.way.at(-1)?.spot, spot)) this.way.push({ time: secondsOf(vehicle), spot });
    }
    while (this.way.length > TRAIL) this.way = this.way.filter((_, place) => place % 2 === 0);
  }

  trail(time: number): Spot[] {
    const until = lastBefore(this.way, time, (one) => one.time);
    return this.way.slice(0, until + 1).map((one) => one.spot);
  }

  /** Other aircraft at a time: from their last known place on, at their last known velocity. */
  private trafficAt(time: number): Traffic[] {
    const { states } = this.track;
    let row = lastBefore(states, time, secondsOf);
    while (row > 0 && states[row]?.traffic.length === 0 && time - secondsOf(states[row]!) <= FORGOTTEN) row -= 1;
    const last = states[row];
    if (!last) return [];
    const later = time - secondsOf(last);
    const moved = (from: number | null, speed: number | null) => (from === null ? null : from + later * (speed ?? 0));
    return last.traffic
      .map((one): Traffic => {
        const { position: at, velocity: to } = one;
        const position = { x: moved(at.x, to.x), y: moved(at.y, to.y), z: moved(at.z, to.z) };
        return { ...one, position, age: (one.age ?? 0) + later };
      })
      .filter((one) => (one.age ?? 0) <= FORGOTTEN);
  }

  /** The waypoints of the plan at a time, the target first. */
  private planAt(time: number): Waypoint[] {
    const { plans } = this.track;
    return plans[lastBefore(plans, time, secondsOf)]?.waypoints ?? [];
  }

  /** Places of all waypoints that were known by a time. */
  placesAt(time: number): MissionOut["places"][string] {
    const { plans } = this.track;
    const known = plans.slice(0, lastBefore(plans, time, secondsOf) + 1).flatMap((one) => one.waypoints);
    return Object.fromEntries(known.map(({ id, x, y, z }) => [id, [x, y, z]]));
  }

  at(time: number): RobotStatus | undefined {
    const { states, statuses, ahead } = this.track;
    // A drone is recorded before its first status, which stands for that moment, too.
    const row = Math.max(0, lastBefore(statuses, time, secondsOf));
    const mission = statuses[row];
    if (!mission) return undefined;
    const plan = this.planAt(time);
    const pending = plan.slice(Math.max(0, plan.length - (ahead[row] ?? 0)));
    const vehicle = states[lastBefore(states, time, secondsOf)];
    return {
      mission: { ...mission, pending, stamp: time * 1e9 },
      vehicle: vehicle ? { ...vehicle, traffic: this.trafficAt(time) } : null,
    };
  }
}
