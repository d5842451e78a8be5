// Commands: their buttons, the bar that stays in sight, and the log of what became of them.

import type { ComponentChildren } from "preact";
import { useEffect, useState } from "preact/hooks";
import "./commands.css";
import { NewestAlert } from "./alerts";
import {
  COMMANDS,
  type Flight,
  type Order,
  type Stage,
  type Word,
  chargeOf,
  heightOf,
  isEnding,
  speedOf,
  stageOf,
  toneOf,
} from "./flight";
import { Badge, Button, Card, useEscape } from "./widgets";
import { wordsOf } from "./words";

const TITLES: Record<Word, string> = {
  pause: "Hover here until you resume",
  resume: "Continue the plan",
  "return-home": "Fly back to the place of take-off, and land",
  clear: "Drop the plan, and hover",
  land: "Land at once, where the drone is",
};
const STAGES: Record<Stage, string> = {
  asked: "asking…",
  accepted: "accepted, under way",
  done: "done",
  refused: "refused",
  unconfirmed: "accepted, not seen done",
  unanswered: "no answer: check whether the drone obeys",
};
/** Milliseconds for which a command that is asked for twice waits for the second click. */
const SURE = 4000;

interface ButtonsProps {
  words: Word[];
  /** Those that are asked for twice. */
  confirmed: Word[];
  /** Whom they command, where that is not the one drone. */
  whom?: string;
  disabled(word: Word): boolean;
  onCommand(word: Word): void;
}

export function CommandButtons({ words, confirmed, whom, disabled, onCommand }: ButtonsProps) {
  const [asked, setAsked] = useState<Word | null>(null);
  useEffect(() => {
    if (asked === null) return;
    const timer = setTimeout(() => setAsked(null), SURE);
    return () => clearTimeout(timer);
  }, [asked]);
  useEscape(asked === null ? null : () => setAsked(null));
  const click = (word: Word) => {
    const sure = asked === word || !confirmed.includes(word);
    setAsked(sure ? null : word);
    if (sure) onCommand(word);
  };
  return (
    <div class="commands">
      {words.map((word) => (
        <Button
          key={word}
          class={`command ${word}`}
          title={whom === undefined ? TITLES[word] : `${TITLES[word]}: each drone in flight that you may command`}
          disabled={disabled(word)}
          onClick={() => click(word)}
        >
          {COMMANDS[word].name}
          {whom !== undefined && ` ${whom}`}
          {asked === word && ": sure?"}
        </Button>
      ))}
    </div>
  );
}

/** The bar: what is flown, the newest alert and command, and the buttons of the commands. */
export function Bar(props: { label: string; flight: Flight; now: ComponentChildren; children: ComponentChildren }) {
  const { label, flight, now, children } = props;
  const [newest] = flight.orders;
  return (
    <section class="card flightbar" aria-label={label}>
      <p class={`now ${flight.stale ? "stale" : ""}`} data-testid="now">{now}</p>
      <div class="newest">
        <NewestAlert log={flight.log} onAcknowledge={flight.acknowledge} />
        {newest && (
          <p class="order" data-stage={stageOf(newest)} title={textOf(newest)} data-testid="newest-order">
            <strong>{newest.what}</strong> {textOf(newest)}
          </p>
        )}
      </div>
      {children}
    </section>
  );
}

/** The bar of one drone. */
export function FlightBar({ flight, robot, mayFly }: { flight: Flight; robot: string; mayFly: boolean }) {
  const status = flight.status(robot);
  const [height, charge] = [heightOf(status), chargeOf(status)];
  const figures = status && [
    height == null ? "" : `${height.toFixed(1)} m`,
    `${speedOf(status)?.toFixed(1) ?? "—"} m/s`,
    charge === null ? "" : `${(100 * charge).toFixed(0)} %`,
  ];
  const now = (
    <>
      <strong>{robot}</strong>
      {status ? (
        <>
          <Badge tone={toneOf(status)}>{wordsOf(status.mission.state)}</Badge>
          <span class="figures">{figures?.filter(Boolean).join(" · ")}</span>
          <span class="why" title={status.mission.reason}>{status.mission.reason}</span>
        </>
      ) : (
        <span class="muted">no state yet</span>
      )}
    </>
  );
  const paused = status?.mission.state === "paused";
  const ends = status !== undefined && isEnding(status);
  const useless = { pause: paused || ends, resume: !paused, clear: ends, "return-home": false, land: false };
  return (
    <Bar label="Flight" {...{ flight, now }}>
      {/* What was asked of one drone is not confirmed for another. */}
      <CommandButtons
        key={robot}
        words={["pause", "resume", "return-home", "clear", "land"]}
        confirmed={["clear", "land"]}
        disabled={(word) => !mayFly || useless[word]}
        onCommand={(word) => flight.command([robot], word)}
      />
    </Bar>
  );
}

/** What became of a command; of several drones, how many are how far, and why others are not. */
function textOf({ drones }: Order): string {
  const [first] = drones;
  if (first && drones.length === 1) {
    const after = first.seconds === null ? "" : ` after ${first.seconds.toFixed(1)} s`;
    return `${STAGES[first.stage]}${first.text && `: ${first.text}`}${after}`;
  }
  const count = (...stages: Stage[]) => drones.filter((one) => stages.includes(one.stage)).length;
  const failed = drones.filter(({ stage }) => stage === "refused" || stage === "unanswered");
  return [
    `${count("accepted", "unconfirmed", "done")} of ${drones.length} accepted`,
    `${count("done")} done`,
    ...failed.map(({ robot, stage, text }) => `${robot}: ${stage === "refused" ? text : STAGES[stage]}`),
  ].join("; ");
}

/** The commands given from this page with what became of them, and all that are recorded. */
export function CommandLog(props: { flight: Flight; mayFly: boolean; hint?: string }) {
  const { flight, mayFly, hint } = props;
  const { commands } = flight.log;
  const single = flight.source.kind === "live";
  if (!single && commands.length + flight.orders.length === 0) return null;
  return (
    <Card kind="commandlog" label="Commands" head={!mayFly && single && <Badge>watch only</Badge>}>
      {hint && <p class="hint">{hint}</p>}
      <ol class="orders" aria-live="polite" data-testid="orders">
        {flight.orders.map((order) => (
          <li key={order.id} class="order" data-stage={stageOf(order)}>
            <strong>{order.what}</strong> {textOf(order)}
          </li>
        ))}
      </ol>
      {commands.length > 0 && (
        <details open={flight.recorded}>
          <summary>All recorded commands: {commands.length}</summary>
          <ol class="given" data-testid="given">
            {commands.map((text, place) => (
              <li key={commands.length - place}>{text}</li>
            ))}
          </ol>
        </details>
      )}
    </Card>
  );
}
