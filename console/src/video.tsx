// The camera: pictures of a live or a recorded flight with what was found in them, and their depth.

import { useEffect, useRef, useState } from "preact/hooks";
import { drawScale } from "./depth";
import type { ClockOffset, Flight } from "./flight";
import { type Painted, paint } from "./paint";
import { KEPT, Pictures, type Target } from "./pictures";

const STALE = 1500;

/** What is on the screen. */
interface Seen extends Painted {
  stamp: number;
  captured: number;
  measured: boolean;
  target: Target["state"] | null;
  /** Metres at which the depth's colours end, where it is shown. */
  range: number | null;
}

/** What is said of the target in the picture that is shown. */
const TARGETS: Record<Target["state"], { text: string; tone: string }> = {
  sure: { text: "◎ follows", tone: "good" },
  likely: { text: "◎ follows the likelier one", tone: "warn" },
  uncertain: { text: "target uncertain: holds", tone: "warn" },
  unseen: { text: "target not in sight", tone: "warn" },
};

interface VideoProps {
  flight: Flight;
  /** Whether it takes the map's place; with what changes that, where it may. */
  large?: boolean;
  onLarge?(large: boolean): void;
}

export function Video({ flight, large = false, onLarge }: VideoProps) {
  const streams = flight.mission.streams;
  const names = Object.keys(streams).sort();
  const cameras = names.filter((name) => streams[name] === "pictures");
  const [chosen, setChosen] = useState("");
  const camera = cameras.includes(chosen) ? chosen : (cameras[0] ?? "");
  const canvas = useRef<HTMLCanvasElement>(null);
  const [seen, setSeen] = useState<Seen | null>(null);
  const [deep, setDeep] = useState(false);
  const finders = names.filter((name) => streams[name] !== "pictures").join(",");

  useEffect(() => {
    if (!camera) return;
    // Of a recording, the picture of the moment is shown and no other one.
    const pictures = new Pictures(flight.recorded ? 1 : KEPT, deep);
    let asked = false;
    const draw = () => {
      asked = false;
      const picture = pictures.newest(camera);
      if (!picture || !canvas.current) return;
      const { stamp, captured, measured } = picture;
      const range = picture.depth?.range ?? null;
      const target = picture.target?.state ?? null;
      setSeen({ stamp, captured, measured, target, range, ...paint(canvas.current, picture) });
    };
    const later = () => {
      if (!asked) requestAnimationFrame(draw);
      asked = true;
    };
    const wanted = { camera, finders: finders.split(","), depth: deep };
    const leave = flight.source.watch(wanted, {
      found: (message) => {
        pictures.found(message);
        flight.see(message);
        later();
      },
      picture: (message, data) => pictures.take(message, data).then(later),
      nothing: () => setSeen(null),
    });
    return () => {
      leave();
      pictures.close();
    };
  }, [camera, finders, flight, deep]);

  if (cameras.length === 0) {
    return (
      <section class="card video" aria-label="Camera">
        <p class="muted">This flight shows no camera</p>
      </section>
    );
  }
  return (
    <section class="card video" aria-label="Camera">
      <header>
        <h2>Camera</h2>
        {cameras.length > 1 && (
          <select
            aria-label="Camera shown"
            value={camera}
            onChange={(event) => setChosen(event.currentTarget.value)}
          >
            {cameras.map((name) => (
              <option key={name}>{name}</option>
            ))}
          </select>
        )}
        {cameras.length === 1 && <span class="muted">{camera}</span>}
        {(seen?.measured || deep) && (
          <button
            type="button"
            class="plain"
            aria-pressed={deep}
            onClick={() => setDeep(!deep)}
          >
            Depth
          </button>
        )}
        {onLarge && (
          <button
            type="button"
            class="plain enlarge"
            title="Have camera and map change places"
            onClick={() => onLarge(!large)}
          >
            {large ? "Small" : "Large"}
          </button>
        )}
        {/* Always there: what comes into it is read out. */}
        <span role="status" data-testid="target">
          {seen?.target && <span class={`badge ${TARGETS[seen.target].tone}`}>{TARGETS[seen.target].text}</span>}
        </span>
        {seen && !flight.recorded && <Age clock={flight.clock} captured={seen.captured} over={flight.over} />}
      </header>
      <div class="screen">
        {/* Its first picture gives it its shape. */}
        <canvas
          ref={canvas}
          hidden={!seen && flight.recorded}
          width="16"
          height="9"
          role="img"
          aria-label={`${flight.recorded ? "Recorded" : "Live"} picture of ${camera}`}
          data-testid="video"
          data-stamp={seen?.stamp}
          data-captured={seen?.captured}
          data-boxes={seen?.boxes}
          data-points={seen?.points}
          data-range={seen?.range}
        />
        {!seen && <p class="empty">No picture yet</p>}
        {seen?.range != null && <Scale range={seen.range} />}
        {seen && (
          <span class="stamp">
            t = {(seen.stamp / 1e9).toFixed(2)} s{seen.boxes > 0 && ` · ${seen.boxes} found`}
          </span>
        )}
      </div>
    </section>
  );
}

function Age(props: { clock: ClockOffset; captured: number; over: boolean }) {
  const [, tick] = useState(0);
  useEffect(() => {
    const timer = setInterval(() => tick((count) => count + 1), 250);
    return () => clearInterval(timer);
  }, []);
  const age = props.clock.age(props.captured);
  if (props.over) return <span class="badge">flight over</span>;
  if (age === null) return null;
  const stale = age > STALE;
  const text = age < 1000 ? `${Math.round(age / 10) * 10} ms` : `${(age / 1000).toFixed(1)} s`;
  return (
    <span class={`badge ${stale ? "bad" : "good"}`} data-testid="age">
      {stale ? `stale: ${text} old` : `${text} old`}
    </span>
  );
}

/** What the depth's colours mean. */
function Scale({ range }: { range: number }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    if (canvas.current) drawScale(canvas.current);
  }, []);
  return (
    <span class="deepness" data-testid="scale">
      0 <canvas ref={canvas} aria-hidden="true" /> {range} m
    </span>
  );
}
