// Pictures of a video in H.264, decoded by the browser where it can (WebCodecs).

import { readFragment } from "./connection";

/** Pictures that may wait for the decoder; more, and the rest until a key frame is left out. */
const WAITING = 12;
/** What each server sends, for the question whether it can be decoded: H.264, baseline, level 4. */
const ASKED = "avc1.42C028";
const PARAMETERS = 7;

/**
 * How pictures are asked for: H.264 takes a tenth of JPEG's bytes, but more of the drone's processor,
 * so not from this machine itself. The address' word `pictures` asks for one of them.
 */
export async function pictureForm(): Promise<"h264" | "jpeg"> {
  const local = ["localhost", "127.0.0.1", "[::1]"].includes(location.hostname);
  const word = readFragment("pictures") ?? (local ? "jpeg" : "h264");
  // A page that is neither local nor HTTPS may not decode.
  if (word !== "h264" || typeof VideoDecoder === "undefined") return "jpeg";
  const support = await VideoDecoder.isConfigSupported({ codec: ASKED }).catch(() => null);
  return support?.supported ? "h264" : "jpeg";
}

/** The name of a key frame's codec, by its sequence parameter set; empty without one. */
function codecOf(data: Uint8Array): string {
  for (let at = 0; at + 6 < data.length; at += 1) {
    if (data[at] !== 0 || data[at + 1] !== 0 || data[at + 2] !== 1) continue;
    if (((data[at + 3] ?? 0) & 0x1f) !== PARAMETERS) continue;
    const name = [...data.slice(at + 4, at + 7)].map((one) => one.toString(16).padStart(2, "0"));
    return `avc1.${name.join("").toUpperCase()}`;
  }
  return "";
}

/** Decoder of one camera's video. */
export class VideoDecoding {
  private decoder: VideoDecoder | undefined;
  private codec = "";
  private count = 0;
  /** Who waits for a picture, by its number. */
  private readonly waiting = new Map<number, (bitmap: ImageBitmap | undefined) => void>();

  /** The picture of the next part of the video; undefined where it cannot be shown. */
  async decoded(data: Uint8Array, key: boolean): Promise<ImageBitmap | undefined> {
    if (key) this.configure(codecOf(data));
    const { decoder } = this;
    if (!decoder || decoder.state !== "configured") return undefined;
    if (!key && decoder.decodeQueueSize > WAITING) {
      this.close();
      return undefined;
    }
    const number = (this.count += 1);
    return new Promise((done) => {
      this.waiting.set(number, done);
      decoder.decode(new EncodedVideoChunk({ type: key ? "key" : "delta", timestamp: number, data }));
    });
  }

  close(): void {
    if (this.decoder && this.decoder.state !== "closed") this.decoder.close();
    this.decoder = undefined;
    for (const done of this.waiting.values()) done(undefined);
    this.waiting.clear();
  }

  private configure(codec: string): void {
    if (this.decoder && this.decoder.state === "configured" && this.codec === codec) return;
    this.close();
    this.codec = codec;
    this.decoder = new VideoDecoder({
      output: (frame) => void this.show(frame),
      // The next key frame begins anew.
      error: () => this.close(),
    });
    this.decoder.configure({ codec, optimizeForLatency: true });
  }

  /** A copy is handed on: a decoder has few frames of its own, and waits for them. */
  private async show(frame: VideoFrame): Promise<void> {
    const done = this.waiting.get(frame.timestamp);
    this.waiting.delete(frame.timestamp);
    const bitmap = await createImageBitmap(frame).catch(() => undefined);
    frame.close();
    done?.(bitmap);
  }
}
