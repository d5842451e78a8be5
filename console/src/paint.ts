// What was found in a picture, drawn on it: depth, boxes, labels and the skeletons of bodies.

import type { Picture } from "./pictures";
import type { Detection, FollowedTarget } from "./wire";

const COLOURS = ["#ffb000", "#00c2a8", "#ff5d8f", "#6aa8ff", "#c6e03a", "#d58bff"];
const SHADOW = "#10151c";
/** Least confidence of a keypoint that is drawn, as in recordings. */
const VISIBLE = 0.3;
/** Pixels between the edges of two boxes that are one. */
const SAME = 1;
/** Points of a body, in COCO's order. */
const BODY = 17;
/** Pairs of a body's points that it connects: limbs, then trunk and neck. */
const BONES = [
  ...[[5, 7], [7, 9], [6, 8], [8, 10], [11, 13], [13, 15], [12, 14], [14, 16]],
  ...[[5, 6], [11, 12], [5, 11], [6, 12], [0, 5], [0, 6]],
] as const;

type Box = NonNullable<FollowedTarget["box"]>;
type Found = Omit<Detection, "box" | "score"> & { box: Box; score: number };

/** Whether a detection's place and score are known. */
function isKnown(one: Detection): one is Found {
  return one.score !== null && !one.box.includes(null);
}

export interface Painted {
  boxes: number;
  /** Points of bodies. */
  points: number;
}

/** Draw a picture with what was found in it; returns what was drawn. */
export function paint(canvas: HTMLCanvasElement, picture: Picture): Painted {
  const { width, height } = picture.bitmap;
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width;
    canvas.height = height;
  }
  const painted = { boxes: 0, points: 0 };
  const pen = canvas.getContext("2d");
  if (!pen) return painted;
  pen.drawImage(picture.bitmap, 0, 0);
  if (picture.depth) {
    pen.imageSmoothingEnabled = false;
    pen.drawImage(picture.depth.bitmap, 0, 0, width, height);
    pen.imageSmoothingEnabled = true;
  }
  const all = once([...picture.found.values()].flat().filter(isKnown));
  // Labels lie over all bodies.
  for (const one of all) painted.points += drawBody(pen, one, width);
  for (const one of all) drawBox(pen, one, width);
  if (picture.target?.box) drawTarget(pen, picture.target, picture.target.box, width, height);
  painted.boxes = all.length;
  return painted;
}

/** Without the nameless boxes that a tracker has, too. */
function once(found: Found[]): Found[] {
  const tracked = found.filter((one) => one.track_id !== null);
  return found.filter(
    (one) =>
      one.track_id !== null || one.keypoints?.length || !tracked.some((other) => same(one, other)),
  );
}

function same(one: Found, other: Found): boolean {
  const close = one.box.every((edge, side) => Math.abs(edge - (other.box[side] ?? 0)) < SAME);
  return close && one.label === other.label;
}

const MARKS: Record<FollowedTarget["state"], string> = {
  sure: "followed",
  likely: "followed?",
  uncertain: "",
  unseen: "",
};

/** Draw corners around what is followed, dashed where that is not sure, and the word below it. */
function drawTarget(
  pen: CanvasRenderingContext2D,
  { state }: FollowedTarget,
  box: Box,
  width: number,
  height: number,
): void {
  const thick = Math.max(3, width / 200);
  const gap = 1.5 * thick;
  const [left, right] = [Math.max(thick, box[0] - gap), Math.min(width - thick, box[2] + gap)];
  const [top, bottom] = [Math.max(thick, box[1] - gap), Math.min(height - thick, box[3] + gap)];
  const arm = Math.max(3 * thick, 0.25 * Math.min(right - left, bottom - top));
  const corners = new Path2D();
  for (const [x, inwards] of [[left, arm], [right, -arm]] as const) {
    for (const [y, down] of [[top, arm], [bottom, -arm]] as const) {
      corners.moveTo(x + inwards, y);
      corners.lineTo(x, y);
      corners.lineTo(x, y + down);
    }
  }
  pen.save();
  for (const [colour, wide] of [[SHADOW, 2 * thick], ["#ffffff", thick]] as const) {
    pen.strokeStyle = colour;
    pen.lineWidth = wide;
    if (state === "likely") pen.setLineDash([1.2 * thick, 1.2 * thick]);
    pen.stroke(corners);
  }
  pen.restore();
  const size = Math.max(11, Math.round(width / 45));
  pen.font = `700 ${size}px system-ui, sans-serif`;
  const text = `◎ ${MARKS[state]}`;
  const wide = pen.measureText(text).width + 8;
  const below = Math.min(bottom + 1.5 * thick, height - size - 6);
  const from = Math.max(0, Math.min((left + right - wide) / 2, width - wide));
  pen.fillStyle = SHADOW;
  pen.fillRect(from, below, wide, size + 6);
  pen.fillStyle = "#ffffff";
  pen.fillText(text, from + 4, below + size + 1);
}

export function colourOf(one: Detection): string {
  return COLOURS[(one.track_id ?? one.label.length) % COLOURS.length] ?? "#ffb000";
}

function drawBox(pen: CanvasRenderingContext2D, one: Found, width: number): void {
  const size = Math.max(11, Math.round(width / 45));
  pen.font = `600 ${size}px system-ui, sans-serif`;
  pen.lineWidth = Math.max(2, width / 320);
  const [left, top, right, bottom] = one.box;
  const colour = colourOf(one);
  pen.strokeStyle = colour;
  pen.strokeRect(left, top, right - left, bottom - top);
  const track = one.track_id === null ? "" : ` #${one.track_id}`;
  const text = `${one.label}${track} ${Math.round(100 * one.score)} %`;
  const wide = pen.measureText(text).width + 8;
  const above = top >= size + 6 ? top - size - 6 : top;
  pen.fillStyle = colour;
  pen.fillRect(left, above, wide, size + 6);
  pen.fillStyle = SHADOW;
  pen.fillText(text, left + 4, above + size + 1);
}

/** Draw the keypoints that are seen, and a body's bones between them; returns how many points. */
function drawBody(pen: CanvasRenderingContext2D, one: Found, width: number): number {
  // A model that does not know a point gives null.
  const points = (one.keypoints ?? []).map(([u, v, sure]) => [u ?? NaN, v ?? NaN, sure ?? 0] as const);
  const seen = points.map(([u, v, sure]) => sure >= VISIBLE && Number.isFinite(u + v));
  // A body far away is a few pixels wide.
  const thick = Math.min(Math.max(2, width / 320), Math.max(1, (one.box[3] - one.box[1]) / 40));
  const bones = new Path2D();
  if (points.length === BODY) {
    for (const [from, to] of BONES) {
      const [first, last] = [points[from], points[to]];
      if (!first || !last || !seen[from] || !seen[to]) continue;
      bones.moveTo(first[0], first[1]);
      bones.lineTo(last[0], last[1]);
    }
  }
  const joints = new Path2D();
  points.forEach(([u, v], place) => {
    if (!seen[place]) return;
    joints.moveTo(u + 1.6 * thick, v);
    joints.arc(u, v, 1.6 * thick, 0, 2 * Math.PI);
  });
  pen.lineCap = "round";
  pen.strokeStyle = SHADOW;
  pen.lineWidth = 2.2 * thick;
  pen.stroke(bones);
  pen.lineWidth = 1.2 * thick;
  pen.stroke(joints);
  pen.strokeStyle = pen.fillStyle = colourOf(one);
  pen.lineWidth = 1.2 * thick;
  pen.stroke(bones);
  pen.fill(joints);
  pen.lineCap = "butt";
  return seen.filter(Boolean).length;
}
