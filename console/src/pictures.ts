// Pictures of a camera with what was found in each: boxes belong to the frame they were made from.

import { type Depth, coloured } from "./depth";
import { VideoDecoding } from "./video_decoder";
import type { Detection, FollowedTarget, ItemMessage, PictureItem } from "./wire";

type Header = PictureItem["header"];

/** Pictures that are kept while what is found in them is under way. */
export const KEPT = 16;
/** Mission nanoseconds by which an analysed picture may be older than the newest one. */
const BEHIND = 1.5e9;
/** And one with more analyses in it than the newest analysed one. */
const PATIENCE = 0.4e9;

export interface Picture {
  bitmap: ImageBitmap;
  source: string;
  stamp: number;
  captured: number;
  camera: string;
  found: Map<string, Detection[]>;
  target: FollowedTarget | undefined;
  /** Whether the camera measured depth with it. */
  measured: boolean;
  depth: Depth | undefined;
}

/** What came before its picture. */
interface Early {
  found: Map<string, Detection[]>;
  target: FollowedTarget | undefined;
  depth: Depth | undefined;
}

export class Pictures {
  private kept: Picture[] = [];
  private early = new Map<string, Early>();
  private readonly video = new VideoDecoding();
  /** Stamp of the picture that was shown last: none before it comes back. */
  private shown = 0;

  constructor(
    private readonly most: number,
    /** Whether the depth is shown. */
    private readonly deep: boolean,
  ) {}

  close(): void {
    this.video.close();
    for (const one of this.kept.splice(0)) one.bitmap.close();
  }

  /** Add a picture, its depth, or what was found or is followed in it. */
  async add(message: ItemMessage, data: ArrayBuffer | null): Promise<void> {
    const { item, stream } = message;
    if (item.is === "Detections") this.of(item.of.header).found.set(stream, item.of.items);
    if (item.is === "Target") this.of(item.header).target = item.of;
    if (!data || !("bytes" in item)) return;
    const bytes = new Uint8Array(data, 0, item.bytes[0]);
    if (item.is === "Depth") {
      const depth = await coloured(new Blob([bytes], { type: "image/png" }), item.range);
      this.of(item.header).depth = depth;
      return;
    }
    const { header } = item;
    const bitmap =
      item.format === "h264"
        ? await this.video.decoded(bytes, message.key)
        : await createImageBitmap(new Blob([bytes], { type: "image/jpeg" }));
    if (!bitmap) return;
    // The same frame comes again where a recording's moments share it.
    const { found, target, depth } = this.of(header);
    this.early.delete(nameOf(header));
    this.kept.push({
      ...{ bitmap, found, target, depth, source: header.source, stamp: header.stamp },
      measured: item.depth,
      captured: message.captured,
      camera: stream,
    });
    // Of a live flight, several are decoded at a time.
    if (this.most > 1) this.kept.sort((one, other) => one.stamp - other.stamp);
    while (this.kept.length > this.most) this.kept.shift()?.bitmap.close();
  }

  /**
   * The newest analysed picture, or one shortly before it in which more analyses found something;
   * the newest of all, where analyses lag far behind. Depth counts as one of them.
   */
  newest(camera: string): Picture | undefined {
    const own = this.kept.filter((one) => one.camera === camera);
    const last = own[own.length - 1];
    const known = ({ found, target, depth }: Picture) =>
      found.size + (target ? 1 : 0) + (this.deep && depth ? 1 : 0);
    const analysed = own.filter((one) => known(one) > 0);
    const newest = analysed[analysed.length - 1];
    let best = newest && last && last.stamp - newest.stamp < BEHIND ? newest : last;
    const from = Math.max(this.most > 1 ? this.shown : 0, (best?.stamp ?? 0) - PATIENCE);
    for (const one of analysed.reverse()) {
      if (best && one.stamp >= from && known(one) > known(best)) best = one;
    }
    this.shown = best?.stamp ?? 0;
    return best;
  }

  /** The picture of a frame, or what waits for it. */
  private of(header: Header): Early {
    const key = nameOf(header);
    const picture = this.kept.find((one) => nameOf(one) === key);
    if (picture) return picture;
    const waiting = this.early.get(key) ?? { found: new Map(), target: undefined, depth: undefined };
    this.early.set(key, waiting);
    for (const old of [...this.early.keys()].slice(0, -KEPT)) this.early.delete(old);
    return waiting;
  }
}

function nameOf({ source, stamp }: Pick<Picture, "source" | "stamp">): string {
  return `${source} ${stamp}`;
}
