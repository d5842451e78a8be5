// What analyses saw, where it stands on the ground: marks on the map that fade as they age.

import { colourOf } from "./paint";
import { LETTER, Labels, type Sight, px } from "./sight";
import type { Detection, ItemMessage } from "./wire";

/** Seconds after which a mark is gone. */
const KEPT = 5;
/** Seconds by which a detection may be ahead of the newest state of a live flight. */
const AHEAD = 1;
/** Most marks that are drawn, the surest first. */
const MOST = 100;
/** Standard deviations of an ellipse, as of a drone's circle. */
const SIGMAS = 2;
/** Metres within which what a tracker knows is not marked again, nameless, by its detector. */
const SAME = 1;

export interface Mark {
  key: string;
  what: Detection;
  source: string;
  /** Mission seconds of capture. */
  time: number;
  place: NonNullable<ItemMessage["places"][number]>;
}

/** The newest places, of each track and of what each analysis found without one. */
export class GroundMarks {
  private readonly streams = new Map<string, Map<string, Mark>>();

  /** Add what a stream has found in a frame. */
  add({ item, stream, places }: ItemMessage): void {
    if (item.is !== "Detections") return;
    const { header, items } = item.of;
    const time = header.stamp / 1e9;
    const known = [...(this.streams.get(`${stream} ${header.source}`)?.values() ?? [])];
    // A track stays where it was seen last; of a recording, what was seen later is not so any more.
    const kept = known.filter(
      (one) => one.what.track_id !== null && one.time <= time && time - one.time < KEPT,
    );
    const marks = new Map(kept.map((one) => [one.key, one]));
    items.forEach((what, number) => {
      const key = `${stream} ${header.source} ${what.track_id ?? `nameless ${number}`}`;
      const place = places[number];
      if (place) marks.set(key, { key, what, source: header.source, time, place });
      else marks.delete(key);
    });
    this.streams.set(`${stream} ${header.source}`, marks);
  }

  clear(): void {
    this.streams.clear();
  }

  /** What is to be drawn at a mission time, the least sure first. */
  at(now: number, recorded: boolean): Mark[] {
    const ahead = recorded ? 0 : AHEAD;
    const all = [...this.streams.values()].flatMap((marks) => [...marks.values()]);
    const young = all.filter((one) => now - one.time >= -ahead && now - one.time < KEPT);
    const tracked = young.filter((one) => one.what.track_id !== null);
    return young
      .filter((one) => one.what.track_id !== null || !tracked.some((other) => same(one, other)))
      .sort((one, other) => (one.what.score ?? 0) - (other.what.score ?? 0))
      .slice(-MOST);
  }
}

function same(one: Mark, other: Mark): boolean {
  const apart = Math.hypot(one.place[0] - other.place[0], one.place[1] - other.place[1]);
  const close = one.source === other.source && Math.abs(one.time - other.time) < 1;
  return close && one.what.label === other.what.label && apart < SAME;
}

export function nameOf({ label, track_id }: Detection): string {
  return track_id === null ? label : `${label} #${track_id}`;
}

interface MarksProps {
  marks: Mark[];
  now: number;
  stale: boolean;
  sight: Sight;
}

/** Those of marks, the least sure first, whose labels cover no surer one's. */
function labelled(marks: Mark[], sight: Sight): Set<Mark> {
  const labels = new Labels();
  return new Set(
    [...marks].reverse().filter(({ what, place: [east, north] }) => {
      const half = (LETTER * nameOf(what).length) / 2;
      return labels.add(sight.x(east) + half, sight.y(north), half);
    }),
  );
}

export function MarkLayer({ marks, now, stale, sight }: MarksProps) {
  const named = labelled(marks, sight);
  return (
    <g>
      {marks.map((one) => {
        const [east, north, , major, minor, angle] = one.place;
        const fresh = 1 - Math.max(0, now - one.time) / KEPT;
        const wide = SIGMAS * sight.view.scale;
        return (
          <g
            key={one.key}
            class={`seen ${stale ? "stale" : ""}`}
            style={{ color: colourOf(one.what), opacity: fresh.toFixed(2) }}
            transform={`translate(${px(sight.x(east))} ${px(sight.y(north))})`}
            data-seen={nameOf(one.what)}
            data-east={east}
            data-north={north}
          >
            <ellipse
              rx={px(wide * major)}
              ry={px(wide * minor)}
              transform={`rotate(${((-angle * 180) / Math.PI).toFixed(1)})`}
            />
            <circle r="4" />
            {named.has(one) && (
              <text x="7" dy="4">{nameOf(one.what)}</text>
            )}
          </g>
        );
      })}
    </g>
  );
}
