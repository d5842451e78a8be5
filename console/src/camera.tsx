// The camera: pictures of a drone in flight or of a recording, with what was found in them, and their depth.

import { useEffect, useRef, useState } from "preact/hooks";
import { drawScale } from "./depth";
import type { Flight } from "./flight";
import { type Painted, paint } from "./paint";
import { KEPT, Pictures } from "./pictures";
import { Badge, Button, Card, NameChoice } from "./widgets";
import type { FollowedTarget, MissionOut } from "./wire";

const STALE = 1500;

/** What is on the screen. */
interface Seen extends Painted {
  stamp: number;
  captured: number;
  measured: boolean;
  target: FollowedTarget["state"] | null;
  /** Metres at which the depth's colours end, where it is shown. */
  range: number | null;
}

/** What is said of the target in the picture that is shown. */
const TARGETS: Record<FollowedTarget["state"], { text: string; tone: string }> = {
  sure: { text: "◎ follows", tone: "good" },
  likely: { text: "◎ follows the likelier one", tone: "warn" },
  uncertain: { text: "target uncertain: holds", tone: "warn" },
  unseen: { text: "target not in sight", tone: "warn" },
};

interface CameraProps {
  flight: Flight;
  /** Whose cameras are shown. */
  mission: MissionOut;
  /** The camera that is shown at first belongs to this robot, if it has one. */
  robot?: string;
  /** Whether it takes the map's place; with what changes that, where it may. */
  large?: boolean;
  onLarge?(large: boolean): void;
}

export function Camera({ flight, mission, robot = "", large = false, onLarge }: CameraProps) {
  const { id, streams } = mission;
  const names = Object.keys(streams).sort();
  const cameras = names.filter((name) => streams[name] === "pictures");
  const [chosen, setChosen] = useState("");
  const first = cameras.find((name) => name.startsWith(`${robot}/`)) ?? cameras[0] ?? "";
  const camera = cameras.includes(chosen) ? chosen : first;
  const canvas = useRef<HTMLCanvasElement>(null);
  const [seen, setSeen] = useState<Seen | null>(null);
  const [deep, setDeep] = useState(false);
  const finders = names.filter((name) => streams[name] !== "pictures").join(",");

  useEffect(() => {
    if (!camera) return;
    // Of a recording, the picture of the moment is shown and no other one.
    const pictures = new Pictures(flight.recorded ? 1 : KEPT, deep);
    let requested = false;
    const draw = () => {
      requested = false;
      const picture = pictures.newest(camera);
      if (!picture || !canvas.current) return;
      const { stamp, captured, measured } = picture;
      const range = picture.depth?.range ?? null;
      const target = picture.target?.state ?? null;
      setSeen({ stamp, captured, measured, target, range, ...paint(canvas.current, picture) });
    };
    const redraw = () => {
      if (!requested) requestAnimationFrame(draw);
      requested = true;
    };
    const leave = flight.source.watch({ mission: id, camera, finders: finders.split(","), depth: deep }, {
      onItem: (message, blob) => {
        flight.marks.add(message);
        // Of a live flight, the next state draws it.
        if (flight.recorded && message.item.is === "Detections") flight.changed();
        return pictures.add(message, blob).then(redraw);
      },
      onNothing: () => setSeen(null),
      onTime: (now) => flight.clock.receive(now),
    });
    return () => {
      leave();
      pictures.close();
      flight.marks.clear();
    };
  }, [id, camera, finders, flight, deep]);

  if (cameras.length === 0) return null;
  const head = (
    <>
      {cameras.length === 1 && <span class="muted">{camera}</span>}
      <NameChoice label="Camera shown" names={cameras} value={camera} onChoose={setChosen} />
      {(seen?.measured || deep) && (
        <Button class="plain" pressed={deep} onClick={() => setDeep(!deep)}>Depth</Button>
      )}
      {onLarge && (
        <Button class="plain enlarge" title="Swap camera and map" onClick={() => onLarge(!large)}>
          {large ? "Small" : "Large"}
        </Button>
      )}
      {/* Always there: what comes into it is read out. */}
      <span role="status" data-testid="target">
        {seen?.target && <Badge tone={TARGETS[seen.target].tone}>{TARGETS[seen.target].text}</Badge>}
      </span>
      {seen && !flight.recorded && <Age flight={flight} captured={seen.captured} />}
    </>
  );
  return (
    <Card kind="video" label="Camera" head={head}>
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
    </Card>
  );
}

function Age({ flight, captured }: { flight: Flight; captured: number }) {
  const age = flight.clock.age(captured);
  if (flight.over) return <Badge>flight over</Badge>;
  if (age === null) return null;
  const stale = age > STALE;
  const text = age < 1000 ? `${Math.round(age / 10) * 10} ms` : `${(age / 1000).toFixed(1)} s`;
  return (
    <Badge tone={stale ? "bad" : "good"} testid="age">
      {stale ? `stale: ${text} old` : `${text} old`}
    </Badge>
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
