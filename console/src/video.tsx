// Pictures of one camera: boxes and labels are drawn on the very frame they were made from.

import { useEffect, useRef, useState } from "preact/hooks";
import type { ClockOffset, Flight } from "./flight";

const KEPT = 16;
const STALE = 1500;
/** Mission nanoseconds by which an analysed picture may be older than the newest one. */
const BEHIND = 1.5e9;

interface Detection {
  box: [number, number, number, number];
  label: string;
  score: number;
  track_id: number | null;
}

interface Picture {
  bitmap: ImageBitmap;
  stamp: number;
  captured: number;
  camera: string;
  found: Map<string, Detection[]>;
}

interface Header {
  stamp: number;
  source: string;
}

/** The fields of an item as the wire has it: `{"is": CLASS, "of": fields}`. */
function fields<T>(item: unknown): T {
  return (item as { of: T }).of;
}

function list(items: unknown): unknown[] {
  return Array.isArray(items) ? items : ((items as { of?: unknown[] } | null)?.of ?? []);
}

class Pictures {
  constructor(private readonly most: number) {}

  private kept: Picture[] = [];
  private early = new Map<string, Map<string, Detection[]>>();

  async frame(message: Record<string, unknown>, data: ArrayBuffer): Promise<void> {
    const item = message["item"] as { header: unknown; bytes: [number, number] };
    const header = fields<Header>(item.header);
    const jpeg = new Blob([new Uint8Array(data, 0, item.bytes[0])], { type: "image/jpeg" });
    const bitmap = await createImageBitmap(jpeg);
    const key = `${header.source} ${header.stamp}`;
    const found = this.early.get(key) ?? new Map<string, Detection[]>();
    this.early.delete(key);
    this.kept.push({
      bitmap,
      stamp: header.stamp,
      captured: message["captured"] as number,
      camera: message["stream"] as string,
      found,
    });
    while (this.kept.length > this.most) this.kept.shift()?.bitmap.close();
  }

  detections(message: Record<string, unknown>): void {
    const item = fields<{ header: unknown; items: unknown }>(message["item"]);
    const header = fields<Header>(item.header);
    const found = list(item.items).map((one) => {
      const detection = fields<Detection>(one);
      return { ...detection, box: list(detection.box) as Detection["box"] };
    });
    const stream = message["stream"] as string;
    const picture = this.kept.find((one) => one.stamp === header.stamp);
    if (picture) {
      picture.found.set(stream, found);
      return;
    }
    const key = `${header.source} ${header.stamp}`;
    const waiting = this.early.get(key) ?? new Map<string, Detection[]>();
    this.early.set(key, waiting.set(stream, found));
    for (const old of [...this.early.keys()].slice(0, -KEPT)) this.early.delete(old);
  }

  /** The newest analysed picture, unless analyses lag far behind: then the newest one. */
  newest(camera: string): Picture | undefined {
    const own = this.kept.filter((one) => one.camera === camera);
    const last = own[own.length - 1];
    const analysed = own.filter((one) => one.found.size > 0);
    const best = analysed[analysed.length - 1];
    return best && last && last.stamp - best.stamp < BEHIND ? best : last;
  }
}

export function Video({ flight }: { flight: Flight }) {
  const streams = flight.mission.streams;
  const names = Object.keys(streams).sort();
  const cameras = names.filter((name) => streams[name] === "pictures");
  const [chosen, setChosen] = useState("");
  const camera = cameras.includes(chosen) ? chosen : (cameras[0] ?? "");
  const canvas = useRef<HTMLCanvasElement>(null);
  const [seen, setSeen] = useState<{ stamp: number; captured: number; boxes: number } | null>(null);
  const finders = names.filter((name) => streams[name] === "detections").join(",");

  useEffect(() => {
    if (!camera) return;
    // Of a recording, the picture of the moment is shown and no other one.
    const pictures = new Pictures(flight.recorded ? 1 : KEPT);
    let asked = false;
    const draw = () => {
      asked = false;
      const picture = pictures.newest(camera);
      if (!picture || !canvas.current) return;
      const boxes = paint(canvas.current, picture);
      setSeen({ stamp: picture.stamp, captured: picture.captured, boxes });
    };
    const later = () => {
      if (!asked) requestAnimationFrame(draw);
      asked = true;
    };
    return flight.source.watch(camera, finders.split(","), {
      found: (message) => {
        pictures.detections(message);
        later();
      },
      picture: (message, data) => pictures.frame(message, data).then(later),
      nothing: () => setSeen(null),
    });
  }, [camera, finders, flight]);

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
        />
        {!seen && (
          <p class="empty">
            {cameras.length ? "No picture yet" : "This flight shows no camera"}
          </p>
        )}
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

const COLOURS = ["#ffb000", "#00c2a8", "#ff5d8f", "#6aa8ff", "#c6e03a", "#d58bff"];

/** Draw a picture with what was found in it; returns the number of boxes. */
function paint(canvas: HTMLCanvasElement, picture: Picture): number {
  const { width, height } = picture.bitmap;
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width;
    canvas.height = height;
  }
  const pen = canvas.getContext("2d");
  if (!pen) return 0;
  pen.drawImage(picture.bitmap, 0, 0);
  const size = Math.max(11, Math.round(width / 45));
  pen.font = `600 ${size}px system-ui, sans-serif`;
  pen.lineWidth = Math.max(2, width / 320);
  let boxes = 0;
  for (const found of picture.found.values()) {
    for (const one of found) {
      boxes += 1;
      const [left, top, right, bottom] = one.box;
      const colour = COLOURS[(one.track_id ?? one.label.length) % COLOURS.length] ?? "#ffb000";
      pen.strokeStyle = colour;
      pen.strokeRect(left, top, right - left, bottom - top);
      const track = one.track_id === null ? "" : ` #${one.track_id}`;
      const text = `${one.label}${track} ${Math.round(100 * one.score)} %`;
      const wide = pen.measureText(text).width + 8;
      const above = top >= size + 6 ? top - size - 6 : top;
      pen.fillStyle = colour;
      pen.fillRect(left, above, wide, size + 6);
      pen.fillStyle = "#10151c";
      pen.fillText(text, left + 4, above + size + 1);
    }
  }
  return boxes;
}
