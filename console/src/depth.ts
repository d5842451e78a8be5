// Depth as an overlay: the server's grey values in colours, near ones warm.

/** What was measured with a picture. */
export interface Depth {
  bitmap: ImageBitmap;
  /** Metres at which the colours end. */
  range: number;
}

/** Red, green and blue from near to far: the ends and six places between them. */
const ANCHORS = [
  [190, 20, 30],
  [246, 96, 26],
  [252, 190, 46],
  [196, 236, 70],
  [70, 216, 150],
  [38, 160, 226],
  [58, 84, 196],
  [48, 18, 90],
] as const;
/** Of what lies over the picture. */
const OPAQUE = 165;
const SHADES = 255;

/** Red, green and blue of each grey value; 0 is what was not measured. */
const COLOURS: readonly (readonly [number, number, number])[] = Array.from(
  { length: SHADES + 1 },
  (_, grey) => {
    const place = (Math.max(0, grey - 1) / (SHADES - 1)) * (ANCHORS.length - 1);
    const first = Math.min(ANCHORS.length - 2, Math.floor(place));
    const [from, to] = [ANCHORS[first], ANCHORS[first + 1]] as const;
    const mixed = (one: 0 | 1 | 2) =>
      Math.round((from?.[one] ?? 0) + ((to?.[one] ?? 0) - (from?.[one] ?? 0)) * (place - first));
    return [mixed(0), mixed(1), mixed(2)] as const;
  },
);

/** The depth in a grey PNG, coloured; what was not measured is left clear. */
export async function coloured(png: Blob, range: number): Promise<Depth> {
  // Neither premultiplied nor matched to a screen: a grey value is a number.
  const grey = await createImageBitmap(png, {
    colorSpaceConversion: "none",
    premultiplyAlpha: "none",
  });
  const sheet = new OffscreenCanvas(grey.width, grey.height);
  const pen = sheet.getContext("2d", { willReadFrequently: true });
  if (!pen) return { bitmap: grey, range };
  pen.drawImage(grey, 0, 0);
  grey.close();
  const pixels = pen.getImageData(0, 0, sheet.width, sheet.height);
  const { data } = pixels;
  for (let at = 0; at < data.length; at += 4) {
    const value = data[at] ?? 0;
    const [red, green, blue] = COLOURS[value] ?? [0, 0, 0];
    data[at] = red;
    data[at + 1] = green;
    data[at + 2] = blue;
    data[at + 3] = value === 0 ? 0 : OPAQUE;
  }
  pen.putImageData(pixels, 0, 0);
  return { bitmap: sheet.transferToImageBitmap(), range };
}

/** Draw the scale into a canvas, near on its left. */
export function drawScale(canvas: HTMLCanvasElement): void {
  canvas.width = SHADES;
  canvas.height = 1;
  const pen = canvas.getContext("2d");
  COLOURS.slice(1).forEach(([red, green, blue], place) => {
    if (!pen) return;
    pen.fillStyle = `rgb(${red} ${green} ${blue})`;
    pen.fillRect(place, 0, 1, 1);
  });
}
