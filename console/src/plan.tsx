// The coming waypoints: dragged or moved by keys into another order, or left out.

import { useEffect, useRef, useState } from "preact/hooks";
import { type Flight, aheadOf, idsOf, isEnding } from "./flight";
import { Badge, Button, Card } from "./widgets";
import { wordsOf } from "./words";
import type { RobotStatus, Waypoint } from "./wire";

/** Milliseconds after the last key before the order is asked for. */
const PAUSE = 600;
/** Milliseconds for which an order that was asked for is shown before the mission tells its own. */
const PATIENCE = 3000;

export function Plan(props: { flight: Flight; robot: string; mayFly: boolean }) {
  const { flight, robot } = props;
  const status = flight.status(robot);
  const { target = null, pending = [] } = status?.mission ?? {};
  const coming = idsOf(pending);
  const [draft, setDraft] = useState<string[] | null>(null);
  const [dragged, setDragged] = useState<string | null>(null);
  const list = useRef<HTMLOListElement>(null);
  const timer = useRef(0);
  const over = status !== undefined && isEnding(status);
  const mayFly = props.mayFly && !over;
  useEffect(() => () => clearTimeout(timer.current), []);
  if (!status || (target === null && coming.length === 0)) return null;

  // What was reached or added meanwhile is so in the draft, too.
  const shown = draft === null ? coming : merged(draft, coming);
  const move = (id: string, to: number): string[] => {
    const rest = shown.filter((one) => one !== id);
    const place = Math.max(0, Math.min(rest.length, to));
    const order = [...rest.slice(0, place), id, ...rest.slice(place)];
    setDraft(order);
    return order;
  };
  const ask = (order: string[]) => {
    clearTimeout(timer.current);
    const changed = between(coming, merged(order, coming));
    if (changed.length > 0) {
      flight.rearrange({ robot, order: changed }, `order ${named(changed)}`, (now) =>
        inOrder(now, changed) ? "so the plan is now" : null,
      );
    }
    timer.current = setTimeout(() => setDraft(null), changed.length > 0 ? PATIENCE : 0);
  };
  const remove = (id: string) =>
    flight.rearrange({ robot, remove: [id] }, `leave out ${id}`, (now) =>
      idsOf(aheadOf(now)).includes(id) ? null : "not in the plan any more",
    );
  const placeAt = (y: number) => {
    const rows = [...(list.current?.querySelectorAll("li[data-coming]") ?? [])];
    return rows.filter((row) => {
      const box = row.getBoundingClientRect();
      return box.top + box.height / 2 < y;
    }).length;
  };
  const keys = (event: KeyboardEvent, id: string, place: number) => {
    const steps: Record<string, number> = { ArrowUp: -1, ArrowDown: 1 };
    const step = steps[event.key];
    if (step !== undefined) {
      event.preventDefault();
      const order = move(id, place + step);
      clearTimeout(timer.current);
      timer.current = setTimeout(() => ask(order), PAUSE);
    } else if (event.key === "Delete") {
      event.preventDefault();
      remove(id);
    }
  };

  const left = coming.length + (target === null ? 0 : 1);
  const now = target === null ? "" : `, now ${target.id}`;
  const head = (
    <Badge testid="to-go">
      {over ? `${wordsOf(status.mission.state)}: ${left} left out` : `${left} to go${now}`}
    </Badge>
  );
  return (
    <Card kind={`plan ${over ? "over" : ""}`} label="Plan" head={head}>
      {mayFly && shown.length > 0 && (
        <p class="hint">Drag a waypoint to another place, or use the arrow keys on its handle; Delete removes it.</p>
      )}
      <ol ref={list} data-testid="plan">
        {target !== null && (
          <li class={over ? "" : "current"} data-plan={target.id}>
            <span class="handle" aria-hidden="true">{over ? "○" : "▶"}</span>
            <Place id={target.id} at={target} />
            {mayFly && <Remove id={target.id} word="Skip" onRemove={remove} />}
          </li>
        )}
        {shown.map((id, place) => (
          <li key={id} data-plan={id} data-coming class={id === dragged ? "dragged" : ""}>
            {mayFly ? (
              <button
                type="button"
                class="handle"
                aria-label={`${id}, ${place + 1} of ${shown.length} coming. Arrow keys move it, Delete leaves it out.`}
                onKeyDown={(event) => keys(event, id, place)}
                onPointerDown={(event) => {
                  event.currentTarget.setPointerCapture(event.pointerId);
                  setDragged(id);
                }}
                onPointerMove={(event) => {
                  if (dragged !== id) return;
                  const to = placeAt(event.clientY);
                  // Its own row counts among those above it.
                  move(id, to > place ? to - 1 : to);
                }}
                onPointerUp={() => {
                  setDragged(null);
                  if (draft) ask(draft);
                }}
                onPointerCancel={() => {
                  setDragged(null);
                  setDraft(null);
                }}
              >
                ⠿
              </button>
            ) : (
              <span class="handle" aria-hidden="true">○</span>
            )}
            <Place id={id} at={pending.find((one) => one.id === id)} />
            {mayFly && <Remove id={id} word="Leave out" onRemove={remove} />}
          </li>
        ))}
      </ol>
    </Card>
  );
}

function Place({ id, at }: { id: string; at: Waypoint | undefined }) {
  return (
    <span class="what">
      <strong>{id}</strong>{" "}
      {at && (
        <small>{at.x.toFixed(1)} E, {at.y.toFixed(1)} N, {at.z.toFixed(1)} m</small>
      )}
    </span>
  );
}

function Remove(props: { id: string; word: string; onRemove(id: string): void }) {
  const { id, word, onRemove } = props;
  return (
    <Button class="plain" title={word} label={`${word}: ${id}`} onClick={() => onRemove(id)}>✕</Button>
  );
}

/** The draft's order, of what is still coming; what has come since is last. */
function merged(draft: string[], coming: string[]): string[] {
  return [
    ...draft.filter((one) => coming.includes(one)),
    ...coming.filter((one) => !draft.includes(one)),
  ];
}

/** The part of an order in which it differs from another: the mission pins what is named. */
function between(before: string[], after: string[]): string[] {
  const places = [...after.keys()].filter((place) => before[place] !== after[place]);
  const [first, last] = [places[0], places.at(-1)];
  return first === undefined || last === undefined ? [] : after.slice(first, last + 1);
}

/** Whether those that are still ahead are so in this order. */
function inOrder(status: RobotStatus, order: string[]): boolean {
  const left = idsOf(aheadOf(status));
  const expected = order.filter((one) => left.includes(one));
  return left.filter((one) => order.includes(one)).every((one, place) => one === expected[place]);
}

function named(ids: string[]): string {
  const most = 4;
  return ids.length <= most ? ids.join(", ") : `${ids.slice(0, most).join(", ")}, …`;
}
