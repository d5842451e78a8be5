// The bar that stays in sight: a drone's state, the newest alert, and the commands.

import { useEffect, useState } from "preact/hooks";
import "./flight_bar.css";
import { useEscape } from "./escape";
import { type AlertLog, type Flight, NAMES, type Order, type Word, ending, speedOf } from "./flight";
import { STAGES, tone } from "./panels";
import type { StatusOut } from "./wire";

const BUTTONS: { word: Word; title: string; sure: boolean }[] = [
  { word: "pause", title: "Hover here until told to resume", sure: false },
  { word: "resume", title: "Go on where it was held", sure: false },
  { word: "return-home", title: "Fly back to take-off and land", sure: false },
  { word: "clear", title: "Drop the plan and hover here", sure: true },
  { word: "land", title: "Land at once, where the drone is", sure: true },
];
/** Milliseconds for which a command that is asked for twice waits for the second time. */
const SURE = 4000;

export function FlightBar(props: { flight: Flight; robot: string; mayFly: boolean }) {
  const { flight, robot } = props;
  const status = flight.status(robot);
  return (
    <section class="card flightbar" aria-label="Flight">
      <p class={`now ${flight.stale ? "stale" : ""}`} data-testid="now">
        <strong>{robot}</strong>
        {status ? <Now status={status} /> : <span class="muted">nothing heard yet</span>}
      </p>
      <div class="newest">
        <NewestAlert log={flight.log} onAcknowledge={(id) => flight.acknowledge(id)} />
        <NewestOrder order={flight.orders[0]} />
      </div>
      <Buttons {...props} />
    </section>
  );
}

function Now({ status }: { status: StatusOut }) {
  const height = status.position?.[2];
  const figures = [
    height == null ? "" : `${height.toFixed(1)} m`,
    `${speedOf(status)?.toFixed(1) ?? "—"} m/s`,
    status.battery === null ? "" : `${(100 * status.battery).toFixed(0)} %`,
  ];
  return (
    <>
      <span class={`badge ${tone(status)}`}>{status.state.replace("_", " ")}</span>
      <span class="figures">{figures.filter(Boolean).join(" · ")}</span>
      <span class="why" title={status.reason}>
        {status.reason}
      </span>
    </>
  );
}

/** The newest alert that is not acknowledged; always there, so that a new one is read out. */
export function NewestAlert(props: { log: AlertLog; onAcknowledge(id: number): void }) {
  const open = props.log.alerts.filter((one) => !one.acknowledged);
  const [newest] = open;
  return (
    <p class="alert" role="status" data-testid="newest-alert">
      {newest ? (
        <>
          <span class="badge warn">{open.length > 1 ? `${open.length} alerts` : "alert"}</span>
          <span class="text" title={newest.text}>
            {newest.source && <span class="muted">{newest.source}: </span>}
            <strong>{newest.kind.replaceAll("_", " ")}</strong> {newest.text}
          </span>
          <button
            type="button"
            class="plain"
            aria-label={`Acknowledge: ${newest.text}`}
            onClick={() => props.onAcknowledge(newest.id)}
          >
            OK
          </button>
        </>
      ) : (
        <span class="muted">no new alert</span>
      )}
    </p>
  );
}

function NewestOrder({ order }: { order: Order | undefined }) {
  if (!order) return null;
  const said = `${STAGES[order.stage]}${order.text && `: ${order.text}`}`;
  return (
    <p class={`order ${order.stage}`} title={said} data-testid="newest-order">
      <strong>{order.what}</strong> {said}
    </p>
  );
}

function Buttons(props: { flight: Flight; robot: string; mayFly: boolean }) {
  const { flight, robot, mayFly } = props;
  const [asked, setAsked] = useState<Word | null>(null);
  useEffect(() => {
    if (asked === null) return;
    const timer = setTimeout(() => setAsked(null), SURE);
    return () => clearTimeout(timer);
  }, [asked]);
  // What was asked of one drone is not confirmed for another.
  useEffect(() => setAsked(null), [robot]);
  useEscape(asked === null ? null : () => setAsked(null));
  const status = flight.status(robot);
  const paused = status?.state === "paused";
  const ends = status !== undefined && ending(status);
  const senseless: Partial<Record<Word, boolean>> = {
    pause: paused || ends,
    resume: !paused,
    clear: ends,
  };
  return (
    <div class="commands">
      {BUTTONS.map(({ word, title, sure }) => (
        <button
          key={word}
          type="button"
          class={`command ${word}`}
          title={title}
          disabled={!mayFly || senseless[word]}
          onClick={() => {
            if (sure && asked !== word) {
              setAsked(word);
              return;
            }
            setAsked(null);
            flight.command(robot, word);
          }}
        >
          {asked === word ? `${NAMES[word]}: sure?` : NAMES[word]}
        </button>
      ))}
    </div>
  );
}
