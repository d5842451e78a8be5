// The timeline of a recording: states, waypoints visited, alerts, decisions; play, seek and link.

import { useEffect, useLayoutEffect, useMemo, useState } from "preact/hooks";
import "./timeline.css";
import { writeFragment } from "./connection";
import { lastBefore, type Playback } from "./playback";
import type { AnalyticsOut, RecordedOut, StatusOut } from "./wire";

const SPEEDS = [0.25, 0.5, 1, 2, 4, 8, 16];
const STEP = 1;
const LEAP = 10;
const BINS = 120;
/** Share of the timeline below which a band is not drawn by itself. */
const NARROW = 0.001;
const TICKS = 6;
/** Seconds before an event at which it is sought, so that it is seen to come. */
const LEAD = 0.05;
/** Milliseconds after which the address follows the moment shown. */
const REST = 250;

interface Band {
  state: string;
  begin: number;
  end: number;
}

export function Timeline({ playback, robot }: { playback: Playback; robot: string }) {
  const { flight } = playback;
  const [copied, setCopied] = useState(false);
  const statuses = flight.tracks[robot]?.statuses ?? [];
  const bands = useMemo(() => bandsOf(statuses, flight), [statuses, flight]);
  const visits = useMemo(() => visitsOf(statuses), [statuses]);
  const bins = useMemo(() => binsOf(flight.analytics, flight), [flight]);
  const events = useMemo(
    () =>
      [
        ...bands.map((one) => one.begin),
        ...visits.map((one) => one.time),
        ...flight.alerts.map((one) => one.time),
      ].sort((one, other) => one - other),
    [bands, visits, flight],
  );
  const length = Math.max(flight.end - flight.begin, 0.001);
  const share = (time: number) => `${(100 * (time - flight.begin)) / length}%`;
  const toEvent = (ahead: boolean) => {
    const now = lastBefore(events, playback.time, (one) => one);
    const place = ahead ? now + 1 : lastBefore(events, playback.time - 2 * LEAD, (one) => one);
    playback.seek(events[place] ?? (ahead ? flight.end : flight.begin));
  };
  const toggle = () => (playback.playing ? playback.pause() : playback.play());

  // Before it is painted: who sees the timeline can use its keys.
  useLayoutEffect(() => {
    const keys: Record<string, (event: KeyboardEvent) => void> = {
      " ": toggle,
      ArrowLeft: (event) => playback.seek(playback.time - (event.shiftKey ? LEAP : STEP)),
      ArrowRight: (event) => playback.seek(playback.time + (event.shiftKey ? LEAP : STEP)),
      Home: () => playback.seek(flight.begin),
      End: () => playback.seek(flight.end),
      "[": () => toEvent(false),
      "]": () => toEvent(true),
    };
    const press = (event: KeyboardEvent) => {
      const act = keys[event.key];
      if (!act || event.ctrlKey || event.metaKey || event.altKey || taken(event)) return;
      event.preventDefault();
      act(event);
    };
    document.addEventListener("keydown", press);
    return () => document.removeEventListener("keydown", press);
  });

  // The address is a link to the moment at which it rests.
  const resting = playback.playing ? null : playback.time.toFixed(2);
  useEffect(() => {
    if (resting === null) return;
    // Browsers refuse to change it as often as a slider moves.
    const timer = setTimeout(() => writeFragment({ t: resting }), REST);
    return () => clearTimeout(timer);
  }, [resting]);
  useEffect(() => setCopied(false), [resting]);
  useEffect(() => {
    const follow = () => {
      const time = momentOfLink();
      if (time !== null) playback.seek(time);
    };
    addEventListener("hashchange", follow);
    return () => removeEventListener("hashchange", follow);
  }, [playback]);

  const state = bands[lastBefore(bands, playback.time, (one) => one.begin)]?.state ?? "";
  const said = `${playback.time.toFixed(1)} of ${flight.end.toFixed(1)} seconds${state && `, ${state}`}`;
  return (
    <section class="card timeline" aria-label="Playback">
      <div class="player">
        <button
          type="button"
          title="Event before ([)"
          aria-label="Event before"
          onClick={() => toEvent(false)}
        >
          <Skip ahead={false} />
        </button>
        <button
          type="button"
          class="primary"
          title="Play or pause (space)"
          data-testid="play"
          onClick={toggle}
        >
          {playback.playing ? "Pause" : "Play"}
        </button>
        <button
          type="button"
          title="Next event (])"
          aria-label="Next event"
          onClick={() => toEvent(true)}
        >
          <Skip ahead />
        </button>
        <select
          aria-label="Speed"
          value={String(playback.speed)}
          onChange={(event) => {
            playback.speed = Number(event.currentTarget.value);
          }}
        >
          {SPEEDS.map((speed) => (
            <option key={speed} value={String(speed)}>
              {speed} ×
            </option>
          ))}
        </select>
        <output class="time" data-testid="time" data-time={playback.time}>
          {clock(playback.time)} <small>of {clock(flight.end)}</small>
        </output>
        <span class="grow" />
        <button
          type="button"
          title="Copy a link to this moment; who opens it needs a token of their own"
          onClick={() => {
            writeFragment({ t: playback.time.toFixed(2) });
            void navigator.clipboard?.writeText(location.href).then(() => setCopied(true));
          }}
        >
          {copied ? "Copied" : "Link"}
        </button>
      </div>
      <div
        class="lanes"
        onPointerDown={(event) => {
          event.currentTarget.setPointerCapture(event.pointerId);
          playback.seek(timeAt(event, flight));
        }}
        onPointerMove={(event) => {
          if (event.buttons) playback.seek(timeAt(event, flight));
        }}
      >
        <svg aria-hidden="true" width="100%" height="66">
          {bands.map((band) => (
            <svg
              key={band.begin}
              x={share(band.begin)}
              width={`${(100 * (band.end - band.begin)) / length}%`}
              y="0"
              height="22"
            >
              <title>{`${band.state} from ${band.begin.toFixed(1)} s`}</title>
              <rect class={`band ${band.state}`} width="100%" height="100%" />
              <text x="5" y="15">
                {band.state.replaceAll("_", " ")}
              </text>
            </svg>
          ))}
          {bins.map((bin) => (
            <g key={bin.time}>
              <rect class="bad" x={share(bin.time)} y="24" width={bin.width} height="14" />
              <rect
                class="good"
                x={share(bin.time)}
                y={38 - 14 * bin.inTime}
                width={bin.width}
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
            <svg key={place} x={share(alert.time)} y="40" class="alert">
              <title>{`${alert.time.toFixed(1)} s ${alert.kind}: ${alert.text}`}</title>
              <path d="M0 0l5 9h-10z" />
            </svg>
          ))}
          {ticksOf(flight).map((tick) => (
            <text key={tick} class="tick" x={share(tick)} y="64">
              {clock(tick).replace(/\.0$/, "")}
            </text>
          ))}
          <svg x={share(playback.time)} class="now">
            <path d="M0 0V52" />
          </svg>
        </svg>
      </div>
      <input
        type="range"
        class="seek"
        aria-label="Mission time"
        aria-valuetext={said}
        min={flight.begin}
        max={flight.end}
        step="any"
        value={playback.time}
        data-testid="seek"
        onInput={(event) => playback.seek(Number(event.currentTarget.value))}
      />
      {flight.remark && (
        <p class="hint" data-testid="remark">
          Of this recording, {flight.remark}.
        </p>
      )}
    </section>
  );
}

function Skip({ ahead }: { ahead: boolean }) {
  return (
    <svg class="skip" width="14" height="14" viewBox="0 0 14 14" aria-hidden="true">
      <path d={ahead ? "M1 1l8 6-8 6zM10 1h3v12h-3z" : "M13 1L5 7l8 6zM4 1H1v12h3z"} />
    </svg>
  );
}

/** The moment that the address names, mission seconds; null for none. */
export function momentOfLink(): number | null {
  const text = new URLSearchParams(location.hash.slice(1)).get("t");
  const time = text === null ? NaN : Number(text);
  return Number.isFinite(time) ? time : null;
}

/** Whether what has the focus takes a key for itself. */
function taken(event: KeyboardEvent): boolean {
  const at = event.target;
  if (!(at instanceof HTMLElement)) return false;
  if (at instanceof HTMLInputElement) return at.type !== "range";
  if (at instanceof HTMLButtonElement) return event.key === " ";
  return at.closest("select, textarea, .mapbox") !== null;
}

function timeAt(event: PointerEvent, flight: RecordedOut): number {
  const box = (event.currentTarget as HTMLElement).getBoundingClientRect();
  const share = (event.clientX - box.left) / Math.max(1, box.width);
  return flight.begin + share * (flight.end - flight.begin);
}

function bandsOf(statuses: StatusOut[], flight: RecordedOut): Band[] {
  const bands: Band[] = [];
  const least = NARROW * (flight.end - flight.begin);
  for (const one of statuses) {
    const last = bands.at(-1);
    if (last?.state === one.state) continue;
    if (last && one.time - last.begin < least) {
      // What is too short to be seen gives way to what follows.
      last.state = one.state;
      continue;
    }
    if (last) last.end = one.time;
    bands.push({ state: one.state, begin: one.time, end: flight.end });
  }
  return bands;
}

function visitsOf(statuses: StatusOut[]): { id: string; time: number }[] {
  const visits: { id: string; time: number }[] = [];
  let before = 0;
  for (const one of statuses) {
    const fresh = Math.min(one.waypoints_visited - before, one.visited.length);
    if (fresh > 0) for (const id of one.visited.slice(-fresh)) visits.push({ id, time: one.time });
    before = Math.max(before, one.waypoints_visited);
  }
  return visits;
}

/** How many of the tasks that ended in each part of the flight did so in time, 0 to 1. */
function binsOf(
  rows: AnalyticsOut[],
  flight: RecordedOut,
): { time: number; width: string; inTime: number }[] {
  const length = (flight.end - flight.begin) / BINS;
  if (rows.length === 0 || length <= 0) return [];
  const sums = (time: number) => rows[lastBefore(rows, time, (one) => one.time)];
  return Array.from({ length: BINS }, (_, place) => flight.begin + place * length).flatMap((time) => {
    const [from, to] = [sums(time), sums(time + length)];
    const inTime = (to?.in_time ?? 0) - (from?.in_time ?? 0);
    const others =
      (to?.late ?? 0) + (to?.dropped ?? 0) - (from?.late ?? 0) - (from?.dropped ?? 0);
    if (inTime + others <= 0) return [];
    return [{ time, width: `${100 / BINS}%`, inTime: inTime / (inTime + others) }];
  });
}

function ticksOf(flight: RecordedOut): number[] {
  const least = (flight.end - flight.begin) / TICKS;
  const steps = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200];
  const step = steps.find((one) => one >= least) ?? least;
  const count = Math.floor(flight.end / step);
  return Array.from({ length: count }, (_, place) => (place + 1) * step).filter(
    (one) => one > flight.begin && one < flight.end - step / 4,
  );
}

function clock(seconds: number): string {
  const whole = Math.floor(seconds);
  const rest = Math.floor((seconds - whole) * 10);
  const pad = (number: number) => String(number).padStart(2, "0");
  const hours = Math.floor(whole / 3600);
  const minutes = Math.floor((whole % 3600) / 60);
  return `${hours ? `${hours}:${pad(minutes)}` : minutes}:${pad(whole % 60)}.${rest}`;
}
