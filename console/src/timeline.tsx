// The timeline of a recording: states, waypoints visited, alerts, decisions; play, seek and link.

import { useEffect, useMemo, useState } from "preact/hooks";
import "./timeline.css";
import { readFragment, writeFragment } from "./connection";
import { Lanes, type RecordedDrone, eventsOf, stateAt } from "./lanes";
import { lastBefore, type Playback } from "./playback";
import { Button, Select, useEvent } from "./widgets";
import { clock } from "./words";

const SPEEDS = [0.25, 0.5, 1, 2, 4, 8, 16];
const STEP = 1;
const LEAP = 10;
/** Seconds before an event at which it is sought, so that it is seen to come. */
const LEAD = 0.05;
/** Milliseconds after which the address follows the moment shown. */
const REST = 250;

/** Recorded drones by one timeline, which is that of `playback`. */
export function Timeline({ playback, drones }: { playback: Playback; drones: RecordedDrone[] }) {
  const { begin, end } = playback;
  const [copied, setCopied] = useState(false);
  const names = drones.map((one) => one.robot).join();
  const events = useMemo(
    () => drones.flatMap(eventsOf).sort((one, other) => one - other),
    [playback, names],
  );
  const toEvent = (ahead: boolean) => {
    const now = lastBefore(events, playback.time, (one) => one);
    const place = ahead ? now + 1 : lastBefore(events, playback.time - 2 * LEAD, (one) => one);
    playback.seek(events[place] ?? (ahead ? end : begin));
  };
  const toggle = () => (playback.playing ? playback.pause() : playback.play());

  const keys: Record<string, (event: KeyboardEvent) => void> = {
    " ": toggle,
    ArrowLeft: (event) => playback.seek(playback.time - (event.shiftKey ? LEAP : STEP)),
    ArrowRight: (event) => playback.seek(playback.time + (event.shiftKey ? LEAP : STEP)),
    Home: () => playback.seek(begin),
    End: () => playback.seek(end),
    "[": () => toEvent(false),
    "]": () => toEvent(true),
  };
  useEvent("keydown", (event) => {
    const act = keys[event.key];
    if (!act || event.ctrlKey || event.metaKey || event.altKey || isTyping(event)) return;
    event.preventDefault();
    act(event);
  });
  useEvent("hashchange", () => {
    const time = momentOfLink();
    if (time !== null) playback.seek(time);
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

  const states = drones.map((one) => stateAt(one, playback.time)).filter(Boolean);
  const spoken = [`${playback.time.toFixed(1)} of ${end.toFixed(1)} seconds`, ...states].join(", ");
  return (
    <section class="card timeline" aria-label="Playback">
      <div class="player">
        <Button title="Event before ([)" label="Event before" onClick={() => toEvent(false)}>
          <Skip ahead={false} />
        </Button>
        <Button class="primary" title="Play or pause (space)" testid="play" onClick={toggle}>
          {playback.playing ? "Pause" : "Play"}
        </Button>
        <Button title="Next event (])" label="Next event" onClick={() => toEvent(true)}>
          <Skip ahead />
        </Button>
        <Select
          label="Speed"
          value={String(playback.speed)}
          options={SPEEDS.map((speed) => [String(speed), `${speed} ×`])}
          onChoose={(speed) => (playback.speed = Number(speed))}
        />
        <output class="time" data-testid="time" data-time={playback.time}>
          {clock(playback.time, true)} <small>of {clock(end, true)}</small>
        </output>
        <span class="grow" />
        <Button
          title="Copy a link to this moment. Whoever opens it needs a token"
          onClick={() => {
            writeFragment({ t: playback.time.toFixed(2) });
            void navigator.clipboard?.writeText(location.href).then(() => setCopied(true));
          }}
        >
          {copied ? "Copied" : "Link"}
        </Button>
      </div>
      <div
        class="lanes"
        onPointerDown={(event) => {
          event.currentTarget.setPointerCapture(event.pointerId);
          playback.seek(timeAt(event, playback));
        }}
        onPointerMove={(event) => {
          if (event.buttons) playback.seek(timeAt(event, playback));
        }}
      >
        {drones.map((one, place) => (
          <Lanes
            key={`${place} ${one.robot}`}
            drone={one}
            {...{ begin, end, now: playback.time }}
            ticks={place === drones.length - 1}
          />
        ))}
      </div>
      <input
        type="range"
        class="seek"
        aria-label="Mission time"
        aria-valuetext={spoken}
        min={begin}
        max={end}
        step="any"
        value={playback.time}
        data-testid="seek"
        onInput={(event) => playback.seek(Number(event.currentTarget.value))}
      />
      {drones.map(
        ({ flight }, place) =>
          flight.remark && (
            <p key={place} class="hint" data-testid="remark">
              {drones.length > 1 ? flight.name : "This recording"} is incomplete: {flight.remark}.
            </p>
          ),
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
  const text = readFragment("t");
  const time = text === null ? NaN : Number(text);
  return Number.isFinite(time) ? time : null;
}

/** Whether what has the focus takes a key for itself. */
function isTyping(event: KeyboardEvent): boolean {
  const at = event.target;
  if (!(at instanceof HTMLElement)) return false;
  if (at instanceof HTMLInputElement) return at.type !== "range";
  if (at instanceof HTMLButtonElement) return event.key === " ";
  return at.closest("select, textarea, .mapbox") !== null;
}

function timeAt(event: PointerEvent, { begin, end }: Playback): number {
  const box = (event.currentTarget as HTMLElement).getBoundingClientRect();
  const share = (event.clientX - box.left) / Math.max(1, box.width);
  return begin + share * (end - begin);
}
