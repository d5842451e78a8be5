// The lanes of a timeline: one recorded drone's states, decisions, waypoints visited and alerts.

import { useMemo } from "preact/hooks";
import { secondsOf } from "./flight";
import { lastBefore } from "./playback";
import { clock, wordsOf } from "./words";
import type { AnalyticsOut, MissionStatus, RecordedOut } from "./wire";

const BINS = 120;
/** Share of the timeline below which a band is not drawn by itself. */
const NARROW = 0.001;
const TICKS = 6;
/** Pixels beside the lanes, and of a letter in them. */
const MARGIN = 60;
const LETTER = 6.5;

export interface RecordedDrone {
  flight: RecordedOut;
  robot: string;
}

interface Band {
  state: string;
  begin: number;
  end: number;
}

export interface LanesProps {
  drone: RecordedDrone;
  /** Mission seconds at both ends of the timeline, which may be longer than this flight. */
  begin: number;
  end: number;
  now: number;
  /** Whether the times are written below. */
  ticks: boolean;
}

export function Lanes({ drone, begin, end, now, ticks }: LanesProps) {
  const { flight } = drone;
  const statuses = statusesOf(drone);
  const bands = useMemo(() => bandsOf(statuses, flight), [statuses, flight]);
  const visits = useMemo(() => visitsOf(statuses), [statuses]);
  const bins = useMemo(() => binsOf(flight.analytics, flight), [flight]);
  const whole = Math.max(end - begin, 0.001);
  const share = (time: number) => `${(100 * (time - begin)) / whole}%`;
  const width = (seconds: number) => `${(100 * seconds) / whole}%`;
  const fits = ({ state, begin: from, end: to }: Band) =>
    ((to - from) / whole) * (innerWidth - MARGIN) > LETTER * (state.length + 1);
  return (
    <svg aria-hidden="true" width="100%" height={ticks ? 66 : 52}>
      {bands.map((band) => (
        <svg
          key={band.begin}
          x={share(band.begin)}
          width={width(band.end - band.begin)}
          y="0"
          height="22"
        >
          <title>{`${band.state} from ${band.begin.toFixed(1)} s`}</title>
          <rect class={`band ${band.state}`} width="100%" height="100%" />
          {fits(band) && (
            <text x="5" y="15">{wordsOf(band.state)}</text>
          )}
        </svg>
      ))}
      {bins.map((bin) => (
        <g key={bin.time}>
          <rect class="bad" x={share(bin.time)} y="24" width={width(bin.length)} height="14" />
          <rect
            class="good"
            x={share(bin.time)}
            y={38 - 14 * bin.inTime}
            width={width(bin.length)}
            height={14 * bin.inTime}
          />
        </g>
      ))}
      {visits.map((visit) => (
        <svg key={`${visit.id} ${visit.time}`} x={share(visit.time)} y="30" class="visit">
          <title>{`${visit.id} visited at ${visit.time.toFixed(1)} s`}</title>
          <circle r="5" />
        </svg>
      ))}
      {flight.alerts.map((alert, place) => (
        <svg key={place} x={share(secondsOf(alert.header))} y="40" class="alert">
          <title>{`${secondsOf(alert.header).toFixed(1)} s ${alert.kind}: ${alert.text}`}</title>
          <path d="M0 0l5 9h-10z" />
        </svg>
      ))}
      {(ticks ? ticksOf(begin, end) : []).map((tick) => (
        <text key={tick} class="tick" x={share(tick)} y="64">{clock(tick)}</text>
      ))}
      <svg x={share(now)} class="now">
        <path d="M0 0V52" />
      </svg>
    </svg>
  );
}

/** Moments of a drone's flight that are worth seeing, mission seconds in no order. */
export function eventsOf(drone: RecordedDrone): number[] {
  const statuses = statusesOf(drone);
  return [
    ...bandsOf(statuses, drone.flight).map((one) => one.begin),
    ...visitsOf(statuses).map((one) => one.time),
    ...drone.flight.alerts.map((one) => secondsOf(one.header)),
  ];
}

/** The state at a moment, in words; empty before the first one. */
export function stateAt(drone: RecordedDrone, time: number): string {
  const statuses = statusesOf(drone);
  const status = statuses[lastBefore(statuses, time, secondsOf)];
  return status ? wordsOf(status.state) : "";
}

const NONE: MissionStatus[] = [];

function statusesOf({ flight, robot }: RecordedDrone): MissionStatus[] {
  return flight.tracks[robot]?.statuses ?? NONE;
}

function bandsOf(statuses: MissionStatus[], flight: RecordedOut): Band[] {
  const bands: Band[] = [];
  const least = NARROW * (flight.end - flight.begin);
  for (const one of statuses) {
    const [last, time] = [bands.at(-1), secondsOf(one)];
    if (last?.state === one.state) continue;
    if (last && time - last.begin < least) {
      // What is too short to be seen gives way to what follows.
      last.state = one.state;
      continue;
    }
    if (last) last.end = time;
    bands.push({ state: one.state, begin: time, end: flight.end });
  }
  return bands;
}

function visitsOf(statuses: MissionStatus[]): { id: string; time: number }[] {
  const visits: { id: string; time: number }[] = [];
  let before = 0;
  for (const one of statuses) {
    const fresh = Math.min(one.visits - before, one.visited.length);
    if (fresh > 0) for (const id of one.visited.slice(-fresh)) visits.push({ id, time: secondsOf(one) });
    before = Math.max(before, one.visits);
  }
  return visits;
}

/** How many of the tasks that ended in each part of the flight did so in time, 0 to 1. */
function binsOf(
  rows: AnalyticsOut[],
  flight: RecordedOut,
): { time: number; length: number; inTime: number }[] {
  const length = (flight.end - flight.begin) / BINS;
  if (rows.length === 0 || length <= 0) return [];
  const sums = (time: number) => rows[lastBefore(rows, time, (one) => one.time)];
  return Array.from({ length: BINS }, (_, place) => flight.begin + place * length).flatMap((time) => {
    const [from, to] = [sums(time), sums(time + length)];
    const inTime = (to?.in_time ?? 0) - (from?.in_time ?? 0);
    const others =
      (to?.late ?? 0) + (to?.dropped ?? 0) - (from?.late ?? 0) - (from?.dropped ?? 0);
    if (inTime + others <= 0) return [];
    return [{ time, length, inTime: inTime / (inTime + others) }];
  });
}

function ticksOf(begin: number, end: number): number[] {
  const least = (end - begin) / TICKS;
  const steps = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200];
  const step = steps.find((one) => one >= least) ?? least;
  const count = Math.floor(end / step);
  return Array.from({ length: count }, (_, place) => (place + 1) * step).filter(
    (one) => one > begin && one < end - step / 4,
  );
}
